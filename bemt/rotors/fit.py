"""The population fitted by maximum likelihood to measured propellers, through the solver's own sensitivities.

Points are averaged in bins of (static or J/J0, Re), so that a long line counts no more than a short one.  The logarithm
of the likelihood of a rotor is that of a mixture of normal laws over the sizes of its latent numbers; the gradient is
analytic in every covariance and by differences in the few numbers that make them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bemt.rotors.conditioning import condition
from bemt.rotors.latents import NAMES, Prior, Sensed
from bemt.rotors.population import WEIGHTS, Population, sizes

Array = NDArray[np.float64]

J_BINS = (0.3, 0.45, 0.6, 0.7)
"""Edges of the bins in J/J0 [1]."""
STATIC_BINS = 3


@dataclass(frozen=True, eq=False)
class MeasuredRotor(Sensed):
    """One measured propeller beside the solver, P rows of points or bins; ``y`` (2, P) are CT and CP measured [1]."""

    name: str
    family: str
    section: str
    gap_deg: float
    static: NDArray[np.bool_]
    y: Array
    chord: float = math.nan  # At 0.75 R over the radius [1]


def binned(m: MeasuredRotor) -> MeasuredRotor:
    """Averages over bins of (static or J/J0, Re)."""
    key = np.full(m.x.size, -1)
    rest = np.flatnonzero(m.static)
    for i, part in enumerate(np.array_split(rest[np.argsort(m.Re[rest])], min(STATIC_BINS, max(rest.size, 1)))):
        key[part] = i
    fast = np.flatnonzero(~m.static)
    if fast.size:
        key[fast] = 10 + 2 * np.digitize(m.x[fast], J_BINS) + (m.Re[fast] > np.median(m.Re[fast]))
    groups = np.unique(key)

    def mean(a: Array) -> Array:
        return np.stack([a[..., key == k].mean(axis=-1) for k in groups], axis=-1)

    return replace(
        m, static=np.array([bool(m.static[key == k][0]) for k in groups]), x=mean(m.x),
        Re=np.exp(mean(np.log(m.Re))), y=mean(m.y), f=mean(m.f), top=mean(m.top), T=mean(m.T),
    )  # fmt: skip


MARGINAL = 0.5
"""Weight of single rows beside the rotor as a whole in the likelihood (composite likelihood, Varin, Reid and Firth,
Statistica Sinica 21, 2011, not checked): the whole tells the correlations, single rows how wide an interval is [1]."""

# The latent numbers have expectation zero: the section rule was calibrated to have no bias at rest, and free means
# make families left out worse (static CT 5.2 to 5.8 %, CP 7.6 to 7.8 in the median).  What the solver lacks is `bias`:
# the hub's drag starts at a bluff body's (0.8 to 1.1: Hoerner 1965, Fluid-Dynamic Drag, ch. 3, not checked).  Drag over
# chord starts at what thickness over chord (APC's PE0 files) and drag over thickness (the section tables) make of it.
# Numbers of the search: name, start, centre and width of the prior that keeps what the data do not know.  The widths of
# stations, label and families are narrow: measured propellers tell the sum of their variances, not its parts; optical
# stations are off by about a degree (blades turned to their measured zero-thrust J scatter by 0.7 to 1.5).  The growth
# of all widths below 7 in starts at 0.6: volume 1 has no such propellers, and of the centres 0.3, 0.6 and 0.8 it
# predicts volume 2 best.  Chosen by the mean log score a point over families left out (in six groups), volume 2 by 1
# and 1 by 2: centres 0.744, 0.751, 0.751; bias x^4 and x^2 in CT and CP 0.746, hub and lift over Re 0.768; weight of
# single rows 0.15, 0.5, 1: 0.722, 0.744, 0.743; small from 9 in on 0.748; free widths of stations and labels 0.723.
_FREE: tuple[tuple[str, float, float, float], ...] = (
    ("ln_angle", math.log(0.4), math.log(0.4), 0.5), ("ln_lift", math.log(0.06), math.log(0.06), 0.5),
    ("ln_drag", math.log(0.15), math.log(0.15), 0.5), ("ln_low", math.log(0.05), math.log(0.05), 0.5),
    ("c_lift_angle", 0.0, 0.0, 1.0), ("c_drag_angle", 0.0, 0.0, 1.0), ("c_drag_lift", 0.0, 0.0, 1.0),
    ("ln_stations", math.log(0.7), math.log(0.7), 0.05), ("ln_label", math.log(0.8), math.log(0.8), 0.05),
    ("ln_family", 0.0, 0.0, 0.05), ("offset", 0.7, 0.7, 0.15),
    ("small", 0.6, 0.6, 0.2), ("ln_rest_CT", math.log(0.04), math.log(0.04), 0.5),
    ("ln_rest_CP", math.log(0.05), math.log(0.05), 0.5), ("rest_small", 0.6, 0.6, 0.2),
    ("rest_share", 0.5, 0.5, 0.3),
    ("ln_length_J", math.log(0.4), math.log(0.4), 0.4), ("ln_length_Re", math.log(0.7), math.log(0.7), 0.4),
    ("ln_reach", math.log(0.3), math.log(0.3), 0.3),
    ("rho", 0.3, 0.3, 1.0), ("ln_noise", math.log(0.012), math.log(0.012), 0.15),
    ("hub_cd", 0.8, 0.8, 0.4), ("lift_Re", 0.0, 0.0, 0.1), ("drag_chord", -0.3, -0.3, 0.3),
    ("ln_nu", math.log(4.0), math.log(4.0), 0.4),
    ("ln_nu_rest", math.log(4.0), math.log(4.0), 0.4),
)  # fmt: skip
_NAMES = tuple(f[0] for f in _FREE)
START, _CENTRE, _WIDTH = (np.array([f[i] for f in _FREE]) for i in (1, 2, 3))
_REST = tuple(range(_NAMES.index("ln_rest_CT"), _NAMES.index("ln_noise") + 1))
_NU, _NU_REST = _NAMES.index("ln_nu"), _NAMES.index("ln_nu_rest")
_PAIRS = np.outer(WEIGHTS, WEIGHTS).reshape(-1)
_BIAS = tuple(_NAMES.index(n) for n in ("hub_cd", "lift_Re"))
_STEP = 1e-5
# The label's gap to the stations is heavy-tailed within families: degrees of freedom of its Student law.
_GAP_NU = 4.0


def _population(theta: Array) -> Population:
    """Population of the search's numbers."""
    d = dict(zip(_NAMES, theta.tolist(), strict=True))
    K = len(NAMES)
    L = np.eye(4)
    L[1, 0], L[2, 0], L[2, 1] = d["c_lift_angle"], d["c_drag_angle"], d["c_drag_lift"]
    sd = np.exp([d["ln_angle"], d["ln_lift"], d["ln_drag"], d["ln_low"]])
    L = L / np.sqrt((L**2).sum(axis=1))[:, None] * sd[:, None]
    cov = np.zeros((K, K))
    cov[:4, :4] = L @ L.T
    return Population(
        mean=np.zeros(K), cov=cov, stations_deg=math.exp(d["ln_stations"]), label_deg=math.exp(d["ln_label"]),
        family_deg=math.exp(d["ln_family"]), offset_deg=d["offset"], small=d["small"],
        rest_CT=math.exp(d["ln_rest_CT"]),
        rest_CP=math.exp(d["ln_rest_CP"]), rest_small=d["rest_small"], rest_share=d["rest_share"],
        length_J=math.exp(d["ln_length_J"]), length_ln_Re=math.exp(d["ln_length_Re"]), reach=math.exp(d["ln_reach"]),
        hub_cd=d["hub_cd"], lift_Re=d["lift_Re"], drag_chord=d["drag_chord"],
        rest_correlation=math.tanh(d["rho"]), noise=math.exp(d["ln_noise"]), nu=math.exp(d["ln_nu"]),
        nu_rest=math.exp(d["ln_nu_rest"]),
    )  # fmt: skip


def law(p: Population, m: MeasuredRotor) -> Prior:
    """What is known of a propeller before it is measured, stations given."""
    return p.prior("stations", m.diameter_m, m.gap_deg, m.family, m.section, chord=m.chord)


def _noise(p: Population, m: MeasuredRotor) -> Array:
    """Covariance without the latent numbers, over the coefficients at rest."""
    both = np.outer(np.abs(m.top).reshape(-1), np.abs(m.top).reshape(-1))
    K = p.rest(m.diameter_m, m.x, m.Re, m.f, m.top)
    return np.asarray((K + np.diag(p.noise_sd(m.f, m.top).reshape(-1) ** 2)) / both)


def _gaps(p: Population, rotors: Sequence[MeasuredRotor]) -> float:
    """Logarithm of the probability of the labels' gaps, families together, Student's t."""
    families: dict[str, list[MeasuredRotor]] = {}
    for m in rotors:
        if math.isfinite(m.gap_deg):
            families.setdefault(m.family, []).append(m)
    total = 0.0
    for members in families.values():
        own = np.array([(p.stations_deg * p.growth(m.diameter_m)) ** 2 for m in members])
        C = p.family_deg**2 + np.diag(own + p.label_deg**2)
        d = np.array([m.gap_deg for m in members]) - p.offset_deg
        n = d.size
        total -= 0.5 * (_GAP_NU + n) * math.log1p(d @ np.linalg.solve(C, d) / _GAP_NU) + 0.5 * np.linalg.slogdet(C)[1]
    return float(total)


def _rotor(m: MeasuredRotor, mean: Array, cov: Array, noise: Array, bias: Array, s2: Array, t2: Array) -> _Slopes:
    """Log-likelihood of one rotor and its slopes; s2, t2 the squared sizes of latent numbers and rest, all pairs."""
    top = np.abs(m.top).reshape(-1)
    T = np.moveaxis(m.T, 1, 2).reshape(top.size, -1) / top[:, None]
    r = (m.y - m.f - bias).reshape(-1) / top - T @ mean
    L = np.linalg.cholesky(noise)
    Li = np.linalg.inv(L)
    A = Li @ T
    values, U = np.linalg.eigh(A @ cov @ A.T)
    values = np.maximum(values, 0.0)
    W = Li.T @ U
    seen = W.T @ r
    inner = s2[:, None] * values + t2[:, None]
    log_p = -0.5 * (seen**2 / inner).sum(axis=1) - 0.5 * np.log(inner).sum(axis=1) + np.log(_PAIRS)
    best = log_p.max()
    share = np.exp(log_p - best)
    total = best + math.log(share.sum()) - np.log(np.diag(L)).sum()
    share = share / share.sum()
    # d log p / d S in the eigenbasis: (alpha alpha^T - S^-1) / 2
    alpha = seen / inner
    middle_N = 0.5 * (np.einsum("s,si,sj->ij", share * t2, alpha, alpha) - np.diag((share * t2) @ (1.0 / inner)))
    middle_A = 0.5 * (np.einsum("s,si,sj->ij", share * s2, alpha, alpha) - np.diag((share * s2) @ (1.0 / inner)))
    TW = T.T @ W
    d_r = W @ (share @ alpha)
    d_cov = TW @ middle_A @ TW.T
    d_noise = W @ middle_N @ W.T
    change = 0.5 * (alpha**2 - 1.0 / inner)
    d_s2, d_t2 = share * (change * values).sum(axis=1), share * change.sum(axis=1)
    # each row by itself: what an interval at one point must hold
    a, n = np.einsum("ij,jk,ik->i", T, cov, T), np.diag(noise)
    var = np.outer(s2, a) + np.outer(t2, n)
    logs = -0.5 * r**2 / var - 0.5 * np.log(var) + np.log(_PAIRS)[:, None]
    top_log = logs.max(axis=0)
    part = np.exp(logs - top_log)
    alone = float((top_log + np.log(part.sum(axis=0))).sum())
    part = part / part.sum(axis=0)
    slope = 0.5 * part * (r**2 / var**2 - 1.0 / var)
    d_r = d_r + MARGINAL * (part / var).sum(axis=0) * r
    d_cov = d_cov + MARGINAL * T.T @ ((s2 @ slope)[:, None] * T)
    d_noise = d_noise + MARGINAL * np.diag(t2 @ slope)
    d_s2, d_t2 = d_s2 + MARGINAL * slope @ a, d_t2 + MARGINAL * slope @ n
    return _Slopes(float(total) + MARGINAL * alone, T.T @ d_r, d_cov, d_noise, d_r, d_s2, d_t2)


class _Slopes(NamedTuple):
    """Log-likelihood of a rotor and its slopes."""

    value: float
    mean: Array
    cov: Array
    noise: Array
    readings: Array
    s2: Array
    t2: Array


def _pairs(p: Population) -> tuple[Array, Array]:
    """Squared sizes of latent numbers and rest, all pairs."""
    s2, t2 = np.meshgrid(sizes(p.nu) ** 2, p.rest_sizes**2, indexing="ij")
    return s2.reshape(-1), t2.reshape(-1)


def objective(theta: Array, rotors: Sequence[MeasuredRotor]) -> tuple[float, Array]:
    """Negative log-likelihood with priors, and its gradient."""
    p = _population(theta)
    steps = [_population(theta + _STEP * e) for e in np.eye(theta.size)]
    s2, t2 = _pairs(p)
    ds2, dt2 = (_pairs(steps[_NU])[0] - s2) / _STEP, (_pairs(steps[_NU_REST])[1] - t2) / _STEP
    total = -_gaps(p, rotors)
    gradient = np.array([-(_gaps(q, rotors) + total) / _STEP if i in _GAPS else 0.0 for i, q in enumerate(steps)])
    for m in rotors:
        prior = law(p, m)
        noise, bias = _noise(p, m), p.bias(m)
        g = _rotor(m, prior.mean, prior.cov, noise, bias, s2, t2)
        total -= g.value
        for i, q in enumerate(steps):
            if i in _BIAS:
                change = (bias - q.bias(m)) / np.abs(m.top)
                gradient[i] += float(g.readings @ change.reshape(-1)) / _STEP
            elif i in _REST:
                gradient[i] -= float((g.noise * (_noise(q, m) - noise)).sum()) / _STEP
            elif i not in (_NU, _NU_REST):
                other = law(q, m)
                change = g.mean @ (other.mean - prior.mean) + float((g.cov * (other.cov - prior.cov)).sum())
                gradient[i] -= change / _STEP
        gradient[_NU] -= float(g.s2 @ ds2)
        gradient[_NU_REST] -= float(g.t2 @ dt2)
    away = (theta - _CENTRE) / _WIDTH
    return float(total + 0.5 * away @ away), gradient + away / _WIDTH


_GAPS = tuple(_NAMES.index(n) for n in ("ln_stations", "ln_label", "ln_family", "offset", "small"))


def fit(
    rotors: Sequence[MeasuredRotor],
    start: Array | None = None,
    most: int = 80,
    provenance: Mapping[str, Any] | None = None,
) -> tuple[Population, Array]:
    """Fit a population; gives it with its parameters, (P,)."""
    from scipy.optimize import minimize

    rows = [binned(m) for m in rotors]
    found = minimize(
        objective, START if start is None else start, args=(rows,), jac=True, method="L-BFGS-B",
        options={"maxiter": most, "ftol": 1e-7},
    )  # fmt: skip
    p = _population(found.x)
    return replace(p, offsets=offsets(p, rows), provenance=dict(provenance or {})), np.asarray(found.x)


def offsets(p: Population, rows: Sequence[MeasuredRotor]) -> dict[str, tuple[float, float]]:
    """Offset over the label usual for each family at hand and its standard deviation [deg]: the blades as measured."""
    seen: dict[str, list[tuple[float, float]]] = {}
    i = NAMES.index("angle_deg")
    for m in rows:
        if not math.isfinite(m.gap_deg):
            continue
        # blade angle from its performance, no label: the stations' part of the posterior shift of the angle
        own = (p.stations_deg * p.growth(m.diameter_m)) ** 2
        free = p.prior("stations", m.diameter_m, section=m.section, chord=m.chord)
        mean, cov = posterior(p, m, free.mean, free.cov)
        part = own / free.cov[i, i]
        shift = part * (mean[i] - free.mean[i])
        variance = part**2 * cov[i, i] + own * (1.0 - part) + p.label_deg**2
        seen.setdefault(m.family, []).append((m.gap_deg + shift, variance))
    out = {}
    for family, members in sorted(seen.items()):
        d, v = np.array(members).T
        weight = 1.0 / p.family_deg**2 + (1.0 / v).sum()
        out[family] = (float((p.offset_deg / p.family_deg**2 + (d / v).sum()) / weight), float(weight**-0.5))
    return out


def posterior(p: Population, m: MeasuredRotor, mean: Array, cov: Array) -> tuple[Array, Array]:
    """Mean and covariance of the latent numbers of a measured rotor, solver taken as linear."""
    top = np.abs(m.top).reshape(-1)
    T = np.moveaxis(m.T, 1, 2).reshape(top.size, -1) / top[:, None]
    readings = (m.y - m.f - p.bias(m)).reshape(-1) / top
    prior = Prior(mean, cov, sizes(p.nu), WEIGHTS)
    found = condition(lambda z: T @ z, prior, readings, _noise(p, m), p.rest_sizes, WEIGHTS, most=1)
    return found.mean, found.cov
