"""One posterior: nothing, every effect, every pair and something unknown, as one mixture of normal distributions.

For readings with covariance C the evidence of a signature s_g of prior weight w_g is exact on the grid of settings:
Z = sum_g w_g exp(-|L^-1 (r - s_g)|^2 / 2) / |L|, C = L L^T (MacKay 2003, Information Theory, ch. 28).  The error of an
effect's law is a few more columns of that covariance, by Woodbury.  What else is known enters once, as a factor.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.gaussian.evidence import log_sum, shares
from bemt.base.gaussian.whitening import conditional
from bemt.judge.diagnose import form, knowledge, noise, record
from bemt.judge.diagnose.form import State
from bemt.judge.diagnose.other_rotor import Another
from bemt.judge.explanation import NONE, UNKNOWN, Explanation
from bemt.physics import effects
from bemt.physics.effects import base as effect_base

if TYPE_CHECKING:
    from bemt.base.gaussian.whitening import Conditional, Whitener
    from bemt.judge.diagnose.noise import Hyper, SmoothAlternative
    from bemt.judge.diagnose.problem import Problem
    from bemt.judge.diagnose.signatures import Candidate

LEAST = 0.01
"""What changes no load by more than this share of its size, where it changes it, is no cause, known or unknown [1]."""
EARNED = 3.0
"""Log odds that a second effect must add to the better one of a pair; below, the pair counts as that one [1]."""
_TOUCHED = 0.1  # share of that which a reading changes by at least where an effect is at work in it [1]
# Settings of the covariance that are kept, settings of an effect that choose them, and settings of each effect in a
# pair: evenly chosen and best; pairs with the errors of both laws.
_KEEP, _FEW, _EVEN, _BEST, _PAIRS = 3, 9, 14, 10, 12
_SHUT = -60.0
# Log odds that a pair is expected to lack, where covariances are chosen: it has twice the settings.
_TWICE = 4.0


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
    prior: dict[Explanation, float] = field(default_factory=dict)  # Probability before the readings [1]

    @property
    def p_value(self) -> float:
        """Probability of as large a misfit without any cause: the whitened residual of "none" is chi-square [1]."""
        from scipy.special import chdtrc

        return max(float(chdtrc(s.r.size, s.r @ s.r)) for s in self.states)

    @property
    def solver_error(self) -> float:
        """Root mean square of the error of the solver itself, over settings of the covariance [1]."""
        p = shares([max(s.log_z.values()) + np.log(s.hyper.weight) for s in self.states])
        return float(np.sqrt(p @ [s.hyper.model**2 for s in self.states]))

    @property
    def inclusion(self) -> dict[str, float]:
        """Probability that an effect is at work, alone or in a pair, by id, likeliest first [1]."""
        out = dict.fromkeys(self.spans, 0.0)
        for what, p in self.probability.items():
            for i in what.ids:
                out[i] = out.get(i, 0.0) + p
        return dict(sorted(out.items(), key=lambda kv: -kv[1]))

    def of(self, name: str) -> Candidate:
        """Candidate by id."""
        return next(c for c in self.candidates if c.id == name)

    def log_bayes(self, what: Explanation, over: Explanation = NONE) -> float:
        """Natural logarithm of the odds of the readings under one explanation over another."""
        w = np.log([s.hyper.weight for s in self.states])
        mine, other = ([s.log_z.get(k, -np.inf) for s in self.states] for k in (what, over))
        return float(log_sum(mine, w) - log_sum(other, w))


@dataclass(frozen=True, eq=False)
class _Bank:
    """Signatures of all candidates side by side."""

    problem: Problem
    candidates: tuple[Candidate, ...]
    spans: dict[str, slice]
    S: Array  # (M, G) [units of the readings]
    log_w: Array  # (G,)
    seen: NDArray[np.bool_]  # (G,) Whether a setting changes the readings by as much as counts
    modes: dict[str, Array]  # Of the error of each law, (M, q)
    _columns: dict[tuple[str, int], tuple[int, Array]]

    @classmethod
    def of(cls, problem: Problem, candidates: Sequence[Candidate]) -> _Bank:
        """Lay out."""
        ends = np.cumsum([0, *(c.weight.size for c in candidates)])
        spans = {c.id: slice(int(a), int(b)) for c, a, b in zip(candidates, ends, ends[1:], strict=False)}
        S = np.concatenate([np.zeros((problem.y.size, 0)), *(c.signatures for c in candidates)], axis=1)
        log_w = np.concatenate([np.zeros(0), *(np.log(c.weight) for c in candidates)])
        seen = _counts(problem, problem.changed, S[problem.changed])
        return cls(problem, tuple(candidates), spans, S, log_w, seen, form.form_modes(problem, candidates), {})

    def columns(self, name: str, setting: int) -> tuple[int, Array]:
        """How many modes the error of a law has at a setting, and all its columns."""
        if (name, setting) not in self._columns:
            candidate = next(c for c in self.candidates if c.id == name)
            self._columns[name, setting] = form.columns(self.problem, candidate, setting, self.modes[name])
        return self._columns[name, setting]


def weigh(
    problem: Problem, candidates: Sequence[Candidate], pairs: bool = True, gone: Collection[str] = ()
) -> Evidence:  # fmt: skip
    """Weigh all explanations but those that are ``gone``, ruled out; candidates are without them."""
    bank = _Bank.of(problem, candidates)
    # whatever its law, what changes along a variable of its own is that effect
    rivals = noise.rivals(problem, [v for v, i in _own_variables().items() if i in bank.spans])
    other = Another.of(problem)
    if other is not None and other[0].ids & set(gone):
        other = None
    states = []
    for h in _leading(bank):
        C = noise.covariance(problem, h)
        state = _single(bank, h, conditional(C, problem.u, problem.changed))
        beside = noise.unlike(C, problem.u, rivals)
        gains = unknown(beside, problem.residual)
        state.log_z[UNKNOWN] = state.log_z[NONE]
        if gains.size:
            state.best_rival = rivals[int(np.argmax(gains))].name
            counts = _noticed(problem, rivals, beside)
            for where, some in ((state.log_z, counts), (state.small, ~counts)):
                share = float(log_sum(gains[some])) - float(np.log(gains.size)) if some.any() else _SHUT
                where[UNKNOWN] = state.log_z[NONE] + share
        if other is not None:
            state.log_z[other[0]] = state.log_z[NONE] + other[1].log_bayes(state.white, state.r, problem.channel)
        if pairs:
            _pairs(bank, state)
        states.append(state)
    weights = knowledge.prior_weights(problem, list(bank.spans))
    alone = {} if other is None else {other[0]: math.prod(knowledge.prior_weights(problem, list(other[0])).values())}
    before = knowledge.log_priors(weights, pairs, knowledge.kinds(problem), alone)
    rough = {c.id for c in candidates if problem.by_laws and effects.catalogue()[c.id].kind != "stand"
             and not effects.catalogue()[c.id].exact}  # fmt: skip
    probability = _posterior(states, before, rough, _stated(problem, candidates))
    likeliest = max(probability, key=lambda k: probability[k])
    states.sort(key=lambda s: -(s.log_z[likeliest] + np.log(s.hyper.weight)))
    prior = {k: math.exp(v) for k, v in before.items()}
    return Evidence(problem, tuple(candidates), tuple(states), probability, bank.spans, bank.log_w, rivals, prior)


def log_odds(problem: Problem, candidates: Sequence[Candidate]) -> dict[str, float]:
    """Natural logarithm of the odds of each effect alone over none, the likeliest covariances added up."""
    bank = _Bank.of(problem, candidates)
    states = [_single(bank, h, conditional(noise.covariance(problem, h), problem.u, problem.changed))
              for h in _leading(bank)]  # fmt: skip
    found = Evidence(problem, tuple(candidates), tuple(states), {}, bank.spans, bank.log_w)
    return {i: found.log_bayes(Explanation.of(i)) for i in bank.spans}


def bare(problem: Problem, candidates: Sequence[Candidate], hyper: Hyper) -> Evidence:
    """Whitened signatures under one covariance, without weighing: all that a plan needs."""
    bank = _Bank.of(problem, candidates)
    white = conditional(noise.covariance(problem, hyper), problem.u, problem.changed)
    S = white.changes(bank.S)
    state = State(hyper, white, white(problem.residual), S, 0.5 * np.sum(S * S, axis=0))
    return Evidence(problem, tuple(candidates), (state,), {}, bank.spans, bank.log_w)


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


def _noticed(
    problem: Problem, rivals: Sequence[SmoothAlternative], beside: Sequence[tuple[Conditional, Whitener]]
) -> NDArray[np.bool_]:  # fmt: skip
    """Which rivals, as the readings show them, change any channel by as much as counts, (K,)."""
    out = []
    for k, (given, white) in zip(rivals, beside, strict=True):
        change = k.size**2 * k.kernel @ white.solve(given.rest(problem.residual))
        out.append(_counts(problem, k.mine, change[:, None])[0])
    return np.array(out)


def _counts(problem: Problem, rows: NDArray[np.bool_], changes: Array) -> NDArray[np.bool_]:
    """Which changes (N, K) of some readings are as large as counts in any channel, over the readings that they change.

    Loads grow with the square of the speed: half of what counts in loads counts in the speed at a pulse width.
    """
    channel = problem.channel[rows]
    share = (
        np.abs(changes) / (problem.scale[rows] * np.where(channel == record.CHANNELS.index("rpm"), 0.5, 1.0))[:, None]
    )
    there = share > _TOUCHED * LEAST
    out = np.zeros(share.shape[1], dtype=bool)
    for c in np.unique(channel):
        mine = channel == c
        out |= np.sum(share[mine] ** 2, axis=0, where=there[mine]) > LEAST**2 * np.sum(there[mine], axis=0)
    return out


def _own_variables() -> dict[str, str]:
    """Variables that one effect alone follows, and which: what changes along a wall's distance is the wall."""
    followed: dict[str, list[str]] = {}
    for e in effects.catalogue().values():
        for v in e.along:
            followed.setdefault(v, []).append(e.id)
    return {v: ids[0] for v, ids in followed.items() if len(ids) == 1}


def _stated(problem: Problem, candidates: Sequence[Candidate]) -> set[str]:
    """Effects by laws that the case has on, over a variable that was varied: what is left of these is no cause.

    A recorded wall is not left out. Where the readings ask for more of it, its published law is off.
    """
    known, X = knowledge.present(problem), problem.covariates
    varied = {i for v, i in _own_variables().items() if i in known and v in X and np.ptp(X[v]) > 0.0}
    return {c.id for c in candidates if (effects.catalogue()[c.id].law or c.id) in varied}


def _leading(bank: _Bank) -> list[Hyper]:
    """Settings of the covariance under which some explanation is best, and the best of none and of one effect.

    A few settings of each effect are enough to see that. Something unknown is not asked: under the least noise it also
    fits what the few settings leave between them.
    """
    problem = bank.problem
    few = _few(bank)
    S = bank.S[:, few]
    scores, hypers = [], []
    for h, C in noise.covariances(problem):
        white = conditional(C, problem.u, problem.changed)
        r, X = white(problem.residual), white.changes(S)
        none = -0.5 * float(r @ r) - white.log_det - float(white.misfit(problem.residual)) + np.log(h.weight)
        gain = X.T @ r - 0.5 * np.sum(X * X, axis=0) if few.size else np.zeros(1)
        best = int(np.argmax(gain))
        two = float(np.max(gain + gain[best] - X.T @ X[:, best])) if few.size else 0.0
        one = max(0.0, float(gain[best]))
        scores.append((none, none + one, none + max(one, two - _TWICE)))
        hypers.append(h)
    table = np.array(scores)
    if not np.isfinite(table).all():
        raise FloatingPointError("a covariance of the readings is not finite")
    chosen = [*np.argsort(-table[:, 2])[:_KEEP], int(np.argmax(table[:, 0])), int(np.argmax(table[:, 1]))]
    return [hypers[int(i)] for i in dict.fromkeys(chosen)]


def _few(bank: _Bank) -> NDArray[np.intp]:
    """Columns that stand for each candidate: those nearest to the readings, and evenly chosen ones."""
    out = []
    rough = np.hypot(bank.problem.u, 0.03 * bank.problem.scale)[:, None]
    for c in bank.candidates:
        apart = np.sum(((bank.problem.residual[:, None] - c.signatures) / rough) ** 2, axis=0)
        even = np.linspace(0, c.weight.size - 1, _FEW).round().astype(int)
        out.append(bank.spans[c.id].start + np.union1d(even, np.argsort(apart, kind="stable")[:_FEW]))
    return np.concatenate([np.zeros(0, dtype=np.intp), *out])


def _single(bank: _Bank, h: Hyper, white: Conditional) -> State:
    """Whitened readings and signatures, and the evidence of none and of every single effect."""
    problem = bank.problem
    r, S = white(problem.residual), white.changes(bank.S)
    none = -0.5 * float(r @ r) - white.log_det - float(white.misfit(problem.residual))
    state = State(h, white, r, S, 0.5 * np.sum(S * S, axis=0), log_z={NONE: none})
    gain = S.T @ r - state.half + bank.log_w
    for name, span in bank.spans.items():
        counts = bank.seen[span]
        among = np.flatnonzero(counts if counts.any() else ~counts)
        total, best = gain[span], int(among[np.argmax(gain[span][among])])
        for _ in range(2):  # the error of the law follows the size of the best setting, which depends on it
            width, columns = bank.columns(name, best)
            law = form.LawError.of(white.changes(columns), width)
            total = gain[span] + law.gain(r[:, None] - S[:, span])
            if (again := int(among[np.argmax(total[among])])) == best:
                break
            best = again
        state.forms[name] = law.at(r - S[:, span.start + best])
        state.log_z[Explanation.of(name)] = none + (float(log_sum(total[counts])) if counts.any() else _SHUT)
        # the error of a law is a share of what it changes
        state.small[Explanation.of(name)] = none + (float(log_sum(gain[span][~counts])) if not counts.all() else _SHUT)
        state.best[name] = best
    return state


def _pairs(bank: _Bank, state: State) -> None:
    """Evidence of two effects at a time, signatures added; the errors of both laws where they lead or count."""
    none, some = state.log_z[NONE], {}
    gain = state.S.T @ state.r - state.half
    for name, span in bank.spans.items():
        n, weight = span.stop - span.start, bank.log_w[span]
        at = np.arange(n)
        if n > _EVEN + _BEST:  # the best ones stand for themselves, even ones for what is nearest to them
            best = np.unique([*np.argsort(-gain[span])[:_BEST], state.best[name]])
            even = np.setdiff1d(np.linspace(0, n - 1, _EVEN).astype(int), best)
            rest = np.setdiff1d(at, best)
            near = np.argmin(np.abs(rest[:, None] - even[None, :]), axis=1)
            lent = np.log(np.bincount(near, np.exp(weight[rest]), even.size))
            at, weight = np.concatenate([best, even]), np.concatenate([weight[best], lent])
        some[name] = span.start + at, gain[span][at] + weight + np.where(bank.seen[span][at], 0.0, _SHUT)
    tables = {}
    for a, b in combinations(bank.spans, 2):
        (A, of_a), (B, of_b) = some[a], some[b]
        total = of_a[:, None] + of_b[None, :] - state.S[:, A].T @ state.S[:, B]
        pair = Explanation.of(a, b)
        state.log_z[pair], tables[pair] = none + float(log_sum(total.ravel())), (a, b, total)

    def most(pair: Explanation) -> float:
        return max(state.log_z[pair], *(state.log_z[Explanation.of(i)] for i in pair.ids))

    for k, pair in enumerate(sorted(tables, key=most, reverse=True)):
        better = max(state.log_z[Explanation.of(i)] for i in pair.ids)
        if k >= _PAIRS and state.log_z[pair] < better + EARNED:  # it counts as the better one as it is
            continue
        a, b, total = tables[pair]
        A, B = some[a][0], some[b][0]
        i, j = np.unravel_index(int(np.argmax(total)), total.shape)
        each = [bank.columns(k, int(c) - bank.spans[k].start) for k, c in ((a, A[i]), (b, B[j]))]
        law = form.LawError.of(state.white.changes(np.concatenate([x for _, x in each], axis=1)),
                          *(part for width, x in each for part in (width, x.shape[1] - width)))  # fmt: skip
        value = total + law.gain_of_two(state.r, state.S[:, A], state.S[:, B])
        state.log_z[pair] = none + float(log_sum(value.ravel()))


def _better(pair: Explanation, log_z: Mapping[Explanation, float]) -> Explanation:
    """Effect of a pair that has the larger evidence alone."""
    return max((Explanation.of(i) for i in pair.ids), key=lambda i: log_z[i])


def _posterior(
    states: Sequence[State], before: dict[Explanation, float], rough: Collection[str], stated: Collection[str]
) -> dict[Explanation, float]:  # fmt: skip
    """Probabilities: what is too small to count is none, a second effect that adds too little is not there.

    What is ``stated`` is not left out.

    Evidence between ``rough`` laws is tempered: they are off by a share of what they explain, so that they are told
    apart by no less than that share of the log odds (a power likelihood, as for any model that is known to be wrong).
    A pair in which a law adds too little to an exact cause is no evidence of any law.
    """
    weight = np.array([np.log(s.hyper.weight) for s in states])

    def together(values: Sequence[float]) -> float:
        return float(log_sum(np.array(values), weight))

    log_z = {k: together([s.log_z[k] for s in states]) for k in states[0].log_z}
    plain = dict(log_z)
    near = {
        k: v for k, v in log_z.items() if k.ids & set(rough) and (not k.pair or v >= plain[_better(k, plain)] + EARNED)
    }
    if near:
        top = max(near.values())
        power = EARNED / max(EARNED, min(effect_base.FORM) * (top - log_z[NONE]))
        log_z |= {k: top - power * (top - v) for k, v in near.items() if not k.pair}
    small = {k: together([s.small[k] for s in states]) for k in states[0].small}
    log_p = [log_z[k] + before[k] for k in log_z] + [v + before[k] for k, v in small.items()]
    p = shares(log_p)
    out = dict(zip(log_z, p.tolist(), strict=False))
    out[NONE] += float(np.sum(p[len(log_z) :]))
    for k in [k for k in out if k.pair]:
        better = _better(k, plain)
        if plain[k] < plain[better] + EARNED:
            out[better] += out[k]
            out[k] = 0.0
    for k in [k for k in out if k.ids & set(stated)]:
        out[Explanation.of(*(k.ids - set(stated)))] += out.pop(k)
    return out
