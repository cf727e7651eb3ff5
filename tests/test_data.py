"""Fetching a database: whole or not at all, checked. A local server stands for the publisher's."""

from __future__ import annotations

import io
import json
import stat
import threading
import zipfile
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from bemt.app import cli
from bemt.base import cache, given
from bemt.base.errors import InputError
from bemt.data.recordings import database as data
from bemt.data.recordings import database as data_archive

GEOM = "r/R c/R beta\n0.15 0.11 30.0\n0.50 0.16 20.0\n0.75 0.13 13.0\n1.00 0.05 8.0\n"
STATIC = "RPM CT CP\n3000 0.095 0.040\n4000 0.096 0.041\n"
FILES = {  # the layout of the public archive as far as known
    "UIUC-propDB/volume-1/data/test_10x5_geom.txt": GEOM,
    "UIUC-propDB/volume-1/data/test_10x5_static_kt0001.txt": STATIC,
    "UIUC-propDB/volume-2/data/test_5x3_static_kt0002.txt": STATIC,
    "UIUC-propDB/README.txt": "words\n",
}


def damaged(method: int) -> bytes:
    """Archive whose compressed bytes are no stream of their method."""
    page = io.BytesIO()
    with zipfile.ZipFile(page, "w", method) as archive:
        archive.writestr("a.txt", "words " * 500)
    data = bytearray(page.getvalue())
    data[45:51] = bytes(b ^ 0xFF for b in data[45:51])
    return bytes(data)


def misnamed() -> bytes:
    """Archive that says of a file name that it is UTF-8 where it is not."""
    data = bytearray(zipped({"a.txt": "words"}).replace(b"a.txt", b"\xff\xfe.tx"))
    data[7] |= 0x08
    data[data.find(b"PK\x01\x02") + 9] |= 0x08
    return bytes(data)


def zipped(files: dict[str, str | bytes], filler: int = 0) -> bytes:
    page = io.BytesIO()
    with zipfile.ZipFile(page, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
        if filler:
            archive.writestr("UIUC-propDB/filler.bin", bytes(range(256)) * (filler // 256))
    return page.getvalue()


class Server(ThreadingHTTPServer):
    """Serves one body; may break off after `cut` bytes; counts how often it was asked."""

    body = b""
    cut: int | None = None
    asked = 0


class Handler(BaseHTTPRequestHandler):
    server: Server

    def do_GET(self) -> None:
        s = self.server
        s.asked += 1
        if self.path != "/UIUC-propDB.zip":
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Length", str(len(s.body)))
        self.end_headers()
        self.wfile.write(s.body[: s.cut])

    def log_message(self, *args: object) -> None:
        pass


@pytest.fixture
def server() -> Iterator[Server]:
    s = Server(("127.0.0.1", 0), Handler)
    s.body = zipped(FILES)
    thread = threading.Thread(target=s.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield s
    s.shutdown()
    thread.join()
    s.server_close()


def url(server: Server) -> str:
    return f"http://127.0.0.1:{server.server_port}/UIUC-propDB.zip"


@pytest.fixture
def no_cache_but(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("BEMT_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("BEMT_DATA", str(tmp_path / "nothing"))
    return tmp_path / "cache"


def left(folder: Path) -> set[str]:
    return {p.name for p in folder.iterdir()} if folder.is_dir() else set()


def test_fetched_data_are_found_by_every_reader(server, no_cache_but, capsys):
    assert given.find_data("uiuc") is None
    assert cli.main(["fetch", "uiuc", "--url", url(server), "--json"]) == 0
    doc = json.loads(capsys.readouterr().out)
    folder = no_cache_but / "data" / "uiuc"
    assert doc["schema"] == "bemt.data/1" and doc["propellers"] == 2 and doc["files"] == 4
    assert (doc["checksum"], doc["fetched"], doc["folder"]) == ("first use", True, str(folder))
    assert (folder / "volume-1" / "data" / "test_10x5_geom.txt").read_text() == GEOM  # the one top folder is left off
    assert given.find_data("uiuc") == folder and left(no_cache_but / "data") == {"uiuc"}
    assert cli.main(["calibrate", "--quiet"]) == 0  # reads the fetched data when no file is named


def test_a_named_folder_comes_before_the_cache(server, no_cache_but, tmp_path, monkeypatch):
    data.get("uiuc", no_cache_but / "data" / "uiuc", url=url(server))
    mine = tmp_path / "mine"
    (mine / "uiuc").mkdir(parents=True)
    monkeypatch.setenv("BEMT_DATA", str(mine))
    assert given.find_data("uiuc") == mine / "uiuc"
    monkeypatch.setenv("BEMT_CACHE", "off")
    (mine / "uiuc").rmdir()
    assert given.find_data("uiuc") is None


def test_what_is_there_is_not_fetched_again(server, tmp_path):
    first = data.get("uiuc", tmp_path / "uiuc", url=url(server))
    again = data.get("uiuc", tmp_path / "uiuc", url=url(server))
    assert server.asked == 1 and again.sha256 == first.sha256
    assert (again.checksum, again.fetched) == ("as recorded", False)


def files_in(folder: Path) -> dict[Path, bytes]:
    return {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_another_archive_than_the_one_that_is_there_is_refused(server, tmp_path):
    data.get("uiuc", tmp_path / "uiuc", url=url(server))
    before = files_in(tmp_path / "uiuc")
    archive = tmp_path / "a.zip"
    archive.write_bytes(zipped(FILES | {"UIUC-propDB/volume-1/data/new_9x5_static_kt0009.txt": STATIC}))
    with pytest.raises(InputError, match=r"data of another archive; expected a new folder\. Delete the folder"):
        data.get("uiuc", tmp_path / "uiuc", archive)
    assert files_in(tmp_path / "uiuc") == before
    assert left(tmp_path) == {"uiuc", "a.zip"}


def test_an_interrupted_download_leaves_nothing_and_the_next_one_is_whole(server, tmp_path):
    server.body = zipped(FILES, filler=400_000)
    server.cut = 150_000
    with pytest.raises(InputError):
        data.get("uiuc", tmp_path / "uiuc", url=url(server))
    assert left(tmp_path) == set()
    server.cut = None
    doc = data.get("uiuc", tmp_path / "uiuc", url=url(server))
    assert doc.bytes == len(server.body) and left(tmp_path) == {"uiuc"}


def test_an_address_that_does_not_answer_is_an_input_error(server, tmp_path, capsys):
    where = url(server).replace("UIUC-propDB", "elsewhere")
    assert cli.main(["fetch", "uiuc", "--out", str(tmp_path / "uiuc"), "--url", where]) == 2
    error = capsys.readouterr().err
    assert "404" in error and "--source FILE.zip" in error and "Traceback" not in error
    assert not (tmp_path / "uiuc").exists()


def test_too_much_is_refused(server, tmp_path, monkeypatch):
    monkeypatch.setattr(data_archive, "MAX_ARCHIVE", 100)
    with pytest.raises(InputError, match="at most 100 bytes"):
        data.get("uiuc", tmp_path / "uiuc", url=url(server))
    monkeypatch.setattr(data_archive, "MAX_ARCHIVE", 10**9)
    monkeypatch.setattr(data_archive, "MAX_UNPACKED", 10)
    with pytest.raises(InputError, match="bytes unpacked"):
        data.get("uiuc", tmp_path / "uiuc", url=url(server))
    assert left(tmp_path) == set()


def test_a_local_archive(tmp_path, capsys):
    archive = tmp_path / "mine.zip"
    archive.write_bytes(zipped(FILES))
    assert cli.main(["fetch", "uiuc", "--source", str(archive), "--out", str(tmp_path / "uiuc")]) == 0
    out = capsys.readouterr().out
    assert "2 propellers, 4 files" in out and "first use" in out and "please cite" in out
    assert archive.exists() and left(tmp_path) == {"mine.zip", "uiuc"}
    assert data.get("uiuc", tmp_path / "uiuc", archive).checksum == "as recorded"


def link() -> bytes:
    page = io.BytesIO(zipped(FILES))
    with zipfile.ZipFile(page, "a") as archive:
        info = zipfile.ZipInfo("UIUC-propDB/link.txt")
        info.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(info, "/etc/hostname")
    return page.getvalue()


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (zipped(FILES | {"UIUC-propDB/../../evil.txt": "x"}), "a path that leaves the folder"),
        (zipped(FILES | {"/evil.txt": "x"}), "a path that leaves the folder"),
        (zipped(FILES | {"C:/evil.txt": "x"}), "a path that leaves the folder"),
        (zipped(FILES | {"a\\..\\evil.txt": "x"}), "a path that leaves the folder"),
        (link(), "a link"),
        (zipped(FILES | {"UIUC-propDB/readme.txt": "x"}), "a second file of this name"),
        (zipped({"notes/a.txt": "words"}), "no propeller"),
        (b"no zip at all", "a sound zip archive"),
        (zipped(FILES)[:-40], "a sound zip archive"),
        (zipped(FILES).replace(b"0.095 0.040", b"0.095 0.099"), "a sound zip archive"),  # CRC
        (damaged(zipfile.ZIP_DEFLATED), "a sound zip archive"),
        (damaged(zipfile.ZIP_LZMA), "a sound zip archive"),
        (damaged(zipfile.ZIP_BZIP2), "a sound zip archive"),
        (misnamed(), "a sound zip archive"),
    ],
)
def test_an_unsound_archive_changes_nothing(tmp_path, body, words):
    archive = tmp_path / "in" / "bad.zip"
    archive.parent.mkdir()
    archive.write_bytes(body)
    out = tmp_path / "out" / "uiuc"
    for there in (False, True):  # into nothing, and into a folder that is there
        if there:
            out.mkdir()
        with pytest.raises(InputError, match=words):
            data.get("uiuc", out, archive)
        assert left(out.parent) == ({"uiuc"} if there else set()) and not left(out)
    good = tmp_path / "in" / "good.zip"
    good.write_bytes(zipped(FILES))
    data.get("uiuc", out, good)
    before = files_in(out)
    with pytest.raises(InputError, match="data of another archive"):
        data.get("uiuc", out, archive)
    assert files_in(out) == before and (out / "volume-1" / "data" / "test_10x5_geom.txt").read_text() == GEOM
    assert not list(tmp_path.rglob("evil*"))


def test_a_folder_with_other_files_is_left_alone(tmp_path):
    archive = tmp_path / "a.zip"
    archive.write_bytes(zipped(FILES))
    (tmp_path / "uiuc").mkdir()
    (tmp_path / "uiuc" / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="did not put there"):
        data.get("uiuc", tmp_path / "uiuc", archive)
    assert left(tmp_path / "uiuc") == {"thesis.txt"}


def test_what_the_user_added_or_changed_is_not_deleted(server, tmp_path):
    archive, folder = tmp_path / "a.zip", tmp_path / "uiuc"
    archive.write_bytes(zipped(FILES))
    data.get("uiuc", folder, archive)
    (folder / "notes.txt").write_text("days of work")
    (folder / "volume-1" / "data" / "test_10x5_geom.txt").write_text(GEOM + "\n")  # corrected by hand
    before = files_in(folder)
    for how in ({"source": archive}, {"url": url(server)}, {}):
        assert data.get("uiuc", folder, **how).checksum == "as recorded"
    archive.write_bytes(zipped(FILES | {"UIUC-propDB/b.txt": "x"}))
    with pytest.raises(InputError, match="--out"):
        data.get("uiuc", folder, archive)
    assert not server.asked and files_in(folder) == before and left(tmp_path) == {"a.zip", "uiuc"}


def test_a_mirror_beside_a_local_archive_is_refused(tmp_path, capsys):
    archive = tmp_path / "a.zip"
    archive.write_bytes(zipped(FILES))
    words = ["fetch", "uiuc", "--source", str(archive), "--url", "http://localhost/a.zip", "--out", str(tmp_path / "d")]
    assert cli.main(words) == 2
    assert "--url: got http://localhost/a.zip; expected none with --source" in capsys.readouterr().err
    assert left(tmp_path) == {"a.zip"}


def test_without_a_cache_a_folder_must_be_named(monkeypatch, capsys):
    monkeypatch.setenv("BEMT_CACHE", "off")
    assert cache.cache_dir() is None
    assert cli.main(["fetch", "uiuc"]) == 2
    assert "--out DIR" in capsys.readouterr().err
