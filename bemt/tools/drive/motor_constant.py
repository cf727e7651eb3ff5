r"""Torque constant of a brushless motor by three methods, every convention stated.

The common currency is ``ke``, the peak EMF of one winding per mechanical speed [V s/rad]. For sinusoidal EMF and
current in phase, three windings give the power 3/2 E I, so that

    torque = 3/2 ke I_winding,peak                                                      (1)

What was measured is a multiple of the winding's peak: voltage between lines is sqrt(3) times it in a wye and equal to
it in a delta; the line current is the winding's in a wye and sqrt(3) times it in a delta; rms is peak over sqrt(2). The
power-invariant Clarke/Park transform (factor sqrt(2/3)) makes I_q = sqrt(3/2) I_peak, hence

    K_t,q = sqrt(3/2) ke,                                                               (2)

and the amplitude-invariant one I_q = I_peak, K_t,q = 3/2 ke.

References
----------
R. Krishnan, "Permanent Magnet Synchronous and Brushless DC Motor Drives", CRC Press, 2010, ch. 3 (transforms, torque;
not checked against the book). Equation (2) and the trials' layout follow T. Cahill, MS thesis, Northeastern University,
2025.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError

VOLTAGES = {"peak": 1.0, "peak_to_peak": 2.0, "rms": math.sqrt(0.5)}
"""Measure of a sinusoidal voltage over its peak. [1]"""
CURRENTS = {"peak": 1.0, "rms": math.sqrt(0.5), "q_power_invariant": math.sqrt(1.5), "q_amplitude_invariant": 1.0}
"""Measure of a sinusoidal current over its peak. [1]"""
WINDINGS = ("wye", "delta")


def _known(where: str, value: str, known: tuple[str, ...]) -> None:
    if value not in known:
        raise InputError(Fault("", where, repr(value), f"one of {', '.join(known)}"))


def voltage_factor(measure: str, between: str, winding: str) -> float:
    """Measured voltage over the peak voltage of a winding. [1]

    >>> voltage_factor("peak_to_peak", "phase", "delta"), round(voltage_factor("rms", "line", "wye"), 6)
    (2.0, 1.224745)
    """
    _known("measure", measure, tuple(VOLTAGES))
    _known("between", between, ("line", "phase"))
    _known("winding", winding, WINDINGS)
    return VOLTAGES[measure] * (math.sqrt(3.0) if (between, winding) == ("line", "wye") else 1.0)


def current_factor(measure: str, between: str, winding: str) -> float:
    """Measured current over the peak current of a winding. [1]

    >>> round(current_factor("q_power_invariant", "phase", "delta"), 6)
    1.224745
    """
    _known("measure", measure, tuple(CURRENTS))
    _known("between", between, ("line", "phase"))
    _known("winding", winding, WINDINGS)
    return CURRENTS[measure] * (math.sqrt(3.0) if (between, winding) == ("line", "delta") else 1.0)


def ke_to_kt(ke: float, measure: str = "q_power_invariant", between: str = "phase", winding: str = "wye") -> float:
    """Torque per measured current. [N m/A]"""
    return 1.5 * ke / current_factor(measure, between, winding)


def from_kv(kv_rpm_V: float, winding: str, measure: str = "peak", between: str = "line") -> float:
    """Give ke of the speed constant in a data sheet. [V s/rad]

    >>> ke = from_kv(380.0, "delta")
    >>> round(ke, 5), round(ke_to_kt(ke, "q_power_invariant", "phase", "delta"), 4)
    (0.02513, 0.0308)
    """
    return 60.0 / (2.0 * math.pi * kv_rpm_V) / voltage_factor(measure, between, winding)


@dataclass(frozen=True)
class TorqueLoop:
    """Torque transmitter read as volts over a resistor."""

    shunt_ohm: float  # resistor as assumed. [ohm]
    # current at the ends of the calibration line. [mA]
    low_mA: float = 4.0
    high_mA: float = 20.0
    # torque there. [N m]
    torque_low_Nm: float = 0.0
    torque_high_Nm: float = 2.0

    @property
    def Nm_per_mA(self) -> float:
        """Slope of the calibration line. [N m/mA]"""
        return (self.torque_high_Nm - self.torque_low_Nm) / (self.high_mA - self.low_mA)

    @property
    def live_zero_Nm(self) -> float:
        """How much torque the current at zero torque stands for: what a wrong resistor shifts. [N m]"""
        return self.low_mA * self.Nm_per_mA - self.torque_low_Nm

    def torque(self, shunt_V: ArrayLike) -> Array:
        """Torque of a reading, (N,) [N m].

        >>> TorqueLoop(250.0).torque([1.0, 3.0, 5.0])
        array([0., 1., 2.])
        """
        mA = np.asarray(shunt_V, dtype=float) / self.shunt_ohm * 1e3
        return np.asarray(self.torque_low_Nm + (mA - self.low_mA) * self.Nm_per_mA)


@dataclass(frozen=True, eq=False)
class Line:
    """Mean straight line of some trials."""

    # means, in the units of y/x and y
    slope: float
    intercept: float
    cov: Array  # (2, 2) covariance of the two means, in their units, widened for the number of trials
    # (N,) by trial, in the units of y/x and y
    slopes: Array
    intercepts: Array
    names: tuple[str, ...] = ()  # of the trials

    @property
    def sd(self) -> float:
        """Standard deviation of the trials' slopes, in their unit."""
        return float(np.std(self.slopes, ddof=1)) if len(self.slopes) > 1 else math.nan

    def scaled(self, factor: float) -> Line:
        """The line with its slope in another unit."""
        to = np.diag([factor, 1.0])
        return Line(
            self.slope * factor, self.intercept, to @ self.cov @ to, self.slopes * factor, self.intercepts, self.names
        )


def _widened(n: int, parameters: int) -> float:
    """Variance of Student's t with n - parameters degrees of freedom."""
    dof = n - parameters
    return dof / (dof - 2.0) if dof > 2 else 9.0


def line(x: ArrayLike, y: ArrayLike, trial: ArrayLike) -> Line:
    """Fit a straight line to every trial and take the mean of the lines."""
    xs, ys, which = (np.asarray(v, dtype=float) for v in (x, y, trial))
    names = np.unique(which)
    if len(names) < 3:
        hint = "A mean and its scatter need repeated trials"
        raise InputError(Fault("", "trial", f"{len(names)} trials", "3 or more", hint))
    if all(len(np.unique(xs[which == k])) >= 3 for k in names):
        fits = np.array([np.polyfit(xs[which == k], ys[which == k], 1) for k in names])
        cov = np.cov(fits.T) / len(fits) * _widened(len(fits), 1)
        slope, intercept = fits.mean(axis=0)
        return Line(float(slope), float(intercept), cov, fits[:, 0], fits[:, 1], tuple(f"{k:g}" for k in names))
    if len(np.unique(xs)) < 3:
        raise InputError(Fault("", "trials", "values at fewer than 3 different points", "3 or more", "Vary the speed"))
    (slope, intercept), cov = np.polyfit(xs, ys, 1, cov="unscaled")
    rest = ys - slope * xs - intercept
    sigma2 = float(rest @ rest) / (len(xs) - 2)
    each = np.array([np.mean(ys[which == k] / xs[which == k]) for k in names])
    return Line(float(slope), float(intercept), cov * sigma2 * _widened(len(xs), 2), each, np.full(len(names), np.nan),
                tuple(f"{k:g}" for k in names))  # fmt: skip


@dataclass(frozen=True)
class Waveform:
    """Back-EMF seen by an oscilloscope."""

    # of the fundamental [Hz], its peak [V], and the mean [V]
    frequency_Hz: float
    amplitude_V: float
    offset_V: float
    harmonics: tuple[float, float]  # third and fifth harmonic over the fundamental. [1]
    residual_V: float  # standard deviation of what is left. [V]

    def ke(self, pole_pairs: int, between: str, winding: str) -> float:
        """Peak EMF of a winding per mechanical speed. [V s/rad]"""
        omega = 2.0 * math.pi * self.frequency_Hz / pole_pairs
        return self.amplitude_V / omega / voltage_factor("peak", between, winding)


def fit_waveform(time_s: ArrayLike, volts: ArrayLike) -> Waveform:
    """Fit fundamental, third and fifth harmonic to a waveform."""
    from scipy.optimize import minimize_scalar

    t, v = np.asarray(time_s, dtype=float), np.asarray(volts, dtype=float)
    ok = np.isfinite(t) & np.isfinite(v)
    t, v = t[ok], v[ok]
    if len(t) < 16 or np.any(np.diff(t) <= 0.0):
        raise InputError(Fault("", "waveform", f"{len(t)} samples", "16 or more, time rising"))
    t = t - t[0]
    even = np.interp(np.linspace(0.0, t[-1], len(t)), t, v)
    padded = 8 * len(even)
    spectrum = np.abs(np.fft.rfft((even - even.mean()) * np.hanning(len(even)), padded))
    rate = (len(t) - 1) / t[-1]
    coarse = float(np.argmax(spectrum)) * rate / padded
    if coarse * t[-1] < 1.5:
        got = f"{coarse * t[-1]:.2f} periods"
        raise InputError(Fault("", "waveform", got, "1.5 periods or more", "Record a longer trace"))

    def solve(f: float) -> tuple[Array, Array]:
        angle = 2.0 * math.pi * f * t
        columns = [np.ones_like(t)] + [g(k * angle) for k in (1, 3, 5) for g in (np.cos, np.sin)]
        basis = np.column_stack(columns)
        c = np.linalg.lstsq(basis, v, rcond=None)[0]
        return c, v - basis @ c

    span = 0.5 / t[-1]
    best = minimize_scalar(
        lambda f: float(np.sum(solve(f)[1] ** 2)),
        bounds=(max(coarse - span, 0.1 * coarse), coarse + span),
        method="bounded",
        options={"xatol": 1e-9 * coarse},
    )
    f = float(best.x)
    c, rest = solve(f)
    sizes = [math.hypot(c[1 + 2 * k], c[2 + 2 * k]) for k in range(3)]
    sd = float(np.sqrt(rest @ rest / max(len(t) - 8, 1)))
    return Waveform(f, sizes[0], float(c[0]), (sizes[1] / sizes[0], sizes[2] / sizes[0]), sd)
