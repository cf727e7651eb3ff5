"""Everything a report shows, gathered: results, curves, pictures, diagnoses (made here), pages of tools."""

from __future__ import annotations

import hashlib
import json
import math
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import bemt
from bemt.base import plugins
from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.page import FIRST
from bemt.base.tables import json_text, number_of, write_atomic
from bemt.results.report.book import (
    BladeCurves,
    Book,
    CaseCurves,
    CasePage,
    Diagnosed,
    RadialCurves,
    Refinement,
    ShownDiagnosis,
)
from bemt.results.report.plot import still
from bemt.results.sweep.rows import Result
from bemt.rotors.case import Case, find_cases, load_case
from geometry.common import GeometryError
from geometry.mesh import surfaces

# Files that somebody else wrote into the folder of the results: read with limits, nothing outside of it.

FIGURE_BYTES = 600_000
FIGURES = 12
JSON_BYTES = 20_000_000
_FIGURE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,80}\.(png|svg)")


def read_json(path: Path) -> Any:
    """Read a JSON file that somebody else wrote."""
    try:
        if path.stat().st_size > JSON_BYTES:
            return None
        return json.loads(path.read_text(encoding="utf-8"), parse_constant=lambda name: None)
    except (OSError, ValueError, RecursionError):
        return None


def safe_files(folder: Path) -> list[tuple[str, bytes]]:
    """Figures in a folder: plain names, no links, PNG or SVG by content, of a moderate size.

    Of two pictures with one stem the smaller is taken.
    """
    found: dict[str, tuple[str, bytes]] = {}
    for path in sorted(folder.glob("*")):
        if not _FIGURE.fullmatch(path.name) or path.is_symlink() or not path.is_file():
            continue
        if path.stat().st_size > FIGURE_BYTES:
            continue
        data = path.read_bytes()
        good = data.startswith(b"\x89PNG\r\n") if path.suffix == ".png" else b"<svg" in data[:1000]
        if good and (path.stem not in found or len(data) < len(found[path.stem][1])):
            found[path.stem] = (path.name, data)
    return list(found.values())[:FIGURES]


# What a case page plots: geometry, performance over J and rpm with bands, radial loading, refinement of the stations.
#
# The bands are those of `bemt.rotors.case.propagate`, as everywhere.

N_J, N_RPM = 29, 21
REFINED = (10, 20, 40, 80)


def blade_curves(case: Case) -> BladeCurves:
    """Chord and blade angle over the radius."""
    rotor = case.rotor()
    r = np.linspace(rotor.blade.Rhub, rotor.blade.R, 41)
    chord, beta = rotor.blade.at(r)
    return BladeCurves(r / rotor.R, 1e3 * chord, np.degrees(beta))


def _grids(case: Case, pitch_over_D: float, full_rpm: float | None) -> tuple[Array, Array, int]:
    """Points of the curves: a line of J at the case's rpm, then a line of rpm at its airspeed, to full throttle."""
    J = np.linspace(0.0, 1.45 * pitch_over_D, N_J)
    rpm = np.linspace(0.2, 1.1, N_RPM) * case.rpm
    if full_rpm is not None:
        rpm = np.linspace(0.2, 1.0, N_RPM) * np.fmax(full_rpm, case.rpm)
    speeds = J * case.rpm / 60.0 * case.diameter_m
    return (
        np.concatenate([np.full(N_J, case.rpm), rpm]),
        np.concatenate([speeds, np.full(N_RPM, case.airspeed_m_s)]),
        N_J,
    )


def case_curves(case: Case, full_rpm: float | None = None) -> CaseCurves:
    """Performance over J and over rpm up to full throttle [rev/min], BEMT with bands and K1/K2."""
    from bemt.rotors.case.prepare import k1k2_case
    from bemt.rotors.case.propagate import propagate
    from bemt.rotors.validity import counted

    rotor = case.rotor()
    rpm, V, cut = _grids(case, rotor.blade.pitch_m() / rotor.D, full_rpm)
    found = propagate(case, rpm, V).points
    simple = k1k2_case(case, None, rpm, V, case.air())
    shown = [*range(keep := _until_windmill(found.CT[:cut])), *range(cut, len(found))]
    flags = counted([found.flags[i] for i in shown])
    over_J, over_rpm = found.select(slice(keep)), found.select(slice(cut, None))
    return CaseCurves(over_J, over_rpm, simple.CT[:keep], simple.thrust_N[cut:], flags)


def _until_windmill(CT: Array) -> int:
    """Points up to the first without thrust, that one included."""
    below = np.flatnonzero(CT < 0.0)
    return int(below[0]) + 1 if below.size else len(CT)


def radial_curves(case: Case) -> RadialCurves:
    """Loading along the blade at the case's own operating point."""
    from bemt.physics.bem import solver
    from bemt.rotors.case.prepare import prepare_case

    prep = prepare_case(case).prep
    answer = solver.solve(prep, case.rpm, case.airspeed_m_s, case.air(), radial=True)
    stations = prep.stations
    ok = np.where(answer.converged[0], 1.0, np.nan)
    dT, dQ, alpha, M = (getattr(answer.radial, name)[0] for name in ("dT", "dQ", "alpha", "M"))
    r_over_R = stations.r / prep.rotor.R
    return RadialCurves(r_over_R, dT / stations.dr * ok, dQ / stations.dr * ok, np.degrees(alpha) * ok, M * ok)


def refinement(case: Case) -> Refinement:
    """Thrust and torque against the number of blade elements."""
    from bemt.data.recordings.grid_study import grid_study
    from bemt.rotors.case.prepare import prepare_case

    air = case.air()
    points = [prepare_case(case, None, n).solve(case.rpm, case.airspeed_m_s, air) for n in REFINED]
    T, Q = (np.array([float(getattr(p, name)[0]) for p in points]) for name in ("thrust_N", "torque_Nm"))
    study = None
    if np.all(np.isfinite(T[-3:])) and not np.any(T[-2:] == 0.0):
        try:
            study = grid_study(T[:-4:-1].tolist(), [2.0, 2.0])
        except InputError:
            study = None
    used = case.file.model.stations
    finest = float(T[-1])
    near = REFINED.index(used) if used in REFINED else None
    change = math.nan if near is None or finest == 0.0 else float(T[near]) / finest - 1.0
    return Refinement(REFINED, T, Q, used, change, study)


Progress = Callable[[str], None]
SCHEMAS = ("bemt.diagnosis/", "bemt.run-comparison/")
"""What a page shows: a diagnosis, or a recording of too few readings for one beside the model."""
ALL_BYTES = 4_000_000
"""Of all figures of diagnoses together, so that the report stays below 8 MB."""


def gather(
    paths: Sequence[str | Path], out: Path, progress: Progress | None = None, recordings: Sequence[str] = ()
) -> Book:
    """Solve the cases (or take up the results of a sweep in `out`) and compute what the report plots.

    Of the `recordings` of the one case those that are runs of CFD stand beside it as if they lay in its folder.
    """
    from bemt.data.readers.cfd_run import sniff
    from bemt.results.sweep import sweep

    tell = progress or (lambda line: None)
    files = [p / "run.toml" if p.is_dir() else p for p in map(Path, recordings)]
    runs = [p for p in files if p.suffix == ".toml" and p.is_file() and sniff(p.read_bytes()[:4096])]
    swept = sweep(paths, out, progress=tell, beside=runs)
    pages = []
    for path, result in zip(find_cases(paths), swept.cases, strict=True):
        tell(f"report: {result.name}")
        pages.append(_case(path, result))
    book = Book(bemt.__version__, tuple(pages), swept.exit_code)
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
        page = replace(page, files=files, blade=blade_curves(case))
        page = replace(page, curves=case_curves(case, result.drive.rpm.value if result.drive else None))
        page = replace(page, radial=radial_curves(case))
        page = replace(page, refinement=refinement(case))
    except (InputError, GeometryError, ValueError) as error:
        return replace(page, problems=(f"some figures could not be computed: {error}",))
    try:
        found = surfaces(case.rotor(), case.duct())
        page = replace(page, surfaces=found, picture=still(found))
    except GeometryError as error:
        page = replace(page, problems=(f"no picture: {error}",))
    return page


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
        item = Diagnosed(name, ShownDiagnosis.from_document(document, lenient=True), figures)
        if name in names and path.parent.name == "diagnosis":
            own[name] = item
        else:
            others.append(item)
    cases = tuple(replace(page, diagnosis=own.get(page.result.name)) for page in book.cases)
    return replace(book, cases=cases, diagnoses=tuple(others))


def diagnose_into(
    paths: Sequence[str | Path], recordings: Sequence[str], out: Path, progress: Callable[[str], None] | None = None,
    references: Sequence[str] = (),
) -> None:  # fmt: skip
    """Diagnose recordings of the one case of a report, beside references, into ``out/NAME/diagnosis``.

    They are analysed together; too few readings are shown beside the model.
    """
    from bemt.judge.compare.one_run import compare_run
    from bemt.judge.diagnose import folder
    from bemt.judge.diagnose.chain import diagnose
    from bemt.judge.diagnose.document import document
    from bemt.judge.diagnose.figures import first_picture
    from bemt.judge.diagnose.load import load_all
    from bemt.judge.diagnose.suggest import Given

    cases = find_cases(paths)
    if len(cases) != 1:
        fault = Fault("--recording", "", number_of(len(cases), "case"), "one case, the rotor that was recorded")
        raise InputError(fault)
    found, records = load_all(list(recordings), [str(cases[0])], list(references))
    target = (out / found[0].name / "diagnosis").as_posix()
    folder.check(target, found)
    about = {"recordings": list(recordings), "cases": [c.name for c in found]}
    about |= {"references": list(references)} if references else {}
    own, known = (tuple(map(shlex.quote, files)) for files in (recordings, references))
    where = cases[0].parent if cases[0].name == "case.toml" else cases[0]
    asked = Given(own, known, f"--case {shlex.quote(str(where))}")
    try:
        answer = diagnose(records, found, None, progress, given=asked)
    except InputError as error:
        if len(recordings) > 1 or any(f.where != "readings" for f in error.faults):
            raise
        one = compare_run(recordings[0], found[0], progress)
        few = f"One point cannot name a cause. {one.sentence} Next: {one.next}."
        told = one.document() | about | {"verdict": "insufficient", "effects": [], "explanation": few}
        write_atomic(Path(target) / "diagnosis.json", json_text(told))
        write_atomic(Path(target) / f"{FIRST}.png", first_picture(records, found)[0].png())
        return
    folder.write(target, answer, document(answer) | about, found)
