"""A public database of measured propellers into the user's cache.

The publisher gives no hash, so the first archive is trusted and its SHA-256 is written beside the data
(``.bemt-data.json``). A folder that holds anything is never written to: to have the data anew, delete it. The data stay
the publisher's: cite them as they ask. Never run against the publisher's server in the tests, which use a local one.

Schema ``bemt.data/1``: ``kind``, ``folder``, ``url`` (or ``archive``), ``sha256``, ``bytes``, ``files``,
``propellers``, ``refused``, ``checksum`` (``first use``, ``as recorded``), ``fetched``.
"""

from __future__ import annotations

import json
import lzma
import os
import shutil
import stat
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

from bemt.base.cache import cache_dir
from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError
from bemt.base.packed import MAX_BYTES
from bemt.base.tables import file_hash, json_text, number_of

# Archives from elsewhere: fetched whole, checked before anything is unpacked, put in place in one step.

MAX_ARCHIVE = 500_000_000
"""Bytes that an archive may have."""
MAX_UNPACKED = MAX_BYTES
"""Bytes that its files may have together."""
MAX_FILES = 50_000
"""Files that it may hold."""
_BLOCK = 1 << 16

Progress = Callable[[int, int], None]


def _limit(url: str, size: int) -> None:
    if size > MAX_ARCHIVE:
        raise InputError(Fault(url, "", f"{size} bytes", f"at most {MAX_ARCHIVE} bytes", "Is this the archive?"))


def _get(url: str, target: Path, progress: Progress | None) -> None:
    """Fetch a file, whole and of no more bytes than an archive may have."""
    import requests

    try:
        with requests.get(url, headers={"Accept-Encoding": "identity"}, stream=True, timeout=(20, 60)) as answer:
            answer.raise_for_status()
            length, have = answer.headers.get("Content-Length", ""), 0
            total = int(length) if length.isdigit() else 0
            _limit(url, total)
            with target.open("wb") as stream:
                for block in answer.iter_content(_BLOCK):
                    stream.write(block)
                    have += len(block)
                    _limit(url, have)
                    if progress is not None:
                        progress(have, total)
    except requests.RequestException as error:
        got = str(error).split("(Caused")[0].strip()[:200] or type(error).__name__
        hint = "Download it manually and give it with --source FILE.zip"
        raise InputError(Fault(url, "", got, "an archive to fetch", hint)) from error
    except OSError as error:
        raise InputError(Fault(os.fspath(target), "", str(error), "room and permission to write")) from error
    if total and have != total:
        raise InputError(Fault(url, "", f"{have} of {total} bytes", "the whole file", "Run the command again"))


def _unsafe(info: zipfile.ZipInfo) -> tuple[str, str] | None:
    """What must not be unpacked of an archive, and what would do."""
    path = PurePosixPath(info.filename)
    if "\\" in info.filename or path.is_absolute() or ".." in path.parts or any(":" in part for part in path.parts):
        return "a path that leaves the folder", "a relative path"
    if stat.S_ISLNK(info.external_attr >> 16):
        return "a link", "files only"
    return ("an encrypted file", "plain files") if info.flag_bits & 0x1 else None


def _members(archive: zipfile.ZipFile, name: str) -> list[tuple[zipfile.ZipInfo, PurePosixPath]]:
    """Files of an archive with the places they may take; all faults at once."""
    faults: list[Fault] = []
    found: list[tuple[zipfile.ZipInfo, PurePosixPath]] = []
    seen: set[str] = set()
    infos = archive.infolist()
    if len(infos) > MAX_FILES:
        raise InputError(Fault(name, "", number_of(len(infos), "file"), f"at most {MAX_FILES}", "Is this the archive?"))
    for info in infos:
        path = PurePosixPath(info.filename)
        parts = path.parts
        if unsafe := _unsafe(info):
            faults.append(Fault(name, info.filename, *unsafe))
        elif not info.is_dir() and "__MACOSX" not in parts and not any(part.startswith(".") for part in parts):
            if str(path).lower() in seen:
                faults.append(Fault(name, info.filename, "a second file of this name", "one"))
            seen.add(str(path).lower())
            found.append((info, path))
    total = sum(info.file_size for info, _ in found)
    if total > MAX_UNPACKED:
        faults.append(Fault(name, "", f"{total} bytes unpacked", f"at most {MAX_UNPACKED}", "Is this the archive?"))
    if faults:
        raise InputError(faults[:20])
    tops = {path.parts[0] for _, path in found}
    alone = len(tops) == 1 and all(len(path.parts) > 1 for _, path in found)
    if alone and not min(tops).startswith("volume"):  # UIUC-propDB/volume-1/... -> volume-1/...
        found = [(info, PurePosixPath(*path.parts[1:])) for info, path in found]
    return found


@contextmanager
def unpacked(archive: Path, folder: Path) -> Iterator[Path]:
    """Unpack beside a folder that is empty or not there, for a look; put in its place when the block ends well."""
    name = os.fspath(archive)
    fresh = folder.with_name(f".{folder.name}.{os.getpid()}.tmp")
    shutil.rmtree(fresh, ignore_errors=True)
    try:
        try:
            with zipfile.ZipFile(archive) as source:
                for info, path in _members(source, name):
                    place = fresh / path
                    place.parent.mkdir(parents=True, exist_ok=True)
                    with source.open(info) as stream, place.open("wb") as out:
                        shutil.copyfileobj(stream, out)
        except (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, UnicodeDecodeError, RuntimeError) as error:
            # RuntimeError: encrypted, or compressed in a way that zipfile does not know
            raise InputError(Fault(name, "", str(error) or "damaged data", "a sound zip archive")) from error
        except OSError as error:
            if error.errno is None:  # of bz2, not of the disk
                raise InputError(Fault(name, "", str(error), "a sound zip archive")) from error
            hint = "Is there a file where a folder should be, or no room?"
            raise InputError(Fault(name, "", error.strerror or str(error), "an archive to unpack", hint)) from error
        fresh.mkdir(parents=True, exist_ok=True)
        yield fresh
        if folder.exists():
            folder.rmdir()
        os.replace(fresh, folder)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


SCHEMA = "bemt.data/1"
RECORD = ".bemt-data.json"
URLS = {"uiuc": "https://m-selig.ae.illinois.edu/props/download/UIUC-propDB.zip"}
"""Public archive of each kind."""
CITE = {
    "uiuc": "J.B. Brandt, R.W. Deters, G.K. Ananda, O.D. Dantsker, M.S. Selig, UIUC Propeller Database, Vols 1-4, "
    "University of Illinois at Urbana-Champaign",
}
"""What the publisher asks to cite."""


class FetchedData(Documented):
    """A database in a folder: where it came from, what is in it, and what this run did."""

    sha256: str
    kind: str = ""
    folder: str = ""
    url: str | None = None
    archive: str | None = None
    bytes: int = 0
    files: int = 0
    propellers: int = 0
    refused: int = 0
    cite: str = ""
    checksum: str | None = None
    fetched: bool | None = None

    def document(self) -> dict[str, Any]:
        """Plain values, ``bemt.data/1``."""
        return {"schema": SCHEMA, "url": None, "archive": None, **super().document()}

    @property
    def text(self) -> str:
        """Where the data lie and where they came from."""
        first = self.checksum != "as recorded"
        said = "first use: the publisher gives no hash, so this one is trusted and recorded"
        lines = [
            f"{self.kind}: {self.propellers} propellers, {self.files} files in {self.folder}",
            f"from {self.url or self.archive}, {self.bytes} bytes",
            f"sha256 {self.sha256} ({said if first else 'as recorded at its first use'})",
        ]
        if self.refused:
            lines.append(f"{self.refused} faults in its files; bemt lab calibrate names them")
        return "\n".join([*lines, f"please cite: {self.cite}"])


def _record(folder: Path) -> FetchedData | None:
    """What an earlier run wrote beside the data; None when there is none."""
    try:
        return FetchedData.from_document(json.loads((folder / RECORD).read_text(encoding="utf-8")), lenient=True)
    except (OSError, ValueError, TypeError):
        return None


def get(
    kind: str, folder: Path, source: str | Path | None = None, url: str | None = None, progress: Progress | None = None
) -> FetchedData:
    """Put a database into a folder; one that is there already is only looked at."""
    from bemt.data.readers.uiuc import scan_folder

    if None not in (source, url):
        expected = "none with --source, which downloads nothing"
        raise InputError(Fault("", "--url", str(url), expected, "Give one of the two"))
    known = _record(folder)
    if known is None and folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        hint = "Name an empty or new folder with --out"
        raise InputError(Fault(os.fspath(folder), "", "files that this command did not put there", "no folder", hint))
    archive = folder.with_name(f".{folder.name}.zip") if source is None else Path(source)
    if source is not None and not archive.is_file():
        raise InputError(Fault(os.fspath(source), "", "no such file", "a zip archive", "Check the path"))
    if known is not None:
        if source is not None and file_hash(archive) != known.sha256:
            hint = "Delete the folder to have the data anew, or name another with --out"
            raise InputError(Fault(os.fspath(folder), "sha256", "data of another archive", "a new folder", hint))
        return replace(known, folder=os.fspath(folder), checksum="as recorded", fetched=False)
    folder.parent.mkdir(parents=True, exist_ok=True)
    address = url or URLS[kind]
    try:
        if source is None:
            _get(address, archive, progress)
        with unpacked(archive, folder) as fresh:
            scan = scan_folder(fresh)
            if not scan.propellers:
                expected = "tables such as volume-1/data/apce_10x5_geom.txt"
                raise InputError(Fault(os.fspath(archive), "", "no propeller", expected, "Is this the archive?"))
            files = sum(p.is_file() for p in fresh.rglob("*"))
            found = FetchedData(
                file_hash(archive), kind, os.fspath(folder), address if source is None else None,
                None if source is None else archive.name, archive.stat().st_size, files, len(scan.propellers),
                len(scan.faults), CITE[kind],
            )  # fmt: skip
            (fresh / RECORD).write_text(json_text(found.document()), encoding="utf-8")
    finally:
        if source is None:
            archive.unlink(missing_ok=True)
    return replace(found, checksum="first use", fetched=source is None)


def folder_of(kind: str, given: str | None) -> Path:
    """Folder as named, else that in the cache; without a cache one must be named."""
    cache = cache_dir()
    if given is None and cache is None:
        raise InputError(Fault("BEMT_CACHE", "", "switched off", "a cache folder, or --out DIR"))
    return Path(given) if given else Path(cache or ".") / "data" / kind
