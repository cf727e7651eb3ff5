"""The best setting of an explanation, its intervals, and what smooth rest it leaves.

Intervals are widened so that as many hold the truth as they say (split conformal calibration). A half-width times the
factor of its parameter (of its kind of fault, where few were seen) held 90 % of the truths in the development sets that
``reports/studies/interval_scales.py`` was given (Vovk, Gammerman and Shafer 2005, Algorithmic Learning in a Random
World, ch. 4; Lei et al. 2018, J. Am. Stat. Assoc. 113:1094). The file says which seeds and version.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.gaussian.whitening import whitener
from bemt.judge.diagnose import noise
from bemt.judge.diagnose.form import form_modes
from bemt.judge.diagnose.signatures import Setting, effect_of
from bemt.judge.explanation import Explanation, Size, Sizes
from bemt.physics import effects
from bemt.physics.effects.base import FORM

if TYPE_CHECKING:
    from bemt.judge.diagnose.posterior import Evidence
    from bemt.physics.effects import Parameter

_STEPS = 5
# Values of a discrete parameter that are told with their odds.
_SHOWN = 6
# Settings of the covariance that are less likely than this beside the best one add nothing to an interval.
_RARE = 0.01
# Quantiles that stand for a distribution.
_QUANTILES = 199
# Root mean square of the prior sizes of a form's error.
_FORM_SIZE = float(np.sqrt(sum(w * f**2 for f, w in FORM.items())))


@dataclass(frozen=True, eq=False)
class Fit:
    """An explanation at its best setting."""

    ids: tuple[str, ...]  # Effects; of nothing none
    settings: tuple[Setting, ...]  # Parameters of each
    columns: tuple[int, ...]  # Columns of ``State.S``
    signature: Array  # (M,) Change of the readings, solved together (not added up) [units of the readings]


def fit(found: Evidence, what: Explanation) -> Fit:
    """Best setting of an explanation under the preferred covariance."""
    problem, state = found.problem, found.states[0]
    ids = tuple(what)
    if not ids:
        return Fit((), (), (), np.zeros_like(problem.y))
    total = state.scores(what, found.spans, found.log_w)
    at = np.unravel_index(int(np.argmax(total)), total.shape)
    columns = tuple(found.spans[i].start + int(k) for i, k in zip(ids, at, strict=True))
    settings = tuple(found.of(i).settings[c - found.spans[i].start] for i, c in zip(ids, columns, strict=True))
    signature = problem.signature(tuple(effect_of(i, s) for i, s in zip(ids, settings, strict=True)))
    if not np.isfinite(signature).all():
        parts = [found.of(i).signatures[:, c - found.spans[i].start] for i, c in zip(ids, columns, strict=True)]
        signature = np.sum(parts, axis=0)
    return Fit(ids, settings, columns, signature)


def intervals(found: Evidence, what: Explanation, share: float = 0.9) -> dict[str, dict[str, Size]]:
    """Posterior medians and intervals of the parameters of an explanation."""
    return {i: _marginals(found, i, p, share) for i, p in weights(found, what).items()}


def flat(what: Explanation, sizes: Sizes) -> dict[str, Size]:
    """Parameters of an explanation by name, those of a pair with their effect in front."""
    return {f"{i}.{k}" if what.pair else k: v for i, own in sizes.items() for k, v in own.items()}


def weights(found: Evidence, what: Explanation) -> dict[str, Array]:
    """Posterior probability of every setting of the effects of an explanation. [1]"""
    ids = tuple(what)
    states = [s for s in found.states if what in s.log_z]
    share = np.array([s.log_z[what] + np.log(s.hyper.weight) for s in states])
    share = np.exp(share - share.max())
    out = {i: np.zeros(found.of(i).weight.size) for i in ids}
    for s, w in zip(states, share / share.sum(), strict=True):
        total = s.scores(what, found.spans, found.log_w)
        p = np.exp(total - total.max())
        p /= p.sum()
        for k, i in enumerate(ids):
            out[i] += w * (p if p.ndim == 1 else p.sum(axis=1 - k))
    return out


def _marginals(found: Evidence, id_: str, p: Array, share: float) -> dict[str, Size]:
    candidate = found.of(id_)
    cls = type(effect_of(id_, candidate.settings[0]))
    units, discrete = {q.name: q.unit for q in cls.parameters}, cls.discrete
    out: dict[str, Size] = {}
    for key in dict.fromkeys(k for s in candidate.settings for k in s):
        values = [s.get(key) for s in candidate.settings]
        if all(isinstance(v, (int, float)) for v in values if v is not None):
            have = np.array([v is not None for v in values])
            x, q = np.array([float(v) for v in values if v is not None]), p[have]
            if q.sum() <= 0:
                continue
            if key in discrete:
                out[key] = _discrete(values, p, units.get(key, "1"), share)
                continue
            order = np.argsort(x, kind="stable")
            cumulative = np.cumsum(q[order]) / q.sum()
            middle = cumulative - 0.5 * q[order] / q.sum()
            # a grid of settings stands for a density: interpolate its distribution
            ends = (0.5, 0.5 - share / 2, 0.5 + share / 2)
            value, low, high = (float(np.interp(t, middle, x[order])) for t in ends)
            out[key] = Size(value, low, high, units.get(key, "1"))
        else:
            out[key] = _discrete(values, p, "", share)
    return out


def _discrete(values: Sequence[Any], p: Array, unit: str, share: float) -> Size:
    """Posterior of a parameter that takes a few values: the likeliest, the ends of those it may be, and their odds."""
    odds: dict[Any, float] = {}
    for v, q in zip(values, p, strict=True):
        if v is not None:
            odds[v] = odds.get(v, 0.0) + float(q)
    total = sum(odds.values()) or 1.0
    ranked = sorted(odds, key=lambda v: -odds[v])
    mass = np.cumsum([odds[v] / total for v in ranked])
    kept = ranked[: int(np.searchsorted(mass, share)) + 1]
    ends = sorted(kept) if all(isinstance(v, (int, float)) for v in kept) else [kept[0]]
    return Size(kept[0], ends[0], ends[-1], unit, tuple((v, odds[v] / total) for v in kept[:_SHOWN]))


def refined(found: Evidence, best: Fit, share: float = 0.9) -> tuple[Fit, dict[str, dict[str, Size]]]:
    """Parameters between the grid's settings: Gauss-Newton on the solved model, Laplace within the physical ranges."""
    problem = found.problem
    kinds = [effects.catalogue()[i] for i in best.ids]
    where = [(k, p) for k, cls in enumerate(kinds) for p in cls.parameters
             if p.name in best.settings[k] and p.name not in cls.discrete]  # fmt: skip
    # what the form does to the scale of a law looks like its parameter: no fit shows it, so its prior size holds
    C = noise.covariance(problem, found.states[0].hyper)
    C = C + form_covariance(found, best, _FORM_SIZE) + _scale(found, best)
    white = whitener(C, problem.u)
    settings = [dict(s) for s in best.settings]
    low, high = np.array([_ends(found, best.ids[k], p) for k, p in where]).reshape(-1, 2).T
    # as wide as the prior: uniform, or heavy-tailed, whose standard deviation is root 3 of its scale
    usual = np.array([np.inf if p.usual is None else 3.0 * p.usual**2 for _, p in where])
    spread = np.minimum((high - low) ** 2 / 12.0, usual)
    x = np.array([float(settings[k][p.name]) for k, p in where])

    def solve(values: Array) -> Array:
        for (k, p), v in zip(where, values, strict=True):
            settings[k][p.name] = float(v)
        return problem.signature(tuple(effect_of(i, s) for i, s in zip(best.ids, settings, strict=True)))

    def misfit(s: Array) -> float:
        w = white(problem.residual - s)
        return float(w @ w)

    s = solve(x)
    tangent: Array | None = None
    for _ in range(_STEPS if x.size and np.isfinite(s).all() else 0):
        step = np.where(x + 0.02 * (high - low) <= high, 0.02, -0.02) * (high - low)
        slope = np.stack([(solve(x + d) - s) / d[k] for k, d in enumerate(np.diag(step))], axis=1)
        if not np.isfinite(slope).all():
            break
        tangent = slope
        J = white(tangent)
        H, g = J.T @ J, J.T @ white(problem.residual - s)
        move = np.linalg.solve(H + np.diag(1.0 / spread), g)
        for shrink in (1.0, 0.3):
            new = np.clip(x + shrink * move, low, high)
            trial = solve(new)
            if np.isfinite(trial).all() and misfit(trial) < misfit(s):
                break
        else:
            break
        settled = bool(np.all(np.abs(new - x) < 1e-3 * (high - low)))
        x, s = new, trial
        if settled:
            break
    mixed = [(1.0, x, np.full(x.size, np.inf))]
    if tangent is not None:
        mixed = _by_state(found, best, x, s, tangent, high - low)
    middle, ends = _truncated(mixed, low, high, share)
    trial = solve(middle)
    if np.isfinite(trial).all() and misfit(trial) < misfit(s) + 1.0:
        x = middle
    s = solve(x)
    told = intervals(found, Explanation.of(*best.ids), share) if best.ids else {}
    out: dict[str, dict[str, Size]] = {}
    for k, i in enumerate(best.ids):
        units = {p.name: p.unit for p in type(effect_of(i, settings[k])).parameters}
        # what is not refined is as sure as the grid says it is
        out[i] = {key: _told(told[i].get(key), v, units.get(key, "")) for key, v in settings[k].items()}
    for (k, p), v, a, b in zip(where, x, *ends, strict=True):
        out[best.ids[k]][p.name] = Size(float(v), float(min(a, v)), float(max(b, v)), p.unit)
    final = tuple(dict(q) for q in settings)
    return (Fit(best.ids, final, best.columns, s) if np.isfinite(s).all() else best), out


def _by_state(
    found: Evidence, best: Fit, x: Array, s: Array, tangent: Array, span: Array
) -> list[tuple[float, Array, Array]]:
    """Weight, mean and standard deviation of the parameters under every setting of the covariance, by Laplace at x."""
    what = Explanation.of(*best.ids)
    states = [q for q in found.states if what in q.log_z]
    log_w = np.array([q.log_z[what] + np.log(q.hyper.weight) for q in states])
    extra = form_covariance(found, best, _FORM_SIZE) + _scale(found, best)
    out = []
    for q, w in zip(states, np.exp(log_w - log_w.max()), strict=True):
        if w < _RARE:
            continue
        white = whitener(noise.covariance(found.problem, q.hyper) + extra, found.problem.u)
        J = white(tangent)
        # of the readings alone, but for a prior so wide that it only keeps directions that they do not see finite
        H = J.T @ J + np.diag(0.1 / span**2)
        mean = x + np.linalg.solve(H, J.T @ white(found.problem.residual - s))
        out.append((float(w), mean, np.sqrt(np.diag(np.linalg.inv(H)))))
    return out


def _truncated(
    mixed: Sequence[tuple[float, Array, Array]], low: Array, high: Array, share: float
) -> tuple[Array, tuple[Array, Array]]:
    """Medians and ends of the interval of a mixture of normal distributions that end at physical bounds."""
    if not low.size:
        return low, (low, low)
    grid = np.linspace(0.0, 1.0, 2 * _QUANTILES + 1)[1::2]
    values, weight = [], []
    for w, mean, sigma in mixed:
        sigma = np.clip(sigma, 1e-9 * (high - low), 1e3 * (high - low))
        # further out than this the distribution is an exponential at the bound, and its tail numbers underflow
        mean = np.clip(mean, low - 8.0 * sigma, high + 8.0 * sigma)
        a, b = (low - mean) / sigma, (high - mean) / sigma
        values.append(np.stack([mean + sigma * _quantile(float(q), a, b) for q in grid]))
        weight.append(np.full(grid.size, w))
    x, w = np.concatenate(values), np.concatenate(weight) / np.sum(weight)
    ends = np.empty((3, low.size))
    for k in range(low.size):
        order = np.argsort(x[:, k], kind="stable")
        below = np.cumsum(w[order]) - 0.5 * w[order]
        ends[:, k] = np.interp([0.5, 0.5 - share / 2, 0.5 + share / 2], below, x[order, k])
    return ends[0], (ends[1], ends[2])


def _quantile(q: float, a: Array, b: Array) -> Array:
    """Quantile of the standard normal distribution between a and b, from the side on which its tail is smaller."""
    from scipy.special import log_ndtr, ndtri_exp

    right = a > 0.0  # mirrored, so that the tail that counts is the left one
    low, high, part = np.where(right, -b, a), np.where(right, -a, b), np.where(right, 1.0 - q, q)
    below, above = log_ndtr(low), log_ndtr(high)
    inside = above + np.log1p(-np.exp(below - above))
    x = ndtri_exp(np.minimum(np.logaddexp(below, np.log(part) + inside), 0.0))
    return np.asarray(np.clip(np.where(right, -x, x), a, b))


def _told(grid: Size | None, value: object, unit: str) -> Size:
    """What a fit says of a parameter that it took from the grid."""
    if grid is None or not isinstance(value, (int, float)):
        return Size(value, value, value, unit, None if grid is None else grid.odds)
    return Size(value, min(grid.low, value), max(grid.high, value), unit, grid.odds)


def _ends(found: Evidence, id_: str, p: Parameter) -> tuple[float, float]:
    """Range of a parameter that is physically possible at these points."""
    values = [float(s[p.name]) for s in found.of(id_).settings if p.name in s]
    inside = [max(min(values), p.low), min(max(values), p.high)] if values else [p.low, p.high]
    return (inside[0], inside[1]) if inside[1] > inside[0] else (p.low, p.high)


def form_covariance(found: Evidence, best: Fit, size: float | None = None) -> Array:
    """Covariance of the forms of an explanation and of what lies between settings of the grid, (M, M)."""
    M = found.problem.y.size
    modes = form_modes(found.problem, found.candidates)
    out = np.zeros((M, M))
    for i, c in zip(best.ids, best.columns, strict=True):
        candidate, g = found.of(i), c - found.spans[i].start
        spread = found.states[0].forms[i].size if size is None else size
        shape = spread * candidate.signatures[:, g, None] * modes[i]
        B = np.column_stack([shape, candidate.other_laws(g)])
        out += B @ B.T
    return out


def _scale(found: Evidence, best: Fit) -> Array:
    """Covariance of the scale of each law as far as the modes of its form average out over the readings, (M, M)."""
    M = found.problem.y.size
    modes = form_modes(found.problem, found.candidates)
    out = np.zeros((M, M))
    for i, c in zip(best.ids, best.columns, strict=True):
        s = found.of(i).signatures[:, c - found.spans[i].start]
        weight = (s / found.problem.u) ** 2
        if modes[i].shape[1] and weight.any():
            mean = modes[i].T @ (weight / weight.sum())
            out += _FORM_SIZE**2 * max(1.0 - float(mean @ mean), 0.0) * np.outer(s, s)
    return out


def smooth(found: Evidence, best: Fit) -> Array:
    """What nuisances, the solver's own error and that of the effect's form add to an explanation, posterior mean."""
    problem, hyper = found.problem, found.states[0].hyper
    C = noise.covariance(problem, hyper) + form_covariance(found, best)
    systematic = C - hyper.scale**2 * noise.noise(problem, hyper.ar)
    return np.asarray(systematic @ whitener(C, problem.u).solve(problem.residual - best.signature))


FILE = "interval_scales.json"


def scale_of(effect: str, parameter: str) -> float:
    """Factor on the half-widths of a parameter [1]."""
    own = _scales()["parameters"].get(f"{effect}.{parameter}")
    return float((own or _scales()["kinds"].get(effects.catalogue()[effect].kind, {"scale": 1.0}))["scale"])


@cache
def _scales() -> Mapping[str, Mapping[str, Mapping[str, float]]]:
    return json.loads(resources.files("bemt.judge.diagnose").joinpath(FILE).read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def widened(told: Sizes) -> dict[str, dict[str, Size]]:
    """Parameters of effects with calibrated intervals, within their physical ranges."""
    return {i: {k: _widened(i, k, v) for k, v in numbers.items()} for i, numbers in told.items()}


def _widened(effect: str, name: str, v: Size) -> Size:
    cls = effects.catalogue()[effect]
    p = next((p for p in cls.parameters if p.name == name), None)
    if p is None or name in cls.discrete or not isinstance(v.value, float):
        return v
    s = scale_of(effect, name)
    low, high = v.value - s * (v.value - v.low), v.value + s * (v.high - v.value)
    return replace(v, low=max(low, min(p.low, v.value)), high=min(high, max(p.high, v.value)))
