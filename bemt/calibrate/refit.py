"""Constants of :mod:`bemt.calibrate.compact` from measured points, and its error bands with the maker left out.

Order: thrust and power constants on propellers whose chord is known; Re0 so that static CT follows rpm WITHIN each
propeller (propellers differ in more than Reynolds number); then the chord law, on the known chords and on those that
static thrust implies. Residuals are taken in arsinh, which is a logarithm except near zero, with scipy's soft_l1 loss;
each propeller weighs one at rest and one in flight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bemt.calibrate import compact
from bemt.calibrate.points import Points

Array = NDArray[np.float64]

MIN_PROPELLERS = 8
"""Propellers with a known chord and power that a fit of the eight constants needs."""
SOFT_CT, SOFT_CP = 0.02, 0.012
"""Coefficients below which residuals become absolute [-]."""
LOSS_SCALE = 0.03
X_THRUST, X_POWER = 0.95, 1.0
"""J/(P/D) up to which thrust and power are fitted [-]."""
RE0_RANGE = (500.0, 30000.0)
WITHIN_SCALE = 0.02
CHORD_GRID = np.linspace(0.05, 0.4, 141)


@dataclass(frozen=True)
class Fitted:
    """Constants and what they were fitted on: ``propellers`` with chord, ``chords`` of the chord law."""

    constants: compact.Constants
    propellers: int
    chords: int


def predict(points: Points, constants: compact.Constants, known: bool = True) -> tuple[Array, Array]:
    """CT and CP of the formula at measured conditions.

    Parameters
    ----------
    points : Points
        Conditions, in standard air.
    constants : compact.Constants
        Constants.
    known : bool
        Use measured chords where there are any.

    Returns
    -------
    CT, CP : (N,) float
        Propeller convention. [-]
    """
    chord = points.chord(constants, known)
    s = 2.0 * points.of("blades") * chord / (np.pi * points.of("diameter_m"))
    return compact.coefficients(points.P_D, points.J, s, points.Re(chord), constants)


def fittable(points: Points) -> NDArray[np.bool_]:
    """Points of open propellers with a known chord, in the range of the fit.

    Parameters
    ----------
    points : Points
        Measured points.

    Returns
    -------
    (N,) bool
        True where it holds.
    """
    return np.isfinite(points.of("chord_m")) & ~points.ducted & (points.x >= 0) & (points.x < X_POWER)


def _arsinh(y: Array, soft: float) -> Array:
    return np.arcsinh(y / (2.0 * soft))


def _weights(points: Points) -> Array:
    group = 2 * points.index + (points.J == 0)
    return np.asarray(1.0 / np.sqrt(np.bincount(group)[group]))


def _least_squares(residual: Callable[[Array], Array], start: tuple[float, ...]) -> Array:
    from scipy.optimize import least_squares

    x0 = np.array(start)
    found = least_squares(residual, x0, loss="soft_l1", f_scale=LOSS_SCALE, x_scale=np.abs(x0))
    return np.asarray(found.x)


def _thrust_fit(points: Points, start: compact.Constants) -> compact.Constants:
    """The three thrust constants at a given Re0."""
    used = points.select(points.x < X_THRUST)
    w, y = _weights(used), _arsinh(used.CT, SOFT_CT)

    def make(v: Array) -> compact.Constants:
        return replace(start, pitch_factor=float(v[0]), zero_lift=float(v[1]), loading_max=float(v[2]))

    def residual(v: Array) -> Array:
        return (_arsinh(predict(used, make(v))[0], SOFT_CT) - y) * w

    return make(_least_squares(residual, (start.pitch_factor, start.zero_lift, start.loading_max)))


def _power_fit(points: Points, start: compact.Constants) -> compact.Constants:
    used = points.select(np.isfinite(points.CP))
    w, y = _weights(used), _arsinh(used.CP, SOFT_CP)

    def make(v: Array) -> compact.Constants:
        return replace(start, stall_drag=float(v[0]), cd0=float(v[1]))

    def residual(v: Array) -> Array:
        return (_arsinh(predict(used, make(v))[1], SOFT_CP) - y) * w

    return make(_least_squares(residual, (start.stall_drag, start.cd0)))


def _within(points: Points, constants: compact.Constants) -> float:
    """How badly static CT follows the rpm of each propeller, its own level taken away."""
    still = points.select((points.J == 0) & (points.CT > 0))
    d = np.log(still.CT) - np.log(predict(still, constants)[0])
    k = still.index
    e = d - (np.bincount(k, d) / np.maximum(np.bincount(k), 1))[k]
    return float(np.mean(np.sqrt(1.0 + (e / WITHIN_SCALE) ** 2) - 1.0))


def implied_chords(points: Points, constants: compact.Constants) -> Array:
    """Chord over radius that makes the formula's static CT the measured one, for propellers without a chord.

    Parameters
    ----------
    points : Points
        Measured points.
    constants : compact.Constants
        Constants; the chord law is not used.

    Returns
    -------
    (K,) float
        NaN for propellers with a chord, without static points, or whose thrust no chord of 0.05 to 0.4 R explains. [-]
    """
    out = np.full(len(points.propellers), np.nan)
    for k, propeller in enumerate(points.propellers):
        own = points.select((points.index == k) & (points.J == 0) & (points.CT > 0))
        if np.isfinite(propeller.chord_m) or propeller.ducted or own.rpm.size == 0:
            continue
        R = propeller.diameter_m / 2.0
        s = propeller.blades * CHORD_GRID / np.pi
        Re = own.Re(np.full(own.rpm.size, R))[:, None] * CHORD_GRID
        CT = compact.coefficients(propeller.pitch_m / propeller.diameter_m, 0.0, s, Re, constants)[0]
        level = np.median(np.log(CT / own.CT[:, None]), axis=0)
        if level[0] < 0.0 < level[-1]:
            out[k] = np.interp(0.0, level, CHORD_GRID)
    return out


def fit(points: Points, start: compact.Constants = compact.CONSTANTS, re_scale: float | None = None) -> Fitted | None:
    """Fit the eight constants.

    Parameters
    ----------
    points : Points
        Measured points.
    start : compact.Constants
        Where the search begins.
    re_scale : float, optional
        Re0 to keep instead of fitting it. [-]

    Returns
    -------
    Fitted or None
        None when fewer than `MIN_PROPELLERS` propellers have chord and power.
    """
    from scipy.optimize import minimize_scalar

    used = points.select(fittable(points))
    if np.unique(used.index[np.isfinite(used.CP)]).size < MIN_PROPELLERS or not np.any(used.J == 0):
        return None
    if re_scale is None:

        def cost(log_re: float) -> float:
            return _within(used, _thrust_fit(used, replace(start, re_scale=float(np.exp(log_re)))))

        bounds = (float(np.log(RE0_RANGE[0])), float(np.log(RE0_RANGE[1])))
        found = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 0.01})
        re_scale = float(np.exp(found.x))
    constants = _power_fit(used, _thrust_fit(used, replace(start, re_scale=re_scale)))
    known = np.array([p.chord_m / (p.diameter_m / 2.0) if not p.ducted else np.nan for p in points.propellers])
    per_blade = np.where(np.isfinite(known), known, implied_chords(points, constants))
    have = np.isfinite(per_blade)
    D = np.array([p.diameter_m for p in points.propellers])
    exponent, level = constants.chord_exponent, 0.0
    if np.ptp(np.log(D[have])) > 0.2:
        exponent, level = np.polyfit(np.log(D[have] / compact.D_CHORD), np.log(per_blade[have]), 1)
    else:
        level = float(np.mean(np.log(per_blade[have]) - exponent * np.log(D[have] / compact.D_CHORD)))
    constants = replace(constants, chord_R=float(np.exp(level)), chord_exponent=float(exponent))
    return Fitted(constants, int(np.unique(used.index).size), int(np.count_nonzero(have)))


def left_out(
    points: Points, fitted: Fitted, groups: NDArray[np.intp], progress: Callable[[int, int], None] | None = None
) -> dict[bool, tuple[Array, Array]]:
    """CT and CP of every point by constants fitted without its group; Re0 is kept.

    Parameters
    ----------
    points : Points
        Measured points.
    fitted : Fitted
        Fit on all of them: start and Re0.
    groups : (N,) int
        Group of each point: its propeller, or its maker.
    progress : callable, optional
        Called with what is done and how much there is.

    Returns
    -------
    dict
        By whether measured chords are used: CT and CP; NaN where too few propellers are left to fit. [-]
    """
    out = {known: (np.full(points.rpm.size, np.nan), np.full(points.rpm.size, np.nan)) for known in (True, False)}
    all_groups = np.unique(groups)
    for done, g in enumerate(all_groups):
        own = groups == g
        rest = fit(points.select(~own), fitted.constants, fitted.constants.re_scale)
        for known, (CT, CP) in out.items():
            if rest is not None:
                CT[own], CP[own] = predict(points.select(own), rest.constants, known)
        if progress is not None:
            progress(done + 1, all_groups.size)
    return out


def bands(
    points: Points, CT: Array, CP: Array, constants: compact.Constants, known: bool
) -> dict[str, tuple[float, ...]]:
    """Half-widths of the error bands over `compact.BAND_X`.

    Parameters
    ----------
    points : Points
        Measured points.
    CT, CP : (N,) float
        Predictions by fits without the maker. [-]
    constants : compact.Constants
        For the model's own static values.
    known : bool
        Chords as in the predictions.

    Returns
    -------
    dict
        ``CT68``, ``CT95``, ``CP68``, ``CP95``: quantiles of |error| over the static value of the model at the same rpm;
        NaN for bands with fewer than 20 points. [-]
    """
    own = replace(points, J=np.zeros_like(points.J))
    CT0, CP0 = predict(own, constants, known)
    x = points.x
    out: dict[str, tuple[float, ...]] = {}
    for name, measured, made, scale in (("CT", points.CT, CT, CT0), ("CP", points.CP, CP, CP0)):
        e = np.abs(measured - made) / scale
        for share in (0.6827, 0.95):
            widths = []
            for centre in compact.BAND_X:
                near = (points.J == 0) if centre == 0.0 else (points.J > 0) & (np.abs(x - centre) <= 0.1)
                near = near & np.isfinite(e) & ~points.ducted
                widths.append(float(np.quantile(e[near], share)) if near.sum() >= 20 else float("nan"))
            out[f"{name}{round(100 * share)}"] = tuple(widths)
    return out
