"""Questions that a vehicle asks of its drive: hover, endurance, response."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bemt.base.arrays import Array
from bemt.base.units import G0
from bemt.tools.drive import transient
from bemt.tools.drive.drive_model import Drive


@dataclass(frozen=True)
class Hover:
    """Hover of one rotor; NaN where the drive does not carry the weight."""

    # thrust that one rotor must give, and the most it gives at this charge. [N]
    wanted_N: float
    full_N: float
    # pulse width [us] and speed [rev/min]
    pulse_us: float
    rpm: float
    # current [A], power [W] and thrust over power [gf/W]
    battery_A: float
    power_W: float
    g_per_W: float
    temperature_C: float  # where the winding settles. [C]


def settled_temperature(drive: Drive, pulse_us: float, soc: float) -> float:
    """Temperature at which copper loss and cooling agree. [C]"""
    motor = drive.motor
    warm = motor.ambient_C
    if "motor_heating" in drive.off or motor.thermal_K_W <= 0.0:
        return warm
    for _ in range(200):
        amps = float(drive.steady(pulse_us, soc, warm).motor_A[0])
        new = motor.ambient_C + motor.thermal_K_W * float(motor.resistance(warm)) * amps**2
        if not math.isfinite(new) or new > 1000.0:
            return math.nan
        if abs(new - warm) < 1e-6:
            return new
        warm = 0.5 * (warm + new)
    return math.nan


def hover(drive: Drive, mass_kg: float, rotors: int, soc: float) -> Hover:
    """Find the hover point."""
    wanted = mass_kg * G0 / rotors
    full = float(drive.steady(drive.esc.pulse_max_us, soc).thrust_N[0])
    pulse = drive.pulse_for(wanted, soc)
    if math.isnan(pulse):
        return Hover(wanted, full, *[math.nan] * 6)
    s = drive.steady(pulse, soc)
    power = float(s.power_W[0])
    return Hover(wanted, full, pulse, float(s.rpm[0]), float(s.battery_A[0]), power, wanted / G0 * 1e3 / power,
                 settled_temperature(drive, pulse, soc))  # fmt: skip


def endurance(drive: Drive, mass_kg: float, rotors: int, soc: float, soc_min: float) -> tuple[float, float]:
    """Time in hover until the charge is used, or the drive no longer carries the weight."""
    wanted = mass_kg * G0 / rotors

    def drawn(c: Array) -> Array:
        pulse = drive.pulses_for(wanted, c)
        return np.where(np.isfinite(pulse), drive.steady(pulse, c).battery_A, np.nan)

    charge = np.linspace(soc, soc_min, 21)
    amps = drawn(charge)
    good = int(np.argmax(~np.isfinite(amps))) if np.any(~np.isfinite(amps)) else len(amps)
    if good < 1:
        return math.nan, soc
    if good < len(amps) and good >= 1:  # the last charge that carries, by bisection
        lo, hi = charge[good], charge[good - 1]
        for _ in range(20):
            mid = 0.5 * (lo + hi)
            carries = bool(np.isfinite(drawn(np.array([mid])))[0])
            lo, hi = (lo, mid) if carries else (mid, hi)
        charge = np.append(charge[:good], hi)
        amps = np.append(amps[:good], drawn(np.array([hi])))
    share = 3600.0 * drive.battery.capacity_Ah
    time = float(np.sum(-np.diff(charge) * 0.5 * (1.0 / amps[1:] + 1.0 / amps[:-1]))) * share
    return time, float(charge[-1])


@dataclass(frozen=True)
class Response:
    """Answer to a step of the command."""

    # command. [us]
    before_us: float
    after_us: float
    # thrust. [N]
    before_N: float
    after_N: float
    time63_s: float  # time to 63 % of the change of thrust. [s]


def response(drive: Drive, low: float, high: float, soc: float) -> tuple[list[Response], transient.History | None]:
    """Step between two shares of full thrust, up and down."""
    full = float(drive.steady(drive.esc.pulse_max_us, soc).thrust_N[0])
    if not full > 0.0:  # NaN too: turned by the wind beyond the rotor's table
        return [], None
    a, b = (drive.pulse_for(share * full, soc) for share in (low, high))
    if not math.isfinite(a + b):
        return [], None
    guess = 0.2
    for _ in range(6):  # long enough that both steps settle
        end = 2.0 * guess + 0.1 * guess
        t = np.linspace(0.0, end, 4001)
        course = transient.simulate(drive, [(0.0, a), (0.1 * guess, b), (1.1 * guess, a)], end, t, soc)
        up = (t >= 0.05 * guess) & (t < 1.1 * guess)
        down = t >= 1.05 * guess
        times = [
            transient.time_to(t[up], course.thrust_N[up], 0.1 * guess),
            transient.time_to(t[down], course.thrust_N[down], 1.1 * guess),
        ]
        if not np.all(np.isfinite(times)) or max(times) < 0.1 * guess:
            break
        guess *= 2.5
    T = [float(course.thrust_N[i]) for i in (0, int(np.flatnonzero(up)[-1]), -1)]
    return [Response(a, b, T[0], T[1], times[0]), Response(b, a, T[1], T[2], times[1])], course
