"""Which columns of the files of a CFD run are which load: by name, unit and zone, in SI, with the sign that was stated.

Nothing is guessed that changes a number without saying so: a unit that no file states is asked for, so are the zones
that count. A load of which the sign is not given is turned to positive, and the note says it.
"""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bemt.base.arrays import Array, middle
from bemt.base.errors import Fault
from bemt.data.readers.cfd import unit_of
from bemt.data.readers.cfd_run import QUANTITIES, RunColumn, RunToml
from bemt.data.readers.headings import other_dimension
from bemt.data.readers.unit_text import BY_THE_CASE
from bemt.data.recordings.cfd_files import CHANNEL, VECTOR, LoadColumn, Settled, fits, level, recorded, settled
from bemt.data.recordings.cfd_setup import FLIES, Elsewhere

_ALONG = 3.0  # a thrust stands out of the side forces by this factor, or the shaft is not along an axis
DUCT = re.compile(r"duct|shroud|nozzle|casing|housing|\bring\b|\blip\b|kort", re.IGNORECASE)
"""Name of a zone that is the duct; a nacelle is one where no other is, else a body on the axis."""
_STILL = re.compile(r"stator|vane|nacelle|strut|pylon|support|leitrad|(?<![a-z])(ogv|igv|pod)(?![a-z])", re.IGNORECASE)
TURNS = re.compile(r"blade|rotor|prop|impeller|spinner|hub|nabe|(?<![a-z])fan(?![a-z])", re.IGNORECASE)
"""Names of zones that stand still, whatever else they say (``stator_blade``), and of those on the shaft."""
_SLIGHT = 0.01
"""Share of the shaft's moment that a zone of unknown part may have without being asked about [1]."""
NET = ("net", "total", "")
_DIRECTION, _NUMBER = re.compile(r"(?<=along )\([^()]*\)"), re.compile(r"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?")
_PARALLEL = 0.1  # sine of the angle up to which two axes are one [1]
_TOTAL = re.compile(r"(total[-_ ]?)?(thrust|torque)([-_ ](total|op))*", re.IGNORECASE)


@dataclass
class OpenRun:
    """A run while it is put together."""

    run: RunToml
    name: str
    columns: list[LoadColumn]
    complete: bool = True  # whether all its files could be read
    period: float = math.nan
    end: float = math.inf
    notes: list[str] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    used: set[str] = field(default_factory=set)  # names of columns that became something
    rested: set[str] = field(default_factory=set)  # reference values that a load rests on
    size_unit: str = ""  # of a column of cell sizes, SI; "" if not known
    zones: frozenset[str] = frozenset()  # whose forces are the thrust
    elsewhere: list[Elsewhere] = field(default_factory=list)
    unread: str = ""  # columns in which alone some rows differ
    walls: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # mean and largest y+ by patch [1]
    pools: dict[str, dict[str, LoadColumn]] = field(default_factory=dict)  # columns of each load by zone

    def fault(self, at: LoadColumn | None, where: str, got: str, expected: str, hint: str = "") -> None:
        """Note a fault of a column's file, or of the run."""
        self.faults.append(Fault(self.name if at is None else at.file, where, got, expected, hint))

    @property
    def told(self) -> list[Fault]:
        """Its faults, each once."""
        return list(dict.fromkeys(self.faults))

    def is_duct(self, zone: str) -> bool:
        """Whether a zone is the duct: as stated, else by its name."""
        stated = self.run.run.duct_zones
        if stated is not None:
            return zone in stated
        outer = not any(DUCT.search(c.zone) for c in self.columns)
        return bool(DUCT.search(zone)) or (outer and "nacelle" in zone.lower())

    def stands_still(self, zone: str) -> bool:
        """Whether a zone is a part beside the rotor, such as a duct or a stator."""
        return self.is_duct(zone) or bool(_STILL.search(zone))

    def fact(self, quantity: str) -> RunColumn:
        """What the user said of a quantity."""
        return getattr(self.run.columns, quantity) or RunColumn()

    @property
    def units_given(self) -> tuple[str, ...]:
        """Loads whose unit the user stated: asked for where the files state none."""
        return tuple(q for q in ("thrust", "torque") if self.fact(q).unit)

    def named(self, quantity: str) -> list[LoadColumn]:
        """Columns that may be a quantity: by the name that was given, by unit, or by the words of the heading."""
        told = self.fact(quantity).column
        if told is None:
            taken = {self.fact(q).column for q in QUANTITIES}
            free = (c for c in self.columns if not (c.name in taken or c.stem in taken or c.axis))
            return recorded([c for c in free if fits(c, quantity, self.fact(quantity).unit)])
        hits = [c for c in self.columns if told in (c.name, c.stem)]
        if hits:
            self._is_one(quantity, hits[0])
        elif self.complete:
            known = ", ".join(dict.fromkeys(c.name for c in self.columns)) or "none"
            self.fault(None, f"columns.{quantity}.column", repr(told), f"one of {known}")
        return hits

    def _is_one(self, quantity: str, c: LoadColumn) -> None:
        """Fault where the column that is stated for a quantity is another by its unit, or a coefficient."""
        (dimension, usual), unit = QUANTITIES[quantity], unit_of(c.unit)
        if unit is None:
            other = c.coefficient[0] or other_dimension(c.stem, dimension)
            hint = f"Leave out its unit: {BY_THE_CASE}" if c.coefficient[0] else ""
        else:  # what is stated of its unit is kept, in `si`
            other = "" if unit.dimension == dimension or self.fact(quantity).unit else unit.dimension
            meant = f"{c.unit}f" if (other, dimension) == ("mass", "force") else usual
            hint = f"The file says {c.unit}; if that is wrong: --unit {quantity}={shlex.quote(meant)}"
        if other and quantity != "cells":
            got = f"a column of {other.replace('_', ' ')} for the {quantity}"
            self.fault(c, c.name, got, f"one of {dimension.replace('_', ' ')}", hint)

    def si(self, quantity: str, c: LoadColumn) -> Array | None:
        """Values of a column in SI (rev/min for a speed); a missing unit is a fault."""
        self.used.add(c.name)
        if quantity == "cells":
            return c.record[c.name]
        told, stated = self.fact(quantity).unit, unit_of(c.unit)
        unit = unit_of(told) if told else stated
        alike = stated is not None and unit is not None and stated.dimension == unit.dimension
        if told and alike and stated.suffix != unit.suffix:  # type: ignore[union-attr]
            got = f"{told}, where the file says {c.unit}"
            self.fault(c, c.name, got, "the unit of the file", f"Leave out --unit {quantity}={told!r}")
            return None
        if not c.unit and not told and ((c.part and c.axis) or (c.of_reference and quantity in VECTOR)):
            factor = self._reference(c, c.part or VECTOR.get(quantity, ""))
            return None if factor is None else c.record[c.name] * factor
        if unit is None:
            self._no_unit(quantity, c)
            return None
        scale = unit.factor / (math.pi / 30.0) if quantity == "rpm" else unit.factor
        return np.asarray(c.record[c.name] * (1.0 if unit.suffix == "rpm" else scale))

    def _no_unit(self, quantity: str, c: LoadColumn) -> None:
        """Ask for the unit of a column, once for all zones of a file."""
        usual = QUANTITIES[quantity][1]
        got = f"no unit ({c.unit!r} is none that is known)" if c.unit else "no unit"
        expected = f"the unit of the {quantity}"
        if not any((f.file, f.got, f.expected) == (c.file, got, expected) for f in self.faults):
            hint = f'--unit {quantity}="{usual}" if that is its unit; '
            self.fault(c, c.name, got, expected, f'{hint}run.toml: [columns] {quantity} = {{ unit = "{usual}" }}')

    def _reference(self, c: LoadColumn, part: str) -> float | None:
        """Newtons, or newton metres, for one of a coefficient; a propeller's own has n D, 2 D^2 and D for reference."""
        ref, head = self.run.reference, self.run.run
        rho = ref.density_kg_m3 or head.density_kg_m3
        force = float(c.record["RefForce"][-1]) if "RefForce" in c.record else math.nan
        if math.isnan(force) and rho and ref.area_m2 and ref.speed_m_s:
            force = 0.5 * rho * ref.speed_m_s**2 * ref.area_m2
            self.rested |= {"density_kg_m3", "speed_m_s", "area_m2"}
        length = 1.0 if part == "force" else ref.length_m
        self.rested |= set() if part == "force" else {"length_m"}
        if math.isnan(force) or length is None:
            hint = "--reference area=A,length=L,speed=V,density=RHO in m2, m, m/s, kg/m3, as set in the solver"
            self.fault(c, c.name, "a coefficient", "the reference values it rests on", hint)
            return None
        return force * length

    def signs(self, loads: Mapping[str, Settled], state: Mapping[str, Array]) -> dict[str, float]:
        """Sign of each load: as told, that of the whole for the duct's part, else the one that makes it positive.

        In flight a rotor may brake, and the flow may drive it. What a pull or a flow can give of power, thrust times
        airspeed at most (actuator disk), tells which; what is open then is asked for.
        """
        V, rpm = (np.nan_to_num(state.get(k, np.zeros(1))) for k in ("airspeed_m_s", "rpm"))
        slowest = float(V.min())
        at = {q: f.values[V == slowest] if V.size == f.values.size else f.values for q, f in loads.items()}
        size = {q: float(np.nan_to_num(middle(v))) for q, v in at.items()}
        shaft = _shaft_power(size, float(np.median(rpm)))
        brakes = 0.0 < shaft < slowest * abs(size.get("thrust", 0.0))  # no pull gives more than its shaft
        out: dict[str, float] = {}
        for quantity, value in size.items():
            told, name = self.fact(quantity).sign, CHANNEL[quantity]
            if told is not None:
                out[quantity] = float(told)
                if told * value < 0:
                    why = "a rotor that is driven by the flow" if quantity != "thrust" else "thrust backwards"
                    self.notes.append(f"{name} is {told * value:.4g} by the sign that is stated, {told:+d}: {why}")
            elif quantity == "duct_thrust":
                out[quantity] = out.get("thrust", 1.0)
            elif value < 0 and slowest > FLIES and quantity == "thrust" and brakes:
                out[quantity], times = 1.0, f"{slowest * abs(value) / shaft:.3g} times the power of the shaft"
                self.notes.append(f"{name} is {value:.4g} in the file: kept, since as a pull it would give {times}")
            else:
                out[quantity] = -1.0 if value < 0 else 1.0
                open_ = slowest > FLIES and (brakes or quantity == "thrust" or "thrust" not in loads)
                if value < 0:
                    self._turned(quantity, value, slowest if open_ else None)
        return out

    def _turned(self, quantity: str, value: float, airspeed: float | None) -> None:
        """Note a load whose sign is turned to positive; ask about it at an airspeed [m/s] that may be why."""
        keeps = f"--sign {quantity}=1 keeps it"
        if airspeed is None:
            self.notes.append(f"{CHANNEL[quantity]} is {value:.4g} in the file: taken as positive ({keeps})")
            return
        got, may = f"{value:.4g} in the file at {airspeed:.4g} m/s", "its sign: in flight a rotor may brake"
        may += "" if quantity == "thrust" else ", and the flow may drive it"
        self.fault(None, quantity, got, may, f"{keeps}, --sign {quantity}=-1 turns it")

    def of_density(self, loads: Mapping[str, Settled], state: Mapping[str, Array]) -> Array:
        """Density of the run over the one that its program took for it; reference values without effect are faults."""
        left = {k: v for k, v in self.run.reference.given().items() if k not in self.rested}
        taken, rho = left.pop("density_kg_m3", None) if loads else None, state.get("density_kg_m3")
        for key, value in left.items():
            self.fault(None, f"reference.{key}", f"{value:g}", "nothing: no load here rests on it", "Leave it out")
        if taken is None:
            return np.ones(1)
        if rho is None:
            got = f"loads of a program that took {taken:g} kg/m3, and no density of the run"
            self.fault(None, "density", got, "the density of the run", "--density-kg-m3 RHO: loads go with it")
            return np.ones(1)
        self.notes.append(f"loads times {middle(rho) / taken:.4g}: the program took a density of {taken:g} kg/m3")
        return np.asarray(rho / taken)

    def mean(self, quantity: str, c: LoadColumn) -> Settled | None:
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
        head, told, own = self.run.run, self.fact("rpm"), self.named("rpm")
        if own and (head.rpm is None or told.column is not None):
            self.used |= {c.name for c in own}
        if head.rpm is not None:
            if told.column is None:
                self._another_speed(own, head.rpm)
            return np.array([head.rpm])
        if not own:
            loads = any(fits(c, q) for c in self.columns for q in (*CHANNEL, "airspeed"))
            if loads or not any(c.coefficient[0] and c.record.clock == "none" for c in self.columns):
                hint = "--rpm N; run.toml: [run] rpm = N"
                self.fault(None, "rpm", "no speed of rotation", "rev/min of the run", hint)
            return np.array([math.nan])
        values, record = self.si("rpm", own[0]), own[0].record
        if values is None:
            return np.array([math.nan])
        found = None if record.clock == "time" else settled(values, record, math.nan, None)
        return np.abs(found.values if isinstance(found, Settled) else values[-1:])

    def _another_speed(self, own: Sequence[LoadColumn], rpm: float) -> None:
        """Note a fault where columns give a speed beside the stated one [rev/min]: by their unit, or as they vary."""
        stated = [c for c in own if unit_of(c.unit) is not None]
        for c in stated or own:
            v = np.unique(c.record[c.name])
            if stated or (v.size > 1 and c.record.clock == "none"):
                got = f"--rpm {rpm:g}, where {c.name} has {', '.join(f'{x:g}' for x in v[:4])}"
                usual = "Leave out --rpm" if stated else '--unit rpm=rpm, or --unit rpm="rad/s", says its unit'
                return self.fault(c, c.name, got, "one source of the speed", usual)


def _shaft_power(size: Mapping[str, float], rpm: float) -> float:
    """Power of the shaft by torque and by power, the higher; infinite where neither is known. [W]"""
    by = {"torque": rpm * math.pi / 30.0, "power": 1.0}
    return max((abs(size[q]) * factor for q, factor in by.items() if q in size), default=math.inf)


def _axis(run: OpenRun, forces: Sequence[LoadColumn], moments: Sequence[LoadColumn]) -> str:
    """Axis of the shaft: as given, else that of the largest force."""
    if run.run.run.axis:
        return run.run.run.axis
    lead = forces or moments
    size: dict[str, float] = {}
    for c in lead:
        size[c.axis] = size.get(c.axis, 0.0) + abs(level(c))
    axis = max(size, key=lambda a: size[a])
    side = max((v for a, v in size.items() if a != axis), default=0.0)
    if size[axis] < _ALONG * side:
        got = ", ".join(f"{a} {v:.4g}" for a, v in size.items())
        run.fault(lead[0], "axis", got, "one component that stands out", "Name the shaft's: --axis z")
    return axis


def _along_shaft(run: OpenRun, quantity: str) -> list[LoadColumn]:
    """Components of the forces or moments along the shaft, which are the thrust and the torque."""
    vectors = {p: recorded([c for c in run.columns if c.part == p and c.axis]) for p in ("force", "moment")}
    own, zones = vectors.get(VECTOR.get(quantity, ""), []), run.run.run.zones
    if not own:
        return []
    axis = _axis(run, [c for c in vectors["force"] if not zones or c.zone in zones], vectors["moment"])
    run.notes.append(f"{quantity} along {axis}" + (", the largest force" if not run.run.run.axis else ""))
    return [c for c in own if c.axis == axis]


def by_zone(run: OpenRun, quantity: str) -> dict[str, LoadColumn]:
    """Columns of a load by their zone."""
    found = run.named(quantity)
    if not found and run.fact(quantity).column is None:
        found = _along_shaft(run, quantity)
    run.used |= {c.name for c in found}
    total = next((c for c in found if not c.zone and _TOTAL.fullmatch(c.stem)), None)
    several = len({(f.stem, f.zone) for f in found}) > 1
    labels = [c.zone or (c.stem if several and c is not total else "") for c in found]
    out: dict[str, LoadColumn] = {}
    twice = 0
    for label, c in zip(labels, found, strict=True):
        twice += label in out
        if label in out and twice == 1:
            got = f"{out[label].name} ({Path(out[label].file).name}) and {c.name} ({Path(c.file).name})"
            option = f"--column {quantity}=NAME" if out[label].name != c.name else "Give one of the files"
            run.fault(c, quantity, got, "one column", option)
        out.setdefault(label, c)
    return out


def same_shaft(run: OpenRun) -> None:
    """Refuse forces and moments that are not of one shaft, or not of the same zones."""
    forces, moments = run.pools.get("thrust", {}), run.pools.get("torque", {})
    if not forces or not moments:
        return
    thrust, torque = next(iter(forces.values())), next(iter(moments.values()))
    (pull, a), (turn, b) = _direction(thrust), _direction(torque)
    if np.linalg.norm(np.cross(a, b)) > _PARALLEL * np.linalg.norm(a) * np.linalg.norm(b):
        hint = f"Report it about that axis, or leave it out: --ignore {shlex.quote(torque.stem)}"
        run.fault(torque, torque.name, f"the moment about {turn}, where the force is along {pull}",
                  "both along the shaft", hint)  # fmt: skip
    alone = [z for z in moments if z not in forces and z.lower() not in NET]
    if alone and run.run.run.zones is None and any(z in forces for z in moments if z.lower() not in NET):
        got, hint = f"a moment of {', '.join(alone)} and no force of it", "Export the force of every zone"
        run.fault(thrust, "zones", got, "forces and moments of the same zones", f"{hint}; --zones: those that count")


def _direction(c: LoadColumn) -> tuple[str, Array]:
    """Direction that the name of a column holds, as it stands there and as a vector; zero where there is none."""
    told = _DIRECTION.search(c.name)
    numbers = [float(x) for x in _NUMBER.findall(told[0])] if told else []
    return (told[0] if told else "", np.array(numbers if len(numbers) == 3 else [0.0] * 3))


def other_axes(run: OpenRun, c: LoadColumn) -> list[LoadColumn]:
    """Components of a vector across the one that a column is."""
    own = (c.file, c.part, c.zone)
    return [o for o in run.columns if c.axis and o.axis not in ("", c.axis) and (o.file, o.part, o.zone) == own]


def across(run: OpenRun, quantity: str, axis: str, along: float, others: Mapping[str, float]) -> None:
    """Note a component across the shaft that is `_ALONG` times the one along it: another axis, or another shaft."""
    if not others:
        return
    most = max(others, key=lambda a: abs(others[a]))
    if abs(others[most]) > _ALONG * abs(along):
        factor = abs(others[most] / along) if along else math.inf
        words = f"along {most}"
        run.elsewhere.append(Elsewhere(CHANNEL[quantity], words, factor))
        run.notes.append(
            f"{quantity} along {axis} is {along:.4g}, {words} {others[most]:.4g}: --axis {most} if that is the shaft"
        )


def _stated_zones(run: OpenRun, quantity: str, pool: Mapping[str, LoadColumn], zones: Sequence[str]) -> list[str]:
    """Zones that the user names and a load has; a duct needs no torque."""
    torque, known, absent = quantity == "torque", [z for z in zones if z in pool], [z for z in zones if z not in pool]
    if "Net" in zones and len(zones) > 1:
        run.fault(None, "zones", "Net with other zones", "Net alone, or zones", "Net holds them all")
    if torque and not known and list(pool) == [""]:
        return [""]
    if torque and known:
        bare = [z for z in absent if not run.is_duct(z)]
        run.notes += [f"torque: no column for {', '.join(bare)}"] if bare else []
    elif absent:
        hint = f"Zones: {', '.join(z or 'the whole' for z in pool)}"
        run.fault(None, "zones", ", ".join(absent), f"zones with a {quantity}", hint)
    return known


def _as_told(run: OpenRun, told: Sequence[str], pool: Mapping[str, LoadColumn], zones: Sequence[str]) -> list[str]:
    """Those of some zones that are stated to be on the shaft; a fault where one of them has no torque."""
    if absent := [z for z in told if z not in pool]:
        run.fault(None, "rotor_zones", ", ".join(absent), f"zones with a torque: {', '.join(zones)}")
    return [z for z in zones if z in told]


def _on_shaft(run: OpenRun, pool: Mapping[str, LoadColumn], zones: Sequence[str]) -> list[str]:
    """Those of some zones whose moment is the shaft's torque: as stated, else by name and by the sense of the moment.

    A duct and a stator stand still, and no zone on the shaft turns against the blades. A zone of unknown part counts
    where nothing stands still; beside parts that do, and where no name tells the blades, it is asked for.
    """
    if (told := run.run.run.rotor_zones) is not None:
        return _as_told(run, told, pool, zones)
    moment = {z: level(pool[z]) for z in zones if not run.stands_still(z)}
    named = [z for z in moment if TURNS.search(z)]
    whole = sum(moment[z] for z in named or moment)
    against = [z for z in moment if moment[z] * whole < 0.0]

    def counts(some: Sequence[str]) -> bool:
        return sum(abs(moment[z]) for z in some) > _SLIGHT * abs(whole)

    if len(moment) == len(zones) and not counts(against):
        return list(moment)
    shaft = named or sorted(moment, key=lambda z: -abs(moment[z]))[:1]
    doubt = [z for z in moment if (z in shaft) == (bool(named) and z in against)]
    if counts(doubt):
        got = "torque of " + ", ".join(f"{z} {m:+.4g}" for z, m in moment.items())
        hint = f"--rotor-zones {','.join(z for z in shaft if z not in doubt)}: those on one shaft; thrust counts all"
        run.fault(None, "zones", got, "the zones that turn with the shaft", hint)
    return shaft


def counted_zones(
    run: OpenRun, quantity: str, pool: Mapping[str, LoadColumn]
) -> tuple[list[tuple[float, str]], list[str]]:
    """Zones whose loads are added (with their sign), and those of them that are the duct."""
    ducts = [z for z in pool if run.is_duct(z)]
    if run.run.run.zones is not None:
        known = _stated_zones(run, quantity, pool, run.run.run.zones)
        return [(1.0, z) for z in _turning(run, quantity, pool, known)], [z for z in known if z in ducts]
    net = next((z for z in pool if z.lower() in NET), None)
    if net is not None:
        return [(1.0, net), *((-1.0, z) for z in _less(run, quantity, pool, net))], ducts
    if len(pool) > 1:
        hint = f"--zones {shlex.quote(','.join(pool))} (leave out what does not count)"
        run.fault(None, "zones", f"{quantity} of {', '.join(pool)}", "the zones that count", hint)
    return [(1.0, z) for z in pool], ducts if len(pool) > 1 else []


def _turning(run: OpenRun, quantity: str, pool: Mapping[str, LoadColumn], zones: Sequence[str]) -> Sequence[str]:
    """Those of the stated zones that count: of a torque the ones on the shaft."""
    shaft = _on_shaft(run, pool, zones) if quantity == "torque" and len(zones) > 1 else zones
    if shaft and (left := [z for z in zones if z not in shaft]):
        run.notes.append(f"torque is that of {' + '.join(shaft)}, without {', '.join(left)}: the shaft's own")
    return shaft or zones


def _less(run: OpenRun, quantity: str, pool: Mapping[str, LoadColumn], net: str) -> list[str]:
    """Zones to take off the whole: of a torque those that are not on the shaft."""
    parts = [z for z in pool if z != net] if quantity == "torque" else []
    turning = _on_shaft(run, pool, parts) if parts else []
    less = [z for z in parts if z not in turning]
    if less:
        run.notes.append(f"torque: {net or 'the whole'} less {', '.join(less)}: the shaft's own; thrust counts all")
    return less
