"""What is packed is read as what it holds, within one limit, at every door; what is not read is one line."""

import gzip
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

import bemt
from bemt.base import packed
from bemt.base.errors import InputError
from bemt.data import readers
from bemt.data.recordings.load import import_file
from bemt.tools.flight.read import read_log

ROWS = [["RPM", "Thrust (N)", "Torque (Nm)"], *([3000 + k, 1.5 + 0.01 * k, 0.1 + 0.001 * k] for k in range(6))]


def text(rows: list[list[object]]) -> bytes:
    return "".join(",".join(map(str, row)) + "\n" for row in rows).encode()


def zipped(**files: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return out.getvalue()


def ods(rows: list[list[object]], far: str = "") -> bytes:
    """As LibreOffice writes it: rows and columns that are empty to the end of the sheet are repeated."""
    rest = '<table:table-cell table:number-columns-repeated="16381"/>'

    def cell(value: object) -> str:
        kind = "string" if isinstance(value, str) else f'float" office:value="{value}'
        return f'<table:table-cell office:value-type="{kind}"><text:p>{value}</text:p></table:table-cell>'

    body = "".join(f"<table:table-row>{''.join(map(cell, row))}{rest}</table:table-row>" for row in rows)
    end = f'<table:table-row table:number-rows-repeated="1048000">{rest}</table:table-row>{far}'
    spaces = " ".join(f'xmlns:{n}="urn:oasis:names:tc:opendocument:xmlns:{n}:1.0"' for n in ("office", "table", "text"))
    content = (
        f"<office:document-content {spaces}><office:body><office:spreadsheet>"
        f'<table:table table:name="run">{body}{end}</table:table></office:spreadsheet></office:body>'
        "</office:document-content>"
    )
    manifest = (
        '<manifest:manifest xmlns:manifest="urn:oasis:names:tc:opendocument:xmlns:manifest:1.0"><manifest:file-entry '
        'manifest:full-path="/" manifest:media-type="application/vnd.oasis.opendocument.spreadsheet"/>'
        "</manifest:manifest>"
    )
    return zipped(**{"mimetype": b"application/vnd.oasis.opendocument.spreadsheet", "content.xml": content.encode(),
                     "META-INF/manifest.xml": manifest.encode()})  # fmt: skip


def by_pandas(folder: Path, rows: int) -> Path:
    pytest.importorskip("openpyxl")
    import pandas as pd

    columns = {"RPM": 3000.0 + np.arange(rows), "Thrust (N)": 1.5 + 0.01 * np.arange(rows), "Volts (V)": 11.1}
    pd.DataFrame(columns).to_excel(folder / "log.xlsx", index=False)
    return folder / "log.xlsx"


@pytest.mark.parametrize("rows", [50, 500, pytest.param(20_000, marks=pytest.mark.slow)])
def test_a_workbook_of_pandas_is_read_whatever_its_length(rows: int, tmp_path: Path) -> None:
    got = readers.read(by_pandas(tmp_path, rows))
    assert len(got) == rows and np.allclose(got["thrust_N"], 1.5 + 0.01 * np.arange(rows))


@pytest.mark.parametrize("form", ["gz", "two members", "zip", "xlsx in a zip", "ods"])
def test_what_is_packed_is_what_it_holds(form: str, tmp_path: Path) -> None:
    plain = text(ROWS)
    raw = {
        "gz": lambda: gzip.compress(plain),
        "two members": lambda: gzip.compress(plain[:40]) + gzip.compress(plain[40:]),
        "zip": lambda: zipped(**{"run/log.csv": plain, "__MACOSX/run/._log.csv": b"\0"}),
        "xlsx in a zip": lambda: zipped(**{"log.xlsx": by_pandas(tmp_path, 6).read_bytes()}),
        "ods": lambda: ods(ROWS),
    }[form]()
    (tmp_path / "log.any").write_bytes(raw)
    got = readers.read(tmp_path / "log.any")
    assert np.allclose(got["rpm"], 3000.0 + np.arange(6)) and np.allclose(got["thrust_N"], 1.5 + 0.01 * np.arange(6))


def far_cell(folder: Path) -> bytes:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.load_workbook(by_pandas(folder, 20))
    book.active["XFD1048576"] = 1
    book.save(folder / "far.xlsx")
    return (folder / "far.xlsx").read_bytes()


_FAR = (
    '<table:table-row><table:table-cell table:number-columns-repeated="16383"/>'
    '<table:table-cell office:value-type="float" office:value="1"/></table:table-row>'
)
_DOCTYPE = b'<!DOCTYPE x [<!ENTITY a "aaaa">]><worksheet/>'
REFUSED = {
    "a cell in the last corner": (far_cell, "cells up to row 1048576, column 16384"),
    "a cell in the last corner, ods": (lambda _: ods(ROWS, _FAR), "cells up to row"),
    "a document type": (
        lambda _: zipped(**{"xl/workbook.xml": b"<w/>", "xl/worksheets/sheet1.xml": _DOCTYPE}), "document type"),
    "a cell of 131,073 characters": (lambda _: b'rpm,note\n5000,"' + b"x" * 131_073 + b'"\n5100,b\n', "a line of 131"),
    "two files": (lambda _: zipped(a=b"1", b=b"2"), "2 files"),
    "a binary workbook": (lambda _: zipped(**{"xl/workbook.bin": b"1"}), "xlsb"),
    "half a gzip": (lambda _: gzip.compress(text(ROWS))[:-12], "damaged gzip"),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_read_is_one_line(what: str, tmp_path: Path) -> None:
    make, words = REFUSED[what]
    (tmp_path / "log.any").write_bytes(make(tmp_path))
    with pytest.raises(InputError, match=words) as error:
        import_file(tmp_path / "log.any")
    assert len(error.value.faults) == 1


@pytest.mark.parametrize("door", [import_file, read_log, readers.load_text])
def test_every_door_has_the_same_limit(door: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packed, "MAX_BYTES", 1 << 20)
    head = b"time,motor[0],motor[1],motor[2],motor[3]\n"
    (tmp_path / "bomb.csv.gz").write_bytes(gzip.compress(head + b"1,2,3,4,5\n" * 200_000))
    with pytest.raises(InputError, match="more than 1048576 bytes"):
        door(tmp_path / "bomb.csv.gz")  # type: ignore[operator]


def test_a_bomb_is_not_unpacked_beyond_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packed, "MAX_BYTES", 1 << 16)
    raw = gzip.compress(bytes(1 << 26))
    assert len(packed.gunzip(raw, "b", 100)[0]) == 100
    with pytest.raises(InputError, match="gzip"):
        packed.gunzip(raw, "b")


def test_what_is_whole_of_a_damaged_gzip_is_kept() -> None:
    rng = np.random.default_rng(1)
    whole = rng.bytes(300_000)
    raw = bytearray(gzip.compress(whole))
    got, damage = packed.gunzip(bytes(raw[:200_000]), "b")
    assert damage and len(got) > 190_000 and whole.startswith(got)


def _two_tables(path: Path, form: str) -> None:
    """A file of two tables, the second with twice the thrust."""
    twice = [ROWS[0], *([n, 2.0 * T, Q] for n, T, Q in ROWS[1:])]  # type: ignore[operator]
    if form == "zip":
        path.write_bytes(zipped(**{"first run": text(ROWS), "second run": text(twice)}))
        return
    book = pytest.importorskip("openpyxl").Workbook()
    for title, rows in (("first run", ROWS), ("second run", twice)):
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    del book["Sheet"]
    book.save(path)


@pytest.mark.parametrize("form", ["xlsx", "zip"])
def test_one_of_several_tables_is_asked_for_and_taken_by_name_at_every_door(form: str, tmp_path: Path) -> None:
    """No sheet is taken by guess; the name that the refusal shows is one that works, and a recording.toml keeps it."""
    file = tmp_path / f"runs.{form}"
    _two_tables(file, form)
    with pytest.raises(InputError, match="first run.*second run") as error:
        import_file(file)
    assert error.value.faults[0].choices == ("first run", "second run"), "so that a page may ask"
    shown = str(error.value).split('"')[1]
    assert np.array_equal(import_file(shown)["thrust_N"], [row[1] for row in ROWS[1:]])
    second = import_file(f"{file}#second run")["thrust_N"]
    assert np.array_equal(second, [2.0 * row[1] for row in ROWS[1:]])  # type: ignore[operator]
    assert np.array_equal(import_file(f"{file}#SECOND RUN")["thrust_N"], second)
    kept = tmp_path / "second.toml"
    assert bemt.import_(file, sheet="second run", out=kept).exit_code == 0
    assert np.array_equal(import_file(kept)["thrust_N"], second)
    with pytest.raises(InputError, match="no 'third'"):
        import_file(f"{file}#third")


def test_a_sheet_of_numbers_that_were_typed_as_text_is_the_one_that_holds_any(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in (["Drehzahl (U/min)", "Schub (g)"], ["3000", "100,5"], ["4000", "180,2"], ["5000", "283,9"]):
        book.active.append(row)
    book.create_sheet("empty")
    book.save(tmp_path / "a.xlsx")
    assert import_file(tmp_path / "a.xlsx")["thrust_N"] == pytest.approx(np.array([100.5, 180.2, 283.9]) * 9.80665e-3)


@pytest.mark.parametrize(
    ("typed", "read"),
    [
        (["2,08", "3,32", "5.91"], [2.08, 3.32, 5.91]), ([2.085, "3,321", 5.91], "B3"),
        (["2,085", "3,321", "5,910"], "B2"), (["0,085", "3,321", "5,910"], [0.085, 3.321, 5.91]),
        (["2,1", "3,3", "5.910"], "B4"), (["985,5", "1.234,5", "2.000"], [985.5, 1234.5, 2000.0]),
        (["985.5", "1,234.5", "2,000"], [985.5, 1234.5, 2000.0]),
    ],
)  # fmt: skip
def test_numbers_typed_as_text_beside_numbers_are_read_where_they_can_be_but_one(
    tmp_path: Path, typed: list[object], read: list[float] | str
) -> None:
    """Else the cell is named: 2,085 is thousands in one country and decimals in another."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in (["Drehzahl (U/min)", "Schub (N)"], *zip((3000, 4000, 5000), typed, strict=True)):
        book.active.append(row)
    book.active.title = "Messung"
    book.save(tmp_path / "a.xlsx")
    if isinstance(read, str):
        with pytest.raises(InputError, match=f"a.xlsx: sheet 'Messung', cell {read}: got .* as text.*Thousands"):
            import_file(tmp_path / "a.xlsx")
    else:
        assert import_file(tmp_path / "a.xlsx")["thrust_N"] == pytest.approx(np.array(read), rel=1e-12)


def test_a_mark_in_the_name_of_a_file_is_no_sheet(tmp_path: Path) -> None:
    (tmp_path / "run#2.csv").write_bytes(text(ROWS))
    assert len(import_file(tmp_path / "run#2.csv")) == len(ROWS) - 1
    (tmp_path / "run").write_bytes(text(ROWS))
    with pytest.raises(InputError, match="has none"):
        import_file(tmp_path / "run#3")


def test_a_sheet_of_stations_makes_the_case_of_that_blade(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    monkeypatch.chdir(tmp_path)
    book = openpyxl.Workbook()
    del book["Sheet"]
    for title, turn in (("blade A", 0.0), ("blade B", 3.0)):
        sheet = book.create_sheet(title)
        for row in [
            ["r/R", "c/R", "beta (deg)"],
            *([x, 0.2, 25.0 - 18.0 * x + turn] for x in (0.2, 0.4, 0.6, 0.8, 1.0)),
        ]:
            sheet.append(row)
    book.save("blades.xlsx")
    with pytest.raises(InputError, match="blade A.*blade B"):
        bemt.new("a", stations="blades.xlsx", diameter_in=10.0)
    thrust = []
    for name in ("A", "B"):
        bemt.new(name, stations=f"blades.xlsx#blade {name}", diameter_in=10.0)
        thrust.append(float(bemt.load(tmp_path / name).solve(rpm=5000.0).thrust_N[0]))
    assert thrust[1] > 1.1 * thrust[0]
