"""The answer of the judge: one object with named groups, of which text, JSON, figures and report are views."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.judge.diagnose import prior
from bemt.judge.diagnose.record import CHANNELS
from bemt.judge.explanation import UNKNOWN, Explanation, Sizes
from bemt.judge.loss import Decision
from bemt.physics import effects

if TYPE_CHECKING:
    from bemt.judge.compare.recordings import RunChange
    from bemt.judge.diagnose import confusion, posterior
    from bemt.judge.diagnose import fit as fitting
    from bemt.judge.diagnose import locate as location
    from bemt.judge.diagnose import suggest as suggestion
    from bemt.judge.diagnose.problem import Problem
    from bemt.judge.diagnose.signatures import Candidate

# Computed loads below this share of the largest have no ratio; departures above it are said where the median is small.
_NEAR_ZERO, _FAR = 0.1, 0.05


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings of all recordings, stacked: (M,) values, with (P,) variables of the points that they belong to."""

    channels: tuple[str, ...]
    values: Array  # (M,) [units of the channel]
    u: Array  # (M,) standard uncertainty [units of the channel]
    channel: NDArray[np.intp]  # (M,) place in CHANNELS
    point: NDArray[np.intp]  # (M,) place in the variables
    tested: NDArray[np.bool_]  # (M,) False: of a reference
    variables: dict[str, Array]  # (P,) each
    notes: tuple[str, ...]
    findings: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Baseline:
    """Model of the case without any cause."""

    effects: tuple[effects.Effect, ...]
    values: Array  # (M,) [units of the channel]
    level: dict[str, float]  # Median of each load over what the case gives, less 1 [1]


@dataclass(frozen=True, eq=False)
class Posterior:
    """What the readings say of the explanations."""

    probability: dict[Explanation, float]  # Adds up to 1 [1]
    log_bayes: dict[Explanation, float]  # Natural logarithm of the odds over nothing, of each effect and the unknown
    inclusion: dict[str, float]  # That an effect is present, alone or in a pair [1]
    parameters: Sizes  # Of the leading explanation
    p_value: float  # Of as large a misfit without a cause [1]


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What is wrong, in named groups; text, JSON, figures and report are views of it."""

    found: posterior.Evidence  # Outcome of the weighing, with the problem in it
    decision: Decision  # Verdict of the evidence in the case
    said: Decision  # What is said in the end: with what the drive says
    best: fitting.Fit  # Leading explanation at its best setting
    parameters: Sizes  # Of the leading explanation
    p_value: float  # Of the gate [1]
    where: location.Location  # Of the mismatch; of the largest scatter when the verdict is none
    # Channel to RMSE in its unit: before, after, noise, gp_only, holdout_before, holdout_after; mean and largest
    # magnitude of the readings
    scores: dict[str, dict[str, float]]
    blocks: str  # What was left out in turn for the held-out scores
    # (M,) Readings as the improved model gives them: fitted, and each block from the others [units of the readings]
    after: Array
    held: Array
    next: suggestion.Suggestion  # What would decide
    alike: confusion.Confusion  # Distances of effects in this plan
    absent: dict[str, str]  # Effects that could not be tried, and why
    # Of the motor's speed over pulse width, a problem of its own; None where it was not recorded
    drive: Diagnosis | None = None
    loads: Diagnosis | None = None  # Of thrust and torque, where they name nothing and the answer is that of the drive
    change: RunChange | None = None  # Change from the references, where there is one recording beside them

    @property
    def readings(self) -> Readings:
        """What was measured."""
        p = self.problem
        channels = tuple(CHANNELS[c] for c in np.unique(p.channel))
        return Readings(channels, p.y, p.u, p.channel, p.point, p.free, p.covariates, p.notes, p.findings)

    @property
    def baseline(self) -> Baseline:
        """What the case gives there."""
        return Baseline(self.problem.baseline, self.problem.f0, self.problem.level)

    @property
    def prior(self) -> dict[Explanation, float]:
        """Probability of every explanation before a reading was looked at [1]."""
        weights = prior.prior_weights(self.problem, list(self.found.spans))
        return {k: float(np.exp(v)) for k, v in prior.log_priors(weights, of=prior.kinds(self.problem)).items()}

    @property
    def explanations(self) -> tuple[Candidate, ...]:
        """Effects that were tried, with what each changes in the readings."""
        return self.found.candidates

    @property
    def posterior(self) -> Posterior:
        """What the readings say of them."""
        odds = {e: self.found.log_bayes(e) for e in (*map(Explanation.of, self.found.spans), UNKNOWN)}
        return Posterior(self.found.probability, odds, self.found.inclusion, self.parameters, self.p_value)

    @property
    def systems(self) -> dict[str, dict[str, Any]]:
        """Verdict and effects of air, stand and drive, each for itself."""
        said = self.said
        listed = said.verdict in ("named", "class", "sensor")
        kinds = {i: _kind(i) for i in said.effects}
        out: dict[str, dict[str, Any]] = {}
        for system in ("air", "stand", "drive"):
            mine = [i for i, kind in kinds.items() if kind == system]
            word = ("none" if not mine else said.verdict) if listed else said.verdict
            if self.loads is not None and system != "drive":
                word = self.loads.decision.verdict
            out[system] = {"verdict": word, "effects": mine}
        if self.drive is not None and self.drive is not self:
            out["drive"] = {"verdict": self.drive.decision.verdict, "effects": list(self.drive.decision.effects)}
        elif not any("rpm" in p.channels for p in self.problem.parts):
            out["drive"] = {"verdict": "not recorded", "effects": []}
        return out

    @property
    def problem(self) -> Problem:
        """Readings, baseline, nuisances."""
        return self.found.problem

    @property
    def in_reference(self) -> tuple[str, ...]:
        """Effects of the answer that the case leaves out and the reference shows as well."""
        return tuple(i for i in self.said.effects if i in self.problem.shared)

    @property
    def off(self) -> dict[str, tuple[float, bool]]:
        """How far each channel is from the case: median of the ratio, less 1 [1]; or how far most go, and True."""
        p, out = self.problem, {}
        for c, name in enumerate(CHANNELS):
            here = (p.channel == c) & p.free
            here &= np.abs(p.f0) > _NEAR_ZERO * np.max(np.abs(p.f0), where=here, initial=0.0)
            if here.any():
                change = p.y[here] / p.f0[here] - 1.0
                order = np.argsort(np.abs(change))
                median, far = float(np.median(change)), float(change[order[int(0.9 * (change.size - 1))]])
                wide = abs(far) > _FAR and abs(median) < 0.5 * abs(far)
                out[name] = (far if wide else median), wide
        return out

    @property
    def marked(self) -> location.Location | None:
        """Location of the mismatch; None without one."""
        return None if self.decision.verdict == "none" else self.where


def _kind(name: str) -> str:
    """Sub-system of an effect, or of a cause in the drive that is none."""
    return effects.catalogue()[name].kind if name in effects.catalogue() else "drive"
