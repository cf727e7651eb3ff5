"""Everything a report shows, as plain values: results, curves, pictures, diagnoses (made here), CFD runs."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import bemt
from bemt.base.errors import Fault, InputError
from bemt.base.tables import json_text, number_of, write_atomic
from bemt.results.report import curves, trends
from bemt.results.report.cfd import attach, cfd_runs, fidelities
from bemt.results.report.found_files import read_json, safe_files
from bemt.results.report.rotor_view import still
from bemt.rotors.case import Case, find_cases, load_case
from geometry.common import GeometryError
from geometry.surface import surfaces

Progress = Callable[[str], None]
SCHEMAS = ("bemt.diagnosis/", "bemt.run-comparison/")
"""What a page shows: a diagnosis, or a recording of too few readings for one beside the model."""
REPRODUCED = {"section", "quantity", "stated", "ours", "unit", "status", "note"}
ALL_BYTES = 4_000_000
"""Of all figures of diagnoses together, so that the report stays below 8 MB."""


def gather(paths: Sequence[str | Path], out: Path, progress: Progress | None = None) -> dict[str, Any]:
    """Solve the cases (or take up the results of a sweep in `out`) and compute what the report plots."""
    from bemt.results.sweep import sweep

    tell = progress or (lambda line: None)
    document = sweep(paths, out, progress=tell)
    pages, solved = [], []
    for path, result in zip(find_cases(paths), document["cases"], strict=True):
        tell(f"report: {result['name']}")
        page, case = _case(path, result)
        pages.append(page)
        if case is not None and result["rows"]:
            solved.append((case, page))
    tell("report: trends")
    of_thesis = any(result.get("origin") == trends.ORIGIN for result in document["cases"])
    book = {
        "version": bemt.__version__,
        "cases": pages,
        "trends": _trends(solved, document["cases"]),
        "reproduction": _reproduction(out) if of_thesis else [],
        "exit_code": document["exit_code"],
        "cfd": cfd_runs(out),
        "fidelities": fidelities(out, [str(page["result"]["name"]) for page in pages]),
    }
    attach(book)
    attach_diagnoses(book, out)
    return book


def _case(path: Path, result: Mapping[str, Any]) -> tuple[dict[str, Any], Case | None]:
    """Page of one case."""
    page: dict[str, Any] = {
        "result": result,
        "files": [],
        "problems": [],
        "pictures": {},
        "surfaces": [],
        "geometry": {},
        "curves": {},
        "radial": {},
        "refinement": {},
    }
    if not result["rows"]:
        return page, None
    try:
        case = load_case(path)
        page["files"] = [
            {"name": file.name, "sha256": hashlib.sha256(file.read_bytes()).hexdigest()} for file in case.files()
        ]
        page["geometry"] = curves.geometry_curves(case)
        page["curves"] = curves.case_curves(case, (result.get("drive") or {}).get("rpm", {}).get("value"))
        page["radial"] = curves.radial_curves(case)
        page["refinement"] = curves.refinement(case)
    except (InputError, GeometryError, ValueError) as error:
        page["problems"].append(f"some figures could not be computed: {error}")
        return page, None
    try:
        page["surfaces"] = surfaces(case.rotor(), case.duct())
        page["pictures"] = {"rotor": still(page["surfaces"])}
    except GeometryError as error:
        page["problems"].append(f"no picture: {error}")
    return page, case


def _trends(solved: Sequence[tuple[Case, dict[str, Any]]], results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    base = next((case for case, _ in solved if not case.ducted), None)
    family: dict[str, Any] = {}
    if base is not None:
        try:
            family = trends.families(base)
        except (InputError, GeometryError, ValueError):
            family = {}
    thesis = [result for result in results if result.get("origin") == trends.ORIGIN]  # the robot is that of the thesis
    return {"family": family, "choice": trends.choice(thesis), "moments": trends.moments(thesis)}


def _reproduction(out: Path) -> list[Mapping[str, Any]]:
    """Numbers of the thesis beside ours, of a study in the folder of results; the database statistics left out."""
    document = read_json(out / "reproduction.json")
    if not isinstance(document, Mapping) or not str(document.get("schema", "")).startswith("bemt.reproduce/"):
        return []
    rows = [item for item in document.get("items", []) if isinstance(item, Mapping) and item.keys() >= REPRODUCED]
    return [item for item in rows if not str(item["status"]).startswith("not checked")]


def attach_diagnoses(book: dict[str, Any], out: Path) -> None:
    """Put diagnoses found in the folder of results to their cases, the others on a page of their own."""
    others, room = [], ALL_BYTES
    named = {page["result"]["name"]: page for page in book["cases"]}
    files = [*sorted(out.glob("*/diagnosis/diagnosis.json")), *sorted(out.glob("diagnosis/*/diagnosis.json"))]
    for path in files:
        document = read_json(path)
        if not isinstance(document, Mapping) or not str(document.get("schema", "")).startswith(SCHEMAS):
            continue
        name = path.parent.parent.name if path.parent.name == "diagnosis" else path.parent.name
        figures = []
        for figure in safe_files(path.parent):
            room -= len(figure[1])
            figures += [figure] if room > 0 else []
        item = {"name": name, "document": document, "figures": figures}
        page = named.get(name)
        if page is not None and path.parent.name == "diagnosis":
            page["diagnosis"] = item
        else:
            others.append(item)
    book["diagnoses"] = others


def diagnose_into(
    paths: Sequence[str | Path], recordings: Sequence[str], out: Path, progress: Callable[[str], None] | None = None
) -> None:
    """Diagnose recordings of the one case of a report into ``out/NAME/diagnosis``.

    They are analysed together; too few readings are shown beside the model.
    """
    from bemt.judge.compare.one_run import compare_run
    from bemt.judge.diagnose import folder
    from bemt.judge.diagnose.chain import diagnose
    from bemt.judge.diagnose.document import document
    from bemt.judge.diagnose.figures_recording import FIRST, first_picture
    from bemt.judge.diagnose.load import load_all

    cases = find_cases(paths)
    if len(cases) != 1:
        raise InputError(
            Fault("--recording", "", number_of(len(cases), "case"), "one case, the rotor that was recorded")
        )
    found, records = load_all(list(recordings), [str(cases[0])])
    target = (out / found[0].name / "diagnosis").as_posix()
    folder.check(target, found)
    about: dict[str, Any] = {"recordings": list(recordings), "cases": [c.name for c in found]}
    try:
        answer = diagnose(records, found, None, progress)
    except InputError as error:
        if len(recordings) > 1 or any(f.where != "readings" for f in error.faults):
            raise
        told = compare_run(recordings[0], found[0], progress) | about
        few = f"One point cannot name a cause. {told['sentence']} Next: {told['next']}."
        told |= {"verdict": "insufficient", "effects": [], "explanation": few}
        write_atomic(Path(target) / "diagnosis.json", json_text(told))
        write_atomic(Path(target) / f"{FIRST}.png", first_picture(records, found)[0].png())
        return
    folder.write(target, answer, document(answer) | about, found)
