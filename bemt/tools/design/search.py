r"""Which propeller on which motor: labels against a target, with the probability that it is met.

At a thrust, the rotor's speed and torque Q are known, and the drive (`bemt.tools.drive.drive_model`) inverts in closed
form:

    I = Q/k + I_0,   d^2 R_b I - d V_oc + k Omega + R I = 0,   P = (V_oc - R_b d I) d I

with the smaller root d, the duty; the thrust is out of reach where d is above 1 or not real. A motor that is tried by
its K_v weighs what its torque at the target asks for (:mod:`bemt.tools.design.motors_file`). The resistance of one that
states none is that of its class (`bemt.rotors.case.motor`), as in `drive`. Idle current and battery take the
shares at full throttle and rest that `bemt.rotors.case.unknowns` declares (3582 points of 1088 recorded motors):

    k Omega_full = (1 - sag) V_oc - R I_full,   I_full = Q_full / (k (1 - idle)).

Rotor, motor and battery vary together: thrust and torque of the rotor with the bands and the correlation of
`bemt.rotors.case.propagate`, log-normal; each share uniform on either side of its value, which is its median (the
ranges reach further up: drawn evenly, the losses would be larger than typical). The same 256 draws serve every pair, so
that the ranking is not noise: a rank-1 lattice (Korobov 1959), as even as Sobol's points without the import of
`scipy.stats`.
"""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, refuse
from bemt.base.units import G0, INCH
from bemt.rotors.case.drive_schema import LIPO_SOC, LIPO_V
from bemt.rotors.case.motor import SCATTER, SCATTER_MASS, class_resistance
from bemt.rotors.case.tip_speed import fastest_kv
from bemt.rotors.case.unknowns import DRIVE, ESC_DROP
from bemt.tools.design import motors_file, rotor_loads
from bemt.tools.design.motors_file import KnownMotor
from bemt.tools.design.rotor_loads import LoadScatter, RotorLoads

if TYPE_CHECKING:
    import pandas as pd

DIAMETERS = (3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 20, 22, 24, 26, 28, 30, 32, 36, 40)
"""Diameters on sale [in]."""
RATIOS = ((5.6, (0.6, 0.75, 0.9)), (10.6, (0.47, 0.55, 0.7)), (math.inf, (0.36, 0.45, 0.55, 0.7)))
"""Pitch over diameter of the labels that are tried, up to a diameter [in]: from the lowest tenth to the upper quarter
of 567 propellers on sale that Drive Calculator lists; small ones have more pitch [1]."""
FLYING = (0.85, 1.0, 1.2)
"""More pitches over the diameter where the target flies [1]."""
SOC = 0.5
"""State of charge of thrust, current and power, as in `drive`; flight begins full and ends at `SOC_END`."""
SOC_END = 0.2
EFFICIENCY = 0.8
"""Of motor and controller, for the size of the controller alone: declared [1]."""
SHARES = {item.key.rpartition(".")[2]: item for item in (*DRIVE, ESC_DROP)}
LOADING = {"air": (15.0, 1200.0), "water": (300.0, 60_000.0), "fan": (500.0, 12_000.0)}
"""Disk loading of the sizes that are tried, in air, in water, of ducted fans [N/m2]."""
WATER_DIAMETERS = (2, 2.5, *DIAMETERS[:21])
FAN_MM = (30, 40, 50, 55, 64, 70, 80, 90, 105, 120)
"""Ducted fans on sale [mm]."""
TIP_IN_WATER = 40.0
"""Tip speed to which a propeller is solved in water: it cavitates long before [m/s]."""
POWER_BAND = 0.64
"""Standard uncertainty of the power at a thrust over the scatter of the draws: rms of the error over it, of 256
readings of six stands (0.58) and 149 labels of UIUC at rest (0.73); 0.63 to 0.69 with a stand or a maker's family left
out. The bands of thrust and torque are wider than labels err at rest (docs/choose_benches.py) [1]."""
NEAR = 0.05
"""The smallest within this share of the least power comes first: the optimum is flat, and no label is known better."""
DRAWS = 256
PILOT = 32
"""Draws of the ranking that only finds which pair the mass is stated for."""
AGAIN = 0.002
"""Of the mass: a first pair that is further from it is not that of the pilot [1]."""
SETTLED = 1e-4
"""Change of the speed at full throttle from which on it is solved [rev/min]."""
LATTICE = 235
"""Of the odd generators the one with the least centred discrepancy in six dimensions: 5.8e-4, Sobol's points 5.5e-4.
The seventh coordinate, of the masses, hardly moves any result."""


@dataclass(frozen=True)
class Target:
    """What a propeller has to do."""

    thrust_N: float  # Of one rotor at full throttle. [N]
    cells: int  # LiPo cells in series
    cruise_N: float | None = None  # Thrust at which power, current and time are stated; `thrust_N` unless given. [N]
    airspeed_m_s: float = 0.0  # Of flight. [m/s]
    max_tip_mach: float = 0.8  # Helical, at the target thrust
    rotors: int = 1  # On the battery
    # Battery capacity [A h]; time at `cruise_N` that is part of the target [min]
    capacity_Ah: float | None = None
    minutes: float | None = None
    # Mass of the vehicle, and of it without motors, propellers, controllers and arms [kg]. Every pair lifts the same
    # rest and its own parts. A rest that was not told is what the first pair leaves of the mass: it hovers the mass.
    mass_kg: float | None = None
    rest_kg: float | None = None
    told_rest: bool = False
    fixed: bool = True  # Whether the thrust is asked for, not twice that of hover
    use: rotor_loads.Use = rotor_loads.ALONE
    fan: bool = False
    sized: bool = True  # Whether motors are as large as the thrust asks for, else those of a list
    arm_m: float | None = None  # Of the frame, which leaves room for the largest diameter [m]
    max_diameter_in: float | None = None

    @property
    def arms(self) -> int:
        """Arms that carry the rotors."""
        return self.rotors // 2 if self.use.coaxial else self.rotors

    @property
    def voc(self) -> float:
        """Open-circuit voltage at `SOC`. [V]"""
        return self.cells * float(np.interp(SOC, LIPO_SOC, LIPO_V))

    @property
    def loaded_V(self) -> float:
        """Voltage of a typical battery at `SOC` and full throttle."""
        return float((1.0 - SHARES["sag"].value) * self.voc)

    def suited(self, diameter_in: float, machines: Sequence[KnownMotor]) -> tuple[KnownMotor, ...]:
        """Motors tried by their K_v that turn no tip faster than those with a propeller do; all, if none or if told."""
        if not self.sized or self.fan or self.use.fluid != "air":
            return tuple(machines)
        most = fastest_kv(self.loaded_V, diameter_in * INCH)
        return tuple(m for m in machines if m.kv <= most) or tuple(machines)

    @property
    def sizes_in(self) -> Sequence[float]:
        """Standard diameters, smallest first. [in]"""
        if self.fan:
            return [mm / 25.4 for mm in FAN_MM]
        return WATER_DIAMETERS if self.use.fluid == "water" else DIAMETERS

    @property
    def at_N(self) -> float:
        """Thrust at which power is stated. [N]"""
        return self.thrust_N if self.cruise_N is None else self.cruise_N


def choose(
    target: Target, kv: float | Sequence[float], motors: Any, labels: Any, blades: Any, max_diameter_in: float | None,
    sure: float,
) -> tuple[pd.DataFrame, Target, pd.DataFrame]:  # fmt: skip
    """Rank propellers and motors; arguments as those of :func:`bemt.choose`.

    A row per pair, best first. ``mean_W`` is the power to expect over its band, exp(u^2/2) times the nominal one: of
    two equal labels that which is known better costs less. ``propulsion_g`` is the mass of one rotor's motor,
    propeller, controller and arm, ``at_N`` the thrust of the power, ``mass_kg`` what the vehicle weighs with the pair,
    ``reached`` the probability of thrust and tip Mach number without the time, ``why`` says why it is not the first.
    Pairs that meet the target with the probability `sure` come first: the smallest within 5 % of the least mean power,
    the one with the least, then by mean power. Beside it the target as it was tried, and likewise up to three motors on
    sale for the first propeller.
    """
    import pandas as pd

    ends, counts = _several(kv), _several(blades)
    _check(ends, max_diameter_in, sure, counts)
    room = math.inf if target.arm_m is None else motors_file.diameter_on(target.arm_m, target.arms) / INCH
    most = min(room, math.inf if max_diameter_in is None else max_diameter_in)
    kvs = np.geomspace(min(ends), max(ends), 72) if min(ends) < max(ends) else np.array(ends[:1])
    given = [motors] if isinstance(motors, (str, os.PathLike)) else motors
    known = tuple(m for one in given for m in motors_file.motors_of(one))
    target = dataclasses.replace(target, max_diameter_in=None if math.isinf(most) else most, sized=not known)
    machines = known or tuple(KnownMotor(f"{v:.0f} rev/min/V", float(v)) for v in kvs)
    names = _several(labels) or _standard(target, counts)
    if target.use.reading is not None and len(names) != 1:
        hint = "Name it with --labels"
        raise InputError(Fault("", "--reading", f"{len(names)} propellers", "the one that gave it", hint))
    loads = [found for name in names if (found := _loads(name, target, machines)) is not None]
    if not loads:
        raise InputError(Fault("", "--labels", "none that can be solved", "a propeller that can reach the speed"))
    spreads = rotor_loads.scatters(loads, target.thrust_N, target.airspeed_m_s, target.use)
    near = [rotor_loads.nearest(one, spreads) for one in loads]

    def ranked(lifting: Target, draws: int = DRAWS) -> pd.DataFrame:
        found = (
            _rows(one, u, target.suited(one.diameter_m / INCH, machines), lifting, draws)
            for one, u in zip(loads, near, strict=True)
        )
        return _ranked(pd.DataFrame([row for rows in found for row in rows]), sure)

    if target.mass_kg is not None and not target.told_rest:
        target = _lifting(target, ranked(target, PILOT), loads, machines)
    table = ranked(target)
    if target.mass_kg is not None and not target.told_rest:
        other = _lifting(target, table, loads, machines)
        if abs((other.rest_kg or 0.0) - (target.rest_kg or 0.0)) > AGAIN * target.mass_kg:  # the pilot had another
            target = other
            table = ranked(target)
    table["why"] = _reasons(table, target, sure)
    table = table.drop(columns="beyond")
    return table, target, pd.DataFrame(_on_sale(table, loads, spreads, target, sure))


def _lifting(
    target: Target, table: pd.DataFrame, loads: Sequence[RotorLoads], machines: Sequence[KnownMotor]
) -> Target:
    """Target with the rest that the first pair of a table leaves of the mass, its own parts being sized for that."""
    mass, first = target.mass_kg or 0.0, table.iloc[0]
    one = next(x for x in loads if x.label == first.label)
    motor = next(m for m in machines if m.name == first.motor)
    at = mass * G0 / target.rotors
    asked = target.thrust_N if target.fixed else 2.0 * at
    _, own_kg = _own(one, target, asked, motor.mass_g if len(machines) == 1 or not target.sized else math.nan)
    return dataclasses.replace(target, rest_kg=max(mass - target.rotors * own_kg, 0.0))


def _own(loads: RotorLoads, target: Target, asked_N: float, motor_g: float) -> tuple[motors_file.Masses, float]:
    """Parts of one rotor for a thrust at full throttle, and their mass [kg]: two of a pair share an arm."""
    n = float(np.nan_to_num(loads.speed_for(np.array([asked_N]))[0], nan=loads.rpm[-1]))
    parts = _parts(loads, target, n, asked_N, motor_g)
    return parts, float(parts.total - (0.5 * parts.arm if target.use.coaxial else 0.0))


MAKERS = 3
"""Motors on sale that are named, each of another maker."""


def _on_sale(
    table: pd.DataFrame, loads: Sequence[RotorLoads], spreads: Sequence[LoadScatter], target: Target, sure: float
) -> list[dict[str, Any]]:
    """The most usual motors on sale for the first propeller that are sure of the target and stand full throttle."""
    first = table.iloc[0]
    if not target.sized or first.probability < sure or target.use.fluid != "air":
        return []
    one = next(x for x in loads if x.label == first.label)
    even = table[(table.label == first.label) & (table.probability >= 0.5)].sort_values("kv").iloc[0]
    theirs, u = dataclasses.replace(target, sized=False), rotor_loads.nearest(one, spreads)
    found: dict[str, dict[str, Any]] = {}
    for motor in motors_file.on_sale(math.sqrt(even.kv * first.kv), first.motor_g, 0.8 * even.peak_A):
        if motor.maker in found:
            continue
        row = _rows(one, u, (motor,), theirs)[0]
        if row["probability"] >= sure and not row.pop("beyond"):
            found[motor.maker] = row | {"maker": motor.maker, "max_current_A": motor.max_current_A}
        if len(found) == MAKERS:
            break
    return list(found.values())


def _several(value: Any) -> tuple[Any, ...]:
    """One value, or several."""
    return (value,) if isinstance(value, str) or _is_number(value) else tuple(value)


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


_RANGES: dict[str, tuple[float, float, str, str]] = {  # lowest and highest value, and what one below or above may be
    "--thrust-N": (0.01, 5000.0, "", ""), "--mass-kg": (0.005, 1000.0, "", "In grams? Divide by 1000"),
    "--cells": (1, 60, "", ""), "--rotors": (1, 64, "", ""), "--airspeed-m-s": (0.0, 150.0, "", "km/h? Divide by 3.6"),
    "--max-tip-mach": (0.05, 0.95, "Section theory ends below Mach 1", "Section theory ends below Mach 1"),
    "--capacity-Ah": (0.01, 1000.0, "", "In mAh? Divide by 1000"), "--minutes": (0.01, 1e4, "", ""),
    "--rest-kg": (0.001, 1000.0, "Part of the mass", "Part of the mass"),
    "--arm-mm": (10.0, 5000.0, "In metres? Times 1000", ""),
}  # fmt: skip


def _out_of_range(given: Mapping[str, float | None]) -> list[Fault]:
    """Numbers out of their range, and parts of a cell or a rotor."""
    told = {k: v for k, v in given.items() if v is not None}
    out = [Fault("", k, f"{told[k]:g}", "a whole number") for k in ("--cells", "--rotors") if told[k] % 1 != 0]
    for name, value in told.items():
        low, high, below, above = _RANGES[name]
        high = told.get("--mass-kg") or high if name == "--rest-kg" else high
        if not low <= value <= high:
            hint = above if value > high else below
            out.append(Fault("", name, f"{value:g}", f"a number from {low:g} to {high:g}", hint))
    return out


def _clashes(
    use: rotor_loads.Use, fan: bool, rotors: float, rest_kg: float | None, mass_kg: float | None
) -> Iterator[Fault]:
    """Options that do not go together."""
    if use.fluid not in LOADING or use.fluid == "fan":
        yield Fault("", "--fluid", repr(use.fluid), "air or water")
    clash = ["--coaxial"] * use.coaxial + ["--fluid water"] * (use.fluid == "water") + ["--reading"] * bool(use.reading)
    if fan and clash:
        yield Fault("", "--fan", f"with {clash[0]}", "a fan by its size, alone in air")
    if rest_kg is not None and mass_kg is None:
        yield Fault("", "--rest-kg", "given", "nothing without --mass-kg")
    if use.coaxial and (not _is_number(rotors) or rotors % 2 != 0):
        yield Fault("", "--rotors", f"{rotors}", "an even number, for pairs of them", "It counts both of a pair")


def target_of(
    thrust_N: float | None, cells: int | None, mass_kg: float | None, rest_kg: float | None, rotors: int,
    airspeed_m_s: float, max_tip_mach: float, capacity_Ah: float | None, minutes: float | None, fan: bool, fluid: str,
    coaxial: bool, arm_mm: float | None, reading: str | None,
) -> Target:  # fmt: skip
    """What is asked for; all faults at once."""
    given = {
        "--thrust-N": thrust_N, "--mass-kg": mass_kg, "--cells": cells, "--rotors": rotors,
        "--airspeed-m-s": airspeed_m_s, "--max-tip-mach": max_tip_mach, "--capacity-Ah": capacity_Ah,
        "--minutes": minutes, "--rest-kg": rest_kg, "--arm-mm": arm_mm,
    }  # fmt: skip
    example, faults = "As in --thrust-N 27 --cells 6", []
    if thrust_N is None and mass_kg is None:
        faults.append(Fault("", "--thrust-N", "nothing", "a thrust [N] or a mass [kg]", example))
    if cells is None:
        faults.append(Fault("", "--cells", "nothing", "cells in series", example))
    if minutes is not None and capacity_Ah is None:
        faults.append(Fault("", "--capacity-Ah", "nothing", "the battery's capacity [A h], for the time"))
    faults += [Fault("", k, repr(v), "a number") for k, v in given.items() if not (v is None or _is_number(v))]
    use = rotor_loads.Use(fluid, coaxial, reading)
    refuse([*faults, *_clashes(use, fan, rotors, rest_kg, mass_kg)])
    refuse(_out_of_range(given))
    hover, most, rest = None, thrust_N or 0.0, rest_kg
    if mass_kg is not None:
        hover = mass_kg * G0 / rotors
        most = 2.0 * hover if thrust_N is None else thrust_N
        rest = (1.0 - motors_file.SHARE) * mass_kg if rest_kg is None else rest_kg  # to start with
        if most < hover:
            hint = f"Each of {rotors} carries {hover:.2f} N in hover"
            raise InputError(Fault("", "--thrust-N", f"{most:g}", f"{hover:.4g} N or more", hint))
    arm_m = None if arm_mm is None else 1e-3 * arm_mm
    return Target(most, int(cells or 1), hover, airspeed_m_s, max_tip_mach, rotors, capacity_Ah, minutes, mass_kg, rest,
                  rest_kg is not None, thrust_N is not None, use, fan, True, arm_m)  # fmt: skip


def _check(kv: Sequence[float], max_diameter_in: float | None, sure: float, blades: Sequence[int]) -> None:
    faults = []
    if not 1 <= len(kv) <= 2 or not all(_is_number(v) and 20.0 <= v <= 50_000.0 for v in kv):
        faults.append(Fault("", "--kv", ":".join(f"{v}" for v in kv), "LOW:HIGH from 20 to 50000 rev/min/V"))
    if max_diameter_in is not None and not 1.0 <= max_diameter_in <= 120.0:
        hint = "Is that in mm? Divide by 25.4" if max_diameter_in > 120.0 else ""
        faults.append(Fault("", "--max-diameter-in", f"{max_diameter_in:g}", "a number from 1 to 120", hint))
    if not 0.0 < sure < 1.0:
        hint = "In percent? Divide by 100" if 1.0 < sure < 100.0 else ""
        faults.append(Fault("", "--sure", f"{sure:g}", "a probability between 0 and 1", hint))
    faults += [Fault("", "--blades", f"{b}", "2 to 8") for b in blades if b not in range(2, 9)]
    refuse(faults)


def _area(diameter_in: float) -> float:
    return 0.25 * math.pi * (diameter_in * INCH) ** 2


def _no_size(target: Target, small: Sequence[float]) -> Fault:
    """The thrust that no standard size carries, and what those that have room do."""
    what = "fan" if target.fan else "standard size"
    hint = "Or more rotors" if target.fan else "Other sizes: name them with --labels"
    if not small:
        expected = f"{target.sizes_in[0]:.3g} in or more, the smallest {what}"
        where = "--max-diameter-in" if target.arm_m is None else "--arm-mm"
        return Fault("", where, f"room for {target.max_diameter_in:.3g} in", expected, hint)
    least, most = LOADING["fan" if target.fan else target.use.fluid]
    low, high = least * _area(small[0]), most * _area(small[-1])
    within = "" if target.max_diameter_in is None else f" within {target.max_diameter_in:.3g} in"
    expected = f"{low:.2g} to {high:.3g} N, the load of a {what} from {small[0]:.3g} to {small[-1]:.3g} in"
    return Fault("", "--thrust-N", f"{target.thrust_N:g} N{within}", expected, hint)


def _standard(target: Target, blades: Sequence[int]) -> tuple[str, ...]:
    """Standard sizes whose disk loading at the target can be expected to work."""
    least, most = LOADING["fan" if target.fan else target.use.fluid]
    room = math.inf if target.max_diameter_in is None else target.max_diameter_in * (1.0 + 1e-9)
    small = [D for D in target.sizes_in if room >= D]
    fit = [D for D in small if least <= target.thrust_N / _area(D) <= most]
    if not fit:
        raise InputError(_no_size(target, small))
    if target.fan:
        return tuple(f"{rotor_loads.FAN}{25.4 * D:.3g} mm" for D in fit)
    flying = target.airspeed_m_s > 0.0 or target.use.fluid == "water"
    pairs = [(D, P) for D in fit for P in pitches_in(D, flying)]
    return tuple(f"{D:g}x{P:g}" + (f"x{B}" if B != 2 else "") for D, P in pairs for B in blades)


def pitches_in(diameter_in: float, flying: bool) -> tuple[float, ...]:
    """Pitches on sale in steps of half an inch [in].

    >>> pitches_in(5, False), pitches_in(10, False)
    ((3.0, 4.0, 4.5), (4.5, 5.5, 7.0))
    """
    ratios = next(few for most, few in RATIOS if diameter_in < most) + (FLYING if flying else ())
    return tuple(dict.fromkeys(max(round(2.0 * diameter_in * ratio) / 2.0, 0.5) for ratio in ratios))


def _loads(label: str, target: Target, machines: Sequence[KnownMotor]) -> RotorLoads | None:
    D = rotor_loads.size_in(label) * INCH
    tip = TIP_IN_WATER if target.use.fluid == "water" else 0.97 * 340.0
    fastest = 1.05 * max(m.kv for m in machines) * target.voc
    most = min(60.0 * tip / (math.pi * D), fastest)
    return rotor_loads.rotor_loads(label, most, target.airspeed_m_s, use=target.use)


@cache
def _draws() -> tuple[Array, Array]:
    """Standard normal (3, DRAWS + 1) for rotor and mass, quantiles (4, DRAWS + 1) of shares; the first is nominal."""
    from scipy.special import ndtri

    steps = np.array([pow(LATTICE, j, DRAWS) for j in range(7)])
    u = (np.outer(steps, np.arange(DRAWS)) + 0.5) / DRAWS % 1.0
    z = ndtri(u[[0, 1, 6]])
    return np.c_[np.zeros(3), z], np.c_[np.full(4, 0.5), u[2:6]]


@dataclass(frozen=True, eq=False)
class _Chain:
    """Motors with one battery share at draws, (M, N) each."""

    k: Array
    ohm: Array
    idle_A: Array
    battery_ohm: Array
    voc: float

    def at(self, rpm: Array, torque_Nm: Array) -> tuple[Array, Array, Array]:
        """Duty, battery current [A] and power [W]; NaN where it does not get there."""
        amps = torque_Nm / self.k + self.idle_A
        need = self.k * rpm * math.pi / 30.0 + self.ohm * amps
        a = self.battery_ohm * amps
        with np.errstate(invalid="ignore"):
            duty = 2.0 * need / (self.voc + np.sqrt(self.voc**2 - 4.0 * a * need))
            duty = np.where(duty <= 1.0 + 1e-9, duty, math.nan)
        bus = duty * amps
        return duty, bus, (self.voc - self.battery_ohm * bus) * bus


def _chain(loads: RotorLoads, machines: Sequence[KnownMotor], target: Target, draws: int = DRAWS) -> _Chain:
    drawn = {
        name: np.interp(u[: draws + 1], [0.0, 0.5, 1.0], [item.low, item.value, item.high])
        for (name, item), u in zip(SHARES.items(), _draws()[1], strict=True)
    }
    sag, idle, lost, scale = (drawn[name] for name in ("sag", "idle_share", "drop", "size"))
    kv, told, no_load, mass = (
        np.array([[getattr(m, f)] for m in machines]) for f in ("kv", "resistance_ohm", "no_load_A", "mass_g")
    )
    k, loaded = 30.0 / (math.pi * kv), (1.0 - sag) * target.voc
    size = np.exp(scale * np.where(np.isnan(mass), 1.0, SCATTER_MASS / SCATTER))
    lost, rest = np.where(np.isnan(told), 0.0, lost), loads.rest or loads
    full = np.minimum((0.9 - lost) * loaded / k * 30.0 / math.pi, rest.rpm[-1])
    for _ in range(80):
        amps = rest.torque_at(full) / k / (1.0 - idle)
        ohm = np.where(np.isnan(told), size * class_resistance(amps, kv, mass), told)
        old, new = full, np.maximum(((1.0 - lost) * loaded - ohm * amps) / k * 30.0 / math.pi, 1.0)
        full = 0.7 * full + 0.3 * np.minimum(new, rest.rpm[-1])
        if np.nanmax(np.abs(full - old)) < SETTLED:
            break
    winding = lost * loaded / amps + ohm
    idle_A = np.where(np.isnan(no_load), idle * amps, no_load)
    return _Chain(k, winding, idle_A, sag * target.voc / amps, target.voc)


def _rows(
    loads: RotorLoads, u: LoadScatter, machines: Sequence[KnownMotor], target: Target, draws: int = DRAWS
) -> list[dict[str, Any]]:  # fmt: skip
    z = _draws()[0][:, : draws + 1]
    thrust = np.exp(u.u_thrust * z[0])
    torque = np.exp(u.u_torque * (u.correlation * z[0] + math.sqrt(1.0 - u.correlation**2) * z[1]))
    at, asked = np.full((1, 1), target.at_N), np.full((1, 1), target.thrust_N)
    for _ in range(1 if target.rest_kg is None else 8):  # a heavier motor lifts itself as well
        parts, own_kg = _own(loads, target, float(asked[0, 0]), machines[0].mass_g if len(machines) == 1 else math.nan)
        if target.rest_kg is not None:
            heavier = np.exp(min(float(parts.u) / own_kg, 1.0) * z[2]) if target.told_rest else np.ones(draws + 1)
            at = G0 * (target.rest_kg / target.rotors + own_kg * heavier)[None, :]
            asked = asked if target.fixed else 2.0 * at
    chain = _chain(loads, machines, target, draws)
    own = _Chain(chain.k, chain.ohm[:, :1], chain.idle_A[:, :1], chain.battery_ohm[:, :1], chain.voc)
    duty, bus, watts = own.at(loads.rpm[None, :], loads.torque_Nm[None, :])
    reach = np.isfinite(duty)
    last = loads.rpm.size - 1 - np.argmax(reach[:, ::-1], axis=1)
    some, motor = reach.any(axis=1), np.arange(len(machines))
    most, peak = np.where(some, loads.thrust_N[last], 0.0), np.where(some, bus[motor, last], math.nan)
    peak_W = np.where(some, watts[motor, last], math.nan)
    n_full, n_at = (loads.speed_for(T / thrust) for T in (asked, at))
    duty, _, _ = chain.at(n_full, torque * loads.torque_at(n_full))
    _, amps, power = chain.at(n_at, torque * loads.torque_at(n_at))
    mach = np.broadcast_to(loads.tip_mach(n_full, target.airspeed_m_s), duty.shape)
    met = np.isfinite(duty) & (mach <= target.max_tip_mach)
    reached = met[:, 1:].mean(axis=1)
    minutes = 60.0 * (1.0 - SOC_END) * (target.capacity_Ah or 1.0) / target.rotors / amps
    if target.minutes is not None:
        met &= minutes >= target.minutes
    chance = met[:, 1:].mean(axis=1)
    scatter = np.array(
        [POWER_BAND * float(np.std(p[np.isfinite(p)])) if np.isfinite(p).sum() > 9 else math.nan for p in power[:, 1:]]
    )
    mean = power[:, 0] * np.exp(np.minimum(0.5 * (scatter / power[:, 0]) ** 2, 10.0))
    at, asked, n_at = (np.broadcast_to(v, power.shape)[:, 0] for v in (at, asked, n_at))
    return [
        {"label": loads.label, "diameter_in": loads.diameter_m / INCH, "motor": m.name, "kv": m.kv,
         "probability": float(chance[i]), "reached": float(reached[i]),
         "power_W": float(power[i, 0]), "u_power_W": float(scatter[i]), "mean_W": float(mean[i]),
         "current_A": float(amps[i, 0]), "peak_A": float(peak[i]),
         "g_per_W": 1e3 * float(at[i]) / G0 / float(power[i, 0]), "minutes": float(minutes[i, 0]),
         "rpm": float(n_at[i]),
         "tip_mach": float(mach[i, 0]), "full_thrust_N": float(most[i]), "propulsion_g": 1e3 * own_kg,
         "motor_g": 1e3 * float(parts.motor),
         "mass_kg": math.nan if target.rest_kg is None else target.rotors * float(at[i]) / G0,
         "at_N": float(at[i]), "asked_N": float(asked[i]), "keller_N": loads.keller_N,
         "beyond": _beyond(m, float(peak[i]), float(peak_W[i]))}
        for i, m in enumerate(machines)
    ]  # fmt: skip


def _beyond(motor: KnownMotor, peak_A: float, peak_W: float) -> str:
    """What a motor takes at full throttle beyond what its maker allows; "" where nothing is known to be."""
    pairs = ((peak_A, motor.max_current_A, "A"), (peak_W, motor.max_power_W, "W"))
    words = " and ".join(f"{v:.3g} {unit} of {most:.4g}" for v, most, unit in pairs if v > most)
    return words and f"takes {words} at full throttle"


def _parts(loads: RotorLoads, target: Target, rpm: float, thrust_N: float, motor_g: float) -> motors_file.Masses:
    """Mass of one rotor's parts for the thrust asked for at a speed, with a motor of which the mass may be known."""
    torque = float(loads.torque_at(np.array([rpm]))[0])
    arm = motors_file.arm_for(loads.diameter_m, target.arms) if target.arm_m is None else target.arm_m
    watts = torque * rpm * math.pi / 30.0 / EFFICIENCY
    carried = 0.0 if target.rest_kg is None else arm
    parts = motors_file.masses(torque, watts, thrust_N, loads.diameter_m, loads.blades, carried)
    return parts if math.isnan(motor_g) else dataclasses.replace(parts, motor=np.asarray(1e-3 * motor_g))


def _ranked(table: pd.DataFrame, sure: float) -> pd.DataFrame:
    """Sure pairs first: the smallest within `NEAR` of the least mean power, the least, then by mean power."""
    lost = table.mean_W.isna() | (table.probability < sure)
    power = table.mean_W.where(~lost, math.inf)
    order = np.lexsort((-table.full_thrust_N, power, np.where(lost, -table.probability, 0.0), lost))
    found = table.iloc[order].reset_index(drop=True)
    good = found[: int((~lost).sum())]
    if good.empty:
        return found
    near = good[good.mean_W <= (1.0 + NEAR) * good.mean_W.iloc[0]]
    first = near[near.diameter_in <= near.diameter_in.min() * (1.0 + 1e-9)].index[0]
    return found.loc[[first, *found.index.drop(first)]].reset_index(drop=True)


def _reasons(table: pd.DataFrame, target: Target, sure: float) -> list[str]:
    """Why each pair is not the first."""
    best = table.iloc[0]
    out = []
    for i, row in enumerate(table.itertuples()):
        words = []
        if row.full_thrust_N < row.asked_N:
            words.append(f"full throttle gives {row.full_thrust_N:.3g} N of {row.asked_N:.3g}")
        if row.tip_mach > target.max_tip_mach:
            words.append(f"tip Mach {row.tip_mach:.2f}")
        if target.use.fluid == "water" and row.asked_N > row.keller_N:
            words.append(f"may cavitate: wants wider blades above {row.keller_N:.3g} N")
        if target.minutes is not None and row.minutes < target.minutes:
            words.append(f"{row.minutes:.1f} min")
        short = [f"{row.full_thrust_N / row.asked_N - 1.0:.0%} thrust"] if row.reached < sure else []
        if target.minutes is not None and row.probability < row.reached:
            short.append(f"{row.minutes / target.minutes - 1.0:.0%} time")
        if not words and row.probability < sure:
            words.append(f"{' and '.join(short)} in hand: too little for the bands")
        if not words and i:
            more, size = row.mean_W / best.mean_W - 1.0, row.diameter_in - best.diameter_in
            words.append(f"{more:+.1%} power" + (f", {size:+.3g} in" if more < 0.0 and size > 0.0 else ""))
        out.append(", ".join([*words, *([row.beyond] if row.beyond else [])]))
    return out
