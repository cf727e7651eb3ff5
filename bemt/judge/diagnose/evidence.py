"""How well "nothing", every effect, every pair and "an unknown smooth effect" explain the readings.

For Gaussian readings with covariance C the evidence of a signature s_g of prior weight w_g is exact on the grid:
Z = sum_g w_g exp(-|L^-1 (r - s_g)|^2 / 2) / |L|, C = L L^T (MacKay 2003, Information Theory, ch. 28).  Everything is
done for all settings of the covariance and added up with their prior weights.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.gaussian.evidence import log_sum, shares
from bemt.base.gaussian.whitening import conditional
from bemt.judge.diagnose import form, noise, prior
from bemt.judge.diagnose.explanation import NONE, UNKNOWN, Explanation
from bemt.judge.diagnose.form import LawError
from bemt.judge.diagnose.pair_evidence import best_pair, every_pair, price, solve_together
from bemt.judge.diagnose.state import State
from bemt.physics import effects

if TYPE_CHECKING:
    from bemt.base.gaussian.whitening import Conditional, Whitener
    from bemt.judge.diagnose.noise import Hyper, SmoothAlternative
    from bemt.judge.diagnose.problem import Problem
    from bemt.judge.diagnose.signatures import Candidate

# Settings of the covariance this far (in natural logarithm) below the best are dropped.
_DROP = 8.0
_KEEP = 6
# Error of the solver, share of the largest coefficient, within which a ratio is looked for.
_ROUGH = 0.03
FOR_NULLS = 3
"""Settings of the covariance, best first, that nulls are weighed under; only these keep what rivals need [1]."""


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep linear algebra to one thread: with a few hundred rows more only wait for each other, on a busy machine long.

    scipy brings a BLAS of its own, which can only be limited once it is loaded.
    """
    import scipy.linalg  # noqa: F401
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        yield


@dataclass(frozen=True, eq=False)
class Evidence:
    """Outcome of the weighing."""

    problem: Problem  # Readings
    candidates: tuple[Candidate, ...]  # Effects
    states: tuple[State, ...]  # Settings of the covariance that matter, best for the likeliest explanation first
    probability: dict[Explanation, float]  # Posterior probability [1]
    spans: dict[str, slice]  # Columns of each candidate in ``State.S``
    log_w: Array  # (G,) Logarithm of the prior weight of each column within its candidate [1]
    rivals: tuple[SmoothAlternative, ...] = ()  # Unknown smooth effects

    def of(self, name: str) -> Candidate:
        """Candidate by id."""
        return next(c for c in self.candidates if c.id == name)

    def log_bayes(self, what: Explanation, over: Explanation = NONE, real: bool = False) -> float:
        """Natural logarithm of the odds of the readings under one explanation over another.

        With ``real`` only settings of a rotor as far off the solver as measured ones are count, where there are any.
        """
        states = tuple(s for s in self.states if s.hyper.real > 0.0) if real else ()
        states = states or self.states
        w = np.log([s.hyper.weight for s in states])
        mine, other = ([s.log_z.get(k, -np.inf) for s in states] for k in (what, over))
        return float(log_sum(mine, w) - log_sum(other, w))


def singles(state: State, R: Array, spans: dict[str, slice], log_w: Array) -> dict[str, Array]:
    """Log evidence over that of "none" of each candidate, for whitened residuals (M, n): (n,) each."""
    out = {}
    for name, span in spans.items():
        gain = state.gains(name, span, R)
        out[name] = log_sum(gain, log_w[span][:, None], axis=0)
    return out


def unknown(rivals: Sequence[tuple[Conditional, Whitener]], residual: Array) -> Array:
    """Log evidence over that of "none" of each rival for residuals (M,) or (M, B): (K,) or (K, B)."""
    rest: dict[int, tuple[Array, Array]] = {}
    rows = []
    for given, white in rivals:
        if id(given) not in rest:
            e = given.rest(residual)
            w = given.white(e)
            rest[id(given)] = e, 0.5 * np.sum(w * w, axis=0)
        e, base = rest[id(given)]
        w = white(e)
        rows.append(base - 0.5 * np.sum(w * w, axis=0) - (white.log_det - given.white.log_det))
    return np.array(rows)


def weigh(problem: Problem, candidates: Sequence[Candidate], pairs: bool = True) -> Evidence:
    """Weigh all explanations."""
    spans, S, log_w = _stacked(problem, candidates)
    modes = form.form_modes(problem, candidates)
    # a few settings of each effect are enough to see which covariances matter
    coarse = _EvidenceTable(problem, S, log_w, spans, candidates, modes, _few(problem, candidates))
    best: dict[Hyper, dict[Explanation, float]] = {}
    top = -np.inf
    for h, C in noise.covariances(problem):
        state = coarse.state(h, C, top - _DROP)
        if pairs and state.half.size:
            best_pair(state, coarse.spans, coarse.log_w, coarse.shape)
        best[h] = state.log_z
        top = max(top, max(best[h].values()) + np.log(h.weight))
    fine = _EvidenceTable(problem, S, log_w, spans, candidates, modes, None)
    rivals = noise.rivals(problem, _told(candidates))
    states: list[State] = []
    for h in _leading(best):
        C = noise.covariance(problem, h)
        state = fine.state(h, C)
        gains = unknown(noise.unlike(C, problem.u, rivals), problem.residual)  # not kept: the largest arrays there are
        if gains.size:
            state.best_rival = rivals[int(np.argmax(gains))].name
            state.log_z[UNKNOWN] = state.log_z[NONE] + float(log_sum(gains)) - float(np.log(gains.size))
        else:
            state.log_z[UNKNOWN] = state.log_z[NONE]
        if pairs:
            every_pair(state, spans, log_w, fine.shape)
        states.append(state)
    before = prior.log_priors(prior.prior_weights(problem, list(spans)), pairs)
    if pairs:
        solve_together(problem, candidates, states, spans, log_w, before, fine.shape)
    added = price(problem, states, modes)
    probability = _posterior(states, {k: v - added.get(k, 0.0) for k, v in before.items()})
    likeliest = max(probability, key=lambda k: probability[k])
    states.sort(key=lambda s: -(s.log_z[likeliest] + np.log(s.hyper.weight)))
    for s in states[:FOR_NULLS]:
        s.rivals = noise.unlike(noise.covariance(problem, s.hyper), problem.u, rivals)
    return Evidence(problem, tuple(candidates), tuple(states), probability, spans, log_w, rivals)


def log_odds(problem: Problem, candidates: Sequence[Candidate]) -> dict[str, float]:
    """Natural logarithm of the odds of each effect alone over none, all settings of the covariance added up."""
    spans, S, log_w = _stacked(problem, candidates)
    modes = form.form_modes(problem, candidates)
    table = _EvidenceTable(problem, S, log_w, spans, candidates, modes, _few(problem, candidates))
    states = [table.state(h, C) for h, C in noise.covariances(problem)]
    weight = np.log([s.hyper.weight for s in states])
    none = log_sum([s.log_z[NONE] for s in states], weight)
    return {i: float(log_sum([s.log_z[Explanation.of(i)] for s in states], weight) - none) for i in spans}


def _told(candidates: Sequence[Candidate]) -> list[str]:
    """Variables that one effect alone follows: what changes along a wall's distance is the wall, whatever its law."""
    along = [(v, e.id) for e in effects.catalogue().values() for v in e.along]
    tried = {c.id for c in candidates}
    return [v for v, i in along if i in tried and [w for w, _ in along].count(v) == 1]


def _stacked(problem: Problem, candidates: Sequence[Candidate]) -> tuple[dict[str, slice], Array, Array]:
    """Columns of each candidate, all signatures, logarithm of the weights."""
    ends = np.cumsum([0, *(c.weight.size for c in candidates)])
    spans = {c.id: slice(int(a), int(b)) for c, a, b in zip(candidates, ends, ends[1:], strict=False)}
    S = np.concatenate([np.zeros((problem.y.size, 0)), *(c.signatures for c in candidates)], axis=1)
    return spans, S, np.concatenate([np.zeros(0), *(np.log(c.weight) for c in candidates)])


def bare(problem: Problem, candidates: Sequence[Candidate], hyper: Hyper) -> Evidence:
    """Whitened signatures under one covariance, without weighing: all that a plan needs."""
    spans, S, log_w = _stacked(problem, candidates)
    white = conditional(noise.covariance(problem, hyper), problem.u, problem.changed)
    Sw = white.changes(S)
    state = State(hyper, white, white(problem.residual), Sw, 0.5 * np.sum(Sw * Sw, axis=0))
    return Evidence(problem, tuple(candidates), (state,), {}, spans, log_w)


def _few(problem: Problem, candidates: Sequence[Candidate], most: int = 9) -> NDArray[np.intp]:
    """Columns that stand for each candidate: some of the settings that were solved, evenly chosen.

    Where settings are not alike beforehand, ends and quantiles of their prior. Of ratios that are exact, those nearest
    to the readings: no other ratio stands for the right one.
    """
    out, start = [], 0
    rough = np.hypot(problem.u, _ROUGH * problem.scale)[:, None]
    for c in candidates:
        solved = np.flatnonzero(c.solved)
        cls = effects.catalogue()[c.id]
        if cls.kind == "stand" and cls.discrete:
            apart = np.sum(((problem.residual[:, None] - c.signatures) / rough) ** 2, axis=0)
            chosen = np.sort(np.argsort(apart, kind="stable")[:most])
        elif np.ptp(c.weight) < 1e-12:
            chosen = solved[np.unique(np.linspace(0, solved.size - 1, most).round().astype(int))]
        else:
            before = np.cumsum(c.weight) - 0.5 * c.weight
            inner = np.searchsorted(before, (np.arange(most - 2) + 0.5) / (most - 2))
            chosen = np.unique(np.clip([0, *inner, before.size - 1], 0, before.size - 1))
        out.append(start + chosen)
        start += c.weight.size
    return np.concatenate([np.zeros(0, dtype=np.intp), *out])


class _EvidenceTable:
    """Settings of all candidates, or some of each, laid out so that one covariance weighs them in a few products."""

    def __init__(
        self, problem: Problem, S: Array, log_w: Array, spans: dict[str, slice], candidates: Sequence[Candidate],
        modes: dict[str, Array], some: NDArray[np.intp] | None,
    ) -> None:  # fmt: skip
        self.problem, self.candidates = problem, candidates
        self.modes = [modes[c.id] for c in candidates]
        columns = np.arange(log_w.size) if some is None else some
        self.S, self.residual = S if some is None else S[:, columns], problem.residual
        self.log_w = log_w[columns]
        self.first = np.array([spans[c.id].start for c in candidates], dtype=np.intp)
        ends = [[spans[c.id].start, spans[c.id].stop] for c in candidates]
        self.spans = {c.id: slice(*np.searchsorted(columns, e)) for c, e in zip(candidates, ends, strict=True)}
        self.starts = np.array([s.start for s in self.spans.values()], dtype=np.intp)
        self.counts = np.array([s.stop - s.start for s in self.spans.values()], dtype=np.intp)
        self.columns = columns
        self._own: dict[tuple[int, int], tuple[int, Array]] = {}

    def state(self, h: Hyper, C: Array, least: float = -np.inf) -> State:
        """Whitened readings and the evidence of none and, unless all must be below a score, of every single effect."""
        white = conditional(C, self.problem.u, self.problem.changed)
        r = white(self.residual)
        reach = -white.log_det - float(white.misfit(self.residual))
        none = reach - 0.5 * float(r @ r)
        # no explanation does better than to leave nothing of the test
        if not self.candidates or reach + np.log(h.weight) < least:
            return State(h, white, r, self.S[:0], np.zeros(0), log_z={NONE: none})
        S = white.changes(self.S)
        state = State(h, white, r, S, 0.5 * np.sum(S * S, axis=0), log_z={NONE: none})
        base = S.T @ r - state.half
        # the form follows the size of the best setting, which depends on the form
        best = self._best(base)
        rest = r[:, None] - S
        every = np.arange(len(self.candidates))
        forms = self._forms(white, best, rest, every)
        gain = base.copy()
        self._add(gain, base, forms, rest, every)
        again = self._best(gain)
        moved = np.flatnonzero(again != best)
        if moved.size:
            other = self._forms(white, again, rest, moved)
            forms = forms.replaced(moved, other)
            self._add(gain, base, other, rest, moved)
        total = gain + self.log_w
        top = np.maximum.reduceat(total, self.starts)
        log_z = none + top + np.log(np.add.reduceat(np.exp(total - np.repeat(top, self.counts)), self.starts))
        for k, name in enumerate(self.spans):
            state.forms[name] = forms[k]
            state.log_z[Explanation.of(name)] = float(log_z[k])
        return state

    def _best(self, gain: Array) -> NDArray[np.intp]:
        """Column of the best setting of each candidate."""
        total = gain + self.log_w
        return np.array([s.start + int(np.argmax(total[s])) for s in self.spans.values()], dtype=np.intp)

    def _forms(self, white: Conditional, at: NDArray[np.intp], rest: Array, which: NDArray[np.intp]) -> LawError:
        """Error of the form at the best settings of some candidates."""
        return LawError.of(white, [self._columns(k, int(at[k])) for k in which.tolist()], rest[:, at[which]])

    def _columns(self, k: int, at: int) -> tuple[int, Array]:
        if (k, at) not in self._own:
            setting = int(self.columns[at] - self.first[k])
            self._own[(k, at)] = form.columns(self.candidates[k], setting, self.modes[k])
        return self._own[(k, at)]

    def shape(self, name: str, at: int) -> tuple[int, Array]:
        """Number of modes and columns of the error of an effect's law at a column of the table."""
        return self._columns(list(self.spans).index(name), at)

    def _add(self, gain: Array, base: Array, forms: LawError, rest: Array, which: NDArray[np.intp]) -> None:
        """Put in the log likelihood over that of "none" of every setting, its form taken into account."""
        spans = list(self.spans.values())
        added = forms.gains([rest[:, spans[k]] for k in which])
        for k, more, width in zip(which, added, forms.width, strict=True):
            gain[spans[k]] = base[spans[k]] + (more if width else 0.0)


def _leading(log_z: dict[Hyper, dict[Explanation, float]]) -> list[Hyper]:
    """Settings of the covariance under which some explanation is good, and the best of none, one effect and two."""
    hypers = list(log_z)
    weight = np.log([h.weight for h in hypers])

    def score(effects: int) -> Array:
        z = [max((v for k, v in log_z[h].items() if _effects(k) == effects), default=-np.inf) for h in hypers]
        return np.array(z) + weight

    each = np.array([score(effects) for effects in (0, 1, 2)])
    together = each.max(axis=0)
    order = np.argsort(-together)[:_KEEP]
    chosen = [int(i) for i in order if together[i] > together[order[0]] - _DROP]
    # each is judged at its best: two effects explain what one leaves to a wider error of the solver.  Something unknown
    # is not asked: under the least noise it also fits what the few settings of a listed effect leave between them.
    own = [int(np.argmax(s)) for s in each if np.isfinite(s).any()]
    return [hypers[i] for i in dict.fromkeys([*chosen, *own])]


def _effects(what: Explanation) -> int:
    """Number of effects at work."""
    return 0 if what == NONE else len(what)


def _posterior(states: Sequence[State], before: dict[Explanation, float]) -> dict[Explanation, float]:
    names = list(states[0].log_z)
    table = np.array([[s.log_z[name] + np.log(s.hyper.weight) for s in states] for name in names])
    p = shares(log_sum(table, axis=1) + [before[name] for name in names])
    return dict(zip(names, p.tolist(), strict=True))
