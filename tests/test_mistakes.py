"""The promise to a newcomer: every usual mistake is answered with place and remedy."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from bemt.app.cli import main

TABLE = "rpm,thrust_N,torque_Nm\n4000,1.1,0.016\n6000,2.4,0.034\n8000,4.3,0.061\n"
Put = Callable[[str, str], str]


@pytest.fixture
def put(tmp_path: Path, project: Path, monkeypatch: pytest.MonkeyPatch) -> Put:
    """Work in an empty folder with one sound case, `mine`."""
    shutil.copytree(project / "cases" / "prop_8x5", tmp_path / "mine")
    monkeypatch.chdir(tmp_path)

    def write(name: str, text: str) -> str:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return name

    return write


def changed(*pairs: tuple[str, str]) -> str:
    """Folder of the case with some of its text changed."""
    path = Path("other/case.toml")
    shutil.copytree("mine", "other")
    text = path.read_text(encoding="utf-8")
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return "other"


def workbook() -> str:
    with zipfile.ZipFile("t.xlsb", "w") as book:
        book.writestr("xl/workbook.bin", "x")
    return "t.xlsb"


def twice() -> list[str]:
    shutil.copytree("mine", "again")
    return ["mine", "again"]


RUNS: dict[str, tuple[Callable[[Put], list[str]], int, tuple[str, ...]]] = {
    "wrong path": (lambda put: ["sweep", "mime"], 2, ("mime", "no such file or folder", "Check the path")),
    "typo in a command": (lambda put: ["swep", "mine"], 2, ("swep", "Did you mean sweep?")),
    "typo in an option": (lambda put: ["sweep", "mine", "--tolerence", "3"], 2, ("Did you mean --tolerance-pct?",)),
    "typo in a key": (lambda put: ["sweep", changed(("pitch_in", "pich_in"))], 2,
                      ("other/case.toml", "blade.pich_in", "Did you mean pitch_in?")),
    "typo in an effect": (lambda put: ["diagnose", put("l.csv", TABLE), "--case", "mine", "--only", "tip_los"], 2,
                          ("tip_los", "Did you mean tip_loss?")),
    "typo in an effect of a case": (
        lambda put: ["sweep", changed(("stations = 40", 'stations = 40\neffects_off = ["tip_los"]'))], 2,
        ("model.effects_off", "Did you mean tip_loss?")),
    "mm for m": (lambda put: ["sweep", changed(("diameter_in = 8", "diameter_m = 203"))], 2,
                 ("rotor.diameter_m", "203", "In mm?")),
    "radius for diameter": (lambda put: ["sweep", changed(("diameter_in = 8", "diameter_in = 4"))], 2,
                            ("101.6 mm", "203.2 mm", "radius")),
    "missing polar": (
        lambda put: ["sweep", changed(("[operating]", '[[polars]]\nr_over_R = 0.5\nfile = "a.csv"\n\n[operating]'))], 2,
        ("polars[0].file", "a.csv", "does not exist")),
    "semicolons and decimal commas": (lambda put: ["import", put("s.csv", "rpm;thrust_N\n4000;1,1\n6000;2,4\n")], 0,
                                      ("thrust_N", "decimal commas")),
    "German heads": (lambda put: ["import", put("d.csv", "Drehzahl [1/min];Schub [g]\n4000;112\n6000;245\n")], 0,
                     ("thrust_N", "gram-force")),
    "empty file": (lambda put: ["import", put("e.csv", "")], 2, ("e.csv", "an empty file", "export")),
    "a unit of mass for a thrust": (lambda put: ["import", put("u.csv", "rpm,thrust_lb\n4000,1\n6000,2\n")], 0,
                                    ("thrust_lb", "pound-force")),
    "negative rpm": (lambda put: ["estimate", "8x5", "--rpm", "-5000"], 2, ("-5000", "rpm")),
    "unicode path": (lambda put: ["import", put("Mess ø/Prüf ü.csv", TABLE)], 0, ("Prüf ü.csv", "thrust_N")),
    "file for a folder": (lambda put: ["sweep", "mine", "--out", put("f", "x")], 2, ("--out", "a folder")),
    "two propellers in one file": (
        lambda put: ["diagnose", "--case", "mine", "--", put("two.csv", "Prop,rpm,thrust_N\n" + "".join(
            f"{p},{n},{n / 2000}\n" for p in ("8x5", "9x5") for n in (4000, 6000, 8000)))], 2,
        ("two.csv", "2 set-ups", "a separate file")),
    "UIUC geometry given to stations": (lambda put: ["stations", put("x_geom.txt", "r/R c/R beta\n0.2 0.1 30\n")], 2,
                                        ("x_geom.txt", "bemt new --stations")),
    "validate without data": (lambda put: ["validate", "uiuc"], 2, ("uiuc", "bemt lab fetch uiuc")),
    "a case for a recording": (lambda put: ["import", "mine"], 2, ("mine", "a recording", "bemt sweep")),
    "a recording for a case": (lambda put: ["sweep", put("l.csv", TABLE)], 2, ("l.csv", "bemt import")),
    "workbook": (lambda put: ["import", workbook()], 2, ("t.xlsb", "CSV")),
    "two cases of one name": (lambda put: ["sweep", *twice()], 2, ("again/case.toml", "name", "prop_8x5")),
    "two columns of one name": (lambda put: ["import", put("n.csv", "rpm,thrust_N,thrust_N\n4000,1,1\n6000,2,2\n")], 0,
                                ("name of another column",)),
    "electrical rpm": (lambda put: ["diagnose", put("r.csv", TABLE.replace("000,", "0000,")), "--case", "mine"], 0,
                       ("electrical revolutions", "pole pairs")),
    "no load at all": (lambda put: ["diagnose", put("l.csv", "rpm,temp\n4000,1\n6000,2\n"), "--case", "mine"], 2,
                       ("l.csv", "thrust", "unit")),
    "N mm for N m": (lambda put: ["import", put("q.csv", TABLE.replace("0.0", ""))], 0,
                     ("torque_Nm", "mNm taken for Nm")),
    "no motor": (lambda put: ["drive", "mine"], 2, ("[drive]", "--kv")),
    "pitch without a point": (lambda put: ["drive", "10x100", "--kv", "900", "--cells", "3"], 2, ("Meant 10x10?",)),
    "no case": (lambda put: ["diagnose", put("a.csv", TABLE), "--reference", put("b.csv", TABLE)], 2,
                ("--case 10x5", "bemt compare A B")),
    "three to compare": (lambda put: ["compare", *(put(f"{k}.csv", TABLE) for k in "abc")], 2,
                         ("c.csv", "bemt diagnose B --reference A1 A2")),
    "a reference to compare": (lambda put: ["compare", put("a.csv", TABLE), "--reference", put("b.csv", TABLE)], 2,
                               ("A is the reference",)),
    "a load under a name of its own": (
        lambda put: ["diagnose", "--case", "mine", "--", put("l.csv", TABLE.replace("thrust_N,torque_Nm", "th,x"))], 2,
        ("l.csv", "'th'", "as loads do", "--column thrust=th --unit thrust=UNIT")),
    "no torque": (lambda put: ["import", put("t.csv", "rpm,thrust_N\n4000,1.1\n6000,2.4\n")], 0, ("thrust_N",)),
}  # fmt: skip


@pytest.mark.parametrize("name", RUNS)
def test_a_mistake_is_answered_with_its_remedy(
    name: str, put: Put, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    if name == "validate without data":
        monkeypatch.setenv("BEMT_DATA", str(tmp_path / "none"))
        monkeypatch.setenv("BEMT_CACHE", str(tmp_path / "cache"))
        monkeypatch.setattr("bemt.base.given.DEFAULT", tmp_path / "none", raising=False)
    make, code, words = RUNS[name]
    try:
        got = main(make(put))
    except SystemExit as stopped:
        got = int(stopped.code or 0)
    shown = capsys.readouterr()
    text = " ".join((shown.out + shown.err).split())
    assert got == code, text
    assert all(word in text for word in words), text
    assert "Traceback" not in text and "internal error" not in text


@pytest.mark.usefixtures("put")
def test_a_cache_that_cannot_be_written_stops_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("BEMT_CACHE", str(tmp_path / "mine" / "case.toml"))  # a file, where a folder is wanted
    assert main(["estimate", "8x5", "--rpm", "5000"]) == 0
    assert main(["sweep", "mine", "--quiet"]) == 0
