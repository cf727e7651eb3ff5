"""Constants of the rotors from a flight: momentum balance for thrust, regressions where the motion tells more.

Over a flight that begins and ends at rest, the mean upward force is the weight plus m dVz/dt:
k = m (g + dVz/dt) / mean(sum n_i^2 cos(tilt)). No accelerometer scale enters.
Bands are from ten pieces of the flight (:mod:`bemt.tools.flight.repeat`).

k is that of a hover. Air that crosses the disk takes induced velocity u v_h away, u^2 (u^2 + (V/v_h)^2) = 1 (Glauert;
Leishman, Principles of Helicopter Aerodynamics, 2nd ed., section 2.14; not checked there), and so adds c (1 - u) of the
thrust at one speed. Blade elements with momentum theory give c = q / (1 + q/2), q = solidity * lift slope / (8 inflow
ratio): 0.7 for q = 1.1, as a small propeller has it. The flight's own c, from its accelerometer, is drawn to that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, refuse
from bemt.base.units import G0
from bemt.rotors.as_measured import AsMeasured, as_measured
from bemt.rotors.model import air_fields, air_of_points
from bemt.tools.flight.layout import layout_of
from bemt.tools.flight.log import FlightLog
from bemt.tools.flight.repeat import BATCHES, flight_scatter, half_width, jackknifed, regressed

if TYPE_CHECKING:
    from bemt.rotors.case import Case

# Induced velocity of multirotors of 35 g to 3 kg in hover, 4 to 8 m/s [m/s]; c at that, and what both leave open [1]
_HOVER_M_S, _GAIN, _GAIN_U = 5.5, 0.7, 0.45
_APART = 0.1  # a rotor's own constant is given when its half width is below this share [1]


@dataclass(frozen=True)
class Constant:
    """A value with the half width of its 95 % band, in `unit`."""

    value: float
    half: float
    unit: str


@dataclass(frozen=True, eq=False)
class Identified:
    """What a flight shows."""

    constants: dict[str, Constant]  # By name, each with its unit
    # One number a rotor: mean command, mean speed [rev/min], share of the squared drive [1]
    rotors: dict[str, tuple[float, ...]]
    unseen: tuple[str, ...]  # What the log cannot show, with the manoeuvre or channel that would
    # Weight over the sum of squared speeds, for unit mass; of mean commands where there is no speed
    weight_per_drive: Constant | None


def identify(log: FlightLog, mass_kg: float | None = None) -> Identified:
    """Identify what the flight shows; without a mass with battery [kg] constants are per kilogram."""
    on = log.flying
    out: dict[str, Constant] = {}
    rotors: dict[str, tuple[float, ...]] = {}
    unseen: list[str] = []
    speeds = log.rpm is not None
    drive = log.rpm**2 if log.rpm is not None else log.command
    if drive is None:
        text = "the log holds neither commands nor speeds (RCOU of ArduPilot, actuator_motors of PX4, motor, pwm)"
        return Identified(out, rotors, (f"motors: {text}",), None)
    if on.sum() < 50:
        return Identified(out, rotors, ("rotors: no flight with the motors running; fly 10 s or more",), None)
    power = drive[on]
    upright = 1.0 if log.upright is None else log.upright[on]
    word, unit = "thrust per command", "N" if log.command_unit == "1" else f"N/{log.command_unit}"
    m, per = (1.0, "/kg") if mass_kg is None else (mass_kg, "")
    weight = _balance(log, on, power.sum(axis=1) * upright)
    if speeds:
        word, unit = "thrust constant", "N/rpm^2"
        weight = None if weight is None else _hovering(log, on, weight)
    if weight is not None and speeds and log.sensors:
        # What the repair leaves open of the sum of squares.
        open_ = [2.0 * s.u * float(power[:, s.motor - 1].mean() / power.sum(axis=1).mean()) for s in log.sensors]
        half = np.hypot(weight.half, 1.96 * weight.value * np.linalg.norm(open_))
        weight = Constant(weight.value, float(half), weight.unit)
    if weight is not None:
        out[word] = Constant(m * weight.value, m * weight.half, unit + per)
    if mass_kg is None:
        unseen.append("mass: give --mass-kg, or a healthy flight of known mass with the same propellers")
    if log.command is not None:
        c = log.command[on]
        rotors["mean command"] = tuple(map(float, c.mean(axis=0)))
        out["hover command"] = _blocks(c.mean(axis=1), np.mean, log.command_unit)
    if log.rpm is not None:
        rotors["mean rpm"] = tuple(map(float, log.rpm[on].mean(axis=0)))
        rotors["share of rpm^2"] = tuple(map(float, power.mean(axis=0) / np.mean(power)))
        _per_rotor(log, on, m, per, out, unseen)
    else:
        unseen.append("thrust over speed: log the speed of each rotor (ESC telemetry)")
    _yaw(log, on, drive, out, unseen)
    _motor(log, on, out, unseen)
    return Identified(out, rotors, tuple(unseen), weight)


def _balance(log: FlightLog, on: NDArray[np.bool_], lift: Array) -> Constant | None:
    """Momentum balance for unit mass."""
    if not np.all(np.isfinite(lift)) or lift.mean() <= 0.0:
        return None
    t, gain = log.t[on], np.zeros(BATCHES)
    parts = np.array_split(np.arange(t.size), BATCHES)
    if log.velocity is not None:
        vz = log.velocity[on, 2]
        gain = np.array([(vz[p[-1]] - vz[p[0]]) / max(t[p[-1]] - t[p[0]], 1e-3) for p in parts])
    values = np.array([(G0 + a) / lift[p].mean() for p, a in zip(parts, gain, strict=True)])
    span = float(t[-1] - t[0])
    whole = 0.0 if log.velocity is None else float(log.velocity[on, 2][-1] - log.velocity[on, 2][0]) / max(span, 1e-3)
    return Constant((G0 + whole) / float(lift.mean()), half_width(values), "1")


def _hovering(log: FlightLog, on: NDArray[np.bool_], weight: Constant) -> Constant:
    """The balance without what air that crosses the disks adds, where the velocity is known (over ground: calm air)."""
    if log.velocity is None or log.axis is None or log.rpm is None:
        return weight
    v, axis = log.velocity[on], log.axis[on]
    along = np.sum(v * axis, axis=1)
    flow = np.sum((v - along[:, None] * axis) ** 2, axis=1) / _HOVER_M_S**2
    # u^2 = sqrt(1 + flow^2/4) - flow/2, without the loss of digits in fast flight.
    gone = 1.0 - 1.0 / np.sqrt(np.sqrt(1.0 + flow**2 / 4.0) + flow / 2.0)
    gain, precision = _GAIN, _GAIN_U**-2
    square = np.mean(log.rpm[on] ** 2, axis=1)
    lift = np.zeros(0) if log.acceleration is None else log.acceleration[on, 2]
    if lift.size >= 20 * BATCHES and np.all(lift > 0.0) and np.all(square > 0.0) and np.ptp(gone) > 0.0:
        c, u = jackknifed(np.column_stack([gone, along, np.ones(lift.size)]), np.log(lift / square))
        own = float(max(u[0], 1e-6) ** -2)
        gain = (precision * gain + own * float(c[0])) / (precision + own)
        precision += own
    gone_mean = float(gone.mean())
    half = float(np.hypot(weight.half, 1.96 * precision**-0.5 * gone_mean * weight.value))
    return Constant(weight.value * (1.0 - gain * gone_mean), half, weight.unit)


def _blocks(y: Array, of: Callable[[Array], np.floating], unit: str) -> Constant:
    return Constant(float(of(y)), half_width([of(b) for b in np.array_split(y, BATCHES)]), unit)


def _per_rotor(
    log: FlightLog, on: NDArray[np.bool_], m: float, per: str, out: dict[str, Constant], unseen: list[str]
) -> None:
    assert log.rpm is not None
    text = "thrust constant of each rotor: the four move together; fly doublets in roll, pitch and yaw"
    if log.sensors:
        unseen.append("thrust constant of each rotor: a speed sensor is at fault")
        return
    if log.acceleration is not None:
        k, half = regressed(log.rpm[on] ** 2, log.acceleration[on, 2])
        if np.all(k > 0.0) and np.all(half < _APART * k):
            for i in range(k.size):
                out[f"thrust constant, rotor {i + 1}"] = Constant(m * k[i], m * half[i], "N/rpm^2" + per)
            return
        text = text.replace("the four", f"the {k.size} rotors")
    unseen.append(text)


def _yaw(
    log: FlightLog, on: NDArray[np.bool_], drive: Array, out: dict[str, Constant], unseen: list[str]
) -> None:  # fmt: skip
    """Angular acceleration in yaw over the difference of the two directions of turning."""
    known = layout_of(log.layout, log.rotors)
    if log.rates is None or known is None:
        unseen.append("torque constant: log the yaw rate, give --layout, and fly yaw doublets")
        return
    step = float(np.median(np.diff(log.t)))
    width = max(int(round(0.1 / step)), 1)
    smooth = np.ones(width) / width
    rate = np.gradient(np.convolve(log.rates[:, 2], smooth, "same"), log.t)[on]
    # A rotor that turns to the left pushes the body to the right.
    side = np.convolve(np.nan_to_num(drive) @ known[:, 1], smooth, "same")[on]
    c, half = regressed(np.column_stack([-side, np.ones(side.size)]), rate)
    unit = "(rad/s^2)/" + ("rpm^2" if log.rpm is not None else log.command_unit)
    if half[0] < 0.5 * abs(c[0]) and c[0] > 0.0:
        out["torque constant over yaw inertia"] = Constant(float(c[0]), float(half[0]), unit)
        unseen.append("torque constant itself: it needs the moment of inertia about the yaw axis")
    else:
        unseen.append("torque constant: this flight hardly yaws; fly yaw doublets")


def _motor(log: FlightLog, on: NDArray[np.bool_], out: dict[str, Constant], unseen: list[str]) -> None:
    speeds = log.rpm is not None and log.sound
    measured = log.voltage is not None and np.ptp(log.voltage[on]) > 1e-9
    if speeds and log.command is not None and measured and log.command_unit == "1":
        assert log.rpm is not None and log.voltage is not None
        volts = (log.command[on] * log.voltage[on, None])[:, log.sound].mean(axis=1)
        k, half = regressed(np.column_stack([volts, np.ones(volts.size)]), log.rpm[on][:, log.sound].mean(axis=1))
        if half[0] < abs(k[0]):
            out["motor line, slope"] = Constant(float(k[0]), float(half[0]), "rpm/V")
            out["motor line, offset"] = Constant(float(k[1]), float(half[1]), "rpm")
    if log.voltage is None:
        unseen.append("battery: log its voltage")
        return
    if not measured:
        unseen.append(f"battery: its voltage reads {log.voltage[on][0]:.3g} V throughout, so it was hardly measured")
        return
    out["battery voltage"] = _blocks(log.voltage[on], np.mean, "V")
    if log.battery_current is not None and np.std(log.battery_current[on]) > 0.0:
        line, half = regressed(np.column_stack([log.battery_current[on], np.ones(on.sum())]), log.voltage[on])
        if line[0] < 0.0 and half[0] < -line[0]:
            out["battery resistance"] = Constant(float(-line[0]), float(half[0]), "ohm")
            return
    unseen.append("battery resistance: log the current, and change thrust in steps")


# The rotor of a flight as a case: its thrust constant is a reference run at hover.
AIR = 0.03
"""Uncertainty of the density, which logs do not hold, against that of the case: 8 K or 300 m of altitude [1]."""


def learn_from_flights(case: Case, files: Sequence[str], flights: Sequence[Identified]) -> AsMeasured:
    """Condition the rotor of a case on hovering flights, one point a flight, by the names of their logs.

    Thrust is that of the rotor where it sits: body in its wash and neighbours included. Flights differ by what
    :func:`bemt.tools.flight.repeat.flight_scatter` says; all share the uncertainty of the density. InputError when a
    flight has no thrust constant in N/rpm^2, or one that is not of this propeller.
    """
    faults, k, own, rpm = [], [], [], []
    for file, flight in zip(files, flights, strict=True):
        c = flight.constants.get("thrust constant")
        if c is None or c.unit != "N/rpm^2":
            got = "no speeds of the rotors" if c is None else "no mass"
            faults.append(Fault(file, "", f"{got}, so no thrust", "a flight with rotor speeds, and --mass-kg"))
            continue
        k.append(c.value)
        own.append(c.half / c.value / 2.0)
        rpm.append(float(np.mean(flight.rotors["mean rpm"])))
    refuse(faults)
    air = {name: np.broadcast_to(v, len(k)) for name, v in air_fields(case.air()).items()}
    CT = 3600.0 * np.array(k) / (air["rho"] * case.diameter_m**4)
    sd, _ = flight_scatter(k)
    u = CT * np.hypot(own, sd)
    unseen = np.full(CT.shape, np.nan)
    still = np.zeros(CT.shape)
    return as_measured(case, np.array(rpm), still, air_of_points(air), CT, unseen, u, still, (AIR, AIR),
                       where=", ".join(files))  # fmt: skip
