"""Signs, and quantities beyond their physical bounds, row by row."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.tables import number_of
from bemt.data.recordings.channels import shaft_power
from bemt.data.recordings.findings import MANY, Facts, Finding, check_for
from bemt.data.recordings.windmilling import zero_thrust_speed
from bemt.physics import coefficients as co


def _where(facts: Facts, rows: Array | NDArray[np.intp]) -> str:
    lines = [str(facts.lines[int(r)]) for r in rows[:6]]
    more = f" and {len(rows) - 6} more" if len(rows) > 6 else ""
    return f"line{'s' if len(rows) > 1 else ''} {', '.join(lines)}{more}"


# Rows from which a recording is a log, and share of those under load that are misread in one.
_LOG, _FEW = 100, 0.2


def _enough(odd: NDArray[np.bool_], among: NDArray[np.bool_]) -> bool:
    """Whether rows are more than the transients and spikes of a log: one in a table, 1 % of many."""
    return bool(np.any(odd)) and float(odd.sum()) > 0.01 * (float(among.sum()) if len(odd) >= MANY else 0.0)


def _contradicts(odd: NDArray[np.bool_], among: NDArray[np.bool_]) -> str:
    """Severity of what cannot be so: a few rows of a log are misread, a table or much of a log contradicts itself."""
    few = len(odd) >= _LOG and float(odd.sum()) < _FEW * float(among.sum())
    return "warning" if few else "error"


def _rows(mask: NDArray[np.bool_]) -> tuple[int, ...]:
    return tuple(int(i) for i in np.flatnonzero(mask))


@check_for("signs")
def flipped(facts: Facts) -> Iterator[Finding]:
    """A whole channel, or some of its rows, with the other sign."""
    for name in ("thrust_N", "torque_Nm", "power_W", "voltage_V", "current_A", "rpm"):
        v = facts.get(name)
        if v is None or (facts.bare and name in ("thrust_N", "torque_Nm", "power_W")):
            continue
        size = np.abs(np.nan_to_num(v))
        top = float(np.percentile(size, 95))
        loaded = (size >= 0.2 * top) & (facts.still | (name in ("voltage_V", "current_A", "rpm")))
        if top <= 0.0 or not np.any(loaded):
            continue
        share = float(np.mean(v[loaded] < 0.0))
        if share > 0.9:
            text = f"negative in {share:.0%} of the rows under load, down to {np.nanmin(v):.4g}"
            habit = "note" if name == "torque_Nm" else "warning"  # either hand of rotation is usual
            fix = "multiply by -1 (sign = -1 in a recording.toml)"
            more = "; or the rotor turns the other way" if name == "torque_Nm" else ""
            yield Finding("sign_flipped", facts.named(name), text, fix + more, (), habit)
            continue
        if name in ("thrust_N", "torque_Nm", "power_W") and _wind(facts) is not None:
            continue
        odd = _mirrored(facts, name, v, loaded, -1.0 if share > 0.5 else 1.0)
        if np.any(odd):
            rows = np.flatnonzero(odd)
            where = f"{number_of(len(rows), 'row')} ({_where(facts, rows)})"
            text = f"the sign changes in {where} whose magnitude fits the others"
            yield Finding("sign_flipped", facts.named(name), text, "multiply those rows by -1", _rows(odd), "error")


def _wind(facts: Facts) -> float | None:
    """Speed of no thrust, as in a wind that is not recorded [rev/min]; None: no such wind."""
    rpm, thrust = facts.get("rpm"), facts.get("thrust_N")
    if rpm is None or thrust is None:
        return None
    return zero_thrust_speed(rpm[facts.still], thrust[facts.still])


def _mirrored(facts: Facts, name: str, v: Array, loaded: NDArray[np.bool_], sign: float) -> NDArray[np.bool_]:
    """Rows of the other sign whose magnitude is what the speed of the row needs."""
    rpm = facts.get("rpm")
    scaled = np.abs(v)
    if rpm is not None and name in ("thrust_N", "torque_Nm", "power_W"):
        with np.errstate(all="ignore"):
            scaled = scaled / np.abs(rpm) ** (3.0 if name == "power_W" else 2.0)
    usual = scaled[loaded & (v * sign > 0.0) & np.isfinite(scaled)]
    if usual.size < 3:
        return np.zeros(len(v), dtype=bool)
    with np.errstate(all="ignore"):
        alike = np.abs(np.log(scaled / np.median(usual))) < math.log(2.0)
    return np.asarray(loaded & (v * sign < 0.0) & alike)


@check_for("negative_thrust")
def negative_thrust(facts: Facts) -> Iterator[Finding]:
    """Thrust below zero at rest of the air, in rows of a channel that is positive elsewhere."""
    v = facts.get("thrust_N")
    if v is None or facts.bare:
        return
    top = float(np.nanpercentile(v, 95))
    if top <= 0.0 or np.mean(np.nan_to_num(v) < 0.0) > 0.5:
        return
    rpm, zero = facts.get("rpm"), _wind(facts)
    if zero is not None:
        text = f"thrust grows with the speed and changes its sign at {zero:.0f} rev/min: a propeller in wind does that"
        fix = "state the airspeed: --airspeed-m-s V in diagnose, --air-a V or --air-b V in compare"
        yield Finding("negative_thrust", facts.named("thrust_N"), text, fix, (), "warning")
        return
    turning = np.ones(len(v), dtype=bool) if rpm is None else np.nan_to_num(rpm) > 0.3 * np.nanpercentile(rpm, 95)
    odd = (v < -0.03 * top) & turning & facts.still
    if _enough(odd, turning):
        rows = np.flatnonzero(odd)
        where = f"{_where(facts, rows)}; lowest {np.nanmin(v[odd]):.4g} N, largest thrust {top:.4g} N"
        fix = "a propeller in still air pushes one way: zero of the load cell, sign, or a misreading; leave them out"
        turns = "while the rotor turns" if rpm is not None else "beside positive ones"
        text = f"negative thrust {turns} in {number_of(len(rows), 'row')} ({where})"
        yield Finding("negative_thrust", facts.named("thrust_N"), text, fix, _rows(odd), "warning")


@check_for("power_above_input")
def power_above_input(facts: Facts) -> Iterator[Finding]:
    """More power at the shaft than goes into the motor."""
    electric = facts.filled.get("electrical_power_W")
    if electric is None:
        return
    shaft, words = shaft_power(facts.filled), "torque x speed"
    if shaft is None or not np.any(np.isfinite(shaft[facts.loaded])):
        shaft, words = facts.get("power_W"), facts.named("power_W")
    if shaft is None:
        return
    with np.errstate(all="ignore"):
        ratio = np.abs(shaft) / electric
    odd = facts.loaded & (ratio > 1.02) & np.isfinite(ratio)
    if _enough(odd, facts.loaded):
        rows = np.flatnonzero(odd)
        text = f"{words} exceeds the electrical power in {len(rows)} of {int(facts.loaded.sum())} rows under load "
        text += f"({_where(facts, rows)}), {np.max(ratio[odd]):.4g} times at most"
        fix = "unit or gain of the torque, electrical revolutions taken for mechanical, or unit of voltage or current"
        yield Finding("power_above_input", words, text, fix, _rows(odd), _contradicts(odd, facts.loaded))


@check_for("merit")
def merit_above_one(facts: Facts) -> Iterator[Finding]:
    """A rotor in still air that needs less power than the ideal one (Froude; with a duct, an ideal one of 1.3 area)."""
    limit, words = (math.sqrt(2.0 * 1.3), "a ducted one") if facts.ducted else (1.0, "an open one")
    ct, cp = facts.get("CT"), facts.get("CP")
    T, D = facts.filled.get("thrust_N"), facts.diameter_m
    shaft = shaft_power(facts.filled)
    if shaft is None:
        shaft = facts.get("power_W")
    with np.errstate(all="ignore"):
        if T is not None and D is not None and D > 0.0 and shaft is not None:
            P = np.abs(shaft)
            area = math.pi / 4.0 * D * D
            fm = np.where((T > 0) & (P > 0), T**1.5 / (P * np.sqrt(2.0 * facts.rho * area)), np.nan)
        elif (
            ct is not None and cp is not None and (facts.get("J") is not None or facts.get("airspeed_m_s") is not None)
        ):
            fm = np.where((ct > 0) & (cp > 0), np.asarray(co.FM(ct, cp), dtype=float), np.nan)
        else:
            return
    odd = facts.loaded & facts.still & (fm > limit * 1.02)
    if _enough(odd, facts.loaded):
        rows = np.flatnonzero(odd)
        text = (
            f"figure of merit {np.max(fm[odd]):.4g} at most in {number_of(len(rows), 'row')} ({_where(facts, rows)}); "
        )
        text += f"{words} stays below {limit:.3g}"
        fix = "unit or gain of thrust or torque, diameter, or a zero that was not subtracted"
        named, severity = facts.named("thrust_N" if T is not None else "CT"), _contradicts(odd, facts.loaded)
        yield Finding("fm_above_1", named, text, fix, _rows(odd), severity)


@check_for("tip_mach")
def tip_mach(facts: Facts) -> Iterator[Finding]:
    """Tip speed above Mach 1.1."""
    rpm, D = facts.get("rpm"), facts.diameter_m
    if rpm is None or D is None:
        return
    mach = math.pi * D * np.abs(np.nan_to_num(rpm)) / 60.0 / 343.0
    odd = mach > 1.1
    if np.mean(odd) > 0.05:
        text = f"tip Mach number {np.max(mach):.3g} in {number_of(odd.sum(), 'row')} with the diameter of {D:g} m"
        fix = "electrical revolutions taken for mechanical (divide by the pole pairs), or the unit of the diameter"
        yield Finding("tip_mach", facts.named("rpm"), text, fix, _rows(odd), "error")
