"""Files of one CFD run become the points of a recording: joined, units, zones, sector and sign applied once, averaged.

Which column is which load: :mod:`bemt.data.recordings.cfd_loads`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NoReturn, TypeGuard

import numpy as np

from bemt.base.arrays import Array
from bemt.base.averaging import Mean
from bemt.base.errors import Fault, InputError, gathered, refuse
from bemt.base.tables import number_of
from bemt.data import readers
from bemt.data.readers.cfd import unit_of
from bemt.data.readers.cfd_run import GridTable, RunToml
from bemt.data.readers.headings import channel_of, heading, meanings
from bemt.data.readers.marks import EXPORT
from bemt.data.recordings.cfd_files import (
    CHANNEL,
    COEFFICIENTS,
    PROGRAMS,
    WALLS,
    LoadColumn,
    Settled,
    cfd_files,
    clock_of,
    columns_of,
    monitored_y_plus,
    other_than_loads,
    read_run,
    settled,
    y_plus,
    zone_of,
)
from bemt.data.recordings.cfd_loads import (
    NET,
    TURNS,
    OpenRun,
    across,
    by_zone,
    counted_zones,
    other_axes,
    same_shaft,
)
from bemt.data.recordings.cfd_setup import THRUSTS, TORQUES, CfdRun, Elsewhere, with_grid_floor
from bemt.data.recordings.channels import moves
from bemt.data.recordings.check import check
from bemt.data.recordings.grid_study import COVERAGE
from bemt.data.recordings.grids import CELL_SIZE, by_grid, groups, together
from bemt.physics.dataset import Dataset

__all__ = ["NO_LOAD", "assemble", "is_run", "run_at"]

NO_LOAD = "a thrust or a torque"
WHICH = "--column airspeed=NAME says what it is, --ignore NAME leaves it out"
"""What to do with a column that nothing read."""
MOVING = 0.01
"""Drift over the averaged part above which a load has not settled. [1]"""
LOST = 0.5
"""Drift above which there is no mean worth a point. [1]"""
_GRIDS = frozenset(("cells", "cell_size"))
_POINT = ("rpm", "airspeed_m_s", "density_kg_m3", "J")
_KNOWN = frozenset((*COEFFICIENTS, "eta", "eta0", "FM", "time_s"))
"""Names of columns that say the loads once more."""
_NAMED_LOAD = re.compile(r"force|thrust|torque|moment|lift|drag", re.IGNORECASE)
_BESIDE = {"force.dat": "moment.dat", "moment.dat": "force.dat"}  # files that OpenFOAM writes beside each other


def run_at(path: str, rpm: float | None = None, airspeed_m_s: float | None = None) -> CfdRun | None:
    """Run of a run.toml, a folder or an export at a stated speed; None for anything that is no CFD."""
    at = Path(path)
    told = {k: v for k, v in (("rpm", rpm), ("airspeed_m_s", airspeed_m_s)) if v is not None}
    made = at / "run.toml" if (at / "run.toml").is_file() else at
    kind = readers.kind_of(made) if made.is_file() else ""
    if kind == "cfd_run":
        run = readers.read(made, kind)
        if twice := [k for k in told if getattr(run.run, k) not in (None, told[k])]:
            got = ", ".join(f"{k} {told[k]:g}, where the run has {getattr(run.run, k):g}" for k in twice)
            raise InputError(Fault(path, "run", got, "one operating point", "Leave out the option"))
        run = run.model_copy(update={"run": run.run.model_copy(update=told)})
        return assemble(run, made.parent, path)
    files = cfd_files(made) if made.is_dir() else (made,) if kind in PROGRAMS else ()
    other = made.with_name(_BESIDE[made.name]) if made.name in _BESIDE else made
    files += (other,) if kind in PROGRAMS and other != made and other.is_file() else ()
    if not files:
        return None
    return assemble(RunToml.model_validate({"run": {"files": tuple(map(str, files)), **told}}), Path(), path)


def run_of(path: str | Path) -> CfdRun | None:
    """Run that a run.toml or a table on stated grids is by itself; None for any other file."""
    from bemt.data.recordings.load import import_file  # which needs this module

    found = import_file(path) if readers.detect(path) in ("cfd_run", "table") else None
    return found if found is not None and is_run(found) else None


def is_run(record: Dataset) -> TypeGuard[CfdRun]:
    """Whether a dataset is a run that was assembled here."""
    return isinstance(record, CfdRun)


def _sum(parts: Sequence[tuple[float, Settled]]) -> Settled:
    over = parts[0][1].over + (f", {len(parts)} zones" if len(parts) > 1 else "")
    return Settled(
        np.sum([k * s.values for k, s in parts], axis=0), sum(k * s.drift for k, s in parts),
        math.hypot(*(s.scatter for _, s in parts)), over,
    )  # fmt: skip


@np.errstate(over="ignore")  # a damaged file may hold any number
def assemble(run: RunToml, folder: Path = Path(), name: str = "run") -> CfdRun:
    """Points of a run: rpm, thrust, torque, the duct's part, with u, and how each was averaged.

    One point, or one for each design point, from files relative to `folder`; runs of one condition on several grids
    (``[[grids]]``, or rows of unlike cells) are one point, with `studies` (`grids.by_grid`). InputError with
    everything that has to be said first: units, zones, speed.
    """
    if run.grids:
        return _grids(run, folder, name)
    work, read = _opened(run, folder, name)
    if not work.complete:
        _ask_all(work)
    rpm = work.speed()
    work.period = 60.0 / float(rpm[0]) if rpm.size == 1 and np.isfinite(rpm[0]) else math.nan
    times = [c[1][-1] for _, r in read if r.clock == "time" and (c := clock_of(r))[1].size]
    work.end = float(min(times)) if times else math.inf
    if times and not math.isfinite(work.period):
        work.period = 1.0
        _ask_all(work)
    loads = {name: load for q in ("thrust", "torque", "power") for name, load in _summed(work, q).items()}
    same_shaft(work)
    for column in work.named("duct_thrust")[:1] if run.columns.duct_thrust is not None else []:
        if (own := work.mean("duct_thrust", column)) is not None:
            loads["duct_thrust"] = own
    found = _applied(work, rpm, loads)
    if work.faults:
        raise InputError(work.told)
    return _dataset(work, found, read)


def _without(columns: Sequence[LoadColumn], ignore: Sequence[str], name: str) -> tuple[list[LoadColumn], list[Fault]]:
    """Columns but those to ignore; faults of names that none of run `name` has."""
    known = dict.fromkeys(n for c in columns for n in (c.name, c.stem))
    faults = [Fault(name, "ignore", repr(n), f"one of {', '.join(known)}") for n in ignore if n not in known]
    return [c for c in columns if not {c.name, c.stem} & {*ignore}], faults


def _opened(run: RunToml, folder: Path, name: str) -> tuple[OpenRun, list[tuple[str, Dataset]]]:
    """The files of a run as they were read, and their columns side by side."""
    files = [folder / f for f in run.run.files]
    walls = y_plus(files)
    read, faults = read_run([f for f in files if f.name != WALLS or not walls])
    homes = {zone_of(Path(f), r.format) for f, r in read if any(n.startswith("force_") for n in r.values)}
    columns = [c for file, record in read for c in columns_of(file, record, len(homes) > 1)]
    columns, unknown = _without(columns, run.run.ignore or (), name)
    faults = faults or unknown
    told = {"restart": False, "joined": False, "left out": False, "rhoInf": bool(run.reference.density_kg_m3),
            "--sector": bool(run.run.sector)}  # fmt: skip
    notes = [n for _, r in read for n in r.notes if any(word in n and not said for word, said in told.items())]
    return OpenRun(run, name, columns, complete=not faults, notes=notes, faults=faults,
                   walls=walls or monitored_y_plus(columns)), read  # fmt: skip


def _summed(work: OpenRun, quantity: str) -> dict[str, Settled]:
    """A load summed over the zones that count, and the duct's part of a thrust; {} where it is not whole."""
    pool = work.pools[quantity] = by_zone(work, quantity)
    counted, ducts = counted_zones(work, quantity, pool) if pool else ([], [])
    if not counted:
        return {}
    thrust, own = quantity == "thrust", [z for _, z in counted]
    means = {z: work.mean(quantity, pool[z]) for z in dict.fromkeys([*own, *(ducts if thrust else ())])}
    known = {z: v for z, v in means.items() if v is not None}
    if len(known) < len(means):
        return {}
    loads = {quantity: _sum([(k, known[z]) for k, z in counted])}
    _beside(work, quantity, pool, counted, float(np.nanmean(loads[quantity].values)))
    if thrust and ducts and work.run.columns.duct_thrust is None:
        loads["duct_thrust"] = _sum([(1.0, known[z]) for z in ducts])
        work.notes.append(f"duct_thrust_N is that of {', '.join(ducts)}")
    if thrust and own != [""]:
        work.notes.append(f"thrust is that of {' + '.join(z or 'the whole' for z in own)}")
    return loads


def _beside(
    work: OpenRun, quantity: str, pool: Mapping[str, LoadColumn], counted: Sequence[tuple[float, str]], value: float
) -> None:  # fmt: skip
    """Keep what the files hold beside a load: zones that are not counted, components across the shaft."""

    def mean(c: LoadColumn) -> float:
        found = work.mean(quantity, c)
        return math.nan if found is None else float(np.nanmean(found.values))

    own = {z for _, z in counted}
    single = {z for z in pool if z.lower() not in NET}
    if quantity == "thrust":
        work.zones = frozenset(own & single or single or own)
        left = [z for z in pool if z in single - own] if own <= single else []
        if left and value:
            whole = value + sum(mean(pool[z]) for z in left)
            work.elsewhere.append(Elsewhere(CHANNEL[quantity], f"with {' + '.join(left)}", abs(whole / value)))
    axes: dict[str, float] = {}
    for k, z in counted:
        for c in other_axes(work, pool[z]):
            axes[c.axis] = axes.get(c.axis, 0.0) + k * mean(c)
    across(work, quantity, next(iter(pool.values())).axis, value, axes)


def _grids(run: RunToml, folder: Path, name: str) -> CfdRun:
    """Runs on several grids, the options the same for all of them, as one study."""
    parts, faults = list[CfdRun](), list[Fault]()
    for grid in run.grids:
        with gathered(faults):
            parts.append(_one_grid(run, folder, grid))
    refuse(dict.fromkeys(faults))
    return replace(together(parts, name=name), files=run.files)


def _one_grid(run: RunToml, folder: Path, grid: GridTable) -> CfdRun:
    """Run on one grid of several, with the cells that are stated."""
    at = [folder / f for f in grid.files]
    made = at[0] / "run.toml" if (at[0] / "run.toml").is_file() else at[0]
    part = run_of(made) if len(at) == 1 and made.is_file() else None
    if part is None:
        files = tuple(str(f) for path in at for f in (cfd_files(path) if path.is_dir() else (path,)))
        own = run.run.model_copy(update={"files": files})
        setup = run.setup.model_copy(update={"cells": None})
        part = assemble(run.model_copy(update={"run": own, "grids": (), "setup": setup}), Path(), str(at[0]))
    return part if grid.cells is None else replace(part, conditions={**part.conditions, "cells": grid.cells})


def _nothing(work: OpenRun) -> None:
    """Say that no column is a load, unless a fault says already what one needs."""
    if not work.complete or any(f.where != "rpm" for f in work.faults):
        return
    known = ", ".join(list(dict.fromkeys(c.name for c in work.columns))[:8]) or "none but the clock"
    if what := other_than_loads(c.name for c in work.columns):
        return work.fault(None, "", f"{what} ({known})", NO_LOAD, EXPORT)
    first = next((c.name for c in work.columns if not c.unit and not heading(c.words).unit), "NAME")
    hint = f'Say which it is by its unit: --unit "{first}=N" for a thrust, "{first}=N m" for a torque'
    if rest := list(dict.fromkeys(c.words for c in work.columns if c.of_reference)):
        hint = f"Coefficients: --column thrust={rest[0]}{f' torque={rest[1]}' if len(rest) > 1 else ''} --reference "
        hint += "area=A,length=L,speed=V,density=RHO of the solver; of T/(rho n^2 D^4) they are 2 D^2, D and n D"
    work.fault(None, "", f"columns {known}", NO_LOAD, hint)


def _ask_all(work: OpenRun) -> NoReturn:
    """Refuse a run; a missing speed with the units, zones and reference values that are missing too."""
    pools = {quantity: pool for quantity in ("thrust", "torque", "power") if (pool := by_zone(work, quantity))}
    for quantity, pool in pools.items():
        counted_zones(work, quantity, pool)
        work.si(quantity, next(iter(pool.values())))
    if not pools:
        _nothing(work)
    raise InputError(work.told)


@dataclass(frozen=True, eq=False)
class _Points:
    """Channels of a run with their u, and by load what the average was taken over and its drift over its size."""

    values: dict[str, Array]
    u: dict[str, Array] = field(default_factory=dict)
    averaged: dict[str, str] = field(default_factory=dict)
    drift: dict[str, float] = field(default_factory=dict)

    def whole(self, name: str) -> dict[str, Array]:
        """Every channel with one value for each row of run `name`."""
        sizes = {k: v.size for k, v in self.values.items()}
        rows = max(sizes.values())
        if {*sizes.values()} - {1, rows}:
            got = ", ".join(f"{k} {size}" for k, size in sizes.items())
            raise InputError(Fault(name, "", f"columns of unlike length ({got})", "files of one run"))
        return {k: np.broadcast_to(v, (rows,)).copy() for k, v in self.values.items()}


def _operating(work: OpenRun, rpm: Array) -> dict[str, Array]:
    """Operating point, as stated or from columns, and the cells of the grids."""
    head, values = work.run.run, {"rpm": rpm} if np.isfinite(rpm).any() or work.faults else {}
    if own := work.named("cells")[:1]:
        values["cells"] = own[0].record[own[0].name]
        work.used.add(own[0].name)
    elif sized := [c for c in work.columns if CELL_SIZE.fullmatch(c.stem)][:1]:
        unit = unit_of(sized[0].unit) if sized[0].unit else None
        values["cell_size"] = (sized[0].record[sized[0].name] * (1.0 if unit is None else unit.factor)) ** -3.0
        work.size_unit = "m" if unit is not None and unit.dimension == "length" else ""
        work.used.add(sized[0].name)
    for name, quantity in (("airspeed_m_s", "airspeed"), ("density_kg_m3", "density")):
        own, given = work.named(quantity), getattr(head, name)
        if given is not None:
            values[name] = np.array([given])
            rows = bool(own) and own[0].record.clock not in ("time", "iteration")
            told = work.si(quantity, own[0]) if rows else None
            if told is not None and not np.allclose(told, given):
                got = f"{given:g}, where the rows have {np.min(told):.4g} to {np.max(told):.4g}"
                work.fault(None, quantity, got, "one source of it", "Leave out the option")
        elif own and (v := work.si(quantity, own[0])) is not None:
            values[name] = v[-1:] if own[0].record.clock in ("time", "iteration") else v
    return values


def _applied(work: OpenRun, rpm: Array, loads: Mapping[str, Settled]) -> _Points:
    """Sector and sign applied, the operating point beside the loads."""
    sector, points = work.run.run.sector or 1, _Points(_operating(work, rpm))
    values = points.values
    signs, times = work.signs(loads, values), sector * work.of_density(loads, values)
    for quantity, found in loads.items():
        name = CHANNEL[quantity]
        values[name] = signs[quantity] * times * found.values
        size = math.hypot(*(abs(x) for x in (found.drift, found.scatter) if math.isfinite(x)), 0.0)
        points.u[name] = np.broadcast_to(size * times, values[name].shape).copy()
        points.averaged[name] = found.over
        mean = float(np.nanmean(found.values)) if np.isfinite(found.values).any() else math.nan
        if math.isfinite(found.drift) and mean:
            drift = points.drift[name] = found.drift / mean
            if abs(drift) > LOST:
                got = f"a mean that drifts by {drift:+.0%}"
                work.fault(None, quantity, got, "a run that has converged", "Run on, or start later")
            elif abs(drift) > MOVING:
                work.notes.append(f"not settled: {quantity} drifts by {drift:+.1%} over the averaged part; in u")
    if sector > 1:
        work.notes.append(f"one of {sector} sectors: loads times {sector}; holds for axisymmetric flow")
    if not {"thrust_N", "torque_Nm"} & values.keys():
        _coefficients(work, points)
    if not {"thrust_N", "torque_Nm", "power_W", "CT", "CQ"} & values.keys():
        _nothing(work)
    elif "airspeed_m_s" not in values and "J" not in values:
        for c in [c for c in work.columns if c.coefficient[0] == "J" and _table(c.record)][:1]:
            values["J"] = c.record[c.name]
            work.used.add(c.name)
    if not work.faults:
        _unused(work, values)
    return points


def _table(record: Dataset) -> bool:
    """Whether the rows of an export are runs, and no history."""
    return record.clock not in ("time", "iteration") and len(record) > 1


def _unused(work: OpenRun, values: Mapping[str, Array]) -> None:
    """Name columns that became nothing, and those that no word but the user's made a load."""
    for quantity in ("thrust", "torque"):
        told = work.fact(quantity).column
        if told is not None and quantity not in meanings(told):
            work.notes.append(f"{quantity} is {told}, as stated")
    left = [c.name for c in work.columns if c.record.clock and not c.part and c.name not in work.used]
    left = [n for n in left if channel_of(n) not in _KNOWN and not other_than_loads([n]) and _NAMED_LOAD.search(n)]
    if left:
        work.notes.insert(0, f"not used: {', '.join(dict.fromkeys(left))}; --column says what it is")
    rest = [c for c in work.columns if _table(c.record) and c.name not in work.used
            and channel_of(c.stem) not in _KNOWN and moves(c.record[c.name])]  # fmt: skip
    if rest:
        _unread_rows(work, values, ", ".join(dict.fromkeys(c.name for c in rest)), len(rest[0].record))


def _unread_rows(work: OpenRun, values: Mapping[str, Array], names: str, rows: int) -> None:
    """Name columns that vary and became nothing: rows that differ in one of them only are no repeats."""
    state = {k: v for k, v in values.items() if k not in CHANNEL.values() and v.size == rows}
    stated = state and not _GRIDS & state.keys()
    apart = any(len(g) > 1 for g in groups(Dataset("cfd", "", state))) if stated else not state
    end = f": {rows} rows, of which some differ in nothing else, are no repeats" if apart else ""
    work.unread = names if apart else ""
    work.notes.insert(0, f"not used, though the rows differ in it: {names}{end}; {WHICH}")


def _coefficients(work: OpenRun, points: _Points) -> None:
    """Loads as coefficients, where a file has nothing else."""
    for c in work.columns:
        name, factor = c.coefficient
        if name and name not in points.values:
            found = settled(factor * c.record[c.name], c.record, work.period, work.run.run.revolutions, work.end)
            if isinstance(found, Settled):
                points.values[name], points.averaged[name] = found.values, found.over
                work.used.add(c.name)
                if name != "J":
                    points.u[name] = np.full(found.values.size, math.hypot(np.nan_to_num(found.drift), found.scatter))


def _y_plus_of(walls: Mapping[str, tuple[float, float]]) -> dict[str, float | None]:
    """Mean and highest y+ of the walls that turn, of all where no name tells them."""
    told = [v for k, v in walls.items() if TURNS.search(k)] or list(walls.values())
    means, most = ([v for v in column if math.isfinite(v)] for column in zip(*told, strict=True)) if told else ([], [])
    return {"y_plus": float(np.mean(means)) if means else None, "y_plus_max": max(most, default=None)}


def _conditions(
    work: OpenRun, read: Sequence[tuple[str, Dataset]], each: Array | None, drift: float | None
) -> dict[str, Any]:
    """What is known of how a run was made; `each` the cells of its rows, `drift` that of its thrust."""
    clocks = {r.clock for _, r in read}
    digits = (str(r.provenance.get("cells", "")) for _, r in read)
    cells = next((float(text) for text in digits if text.isdigit()), None)
    found = {
        "program": " + ".join(dict.fromkeys(PROGRAMS[r.format] for _, r in read)),
        "cells": float(each[0]) if each is not None and np.unique(each).size == 1 else cells,
        "steady": False if "time" in clocks else True if "iteration" in clocks else None, "thrust_from": "forces",
    }  # fmt: skip
    found |= _y_plus_of(work.walls)
    more = {"drift_thrust": drift, "u_grid": _stated_grid(work).get("thrust_N")}
    return {k: v for part in (found, work.run.setup.given(), more) for k, v in part.items() if v is not None}


def _stated_grid(work: OpenRun) -> dict[str, float]:
    """Standard uncertainty by the grid as stated, by channel [1]: of one load it says nothing of the other."""
    told = work.run.setup
    own = ((THRUSTS, told.gci_pct), (TORQUES, told.gci_torque_pct))
    return {k: 0.01 * gci / COVERAGE for channels, gci in own if gci is not None for k in channels}


def _dataset(work: OpenRun, points: _Points, read: Sequence[tuple[str, Dataset]]) -> CfdRun:
    """Points of a run as a dataset: rows without a load left out, those of several grids as one study."""
    name, values, averaged, drift = work.name, points.values, points.averaged, points.drift
    whole = points.whole(name)
    full = {k: v for k, v in whole.items() if k not in _GRIDS}
    rows = max(map(len, whole.values()))
    conditions = _conditions(work, read, values.get("cells"), drift.get("thrust_N"))
    labels = next((tuple(r.texts["name"]) for _, r in read if len(r.texts.get("name", ())) == rows), ())
    sha256 = "+".join(r.sha256 for _, r in read)
    about: dict[str, Any] = {"file": name, "format": "cfd_run", "sha256": sha256}
    if rows == 1:
        about["means"] = {k: Mean(float(full[k][0]), over, drift.get(k)) for k, over in averaged.items()}
    made = CfdRun("cfd", Path(name).name, full, {k: np.broadcast_to(v, (rows,)) for k, v in points.u.items()}, (),
                  about, labels, notes=tuple(dict.fromkeys(work.notes)), files=tuple(work.run.run.files),
                  conditions=conditions, averaged=averaged, drift=drift, units_given=work.units_given, zones=work.zones,
                  elsewhere=tuple(work.elsewhere), unread=work.unread)  # fmt: skip
    keep = np.any([np.isfinite(v) for k, v in full.items() if k not in _POINT], axis=0)
    if not keep.all():
        note = f"{number_of((~keep).sum(), 'point')} without a load left out"
        made = replace(made.select(keep), notes=(*made.notes, note))
    made = replace(made, notes=(*_slips(made), *made.notes))
    grids = next((whole[k][keep] for k in ("cells", "cell_size") if k in whole), np.zeros(0))  # or h^-3
    if np.unique(grids).size > 1:
        return by_grid(made, grids, None if "cells" in values else work.size_unit)
    u = _stated_grid(work)
    told = ", ".join(f"{k.split('_')[0]} {u[k]:.2%}" for k in ("thrust_N", "torque_Nm") if k in u)
    return with_grid_floor(made, u, (f"u of the grid: {told}, as stated",) if u else ())


def _slips(
    run: CfdRun, diameter_m: float | None = None, density_kg_m3: float | None = None, ducted: bool = False
) -> tuple[str, ...]:  # fmt: skip
    """Slips of a unit that the loads of a run show; what lies elsewhere is none."""
    of_case = {"diameter_m": diameter_m, "density_kg_m3": density_kg_m3}
    found = () if run.elsewhere else check(run, ducted=ducted or "duct_thrust_N" in run, **of_case)
    open_ = density_kg_m3 is None and "density_kg_m3" not in run
    fluid = "density, not stated and taken for that of air (--density-kg-m3), or " if open_ else ""
    return tuple(f"{f.evidence}. Suggestion: {fluid}{f.correction}" for f in found if f.severity != "note")


def of_rotor(run: CfdRun, diameter_m: float, density_kg_m3: float, ducted: bool) -> CfdRun:
    """A run of a rotor that is known, in air or water of its case: no slip is seen by a diameter that was guessed."""
    guessed = set(_slips(run))
    said = _slips(run, diameter_m, density_kg_m3, ducted)
    return replace(run, notes=(*said, *(note for note in run.notes if note not in guessed)))
