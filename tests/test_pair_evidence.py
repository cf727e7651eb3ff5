"""Two effects are summed like one, against the whole covariance."""

from __future__ import annotations

import numpy as np
import pytest

from bemt.judge.diagnose import form
from bemt.physics.effects.base import FORM


@pytest.mark.parametrize("seed", range(3))
def test_the_error_of_both_laws_is_that_of_the_whole_covariance(seed: int) -> None:
    """Woodbury's form against determinant and inverse of the covariance, both sizes of the error summed."""
    rng = np.random.default_rng(seed)
    r, a, b, modes = (rng.standard_normal((12, n)) for n in (1, 5, 4, 3))
    columns = np.concatenate([a[:, 1:2] * modes, 0.1 * modes[:, :1], b[:, 2:3] * modes], axis=1)
    law = form.LawError.of(columns, 3, 1, 3)
    found = law.gain_of_two(r[:, 0], a, b)
    kind = np.array([1, 1, 1, 0, 1, 1, 1], dtype=bool)
    for i in range(5):
        for j in range(4):
            d, total = r[:, 0] - a[:, i] - b[:, j], 0.0
            for size, weight in FORM.items():
                W = columns * np.where(kind, size, 1.0)
                C = np.eye(12) + W @ W.T
                total += weight * np.exp(0.5 * d @ d - 0.5 * d @ np.linalg.solve(C, d) - 0.5 * np.linalg.slogdet(C)[1])
            assert found[i, j] == pytest.approx(np.log(total), abs=1e-9)
    np.testing.assert_allclose(law.gain(r - a - b[:, 1:2]), found[:, 1], atol=1e-9)


def test_instruments_have_no_error_of_a_law() -> None:
    law = form.LawError.of(np.zeros((6, 0)), 0)
    assert not law.gain(np.ones((6, 2))).any()
    assert not law.gain_of_two(np.ones(6), np.ones((6, 2)), np.ones((6, 3))).any()
