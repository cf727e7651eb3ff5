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

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bemt.base import unit_errors
from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError

VOLTAGES = {"peak": 1.0, "peak_to_peak": 2.0, "rms": math.sqrt(0.5)}
"""Measure of a sinusoidal voltage over its peak. [1]"""
CURRENTS = {"peak": 1.0, "rms": math.sqrt(0.5), "q_power_invariant": math.sqrt(1.5), "q_amplitude_invariant": 1.0}
"""Measure of a sinusoidal current over its peak. [1]"""
WINDINGS = ("wye", "delta")


def _factor(measures: Mapping[str, float], measure: str, between: str, winding: str, apart: str) -> float:
    """Factor of a measure, times sqrt(3) between the lines of the winding that sets line and phase apart."""
    for where, value, known in (
        ("measure", measure, (*measures,)), ("between", between, ("line", "phase")), ("winding", winding, WINDINGS)
    ):  # fmt: skip
        if value not in known:
            raise InputError(Fault("", where, repr(value), f"one of {', '.join(known)}"))
    return measures[measure] * (math.sqrt(3.0) if (between, winding) == ("line", apart) else 1.0)


def voltage_factor(measure: str, between: str, winding: str) -> float:
    """Measured voltage over the peak voltage of a winding. [1]

    >>> voltage_factor("peak_to_peak", "phase", "delta"), round(voltage_factor("rms", "line", "wye"), 6)
    (2.0, 1.224745)
    """
    return _factor(VOLTAGES, measure, between, winding, "wye")


def current_factor(measure: str, between: str, winding: str) -> float:
    """Measured current over the peak current of a winding. [1]

    >>> round(current_factor("q_power_invariant", "phase", "delta"), 6)
    1.224745
    """
    return _factor(CURRENTS, measure, between, winding, "delta")


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
        lambda f: float(np.sum(solve(f)[1] ** 2)), bounds=(max(coarse - span, 0.1 * coarse), coarse + span),
        method="bounded", options={"xatol": 1e-9 * coarse},
    )  # fmt: skip
    f = float(best.x)
    c, rest = solve(f)
    sizes = [math.hypot(c[1 + 2 * k], c[2 + 2 * k]) for k in range(3)]
    sd = float(np.sqrt(rest @ rest / max(len(t) - 8, 1)))
    return Waveform(f, sizes[0], float(c[0]), (sizes[1] / sizes[0], sizes[2] / sizes[0]), sd)


# Do the methods agree on the motor constant and, if not, which systematic error explains it?
#
# Data are the constant of the data sheet and slope and intercept of the back-EMF and of the torque trials, with their
# covariances. Every hypothesis says how these five numbers follow from one constant ke:
#
#     none              k1 = ke, b2 = ke, a2 = 0, b3 = 3/2 ke / g, a3 = 0
#     back_emf.offset   a2 free
#     torque.offset     a3 free (zero of the sensor; friction and cogging look the same)
#     torque.shunt      R_true/R_assumed = s scales the loop current: b3 times s, a3 = (s - 1) times the live zero
#     METHOD.factor     its slope times sqrt(3/2), sqrt(3), 2 or the inverse: a convention missed
#     METHOD.gain       its slope times a free number; tried only when no single error above explains the data
#
# The least chi-square over ke and the free number judges each. The live zero of the 4-20 mA loop is what tells a wrong
# resistor from a wrong gain. A hypothesis is named only when none fails at `ALPHA` and it passes; when single errors
# fail, gains and then pairs are tried; when several explain the data equally well, all are named and none is preferred.

METHODS = ("data_sheet", "back_emf", "torque")
ALPHA = 0.001
"""Probability at which agreement is rejected."""
FACTORS = {
    e.stated if e.actual == "1" else f"1/{e.actual}": e.factor
    for e in sorted(unit_errors.errors("motor_constant"), key=lambda e: e.actual != "1")
}
"""Convention factors: what a method's value may be too large by."""
NEAR = 6.0
"""Difference of the criterion below which two explanations are not told apart."""


@dataclass(frozen=True, eq=False)
class Measured:
    """What the methods gave, all slopes as ke [V s/rad]."""

    data_sheet: float | None  # ke of the data sheet [V s/rad]
    # Its standard uncertainty; NaN when not stated: then it only bears on convention factors [V s/rad]
    u_data_sheet: float
    # Trials: slopes in V s/rad, intercepts in V and N m
    back_emf: Line | None
    torque: Line | None
    # Standard uncertainty of gains and of the resistor, common to all trials [1]
    u_gain_back_emf: float = 0.0
    u_gain_torque: float = 0.0
    u_shunt: float = 0.0
    live_zero_Nm: float = 0.0  # Shift of torque by a resistor that is wrong by 1 [N m]


@dataclass(frozen=True)
class ErrorSource:
    """One hypothesis fitted."""

    names: tuple[str, ...]  # errors, such as ``torque.shunt`` or ``back_emf.factor sqrt(3)``; empty: none
    # constant under it and its standard uncertainty. [V s/rad]
    ke: float
    u_ke: float
    # by error: offset [V or N m], R_true/R_assumed or factor [1]; standard uncertainty, 0 for a factor
    sizes: tuple[float, ...]
    u_sizes: tuple[float, ...]
    chi2: float  # misfit. [1]
    p: float  # probability of a misfit as large. [1]


@dataclass(frozen=True)
class Verdict:
    """Whether the methods agree."""

    agree: bool  # Whether no systematic error is needed
    # What explains a disagreement, best first; several: not told apart; empty: agreement, or nothing known does
    explanations: tuple[ErrorSource, ...]
    none: ErrorSource  # The fit without any error

    @property
    def named(self) -> tuple[str, ...]:
        """Errors of the only explanation; empty when there is none or more than one."""
        return self.explanations[0].names if len(self.explanations) == 1 else ()


def _errors(m: Measured) -> list[tuple[str, float | None]]:
    """Hypotheses that the data can hold: name and factor (None: a free size)."""
    present = [k for k, v in zip(METHODS, (m.data_sheet, m.back_emf, m.torque), strict=True) if v is not None]
    out: list[tuple[str, float | None]] = []
    if m.back_emf is not None:
        out.append(("back_emf.offset", None))
    if m.torque is not None:
        out += [("torque.offset", None), ("torque.shunt", None)] if m.live_zero_Nm else [("torque.offset", None)]
    if len(present) > 1:
        out += [(f"{method}.factor {word}", f) for method in present for word, f in FACTORS.items()]
    return out


def _gains(m: Measured) -> list[tuple[str, float | None]]:
    """Free scales of the methods; the data sheet's only beside two others."""
    present = [k for k, v in zip(METHODS, (m.data_sheet, m.back_emf, m.torque), strict=True) if v is not None]
    return [(f"{method}.gain", None) for method in present] if len(present) > 1 else []


def _fit(m: Measured, errors: Sequence[tuple[str, float | None]]) -> ErrorSource:
    """Generalised least squares of one hypothesis; Gauss-Newton, since a shunt multiplies ke."""
    from scipy.stats import chi2 as chi2_law

    names = [name for name, _ in errors]
    fixed = {name.split(" ")[0]: f for name, f in errors if f is not None}
    free = [name for name, f in errors if f is None]
    y, blocks = _data(m)
    slopes = [v for v in (m.data_sheet, m.back_emf and m.back_emf.slope, m.torque and m.torque.slope) if v]
    ke = float(np.median(slopes))
    size = {name: 0.0 if name.endswith("offset") else 1.0 for name in free}

    def model(ke: float, size: dict[str, float]) -> Array:
        out: list[float] = []
        for method, read in zip(METHODS, (m.data_sheet, m.back_emf, m.torque), strict=True):
            if read is None:
                continue
            s, zero = size.get(f"{method}.shunt", 1.0), m.live_zero_Nm if method == "torque" else 0.0
            out.append(fixed.get(f"{method}.factor", 1.0) * size.get(f"{method}.gain", 1.0) * ke * s)
            if method != "data_sheet":
                out.append((s - 1.0) * zero + size.get(f"{method}.offset", 0.0))
        return np.array(out)

    cov = _covariance(m, blocks)
    weight = np.linalg.inv(cov)
    theta = np.array([ke, *size.values()])

    def at(theta: Array) -> Array:
        return model(float(theta[0]), dict(zip(free, map(float, theta[1:]), strict=True)))

    jac = np.zeros((len(y), len(theta)))
    for _ in range(30):
        f = at(theta)
        for k in range(len(theta)):
            h = 1e-6 * max(abs(theta[k]), 1e-3)
            step = theta.copy()
            step[k] += h
            jac[:, k] = (at(step) - f) / h
        move = np.linalg.lstsq(jac.T @ weight @ jac, jac.T @ weight @ (y - f), rcond=None)[0]
        theta = theta + move
        if np.all(np.abs(move) <= 1e-10 * np.maximum(np.abs(theta), 1e-6)):
            break
    rest = y - at(theta)
    misfit = float(rest @ weight @ rest)
    spread = np.sqrt(np.diag(np.linalg.pinv(jac.T @ weight @ jac)))
    dof = len(y) - len(theta)
    p = float(chi2_law.sf(misfit, dof)) if dof > 0 else math.nan
    found = dict(zip(free, zip(theta[1:], spread[1:], strict=True), strict=True))
    sizes = [found.get(name, (fixed.get(name.split(" ")[0], math.nan), 0.0)) for name in names]
    return ErrorSource(tuple(names), float(theta[0]), float(spread[0]), tuple(float(s) for s, _ in sizes),
                       tuple(float(u) for _, u in sizes), misfit, p)  # fmt: skip


def _data(m: Measured) -> tuple[Array, list[Array]]:
    y: list[float] = []
    blocks: list[Array] = []
    if m.data_sheet is not None:
        u = m.u_data_sheet if math.isfinite(m.u_data_sheet) else 0.1 * m.data_sheet
        y.append(m.data_sheet)
        blocks.append(np.array([[u**2]]))
    for line in (m.back_emf, m.torque):
        if line is not None:
            y += [line.slope, line.intercept]
            blocks.append(line.cov)
    return np.array(y), blocks


def _covariance(m: Measured, blocks: list[Array]) -> Array:
    """Covariance of the data: trials, gains, resistor."""
    n = sum(len(b) for b in blocks)
    cov, i = np.zeros((n, n)), 0
    order = [x for x in ("data_sheet" if m.data_sheet is not None else "", "back_emf" if m.back_emf else "",
                         "torque" if m.torque else "") if x]  # fmt: skip
    for name, block in zip(order, blocks, strict=True):
        k = len(block)
        cov[i : i + k, i : i + k] += block
        if name == "back_emf" and m.back_emf is not None:
            cov[i, i] += (m.u_gain_back_emf * m.back_emf.slope) ** 2
        if name == "torque" and m.torque is not None:
            cov[i, i] += (m.u_gain_torque * m.torque.slope) ** 2
            along = np.array([m.torque.slope, m.live_zero_Nm])
            cov[i : i + 2, i : i + 2] += m.u_shunt**2 * np.outer(along, along)
        i += k
    return cov


def _criterion(e: ErrorSource, errors: int) -> float:
    free = sum(u > 0.0 for u in e.u_sizes)
    return e.chi2 + math.log(5.0) * free + 2.0 * errors


def judge(m: Measured, alpha: float = ALPHA) -> Verdict:
    """Judge the agreement of the methods."""
    none = _fit(m, [])
    if not none.p < alpha:
        return Verdict(True, (), none)
    errors = _errors(m)
    for pool, how_many in ((errors, 1), (_gains(m), 1), (errors, 2)):
        tried: list[ErrorSource] = []
        for some in itertools.combinations(pool, how_many):
            methods = [name.split(" ")[0] for name, _ in some]
            if len(set(methods)) < how_many or (how_many == 2 and len(_data(m)[0]) - 1 - how_many < 1):
                continue
            e = _fit(m, some)
            if e.p >= alpha:
                tried.append(e)
        if tried:
            tried.sort(key=lambda e: _criterion(e, how_many))
            best = _criterion(tried[0], how_many)
            return Verdict(False, tuple(e for e in tried if _criterion(e, how_many) - best < NEAR), none)
    return Verdict(False, (), none)
