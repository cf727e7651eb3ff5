"""The rotor of a reference: its blade as built, found on the real solver and kept in the baseline.

y = f(c) + T (z - c), c the calibrated rotor, T its tangents there.  The prior stays at the case: residuals refer to
f(c) - T (c - mean of the prior), signatures of effects to f(c) itself, and nothing counts twice (`bemt.rotors`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.gaussian.whitening import log_density
from bemt.judge.diagnose import noise
from bemt.judge.diagnose.record import CHANNELS
from bemt.rotors.case.as_built import known_from
from bemt.rotors.conditioning import condition, tangents
from bemt.rotors.latents import NAMES, UNITS, AsBuilt, Prior

if TYPE_CHECKING:
    from bemt.judge.diagnose.problem import Problem
    from bemt.physics.effects.base import Effect, RotorBuild
    from bemt.rotors.case import Case

# Standard deviations without a reference, in the order of NAMES: angle [deg], lift, drag [1], camber [deg].  Working
# calibrations; a wide blade without a reference would swallow slips of speed and unit.
AS_BUILT = (0.3, 0.03, 0.10, 0.0)
# With a reference, by how the blade is known.  One degree and more between published stations and blades (zero-thrust
# advance ratios of UIUC volumes 1 and 2); a label leaves the section and the law of the blade angle open as well.
_SD = {
    "cad": (0.1, 0.02, 0.05, 0.1), "scan": (0.5, 0.05, 0.12, 0.5), "stations": (1.0, 0.06, 0.15, 0.7),
    "label": (4.0, 0.08, 0.15, 1.0), "reference": (0.3, 0.03, 0.10, 0.3),
}  # fmt: skip
LABELLED = _SD["label"]
"""Standard deviations of a blade of which a label is all that is known, in the order and units of `NAMES`."""
# Heavy tail: factors on all of them, with their probabilities.
_SIZES, _WEIGHTS = (0.8, 1.2, 2.2), (0.5, 0.4, 0.1)
# Blade angles within which a pitch means something [rad].
_FLAT, _STEEP = 0.02, 1.45
FARTHEST_DEG = 11.0
"""A blade that a reference turns further than this is another rotor, or the recording is wrong [deg]."""
# With more error of the solver than this it would take what belongs to the blade; every reading has this noise more,
# shares of the largest coefficient, so that no detail of a curve drives the blade anywhere.
_SMALL, _ROUGH = 0.03, 0.01
# Loads that a blade is sought on.
_FEWEST_LOADS = 3
# Rounds of choosing covariance and point.
_ROUNDS = 3
_WORTH_SAYING = 0.5


@dataclass(frozen=True)
class AsLabelled(AsBuilt):
    """Rotor whose pitch is what the label may have wrong: the angle holds at 0.75 R, the twist is that of the pitch."""

    def blade(self, bake: RotorBuild) -> None:
        """Change the pitch, beta = atan(pitch / (2 pi r)) at every station."""
        at75 = float(np.interp(0.75 * bake.R, bake.r, bake.beta))
        steeper = math.tan(np.clip(at75 + math.radians(self.angle_deg), _FLAT, _STEEP)) / math.tan(max(at75, _FLAT))
        lawful = np.clip(bake.beta, _FLAT, _STEEP)
        bake.beta = bake.beta + np.arctan(steeper * np.tan(lawful)) - lawful


@dataclass(frozen=True, eq=False)
class CalibratedBlade:
    """What is believed of the rotor's blade."""

    at: Array  # (K,) Point of the tangents, in the order and units of `NAMES`
    mean: Array  # (K,) Centre of the prior, in the units of `NAMES`
    # (K, K) Square root of the prior's covariance: its columns are one standard deviation each, in the units of `NAMES`
    root: Array
    kind: type[AsBuilt] = AsBuilt  # What an angle means: a turn, or another pitch
    # Median of each load of the reference over that of the case as stated, less 1 [1]
    moved: Mapping[str, float] = field(default_factory=dict)

    @property
    def effect(self) -> AsBuilt:
        """Blade at the point of the tangents."""
        return self.kind(*map(float, self.at))

    @property
    def used(self) -> NDArray[np.intp]:
        """Latent numbers that are not certain."""
        return np.flatnonzero(np.any(self.root != 0.0, axis=1))

    def changed(self, k: int, step: float) -> Effect:
        """Blade with one latent number changed."""
        z = self.at.copy()
        z[k] += step
        return self.kind(*map(float, z))


PLAIN = CalibratedBlade(np.zeros(len(NAMES)), np.zeros(len(NAMES)), np.diag(AS_BUILT))
"""Blade of the case as it is written."""


def prior_of(case: Case) -> Prior:
    """What is known of the blade of a case before a run of it, wide enough for a label that was guessed."""
    blade, told = case.file.blade, case.file.blade.as_built
    source = known_from(blade)
    if source in ("reference", "measured"):
        return case.as_built().prior
    sd, mean = dict(zip(NAMES, _SD[source], strict=True)), np.zeros(len(NAMES))
    for k, name in enumerate(NAMES):
        mean[k] = getattr(told, name, None) or 0.0
        stated = getattr(told, f"{name.removesuffix('_deg')}_sd{'_deg' if name.endswith('_deg') else ''}", None)
        sd[name] = sd[name] if stated is None else max(float(stated), 1e-3)
    return Prior(mean, np.diag(np.array(list(sd.values())) ** 2), np.array(_SIZES), np.array(_WEIGHTS), source)


def _covariances(problem: Problem) -> Iterator[Array]:
    """Covariances without the blade under which it may be chosen: solver errors of 3 % or less."""
    for h, C in noise.covariances(problem):
        if h.model <= _SMALL:
            yield C + np.diag((_ROUGH * problem.scale) ** 2)


def _misfit(C: Array, r: Array) -> float:
    return float(r @ np.linalg.solve(C, r))


def _likeliest(tables: Sequence[Array], r: Array, B: Array) -> int:
    """Covariance under which a residual is likeliest when the blade is free."""
    return int(np.argmax([log_density(C + B @ B.T, r, constant=False) for C in tables]))


def calibrated(problem: Problem, prior: Prior) -> tuple[CalibratedBlade | None, str, str]:
    """Find the blade on the reference readings."""
    rows = ~problem.free
    if np.count_nonzero(problem.channel[rows] < 2) < _FEWEST_LOADS:
        return None, "", ""
    kind = AsLabelled if prior.known_from == "label" else AsBuilt
    parts = [p for p in problem.parts if p.record.reference]
    ends = np.cumsum([0, *(len(p.channels) * len(p.record) for p in problem.parts)])
    kept = [problem.kept[a:b] for p, a, b in zip(problem.parts, ends, ends[1:], strict=False) if p.record.reference]

    def solve(z: Array) -> Array:
        blade = kind(*map(float, z))
        return np.concatenate([p.predict(p.turned(blade))[k] for p, k in zip(parts, kept, strict=True)])

    y = problem.y[rows]
    whole = problem.with_tangents(np.array([not name.startswith("blade ") for name in problem.names]))
    tables = [C[np.ix_(rows, rows)] for C in _covariances(whole)]
    root = np.asarray(np.linalg.cholesky(prior.cov), dtype=float)
    at, chosen = prior.mean, -1
    for _ in range(_ROUNDS):
        best = _likeliest(tables, y - solve(at), tangents(solve, at) @ root)
        if best == chosen:
            break
        chosen, found = best, condition(solve, prior, y, tables[best])
        at = found.mean
    words = ", ".join(
        f"{name.removesuffix('_deg').replace('_', ' ')} {value:+.2g}{' deg' if UNITS[name] == 'deg' else ''}"
        for name, value, sd in zip(NAMES, found.mean, np.sqrt(np.diag(prior.cov)), strict=True)
        if abs(value) > _WORTH_SAYING * sd
    )
    if abs(found.mean[0]) > FARTHEST_DEG:
        return None, "", (
            f"the reference fits a blade turned by {found.mean[0]:+.0f} deg: another rotor, or a wrong "
            "diameter, number of blades or unit. The blade of the case was kept"
        )  # fmt: skip
    rest, start = y - solve(found.mean), solve(prior.mean)
    if not np.isfinite(rest).all() or _misfit(tables[chosen], rest) > _misfit(tables[chosen], y - start):
        return None, "no blade fits the reference better than that of the case, which was kept", ""
    size = float(np.sqrt(found.weights @ found.sizes**2))
    note = f"blade fitted to the reference, starting from its {prior.known_from}: {words or 'no change worth stating'}"
    at_first = [problem.channel[rows] == k for k in range(2)]
    moved = {
        name: float(np.median(y[own] / start[own])) - 1.0
        for name, own in zip(CHANNELS[:2], at_first, strict=True)
        if own.any() and np.all(start[own] != 0.0)
    }
    return CalibratedBlade(found.mean, prior.mean, size * root, kind, moved), note, ""
