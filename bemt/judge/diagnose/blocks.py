"""Blocks of readings that are left out in turn, and what an explanation predicts of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.gaussian.evidence import shares
from bemt.base.gaussian.whitening import whitener
from bemt.judge.diagnose import noise
from bemt.judge.diagnose.fit import fit, form_covariance

if TYPE_CHECKING:
    from bemt.judge.diagnose.posterior import Evidence
    from bemt.judge.diagnose.problem import Problem
    from bemt.judge.explanation import Explanation

REFERENCE = -1
"""Block of points that are always given: readings without the cause."""


def partitions(problem: Problem, most: int = 6) -> list[tuple[str, NDArray[np.intp]]]:
    """All ways to leave out whole blocks, never random rows: recordings, lines of rpm or J; else intervals."""
    P = problem.covariates["rpm"].size
    mine = np.zeros(P, dtype=bool)
    mine[problem.point[problem.free]] = True
    X = {k: v[mine] for k, v in problem.covariates.items()}
    count = int(mine.sum())
    run = X["run"].astype(int)
    out: list[tuple[str, NDArray[np.intp]]] = []

    def whole(block: NDArray[np.intp]) -> NDArray[np.intp]:
        every = np.full(P, REFERENCE, dtype=np.intp)
        every[mine] = block
        return every

    if len(problem.parts) > 1 and 3 <= np.unique(run).size <= most:
        out.append(("recordings", whole(np.unique(run, return_inverse=True)[1])))
    for name in ("rpm", "J"):
        x = np.log(X[name]) if name == "rpm" else X[name]
        gap = 0.03 if name == "rpm" else 0.02
        order = np.argsort(x, kind="stable")
        line = np.empty(count, dtype=np.intp)
        line[order] = np.cumsum(np.r_[0, np.diff(x[order]) > gap])
        lines = int(line.max()) + 1
        if 3 <= lines <= max(count // 2, 3):
            few = np.minimum(line * most // max(lines, most), most - 1) if lines > most else line
            out.append((f"all readings at one {name}", whole(few)))
    if out:
        return out
    spread = {
        k: float(np.ptp(v)) / max(float(np.max(np.abs(v))), 1e-12) for k, v in X.items() if k in ("rpm", "J", "time_s")
    }
    name = max(spread, key=lambda k: spread[k])
    rank = np.argsort(np.argsort(X[name], kind="stable"))
    return [(f"intervals of {name}", whole(rank * min(4, count) // count))]


def held_out(
    found: Evidence, what: Explanation, split: tuple[str, NDArray[np.intp]] | None = None
) -> tuple[str, Array, Array]:
    """Predict every block from the others, with and without an explanation."""
    problem = found.problem
    words, block = split or partitions(problem)[0]
    member = block[problem.point]
    hyper = found.states[0].hyper
    C = noise.covariance(problem, hyper)
    K = next((k.covariance for k in found.rivals if k.name == found.states[0].best_rival), np.zeros_like(C))
    S, log_w = _columns(found, what)
    r = problem.residual
    after, smooth_part = np.array(problem.centre), np.array(problem.centre)
    systematic = C - hyper.scale**2 * noise.noise(problem, hyper.ar)
    own = form_covariance(found, fit(found, what))
    for b in np.unique(member[member != REFERENCE]):
        test, train = member == b, member != b
        if not train.any():
            continue
        white = whitener((C + own)[np.ix_(train, train)], problem.u[train])
        w = white(np.column_stack([r[train], S[train]]))
        gain = w[:, 1:].T @ w[:, 0] - 0.5 * np.sum(w[:, 1:] ** 2, axis=0) + log_w
        p = shares(gain) if gain.size else np.zeros(0)
        expected = S @ p if gain.size else np.zeros_like(r)
        cross = (systematic + own)[np.ix_(test, train)]
        after[test] += expected[test] + cross @ white.solve((r - expected)[train])
        white = whitener((C + K)[np.ix_(train, train)], problem.u[train])
        smooth_part[test] += (systematic + K)[np.ix_(test, train)] @ white.solve(r[train])
    return words, after, smooth_part


def _columns(found: Evidence, what: Explanation) -> tuple[Array, Array]:
    """Signatures of an explanation; of a pair the settings near the best one."""
    M = found.problem.y.size
    ids = tuple(what)
    if not ids:
        return np.zeros((M, 0)), np.zeros(0)
    if len(ids) == 1:
        c = found.of(ids[0])
        return c.signatures, np.log(c.weight)
    best = fit(found, what)
    a, b = (found.of(i) for i in ids)
    i, j = (col - found.spans[k].start for col, k in zip(best.columns, ids, strict=True))
    interaction = best.signature - a.signatures[:, i] - b.signatures[:, j]
    rows, weight = [], []
    for k in range(a.weight.size):
        for m in range(b.weight.size):
            rows.append(a.signatures[:, k] + b.signatures[:, m] + interaction)
            weight.append(np.log(a.weight[k] * b.weight[m]))
    return np.stack(rows, axis=1), np.array(weight)
