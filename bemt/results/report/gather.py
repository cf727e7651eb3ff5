"""Everything a report shows, gathered: results, curves, pictures, diagnoses (made here), pages of tools."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import bemt
from bemt.base import plugins
from bemt.base.document import rows_of
from bemt.base.errors import Fault, InputError
from bemt.base.page import FIRST
from bemt.base.tables import json_text, number_of, write_atomic
from bemt.results.report import curves
from bemt.results.report.book import Book, CasePage, Diagnosed, Diagnosis, Reproduced
from bemt.results.report.found_files import read_json, safe_files
from bemt.results.report.rotor_view import still
from bemt.results.sweep.rows import Result
from bemt.rotors.case import find_cases, load_case
from geometry.common import GeometryError
from geometry.surface import surfaces

Progress = Callable[[str], None]
ORIGIN = "Cahill 2025"
"""What a case of the source thesis states as its ``origin``."""
SCHEMAS = ("bemt.diagnosis/", "bemt.run-comparison/")
"""What a page shows: a diagnosis, or a recording of too few readings for one beside the model."""
ALL_BYTES = 4_000_000
"""Of all figures of diagnoses together, so that the report stays below 8 MB."""


def gather(paths: Sequence[str | Path], out: Path, progress: Progress | None = None) -> Book:
    """Solve the cases (or take up the results of a sweep in `out`) and compute what the report plots."""
    from bemt.results.sweep import sweep

    tell = progress or (lambda line: None)
    swept = sweep(paths, out, progress=tell)
    pages = []
    for path, result in zip(find_cases(paths), swept.cases, strict=True):
        tell(f"report: {result.name}")
        pages.append(_case(path, result))
    reproduced = _reproduction(out) if any(r.origin == ORIGIN for r in swept.cases) else ()
    book = Book(bemt.__version__, tuple(pages), reproduced, swept.exit_code)
    for part in plugins.loaded("REPORT_PARTS"):
        book = part(book, out)
    return attach_diagnoses(book, out)


def _case(path: Path, result: Result) -> CasePage:
    """Page of one case."""
    page = CasePage(result)
    if not result.rows:
        return page
    try:
        case = load_case(path)
        files = [(file.name, hashlib.sha256(file.read_bytes()).hexdigest()) for file in case.files()]
        page = replace(page, files=files, blade=curves.blade_curves(case))
        page = replace(page, curves=curves.case_curves(case, result.drive.rpm.value if result.drive else None))
        page = replace(page, radial=curves.radial_curves(case))
        page = replace(page, refinement=curves.refinement(case))
    except (InputError, GeometryError, ValueError) as error:
        return replace(page, problems=(f"some figures could not be computed: {error}",))
    try:
        found = surfaces(case.rotor(), case.duct())
        page = replace(page, surfaces=found, picture=still(found))
    except GeometryError as error:
        page = replace(page, problems=(f"no picture: {error}",))
    return page


def _reproduction(out: Path) -> Sequence[Reproduced]:
    """Numbers of the thesis beside ours, of a study in the folder of results; the database statistics left out."""
    document = read_json(out / "reproduction.json")
    if not isinstance(document, Mapping) or not str(document.get("schema", "")).startswith("bemt.reproduce/"):
        return []
    rows = rows_of(Reproduced, document.get("items"), lenient=True)
    return [item for item in rows if not item.status.startswith("not checked")]


def attach_diagnoses(book: Book, out: Path) -> Book:
    """Put diagnoses found in the folder of results to their cases, the others on a page of their own."""
    others, room = [], ALL_BYTES
    own: dict[str, Diagnosed] = {}
    names = {page.result.name for page in book.cases}
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
        item = Diagnosed(name, Diagnosis.from_document(document, lenient=True), figures)
        if name in names and path.parent.name == "diagnosis":
            own[name] = item
        else:
            others.append(item)
    cases = tuple(replace(page, diagnosis=own.get(page.result.name)) for page in book.cases)
    return replace(book, cases=cases, diagnoses=tuple(others))


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
    from bemt.judge.diagnose.figures_recording import first_picture
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
