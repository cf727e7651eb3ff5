r"""Which propeller on which motor: labels against a target, with the probability that it is met.

At a thrust, the rotor's speed and torque Q are known, and the drive (`bemt.tools.drive.drive_model`) inverts in closed
form:

    I = Q/k + I_0,   d^2 R_b I - d V_oc + k Omega + R I = 0,   P = (V_oc - R_b d I) d I

with the smaller root d, the duty; the thrust is out of reach where d is above 1 or not real. A motor of which only K_v
is known has the resistance of its class (`bemt.rotors.case.motor`), as in `drive`; idle current and battery take the
shares at full throttle that `bemt.rotors.case.unknowns` declares (3582 points of 1088 recorded motors):

    k Omega_full = (1 - sag) V_oc - R I_full,   I_full = Q_full / (k (1 - idle)).

Rotor, motor and battery vary together: thrust and torque of the rotor with the bands and the correlation of
`bemt.rotors.case.propagate`, log-normal; each share uniform on either side of its value, which is its median (the
ranges reach further up: drawn evenly, the losses would be larger than typical). The same 256 draws serve every pair, so
that the ranking is not noise: a rank-1 lattice (Korobov 1959), as even as Sobol's points without the import of
`scipy.stats`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.units import G0, INCH
from bemt.rotors.case.drive_schema import LIPO_SOC, LIPO_V
from bemt.rotors.case.motor import usual_resistance
from bemt.rotors.case.unknowns import DRIVE, ESC_DROP
from bemt.tools.design import rotor_loads
from bemt.tools.design.motors_file import KnownMotor, read_motors
from bemt.tools.design.rotor_loads import LoadScatter, RotorLoads

if TYPE_CHECKING:
    import pandas as pd

DIAMETERS = (3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 20, 22, 24, 26, 28, 30, 32, 36, 40)
"""Diameters on sale [in]."""
RATIOS = (0.35, 0.45, 0.55, 0.7)
"""Pitch over diameter of the labels that are tried; the pitch is rounded to half inches [1]."""
SOC = 0.5
"""State of charge of thrust, current and power, as in `drive`; flight begins full and ends at `SOC_END`."""
SOC_END = 0.2
SHARES = {item.key.rpartition(".")[2]: item for item in (*DRIVE, ESC_DROP)}
LOADING = (15.0, 1200.0)
"""Disk loading of the labels that are tried [N/m2]."""
DRAWS = 256
LATTICE = 235
"""Of the odd generators the one with the least centred discrepancy in six dimensions: 5.8e-4, Sobol's points 5.5e-4."""
SCATTERS = 4  # labels whose bands are computed; others take the nearest


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

    @property
    def voc(self) -> float:
        """Open-circuit voltage at `SOC`. [V]"""
        return self.cells * float(np.interp(SOC, LIPO_SOC, LIPO_V))

    @property
    def at_N(self) -> float:
        """Thrust at which power is stated. [N]"""
        return self.thrust_N if self.cruise_N is None else self.cruise_N


def choose(
    thrust_N: float | None = None,
    cells: int | None = None,
    *,
    kv: float | Sequence[float] = (100.0, 3000.0),
    motors: Sequence[KnownMotor] | str | os.PathLike[str] = (),
    labels: str | Sequence[str] = (),
    blades: int | Sequence[int] = (2,),
    mass_kg: float | None = None,
    rotors: int = 1,
    airspeed_m_s: float = 0.0,
    max_diameter_in: float | None = None,
    max_tip_mach: float = 0.8,
    capacity_Ah: float | None = None,
    minutes: float | None = None,
    sure: float = 0.9,
) -> pd.DataFrame:
    """Rank propellers and motors for a thrust or a mass.

    Parameters
    ----------
    thrust_N : float, optional
        Thrust of one rotor at full throttle; twice the hover thrust if only `mass_kg` is given. [N]
    cells : int
        LiPo cells in series.
    kv : float or (low, high)
        Speed constant, or the range of which 60 are tried. [rev/min/V]
    motors : sequence of KnownMotor, or path
        Real motors instead of `kv`, or a CSV with ``name,kv,resistance_mohm,no_load_A``.
    labels : str or sequence of str
        Labels to try, as ``10x5`` or ``9x4.5x3``; standard sizes by default.
    blades : int or sequence of int
        Of the standard sizes.
    mass_kg, rotors : optional
        Vehicle; power, current and time are then those of hover instead of those at `thrust_N`.
    airspeed_m_s, max_diameter_in, max_tip_mach : optional
        Flight speed [m/s], limit on size [in] and on the helical tip Mach number at `thrust_N`.
    capacity_Ah, minutes : optional
        Battery capacity; with it, time in hover that is part of the target [min].
    sure : float
        Pairs that meet the target with this probability come first, least power first; then the others, by probability.

    Returns
    -------
    pandas.DataFrame
        A row per pair, best first: ``label, motor, kv, probability, power_W, u_power_W, current_A, peak_A, g_per_W,
        minutes, rpm, tip_mach, full_thrust_N, why``; ``why`` says why it is not the first.

    Raises
    ------
    InputError
        With every fault of the request, or if no size can be tried.

    Examples
    --------
    >>> found = choose(8.0, 3, labels=["10x4.5", "9x6", "8x4"], kv=(700, 1500))
    >>> found.label.iloc[0], bool(found.probability.iloc[0] >= 0.9)
    ('10x4.5', True)
    """
    import pandas as pd

    target = _target(thrust_N, cells, mass_kg, rotors, airspeed_m_s, max_tip_mach, capacity_Ah, minutes)
    ends, counts = _several(kv), _several(blades)
    _check(ends, max_diameter_in, sure, counts)
    kvs = np.geomspace(min(ends), max(ends), 60) if min(ends) < max(ends) else np.array(ends[:1])
    known = read_motors(motors) if isinstance(motors, (str, os.PathLike)) else tuple(motors)
    machines = known or tuple(KnownMotor(f"{v:.0f} rev/min/V", float(v)) for v in kvs)
    names = _several(labels) or _standard(target, max_diameter_in, counts)
    loads = [found for name in names if (found := _loads(name, target, machines)) is not None]
    if not loads:
        raise InputError(Fault("", "--labels", "none that can be solved", "a propeller that can reach the speed"))
    spreads = _scatters(loads, target)
    rows = [row for one in loads for row in _rows(one, _nearest(one, spreads), machines, target)]
    table = _ranked(pd.DataFrame(rows), sure)
    table["why"] = _reasons(table, target, sure)
    table.attrs |= {"target": target, "sure": sure}
    return table


def _several(value: Any) -> tuple[Any, ...]:
    """One value, or several."""
    return (value,) if isinstance(value, str) or _is_number(value) else tuple(value)


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _target(
    thrust_N: float | None, cells: int | None, mass_kg: float | None, rotors: int, airspeed_m_s: float,
    max_tip_mach: float, capacity_Ah: float | None, minutes: float | None,
) -> Target:  # fmt: skip
    faults = []
    if thrust_N is None and mass_kg is None:
        faults.append(Fault("", "--thrust", "nothing", "a thrust [N] or a mass [kg]", "As in --thrust 27 --cells 6"))
    if cells is None:
        faults.append(Fault("", "--cells", "nothing", "cells in series", "As in --thrust 27 --cells 6"))
    if minutes is not None and capacity_Ah is None:
        faults.append(Fault("", "--capacity", "nothing", "the battery's capacity [A h], for the time"))
    named = {"--thrust": thrust_N, "--mass": mass_kg, "--cells": cells, "--rotors": rotors, "--airspeed": airspeed_m_s,
             "--max-tip-mach": max_tip_mach, "--capacity": capacity_Ah, "--hover-time": minutes}  # fmt: skip
    faults += [Fault("", k, repr(v), "a number") for k, v in named.items() if not (v is None or _is_number(v))]
    if faults:
        raise InputError(faults)
    faults += [Fault("", k, f"{v:g}", "a whole number") for k, v in (("--cells", cells), ("--rotors", rotors))
               if v is not None and v % 1 != 0]  # fmt: skip
    mAh = "In mAh? Divide by 1000" if capacity_Ah is not None and capacity_Ah > 200.0 else ""
    grams = "In grams? Divide by 1000" if mass_kg is not None and mass_kg > 1000.0 else ""
    fast = "km/h? Divide by 3.6" if airspeed_m_s > 150.0 else ""
    for name, value, low, high, hint in (
        ("--thrust", thrust_N, 0.01, 5000.0, ""), ("--mass", mass_kg, 0.005, 1000.0, grams),
        ("--cells", cells, 1, 60, ""), ("--rotors", rotors, 1, 64, ""), ("--airspeed", airspeed_m_s, 0.0, 150.0, fast),
        ("--max-tip-mach", max_tip_mach, 0.05, 0.95, "Section theory ends below Mach 1"),
        ("--capacity", capacity_Ah, 0.01, 1000.0, mAh), ("--hover-time", minutes, 0.01, 1e4, ""),
    ):  # fmt: skip
        if value is not None and not low <= value <= high:
            faults.append(Fault("", name, f"{value:g}", f"a number from {low:g} to {high:g}", hint))
    if faults:
        raise InputError(faults)
    hover = None if mass_kg is None else mass_kg * G0 / rotors
    most = 2.0 * float(hover or 0.0) if thrust_N is None else thrust_N
    if hover is not None and most < hover:
        hint = f"Each of {rotors} carries {hover:.2f} N in hover"
        raise InputError(Fault("", "--thrust", f"{most:g}", f"{hover:.4g} N or more", hint))
    return Target(most, int(cells or 1), hover, airspeed_m_s, max_tip_mach, rotors, capacity_Ah, minutes)


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
    if faults:
        raise InputError(faults)


def _standard(target: Target, max_in: float | None, blades: Sequence[int]) -> tuple[str, ...]:
    """Standard sizes whose disk loading at the target can be expected to work."""
    out = []
    for D in DIAMETERS:
        loading = target.thrust_N / (0.25 * math.pi * (D * INCH) ** 2)
        if (max_in is not None and D > max_in) or not LOADING[0] <= loading <= LOADING[1]:
            continue
        pitches = dict.fromkeys(round(2.0 * D * ratio) / 2.0 for ratio in RATIOS)
        out += [f"{D}x{P:g}" + (f"x{B}" if B != 2 else "") for P in pitches for B in blades]
    if not out:
        sizes = [D for D in DIAMETERS if max_in is None or max_in >= D] or list(DIAMETERS[:1])
        least, most = (
            x * 0.25 * math.pi * (D * INCH) ** 2 for x, D in zip(LOADING, (sizes[0], sizes[-1]), strict=True)
        )
        got = f"{target.thrust_N:g} N" + ("" if max_in is None else f" within {max_in:g} in")
        expected = f"{least:.2g} to {most:.3g} N, the load of standard sizes from {sizes[0]} to {sizes[-1]} in"
        raise InputError(Fault("", "--thrust", got, expected, "Other sizes: name them with --labels"))
    return tuple(out)


def _loads(label: str, target: Target, machines: Sequence[KnownMotor]) -> RotorLoads | None:
    D = rotor_loads.size_in(label) * INCH
    sonic = 0.97 * 340.0 * 60.0 / (math.pi * D)
    fastest = 1.05 * max(m.kv for m in machines) * target.voc
    return rotor_loads.rotor_loads(label, min(sonic, fastest), target.airspeed_m_s)


def _scatters(loads: Sequence[RotorLoads], target: Target) -> list[LoadScatter]:
    """Bands of a few labels spread over the sizes that reach the target."""
    good = [one for one in loads if np.isfinite(one.speed_for(np.array([target.thrust_N]))[0])] or list(loads)
    order = sorted(good, key=lambda one: (one.diameter_m, one.pitch_m))
    picked = {round(i) for i in np.linspace(0, len(order) - 1, min(SCATTERS, len(order)))}
    out = []
    for i in sorted(picked):
        rpm = float(order[i].speed_for(np.array([target.thrust_N]))[0])
        found = rotor_loads.scatter(order[i].label, rpm if math.isfinite(rpm) else float(order[i].rpm[-1]),
                                    target.airspeed_m_s)  # fmt: skip
        if np.isfinite([found.u_thrust, found.u_torque]).all():
            out.append(found)
    if not out:
        raise InputError(Fault("", "--labels", "no band converges", "sizes that the solver can judge at this thrust"))
    return out


def _nearest(one: RotorLoads, spreads: Sequence[LoadScatter]) -> LoadScatter:
    x, p = math.log(one.diameter_m / INCH), one.pitch_m / one.diameter_m
    return min(spreads, key=lambda s: math.hypot(s.log_diameter - x, s.pitch_ratio - p))


@cache
def _draws() -> tuple[Array, Array]:
    """Standard normal (2, DRAWS + 1) for the rotor and quantiles (4, DRAWS + 1) of the shares; the first is nominal."""
    from scipy.special import ndtri

    steps = np.array([pow(LATTICE, j, DRAWS) for j in range(6)])
    u = (np.outer(steps, np.arange(DRAWS)) + 0.5) / DRAWS % 1.0
    z = ndtri(u[:2])
    return np.c_[np.zeros(2), z], np.c_[np.full(4, 0.5), u[2:]]


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


def _driven(amps: Array) -> Array:
    """NaN where the air turns the rotor at full throttle: it says nothing about the motor's size."""
    return np.where(amps > 0.0, amps, math.nan)


def _chain(loads: RotorLoads, machines: Sequence[KnownMotor], target: Target) -> _Chain:
    share = {
        name: np.interp(u, [0.0, 0.5, 1.0], [item.low, item.value, item.high])
        for (name, item), u in zip(SHARES.items(), _draws()[1], strict=True)
    }
    sag, idle, lost = share["sag"], share["idle_share"], share["drop"]
    kv, ohm, no_load = (np.array([[getattr(m, f)] for m in machines]) for f in ("kv", "resistance_ohm", "no_load_A"))
    k, loaded = 30.0 / (math.pi * kv), (1.0 - sag) * target.voc
    usual = usual_resistance(kv, loaded) * np.exp(share["size"])  # with controller and leads
    lost, ohm = np.where(np.isnan(ohm), 0.0, lost), np.where(np.isnan(ohm), usual, ohm)
    full = np.minimum((0.9 - lost) * loaded / k * 30.0 / math.pi, loads.rpm[-1])
    amps = loads.torque_at(full) / k / (1.0 - idle)
    for _ in range(80):
        new = np.maximum(((1.0 - lost) * loaded - ohm * amps) / k * 30.0 / math.pi, 1.0)
        full = 0.7 * full + 0.3 * np.minimum(new, loads.rpm[-1])
        amps = loads.torque_at(full) / k / (1.0 - idle)
    winding = lost * loaded / _driven(amps) + ohm
    amps = _driven(amps)
    rest = np.where(np.isnan(no_load), idle * amps, no_load)
    return _Chain(k, winding, rest, sag * target.voc / amps, target.voc)


def _rows(loads: RotorLoads, u: LoadScatter, machines: Sequence[KnownMotor], target: Target) -> list[dict[str, Any]]:
    z = _draws()[0]
    thrust = np.exp(u.u_thrust * z[0])
    torque = np.exp(u.u_torque * (u.correlation * z[0] + math.sqrt(1.0 - u.correlation**2) * z[1]))
    chain = _chain(loads, machines, target)
    n_full, n_at = (loads.speed_for(T / thrust) for T in (target.thrust_N, target.at_N))
    duty, peak, _ = chain.at(n_full, torque * loads.torque_at(n_full))
    _, amps, power = chain.at(n_at, torque * loads.torque_at(n_at))
    mach = np.broadcast_to(loads.tip_mach(n_full, target.airspeed_m_s), duty.shape)
    met = np.isfinite(duty) & (mach <= target.max_tip_mach)
    minutes = 60.0 * (1.0 - SOC_END) * (target.capacity_Ah or 1.0) / target.rotors / amps
    if target.minutes is not None:
        met &= minutes >= target.minutes
    chance = met[:, 1:].mean(axis=1)
    own = _Chain(chain.k, chain.ohm[:, :1], chain.idle_A[:, :1], chain.battery_ohm[:, :1], chain.voc)
    reach = np.isfinite(own.at(loads.rpm[None, :], loads.torque_Nm[None, :])[0])
    last = loads.rpm.size - 1 - np.argmax(reach[:, ::-1], axis=1)
    most = np.where(reach.any(axis=1), loads.thrust_N[last], 0.0)
    scatter = [float(np.std(p[np.isfinite(p)])) if np.isfinite(p).sum() > 9 else math.nan for p in power[:, 1:]]
    return [
        {"label": loads.label, "motor": m.name, "kv": m.kv, "probability": float(chance[i]),
         "power_W": float(power[i, 0]), "u_power_W": scatter[i], "current_A": float(amps[i, 0]),
         "peak_A": float(peak[i, 0]), "g_per_W": 1e3 * target.at_N / G0 / float(power[i, 0]),
         "minutes": float(minutes[i, 0]), "rpm": float(n_at[0]), "tip_mach": float(mach[i, 0]),
         "full_thrust_N": float(most[i])}
        for i, m in enumerate(machines)
    ]  # fmt: skip


def _ranked(table: pd.DataFrame, sure: float) -> pd.DataFrame:
    lost = table.power_W.isna() | (table.probability < sure)
    power = table.power_W.where(~lost, math.inf)
    order = np.lexsort((-table.full_thrust_N, power, np.where(lost, -table.probability, 0.0), lost))
    return table.iloc[order].reset_index(drop=True)


def _reasons(table: pd.DataFrame, target: Target, sure: float) -> list[str]:
    """Why each pair is not the first."""
    best = table.iloc[0]
    out = []
    for i, row in enumerate(table.itertuples()):
        words = []
        if row.full_thrust_N < target.thrust_N:
            words.append(f"full throttle gives {row.full_thrust_N:.3g} N")
        if row.tip_mach > target.max_tip_mach:
            words.append(f"tip Mach {row.tip_mach:.2f}")
        if target.minutes is not None and row.minutes < target.minutes:
            words.append(f"{row.minutes:.1f} min")
        if not words and row.probability < sure:
            words.append(f"{row.full_thrust_N / target.thrust_N - 1.0:.0%} thrust in hand: too little for the bands")
        if not words and i:
            words.append(f"{row.power_W / best.power_W - 1.0:+.1%} power")
        out.append(", ".join(words))
    return out
