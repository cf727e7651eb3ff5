"""Questions that a vehicle asks of its drive: hover, endurance, response."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.units import G0
from bemt.tools.drive.drive_model import Drive

# The drive in time: speed, induced flow, winding temperature and charge, integrated with scipy.
#
#     (J_m + J_r) dOmega/dt = k (I - I_0) - Q(Omega)                                       rotor_inertia
#     m dv/dt = T(Omega, v) - 2 rho A v (V + v),  T = T_s(Omega) + T_v (v - v_s(Omega))    inflow_lag
#     C dtheta/dt = R_m I^2 - (theta - theta_air) / R_th                                   motor_heating
#     dSoC/dt = -I_b / (3600 capacity)                                                     battery_sag
#
# m = 8/3 rho R^3 (Carpenter and Fridovich, NACA TN 3044, 1953; not checked). Switched off, a state follows at once.


@dataclass(frozen=True, eq=False)
class History:
    """Course of a simulation; all (N,) float."""

    # (N,) time [s] and command [us]
    time_s: Array
    pulse_us: Array
    # (N,) speed [rev/min], thrust [N], torque of the air [N m]
    rpm: Array
    thrust_N: Array
    torque_Nm: Array
    # (N,) currents [A], voltage at the ESC [V]
    motor_A: Array
    battery_A: Array
    voltage_V: Array
    # (N,) of the winding [C]; state of charge [1]
    temperature_C: Array
    soc: Array
    converged: bool  # whether the integrator reached the end; NaN after where it stopped


def simulate(
    drive: Drive, steps: Sequence[tuple[float, float]], end_s: float, times_s: ArrayLike | None = None,
    soc: float = 1.0,
) -> History:  # fmt: skip
    """Integrate the drive through steps of the command."""
    from scipy.integrate import solve_ivp

    inertia = drive.motor.inertia_kg_m2 + drive.rotor.inertia_kg_m2
    if not inertia > 0.0:
        raise InputError(Fault("", "inertia_kg_m2", f"{inertia:g}", "more than 0, of motor and rotor together"))
    at = np.linspace(0.0, end_s, 400) if times_s is None else np.asarray(times_s, dtype=float)
    orders = sorted(steps)
    if not orders or np.any(np.diff(at) < 0.0) or at[0] < 0.0 or at[-1] > end_s * (1 + 1e-12):
        raise InputError(Fault("", "times_s", "times or steps out of order", "0 to end_s, rising"))
    warm0 = drive.motor.ambient_C
    if "rotor_inertia" in drive.off:
        inertia *= 1e-3
    first = drive.steady(orders[0][1], soc, warm0)
    omega = float(first.rpm[0]) * math.pi / 30.0
    state = np.array([omega, float(drive.rotor.induced(drive.rotor.thrust(omega))), warm0, soc])
    out = np.full((4, len(at)), np.nan)
    pulse = np.full(len(at), orders[0][1])
    edges = [0.0, *[t for t, _ in orders if 0.0 < t < end_s], end_s]
    done = True
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        command = [p for t, p in orders if t <= a + 1e-12 or t == orders[0][0]][-1]
        inside = (at >= a) & (at <= b) if b == end_s else (at >= a) & (at < b)
        pulse[inside] = command
        duty = drive.esc.duty([command])
        when, place = np.unique(np.append(at[inside], b), return_inverse=True)
        answer = solve_ivp(_rates, (a, b), state, method="LSODA", t_eval=when, rtol=1e-7,
                           atol=[1e-4, 1e-5, 1e-5, 1e-9], args=(drive, duty, inertia))  # fmt: skip
        if not answer.success:
            done = False
            break
        out[:, inside] = answer.y[:, place[:-1]]
        state = answer.y[:, -1]
    omega_t, v, warm, charge = out
    good = np.isfinite(omega_t)
    safe = np.where(good, omega_t, 0.0)
    voc = drive.battery.voc(np.where(good, charge, 1.0))
    amps, bus, _ = drive.currents(drive.esc.duty(pulse), safe, voc, np.where(good, warm, warm0))
    thrust = _thrust(drive, safe, np.where(good, v, 0.0))
    nan = np.where(good, 0.0, np.nan)
    return History(at, pulse, omega_t * 30.0 / math.pi, thrust + nan, drive.rotor.torque(safe) + nan, amps + nan,
                   bus + nan, voc - drive.battery_ohm * bus + nan, warm, charge, done)  # fmt: skip


def _thrust(drive: Drive, omega: Array, v: Array) -> Array:
    steady = drive.rotor.thrust(omega)
    if drive.rotor.slope_law is None or "inflow_lag" in drive.off:
        return steady
    return np.asarray(steady + drive.rotor.slope_law(omega) * (v - drive.rotor.induced(steady)))


def _rates(t: float, y: Array, drive: Drive, duty: Array, inertia: float) -> list[float]:
    omega, v, warm, soc = (np.atleast_1d(x) for x in y)
    omega = np.maximum(omega, 0.0)
    motor, rotor = drive.motor, drive.rotor
    amps, bus, _ = drive.currents(duty, omega, drive.battery.voc(soc), warm)
    k = motor.k(warm)
    push = k * amps - rotor.torque(omega)
    friction = k * motor.no_load_A
    net = push - friction if omega[0] > 0.0 else np.maximum(push - friction, 0.0)
    rates = [float(net[0]) / inertia, 0.0, 0.0, 0.0]
    if rotor.slope_law is not None and "inflow_lag" not in drive.off:
        air = 2.0 * rotor.rho * rotor.area_m2 * v * (rotor.airspeed_m_s + v)
        rates[1] = float((_thrust(drive, omega, v) - air)[0]) / rotor.apparent_mass_kg
    if "motor_heating" not in drive.off and math.isfinite(motor.heat_capacity_J_K) and motor.thermal_K_W > 0.0:
        loss = float((motor.resistance(warm) * amps**2)[0])
        rates[2] = (loss - float(warm[0] - motor.ambient_C) / motor.thermal_K_W) / motor.heat_capacity_J_K
    if "battery_sag" not in drive.off and math.isfinite(drive.battery.capacity_Ah):
        rates[3] = -float(bus[0]) / (3600.0 * drive.battery.capacity_Ah)
    return rates


def time_to(time_s: Array, values: Array, start_s: float) -> float:
    """Time from a step until 63 % of the change, 1 - 1/e, is reached. [s]

    >>> t = np.linspace(0.0, 1.0, 1001)
    >>> round(time_to(t, 1 - np.exp(-t / 0.05), 0.0), 4)
    0.05
    """
    before = float(np.interp(start_s, time_s, values))
    change = float(values[-1]) - before
    if change == 0.0 or not math.isfinite(change):
        return math.nan
    done, share = (values - before) / change, 1.0 - math.exp(-1.0)
    later = np.flatnonzero((time_s >= start_s) & (done >= share))
    if len(later) == 0 or later[0] == 0:
        return math.nan
    i = int(later[0])
    x = (share - done[i - 1]) / (done[i] - done[i - 1])
    return float(time_s[i - 1] + x * (time_s[i] - time_s[i - 1]) - start_s)


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
    if math.isnan(pulse) or not wanted > 0.0:  # half of a full throttle that lifts nothing
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


def response(drive: Drive, low: float, high: float, soc: float) -> tuple[list[Response], History | None]:
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
        course = simulate(drive, [(0.0, a), (0.1 * guess, b), (1.1 * guess, a)], end, t, soc)
        up = (t >= 0.05 * guess) & (t < 1.1 * guess)
        down = t >= 1.05 * guess
        times = [time_to(t[up], course.thrust_N[up], 0.1 * guess), time_to(t[down], course.thrust_N[down], 1.1 * guess)]
        if not np.all(np.isfinite(times)) or max(times) < 0.1 * guess:
            break
        guess *= 2.5
    T = [float(course.thrust_N[i]) for i in (0, int(np.flatnonzero(up)[-1]), -1)]
    return [Response(a, b, T[0], T[1], times[0]), Response(b, a, T[1], T[2], times[1])], course
