"""This project's own CFD: recordings of campaigns (schema ``bemt.cfd-recording/1``) found in the folder of results.

A recording is audited like anybody else's number. What has another shape than expected is left out.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from pathlib import Path
from typing import Any

from bemt.base.document import Documented
from bemt.base.page import PageTable, num, table
from bemt.data.readers import number
from bemt.data.recordings.audit import Audit, CfdFacts, facts_of
from bemt.results.report.book import Book, CasePage, Page, Section, picture, sections
from bemt.results.report.diagnosis_block import audit_parts
from bemt.results.report.gather import read_json, safe_files
from bemt.results.report.plot import DASHES, SERIES, SHAPES, Figure, Plot, Trace, figure
from bemt.results.sweep.rows import CaseConditions, Comparison, Result, Row
from bemt.rotors.validity import serious
from bemt.tools.cfd.schema import RunRow, run_of

SCHEMA = "bemt.cfd-recording/"
CSV_BYTES = 20_000_000
Loads = Sequence[tuple[float, float, float]]
"""Radius [m], thrust [N/m] and torque [N] per radius."""


class ShownRun(RunRow):
    """A run with the campaign that recorded it, and its audit where its case is known."""

    campaign: str = ""
    audit: Audit | None = None


@dataclass(frozen=True)
class Runs:
    """A campaign: its runs, loads along the radius by run, figures, and the grids behind its uncertainty."""

    name: str
    title: str
    case: str
    runs: tuple[ShownRun, ...]
    radial: Mapping[str, Loads]
    figures: Sequence[tuple[str, bytes]]
    grid_study: bool  # Whether the uncertainty rests on one, its own or of the same case
    levels: int  # Grids of its own study, 1 without


class _Study(Documented):
    levels: tuple[Any, ...] = ()


class _Rule(Documented):
    grid_study: bool = False


class _Manifest(Documented):
    schema: str = ""
    title: str = ""
    case: str = ""
    rule: _Rule = _Rule()
    grid_studies: tuple[_Study, ...] = ()


def read_rows(path: Path) -> list[dict[str, str]]:
    """Lines of a CSV file that somebody else wrote; none when it is missing or no text."""
    try:
        if path.stat().st_size > CSV_BYTES:
            return []
        text = path.read_text(encoding="utf-8", errors="replace")
        return [
            {k: v for k, v in row.items() if isinstance(k, str) and isinstance(v, str)}
            for row in csv.DictReader(io.StringIO(text))
        ]
    except (OSError, csv.Error):
        return []


def value(text: str | None) -> float:
    """Finite number in a cell, else NaN."""
    found = number(text) if text else None
    return found if found is not None and math.isfinite(found) else math.nan


def cfd_runs(out: Path) -> list[Runs]:
    """Read the recordings of CFD campaigns."""
    found = []
    for path in sorted(out.glob("cfd/*/manifest.json")):
        document = read_json(path)
        if not isinstance(document, Mapping):
            continue
        manifest, name = _Manifest.from_document(document, lenient=True), path.parent.name
        if not manifest.schema.startswith(SCHEMA):
            continue
        runs = []
        for row in read_rows(path.parent / "recording.csv"):
            run = ShownRun(**vars(run_of(row)), campaign=name)
            if run.rpm > 0 and math.isfinite(run.thrust_N):
                runs.append(run)
        radial: dict[str, list[tuple[float, float, float]]] = {}
        for row in read_rows(path.parent / "radial.csv"):
            point = tuple(value(row.get(k)) for k in ("r_m", "thrust_per_radius_N_m", "torque_per_radius_Nm_m"))
            if all(map(math.isfinite, point)):
                radial.setdefault(row.get("run", ""), []).append(point)  # type: ignore[arg-type]
        if runs:
            levels = max([1, *(len(study.levels) for study in manifest.grid_studies)])
            found.append(Runs(name, manifest.title or name, manifest.case, tuple(runs), radial,
                              safe_files(path.parent), manifest.rule.grid_study, levels))  # fmt: skip
    return found


def is_plain(run: ShownRun) -> bool:
    """Tell whether a run is the bare case: free domain, axial flow, no plate, blades as they are, settled.

    A sector of one blade counts with its balance only: its sides may leak.
    """
    apart = [run.sideslip_deg, run.pitch_offset_deg]
    closed = run.sector != "blade" or math.isfinite(run.balance_mass)
    return (closed and run.domain == "free" and run.settled and math.isnan(run.wall_distance_m)
            and all(not abs(v) > 1e-9 for v in apart))  # fmt: skip


def operating_run(found: Sequence[Runs], result: Result) -> ShownRun | None:
    """Choose the run that stands for a case at its operating point: compressible before not, then the finest grid."""
    c = result.conditions
    if c is None:
        return None
    ducted = result.kind == "fan"
    best = None
    for item in found:
        if item.case != result.name or ("duct" in item.name and not ducted):
            continue
        for run in item.runs:
            if (
                not is_plain(run)
                or abs(run.rpm / c.rpm - 1) > 1e-3
                or (math.isfinite(run.tip_gap_mm) and not ducted)
                or abs(run.airspeed_m_s - c.airspeed_m_s) > 0.05
            ):
                continue
            rank = (run.solver == "compressible", run.turbulence == "kOmegaSST", run.level)
            if best is None or rank > best[0]:
                best = (rank, run)
    return None if best is None else best[1]


def radial_of(found: Sequence[Runs], run: ShownRun) -> Loads:
    """Loads along the radius of a run, ascending."""
    return next((sorted(item.radial[run.run]) for item in found if run.run in item.radial), [])


def _facts(run: ShownRun, c: CaseConditions, ducted: bool, levels: int) -> CfdFacts:
    """What the audit asks for."""
    D, n = c.diameter_m, run.rpm / 60.0
    T, u = abs(run.thrust_N), run.u_thrust_N
    grid = math.sqrt(max((u / T) ** 2 - run.scatter_thrust**2, 0.0)) if T > 0 and levels > 1 else math.nan
    told = {**vars(run), "grids": levels, "u_grid": grid if grid > 0 else math.nan}
    return facts_of(told.get, True, M_tip=math.pi * D * n / c.a_sound_m_s, J=run.airspeed_m_s / (n * D), ducted=ducted,
                    pitch_over_D=c.pitch_075R_m / D, CT=run.thrust_N / (run.density_kg_m3 * n**2 * D**4))  # fmt: skip


def _plain_rows(found: Sequence[Runs], result: Result) -> list[Row]:
    """Runs of the bare case as rows like those of a sweep, each condition and flow once, finest grid."""
    c = result.conditions
    if c is None:
        return []
    best: dict[tuple[Any, ...], ShownRun] = {}
    for item in found:
        if item.case != result.name or ("duct" in item.name and result.kind != "fan"):
            continue
        for run in filter(is_plain, item.runs):
            if run.turbulence == "kOmegaSST":
                key = (run.solver, round(run.rpm, 3), round(run.airspeed_m_s, 3))
                if key not in best or run.level > best[key].level:
                    best[key] = run
    rows = []
    for run in best.values():
        n, D, rho = run.rpm / 60.0, c.diameter_m, run.density_kg_m3
        power = 2 * math.pi * n * run.torque_Nm
        rows.append(Row(
            "openfoam" if run.solver == "compressible" else "openfoam incompressible",
            f"{run.solver}, {run.cells:.0f} cells", run.thrust_N, rpm=run.rpm, airspeed_m_s=run.airspeed_m_s,
            u=run.u_thrust_N, torque_Nm=run.torque_Nm, power_W=power, CT=run.thrust_N / (rho * n**2 * D**4),
            CP=power / (rho * n**3 * D**5),
        ))  # fmt: skip
    return rows


def report_pages(book: Book, out: Path) -> Book:
    """Page of the campaigns in a folder of results; their numbers join the cases.

    Every run is audited, and the run at a case's operating point compared with its BEMT. The uncertainty of the run is
    that of its audit, so it is unknown as long as one of its lines is.
    """
    book, found = attach(book, cfd_runs(out))
    page = Page("cfd", "Own CFD", "Own CFD", [("words", CFD_WORDS)], cfd_sections(found))
    return replace(book, tools=(*book.tools, page))


def attach(book: Book, found: Sequence[Runs]) -> tuple[Book, list[Runs]]:
    """Audit the runs; put those of a case to its page."""
    results = {page.result.name: page.result for page in book.cases if page.result.conditions}
    audited = [_audited(item, results[item.case], found) if item.case in results else item for item in found]
    return replace(book, cases=tuple(_with_own(page, audited) for page in book.cases)), audited


def _audited(item: Runs, result: Result, found: Sequence[Runs]) -> Runs:
    ducted, levels = result.kind == "fan" or "duct" in item.name, 1
    if item.grid_study:  # of its own, else of the same case
        levels = max([item.levels, *(o.levels for o in found if o.case == item.case)])
    runs = (
        replace(run, audit=Audit.of(f"{item.name}: {run.run}", _facts(run, result.at, ducted, levels)))
        for run in item.runs
    )
    return replace(item, runs=tuple(runs))


def _with_own(page: CasePage, found: Sequence[Runs]) -> CasePage:
    """The page with the runs of its case, and that at its operating point compared with BEMT."""
    result = page.result
    page = replace(page, own_rows=_plain_rows(found, result))
    run, bemt = operating_run(found, result), result.first("bemt")
    if run is None:
        return page
    words = f"{run.campaign}, {run.solver}, {run.cells:.0f} cells"
    page = replace(page, own_points=[("openfoam", words, run.thrust_N, run.u_thrust_N)],
                   own_radial={f"CFD, own, {run.solver}": radial_of(found, run)})  # fmt: skip
    if bemt is None or math.isnan(bemt.thrust_N):
        return page
    share = run.audit.u_relative if run.audit else math.nan
    u_num, u_input, u_model = (math.nan if u is None else u for u in (bemt.u_num, bemt.u_input, bemt.u_model))
    line = Comparison("bemt", f"own CFD, {run.solver}", "openfoam", "thrust_N", "N", bemt.thrust_N, run.thrust_N, u_num,
                      u_input, u_model, abs(run.thrust_N) * share, tuple(serious(bemt.flags)), bemt.rpm,
                      bemt.airspeed_m_s)  # fmt: skip
    return replace(page, result=replace(result, comparisons=(*result.comparisons, line)))


CFD_WORDS = (
    "OpenFOAM runs on the solids of the cases: rotating frame, wall functions, forces integrated over the blades. "
    "Each run is audited like any other CFD result."
)

VARIED = (("J", "J [-]"), ("wall_distance_m", "distance of the plate [m]"), ("tip_gap_mm", "tip gap [mm]"),
          ("sideslip_deg", "angle of the inflow [deg]"), ("pitch_offset_deg", "offset of the blade angle [deg]"),
          ("cells", "cells [-]"))  # fmt: skip
SHOWN = (("rpm", "rpm", 6), ("airspeed_m_s", "V [m/s]", 4), ("J", "J", 3), ("thrust_N", "T [N]", 4),
           ("u_thrust_N", "u [N]", 2), ("torque_Nm", "Q [N m]", 4), ("wall_distance_m", "plate [m]", 3),
           ("tip_gap_mm", "gap [mm]", 3), ("sideslip_deg", "skew [deg]", 3), ("pitch_offset_deg", "dβ [deg]", 3),
           ("cells", "cells", 6), ("yplus_avg", "y+", 3), ("drift_thrust", "drift", 2))  # fmt: skip


def _plots(item: Runs) -> list[Figure | None]:
    """Thrust and torque over the quantity that was varied most, one line per group of the others."""
    runs = [r for r in item.runs if r.settled]

    def values(key: str) -> set[float]:
        found = [getattr(r, key) for r in runs]
        return {round(v, 6) for v in found if math.isfinite(v)}

    name, label = max(VARIED, key=lambda v: (len(values(v[0])), -VARIED.index(v)))
    if len(values(name)) < 2:
        return []
    groups: dict[str, list[ShownRun]] = {}
    for run in runs:
        words = [run.solver, run.domain, f"{run.rpm:g} rev/min"]
        if name != "J" and len(values("J")) > 1:
            words.append(f"J {run.J:.2g}")
        if len({r.turbulence for r in runs}) > 1:
            words.append(run.turbulence)
        groups.setdefault(", ".join(words), []).append(run)
    if name == "cells" and len(values(name)) < 3:
        return []
    plots = []
    for key, word in (("thrust_N", "thrust [N]"), ("torque_Nm", "torque [N m]")):
        traces = []
        for i, (group, rows) in enumerate(groups.items()):
            rows = sorted(rows, key=attrgetter(name))
            x, y, u = ([getattr(r, of) for r in rows] for of in (name, key, f"u_{key}"))
            look = SERIES[i % len(SERIES)], DASHES[i % len(DASHES)], SHAPES[i % len(SHAPES)]
            traces.append(Trace(group, x, y, u, *look, points=len(rows) == 1))
        plots.append(figure(Plot(f"{word.split(' [')[0].capitalize()}: {item.title}", label, word, traces)))
    return plots


def _runs(item: Runs) -> PageTable | None:
    def told(key: str) -> bool:
        values = [getattr(r, key) for r in item.runs]
        return any(math.isfinite(v) and (v != 0 or key in ("J", "airspeed_m_s")) for v in values)

    used = [c for c in SHOWN if told(c[0])]
    rows = []
    for run in item.runs:
        u = 100 * run.audit.u_relative if run.audit else math.nan
        state = "settled" if run.settled else "did not settle"
        rows.append([run.run[:6], run.solver, run.domain, *(num(getattr(run, key), digits) for key, _, digits in used),
                     num(u, 2, none="unknown"), state])  # fmt: skip
    return table(["run", "flow", "domain", *(label for _, label, _ in used), "u of T by audit [%]", "state"], rows)


def cfd_sections(found: Sequence[Runs]) -> list[Section]:
    """Give the figures of all campaigns of this project's own CFD, then the runs and an audit of each."""
    figures, tables = [], []
    for item in found:
        figures += [*_plots(item), *(picture(name, data) for name, data in item.figures)]
        first = next((run.audit for run in item.runs if run.audit), None)
        parts = [("table", _runs(item)), *(audit_parts(first) if first else [])]
        tables.append(("more", (f"{item.title}: {len(item.runs)} runs, audit of the first", parts)))
    return sections(("Figures", [("figures", figures)]), ("Campaigns", tables))
