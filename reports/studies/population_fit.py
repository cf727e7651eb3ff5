"""The population fitted by maximum likelihood to measured propellers, through the solver's own slopes.

Each rotor counts by a few single readings, so that a long line counts no more than a short one, and each family as
much as any other, since its rotors are alike. The likelihood of a rotor is that of a mixture of normal laws over the
sizes of latent numbers and rest. All rotors are evaluated at once, so that
differences are gradient enough.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.rotors.latents import NAMES, Sensed
from bemt.rotors.population import SHARED, WEIGHTS, Family, Population, bias_columns, sizes
from bemt.rotors.validate.points import ComparedRotor, law

Array = NDArray[np.float64]

STATIC, FORWARD = 4, 10
"""Readings of each kind that a rotor counts by, spread evenly over its points [1]."""
MARGINAL = 0.5
"""Weight of single rows beside the rotor as a whole in the likelihood (composite likelihood, Varin, Reid and Firth,
Statistica Sinica 21, 2011, not checked): the whole tells the correlations, single rows how wide an interval is [1]."""

# Numbers of the search: attribute of the population, how the search counts it, and the prior that keeps what the data
# do not know: centre and width, the width in the search's own count.  Widths of label and families are narrow: measured
# propellers tell the sum of their variances, not its parts; optical stations are off by about a degree (blades
# turned to their measured zero-thrust J scatter by 0.7 to 1.5).  The hub's drag starts at a bluff body's (0.8 to 1.1:
# Hoerner 1965, Fluid-Dynamic Drag, ch. 3, not checked).  Hover: moulded blades jump between hover and flight, of which
# most rotors show little; centres of 1 and 2 % left flight falsely sure after a static run.  With 4 and 5 % the mean
# log score of families left out goes from 0.321 to 0.322, after a static run and one flight point from 1.48 to 1.49.
_FREE: tuple[tuple[str, str, float, float], ...] = (
    ("stations_deg", "ln", 0.7, 0.3), ("label_deg", "ln", 0.8, 0.1), ("family_deg", "ln", 1.0, 0.1),
    ("offset_deg", "", 0.7, 0.15), ("lift", "ln", 0.03, 0.5), ("drag", "ln", 0.1, 0.3), ("camber_deg", "ln", 0.3, 0.3),
    ("unknown_drag", "ln", 0.15, 0.5), ("unknown_camber_deg", "ln", 1.0, 0.5), ("camber_drag", "tanh", 0.0, 1.0),
    ("slow_flyer_deg", "", 1.5, 1.5),
    ("nu", "ln", 3.0, 0.15), ("nu_rest", "ln", 4.0, 0.4),
    ("hub_cd", "", 0.8, 0.4), ("lift_Re", "", 0.0, 0.1),
    ("rest_small", "", 0.5, 0.2), ("local_camber_deg", "ln", 0.5, 0.5), ("local_drag", "ln", 0.15, 0.5),
    ("local_correlation", "tanh", -0.4, 0.5), ("local_deg", "ln", 3.5, 0.4), ("local_ln_Re", "ln", 1.0, 0.5),
    ("rest_CT", "ln", 0.03, 0.5), ("rest_CP", "ln", 0.045, 0.5), ("rest_correlation", "tanh", 0.3, 1.0),
    ("rest_deg", "ln", 4.0, 0.4), ("rest_ln_Re", "ln", 0.7, 0.4), ("rest_share", "", 0.3, 0.3),
    ("reach", "ln", 0.5, 0.4), ("hover_CT", "ln", 0.04, 0.1), ("hover_CP", "ln", 0.05, 0.1),
    ("noise", "ln", 0.008, 0.3),
)  # fmt: skip
_FIELDS = tuple(row[0] for row in _FREE)
_REST = slice(_FIELDS.index("rest_small"), len(_FIELDS))
_TO = {"ln": math.log, "tanh": math.atanh, "": float}
_FROM = {"ln": math.exp, "tanh": math.tanh, "": float}
START = np.array([_TO[row[1]](row[2]) for row in _FREE])
_WIDTH = np.array([row[3] for row in _FREE])
_STEP = 1e-5
# The label's gap to the stations is heavy-tailed within families: degrees of freedom of its Student law.
_GAP_NU = 4.0


def counted(m: ComparedRotor) -> NDArray[np.intp]:
    """Readings that a rotor counts by."""
    chosen = []
    for kind, order, most in ((m.static, m.Re, STATIC), (~m.static, None, FORWARD)):
        rows = np.flatnonzero(kind)
        rows = rows if order is None else rows[np.argsort(order[rows])]
        if rows.size:
            chosen.append(rows[np.unique(np.linspace(0, rows.size - 1, min(most, rows.size)).round().astype(int))])
    return np.concatenate(chosen)


class Rotors:
    """The readings of many rotors, padded to one number of points P: (R, ...)."""

    def __init__(self, rotors: Sequence[ComparedRotor]) -> None:
        self.rotors = tuple(rotors)
        chosen = [counted(m) for m in rotors]
        P = max(c.size for c in chosen)

        def stacked(values: Sequence[Array], fill: float) -> Array:
            out = np.full((len(values), *values[0].shape[:-1], P), fill)
            for row, value in zip(out, values, strict=True):
                row[..., : value.shape[-1]] = value
            return out

        parts = [m.part(c) for m, c in zip(rotors, chosen, strict=True)]
        D = np.array([m.diameter_m for m in rotors])
        columns = (stacked([getattr(q, f.name) for q in parts], 1.0) for f in fields(Sensed)[1:])
        self.at = Sensed(D, *columns)  # type: ignore[arg-type]
        y = stacked([m.y[:, c] for m, c in zip(rotors, chosen, strict=True)], 1.0)
        self.real = np.repeat(np.arange(P) < np.array([c.size for c in chosen])[:, None], 2, axis=0)
        self.real = self.real.reshape(len(parts), 2 * P)
        self.top = np.abs(self.at.top).reshape(len(parts), -1)
        slopes = np.moveaxis(self.at.T, 2, 3).reshape(*self.top.shape, -1)
        bias = [c.reshape(self.top.shape) for c in bias_columns(self.at)]
        sides = np.stack([(y - self.at.f).reshape(self.top.shape), *bias], axis=-1)
        # slopes, readings less the solver, columns of the bias, all over the coefficients at rest: (R, 2 P, K + 3)
        self.columns = np.concatenate([slopes, sides], axis=-1) / self.top[..., None] * self.real[..., None]
        families = [m.family for m in rotors]
        weight = np.array([1.0 / families.count(f) for f in families])
        self.weight = weight / weight.mean()
        self._kept: tuple[bytes, tuple[Array, Array, Array]] = (b"", (np.empty(0),) * 3)

    def whitened(self, p: Population, key: bytes = b"") -> tuple[Array, Array, Array]:
        """Columns in units of rest and noise, their log-determinant by rotor, the variance of each row."""
        if key and key == self._kept[0]:
            return self._kept[1]
        P = self.at.J.shape[-1]
        N = p.rest(self.at)
        N[:, np.arange(2 * P), np.arange(2 * P)] += p.noise_sd(self.at).reshape(-1, 2 * P) ** 2
        N /= self.top[:, :, None] * self.top[:, None, :]
        N = np.where(self.real[:, :, None] & self.real[:, None, :], N, np.eye(2 * P))
        L = np.linalg.cholesky(N)
        found = np.linalg.solve(L, self.columns), np.log(np.einsum("rii->ri", L)).sum(axis=1), np.einsum("rii->ri", N)
        self._kept = (key, found)
        return found

    def latent(self, p: Population) -> tuple[Array, Array]:
        """Means and covariances of the latent numbers, (R, K) and (R, K, K)."""
        laws = [law(p, m) for m in self.rotors]
        return np.array([q.mean for q in laws]), np.array([q.cov for q in laws])

    def residual(self, p: Population, columns: Array, mean: Array) -> Array:
        """Readings less their expectation, (R, 2 P)."""
        K = len(NAMES)
        r = columns[..., K] - p.hub_cd * columns[..., K + 1] - p.lift_Re * columns[..., K + 2]
        return np.asarray(r - np.einsum("rpk,rk->rp", columns[..., :K], mean))

    def log_likelihood(self, p: Population, key: bytes = b"") -> Array:
        """Logarithm of the composite likelihood of each rotor, (R,)."""
        K = len(NAMES)
        white, logdet, N = self.whitened(p, key)
        mean, cov = self.latent(p)
        s2, t2, log_w = _pairs(p)
        values, directions = np.linalg.eigh(cov)
        root = directions * np.sqrt(np.maximum(values, 0.0))[:, None, :]
        r, A = self.residual(p, white, mean), white[..., :K] @ root
        gain, U = np.linalg.eigh(np.swapaxes(A, 1, 2) @ A)
        seen = np.einsum("rkj,rpk,rp->rj", U, A, r) ** 2
        q = (s2 / t2)[:, None] * np.maximum(gain, 0.0)[:, None, :]  # (R, S, K)
        left = (r**2).sum(axis=1)[:, None] - ((s2 / t2)[:, None] * seen[:, None, :] / (1.0 + q)).sum(axis=-1)
        n = self.real.sum(axis=1)[:, None]
        logs = log_w - 0.5 * (np.log1p(q).sum(axis=-1) + n * np.log(t2) + left / t2)
        whole = _logsumexp(logs) - logdet
        # each row by itself: what an interval at one point must hold
        T = self.columns[..., :K]
        var = np.einsum("rpk,rkl,rpl->rp", T, cov, T)[..., None] * s2 + N[..., None] * t2
        alone = log_w - 0.5 * (np.log(var) + self.residual(p, self.columns, mean)[..., None] ** 2 / var)
        return np.asarray(whole + MARGINAL * np.where(self.real, _logsumexp(alone), 0.0).sum(axis=1))


def _logsumexp(logs: Array) -> Array:
    top = logs.max(axis=-1, keepdims=True)
    return np.asarray(top[..., 0] + np.log(np.exp(logs - top).sum(axis=-1)))


def _pairs(p: Population) -> tuple[Array, Array, Array]:
    """Squared sizes of latent numbers and rest, all pairs, and the logarithms of their probabilities."""
    s2, t2 = np.meshgrid(sizes(p.nu) ** 2, p.rest_sizes**2, indexing="ij")
    return s2.reshape(-1), t2.reshape(-1), np.log(np.outer(WEIGHTS, WEIGHTS)).reshape(-1)


def _population(theta: Array) -> Population:
    """Population of the search's numbers."""
    found: dict[str, Any] = {row[0]: _FROM[row[1]](x) for row, x in zip(_FREE, theta.tolist(), strict=True)}
    return Population(**found)


def _gaps(p: Population, rotors: Sequence[ComparedRotor]) -> float:
    """Logarithm of the probability of the labels' gaps, families together, Student's t."""
    families: dict[str, list[float]] = {}
    for m in rotors:
        if math.isfinite(m.gap_deg) and m.known_from == "stations":
            families.setdefault(m.family, []).append(m.gap_deg)
    total = 0.0
    for gaps in families.values():
        d, n = np.array(gaps) - p.offset_deg, len(gaps)
        C = p.family_deg**2 + (p.stations_deg**2 + p.label_deg**2) * np.eye(n)
        total -= 0.5 * (_GAP_NU + n) * math.log1p(d @ np.linalg.solve(C, d) / _GAP_NU) + 0.5 * np.linalg.slogdet(C)[1]
    return float(total)


def objective(theta: Array, rows: Rotors) -> float:
    """Negative log-likelihood with the priors of the search's numbers."""
    p = _population(theta)
    away = (theta - START) / _WIDTH
    return float(
        0.5 * away @ away - _gaps(p, rows.rotors) - rows.weight @ rows.log_likelihood(p, theta[_REST].tobytes())
    )


def fit(
    rotors: Sequence[ComparedRotor],
    start: Array | None = None,
    most: int = 40,
    provenance: Mapping[str, Any] | None = None,
) -> tuple[Population, Array]:
    """Fit a population; gives it with its parameters, (P,)."""
    from scipy.optimize import minimize

    rows = Rotors(rotors)

    def value(away: Array) -> float:
        return objective(START + _WIDTH * away, rows)

    def slopes(away: Array) -> tuple[float, Array]:
        here = value(away)
        # those of the rest last: the whitened rows of all others are kept
        steps = _STEP * np.eye(away.size)
        return here, np.array([(value(away + step) - here) / _STEP for step in steps])

    begin = np.zeros(START.size) if start is None else (start - START) / _WIDTH
    found = minimize(slopes, begin, jac=True, method="L-BFGS-B", options={"maxiter": most, "ftol": 1e-7})
    theta = START + _WIDTH * found.x
    return replace(with_families(_population(theta), rows), provenance=dict(provenance or {})), theta


def _told(p: Population, rows: Rotors) -> list[tuple[Array, Array, float]]:
    """What the readings of each rotor tell of `SHARED`: precision, (3, 3), precision times value, size of the rotor."""
    K, mine = len(NAMES), [NAMES.index(n) for n in SHARED]
    white, _, _ = rows.whitened(p)
    _, t2, log_w = _pairs(p)
    out = []
    mean, cov = rows.latent(p)
    for w, real, z, C in zip(white, rows.real, mean, cov, strict=True):
        r, T = w[:, K] - p.hub_cd * w[:, K + 1] - p.lift_Re * w[:, K + 2], w[:, :K]
        s2 = _pairs(p)[0]
        logs = []
        for a, b in zip(s2, t2, strict=True):
            S = a * T @ C @ T.T + b * np.eye(r.size)
            left = r - T @ z
            logs.append(
                -0.5 * (left @ np.linalg.solve(S, left) + np.linalg.slogdet(S)[1] - (~real).sum() * math.log(b))
            )
        chance = np.exp(np.array(logs) + log_w - max(np.array(logs) + log_w))
        chance /= chance.sum()
        rough, size = float(chance @ t2), float(chance @ s2)
        others = [k for k in range(K) if k not in mine]
        S = rough * np.eye(r.size) + T[:, others] @ (size * C[np.ix_(others, others)]) @ T[:, others].T
        G = np.linalg.solve(S, T[:, mine])
        out.append((G.T @ T[:, mine], G.T @ r, max(size, 1.0)))
    return out


def with_families(p: Population, rows: Rotors) -> Population:
    """Population with the share of the spread between families, and what each family at hand has in common.

    Random effects: a rotor's `SHARED` numbers are the usual ones, a shift of its family and one of its own.
    The shares are the likeliest of a grid; the family's shift is shrunk towards none accordingly.
    """
    told = _told(p, rows)
    mine = [NAMES.index(n) for n in SHARED]
    groups: dict[str, list[tuple[Array, Array, Array, Array]]] = {}
    for m, (precision, value, size) in zip(rows.rotors, told, strict=True):
        prior = replace(p, families={}).prior(
            m.known_from, m.diameter_m, math.nan, None, m.section, blade_class=m.blade_class
        )
        mean, cov = prior.mean[mine], prior.cov[np.ix_(mine, mine)]
        groups.setdefault(m.family, []).append((precision, value - precision @ mean, cov, size * np.ones(1)))

    def family(members: Sequence[tuple[Array, Array, Array, Array]], share: Array) -> tuple[float, Array, Array]:
        """Logarithm of the evidence, mean and covariance of the family's shift."""
        eye, own, common = np.eye(3), np.sqrt(1.0 - share), np.sqrt(share)
        F = np.median([c for _, _, c, _ in members], axis=0) * np.outer(common, common)
        P, h, log = np.zeros((3, 3)), np.zeros(3), 0.0
        for precision, value, cov, size in members:
            E = cov * np.outer(own, own) * size
            inner = np.linalg.inv(eye + precision @ E)
            P, h = P + inner @ precision, h + inner @ value
            log += 0.5 * value @ E @ inner @ value + 0.5 * np.linalg.slogdet(inner)[1]
        after = np.linalg.inv(eye + F @ P) @ F
        return float(log + 0.5 * h @ after @ h - 0.5 * np.linalg.slogdet(eye + F @ P)[1]), after @ h, after

    grid = np.linspace(0.05, 0.95, 10)
    share = np.full(3, 0.5)
    for _ in range(3):
        for k in range(3):
            tried = [np.where(np.arange(3) == k, g, share) for g in grid]
            share = tried[int(np.argmax([sum(family(ms, s)[0] for ms in groups.values()) for s in tried]))]
    families = {}
    for name, members in sorted(groups.items()):
        _, mean, cov = family(members, share)
        families[name] = Family(*_offset(p, rows, name, mean, cov), mean, cov)
    return replace(p, between=tuple(float(s) for s in share), families=families)


def _offset(p: Population, rows: Rotors, name: str, mean: Array, cov: Array) -> tuple[float, float]:
    """Blade angle over the label usual for a family, and its standard deviation [deg]: the blades as measured."""
    gaps = np.array([m.gap_deg for m in rows.rotors if m.family == name and math.isfinite(m.gap_deg)])
    own = p.label_deg**2 + (1.0 - p.between[0]) * p.stations_deg**2
    weight = 1.0 / p.family_deg**2 + gaps.size / (own + gaps.size * cov[0, 0])
    level = p.offset_deg / p.family_deg**2 + (gaps + mean[0]).sum() / (own + gaps.size * cov[0, 0])
    return float(level / weight), float(weight**-0.5)
