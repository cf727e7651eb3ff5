"""What a data sheet does not give, from recordings: ESC law, resistances, rotor constants, inertia.

A thrust map gives rotor constants (thrust and torque over speed squared), battery (voltage over current) and, by least
squares of thrust, speed and current over pulse width, the ESC's pulses of no thrust and of full duty, the resistance of
motor and ESC together and, where the current of an ESC with diodes stops within its periods, the ripple; with them K_v
and I_0 when no data sheet states them. The duty is linear between the two pulses unless an exponent is stated. What is
stated stays. A log of a step gives the inertia.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.errors import Fault, InputError
from bemt.physics.dataset import Dataset
from bemt.tools.drive import mission
from bemt.tools.drive.drive_model import Battery, Drive, Esc, Motor, RotorMap, quadratic

Array = NDArray[np.float64]
FREE: dict[str, tuple[float, float, float]] = {
    "pulse_min_us": (1030.0, 800.0, 1250.0),
    "pulse_max_us": (1960.0, 1700.0, 2050.0),
    "resistance_ohm": (0.1, 1e-3, 2.0),
    "ripple_ohm": (0.3, 1e-2, 1e3),
    "kv_rpm_V": (1000.0, 50.0, 20000.0),
    "no_load_A": (0.3, 0.0, 10.0),
    "kQ": (1e-7, 1e-12, 1e-2),
}
"""What can be fitted: start and bounds, in the unit of the name; kQ in N m s2/rad2."""


@dataclass(frozen=True, eq=False)
class MapFit:
    """Drive fitted to a thrust map."""

    drive: Drive  # the drive, with a battery whose voltage at rest is that of the recording
    fitted: Mapping[str, float]  # what was fitted, in the unit of its name
    # rotor constants. [N s2/rad2], [N m s2/rad2]
    kT: float
    kQ: float
    full_thrust_N: float  # greatest thrust recorded. [N]


def no_load(points: Dataset) -> tuple[float, float]:
    """K_v and I_0 of a run without propeller at full pulse width, as data sheets define them."""
    top = points.pulse_us >= np.max(points.pulse_us) - 1.0
    return float(np.mean(points.rpm[top] / points.voltage_V[top])), float(np.mean(points.current_A[top]))


def _rotor_constant(omega: Array, load: Array) -> float:
    ok = np.isfinite(omega) & np.isfinite(load) & (omega > 0.0)
    return float(np.sum(load[ok] * omega[ok] ** 2) / np.sum(omega[ok] ** 4))


def fit_map(
    points: Dataset,
    known: Mapping[str, float] | None = None,
    torque_Nm: ArrayLike | None = None,
    diameter_m: float = 0.2,
) -> MapFit:
    """Fit a drive to a thrust map."""
    from scipy.optimize import least_squares

    known = dict(known or {})
    v = points.values
    faults = [
        Fault("", name, "no values", "a recorded channel")
        for name in ("rpm", "current_A")
        if np.count_nonzero(np.isfinite(v[name])) < 4
    ]
    if np.count_nonzero(np.isfinite(v["voltage_V"])) < 4 and "voltage_V" not in known:
        faults.append(Fault("", "voltage_V", "no values", "recorded, or stated as voltage_V"))
    if faults:
        raise InputError(faults)
    omega = v["rpm"] * math.pi / 30.0
    kT = _rotor_constant(omega, v["thrust_N"])
    if torque_Nm is not None:
        known.setdefault("kQ", _rotor_constant(omega, np.asarray(torque_Nm, dtype=float)))
    voc, rb = _battery(v["current_A"], v["voltage_V"], known)
    free = [name for name in FREE if name not in known]
    full = {name: float(np.nanmax(v[name])) for name in ("thrust_N", "rpm", "current_A")}
    start = {name: FREE[name][0] for name in free}
    top = int(np.nanargmax(v["thrust_N"]))
    if "kv_rpm_V" in free:
        start["kv_rpm_V"] = 1.25 * full["rpm"] / (v["voltage_V"][top] if np.isfinite(v["voltage_V"][top]) else voc)
    if "kQ" in free:
        k = 60.0 / (2.0 * math.pi * known.get("kv_rpm_V", start.get("kv_rpm_V", 1000.0)))
        start["kQ"] = k * full["current_A"] / (full["rpm"] * math.pi / 30.0) ** 2

    def built(theta: Mapping[str, float]) -> Drive:
        every = {"exponent": 1.0, **known, **theta}
        ripple = every.get("ripple_ohm", math.inf)
        esc = Esc(
            every["pulse_min_us"],
            every["pulse_max_us"],
            every["exponent"],
            braking=math.isinf(ripple),
            ripple_ohm=ripple,
        )
        motor = Motor(every["kv_rpm_V"], every["resistance_ohm"], every["no_load_A"])
        return Drive(
            Battery(1, rb, ocv_V=(voc, voc), soc_table=(0.0, 1.0)), esc, motor, quadratic(kT, every["kQ"], diameter_m)
        )

    def fitted_to(names: list[str], begin: Mapping[str, float]) -> tuple[float, dict[str, float]]:
        low = np.array([math.log(FREE[n][1] + 1e-9) for n in names])
        high = np.array([math.log(FREE[n][2]) for n in names])

        def misfit(x: Array) -> Array:
            got = built(dict(zip(names, map(float, np.exp(x)), strict=True))).steady(points.pulse_us)
            pairs = [(got.thrust_N, "thrust_N", 1.0), (got.rpm, "rpm", 1.0), (got.battery_A, "current_A", 0.5)]
            off = np.concatenate([share * (model - v[name]) / full[name] for model, name, share in pairs])
            # what was not recorded says nothing; a drive without a solution is off by all there is
            told = np.isfinite(np.concatenate([v[name] for _, name, _ in pairs]))
            return np.where(told, np.nan_to_num(off, nan=1.0), 0.0)

        x0 = np.clip([math.log(begin[n] + 1e-9) for n in names], low + 1e-6, high - 1e-6)
        found = least_squares(misfit, x0, bounds=(low, high), loss="soft_l1", f_scale=0.03, x_scale=0.1, diff_step=1e-4)
        return float(found.cost), dict(zip(names, map(float, np.exp(found.x)), strict=True))

    cost, fitted = fitted_to([n for n in free if n != "ripple_ohm"], start)
    if "ripple_ohm" in free:  # is the current seen to stop? One constant more has to earn its place (Schwarz 1978)
        size = 3 * len(points.pulse_us)
        tries = [fitted_to(free, {**start, **at, "ripple_ohm": z}) for z in (0.3, 3.0) for at in ({}, fitted)]
        less, better = min(tries, key=lambda one: one[0])
        if size * math.log(max(less, 1e-12) / max(cost, 1e-12)) < -math.log(size):
            fitted = better
    return MapFit(
        built(fitted),
        fitted | {"battery_ohm": rb, "voltage_at_rest_V": voc},
        kT,
        {**known, **fitted}["kQ"],
        full["thrust_N"],
    )


def _battery(current: Array, voltage: Array, known: Mapping[str, float]) -> tuple[float, float]:
    """Voltage at rest and resistance from voltage over current; not below no resistance."""
    ok = np.isfinite(current) & np.isfinite(voltage)
    if np.count_nonzero(ok) < 4:
        return known["voltage_V"], known.get("battery_ohm", 0.0)
    if "battery_ohm" in known:
        return float(np.mean(voltage[ok] + known["battery_ohm"] * current[ok])), known["battery_ohm"]
    slope, rest = np.polyfit(current[ok], voltage[ok], 1)
    return (float(rest), float(-slope)) if slope < 0.0 else (float(np.mean(voltage[ok])), 0.0)


def battery_of(points: Dataset) -> tuple[float, float]:
    """Voltage at rest and resistance of the battery of a recording."""
    current, voltage = points.current_A, points.voltage_V
    if np.count_nonzero(np.isfinite(current) & np.isfinite(voltage)) < 4:
        raise InputError(Fault("", "voltage_V", "no values", "recorded voltage and current"))
    return _battery(current, voltage, {})


@dataclass(frozen=True)
class FirstOrder:
    """Delayed first-order step."""

    # time constant, its standard uncertainty from the scatter of the samples, time of the step. [s]
    tau_s: float
    u_tau_s: float
    delay_s: float
    # levels, in the unit of the samples
    before: float
    after: float


def first_order(time_s: ArrayLike, values: ArrayLike) -> FirstOrder:
    """Fit a delayed first-order step, as load-cell logs are usually read.

    Least squares of before + (after - before) (1 - exp(-(t - t0)/tau)), levels solved linearly.

    >>> t = np.arange(0.0, 1.0, 0.02)
    >>> got = first_order(t, np.where(t > 0.31, 2.0 * (1 - np.exp(-(t - 0.31) / 0.05)), 0.0))
    >>> round(got.tau_s, 3), round(got.delay_s, 3), round(got.after, 3)
    (0.05, 0.31, 2.0)
    """
    from scipy.optimize import least_squares

    t, y = np.asarray(time_s, dtype=float), np.asarray(values, dtype=float)

    def basis(p: Array) -> tuple[Array, Array]:
        rise = np.where(t > p[1], -np.expm1(-np.maximum(t - p[1], 0.0) / math.exp(p[0])), 0.0)
        a = np.column_stack([1.0 - rise, rise])
        return a, np.linalg.lstsq(a, y, rcond=None)[0]

    def misfit(p: Array) -> Array:
        a, c = basis(p)
        return np.asarray(y - a @ c)

    starts = [np.array([math.log(tau), t0]) for tau in (0.02, 0.06, 0.2) for t0 in np.linspace(t[0], t[-1], 26)[1:-1]]
    start = min(starts, key=lambda p: float(np.sum(misfit(p) ** 2)))
    bounds = ([math.log(1e-4), t[0]], [math.log(10.0 * (t[-1] - t[0])), t[-1]])
    found = least_squares(misfit, start, bounds=bounds, x_scale=[0.1, 0.01], diff_step=1e-5)
    before, after = basis(found.x)[1]
    tau = math.exp(found.x[0])
    sigma2 = 2.0 * float(found.cost) / max(len(t) - 4, 1)
    spread = np.linalg.pinv(found.jac.T @ found.jac) * sigma2
    return FirstOrder(tau, tau * math.sqrt(float(spread[0, 0])), float(found.x[1]), float(before), float(after))


def fit_inertia(
    drive: Drive, time_s: ArrayLike, thrust_N: ArrayLike, before_us: float, after_us: float
) -> tuple[float, float]:
    """Inertia of motor and rotor together from a recorded step."""
    from scipy.optimize import brentq

    step = first_order(time_s, thrust_N)
    tau, delay = step.tau_s, step.delay_s
    t = np.asarray(time_s, dtype=float)

    def gap(log_inertia: float) -> float:
        return math.log(step_constant(drive, math.exp(log_inertia), t, delay, before_us, after_us) / tau)

    low, high = math.log(1e-9), math.log(1.0)
    grid = np.linspace(low, high, 22)
    values = [gap(float(x)) for x in grid]
    for a, b, ya, yb in zip(grid[:-1], grid[1:], values[:-1], values[1:], strict=True):
        if ya < 0.0 <= yb:
            return math.exp(float(brentq(gap, a, b, xtol=1e-3))), tau
    raise InputError(Fault("", "inertia", f"a time constant of {tau:.4g} s", "one that an inertia can give"))


def step_constant(
    drive: Drive, inertia_kg_m2: float, times_s: Array, step_s: float, before_us: float, after_us: float
) -> float:
    """First-order time constant of the model's thrust, sampled and read as the recording is. [s]"""
    motor = replace(drive.motor, inertia_kg_m2=inertia_kg_m2)
    rotor = RotorMap(**{**vars(drive.rotor), "inertia_kg_m2": 0.0})
    t = times_s - times_s[0]
    got = mission.simulate(
        replace(drive, motor=motor, rotor=rotor),
        [(0.0, before_us), (step_s - float(times_s[0]), after_us)],
        float(t[-1]),
        t,
    )
    return first_order(t, got.thrust_N).tau_s
