"""Evidence of two effects at a time, and what a second one must explain on top of the first."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.base.gaussian.evidence import log_sum
from bemt.judge.diagnose.explanation import NONE, Explanation
from bemt.judge.diagnose.signatures import effect_of
from bemt.judge.diagnose.state import State
from bemt.physics import effects
from bemt.physics.effects.base import FORM

if TYPE_CHECKING:
    from bemt.judge.diagnose.problem import Problem
    from bemt.judge.diagnose.signatures import Candidate

__all__ = ["DETAIL", "GEOMETRY", "best_pair", "every_pair", "price", "solve_together"]

Shape = Callable[[str, int], tuple[int, Array]]
"""Number of modes and columns of the error of an effect's law at one of its settings, not whitened."""

_PAIR_LEADERS = 60
# Times that the error of two laws follows the best setting.
_FOLLOWED = 2
# Single effects of which the best pair is looked for under every covariance.
_FIRST = 2
# Leading pairs that are solved together: what one effect changes depends on the other.
_TOGETHER, _ROUNDS = 24, 6
DETAIL, GEOMETRY = 0.1, 0.03
"""Share of what one effect explains (log odds) that two must explain on top: by so much its law may be off beyond what
the error of its form holds.  As of a smooth rest beside it, which is no other cause either.  The second of an effect
whose law is geometry and the solver: of 56 that led alone in three proofs, one had another of more, and 5 nats [1]."""


def best_pair(state: State, spans: Mapping[str, slice], log_w: Array, shape: Shape) -> None:
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
        state.log_z[pair] = _log_z(state, pair, spans, log_w, shape)


def every_pair(state: State, spans: dict[str, slice], log_w: Array, shape: Shape) -> None:
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
        state.log_z[pair] = _log_z(state, pair, spans, log_w, shape)


def _log_z(state: State, pair: Explanation, spans: Mapping[str, slice], log_w: Array, shape: Shape) -> float:
    """Logarithm of the evidence of two effects: all settings summed, the error of both laws in each, as of one effect.

    The columns of that error follow the best setting of the two together, which depends on them.
    """
    total = state.both(pair, spans, log_w)
    at, value = _largest(total), total
    for _ in range(_FOLLOWED):
        shapes = [shape(name, spans[name].start + k) for name, k in zip(pair, at, strict=True)]
        value = total + _form_gain(state, pair, spans, shapes, at)
        if (again := _largest(value)) == at:
            break
        at = again
    return state.log_z[NONE] + float(log_sum(value.ravel()))


def _largest(total: Array) -> tuple[int, int]:
    """Row and column of the largest entry."""
    i, j = np.unravel_index(int(np.argmax(total)), total.shape)
    return int(i), int(j)


def _form_gain(
    state: State, pair: Explanation, spans: Mapping[str, slice], shapes: Sequence[tuple[int, Array]],
    at: tuple[int, int],
) -> Array:  # fmt: skip
    """What the error of both laws adds to the log likelihood of every two settings, at its likeliest sizes, (A, B)."""
    A, B = (spans[i] for i in pair)
    widths = [x.shape[1] for _, x in shapes]
    if not sum(widths):
        return np.zeros((1, 1))
    plain = state.white.changes(np.concatenate([x for _, x in shapes], axis=1))
    rest, of_a, of_b = plain.T @ state.r, plain.T @ state.S[:, A], plain.T @ state.S[:, B]
    gram = plain.T @ plain
    choices = [(tuple(FORM) if modes else (min(FORM),)) if width else (1.0,)
               for (modes, _), width in zip(shapes, widths, strict=True)]  # fmt: skip
    sizes = list(product(*choices))
    scales = np.array([
        np.concatenate([np.where(np.arange(width) < modes, size, 1.0)
                        for (modes, _), width, size in zip(shapes, widths, chosen, strict=True)])
        for chosen in sizes
    ])  # fmt: skip
    roots = np.linalg.cholesky(np.eye(scales.shape[1]) + scales[:, :, None] * gram * scales[:, None, :])
    weights = np.array([sum(float(np.log(FORM.get(s, 1.0))) for s in chosen) for chosen in sizes])
    levels = weights - np.sum(np.log(np.diagonal(roots, axis1=1, axis2=2)), axis=1)
    found = np.linalg.solve(roots, (scales * (rest - of_a[:, at[0]] - of_b[:, at[1]]))[:, :, None])[:, :, 0]
    best = int(np.argmax([0.5 * float(d @ d) + level for d, level in zip(found, levels, strict=True)]))
    level, root, scale = float(levels[best]), roots[best], scales[best]
    r, a, b = (np.linalg.solve(root, scale[:, None] * v) for v in (rest[:, None], of_a, of_b))
    left = r - a
    out = 0.5 * np.sum(left * left, axis=0)[:, None] + 0.5 * np.sum(b * b, axis=0)[None, :] - left.T @ b + level
    if pair in state.mixed:
        extra, i, j = state.mixed[pair]
        share = np.outer(state.S[:, A].T @ state.S[:, i] / (2.0 * state.half[i]),
                         state.S[:, B].T @ state.S[:, j] / (2.0 * state.half[j]))  # fmt: skip
        e = np.linalg.solve(root, scale * (plain.T @ extra))
        out += 0.5 * share**2 * float(e @ e) - share * ((e @ left)[:, None] - (e @ b)[None, :])
    return np.asarray(out)


def solve_together(
    problem: Problem, candidates: Sequence[Candidate], states: Sequence[State], spans: Mapping[str, slice],
    log_w: Array, before: Mapping[Explanation, float], shape: Shape,
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
            s.log_z[pair] = _log_z(s, pair, spans, log_w, shape)


def price(
    problem: Problem, states: Sequence[State], modes: Mapping[str, Array]
) -> dict[Explanation, float]:  # fmt: skip
    """What each pair must explain on top of the best single effect, log odds, where that one's law has a form.

    An effect that shows along a recorded variable of its own (time, gap, wall) is no detail of another one's law.
    """
    weight = np.log([s.hyper.weight for s in states])
    none = float(log_sum([s.log_z[NONE] for s in states], weight))
    alone = {i: float(log_sum([s.log_z[Explanation.of(i)] for s in states], weight)) - none for i in modes}
    best = max(alone, key=lambda i: alone[i], default="")
    if not best or not modes[best].shape[1] or alone[best] <= 0.0:
        return {}
    own = {i for i in alone if any(v in problem.covariates for v in effects.catalogue()[i].along)}
    share = GEOMETRY if effects.catalogue()[best].geometric else DETAIL
    return {k: share * alone[best] for k in states[0].log_z if k.pair and min(k, key=lambda i: alone[i]) not in own}
