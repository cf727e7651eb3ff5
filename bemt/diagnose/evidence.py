"""How well "nothing", every effect, every pair and "an unknown smooth effect" explain the readings.

For Gaussian readings with covariance C the evidence of a signature s_g of prior weight w_g is exact on the grid:
Z = sum_g w_g exp(-|L^-1 (r - s_g)|^2 / 2) / |L|, C = L L^T (MacKay 2003, Information Theory, ch. 28).  Everything is
done for all settings of the covariance and added up with their prior weights.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt import effects
from bemt.diagnose import form, noise, prior
from bemt.diagnose.explanation import NONE, UNKNOWN, Explanation
from bemt.diagnose.form import Form, Forms
from bemt.diagnose.signatures import effect_of

if TYPE_CHECKING:
    from bemt.diagnose.noise import Conditional, Hyper, Rival, Whitener
    from bemt.diagnose.problem import Problem
    from bemt.diagnose.signatures import Candidate

__all__ = ["Evidence", "State", "weigh"]

Array = NDArray[np.float64]

# Settings of the covariance this far (in natural logarithm) below the best are dropped.
_DROP = 8.0
_KEEP = 6
_PAIR_LEADERS = 60
# Single effects of which the best pair is looked for under every covariance.
_FIRST = 2
# Leading pairs that are solved together: what one effect changes depends on the other.
_TOGETHER, _ROUNDS = 24, 6
DETAIL, GEOMETRY = 0.1, 0.03
"""Share of what one effect explains (log odds) that two must explain on top: by so much its law may be off beyond what
the error of its form holds.  As of a smooth rest beside it, which is no other cause either.  The second of an effect
whose law is geometry and the solver: of 56 that led alone in three proofs, one had another of more, and 5 nats [1]."""
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


def log_mean(log_values: Array, log_weights: Array, axis: int = -1) -> Array:
    """Logarithm of a weighted sum of exponentials."""
    total = log_values + log_weights
    top = np.max(total, axis=axis, keepdims=True)
    top = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.squeeze(top, axis) + np.log(np.sum(np.exp(total - top), axis=axis)))


@dataclass(eq=False)
class State:
    """Readings and signatures whitened by one setting of the covariance, those of the test given the reference.

    Attributes
    ----------
    hyper : Hyper
        The setting.
    white : Conditional
        Its factors.
    r : (M,) float
        Whitened residual [1].
    S : (M, G) float
        Whitened signatures of all settings of all candidates [1].
    half : (G,) float
        Half of their squared lengths [1].
    forms : dict of str to Form
        Error of the form of each candidate, at its best setting.
    rivals : list of (Conditional, Whitener)
        Factors without and with each unknown smooth effect.
    log_z : dict of Explanation to float
        Logarithm of the evidence per explanation.
    best_rival : str
        Unknown smooth effect of largest evidence.
    mixed : dict of Explanation to (float array, int, int)
        What two effects change together beyond the sum of both, whitened, and the columns at which it was solved.
    """

    hyper: Hyper
    white: Conditional
    r: Array
    S: Array
    half: Array
    forms: dict[str, Form] = field(default_factory=dict)
    rivals: list[tuple[Conditional, Whitener]] = field(default_factory=list)
    log_z: dict[Explanation, float] = field(default_factory=dict)
    best_rival: str = ""
    mixed: dict[Explanation, tuple[Array, int, int]] = field(default_factory=dict)

    def both(self, pair: Explanation, spans: Mapping[str, slice], log_w: Array) -> Array:
        """Log likelihood over that of "none" of all settings of two effects, priors included, forms left out, (A, B).

        Signatures are added; what they change together, where it was solved, grows as the product of their sizes.
        """
        A, B = (spans[i] for i in pair)
        a, b = (self.S[:, x].T @ self.r - self.half[x] + log_w[x] for x in (A, B))
        total = a[:, None] + b[None, :] - self.S[:, A].T @ self.S[:, B]
        if pair in self.mixed:
            extra, i, j = self.mixed[pair]
            share = np.outer(self.S[:, A].T @ self.S[:, i] / (2.0 * self.half[i]),
                             self.S[:, B].T @ self.S[:, j] / (2.0 * self.half[j]))  # fmt: skip
            met = (extra @ self.S[:, A])[:, None] + (extra @ self.S[:, B])[None, :]
            total += share * (extra @ self.r - met) - 0.5 * share**2 * (extra @ extra)
        return np.asarray(total)

    def best_of(self, pair: Explanation, spans: Mapping[str, slice], log_w: Array) -> tuple[int, int]:
        """Columns of the best setting of two effects."""
        total = self.both(pair, spans, log_w)
        i, j = np.unravel_index(int(np.argmax(total)), total.shape)
        A, B = (spans[k] for k in pair)
        return A.start + int(i), B.start + int(j)

    def gains(self, name: str, span: slice, R: Array) -> Array:
        """Log likelihood over that of "none" of every setting of a candidate for whitened residuals. [1]"""
        S = self.S[:, span]
        out = S.T @ R - self.half[span][:, None]
        form = self.forms.get(name)
        if form is not None and form.B.shape[1]:
            pS, pR = form.project(S), form.project(R)
            out += (
                0.5 * np.sum(pS * pS, axis=0)[:, None] - pS.T @ pR + 0.5 * np.sum(pR * pR, axis=0) - form.half_log_det
            )
        return np.asarray(out)


@dataclass(frozen=True, eq=False)
class Evidence:
    """Outcome of the weighing.

    Attributes
    ----------
    problem : Problem
        Readings.
    candidates : tuple of Candidate
        Effects.
    states : tuple of State
        Settings of the covariance that matter, best for the likeliest explanation first.
    probability : dict of Explanation to float
        Posterior probability [1].
    spans : dict of str to slice
        Columns of each candidate in ``State.S``.
    log_w : (G,) float
        Logarithm of the prior weight of each column within its candidate [1].
    rivals : tuple of Rival
        Unknown smooth effects.
    """

    problem: Problem
    candidates: tuple[Candidate, ...]
    states: tuple[State, ...]
    probability: dict[Explanation, float]
    spans: dict[str, slice]
    log_w: Array
    rivals: tuple[Rival, ...] = ()

    def of(self, name: str) -> Candidate:
        """Candidate by id."""
        return next(c for c in self.candidates if c.id == name)

    def log_bayes(self, what: Explanation) -> float:
        """Natural logarithm of the odds of the readings under an explanation over "none"."""
        top = np.array([s.log_z[NONE] for s in self.states])
        mine = np.array([s.log_z.get(what, -np.inf) for s in self.states])
        w = np.log([s.hyper.weight for s in self.states])
        return float(log_mean(mine, w) - log_mean(top, w))


def singles(state: State, R: Array, spans: dict[str, slice], log_w: Array) -> dict[str, Array]:
    """Log evidence over that of "none" of each candidate, for whitened residuals (M, n): (n,) each."""
    out = {}
    for name, span in spans.items():
        gain = state.gains(name, span, R)
        out[name] = log_mean(gain, np.broadcast_to(log_w[span][:, None], gain.shape), axis=0)
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
    coarse = _Table(problem, S, log_w, spans, candidates, modes, _few(candidates))
    best: dict[Hyper, dict[Explanation, float]] = {}
    top = -np.inf
    for h, C in noise.covariances(problem):
        state = coarse.state(h, C, top - _DROP)
        if pairs and state.half.size:
            _best_pair(state, coarse.spans, coarse.log_w)
        best[h] = state.log_z
        top = max(top, max(best[h].values()) + np.log(h.weight))
    fine = _Table(problem, S, log_w, spans, candidates, modes, None)
    rivals = noise.rivals(problem, _told(candidates))
    states: list[State] = []
    for h in _leading(best):
        C = noise.covariance(problem, h)
        state = fine.state(h, C)
        gains = unknown(noise.unlike(C, problem.u, rivals), problem.residual)  # not kept: the largest arrays there are
        if gains.size:
            state.best_rival = rivals[int(np.argmax(gains))].name
            state.log_z[UNKNOWN] = state.log_z[NONE] + float(log_mean(gains, np.full(gains.size, -np.log(gains.size))))
        else:
            state.log_z[UNKNOWN] = state.log_z[NONE]
        if pairs:
            _pairs(state, spans, log_w)
        states.append(state)
    before = prior.log_priors(prior.prior_weights(problem, list(spans)), pairs)
    if pairs:
        _solve_pairs(problem, candidates, states, spans, log_w, before)
    price = _details(problem, states, modes)
    probability = _posterior(states, {k: v - price.get(k, 0.0) for k, v in before.items()})
    likeliest = max(probability, key=lambda k: probability[k])
    states.sort(key=lambda s: -(s.log_z[likeliest] + np.log(s.hyper.weight)))
    for s in states[:FOR_NULLS]:
        s.rivals = noise.unlike(noise.covariance(problem, s.hyper), problem.u, rivals)
    return Evidence(problem, tuple(candidates), tuple(states), probability, spans, log_w, rivals)


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
    white = noise.conditional(noise.covariance(problem, hyper), problem.u, problem.free)
    Sw = white.changes(S)
    state = State(hyper, white, white(problem.residual), Sw, 0.5 * np.sum(Sw * Sw, axis=0))
    return Evidence(problem, tuple(candidates), (state,), {}, spans, log_w)


def _few(candidates: Sequence[Candidate], most: int = 9) -> NDArray[np.intp]:
    """Columns that stand for each candidate: some of the settings that were solved, evenly chosen.

    Where settings are not alike beforehand, ends and quantiles of their prior.
    """
    out, start = [], 0
    for c in candidates:
        solved = np.flatnonzero(c.solved)
        if np.ptp(c.weight) < 1e-12:
            chosen = solved[np.unique(np.linspace(0, solved.size - 1, most).round().astype(int))]
        else:
            before = np.cumsum(c.weight) - 0.5 * c.weight
            inner = np.searchsorted(before, (np.arange(most - 2) + 0.5) / (most - 2))
            chosen = np.unique(np.clip([0, *inner, before.size - 1], 0, before.size - 1))
        out.append(start + chosen)
        start += c.weight.size
    return np.concatenate([np.zeros(0, dtype=np.intp), *out])


class _Table:
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
        white = noise.conditional(C, self.problem.u, self.problem.free)
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

    def _forms(self, white: Conditional, at: NDArray[np.intp], rest: Array, which: NDArray[np.intp]) -> Forms:
        """Error of the form at the best settings of some candidates."""
        return Forms.of(white, [self._columns(k, int(at[k])) for k in which.tolist()], rest[:, at[which]])

    def _columns(self, k: int, at: int) -> tuple[int, Array]:
        if (k, at) not in self._own:
            setting = int(self.columns[at] - self.first[k])
            self._own[(k, at)] = form.columns(self.candidates[k], setting, self.modes[k])
        return self._own[(k, at)]

    def _add(self, gain: Array, base: Array, forms: Forms, rest: Array, which: NDArray[np.intp]) -> None:
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


def _best_pair(state: State, spans: Mapping[str, slice], log_w: Array) -> None:
    """Evidence of the best pair that holds one of the best single effects: enough to see which covariances matter."""
    gain = state.S.T @ state.r - state.half + log_w
    names, starts = list(spans), np.array([s.start for s in spans.values()])
    found: dict[Explanation, float] = {}
    for a in sorted(names, key=lambda i: -state.log_z[Explanation.of(i)])[:_FIRST]:
        A = spans[a]
        total = gain[A][:, None] + gain[None, :] - state.S[:, A].T @ state.S
        top = np.maximum.reduceat(np.max(total, axis=0), starts)
        found |= {Explanation.of(a, b): float(v) for b, v in zip(names, top, strict=True) if b != a}
    if found:
        pair = max(found, key=lambda k: found[k])
        state.log_z[pair] = _log_z(state, pair, spans, log_w)


def _pairs(state: State, spans: dict[str, slice], log_w: Array) -> None:
    """Evidence of two effects at a time, signatures added.

    The error of both forms is worked out for the leading pairs only, at their best settings; others cannot matter.
    """
    gain = state.S.T @ state.r - state.half + log_w
    none = state.log_z[NONE]
    names, ends = list(spans), list(spans.values())
    starts = np.array([s.start for s in ends])

    def together(A: slice, B: slice) -> Array:
        return np.asarray(gain[A][:, None] + gain[B][None, :] - state.S[:, A].T @ state.S[:, B])

    upper: dict[Explanation, float] = {}
    for i, a in enumerate(names[:-1]):
        others = slice(ends[i].stop, ends[-1].stop)
        total, at = together(ends[i], others), starts[i + 1 :] - others.start
        top = np.max(np.maximum.reduceat(total, at, axis=1), axis=0)
        total -= np.repeat(top, np.diff([*at, total.shape[1]]))
        log_sum = top + np.log(np.add.reduceat(np.sum(np.exp(total, out=total), axis=0), at))
        for b, value in zip(names[i + 1 :], log_sum, strict=True):
            pair = Explanation.of(a, b)
            state.log_z[pair] = none + float(value)
            upper[pair] = max(state.log_z[Explanation.of(k)] for k in (a, b))
            upper[pair] = max(upper[pair], state.log_z[pair])
    for pair in sorted(upper, key=lambda k: -upper[k])[:_PAIR_LEADERS]:
        state.log_z[pair] = _log_z(state, pair, spans, log_w)


def _log_z(state: State, pair: Explanation, spans: Mapping[str, slice], log_w: Array) -> float:
    """Logarithm of the evidence of two effects, with the error of both forms at their best settings."""
    total = state.both(pair, spans, log_w)
    out = state.log_z[NONE] + float(log_mean(total.ravel(), np.zeros(total.size)))
    forms = [state.forms[i] for i in pair]
    both = np.concatenate([f.B for f in forms], axis=1)
    if not both.shape[1]:
        return out
    joint = Form(both, np.linalg.cholesky(np.eye(both.shape[1]) + both.T @ both))
    k, m = np.unravel_index(int(np.argmax(total)), total.shape)
    A, B = (spans[i] for i in pair)
    i, j = A.start + int(k), B.start + int(m)
    d = state.r - state.S[:, i] - state.S[:, j]
    if pair in state.mixed:
        extra, at, to = state.mixed[pair]
        share = (state.S[:, i] @ state.S[:, at]) * (state.S[:, j] @ state.S[:, to])
        d -= share / (4.0 * state.half[at] * state.half[to]) * extra
    p = joint.project(d)
    chosen = sum(float(np.log(form.FORM.get(f.size, 1.0))) for f in forms)
    return out + 0.5 * float(p @ p) - joint.half_log_det + chosen


def _solve_pairs(
    problem: Problem, candidates: Sequence[Candidate], states: Sequence[State], spans: Mapping[str, slice],
    log_w: Array, before: Mapping[Explanation, float],
) -> None:  # fmt: skip
    """Solve the leading pairs with both effects on and weigh them again."""
    of = {c.id: c for c in candidates}
    score = {k: max(s.log_z[k] + np.log(s.hyper.weight) for s in states) + v for k, v in before.items() if k.pair}
    for pair in sorted(score, key=lambda k: -score[k])[:_TOGETHER]:
        state = max(states, key=lambda s: s.log_z[pair] + np.log(s.hyper.weight))
        settled = False
        for _ in range(_ROUNDS):
            best = state.best_of(pair, spans, log_w)
            settled = best == state.mixed.get(pair, (None, None, None))[1:]
            if settled:
                break
            a, b = (effect_of(k, of[k].settings[c - spans[k].start]) for k, c in zip(pair, best, strict=True))
            extra = problem.signature((a, b)) - problem.signature((a,)) - problem.signature((b,))
            if not np.isfinite(extra).all() or not min(state.half[list(best)]) > 0.0:
                break
            for s in states:
                s.mixed[pair] = s.white.changes(extra), *best
        if not settled:  # what was solved does not say what holds at the best setting
            for s in states:
                s.mixed.pop(pair, None)
        for s in states:
            s.log_z[pair] = _log_z(s, pair, spans, log_w)


def _details(
    problem: Problem, states: Sequence[State], modes: Mapping[str, Array]
) -> dict[Explanation, float]:  # fmt: skip
    """What each pair must explain on top of the best single effect, log odds, where that one's law has a form.

    An effect that shows along a recorded variable of its own (time, gap, wall) is no detail of another one's law.
    """
    weight = np.log([s.hyper.weight for s in states])
    none = float(log_mean(np.array([s.log_z[NONE] for s in states]), weight))
    alone = {i: float(log_mean(np.array([s.log_z[Explanation.of(i)] for s in states]), weight)) - none for i in modes}
    best = max(alone, key=lambda i: alone[i], default="")
    if not best or not modes[best].shape[1] or alone[best] <= 0.0:
        return {}
    own = {i for i in alone if any(v in problem.covariates for v in effects.catalogue()[i].along)}
    share = GEOMETRY if effects.catalogue()[best].geometric else DETAIL
    return {k: share * alone[best] for k in states[0].log_z if k.pair and min(k, key=lambda i: alone[i]) not in own}


def _posterior(states: Sequence[State], before: dict[Explanation, float]) -> dict[Explanation, float]:
    names = list(states[0].log_z)
    table = np.array([[s.log_z[name] + np.log(s.hyper.weight) for s in states] for name in names])
    log_post = log_mean(table, np.zeros_like(table), axis=1) + np.array([before[name] for name in names])
    p = np.exp(log_post - log_post.max())
    return {name: float(v) for name, v in zip(names, p / p.sum(), strict=True)}
