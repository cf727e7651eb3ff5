"""Rewrite what the documents take from code and cases: ``.venv/bin/python docs/make.py``.

Numbers of docs/diagnosis.md, the page docs/effects.md, docs/gallery.md with its pictures (``--no-pictures``: without).
``--notebooks`` executes docs/notebooks/ and nothing else.
The picture of the README has a script of its own, docs/overview.py.
"""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path

from bemt.case import Case, load_case
from bemt.case.prepare import prepare_case
from bemt.diagnose.nuisance import PRIORS
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
        "# Gallery", "",
        "The shipped cases, as the solver sees them. Written by `python docs/make.py`; do not edit.", "",
        "Thrust and torque are those of BEMT at the case's point; what was recorded stands in the",
        "[report](../reports/report.md).", "",
    ]  # fmt: skip
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
