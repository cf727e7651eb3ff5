"""The Gaussian room against closed forms and limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from bemt.base.gaussian.evidence import LinearTerms, log_sum, shares
from bemt.base.gaussian.kernels import alike, modes, smooth
from bemt.base.gaussian.whitening import Restricted, conditional, contrasts, leave_one_out, log_density, whitener

Array = np.ndarray


def drawn(seed: int, M: int) -> tuple[np.random.Generator, Array]:
    """Generator and a covariance, positive definite."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((M, M))
    return rng, root @ root.T + 0.3 * np.eye(M)


seeds = st.integers(0, 2**31)
sizes = st.integers(1, 12)


# ---- whitening


@settings(max_examples=30, deadline=None)
@given(seeds, sizes)
def test_white_vectors_have_the_covariance_s_inverse_and_density(seed: int, M: int) -> None:
    rng, C = drawn(seed, M)
    x = rng.standard_normal((M, 3))
    white = whitener(C)
    np.testing.assert_allclose(white(x).T @ white(x), x.T @ np.linalg.solve(C, x), rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(C @ white.solve(x), x, atol=1e-8)
    np.testing.assert_allclose(white.back(white(x)), white.solve(x))
    assert 2.0 * white.log_det == pytest.approx(np.linalg.slogdet(C)[1])
    assert log_density(C, x[:, 0]) == pytest.approx(multivariate_normal(np.zeros(M), C).logpdf(x[:, 0]))
    without = log_density(C, x[:, 0], constant=False)
    assert without - log_density(C, x[:, 0]) == pytest.approx(0.5 * M * math.log(2.0 * math.pi))


def test_what_is_no_covariance_is_refused_and_a_singular_one_has_a_factor_with_noise() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        whitener(np.diag([1.0, -1.0]))
    one = np.ones((4, 4))
    assert np.isfinite(whitener(one, np.ones(4)).log_det)


@settings(max_examples=30, deadline=None)
@given(seeds, st.integers(2, 12))
def test_readings_given_the_others_are_as_likely_as_all(seed: int, M: int) -> None:
    rng, C = drawn(seed, M)
    mine = np.arange(M) % 2 == 0
    r, tiny = rng.standard_normal(M), np.zeros(M)
    part, whole = conditional(C, tiny, mine), whitener(C)
    assert part.log_det == pytest.approx(whole.log_det)
    assert 0.5 * float(part(r) @ part(r)) + part.misfit(r) == pytest.approx(0.5 * float(whole(r) @ whole(r)))
    # against the inverse's own block: the precision of some given the rest
    np.testing.assert_allclose(np.linalg.inv(part.covariance), np.linalg.inv(C)[np.ix_(mine, mine)], rtol=1e-6)


@settings(max_examples=30, deadline=None)
@given(seeds, st.integers(2, 8))
def test_left_out_values_are_those_of_a_model_that_never_had_them(seed: int, M: int) -> None:
    rng, C = drawn(seed, M)
    x = rng.standard_normal(M)
    found = leave_one_out(C, x)
    for k in range(M):
        rest = np.arange(M) != k
        gain = np.linalg.solve(C[np.ix_(rest, rest)], C[rest, k])
        sd = math.sqrt(C[k, k] - gain @ C[rest, k])
        assert found[k] == pytest.approx((x[k] - gain @ x[rest]) / sd, rel=1e-6)


# ---- kernels


@settings(max_examples=30, deadline=None)
@given(seeds, sizes)
def test_kernels_are_covariances_and_products_of_their_axes(seed: int, N: int) -> None:
    rng = np.random.default_rng(seed)
    x, y, group = rng.standard_normal(N), rng.standard_normal(N), rng.integers(0, 3, N)
    K = smooth((x, 0.7), (y, 2.0))
    np.testing.assert_allclose(K, smooth((x, 0.7)) * smooth((y, 2.0)))
    np.testing.assert_allclose(np.diag(K), 1.0)
    assert np.linalg.eigvalsh(K * alike(group)).min() > -1e-9
    np.testing.assert_allclose(smooth((x, 0.7), to=(y,)), np.exp(-0.5 * ((x[:, None] - y) / 0.7) ** 2))
    np.testing.assert_allclose(modes(K, -1e-12) @ modes(K, -1e-12).T if N == 1 else K, K)


def test_modes_give_the_kernel_back_but_for_what_is_small() -> None:
    x = np.linspace(0.0, 1.0, 30)
    K = smooth((x, 0.4))
    few = modes(K, 0.02)
    assert few.shape[1] < 8
    np.testing.assert_allclose(few @ few.T, K, atol=0.02 * np.linalg.eigvalsh(K)[-1])
    assert smooth((x, 1e9)).min() == pytest.approx(1.0) and smooth((x, 1e-9)).sum() == pytest.approx(30.0)


# ---- evidence


@settings(max_examples=30, deadline=None)
@given(seeds, st.integers(1, 12), st.integers(0, 4))
def test_linear_terms_add_to_the_covariance(seed: int, M: int, q: int) -> None:
    rng = np.random.default_rng(seed)
    B, x = rng.standard_normal((M, q)), rng.standard_normal((M, 3))
    terms = LinearTerms.of(B)
    both, alone = np.eye(M) + B @ B.T, np.eye(M)
    expected = [log_density(both, v) - log_density(alone, v) for v in x.T]
    np.testing.assert_allclose(terms.gain(x), expected, atol=1e-9)
    assert float(terms.gain(x[:, 0])) == pytest.approx(expected[0])
    # the posterior by brute force: precision 1 + B^T B
    mean, sd = terms.posterior(x[:, 0])
    cov = np.linalg.inv(np.eye(q) + B.T @ B)
    np.testing.assert_allclose(mean, cov @ B.T @ x[:, 0], atol=1e-9)
    np.testing.assert_allclose(sd, np.sqrt(np.diag(cov)))


def test_the_conjugate_normal_has_its_closed_form() -> None:
    """n readings of one mean: ln Z over that of none = (s^2 sum^2 / (1 + n s^2) - ln(1 + n s^2)) / 2."""
    x, s = np.array([0.4, 1.1, -0.2, 0.9, 0.7]), 1.7
    terms = LinearTerms.of(np.full((5, 1), s))
    known = 1.0 + 5.0 * s**2
    assert float(terms.gain(x)) == pytest.approx(0.5 * (s**2 * x.sum() ** 2 / known - math.log(known)))
    mean, sd = terms.posterior(x)
    assert s * mean[0] == pytest.approx(s**2 * x.sum() / known) and s * sd[0] == pytest.approx(s / math.sqrt(known))


def test_terms_that_are_known_to_be_nothing_gain_nothing_and_wide_ones_pay() -> None:
    rng = np.random.default_rng(1)
    B, x = rng.standard_normal((9, 2)), rng.standard_normal(9)
    assert float(LinearTerms.of(1e-9 * B).gain(x)) == pytest.approx(0.0, abs=1e-12)
    wide = [float(LinearTerms.of(10.0**k * B).gain(x)) for k in (3, 4)]
    assert wide[0] - wide[1] == pytest.approx(2.0 * math.log(10.0), abs=1e-4)  # Occam: one factor a term


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-500.0, 500.0), min_size=1, max_size=8), st.floats(-1e4, 1e4))
def test_sums_and_shares_do_not_depend_on_the_level(values: list[float], level: float) -> None:
    log_p = np.array(values)
    assert float(log_sum(log_p + level)) == pytest.approx(float(log_sum(log_p)) + level, abs=1e-8)
    assert max(values) - 1e-12 <= float(log_sum(log_p)) <= max(values) + math.log(len(values)) + 1e-12
    np.testing.assert_allclose(shares(log_p + level), shares(log_p), atol=1e-9)
    assert shares(log_p).sum() == pytest.approx(1.0)


def test_a_sum_of_nothing_is_nothing() -> None:
    assert float(log_sum([])) == -math.inf and float(log_sum([-math.inf, -math.inf])) == -math.inf
    assert log_sum(np.zeros((0, 3)), axis=0).tolist() == [-math.inf] * 3
    np.testing.assert_allclose(log_sum(np.log([[1.0, 2.0], [3.0, 4.0]]), axis=0), np.log([4.0, 6.0]))


# ---- restricted likelihood


def test_contrasts_do_not_see_what_is_fixed() -> None:
    rng = np.random.default_rng(2)
    fixed = rng.standard_normal((10, 3)) * [1.0, 1e-6, 1e6]
    K = contrasts(np.column_stack([fixed, fixed[:, 0], np.zeros(10)]))  # a column twice, one of nothing
    assert K.shape == (10, 7)
    np.testing.assert_allclose(K.T @ K, np.eye(7), atol=1e-10)
    assert np.abs(K.T @ (fixed / np.linalg.norm(fixed, axis=0))).max() < 1e-9


def test_the_likeliest_variance_about_an_unknown_mean_loses_one_degree_of_freedom() -> None:
    """The textbook case: REML of a sample with a free mean is sum of squares over n - 1, not over n."""
    x = np.array([1.0, 4.0, 2.0, 7.0, 3.0, 3.5])
    left = Restricted.of(x, np.ones((6, 1)), None, np.ones(6))
    assert left is not None
    tried = np.linspace(0.5, 5.0, 20001)
    best = tried[int(np.argmin([left.misfit(s) for s in tried]))]
    assert best == pytest.approx(x.std(ddof=1), rel=1e-3)
    assert left.misfit(0.0) > left.misfit(best)


def test_what_is_known_comes_first_and_parts_add() -> None:
    x = np.random.default_rng(3).standard_normal(40)
    known = Restricted.of(x, np.ones((40, 1)), np.full(40, 0.6), np.ones(40), np.ones(40))
    plain = Restricted.of(x, np.ones((40, 1)), None, np.ones(40))
    assert known is not None and plain is not None
    assert known.misfit(0.8, 0.0) == pytest.approx(plain.misfit(1.0))
    assert known.misfit(0.48, 0.64) == pytest.approx(plain.misfit(1.0))
    assert Restricted.of(x[:2], np.eye(2), None, np.ones(2)) is None
