"""Rewrite what the documents take from code and cases: ``.venv/bin/python docs/make.py``.

Numbers of docs/diagnosis.md, the pages docs/effects.md and docs/reference_files.md, docs/gallery.md with its pictures
(``--no-pictures``: without).
``--notebooks`` executes docs/notebooks/ and nothing else.
The picture of the README has a script of its own, docs/overview.py.
"""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import get_origin

from bemt.base.toml import Limits, Table, expected, limits_of
from bemt.case import Case, load_case
from bemt.case.prepare import prepare_case
from bemt.case.schema import GROUPS, CaseFile
from bemt.case.unknowns import completed
from bemt.cfd.schema import AxesTable, CampaignFile
from bemt.diagnose.nuisance import PRIORS
from bemt.drive.drive_file import DriveToml
from bemt.drive.motor_file import MotorToml
from bemt.drive.thrusters_result import ThrustersFile
from bemt.readers.recording_toml import ColumnsTable, ColumnTable, RecordingToml
from bemt.report import effects_list

CASES = ("ds30", "prop_8x5", "prop_10x5", "prop_12x6", "prop_14x8")
"""Cases that the pages show: the shipped ones, whatever else somebody puts beside them."""
DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent


def numbers(text: str) -> str:
    """Fill in the constants of the tables under "The numbers"."""

    def now(row: re.Match[str]) -> str:
        value = getattr(importlib.import_module(f"bemt.diagnose.{row[1]}"), row[2])
        return f"| `{row[1]}.{row[2]}` | `{value!r}` |"

    rows = "".join(f"| {name} | {value:g} |\n" for name, value in PRIORS.items())
    head = "| nuisance | standard deviation |\n|---|---|\n"
    text = re.sub(re.escape(head) + r"(\|.*\n)*", lambda _: head + rows, text)
    return re.sub(r"^\| `(\w+)\.(\w+)` \| `[^`]+` \|", now, text, flags=re.M)


def shipped() -> list[Case]:
    """Cases of the pages."""
    return [load_case(ROOT / "cases" / name / "case.toml") for name in CASES]


def picture(case: Case) -> str:
    """Name of the picture of a case."""
    return f"{case.name}.png"


def gallery(cases: list[Case]) -> str:
    """Page of all cases."""
    lines = [
        "# Gallery",
        "",
        "The shipped cases, as the solver sees them. Written by `python docs/make.py`; do not edit.",
        "",
        "Thrust and torque are those of BEMT at the case's point; what was recorded stands in the",
        "[report](../reports/report.md).",
        "",
    ]
    for case in cases:
        ready = prepare_case(case)
        row = ready.solve(case.rpm, case.airspeed_m_s, case.air())
        kind = "duct cut open" if ready.ducted else "rotor"
        lines += [
            f"## {case.name}", "", case.title, "", f"![{case.title}: {kind}](img/{picture(case)})", "",
            f"| `cases/{case.name}` | |", "|---|---|",
            f"| diameter, blades | {1e3 * ready.diameter_m:.0f} mm, {case.rotor().B} |",
            f"| rev/min, airspeed | {case.rpm:.0f}, {case.airspeed_m_s:g} m/s |",
            f"| thrust, torque | {row.thrust_N[0]:.1f} N, {row.torque_Nm[0]:.3f} N m |", "",
        ]  # fmt: skip
    return "\n".join([*lines, *CFD])


CFD = [
    "## This project's own CFD of the 8x5", "",
    "Cells of the finest OpenFOAM grid (494,000), and the pressure on the blade at rest, 20,000 rev/min,",
    "incompressible: the other blade's tip vortex passes at 0.85 R. How far to trust them: `reports/cfd`.", "",
    "![Plane through the shaft and cells on the blade](img/mesh_8x5.png)", "",
    "![Pressure on the blade, from the front and from behind](img/pressure_8x5.png)", "",
]  # fmt: skip


FILES: dict[str, tuple[type[Table], str]] = {
    "case": (CaseFile, "A propeller or fan: everything that the solver is told. Six lines are enough:"),
    "recording": (RecordingToml, "Beside a table of measurements, where its headings do not say enough:"),
    "drive": (DriveToml, "Beside a case.toml; `bemt drive` reads it, `bemt new 10x5 --kv 900 --cells 3` writes one:"),
    "motor": (MotorToml, "Recordings of a motor constant, for `bemt motor`:"),
    "thrusters": (ThrustersFile, "For `bemt thrusters`:"),
    "campaign": (CampaignFile, "OpenFOAM runs of one case, for `bemt cfd`:"),
}
"""Files that the page of references holds: model, and what the file is for."""
_TAKEN = completed({"rotor": {}, "blade": {}})


def tables(model: type[Table], name: str = "") -> Iterator[tuple[str, type[Table]]]:
    """Every table of a file by its heading, the top of the file first; tables that look alike once."""
    yield name, model
    if model is ColumnsTable:
        yield "columns.NAME", ColumnTable
        return
    for key in model.named():
        inner = model.inner(key)
        if inner is not None and inner is not AxesTable:
            yield from tables(inner, f"{name}.{key}".removeprefix("."))


def rows(name: str, model: type[Table], case: bool) -> Iterator[list[str]]:
    """Key, type, unit, default, range, meaning of every value of a table."""
    taken = _TAKEN if case else {}
    for part in name.split(".") if name else ():
        taken = taken.get(part, {})
    notes = {item["key"]: f", {item['low']:g} to {item['high']:g}" for item in _TAKEN["assumptions"]}
    for key, field in model.named().items():
        if model.inner(key) is not None and model is not ColumnsTable:
            continue
        limits, default = limits_of(field), field.default
        kind = expected(field.annotation, replace(limits, low=Limits.low, high=Limits.high, unit=""))
        if model is ColumnsTable:
            kind = "unit " + expected(str, limits_of(model.inner(key).named()["unit"]))  # type: ignore[union-attr]
        kind = kind.removeprefix("a ").removeprefix("the ").removesuffix(" that is not empty")
        if field.is_required():
            default = "required"
        elif key in taken and default in (None, 0.0, "propeller"):
            default = f"{taken[key]}{notes.get(f'{name}.{key}', '')} (assumed)"
        elif default is None or default == ():
            default = ""
        elif isinstance(default, tuple):
            default = ", ".join(f"{v:g}" for v in default)
        span = (
            f"{limits.low:.6g} to {limits.high:.6g}"
            if limits.low > Limits.low and limits.high < Limits.high
            else (f"{limits.low:g} or more" if limits.low > Limits.low else "")
        )
        meaning = (field.description or "").replace("|", "\\|")
        yield [f"`{key}`", kind.replace("|", "\\|"), limits.unit, str(default), span, meaning]


def files() -> str:
    """Page of the references."""
    lines = [
        "# TOML files",
        "",
        "Every key of the files that commands read. Written by `python docs/make.py`; do not edit.",
        "",
        "Units stand in the key names. An unknown key is refused with a hint, and all faults of a file come at once. "
        "`(assumed)`: taken when the file says nothing of hub, chord, section or air, with the range that then counts "
        "as an uncertainty; `sweep --details` says what each does to the thrust. Fans have ranges of "
        "their own; the chord is that of 10 in.",
        "",
    ]
    for name, (model, words) in FILES.items():
        example = (DOCS / "files" / f"{name}.toml").read_text(encoding="utf-8")
        lines += [f"## {name}.toml", "", words, "", "```toml", example.rstrip(), "```", ""]
        if model is CaseFile:
            lines += ["Of these only one may be given:", ""]
            lines += [f"* `[{table}]` {', '.join(keys)}" for table, keys, _ in GROUPS] + [""]
        for table, inner in tables(model):
            body = list(rows(table, inner, model is CaseFile))
            if body:
                words = (inner.__doc__ or "").strip().partition("\n")[0]
                words = re.sub(r"^\[.*\]: ", "", words)
                if inner is ColumnTable:
                    words = 'what each channel says, as in `thrust = { column = 2, unit = "gf" }`.'
                elif inner is ColumnsTable:
                    words = "channels that may be named."
                array = table in model.named() and get_origin(model.named()[table].annotation) is tuple
                head = f"[[{table}]]" if array else f"[{table}]"
                lines += [f"### `{head}`", "", words[:1].upper() + words[1:], ""] if table else []
                lines += ["| key | type | unit | default | range | meaning |", "|---|---|---|---|---|---|"]
                lines += [f"| {' | '.join(row)} |" for row in body] + [""]
    return "\n".join(lines)


def run_notebook(path: Path) -> None:
    """Execute a notebook and write its outputs into it."""
    import os

    import nbformat
    from nbclient import NotebookClient

    book = nbformat.read(path, 4)
    for cell in book.cells:
        cell.setdefault("metadata", {}).pop("execution", None)
    here = {"metadata": {"path": str(path.parent)}}
    client = NotebookClient(book, timeout=300, record_timing=False, resources=here)
    client.execute(env={**os.environ, "PYTHONPATH": str(ROOT)})
    nbformat.write(book, path)


def main() -> None:
    """Rewrite everything."""
    if "--notebooks" in sys.argv:
        for path in sorted((DOCS / "notebooks").glob("*.ipynb")):
            run_notebook(path)
        return
    from geometry.picture import cutaway_scene, render, rotor_scene

    page = DOCS / "diagnosis.md"
    page.write_text(numbers(page.read_text(encoding="utf-8")), encoding="utf-8")
    (DOCS / "reference_files.md").write_text(files(), encoding="utf-8")
    (DOCS / "effects.md").write_text(effects_list.markdown(), encoding="utf-8")
    cases = shipped()
    if "--no-pictures" not in sys.argv:
        scenes = []
        for case in cases:
            rotor, duct = case.rotor(), case.duct()
            scene = rotor_scene(rotor) if duct is None else cutaway_scene(rotor, duct)
            scenes.append((scene, DOCS / "img" / picture(case)))
        render(scenes)
    (DOCS / "gallery.md").write_text(gallery(cases), encoding="utf-8")


if __name__ == "__main__":
    main()
