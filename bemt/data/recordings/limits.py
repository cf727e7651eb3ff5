"""Signs, and quantities beyond their physical bounds, row by row."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.tables import number_of
from bemt.data.recordings.channels import shaft_power
from bemt.data.recordings.findings import (
    LEAST_EFFICIENCY,
    Facts,
    Finding,
    check_for,
    contradicts,
    enough,
    rows_of,
    where_of,
    zero_thrust_speed,
)
from bemt.physics import coefficients as co


@check_for("signs")
def flipped(facts: Facts) -> Iterator[Finding]:
    """A whole channel, or some of its rows, with the other sign."""
    for name, v in facts.known("thrust_N", "torque_Nm", "power_W", "voltage_V", "current_A", "rpm"):
        if facts.bare and name in ("thrust_N", "torque_Nm", "power_W"):
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
            fix = f"multiply by -1 (--sign {name.rsplit('_', 1)[0]}=-1)"
            more = "; or the rotor turns the other way" if name == "torque_Nm" else ""
            yield Finding("sign_flipped", facts.named(name), text, fix + more, (), habit)
            continue
        if name in ("thrust_N", "torque_Nm", "power_W") and _wind(facts) is not None:
            continue
        odd = _mirrored(facts, name, v, loaded, -1.0 if share > 0.5 else 1.0)
        if np.any(odd):
            rows = np.flatnonzero(odd)
            where = f"{number_of(len(rows), 'row')} ({where_of(facts, rows)})"
            text = f"the sign changes in {where} whose magnitude fits the others"
            yield Finding("sign_flipped", facts.named(name), text, "multiply those rows by -1", rows_of(odd), "error")


def _wind(facts: Facts) -> float | None:
    """Speed of no thrust, as in a wind that is not recorded [rev/min]; None: no such wind."""
    rpm, thrust = facts.rpm, facts.thrust_N
    if rpm is None or thrust is None:
        return None
    return zero_thrust_speed(rpm[facts.still], thrust[facts.still])


def _mirrored(facts: Facts, name: str, v: Array, loaded: NDArray[np.bool_], sign: float) -> NDArray[np.bool_]:
    """Rows of the other sign whose magnitude is what the speed of the row needs."""
    rpm = facts.rpm
    scaled = np.abs(v)
    if rpm is not None and name in ("thrust_N", "torque_Nm", "power_W"):
        scaled = scaled / np.abs(rpm) ** (3.0 if name == "power_W" else 2.0)
    usual = scaled[loaded & (v * sign > 0.0) & np.isfinite(scaled)]
    if usual.size < 3:
        return np.zeros(len(v), dtype=bool)
    alike = np.abs(np.log(scaled / np.median(usual))) < math.log(2.0)
    return np.asarray(loaded & (v * sign < 0.0) & alike)


@check_for("negative_thrust")
def negative_thrust(facts: Facts) -> Iterator[Finding]:
    """Thrust below zero at rest of the air, in rows of a channel that is positive elsewhere."""
    v = facts.thrust_N
    if v is None or facts.bare:
        return
    top = float(np.nanpercentile(v, 95))
    if top <= 0.0 or np.mean(np.nan_to_num(v) < 0.0) > 0.5:
        return
    rpm, zero = facts.rpm, _wind(facts)
    if zero is not None:
        text = f"thrust grows with the speed and changes its sign at {zero:.0f} rev/min: a propeller in wind does that"
        fix = "state the airspeed: --airspeed-m-s V in diagnose, --air-a V or --air-b V in compare"
        yield Finding("negative_thrust", facts.named("thrust_N"), text, fix, (), "warning")
        return
    turning = np.ones(len(v), dtype=bool) if rpm is None else np.nan_to_num(rpm) > 0.3 * np.nanpercentile(rpm, 95)
    odd = (v < -0.03 * top) & turning & facts.still
    if enough(odd, turning):
        rows = np.flatnonzero(odd)
        where = f"{where_of(facts, rows)}; lowest {np.nanmin(v[odd]):.4g} N, largest thrust {top:.4g} N"
        fix = "a propeller in still air pushes one way: zero of the load cell, sign, or a misreading; leave them out"
        turns = "while the rotor turns" if rpm is not None else "beside positive ones"
        text = f"negative thrust {turns} in {number_of(len(rows), 'row')} ({where})"
        yield Finding("negative_thrust", facts.named("thrust_N"), text, fix, rows_of(odd), "warning")


@check_for("power_above_input")
def power_above_input(facts: Facts) -> Iterator[Finding]:
    """More power at the shaft than goes into the motor."""
    electric = facts.filled.get("electrical_power_W")
    if electric is None:
        return
    shaft, words = shaft_power(facts.filled), "torque x speed"
    if shaft is None or not np.any(np.isfinite(shaft[facts.loaded])):
        shaft, words = facts.power_W, facts.named("power_W")
    if shaft is None:
        return
    ratio = np.abs(shaft) / electric
    odd = facts.loaded & (ratio > 1.02) & np.isfinite(ratio)
    if enough(odd, facts.loaded):
        rows, severity = np.flatnonzero(odd), contradicts(odd, facts.loaded)
        among = f"{len(rows)} of {int(facts.loaded.sum())} rows under load ({where_of(facts, rows)})"
        text = f"{words} exceeds the electrical power in {among}, {np.max(ratio[odd]):.4g} times at most"
        if severity == "error" and facts.get("current_A") is not None and _no_motor(facts, shaft, electric):
            text = f"{text}; no constant factor of torque or speed makes a motor of that: the current is what misleads"
            fix = "leave the current out: thrust, torque and speed do not need it"
            yield Finding("power_above_input", facts.named("current_A"), text, fix, rows_of(odd), severity)
            return
        fix = "unit or gain of the torque, electrical revolutions taken for mechanical, or unit of voltage or current"
        lightest = facts.loaded & ~odd
        if np.any(lightest) and float(np.median(electric[odd])) < float(np.median(electric[lightest])):
            fix = f"at part throttle only: a sensor that reads chopped current low; or {fix}"
        yield Finding("power_above_input", words, text, fix, rows_of(odd), severity)


# Root mean square that the law of a motor leaves of its power, above which it is none: 80 sound series of shared stands
# leave 0.03 and less, noisy ones 0.047; and the fewest rows that tell, two more than the law has terms [1].
_UNLIKE_MOTOR, _FEWEST_OF_MOTOR = 0.05, 7


def _no_motor(facts: Facts, shaft: Array, electric: Array) -> bool:
    """Whether the power of a steady load is no motor's under any constant factor of its readings.

    A motor takes k P + c0 + c1 n + c2 n^2 + c3 Q^2 (shaft, controller, friction, iron, copper; none negative), whatever
    the gains, in which k and c are free, while the shaft's own power goes with the speed as a propeller's does.
    """
    from scipy.optimize import nnls

    n, Q = facts.rpm, facts.filled.get("torque_Nm")
    if n is None or Q is None:
        return False
    P = np.abs(shaft)
    good = facts.loaded & facts.still & np.isfinite(P * n * Q) & (P > 0.0) & (electric > 0.0)
    if np.count_nonzero(good) < _FEWEST_OF_MOTOR:
        return False
    P, E, n, Q = P[good], electric[good], n[good], Q[good]
    terms = np.stack([P, np.ones_like(P), n, n**2, Q**2], axis=1) / E[:, None]
    left = float(nnls(terms / np.max(terms, axis=0), np.ones_like(E))[1]) / math.sqrt(E.size)
    propeller = float(np.std(np.log(P / n**3))) < 0.5 * float(np.std(np.log(P / E)))
    return left > _UNLIKE_MOTOR and propeller


USUAL_MERIT = 0.5
"""Static figure of merit of a propeller, which tells the power of its shaft without a torque cell: declared [1]."""


@check_for("power_lost")
def power_lost(facts: Facts) -> Iterator[Finding]:
    """Far more power into the motor than its shaft takes; without a torque, than a usual rotor of that thrust takes."""
    electric, rows, words = facts.filled.get("electrical_power_W"), facts.loaded, "the shaft takes"
    shaft = shaft_power(facts.filled)
    if electric is None or facts.bare:
        return
    if shaft is None or not np.any(np.isfinite(shaft[rows])):
        T, rpm, D = facts.filled.get("thrust_N"), facts.rpm, facts.diameter_m
        if T is None or (D is None and rpm is None) or facts.ducted:
            return
        disk = D if D is not None else (np.abs(T) / (0.1 * facts.rho * (np.asarray(rpm) / 60.0) ** 2)) ** 0.25
        shaft = np.abs(T) ** 1.5 / np.sqrt(0.5 * math.pi * facts.rho) / disk / USUAL_MERIT
        rows, words = facts.loaded & facts.still & (T > 0.0), "by its thrust the shaft takes about"
    ratio = (np.abs(shaft) / electric)[rows]
    ratio = ratio[np.isfinite(ratio)]
    if ratio.size < 3 or not 0.0 < float(np.median(ratio)) < LEAST_EFFICIENCY:
        return
    text = f"{words} {np.median(ratio):.0%} of it ({np.min(ratio):.0%} to {np.max(ratio):.0%} under load); "
    text += f"a motor turns {LEAST_EFFICIENCY:.1%} or more into power of the shaft"
    fix = "check unit, gain and zero of the current and of the voltage; or several motors are on that supply"
    yield Finding("power_lost", facts.named("electrical_power_W"), text, fix, (), "warning")


_LEAST_MERIT = 0.12  # Figure of merit of the poorest rotor: small ones in published tables reach 0.3 (declared) [1]


@check_for("merit")
def merit_above_one(facts: Facts) -> Iterator[Finding]:
    """A rotor in still air that needs less power than the ideal one (Froude; with a duct, an ideal one of 1.3 area).

    Or, where coefficients are given, many times as much: 10 K_Q is a usual column.
    """
    limit, words = (math.sqrt(2.0 * 1.3), "a ducted one") if facts.ducted else (1.0, "an open one")
    ct, cp, cq = facts.CT, facts.CP, facts.get("CQ")
    cp = 2.0 * math.pi * cq if cp is None and cq is not None else cp
    T, D = facts.filled.get("thrust_N"), facts.diameter_m
    shaft = shaft_power(facts.filled)
    if shaft is None:
        shaft = facts.power_W
    if T is not None and D is not None and D > 0.0 and shaft is not None:
        P = np.abs(shaft)
        area = math.pi / 4.0 * D * D
        fm = np.where((T > 0) & (P > 0), T**1.5 / (P * np.sqrt(2.0 * facts.rho * area)), np.nan)
    elif ct is not None and cp is not None and (facts.J is not None or facts.airspeed_m_s is not None):
        fm = np.where((ct > 0) & (cp > 0), np.asarray(co.FM(ct, cp), dtype=float), np.nan)
        low = facts.loaded & facts.still & (fm < _LEAST_MERIT)
        if enough(low, facts.loaded & facts.still):
            text = f"figure of merit {np.max(fm[low]):.2g} at most; of a real rotor, {_LEAST_MERIT:g} and more"
            fix = "10 K_Q taken for K_Q: multiply by 0.1; or the other convention of coefficients"
            named = facts.named("CP" if cq is None else "CQ")
            yield Finding("coefficient_tenfold", named, text, fix, rows_of(low), "warning")
    else:
        return
    odd = facts.loaded & facts.still & (fm > limit * 1.02)
    if enough(odd, facts.loaded):
        rows = np.flatnonzero(odd)
        text = f"figure of merit {np.max(fm[odd]):.4g} at most in {number_of(len(rows), 'row')} "
        text += f"({where_of(facts, rows)}); {words} stays below {limit:.3g}"
        fix = "unit or gain of thrust or torque, diameter, or a zero that was not subtracted"
        named, severity = facts.named("thrust_N" if T is not None else "CT"), contradicts(odd, facts.loaded)
        yield Finding("fm_above_1", named, text, fix, rows_of(odd), severity)


@check_for("tip_mach")
def tip_mach(facts: Facts) -> Iterator[Finding]:
    """Tip speed above Mach 1.1."""
    rpm, D = facts.rpm, facts.diameter_m
    if rpm is None or D is None:
        return
    mach = math.pi * D * np.abs(np.nan_to_num(rpm)) / 60.0 / 343.0
    odd = mach > 1.1
    if np.mean(odd) > 0.05:
        text = f"tip Mach number {np.max(mach):.3g} in {number_of(odd.sum(), 'row')} with the diameter of {D:g} m"
        fix = "electrical revolutions taken for mechanical (divide by the pole pairs), or the unit of the diameter"
        yield Finding("tip_mach", facts.named("rpm"), text, fix, rows_of(odd), "error")
