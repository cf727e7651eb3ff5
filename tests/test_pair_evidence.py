"""Two effects are summed like one: every two settings with the error of both laws, against the whole covariance."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bemt.judge.diagnose import form, pair_evidence
from bemt.judge.diagnose.state import State
from bemt.judge.explanation import NONE, Explanation

PAIR = Explanation.of("ground_effect", "untwist")


def state(seed: int, mixed: bool) -> tuple[State, dict[str, slice], np.ndarray, pair_evidence.Shape, np.ndarray]:
    """Whitened readings of 12 points, 5 and 4 settings of two effects, three modes of error each."""
    rng = np.random.default_rng(seed)
    S = rng.standard_normal((12, 9))
    spans = {name: part for name, part in zip(PAIR, (slice(0, 5), slice(5, 9)), strict=True)}
    white: Any = SimpleNamespace(changes=lambda v: v)
    hyper: Any = None
    out = State(hyper, white, 2.0 * S[:, 1] + S[:, 6] + rng.standard_normal(12), S, 0.5 * np.sum(S * S, axis=0))
    out.log_z[NONE] = -7.0
    if mixed:
        out.mixed[PAIR] = (0.3 * rng.standard_normal(12), 1, 6)
    modes = rng.standard_normal((12, 3))

    def shape(name: str, at: int) -> tuple[int, np.ndarray]:
        return 3, np.concatenate([S[:, at, None] * modes, 0.1 * modes[:, :1]], axis=1)

    return out, spans, np.log(np.full(9, 0.2)), shape, modes


@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_the_error_of_both_laws_is_that_of_the_whole_covariance(seed: int, mixed: bool) -> None:
    s, spans, log_w, shape, _ = state(seed, mixed)
    A, B = (spans[i] for i in PAIR)
    at = pair_evidence._largest(s.both(PAIR, spans, log_w))
    shapes = [shape(name, spans[name].start + k) for name, k in zip(PAIR, at, strict=True)]
    found = s.both(PAIR, spans, log_w) + pair_evidence._form_gain(s, PAIR, spans, shapes, at)

    def direct(i: int, j: int, sizes: tuple[float, float]) -> float:
        columns = [x * np.array([f, f, f, 1.0]) for (_, x), f in zip(shapes, sizes, strict=True)]
        W = np.concatenate(columns, axis=1)
        C = np.eye(12) + W @ W.T
        d = s.r - s.S[:, A.start + i] - s.S[:, B.start + j]
        if mixed:
            extra, k, m = s.mixed[PAIR]
            share = s.S[:, A.start + i] @ s.S[:, k] * (s.S[:, B.start + j] @ s.S[:, m]) / (4 * s.half[k] * s.half[m])
            d = d - share * extra
        prior = sum(np.log(form.FORM[f]) for f in sizes) + log_w[A.start + i] + log_w[B.start + j]
        return float(0.5 * s.r @ s.r - 0.5 * d @ np.linalg.solve(C, d) - 0.5 * np.linalg.slogdet(C)[1] + prior)

    sizes = max(product(form.FORM, repeat=2), key=lambda f: direct(*at, f))
    expected = [[direct(i, j, sizes) for j in range(4)] for i in range(5)]
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_no_pair_of_settings_is_worth_less_than_the_best_one() -> None:
    s, spans, log_w, shape, _ = state(0, False)
    z = pair_evidence._log_z(s, PAIR, spans, log_w, shape)
    at = pair_evidence._largest(s.both(PAIR, spans, log_w))
    shapes = [shape(name, spans[name].start + k) for name, k in zip(PAIR, at, strict=True)]
    one = (s.both(PAIR, spans, log_w) + pair_evidence._form_gain(s, PAIR, spans, shapes, at))[at]
    assert z >= s.log_z[NONE] + one - 1e-9
