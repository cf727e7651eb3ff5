"""What a file is that no reader is sure of, by its first bytes: no results, or the damaged export of a program."""

from __future__ import annotations

import re

EXPORT = (
    "Write a report file of thrust and torque (Fluent), save the monitors as CSV (STAR-CCM+), or use the function "
    "object forces (OpenFOAM)"
)
"""Where loads come from."""
_EXPORT = f"Fields and meshes hold no loads. {EXPORT}"
_Mark = tuple[re.Pattern[bytes], str, str]
_PAGE = ("a web page", "Download the file that it shows, or save its table as CSV")
_FOAM = ("an OpenFOAM dictionary or field", "Import postProcessing/*/*/*.dat")
_FLUENT = "file (mesh, fields and settings)"


def _begins(mark: bytes, got: str, hint: str) -> _Mark:
    return re.compile(rb"\A\s*" + re.escape(mark)), got, hint


_MARKS: tuple[_Mark, ...] = (
    (re.compile(rb"\A\s*\Z"), "an empty file", "Did the export finish?"),
    (re.compile(rb"(?s)\A.{0,1991}<VTKFile "), "a VTK file", _EXPORT),
    _begins(b"\x89HDF", "HDF5 data (a case, mesh or field file)", _EXPORT),
    _begins(b"PK\x03\x04", "a damaged zip archive or workbook", "Copy it again, or save the sheet as CSV"),
    _begins(b"%PDF", "a PDF document", "Copy the numbers into a CSV"),
    _begins(b"\x89PNG", "a picture", ""),
    _begins(b"\xff\xd8\xff", "a picture", ""),
    _begins(b"(rp (", "solver settings of Fluent (no results)", "Settings hold no results; export the report files"),
    _begins(b"FoamFile", *_FOAM),
    _begins(b"$MeshFormat", "a mesh", _EXPORT),
    _begins(b"C Binary", "an EnSight file", _EXPORT),
    _begins(b"#!TDV", "a Tecplot binary file", _EXPORT),
    _begins(b"<?xml", "XML", "Export as CSV"),
    _begins(b"# vtk", "a VTK file", _EXPORT),
    _begins(b"version https://git-lfs", "a Git LFS pointer instead of the file", "Fetch it: git lfs pull"),
    _begins(b"{", "JSON, or a program's settings", "Save the numbers as CSV with a line of headings"),
    _begins(b"<!DOCTYPE", *_PAGE),
    _begins(b"<html", *_PAGE),
    (re.compile(rb'(?s)\A(?=.*Grid size).{0,390}\(0 "(?i:fluent)'), f"a Fluent data {_FLUENT}", _EXPORT),
    (re.compile(rb'(?s)\A.{0,390}\(0 "(?i:fluent)'), f"a Fluent case {_FLUENT}", _EXPORT),
    (re.compile(rb"(?s)\A.{0,1992}FoamFile"), *_FOAM),
)
_IN_TEXT: tuple[_Mark, ...] = (
    (re.compile(rb"^\s*(#[^\n]*\n\s*)*FORMAT\s+type:\s*ensight", re.IGNORECASE), "an EnSight case file", _EXPORT),
    (re.compile(rb"APC Propeller .*(Predictions|RPM Range)"), "a summary of APC over many propellers (PER2)",
     "Import the propeller's own file, PER3_*.dat"),
    (re.compile(rb"\A\s*# y\+"), "y+ of walls", EXPORT),
    (re.compile(rb"^# *Probe +\d+ +\(", re.MULTILINE), "values at probes", EXPORT),
    (re.compile(rb"^\(\(xy/key/label", re.MULTILINE), "a Fluent XY plot", EXPORT),
    (re.compile(rb"^\s*Force vector: \(", re.MULTILINE), "a force report of Fluent 6 or older",
     "Copy its table into a CSV with units in the headings"),
)  # fmt: skip


_DAMAGED = (
    (re.compile(rb'^[^"\n,]*"(?:[ \t]+"[^"\n]*")*\)[ \t]*\r?$', re.MULTILINE), "a Fluent report file"),
    (re.compile(rb'^[^"\n,]*"[ \t]+"[^"\n]*"[ \t]*\r?\n[-+.\d]', re.MULTILINE), "a Fluent monitor"),
    (re.compile(rb"\(\([-+.\deE ]+\) \([-+.\deE ]+\)"), "an OpenFOAM forces file"),
)


def instead(head: bytes, a_table: bool) -> tuple[str, str, str] | None:
    """What a file is, what was expected and a hint; None: nothing is known of it, or it is `a_table` as it seems."""
    marks = _MARKS if b"\0" in head else (*_MARKS, *_IN_TEXT)
    if found := next(((got, hint) for mark, got, hint in marks if mark.search(head)), None) or (
        None if a_table else _by_its_words(head)
    ):
        return found[0], "results as a table of text", found[1]
    if damaged := next((name for mark, name in _DAMAGED if a_table and mark.search(head)), None):
        hint = "Its head is cut or altered; export it again, or give --format"
        return f"what looks like {damaged}", "a whole file", hint
    return None


def _by_its_words(head: bytes) -> tuple[str, str] | None:
    if b"\0" not in head:
        return _as_text(head.decode("latin-1"))
    zeros = max(head[0:400:2].count(0), head[1:400:2].count(0))
    if zeros > 0.8 * len(head[:400]) / 2 and bytes(16) not in head:
        return ("what looks like UTF-16 without its mark", "Save the file as UTF-8")
    return None


def _as_text(head: str) -> tuple[str, str] | None:
    """What a text looks like that is no table of numbers."""
    lines, words = [line for line in head.splitlines() if line.strip()], head.split()
    from bemt.data.readers.polars_c81 import resembles  # which needs what this room shares

    if resembles(head):
        hint = "Fields are 7 characters wide, nine values after the first; or write alpha_deg, cl, cd, mach as CSV"
        return ("a C81 table with a different column width", hint)
    if len(lines) == 1 and re.search(r"[,;\t]", lines[0]):
        return ("one line and no rows", "Did the logger write any?")
    if len(lines) > 2 and not any(re.search(r"[\s,;|]", line.strip()) for line in lines):
        return ("a single column", "One column alone is not enough: also export time, speed or setting")
    numbers = sum(word.strip("(),;").lstrip("+-").replace(".", "", 1)[:1].isdigit() for word in words)
    return ("a text without a table of numbers", "") if len(words) > 20 and numbers < 0.2 * len(words) else None
