"""Files of one CFD run become the points of a recording: joined, units, zones, sector and sign applied once, averaged.

Nothing is guessed that changes a number without saying so: a unit that no file states is asked for, so are the zones
that count. A load of which the sign is not given is turned to positive, and the note says it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bemt import readers
from bemt.base.arrays import Array
from bemt.base.averaging import Mean
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_of, number_text, text_table
from bemt.dataset import Dataset
from bemt.readers._cfd import unit_of
from bemt.readers._headings import may_be_shaft_speed
from bemt.readers.cfd_run import QUANTITIES, RunColumn, RunToml
from bemt.recordings.cfd_files import (
    FIELDS,
    PROGRAMS,
    Settled,
    cfd_files,
    clock_of,
    read_run,
    settled,
    zone_of,
)
from bemt.recordings.cfd_setup import with_grid_floor
from bemt.recordings.grid_study import COVERAGE

__all__ = [
    "DUCT", "FIELDS", "NO_LOAD", "PROGRAMS", "assemble", "cfd_files", "clock_of", "document", "is_run", "run_at",
    "run_text", "settled",
]  # fmt: skip

NO_LOAD = "a thrust or a torque"
MOVING = 0.01
"""Drift over the averaged part above which a load has not settled. [1]"""
LOST = 0.5
"""Drift above which there is no mean worth a point. [1]"""
_ALONG = 3.0  # a thrust stands out of the side forces by this factor, or the shaft is not along an axis
DUCT = re.compile(r"duct|shroud|nozzle|nacelle|casing|housing|\bring\b|\blip\b|kort", re.IGNORECASE)
"""Name of a zone that is the duct."""
_NET = ("net", "total", "")
_FORCE = re.compile(r"force_total(?:_([xyz]))?(?:_N)?( along .*)?|C(?:F)([xyz])")
_MOMENT = re.compile(r"moment_total(?:_([xyz]))?(?:_Nm)?( along .*)?|C(?:M)([xyz])")
_PART = re.compile(r"(force|moment)_(pressure|viscous|porous|internal)(_|\b)")  # parts of a total
_WORDS: dict[str, str] = {
    "thrust": r"thrust|\bforce|^f[xyz]?$|axial[_ -]?load|schub|traction|empuje",
    "torque": r"torque|moment|^m[xyz]?$|couple|drehmoment|par[_ ]motor",
    "power": r"power|leistung",
    "duct_thrust": r"duct|shroud|nozzle",
    "airspeed": r"air_?speed|inlet[-_ ]?velocity|free_?stream|^[vu]_?inf|advance[-_ ](speed|velocity)|flight[-_ ]speed",
    "density": r"density|^rho\b|^rho_kg",
}
"""Heading of a quantity."""
_NOT = re.compile(r"coeff|spectral|^c[dlmt]\b|residual|^res_|^rms\[|kt\b|kq\b", re.IGNORECASE)
_COEFFICIENTS = ("CT", "CQ", "CP", "J")
_CHANNEL = {"thrust": "thrust_N", "duct_thrust": "duct_thrust_N", "torque": "torque_Nm", "power": "power_W"}


@dataclass(frozen=True, eq=False)
class _Found:
    """One column of one file of the run."""

    file: str
    name: str  # as the file has it
    stem: str  # without its zone
    zone: str
    axis: str  # of a vector
    part: str  # force, moment, or "" where only the heading tells
    unit: str
    record: Dataset


_BESIDE = {"force.dat": "moment.dat", "moment.dat": "force.dat"}  # files that OpenFOAM writes beside each other


def run_at(path: str, rpm: float | None = None, airspeed_m_s: float | None = None) -> Dataset | None:
    """Run of a run.toml, a folder or an export at a stated speed; None for anything that is no CFD."""
    at = Path(path)
    told = {k: v for k, v in (("rpm", rpm), ("airspeed_m_s", airspeed_m_s)) if v is not None}
    made = at / "run.toml" if (at / "run.toml").is_file() else at
    if made.is_dir():
        files = cfd_files(made)
    elif not made.is_file():
        return None
    else:
        try:
            kind = readers.detect(made)
        except InputError:  # said where the file is read
            return None
        if kind == "cfd_run":
            run = readers.read(made, kind)
            twice = [k for k in told if getattr(run.run, k) not in (None, told[k])]
            if twice:
                got = ", ".join(f"{k} {told[k]:g}, where the run has {getattr(run.run, k):g}" for k in twice)
                raise InputError(Fault(path, "run", got, "one operating point", "Leave out the option"))
            run = run.model_copy(update={"run": run.run.model_copy(update=told)})
            return assemble(run, made.parent, path)
        files = (made,) if kind in PROGRAMS else ()
        other = made.with_name(_BESIDE.get(made.name, made.name))
        files += (other,) if files and other != made and other.is_file() else ()
    if not files:
        return None
    return assemble(RunToml.model_validate({"run": {"files": tuple(map(str, files)), **told}}), Path(), path)


def is_run(record: Dataset) -> bool:
    """Whether a dataset is a run that was assembled here."""
    return record.provenance.get("format") == "cfd_run"


def _columns(file: str, record: Dataset, several: bool) -> list[_Found]:
    form = str(record.provenance["format"])
    home = zone_of(Path(file), form) if several else ""
    clock = {*record.provenance.get("clock_channels", "").split("\t"), record.provenance.get("time_channel", "")}
    out = []
    for name in record.values:
        if name in clock or name.startswith(("center_of_pressure", "force_coefficient", "moment_coefficient")):
            continue
        if _PART.match(name):
            continue
        match = re.fullmatch(r"(.+?)\s*\(([^()]*)\)", name) if form != "openfoam_forces" else None
        if form == "fluent_transcript" and match is None:  # residuals
            continue
        stem, zone = (match[1], match[2]) if match else (name, home)
        part, axis = "", ""
        for word, pattern in (("force", _FORCE), ("moment", _MOMENT)):
            if (m := pattern.fullmatch(stem)) and (m[3] is None or form in ("su2_history", "flow360_forces")):
                part, axis = word, m[1] or m[3] or ""
        out.append(_Found(file, name, stem, zone, axis, part, record.unit(name), record))
    return out


def _recorded(found: list[_Found]) -> list[_Found]:
    """Columns without what a transcript tells of the same quantity: somebody computed that at some moment."""
    written = [c for c in found if c.record.provenance["format"] != "fluent_transcript"]
    return written or found


@dataclass
class _Run:
    """A run while it is put together."""

    run: RunToml
    name: str
    columns: list[_Found]
    complete: bool = True  # whether all its files could be read
    period: float = math.nan
    end: float = math.inf
    notes: list[str] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)

    def fault(self, at: _Found | None, where: str, got: str, expected: str, hint: str = "") -> None:
        """Note a fault of a column's file, or of the run."""
        self.faults.append(Fault(self.name if at is None else at.file, where, got, expected, hint))

    def fact(self, quantity: str) -> RunColumn:
        """What the user said of a quantity."""
        return getattr(self.run.columns, quantity) or RunColumn()

    def named(self, quantity: str) -> list[_Found]:
        """Columns that may be a quantity: by the name that was given, by unit, or by the words of the heading."""
        told = self.fact(quantity).column
        if told is not None:
            hits = [c for c in self.columns if told in (c.name, c.stem)]
            if not hits and self.complete:
                known = ", ".join(dict.fromkeys(c.name for c in self.columns)) or "none"
                self.fault(None, f"columns.{quantity}.column", repr(told), f"one of {known}")
            return hits
        dimension = QUANTITIES[quantity][0]
        taken = {getattr(self.run.columns, q).column for q in QUANTITIES if getattr(self.run.columns, q) is not None}
        out = []
        for c in self.columns:
            unit = unit_of(c.unit)
            if c.name in taken or c.stem in taken or c.axis or (unit is not None and unit.dimension != dimension):
                continue
            if _NOT.search(c.stem) and unit is None:
                continue
            word = re.sub(r"-op$|-rfile$", "", c.stem)
            if quantity == "rpm":
                fits = may_be_shaft_speed(word) or unit is not None
            else:
                part = {"thrust": "force", "torque": "moment"}.get(quantity)
                fits = c.part == part or re.search(_WORDS[quantity], word, re.IGNORECASE) is not None
            if fits:
                out.append(c)
        return _recorded(out)

    def si(self, quantity: str, c: _Found) -> Array | None:
        """Values of a column in SI (rev/min for a speed); a missing unit is a fault."""
        told = self.fact(quantity).unit
        unit = unit_of(told) if told else unit_of(c.unit)
        stated = unit_of(c.unit)
        if told and stated is not None and unit is not None and stated.suffix != unit.suffix:
            got = f"{told}, where the file says {c.unit}"
            self.fault(c, c.name, got, "the unit of the file", f"Leave out --unit {quantity}=...")
            return None
        if c.part and c.axis and not c.unit and not told:
            factor = self._reference(c)
            return None if factor is None else c.record[c.name] * factor
        if unit is None:
            usual = QUANTITIES[quantity][1]
            hint = f'--unit {quantity}="{usual}" if that is its unit; '
            hint += f'run.toml: [columns] {quantity} = {{ unit = "{usual}" }}'
            got = f"no unit ({c.unit!r} is none that is known)" if c.unit else "no unit"
            self.fault(c, c.name, got, f"the unit of the {quantity}", hint)
            return None
        scale = unit.factor / (math.pi / 30.0) if quantity == "rpm" else unit.factor
        return np.asarray(c.record[c.name] * (1.0 if unit.suffix == "rpm" else scale))

    def _reference(self, c: _Found) -> float | None:
        """Newtons, or newton metres, for one of a coefficient."""
        ref, head = self.run.reference, self.run.run
        rho = ref.density_kg_m3 or head.density_kg_m3
        force = float(c.record["RefForce"][-1]) if "RefForce" in c.record else math.nan
        if math.isnan(force) and rho and ref.area_m2 and ref.speed_m_s:
            force = 0.5 * rho * ref.speed_m_s**2 * ref.area_m2
        length = 1.0 if c.part == "force" else ref.length_m
        if math.isnan(force) or length is None:
            hint = "--reference area=A,length=L,speed=V,density=RHO in m2, m, m/s, kg/m3, as set in the solver"
            self.fault(c, c.name, "a coefficient", "the reference values it rests on", hint)
            return None
        return force * length

    def sign(self, quantity: str, values: Array, others: Mapping[str, float]) -> float:
        """Sign of a load: as told, that of the whole for the duct's part, else the one that makes it positive."""
        told = self.fact(quantity).sign
        if told is not None:
            return float(told)
        if quantity == "duct_thrust":
            return others.get("thrust", 1.0)
        middle = np.nanmedian(values) if np.isfinite(values).any() else 0.0
        if middle < 0:
            name = _CHANNEL[quantity]
            self.notes.append(f"{name} is {middle:.4g} in the file: taken as positive (--sign {quantity}=1 keeps it)")
        return -1.0 if middle < 0 else 1.0

    def mean(self, quantity: str, c: _Found) -> Settled | None:
        """Settled value of one column."""
        values = self.si(quantity, c)
        if values is None:
            return None
        found = settled(values, c.record, self.period, self.run.run.revolutions, self.end)
        if isinstance(found, str):
            hint = "--revolutions N, or run on" if "revolution" in found else "Run on, or leave the file out"
            self.fault(c, c.name, found, "a history with an average", hint)
            return None
        return found

    def speed(self) -> Array:
        """Speed of rotation, (N,), from the files or as given."""
        head = self.run.run
        own = self.named("rpm")
        told = self.fact("rpm")
        if own and head.rpm is not None and told.column is None:
            stated = [c for c in own if unit_of(c.unit) is not None]
            own = stated or [
                c for c in own if np.unique(c.record[c.name]).size > 1 and c.record.provenance.get("clock") == "none"
            ]
            if own:
                v = np.unique(own[0].record[own[0].name])
                got = f"--rpm {head.rpm:g}, where {own[0].name} has {', '.join(f'{x:g}' for x in v[:4])}"
                usual = '--unit rpm=rpm, or --unit rpm="rad/s", says its unit' if not stated else "Leave out --rpm"
                self.fault(own[0], own[0].name, got, "one source of the speed", usual)
        if own and head.rpm is None:
            values = self.si("rpm", own[0])
            if values is not None:
                found = (
                    settled(values, own[0].record, math.nan, None)
                    if own[0].record.provenance.get("clock") != "time"
                    else None
                )
                return np.abs(found.values if isinstance(found, Settled) else values[-1:])
            return np.array([math.nan])
        if head.rpm is None:
            self.fault(None, "rpm", "no speed of rotation", "rev/min of the run", "--rpm N; run.toml: [run] rpm = N")
        return np.array([math.nan if head.rpm is None else head.rpm])


def _axis(run: _Run, forces: Sequence[_Found], moments: Sequence[_Found]) -> str:
    """Axis of the shaft: as given, else that of the largest force."""
    if run.run.run.axis:
        return run.run.run.axis
    lead = forces or moments
    size: dict[str, float] = {}
    for c in lead:
        tail = c.record[c.name][-max(1, len(c.record) // 5) :]
        size[c.axis] = size.get(c.axis, 0.0) + abs(float(np.nanmean(tail)))
    axis = max(size, key=lambda a: size[a])
    side = max((v for a, v in size.items() if a != axis), default=0.0)
    if size[axis] < _ALONG * side:
        got = ", ".join(f"{a} {v:.4g}" for a, v in size.items())
        run.fault(lead[0], "axis", got, "one component that stands out", "Name the shaft's: --axis z")
    return axis


def _pool(run: _Run, quantity: str) -> dict[str, _Found]:
    """Columns of a load by their zone."""
    part = {"thrust": "force", "torque": "moment"}.get(quantity, "")
    vectors = {p: _recorded([c for c in run.columns if c.part == p and c.axis]) for p in ("force", "moment")}
    found = run.named(quantity)
    if not found and part and vectors[part] and run.fact(quantity).column is None:
        zones = run.run.run.zones
        forces = [c for c in vectors["force"] if not zones or c.zone in zones]
        axis = _axis(run, forces, vectors["moment"])
        found = [c for c in vectors[part] if c.axis == axis]
        run.notes.append(f"{quantity} along {axis}" + (", the largest force" if not run.run.run.axis else ""))
    total = [
        c
        for c in found
        if re.fullmatch(r"(total[-_ ]?)?(thrust|torque)([-_ ](total|op))*", c.stem, re.IGNORECASE) and not c.zone
    ]
    labels = [
        c.zone or (c.stem if len({(f.stem, f.zone) for f in found}) > 1 and c not in total[:1] else "") for c in found
    ]
    out: dict[str, _Found] = {}
    twice = 0
    for label, c in zip(labels, found, strict=True):
        twice += label in out
        if label in out and twice == 1:
            got = f"{out[label].name} ({Path(out[label].file).name}) and {c.name} ({Path(c.file).name})"
            option = f"--column {quantity}=NAME" if out[label].name != c.name else "Give one of the files"
            run.fault(c, quantity, got, "one column", option)
        out.setdefault(label, c)
    return out


def _counted(run: _Run, quantity: str, pool: Mapping[str, _Found]) -> tuple[list[tuple[float, str]], list[str]]:
    """Zones whose loads are added (with their sign), and those of them that are the duct."""
    head = run.run.run
    ducts = [z for z in pool if (z in head.duct_zones if head.duct_zones is not None else bool(DUCT.search(z)))]
    torque = quantity == "torque"
    if head.zones is not None:
        known = [z for z in head.zones if z in pool]
        if "Net" in head.zones and len(head.zones) > 1:
            run.fault(None, "zones", "Net with other zones", "Net alone, or zones", "Net holds them all")
        if torque and not known and list(pool) == [""]:
            return [(1.0, "")], []
        if absent := [z for z in head.zones if z not in pool]:
            if not torque or not known:
                hint = f"Zones: {', '.join(z or 'the whole' for z in pool)}"
                run.fault(None, "zones", ", ".join(absent), f"zones with a {quantity}", hint)
            elif bare := [z for z in absent if not DUCT.search(z)]:
                run.notes.append(f"torque: no column for {', '.join(bare)}")
        duct = [z for z in known if z in ducts]
        return [(1.0, z) for z in known if not (torque and z in duct and len(duct) < len(known))], duct
    net = next((z for z in pool if z.lower() in _NET), None)
    if net is not None:
        less = ducts if torque else []
        if less:
            run.notes.append(f"torque: {net or 'the whole'} less {', '.join(less)}: the shaft's own")
        return [(1.0, net), *((-1.0, z) for z in less)], ducts
    if len(pool) > 1:
        names = ",".join(pool)
        hint = f"--zones {names} (leave out what does not count)"
        run.fault(None, "zones", f"{quantity} of {', '.join(pool)}", "the zones that count", hint)
    return [(1.0, z) for z in pool], [z for z in ducts if len(pool) > 1]


def _sum(parts: Sequence[tuple[float, Settled]]) -> Settled:
    over = parts[0][1].over + (f", {len(parts)} zones" if len(parts) > 1 else "")
    return Settled(
        np.sum([k * s.values for k, s in parts], axis=0), sum(k * s.drift for k, s in parts),
        math.hypot(*(s.scatter for _, s in parts)), over,
    )  # fmt: skip


def assemble(run: RunToml, folder: Path = Path(), name: str = "run") -> Dataset:
    """Points of a run: rpm, thrust, torque, the duct's part, with u, and how each was averaged.

    Parameters
    ----------
    run : RunToml
        Files, relative to `folder`, and what they do not say.
    folder : Path
        Folder of the files.
    name : str
        Name of the run, for messages.

    Returns
    -------
    Dataset
        Kind ``cfd``, one point, or one for each design point. ``provenance``: ``conditions``, ``averaged``, ``drift``.

    Raises
    ------
    InputError
        With everything that has to be said first: units, zones, speed.
    """
    paths = [folder / f for f in run.run.files]
    read, faults = read_run(paths)
    homes = {
        zone_of(Path(f), str(r.provenance["format"])) for f, r in read if any(n.startswith("force_") for n in r.values)
    }
    columns = [c for file, record in read for c in _columns(file, record, len(homes) > 1)]
    work = _Run(run, name, columns, complete=not faults)
    work.notes += [n for _, r in read for n in r.notes if "restart" in n or "joined" in n or "left out" in n]
    if not work.complete:
        work.faults += faults
        _ask_all(work)
        raise InputError(list(dict.fromkeys(work.faults)))
    rpm = work.speed()
    work.period = 60.0 / float(rpm[0]) if rpm.size == 1 and np.isfinite(rpm[0]) else math.nan
    times = [c[1][-1] for _, r in read if r.provenance.get("clock") == "time" and (c := clock_of(r))[1].size]
    work.end = float(min(times)) if times else math.inf
    if times and not math.isfinite(work.period):
        work.period = 1.0
        _ask_all(work)
        raise InputError(list(dict.fromkeys(work.faults)))
    loads: dict[str, Settled] = {}
    for quantity in ("thrust", "torque", "power"):
        pool = _pool(work, quantity)
        if not pool:
            continue
        counted, ducts = _counted(work, quantity, pool)
        found = {
            z: work.mean(quantity, pool[z])
            for z in {*(z for _, z in counted), *(ducts if quantity == "thrust" else ())}
        }
        if any(v is None for v in found.values()):
            continue
        known = {z: v for z, v in found.items() if v is not None}
        loads[quantity] = _sum([(k, known[z]) for k, z in counted])
        if quantity == "thrust" and ducts and run.columns.duct_thrust is None:
            loads["duct_thrust"] = _sum([(1.0, known[z]) for z in ducts])
            work.notes.append(f"duct_thrust_N is that of {', '.join(ducts)}")
        if quantity == "thrust" and [z for _, z in counted] != [""]:
            work.notes.append(f"thrust is that of {' + '.join(z or 'the whole' for _, z in counted)}")
    if run.columns.duct_thrust is not None:
        for column in work.named("duct_thrust")[:1]:
            if (own := work.mean("duct_thrust", column)) is not None:
                loads["duct_thrust"] = own
    values, u, about = _applied(work, rpm, loads, read)
    if work.faults:
        raise InputError(list(dict.fromkeys(work.faults)))
    return _dataset(run, name, work, values, u, about, read)


def _nothing(work: _Run) -> None:
    """Say that no column is a load, unless a fault says already what one needs."""
    if not work.complete or any(f.where != "rpm" for f in work.faults):
        return
    known = ", ".join(list(dict.fromkeys(c.name for c in work.columns))[:8]) or "none but the clock"
    first = next((c.name for c in work.columns if not c.unit), "NAME")
    hint = f'Say which it is by its unit: --unit "{first}=N" for a thrust, "{first}=N m" for a torque'
    work.fault(None, "", f"columns {known}", NO_LOAD, hint)


def _ask_all(work: _Run) -> None:
    """Say with a missing speed which units, zones and reference values are missing too."""
    pools = {quantity: pool for quantity in ("thrust", "torque", "power") if (pool := _pool(work, quantity))}
    for quantity, pool in pools.items():
        _counted(work, quantity, pool)
        work.si(quantity, next(iter(pool.values())))
    if not pools:
        _nothing(work)


def _applied(
    work: _Run, rpm: Array, loads: Mapping[str, Settled], read: Sequence[tuple[str, Dataset]]
) -> tuple[dict[str, Array], dict[str, Array], dict[str, Any]]:
    """Sector and sign applied, the operating point beside the loads."""
    head = work.run.run
    sector = head.sector or 1
    values: dict[str, Array] = {"rpm": rpm}
    for name, quantity, given in (
        ("airspeed_m_s", "airspeed", head.airspeed_m_s),
        ("density_kg_m3", "density", head.density_kg_m3),
    ):
        own = [] if given is not None else work.named(quantity)
        if given is not None:
            values[name] = np.array([given])
        elif (
            own and (unit_of(own[0].unit) or work.fact(quantity).unit) and (v := work.si(quantity, own[0])) is not None
        ):
            values[name] = v[-1:] if own[0].record.provenance.get("clock") in ("time", "iteration") else v
    u: dict[str, Array] = {}
    over: dict[str, str] = {}
    drift: dict[str, float] = {}
    signs: dict[str, float] = {}
    for quantity, found in loads.items():
        name = _CHANNEL[quantity]
        signs[quantity] = work.sign(quantity, found.values, signs)
        values[name] = signs[quantity] * sector * found.values
        size = math.hypot(*(abs(x) for x in (found.drift, found.scatter) if math.isfinite(x)), 0.0) * sector
        u[name] = np.full(found.values.size, size)
        over[name] = found.over
        mean = float(np.nanmean(np.abs(found.values))) if np.isfinite(found.values).any() else math.nan
        if math.isfinite(found.drift) and mean:
            drift[name] = found.drift / mean
            if abs(drift[name]) > LOST:
                got = f"a mean that drifts by {drift[name]:+.0%}"
                work.fault(None, quantity, got, "a run that has converged", "Run on, or start later")
            elif abs(drift[name]) > MOVING:
                work.notes.append(f"not settled: {quantity} drifts by {drift[name]:+.1%} over the averaged part; in u")
    if sector > 1:
        work.notes.append(f"one of {sector} sectors: loads times {sector}; holds for axisymmetric flow")
    if not {"thrust_N", "torque_Nm"} & values.keys():
        _coefficients(work, values, u, over)
    if not {"thrust_N", "torque_Nm", "power_W", "CT", "CQ"} & values.keys():
        _nothing(work)
    return values, u, {"averaged": over, "drift": drift}


def _coefficients(work: _Run, values: dict[str, Array], u: dict[str, Array], over: dict[str, str]) -> None:
    """Loads as coefficients, where a file has nothing else."""
    for c in work.columns:
        if c.name in _COEFFICIENTS and c.name not in values:
            found = settled(c.record[c.name], c.record, work.period, work.run.run.revolutions, work.end)
            if isinstance(found, Settled):
                values[c.name], over[c.name] = found.values, found.over
                if c.name != "J":
                    u[c.name] = np.full(found.values.size, math.hypot(np.nan_to_num(found.drift), found.scatter))


def _dataset(
    run: RunToml, name: str, work: _Run, values: Mapping[str, Array], u: Mapping[str, Array], about: Mapping[str, Any],
    read: Sequence[tuple[str, Dataset]],
) -> Dataset:  # fmt: skip
    rows = max(v.size for v in values.values())
    bad = [k for k, v in values.items() if v.size not in (1, rows)]
    if bad:
        got = ", ".join(f"{k} {values[k].size}" for k in values)
        raise InputError(Fault(name, "", f"columns of unlike length ({got})", "files of one run"))
    full = {k: np.broadcast_to(v, (rows,)).copy() for k, v in values.items()}
    clocks = {str(r.provenance.get("clock")) for _, r in read}
    told = {k: v for k, v in run.setup.given().items() if v is not None}
    program = " + ".join(dict.fromkeys(PROGRAMS[str(r.provenance["format"])] for _, r in read))
    cells = next((float(r.provenance["cells"]) for _, r in read if str(r.provenance.get("cells", "")).isdigit()), None)
    steady = False if "time" in clocks else True if "iteration" in clocks else None
    found = {"program": program, "cells": cells, "steady": steady, "thrust_from": "forces"}
    conditions = {k: v for k, v in found.items() if v is not None} | told
    if "thrust_N" in about["drift"]:
        conditions["drift_thrust"] = about["drift"]["thrust_N"]
    gci = run.setup.gci_pct
    if gci is not None:
        conditions["u_grid"] = 0.01 * gci / COVERAGE
    labels = next((tuple(r.texts["name"]) for _, r in read if len(r.texts.get("name", ())) == rows), ())
    provenance = {
        "file": name, "format": "cfd_run", "files": tuple(run.run.files), "conditions": conditions, **about,
        "sha256": "+".join(str(r.provenance.get("sha256", "")) for _, r in read),
    }  # fmt: skip
    if rows == 1:
        provenance["means"] = {
            k: Mean(float(full[k][0]), about["averaged"][k], about["drift"].get(k)) for k in about["averaged"]
        }
    made = Dataset("cfd", Path(name).name, full, {k: np.broadcast_to(v, (rows,)) for k, v in u.items()}, (), provenance,
                   labels, notes=tuple(dict.fromkeys(work.notes)))  # fmt: skip
    keep = np.any(
        [np.isfinite(full[k]) for k in full if k not in ("rpm", "airspeed_m_s", "density_kg_m3", "J")], axis=0
    )
    if not keep.all():
        index = np.flatnonzero(keep)
        made = Dataset("cfd", made.name, {k: v[index] for k, v in full.items()}, {k: made.u[k][index] for k in u}, (),
                       provenance, tuple(labels[i] for i in index) if labels else (),
                       notes=(*made.notes, f"{number_of((~keep).sum(), 'point')} without a load left out"))  # fmt: skip
    return with_grid_floor(made, conditions.get("u_grid", math.nan))


def document(d: Dataset) -> dict[str, Any]:
    """A run as plain values."""
    points = [
        {k: float(d[k][i]) for k in d.values} | {f"u_{k}": float(d.u[k][i]) for k in d.values if np.isfinite(d.u[k][i])}
        for i in range(len(d))
    ]  # fmt: skip
    told = {k: d.provenance[k] for k in ("averaged", "drift", "conditions")}
    head = {"name": str(d.provenance["file"]), "files": list(d.provenance["files"]), "points": points}
    return head | told | {"notes": list(d.notes)}


_SHOWN = {"rpm": "rev/min", "airspeed_m_s": "V [m/s]", "thrust_N": "thrust [N]", "duct_thrust_N": "of it duct [N]",
          "torque_Nm": "torque [N m]", "power_W": "power [W]", "CT": "CT", "CQ": "CQ", "CP": "CP"}  # fmt: skip


def run_text(found: Mapping[str, Any]) -> str:
    """A run for a terminal: points with u, what was averaged, what was decided."""
    points = found["points"]
    names = [k for k in _SHOWN if any(k in p for p in points)]
    rows = []
    for p in points:
        u = {k: p.get(f"u_{k}", math.nan) for k in names}
        rows.append(
            [number_text(p[k], 5) + (f" ± {number_text(u[k], 2)}" if math.isfinite(u[k]) else "") for k in names]
        )
    lines = [f"one run: {', '.join(Path(f).name for f in found['files'])}"]
    lines.append(text_table([_SHOWN[k] for k in names], rows, (), "  "))
    for over in dict.fromkeys(found["averaged"].values()):
        own = [k.rsplit("_", 1)[0] for k, v in found["averaged"].items() if v == over]
        drift = ", ".join(
            f"{k.rsplit('_', 1)[0]} {v:+.2%}" for k, v in found["drift"].items() if found["averaged"].get(k) == over
        )
        lines.append(f"  {', '.join(own)}: {over}" + (f"; drift {drift}" if drift else ""))
    shown = {k: v for k, v in found["conditions"].items() if k not in ("thrust_from", "drift_thrust", "u_grid")}
    words = [
        f"{k.replace('_', ' ')} {'yes' if v is True else 'no' if v is False else f'{v:,.0f}' if k == 'cells' else v}"
        for k, v in shown.items()
    ]
    lines.append(f"  set-up: {', '.join(words)}")
    return "\n".join([*lines, *(f"  ! {note}" for note in found["notes"])])
