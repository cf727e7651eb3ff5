"""What a campaign leaves: recording, manifest, loads along the radius, histories of runs that did not settle."""

from __future__ import annotations

import csv
import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bemt import __version__
from bemt.base.document import rows_of
from bemt.base.errors import Fault, InputError
from bemt.base.tables import csv_text, plain, write_atomic
from bemt.data.readers import number
from bemt.data.recordings.cfd_setup import GRID_FLOOR_SOURCE, grid_floor
from bemt.data.recordings.grid_study import grid_study, ratios
from bemt.tools.cfd.balance import BALANCE_LIMIT
from bemt.tools.cfd.schema import COLUMNS, TEXTS, Campaign, RunRow, Study, StudyResult
from bemt.tools.cfd.worker import DRIFT_LIMIT, RESIDUALS, SCATTER_LIMIT, Outcome

LOADS = ("thrust_N", "torque_Nm")
RADIAL = ("run", "r_m", "thrust_per_radius_N_m", "torque_per_radius_Nm_m")
SAME = ("rpm", "airspeed_m_s", "wall_distance_m", "tip_gap_mm", "sideslip_deg", "pitch_offset_deg", "solver", "gas",
        "domain", "sector", "turbulence")  # fmt: skip
POINT = (*SAME[:6], "level")
"""What a run is of; solver, domain, turbulence and iterations are how it was computed."""
HISTORY_ROWS = 400
NO_BALANCE = "not recorded: made before the balance check"
NOT_ENDED = "not recorded: the run did not come to its end"
FORMAL_ORDER = 2.0


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, float) and isinstance(b, float):
        return (math.isnan(a) and math.isnan(b)) or math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-9)
    return bool(a == b)


def _alike(a: RunRow, b: RunRow, names: Sequence[str]) -> bool:
    return all(_same(getattr(a, k), getattr(b, k)) for k in names)


def _read(path: Path) -> list[RunRow]:
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as stream:
        reader = csv.DictReader(stream)
        if tuple(reader.fieldnames or ()) != COLUMNS:
            expected = "the header of a campaign's recording"
            raise InputError(Fault(path.as_posix(), "1", "another header", expected, "Move the file away"))
        rows = []
        for line, cells in enumerate(reader, 2):
            row: dict[str, Any] = {}
            for key in COLUMNS:
                text = cells.get(key)
                if text is None:
                    hint = "Delete the line; the point will be run again"
                    raise InputError(Fault(path.as_posix(), str(line), "a line cut short", "all cells", hint))
                value = text if key in TEXTS else number(text) if text else math.nan
                if value is None:
                    raise InputError(Fault(path.as_posix(), f"{line}: {key}", repr(text), "a number"))
                row[key] = value
            rows.append(RunRow(**row))
    return rows


def _tried(row: RunRow) -> bool:
    """Whether a run says something of its flow; else a program failed before, which may have been the machine's."""
    return row.settled or row.iterations > 0


def grid_studies(rows: Sequence[RunRow]) -> list[Study]:
    """Find the points that differ in their grid alone and do a grid study of each."""
    groups: list[list[RunRow]] = []
    for row in rows:
        home = next((g for g in groups if _alike(g[0], row, SAME)), None)
        groups.append([row]) if home is None else home.append(row)
    out = []
    for group in groups:
        solved = sorted((r for r in group if r.settled), key=lambda r: -r.level)
        fine = solved[:3]
        if len({r.level for r in fine}) < 2:
            continue
        cells = tuple(float(r.cells) for r in fine)
        steps = tuple(2.0 ** (a.level - b.level) for a, b in zip(fine, fine[1:], strict=False))
        studies = []
        for key in LOADS:
            values = [float(getattr(r, key)) for r in fine]
            found = grid_study(values, steps, FORMAL_ORDER)
            spread = 3.0 * (max(values) - min(values)) / 1.15
            each = {}
            for row in solved:
                value, u = float(getattr(row, key)), found.u_relative * abs(values[0])
                if row is not fine[0]:  # a coarser grid owes its distance to the best estimate as well
                    best = found.extrapolated if found.extrapolated is not None and not found.flags else values[0]
                    u = max(u, 1.25 * abs(value - best) / 1.15)
                each[f"{row.level:g}"] = u / abs(value)
            studies.append(StudyResult(tuple(values), found.order, found.extrapolated, found.gci_fine, found.gci_coarse,
                                     spread / abs(values[0]), found.flags, each))  # fmt: skip
        point = {k: getattr(fine[0], k) for k in SAME}
        T, Q = studies
        out.append(Study(**point, levels=tuple(r.level for r in fine), cells=cells, ratios=steps,
                         by_cells=tuple(ratios(cells)), thrust_N=T, torque_Nm=Q))  # fmt: skip
    return out


def grid_uncertainty(studies: Sequence[Study], row: RunRow) -> dict[str, float]:
    """Standard uncertainty by the grid at a row's level: the largest of the studies, linear between levels. [1]"""
    found: dict[str, float] = {}
    for key in LOADS:
        for study in studies:
            told = study.of(key).u_relative
            levels, u = zip(*sorted((float(k), float(v)) for k, v in told.items()), strict=True)
            if levels[0] <= row.level <= levels[-1]:
                found[key] = max(found.get(key, 0.0), float(np.interp(row.level, levels, u)))
    return found


class CampaignRecord:
    """Files of one campaign; every change is written whole. A recording that is not one of ours is refused."""

    def __init__(self, campaign: Campaign) -> None:
        self.campaign = campaign
        self.folder = campaign.path.parent
        self.path = self.folder / "recording.csv"
        self.rows: list[RunRow] = _read(self.path)

    @property
    def done(self) -> set[str]:
        """Runs that are recorded, converged or not; one that never came to iterate is to be tried again."""
        return {row.run for row in self.rows if _tried(row)}

    def borrow(self, names: Sequence[str]) -> None:
        """Take over runs that a campaign beside this one has recorded already, with their balance."""
        for path in sorted(self.folder.parent.glob("*/recording.csv")):
            if path != self.path and not set(names) <= self.done:
                wanted = set(names) - self.done
                rows = [row for row in _read(path) if row.run in wanted and not math.isnan(row.balance_mass)]
                self._take(rows)
                self._radial(path.parent / "radial.csv", {row.run for row in rows})

    def _take(self, rows: Iterable[RunRow]) -> None:
        """Put in rows, in place of those of the same run."""
        new = {row.run: row for row in rows}
        self.rows = [row for row in self.rows if row.run not in new] + list(new.values())

    def add(self, outcome: Outcome, order: Sequence[str]) -> None:
        """Add a run and write everything."""
        name = outcome.row.run
        self._take(row for row in _read(self.path) if row.run not in self.done)  # by another process, meanwhile
        self._take([outcome.row])
        place = {run: k for k, run in enumerate(order)}
        self.rows.sort(key=lambda row: place.get(row.run, len(place)))
        if outcome.history is not None and not outcome.row.converged:
            step = max(1, len(outcome.history) // HISTORY_ROWS)
            names = ("iteration", "thrust_rotor_N", "torque_Nm", "thrust_standing_N")
            rows = [dict(zip(names, map(float, row), strict=True)) for row in outcome.history[::step]]
            write_atomic(self.folder / "histories" / f"{name}.csv", csv_text(names, _short(rows)))
        if outcome.radial is not None:
            self._radial(self.path, {name}, outcome.radial)
        self.write(order)

    def _radial(self, source: Path, names: set[str], table: Any = None) -> None:
        """Put the loads along the radius of some runs into our file: from a table, or from another campaign's file."""
        path = self.folder / "radial.csv"
        kept = [row for row in csv_rows(path) if row["run"] not in names]
        if table is None:
            rows: Sequence[Mapping[str, object]] = [row for row in csv_rows(source) if row["run"] in names]
        else:
            rows = _short([dict(zip(RADIAL, (*names, *map(float, row)), strict=True)) for row in table])
        if rows:
            write_atomic(path, csv_text(RADIAL, [*kept, *rows]))

    def studies(self) -> list[Study]:
        """Grid studies: those of this recording and of the campaign that it names; the larger uncertainty counts."""
        own = grid_studies(self.rows)
        other = self.campaign.grid_study
        if other is None or not (other / "manifest.json").is_file():
            return own
        return [*own, *studies_of(other)]

    def write(self, order: Sequence[str]) -> None:
        """Write recording and manifest, uncertainties from what is known now."""
        self._forget(order)
        studies = self.studies()
        self.rows = [_with_u(row, studies) for row in self.rows]
        write_atomic(self.path, csv_text(COLUMNS, _short([row.document() for row in self.rows])))
        manifest = self._manifest(order, bool(studies))
        write_atomic(self.folder / "manifest.json", json.dumps(plain(manifest), indent=1) + "\n")

    def _forget(self, order: Sequence[str]) -> None:
        """Drop the rows that say nothing any more."""
        # a run that did not converge and is no longer asked for
        gone = {row.run for row in self.rows if not row.converged and row.run not in order}
        self.rows = [row for row in self.rows if row.run not in gone]
        for run in gone:
            (self.folder / "histories" / f"{run}.csv").unlink(missing_ok=True)
        asked = [row for row in self.rows if row.run in order]
        self.rows = [
            # of one point on one grid, whatever the settings, the newer run replaces the other
            row for row in self.rows if row.run in order or not any(_alike(row, other, POINT) for other in asked)
        ]  # fmt: skip

    def _manifest(self, order: Sequence[str], studied: bool) -> dict[str, object]:
        """What is recorded of the runs asked for, and by which rule."""
        names = set(order)
        done = [row for row in self.rows if row.run in names]
        return {
            "schema": "bemt.cfd-recording/1", "name": self.campaign.name, "title": self.campaign.title,
            "bemt": __version__, "openfoam": "1912 (Debian package)", "case": self.campaign.case.name,
            "case_sha256": self.campaign.case.content_hash(),
            "campaign_sha256": hashlib.sha256(self.campaign.path.read_bytes()).hexdigest(),
            "points": len(order), "recorded": len(done), "converged": sum(int(r.converged) for r in done),
            "missing": [run for run in order if run not in {row.run for row in self.rows}],
            "not_converged": [{"run": r.run, "note": r.note} for r in done if not r.converged],
            "older": [row.run for row in self.rows if row.run not in names],
            **_balances(done),
            "rule": {"drift_limit": DRIFT_LIMIT, "scatter_limit": SCATTER_LIMIT, "balance_limit": BALANCE_LIMIT,
                     "u": "hypot of standard deviation and drift over the averaged iterations, and the grid study",
                     "grid_study": studied, **({} if studied else {"grid_floor": GRID_FLOOR_SOURCE})},
            "grid_studies": [study.document() for study in grid_studies(self.rows)],
            "seconds": float(np.nansum([r.seconds for r in self.rows])),
        }  # fmt: skip


def _with_u(row: RunRow, studies: Sequence[Study]) -> RunRow:
    """Row with the standard uncertainties of its loads; reading what was written changes nothing."""
    grid = {k: grid_floor(k, row.airspeed_m_s > 0.0) for k in LOADS} | grid_uncertainty(studies, row)

    def u(load: float, scatter: float, drift: float, of_grid: float) -> float:
        load, scatter, drift = (float(f"{v:.7g}") for v in (load, scatter, drift))
        return abs(load) * math.hypot(scatter, drift, of_grid) if row.settled else math.nan

    T, Q = (grid[key] for key in LOADS)
    return replace(row, u_thrust_N=u(row.thrust_N, row.scatter_thrust, row.drift_thrust, T),
                   u_torque_Nm=u(row.torque_Nm, row.scatter_torque, row.drift_torque, Q))  # fmt: skip


def _balances(rows: Sequence[RunRow]) -> dict[str, Any]:
    """Balance of every run, or why there is none; only runs that balance count as evidence."""
    each: dict[str, dict[str, float] | str] = {}
    for row in rows:
        if not math.isnan(row.balance_mass):
            each[row.run] = {name.removeprefix("balance_"): getattr(row, name) for name in RESIDUALS}
        else:
            each[row.run] = NO_BALANCE if row.settled else NOT_ENDED
    shown = sum(int(row.converged) for row in rows if isinstance(each[row.run], dict))
    return {"balanced": shown, "balance": each}


def studies_of(folder: Path) -> tuple[Study, ...]:
    """Grid studies that the manifest of a campaign holds."""
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return rows_of(Study, manifest.get("grid_studies", []))


def csv_rows(path: Path) -> list[dict[str, str]]:
    """Rows of a table of ours by column; none where there is no file."""
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def _short(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, object]]:
    """Rows with seven digits, more are noise; whole numbers without a point, so that reading changes nothing."""

    def short(value: Any) -> Any:
        value = plain(value, 7)
        return int(value) if isinstance(value, float) and value.is_integer() else value

    return [{k: short(v) for k, v in row.items()} for row in rows]
