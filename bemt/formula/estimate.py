"""Thrust and power of a propeller by the compact formula, with bands and flags: :func:`estimate`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt import coefficients as co
from bemt.air import Air
from bemt.base.errors import Fault, InputError
from bemt.base.units import INCH, KGF
from bemt.formula.compact import (
    BAND_X,
    BANDS,
    DIAMETER_RANGE,
    M_TIP_DATA,
    M_TIP_LIMIT,
    P_OVER_D_RANGE,
    RE_RANGE,
    X_LIMIT,
    MakerSeries,
    default_chord,
    effective_pitch,
    find_series,
    series_coefficients,
)

Array = NDArray[np.float64]
UNITS = {"mm": 1e-3, "in": INCH, "cm": 1e-2, "m": 1.0}
"""Units in which a length may have been meant. [m]"""
POSSIBLE = {"pitch": (0.1, 2.5), "chord": (0.02, 0.4)}
"""Over the diameter; outside, a propeller is no propeller, mostly one unit has been taken for another. [1]"""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Outcome of the compact formula over N points."""

    # (N,) thrust [N], shaft power [W]
    thrust_N: Array
    power_W: Array
    # (N,) rotational speed [rev/min], airspeed [m/s]
    rpm: Array
    airspeed_m_s: Array
    # (N,) propeller convention, advance ratio, rotational tip Mach number, Reynolds number at 0.75 R [-]
    CT: Array
    CP: Array
    J: Array
    M_tip: Array
    Re: Array
    # (N,) half-widths that held 68 % of the points of makers left out of the fit; NaN (unknown) for ducted rotors, near
    # the speed of sound and beyond zero thrust. At flagged points too narrow: on volume 2 they hold about half [N], [W]
    u_thrust_N: Array
    u_power_W: Array
    # (N,) the same for 95 % [N], [W]
    u95_thrust_N: Array
    u95_power_W: Array
    flags: tuple[tuple[str, ...], ...]  # Per point, why not to trust it; empty when inside the data

    @property
    def thrust_kgf(self) -> Array:
        """Thrust. [kgf]"""
        return self.thrust_N / KGF


def validity_flags(
    diameter_m: float,
    P_D: float,
    blades: float,
    Re: float,
    M_tip: float,
    x: float,
    chord_known: bool = True,
    ducted: bool = False,
) -> tuple[str, ...]:
    """Say where a point leaves the data of the calibration.

    >>> validity_flags(0.254, 0.5, 2, 5e4, 0.2, 0.3)
    ()
    >>> validity_flags(0.3556, 0.57, 2, 3e5, 1.09, 0.0)[-1]
    'tip Mach 1.09 is supersonic: extrapolated, the formula has no Mach number effects'
    """
    out = []
    low, high = DIAMETER_RANGE
    if not low * 0.999 <= diameter_m <= high * 1.001:
        hint = "" if chord_known else "; give the chord, small propellers are wider than the default"
        out.append(f"diameter {diameter_m / INCH:.3g} in outside the data (7-19 in){hint}")
    low, high = P_OVER_D_RANGE
    if not low <= P_D <= high:
        out.append(f"P/D {P_D:.2f} outside the data ({low:g}-{high:g})")
    if blades != 2:
        out.append(f"{blades:g} blades: every propeller of the calibration has 2")
    if np.isfinite(Re) and not RE_RANGE[0] <= Re <= RE_RANGE[1]:
        out.append(f"Reynolds number {Re:.2g} outside the data ({RE_RANGE[0]:.2g}-{RE_RANGE[1]:.2g})")
    if M_tip >= 1.0:
        out.append(f"tip Mach {M_tip:.2f} is supersonic: extrapolated, the formula has no Mach number effects")
    elif M_tip > M_TIP_LIMIT:
        out.append(f"tip Mach {M_tip:.2f} above {M_TIP_LIMIT:g}: extrapolated, the formula has no Mach number effects")
    elif M_tip > M_TIP_DATA:
        out.append(f"tip Mach {M_tip:.2f} beyond the data ({M_TIP_DATA:g})")
    if ducted:
        out.append("ducted: a fit to open propellers (no duct, cascade or stator)")
    if x < 0.0:
        out.append("airspeed from behind: outside the model")
    elif x > X_LIMIT:
        out.append(f"J/(P/D) {x:.2f}: beyond zero thrust, outside the data")
    return tuple(out)


def length_faults(
    where: tuple[str, str], value: float, unit: str, diameter_m: float, limits: tuple[float, float]
) -> list[Fault]:
    """Say whether a length fits the diameter, and in which unit it would.

    >>> print(*length_faults(("--measured-pitch-in", ""), 127.0, "in", 8 * 0.0254, POSSIBLE["pitch"]))
    --measured-pitch-in: got 127; expected 0.1 to 2.5 diameters, 0.8 to 20 in. 127 mm would be 0.62 diameters.
    """
    file, key = where
    if not diameter_m > 0.0:
        fine = 0.0 < value * UNITS[unit] < 100.0
        return [] if fine else [Fault(file, key, f"{value:g}", "a positive length")]
    low, high = limits[0] * (1.0 - 1e-9), limits[1] * (1.0 + 1e-9)  # 2.5 times a diameter in inches is inside
    if low <= value * UNITS[unit] / diameter_m <= high:
        return []
    ends = " to ".join(f"{limit * diameter_m / UNITS[unit]:.3g}" for limit in limits)
    meant = {name: value * size / diameter_m for name, size in UNITS.items()}
    fits = (f"{value:g} {name} would be {ratio:.2g} diameters" for name, ratio in meant.items() if low <= ratio <= high)
    expected = f"{limits[0]:g} to {limits[1]:g} diameters, {ends} {unit}"
    return [Fault(file, key, f"{value:g}", expected, next(fits, ""))]


def _check(
    D: Array, pitch: Array, B: Array, rpm: Array, V: Array, chord: Array | None, measured: Array | None
) -> list[Fault]:
    """All that is wrong with the numbers; what was not given needs no look."""
    hint = "Inches or millimetres given?"
    tests = (
        ("diameter_m", D, (D > 0) & (D < 100), "a positive length", hint),
        ("blades", B, (B >= 1) & (B <= 20) & (B == np.floor(B)), "a whole number from 1 to 20", ""),
        ("rpm", rpm, (rpm >= 0) & np.isfinite(rpm), "0 rev/min or more, finite", "The model has no sense of rotation"),
        ("airspeed_m_s", V, np.isfinite(V), "a finite speed", ""),
    )
    faults = [
        Fault("", name, f"{float(x[~ok].ravel()[0]):g}", expected, hint)
        for name, x, ok, expected, hint in tests
        if not np.all(ok)
    ]
    for name, values in (("pitch_m", pitch), ("chord_m", chord), ("measured_pitch_m", measured)):
        if values is not None:
            limits = POSSIBLE["chord" if name == "chord_m" else "pitch"]
            with np.errstate(all="ignore"):
                odd = np.flatnonzero(~((values >= limits[0] * D) & (values <= limits[1] * D)))
            found = (length_faults(("", name), float(values[i]), "m", float(D[i]), limits) for i in odd)
            faults += next((fault for fault in found if fault), [])
    return faults


def estimate(
    diameter_m: ArrayLike, pitch_m: ArrayLike, blades: ArrayLike, rpm: ArrayLike, airspeed_m_s: ArrayLike = 0.0,
    air: Air | None = None, chord_m: ArrayLike | None = None, measured_pitch_m: ArrayLike | None = None,
    series: str | None = None, ducted: bool = False,
) -> Estimate:  # fmt: skip
    """Thrust and power with their bands and flags.

    >>> e = estimate(10 * 0.0254, 5 * 0.0254, 2, 6000.0)
    >>> e.thrust_N.round(1), e.u_thrust_N.round(1), e.power_W.round(0), e.flags
    (array([5.2]), array([0.7]), array([51.]), ((),))
    """
    air = Air.from_density() if air is None else air
    known = chord_m is not None
    own = MakerSeries()
    faults: list[Fault] = []
    try:
        own = own if series is None else find_series(series)
    except InputError as error:
        faults += error.faults
    chord = own.chord * np.asarray(default_chord(diameter_m)) if chord_m is None else chord_m
    measured = pitch_m if measured_pitch_m is None else measured_pitch_m
    names = (diameter_m, pitch_m, blades, rpm, airspeed_m_s, chord, measured, air.rho, air.mu, air.a_sound)
    arrays = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in names))
    D, p, B, w, V, c, q, rho, mu, a = (np.ravel(x) for x in arrays)
    faults += _check(D, p, B, w, V, c if known else None, None if measured_pitch_m is None else q)
    if faults:
        raise InputError(faults)
    n = w / 60.0
    J = np.asarray(co.J(V, n, D))
    Re = np.asarray(co.Re75(c, n, D, V, rho, mu))
    M = np.asarray(co.M_tip(n, D, a))
    pd, s = p / D, 2.0 * B * c / (np.pi * D)
    turning = np.where(n > 0, Re, np.nan)  # without rotation there is no coefficient
    effective = effective_pitch(p, q) / D
    CT, CP = series_coefficients(effective, J, s, turning, own.zero_lift)
    CT0, CP0 = series_coefficients(effective, np.zeros_like(pd), s, turning, own.zero_lift)
    still = (n == 0) & (V == 0)
    T = np.where(still, 0.0, co.thrust(CT, rho, n, D))
    P = np.where(still, 0.0, co.power(CP, rho, n, D))
    # without rotation J is NaN: the sign of V decides then
    x = np.where(np.isnan(J), np.copysign(np.where(V == 0, 0.0, np.inf), V), J / pd)
    rows = zip(D, pd, B, Re, M, x, strict=True)
    flags = tuple(validity_flags(d, ratio, b, re, m, at, known, ducted) for d, ratio, b, re, m, at in rows)
    unknown = ducted | (M > M_TIP_LIMIT) | (x < 0.0) | (x > X_LIMIT)
    band = BANDS["label" if not known else "chord" if measured_pitch_m is None else "pitch"]

    def width(key: str, scale: Array) -> Array:
        return np.where(unknown, np.nan, np.interp(x, BAND_X, band[key]) * scale)

    T0, P0 = np.asarray(co.thrust(CT0, rho, n, D)), np.asarray(co.power(CP0, rho, n, D))
    return Estimate(
        T, P, w, V, CT, CP, J, M, Re, width("CT68", T0), width("CP68", P0), width("CT95", T0), width("CP95", P0), flags
    )
