"""Constants and series of :mod:`bemt.formula.compact` from measured points, and its bands with the maker left out.

Thrust first, on propellers whose chord is known, as a mixed model: eight constants for all, a0 of each series, a0 and
level of each propeller as random effects (`SIGMA`). So Reynolds number acts as it does WITHIN propellers, and a series
with many sizes counts as little more than one with few. Then power, then the chord law on the known chords and on those
that static thrust implies. Residuals are taken in arsinh, which is a logarithm except near zero, with scipy's soft_l1
loss; each propeller weighs one at rest and one in flight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bemt.formula import compact
from bemt.formula.points import FitPoints
from bemt.readers._uiuc_names import FAMILIES

Array = NDArray[np.float64]

MIN_PROPELLERS = 8
"""Propellers with a known chord and power that a fit of the eight constants needs."""
GIVEN_FIELDS = {"label": (), "chord": ("chord_m",), "pitch": ("chord_m", "measured_pitch_m")}
GIVEN = tuple(GIVEN_FIELDS)
"""What a prediction may use of each propeller: label and series; its chord too; chord and measured pitch."""
SOFT_CT, SOFT_CP = 0.02, 0.012
"""Coefficients below which residuals become absolute [-]."""
LOSS_SCALE = 0.03
SIGMA = {"series": 0.06, "propeller": 0.06, "level": 0.05, "run": 0.05}
"""Spread of a0 by series and by propeller [rad], of the logarithm of the level, of a run in arsinh [-]: the smallest
error with the propeller left out of volume 1 among 0.03 to 0.1."""
RUN_POINTS = 6.0
"""Independent readings that a run at rest or in flight counts for."""
X_THRUST, X_POWER = 0.95, 1.0
"""J/(P/D) up to which thrust and power are fitted [-]."""
RE0_RANGE = (500.0, 30000.0)
CHORD_GRID = np.linspace(0.05, 0.4, 141)


@dataclass(frozen=True)
class Fitted:
    """Constants and series, and what they were fitted on: ``propellers`` with chord, ``chords`` of the chord law."""

    constants: compact.Constants
    series: Mapping[str, compact.MakerSeries]
    propellers: int
    chords: int


PUBLISHED = Fitted(compact.CONSTANTS, compact.SERIES, 0, 0)
"""What :mod:`bemt.formula.compact` holds."""


def _zero_lift(points: FitPoints, series: Mapping[str, compact.MakerSeries]) -> Array:
    return np.array([series.get(p.maker, compact.MakerSeries()).zero_lift for p in points.propellers])[points.index]


def predict(points: FitPoints, fitted: Fitted = PUBLISHED, given: str = "chord") -> tuple[Array, Array]:
    """CT and CP of the formula at measured conditions. [-]"""
    chord = points.chord(fitted.constants, given != "label", fitted.series)
    s = 2.0 * points.of("blades") * chord / (np.pi * points.of("diameter_m"))
    pd = points.P_D
    if given == "pitch":
        pd = compact.effective_pitch(pd, points.of("measured_pitch_m") / points.of("diameter_m"))
    Re, change = points.Re(chord), _zero_lift(points, fitted.series)
    return compact.series_coefficients(pd, points.J, s, Re, change, fitted.constants)


def has(points: FitPoints, given: str) -> NDArray[np.bool_]:
    """Points of propellers that have what a prediction may use, (N,)."""
    names = GIVEN_FIELDS[given]
    return np.asarray(np.all([np.isfinite(points.of(name)) for name in ("diameter_m", *names)], axis=0))


def fittable(points: FitPoints) -> NDArray[np.bool_]:
    """Points of open propellers with a known chord, in the range of the fit, (N,)."""
    return np.isfinite(points.of("chord_m")) & ~points.ducted & (points.x >= 0) & (points.x < X_POWER)


def _arsinh(y: Array, soft: float) -> Array:
    return np.arcsinh(y / (2.0 * soft))


def _weights(points: FitPoints) -> Array:
    group = 2 * points.index + (points.J == 0)
    return np.asarray(1.0 / np.sqrt(np.bincount(group)[group]))


def _thrust_fit(points: FitPoints, start: compact.Constants) -> tuple[compact.Constants, dict[str, float]]:
    """The four thrust constants and a0 of each series by the mixed model of the module."""
    from scipy.optimize import least_squares
    from scipy.sparse import lil_matrix

    used = points.select(points.x < X_THRUST)
    makers, series_of = np.unique([p.maker for p in used.propellers], return_inverse=True)
    present, own = np.unique(used.index, return_inverse=True)
    series = series_of[used.index]
    S, K, N = makers.size, present.size, used.rpm.size
    w = _weights(used) * np.sqrt(RUN_POINTS) / SIGMA["run"]
    y = _arsinh(used.CT, SOFT_CT)
    D = used.of("diameter_m")
    pd = compact.effective_pitch(used.P_D, used.of("measured_pitch_m") / D)
    chord = used.of("chord_m")
    s, Re = 2.0 * used.of("blades") * chord / (np.pi * D), used.Re(chord)
    spread = np.repeat([SIGMA["series"], SIGMA["propeller"], SIGMA["level"]], [S, K, K])

    def make(v: Array) -> compact.Constants:
        values = {"pitch_factor": v[0], "zero_lift": v[1], "loading_max": v[2], "re_scale": np.exp(v[3])}
        return replace(start, **{name: float(x) for name, x in values.items()})

    def residual(v: Array) -> Array:
        change, level = v[4 + series] + v[4 + S + own], np.exp(v[4 + S + K + own])
        CT = compact.coefficients(pd, used.J, s, Re, make(v), change, level)[0]
        return np.concatenate([(_arsinh(CT, SOFT_CT) - y) * w, v[4:] / spread])

    pattern = lil_matrix((N + spread.size, 4 + spread.size), dtype=int)
    rows = np.arange(N)
    pattern[:N, :4] = 1
    for column in (4 + series, 4 + S + own, 4 + S + K + own):
        pattern[rows, column] = 1
    effects = np.arange(spread.size)
    pattern[N + effects, 4 + effects] = 1
    v0 = np.array([start.pitch_factor, start.zero_lift, start.loading_max, np.log(start.re_scale)])
    low, high = np.full((2, v0.size + spread.size), [[-np.inf], [np.inf]])
    low[3], high[3] = np.log(RE0_RANGE)  # data that know no Reynolds number would send it to zero
    found = least_squares(residual, np.concatenate([v0, np.zeros(spread.size)]), loss="soft_l1", f_scale=2.0,
                          bounds=(low, high), x_scale=np.concatenate([np.abs(v0), spread]), jac_sparsity=pattern,
                          ftol=1e-7)  # fmt: skip
    changes = {str(name): float(x) for name, x in zip(makers, found.x[4 : 4 + S], strict=True)}
    return make(found.x), {name: changes[name] for name in np.unique(makers[series])}


def _power_fit(points: FitPoints, fitted: Fitted) -> compact.Constants:
    from scipy.optimize import least_squares

    used, start = points.select(np.isfinite(points.CP)), fitted.constants
    w, y = _weights(used), _arsinh(used.CP, SOFT_CP)

    def make(v: Array) -> compact.Constants:
        return replace(start, stall_drag=float(v[0]), cd0=float(v[1]))

    def residual(v: Array) -> Array:
        made = predict(used, replace(fitted, constants=make(v)), "pitch")[1]
        return (_arsinh(made, SOFT_CP) - y) * w

    v0 = np.array([start.stall_drag, start.cd0])
    return make(least_squares(residual, v0, loss="soft_l1", f_scale=LOSS_SCALE, x_scale=v0).x)


def implied_chords(points: FitPoints, fitted: Fitted) -> Array:
    """Chord over radius that makes the formula's static CT the measured one, where no chord is known, (K,) [-]."""
    out = np.full(len(points.propellers), np.nan)
    change = fitted.series
    for k, propeller in enumerate(points.propellers):
        own = points.select((points.index == k) & (points.J == 0) & (points.CT > 0))
        if np.isfinite(propeller.chord_m) or propeller.ducted or own.rpm.size == 0:
            continue
        R = propeller.diameter_m / 2.0
        s = propeller.blades * CHORD_GRID / np.pi
        Re = own.Re(np.full(own.rpm.size, R))[:, None] * CHORD_GRID
        a0 = change.get(propeller.maker, compact.MakerSeries()).zero_lift
        pd = propeller.pitch_m / propeller.diameter_m
        CT = compact.coefficients(pd, 0.0, s, Re, fitted.constants, a0)[0]
        level = np.median(np.log(CT / own.CT[:, None]), axis=0)
        if level[0] < 0.0 < level[-1]:
            out[k] = np.interp(0.0, level, CHORD_GRID)
    return out


def _chord_law(points: FitPoints, fitted: Fitted) -> Fitted:
    """Chord over diameter, and each series' factor on it: its mean over n propellers, shrunk by n/(n + 1)."""
    known = np.array([p.chord_m / (p.diameter_m / 2.0) if not p.ducted else np.nan for p in points.propellers])
    per_blade = np.where(np.isfinite(known), known, implied_chords(points, fitted))
    have = np.isfinite(per_blade)
    D = np.array([p.diameter_m for p in points.propellers])[have] / compact.D_CHORD
    y = np.log(per_blade[have])
    exponent = fitted.constants.chord_exponent
    if np.ptp(np.log(D)) > 0.2:
        exponent = float(np.polyfit(np.log(D), y, 1)[0])
    level = float(np.mean(y - exponent * np.log(D)))
    makers = np.array([p.maker for p in points.propellers])[have]
    off = y - level - exponent * np.log(D)
    series = {}
    for name in np.unique(makers):
        own = makers == name
        a0 = fitted.series.get(str(name), compact.MakerSeries()).zero_lift
        factor = float(np.exp(np.sum(off[own]) / (np.count_nonzero(own) + 1.0)))
        series[str(name)] = compact.MakerSeries(a0, factor, FAMILIES.get(str(name), str(name)))
    constants = replace(fitted.constants, chord_R=float(np.exp(level)), chord_exponent=exponent)
    return replace(fitted, constants=constants, series=series, chords=int(np.count_nonzero(have)))


def fit(points: FitPoints, start: compact.Constants = compact.CONSTANTS) -> Fitted | None:
    """Fit the eight constants and the series."""
    used = points.select(fittable(points))
    if np.unique(used.index[np.isfinite(used.CP)]).size < MIN_PROPELLERS or not np.any(used.J == 0):
        return None
    constants, changes = _thrust_fit(used, start)
    series = {name: compact.MakerSeries(change) for name, change in changes.items()}
    fitted = Fitted(constants, series, int(np.unique(used.index).size), 0)
    return _chord_law(points, replace(fitted, constants=_power_fit(used, fitted)))


def left_out(
    points: FitPoints, fitted: Fitted, groups: NDArray[np.intp], progress: Callable[[int, int], None] | None = None
) -> dict[str, tuple[Array, Array]]:
    """CT and CP of every point by constants and series fitted without its group. [-]"""
    out = {given: (np.full(points.rpm.size, np.nan), np.full(points.rpm.size, np.nan)) for given in GIVEN}
    all_groups = np.unique(groups)
    for done, g in enumerate(all_groups):
        own = groups == g
        rest = fit(points.select(~own), fitted.constants)
        for given, (CT, CP) in out.items():
            if rest is not None:
                CT[own], CP[own] = predict(points.select(own), rest, given)
        if progress is not None:
            progress(done + 1, all_groups.size)
    return out


def bands(points: FitPoints, CT: Array, CP: Array, fitted: Fitted, given: str) -> dict[str, tuple[float, ...]]:
    """Half-widths of the error bands over `compact.BAND_X`. [-]"""
    own = replace(points, J=np.zeros_like(points.J))
    CT0, CP0 = predict(own, fitted, given)
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
