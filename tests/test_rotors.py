"""Rotors as built: the promises of priors, intervals and conditioning."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import paired
import peer_ccblade
import population_fit as fit
import pytest
from population_fit import Rotors, with_families

import bemt
from bemt.__main__ import main
from bemt.base.errors import InputError
from bemt.rotors.case import load_case
from bemt.rotors.case.prepare import prepare_case
from bemt.rotors.case.propagate import channels_at, propagate
from bemt.rotors.conditioning import ReferenceRun, condition, noise_of_run, scatter
from bemt.rotors.latents import NAMES, Prior, Sensed
from bemt.rotors.model import RealRotor, coefficients
from bemt.rotors.population import WEIGHTS, Population, population, sizes
from bemt.rotors.predict import LEVELS, Prediction, half_width, inside, pair_half_width, predict
from bemt.rotors.validate import points
from bemt.rotors.validate.points import ComparedRotor
from bemt.rotors.validity import Validity

K = len(NAMES)
CASE = """schema = "bemt.case/1"
name = "some_10x5"
[rotor]
kind = "propeller"
blades = 2
diameter_in = 10
hub_ratio = 0.15
[blade]
{blade}
[blade.section]
camber = 0.035
thickness = 0.09
[operating]
rpm = 5000
airspeed_m_s = 6
[air]
density_kg_m3 = 1.225
"""
LABEL = 'pitch_in = 5\nchord_law = "apc_like"\nmax_chord_over_R = 0.19'


def _case(folder: Path, blade: str = LABEL) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "case.toml").write_text(CASE.format(blade=blade))
    return folder


def _sensed(n: int = 12, seed: int = 0) -> Sensed:
    random = np.random.default_rng(seed)
    x = np.linspace(0.0, 0.8, n)
    f = np.array([0.10 * (1.0 - x), 0.04 * (1.0 - 0.5 * x)])
    top = np.repeat(f[:, :1], n, axis=1)
    T = random.normal(size=(2, K, n)) * top[:, None] * 0.1
    return Sensed(0.254, 0.6 * x, 12.0 - 11.0 * x, np.full(n, 6e4), f, top, T)


def test_half_width_is_the_inverse_of_inside() -> None:
    sds = np.random.default_rng(1).uniform(0.1, 3.0, (40, WEIGHTS.size))
    for level in LEVELS:
        assert inside(half_width(level, sds, WEIGHTS), sds, WEIGHTS) == pytest.approx(level, abs=1e-9)
    with_equal = half_width(LEVELS[1], np.full((1, WEIGHTS.size), 1.5), WEIGHTS)
    assert with_equal == pytest.approx(3.0, abs=1e-6)  # one normal law: two standard deviations


@pytest.mark.parametrize("nu", [(2.05, 2.05), (9.3, 4.6), (3.0, 200.0)])
def test_half_width_of_a_sum_is_that_of_all_pairs_of_sizes(nu: tuple[float, float]) -> None:
    first, second = np.random.default_rng(2).lognormal(0.0, 2.0, (2, 200))
    first[0], second[1], first[2], second[2] = 0.0, 0.0, 0.0, 0.0
    s, t = sizes(nu[0]), sizes(nu[1])
    pairs = np.hypot((first[:, None] * s)[:, :, None], (second[:, None] * t)[:, None, :]).reshape(200, -1)
    for level in LEVELS:
        found = pair_half_width(level, first, second, (s, t), (WEIGHTS, WEIGHTS))
        assert found == pytest.approx(
            half_width(level, pairs, np.outer(WEIGHTS, WEIGHTS).ravel()), rel=1e-7, abs=1e-140
        )


def test_better_knowledge_is_never_wider() -> None:
    p = population()
    sds = [p.prior(known, 0.254).sd[0] for known in ("cad", "scan", "stations", "label")]
    assert sds == sorted(sds) and sds[0] < sds[-1]
    small, usual = (p.rest_sd(replace(_sensed(), diameter_m=D)) for D in (0.0762, 0.254))
    assert np.all(small > usual)  # small ones are known worse
    assert np.all(p.prior("label", 0.254, declared=("angle", "chord")).sd <= p.prior("label", 0.254).sd)
    # the label narrows the stations' angle and pulls it towards itself, by a share below one
    alone, beside = p.prior("stations", 0.254), p.prior("stations", 0.254, gap_deg=p.offset_deg + 2.0)
    assert beside.sd[0] < alone.sd[0] and -2.0 < beside.mean[0] < 0.0
    assert p.prior("stations", 0.254, gap_deg=p.offset_deg).mean == pytest.approx(alone.mean)
    stated = p.prior("stations", 0.254, sds={"angle_deg": 0.2})
    assert stated.sd[0] == pytest.approx(0.2) and stated.sd[1:] == pytest.approx(alone.sd[1:])


def test_intervals_hold_what_they_say_of_rotors_drawn_from_the_population() -> None:
    p, at, random = population(), _sensed(), np.random.default_rng(2)
    prior = p.prior("stations", at.diameter_m)
    found = predict(p, prior, at)
    rest = p.rest(at) + np.diag(p.noise_sd(at).reshape(-1) ** 2)
    root = np.linalg.cholesky(rest)
    values, vectors = np.linalg.eigh(prior.cov)
    half = vectors * np.sqrt(np.maximum(values, 0.0))
    held = np.zeros(2)
    n = 4000
    for _ in range(n):
        size, rough = random.choice(prior.sizes, p=prior.weights), random.choice(p.rest_sizes, p=WEIGHTS)
        z = prior.mean + size * half @ random.normal(size=K)
        y = at.f + p.bias(at) + np.einsum("ckp,k->cp", at.T, z)
        y = y + (rough * root @ random.normal(size=root.shape[0])).reshape(2, -1)
        held += [np.mean(np.abs(y - found.mean) <= found.half_width(level, noise=True)) for level in LEVELS]
    assert held / n == pytest.approx(LEVELS, abs=0.015)


def test_what_the_solver_lacks_is_drag_of_the_hub_and_lift_over_Re() -> None:
    p, at = population(), replace(_sensed(), Re=np.full(12, 4e5))
    lacking = p.bias(at)
    # from 3e5 on no lift is known to lack: the drag of a disk of 0.15 D, off thrust only
    area = math.pi / 4.0 * 0.15**2
    assert lacking[0] == pytest.approx(-0.5 * p.hub_cd * area * at.J**2, abs=1e-15)
    assert lacking[1] == pytest.approx(0.0, abs=1e-15)
    assert 0.5 < p.hub_cd < 1.5  # a bluff body (Hoerner 1965)
    low, high = (p.bias(replace(at, Re=np.full(12, Re))) - lacking for Re in (3e4, 1e5))
    assert low == pytest.approx(-high, abs=1e-12)
    # less of it at large angles of attack, at rest, than near zero thrust
    share = np.abs(high / at.T[:, NAMES.index("lift")])
    assert np.all(np.diff(share) > 0.0)


def _after_a_run(y: np.ndarray, at: Sensed, run: np.ndarray) -> tuple[Prediction, Prediction]:
    """Prediction before and after a run at some points of a linear solver."""
    p = population()
    prior = p.prior("stations", at.diameter_m)
    here = at.part(run)
    T = np.moveaxis(here.T, 1, 2).reshape(2 * run.size, K)
    noise = noise_of_run(p, here, y, p.noise_sd(here))
    bias = p.bias(here).reshape(-1)
    found = condition(
        lambda z: here.f.reshape(-1) + T @ z + bias, prior, y.reshape(-1), noise, p.rest_sizes, WEIGHTS, most=1
    )
    reference = ReferenceRun.given(here, noise, y.reshape(-1), found)
    posterior = Prior(found.mean, found.cov, np.ones(1), np.ones(1), "reference")
    return predict(p, prior, at), predict(p, posterior, at, reference=reference)


def test_a_run_that_fits_narrows_and_one_that_no_rotor_could_make_does_not() -> None:
    p, run, held = population(), np.arange(5), []
    for seed in range(60):
        at = _sensed(seed=seed)
        fair = (at.f + p.bias(at))[:, run]
        before, after = _after_a_run(fair, at, run)
        assert np.all(after.half_width()[:, 6:] < before.half_width()[:, 6:])
        wild = fair * np.array([1.25, 0.8, 1.3, 0.75, 1.2])  # up and down from point to point
        _, misled = _after_a_run(wild, at, run)
        assert np.all(misled.half_width()[:, run] > after.half_width()[:, run])
        assert np.median(misled.half_width()[:, 6:] / after.half_width()[:, 6:]) > 1.0
        held.append(np.abs(misled.mean - (at.f + p.bias(at))) <= misled.half_width(LEVELS[1]))
    assert np.mean(np.array(held)[..., 6:]) > 0.95


def test_a_run_says_nothing_of_the_rest_far_from_it() -> None:
    at, p = _sensed(), population()
    far = replace(at, Re=at.Re * np.where(np.arange(at.J.size) > 8, 1e12, 1.0))
    _, after = _after_a_run((at.f * 1.02)[:, :5], far, np.arange(5))
    usual = p.rest_sd(at)
    assert after.rest_sd[:, 9:] == pytest.approx(usual[:, 9:], rel=1e-2)
    assert np.all(after.rest_sd[:, :5] < 0.8 * usual[:, :5])


def test_scatter_is_that_of_readings_not_of_the_curve() -> None:
    random, t = np.random.default_rng(9), np.linspace(3e4, 9e4, 4000)
    assert scatter(0.1 + 1e-6 * t, t) == pytest.approx(0.0, abs=1e-12) and scatter(t[:4] ** 2, t[:4]) == 0.0
    order = random.permutation(t.size)
    noisy = 0.1 + 0.05 * np.sin(t / 3e4) + 0.002 * random.normal(size=t.size)
    assert scatter(noisy[order], t[order]) == pytest.approx(0.002, rel=0.05)


def test_density_integrates_to_one_and_agrees_with_the_intervals() -> None:
    at = _sensed(2)
    found = predict(population(), population().prior("stations", at.diameter_m), at)
    y = np.linspace(found.mean[0, 0] - 0.2, found.mean[0, 0] + 0.2, 20001)
    log = np.array([found.log_density(np.full((2, 2), v))[0, 0] for v in y[::20]])
    density, step = np.exp(log), y[20] - y[0]
    assert density.sum() * step == pytest.approx(1.0, abs=1e-4)
    inner = np.abs(y[::20] - found.mean[0, 0]) <= found.half_width(LEVELS[0], noise=True)[0, 0]
    assert density[inner].sum() * step == pytest.approx(LEVELS[0], abs=0.02)


Array = np.ndarray[Any, Any]
COVERED = Validity((0.05, 0.5), (0.0, 0.9), (4e3, 1.4e5), 0.28, (2, 4), (0.3, 1.1))
INSIDE: dict[str, Any] = {"diameter_m": 0.25, "blades": 2, "pitch_over_D": 0.5, "x": 0.4, "Re": 6e4, "M_tip": 0.2}


def _factor(**changes: Any) -> tuple[Any, Any]:
    at = INSIDE | changes
    size = max(np.size(v) for v in at.values())
    arrays = {k: np.broadcast_to(np.asarray(at[k], float), size) for k in ("x", "Re", "M_tip")}
    factor, words = COVERED.at(**(at | arrays))
    return factor, [" ".join(w) for w in words]


def test_inside_the_measured_rotors_nothing_is_widened_nor_said() -> None:
    assert _factor() == (np.ones(1), [""])
    edge = {"x": 0.9, "Re": 1.4e5, "M_tip": 0.28, "blades": 4, "pitch_over_D": 1.1, "diameter_m": 0.5}
    assert _factor(**edge) == (np.ones(1), [""])


@pytest.mark.parametrize(
    ("name", "values", "word"),
    [
        ("x", np.linspace(0.9, 100.0, 2000), "zero thrust"),
        ("x", np.linspace(0.0, -3.0, 200), "zero thrust"),
        ("Re", np.geomspace(4e3, 10.0, 200), "Re "),
        ("Re", np.geomspace(1.4e5, 1e8, 200), "Re "),
        ("M_tip", np.linspace(0.28, 1.3, 200), "tip Mach"),
    ],
)
def test_outside_the_band_grows_with_the_distance_without_a_jump_and_says_why(
    name: str, values: Array, word: str
) -> None:
    factor, words = _factor(**{name: values})
    assert factor[0] == 1.0 and np.all(np.diff(factor) >= 0.0) and np.max(np.diff(factor)) < 0.1
    assert factor[-1] > 1.5 and word in words[-1] and f" {factor[-1]:.3g} times" in words[-1]


@pytest.mark.parametrize(
    ("near", "far"),
    [({"blades": 5}, {"blades": 8}), ({"diameter_m": 0.6}, {"diameter_m": 2.0}),
     ({"diameter_m": 0.04}, {"diameter_m": 0.01}), ({"pitch_over_D": 1.3}, {"pitch_over_D": 2.2})],
)  # fmt: skip
def test_a_rotor_farther_from_the_measured_ones_is_less_certain(near: dict[str, Any], far: dict[str, Any]) -> None:
    assert 1.0 < _factor(**near)[0] < _factor(**far)[0]


def test_every_departure_is_named_and_widens() -> None:
    many, fast = _factor(blades=11), _factor(M_tip=0.9)
    both, words = _factor(blades=11, M_tip=0.9)
    assert both > max(many[0], fast[0]) and "11 blades" in words[0] and "tip Mach" in words[0]
    assert "do not trust" in _factor(x=100.0)[1][0] and "do not trust" not in fast[1][0]


def test_ranges_of_a_population_survive_its_file() -> None:
    p = population()
    assert p.validity is not None and Population.of(json.loads(json.dumps(p.document()))).validity == p.validity
    assert Validity.of_rotors([COVERED, COVERED]) == COVERED


def _family(name: str, angle_deg: float, n: int, seed: int) -> list[ComparedRotor]:
    """Rotors whose blades all stand off their drawings by the same angle."""
    out = []
    for k in range(n):
        at = _sensed(10, seed + k)
        y = at.f + angle_deg * at.T[:, NAMES.index("angle_deg")]
        out.append(ComparedRotor(**vars(at), name=f"{name}{k}", family=name, section="rule", gap_deg=math.nan,
                                 static=at.J == 0.0, y=y))  # fmt: skip
    return out


def test_what_a_family_has_in_common_is_found_and_shrunk() -> None:
    p = population()
    rotors = [m for k in range(6) for m in _family(f"f{k}", (-1.0) ** k, 4, 10 * k)] + _family("alone", 3.0, 1, 99)
    found = with_families(p, Rotors(rotors))
    for k in range(6):
        kin = found.families[f"f{k}"]
        assert 0.3 < kin.mean[0] * (-1.0) ** k < 1.3 and kin.cov[0, 0] < p.stations_deg**2
    assert 0.5 < found.families["alone"].mean[0] < 3.0  # one rotor tells less of its family than four
    assert found.families["alone"].cov[0, 0] > found.families["f0"].cov[0, 0]
    known, unknown = (found.prior("stations", 0.254, family=name, section="rule") for name in ("f0", "new"))
    assert known.sd[0] < unknown.sd[0] and known.mean[0] > unknown.mean[0]


def test_likelihood_of_all_rotors_at_once_is_that_of_a_mixture_of_normal_laws() -> None:
    from scipy.special import logsumexp

    p, rotors = population(), [*_family("a", 1.0, 2, 3), *_family("b", 0.5, 1, 7)]
    short = vars(rotors[1].part(np.arange(6)))
    rotors[1] = replace(rotors[1], **short, static=rotors[1].static[:6], y=rotors[1].y[:, :6])
    together = Rotors(rotors).log_likelihood(p)
    for m, value in zip(rotors, together, strict=True):
        at, law = m.part(fit.counted(m)), points.law(p, m)
        top = np.abs(at.top).reshape(-1)
        T = np.moveaxis(at.T, 1, 2).reshape(top.size, K) / top[:, None]
        N = (p.rest(at) + np.diag(p.noise_sd(at).reshape(-1) ** 2)) / np.outer(top, top)
        r = (m.y[:, fit.counted(m)] - at.f - p.bias(at)).reshape(-1) / top - T @ law.mean
        whole, alone = [], []
        for s in law.sizes**2:
            for t in p.rest_sizes**2:
                S = s * T @ law.cov @ T.T + t * N
                whole.append(-0.5 * (r @ np.linalg.solve(S, r) + np.linalg.slogdet(S)[1]))
                alone.append(-0.5 * (r**2 / np.diag(S) + np.log(np.diag(S))))
        chance = np.outer(WEIGHTS, WEIGHTS).reshape(-1)
        expected = logsumexp(whole, b=chance) + fit.MARGINAL * logsumexp(alone, axis=0, b=chance[:, None]).sum()
        assert value == pytest.approx(expected, rel=1e-8)


def test_slow_flyers_have_more_camber_whoever_made_them() -> None:
    p, camber = population(), NAMES.index("camber_deg")
    slow, usual = (p.prior("stations", 0.254, section="rule", blade_class=c).mean[camber] for c in ("slow_flyer", None))
    assert 1.0 < slow - usual < 4.0
    assert p.prior("stations", 0.254, section="published", blade_class="slow_flyer").mean[camber] == 0.0


def test_a_real_rotor_says_the_same_by_covariance_and_by_prediction() -> None:
    """Its intervals are the diagonal of its covariance; a run conditions it as a Gaussian process does."""
    p, at = population(), _sensed(10)
    prior = p.prior("stations", 0.254)

    def solve(z: np.ndarray, rpm: np.ndarray, J: np.ndarray, which: np.ndarray) -> np.ndarray:
        rows = np.searchsorted(at.J, J)
        return at.f[:, rows] + np.einsum("ckp,k->cp", at.T[:, :, rows], z)

    rotor = RealRotor(solve, 0.254, 14.0, prior, np.zeros(K))
    here = rotor.at(np.full(10, 5000.0), at.J, at.Re)
    found, C = rotor.predict(here), rotor.covariance(here)
    assert np.diag(C).reshape(2, -1) == pytest.approx(found.latent_sd**2 + found.rest_sd**2, rel=1e-9)
    assert rotor.covariance(here, here.part(np.arange(3))) == pytest.approx(C[:, [0, 1, 2, 10, 11, 12]], rel=1e-9)
    run = here.part(np.arange(4))
    noise = noise_of_run(p, run, run.f, p.noise_sd(run), (0.0, 0.0))
    T = run.T.transpose(0, 2, 1).reshape(8, K)
    one, start = np.ones(1), (run.f + p.bias(run)).reshape(-1)
    told = condition(lambda z: start + T @ z, replace(prior, sizes=one, weights=one), run.f.reshape(-1), noise, most=1)
    after = RealRotor(solve, 0.254, 14.0, Prior(told.mean, told.cov, np.ones(1), np.ones(1)), np.zeros(K),
                      ReferenceRun.given(run, noise, run.f.reshape(-1), told))  # fmt: skip
    k = rotor.covariance(here, run)
    S = rotor.covariance(run) + np.diag(p.noise_sd(run).reshape(-1) ** 2)
    assert after.covariance(here) == pytest.approx(C - k @ np.linalg.solve(S, k.T), rel=1e-6, abs=1e-12)
    mean = (here.f + p.bias(here)).reshape(-1) + rotor.tangents(here) @ prior.mean
    left = run.f.reshape(-1) - mean.reshape(2, -1)[:, :4].reshape(-1)
    assert after.expected(here).reshape(-1) == pytest.approx(mean + k @ np.linalg.solve(S, left), rel=1e-6)


def test_a_run_tells_less_of_a_blade_that_was_turned() -> None:
    p, at = population(), _sensed(10)
    run = ReferenceRun(at, np.zeros(20), p.rest(at) + np.diag(p.noise_sd(at).reshape(-1) ** 2))
    left = [np.diag(run.rest(p, replace(at, alpha_deg=at.alpha_deg + turn))) for turn in (0.0, 2.0, 5.0, 15.0)]
    usual = p.rest_sd(at).reshape(-1) ** 2
    assert np.all(np.diff(np.median(left / usual, axis=1)) > 0.0) and np.all(left[-1] < usual)
    assert np.median(left[0] / usual) < 0.1


def test_condition_is_exact_for_a_linear_solver() -> None:
    random = np.random.default_rng(3)
    T, noise = random.normal(size=(20, K)), np.diag(random.uniform(0.01, 0.1, 20))
    root = random.normal(size=(K, K))
    prior = Prior(random.normal(size=K), root @ root.T, np.ones(1), np.ones(1))
    f = random.normal(size=20)
    y = f + T @ (prior.mean + root @ random.normal(size=K)) + random.normal(size=20) * 0.2
    found = condition(lambda z: f + T @ z, prior, y, noise)
    precision = np.linalg.inv(prior.cov) + T.T @ np.linalg.inv(noise) @ T
    mean = prior.mean + np.linalg.solve(precision, T.T @ np.linalg.inv(noise) @ (y - f - T @ prior.mean))
    assert found.converged
    assert found.mean == pytest.approx(mean, rel=1e-6, abs=1e-8)
    assert found.cov == pytest.approx(np.linalg.inv(precision), rel=1e-6, abs=1e-9)
    S = T @ prior.cov @ T.T + noise
    r = y - f - T @ prior.mean
    evidence = -0.5 * (r @ np.linalg.solve(S, r) + np.linalg.slogdet(S)[1] + r.size * math.log(2.0 * math.pi))
    assert found.log_evidence == pytest.approx(evidence, rel=1e-9)


def test_condition_ends_where_it_stands_still_though_the_solver_is_rough() -> None:
    """A step within the tolerance may lose what the tolerance is worth."""
    random = np.random.default_rng(76)
    T, size, rate = random.standard_normal((12, K)), random.uniform(0.2, 1.5), random.uniform(0.5, 3)
    wave = random.standard_normal(12)

    def solve(z: np.ndarray) -> np.ndarray:
        return np.asarray(T @ z + size * wave * np.sin(rate * z[0]))

    y = solve(np.array([1.0, 0.3, -0.2, 0.1])) + 0.3 * random.standard_normal(12)
    assert condition(solve, Prior(np.zeros(K), np.eye(K), np.ones(1), np.ones(1)), y, np.eye(12)).converged


def test_condition_leaves_exact_numbers_and_missing_rows_alone() -> None:
    T = np.random.default_rng(4).normal(size=(8, K))
    cov = np.eye(K)
    cov[-1] = cov[:, -1] = 0.0
    prior = Prior(np.full(K, 0.3), cov, np.array([1.0, 3.0]), np.array([0.8, 0.2]))
    y = T @ np.arange(K)
    y[2] = np.nan
    found = condition(lambda z: T @ z, prior, y, 0.01 * np.eye(8))
    assert found.mean[-1] == pytest.approx(0.3) and found.cov[-1] == pytest.approx(0.0, abs=1e-12)
    assert np.isfinite(found.mean).all()


def test_readings_are_doubted_for_contradicting_each_other_and_one_contradicts_none() -> None:
    T, prior, noise = np.ones((2, K)), Prior(np.zeros(K), np.eye(K), np.ones(1), np.ones(1)), np.eye(2)
    tail = population().rest_sizes, WEIGHTS
    one = condition(lambda z: T[:1] @ z, prior, np.array([40.0]), noise[:1, :1], *tail)
    apart = condition(lambda z: T @ z, prior, np.array([40.0, -40.0]), noise, *tail)
    assert one.excess == 1.0 and apart.excess > 50.0


@pytest.mark.parametrize(
    ("blade", "where"),
    [
        (LABEL + '\nknown_from = "hearsay"', "blade.known_from"),
        (LABEL + '\nknown_from = "reference"', "blade.known_from"),
        (LABEL + '\nknown_from = "measured"', "blade.known_from"),
        (LABEL + '\nknown_from = "scan"\nas_built = {reading = "rpm=5400,thrust_g=410"}', "blade.known_from"),
        (LABEL + "\nlabel_pitch_in = 127", "blade.label_pitch_in"),
    ],
)
def test_faults_of_a_case(tmp_path: Path, blade: str, where: str) -> None:
    with pytest.raises(InputError) as caught:
        load_case(_case(tmp_path / "case", blade))
    assert [f.where for f in caught.value.faults] == [where]


@pytest.mark.parametrize("kind", ["propeller", "fan"])
def test_a_reading_in_a_case_needs_no_second_key(tmp_path: Path, kind: str) -> None:
    """What tells of the rotor as built says how it is known; a fan's case takes a reading as a propeller's does."""
    if kind == "fan":
        bemt.new("70mm", fan=True, out=tmp_path / "plain")
        text, reading = (tmp_path / "plain" / "case.toml").read_text(), "rpm=49000, thrust_g=2100"
    else:
        _case(tmp_path / "plain")
        text, reading = (tmp_path / "plain" / "case.toml").read_text(), "rpm=5400, thrust_g=410"
    found = []
    for name, key in (("one", ""), ("two", 'known_from = "reference"\n')):
        (tmp_path / name).mkdir()
        built = f'[blade]\n{key}as_built = {{reading = "{reading}"}}\n'
        (tmp_path / name / "case.toml").write_text(text.replace("[blade]\n", built))
        found.append(load_case(tmp_path / name).as_built())
    assert np.array_equal(found[0].prior.mean, found[1].prior.mean) and found[0].prior.known_from == "reference"
    assert not np.allclose(found[0].prior.mean, load_case(tmp_path / "plain").as_built().prior.mean)


def test_a_stated_angle_turns_the_blade(tmp_path: Path) -> None:
    plain = load_case(_case(tmp_path / "a"))
    turned = load_case(_case(tmp_path / "b", LABEL + "\nas_built = {angle_deg = 1.5, angle_sd_deg = 0.1}"))
    offset = load_case(_case(tmp_path / "c", LABEL + "\nbeta_offset_deg = 1.5"))
    rpm, J, one = np.array([5000.0]), np.array([0.3]), np.zeros(1, dtype=np.intp)
    CT = [
        coefficients(prepare_case(c), c.air())(c.as_built().drawn, rpm, J, one)[0, 0] for c in (plain, turned, offset)
    ]
    assert CT[1] == pytest.approx(CT[2], rel=1e-6) and CT[1] > CT[0]
    assert turned.as_built().prior.sd[0] == pytest.approx(0.1) and plain.as_built().prior.known_from == "label"


def test_calibrate_rotor_finds_a_turned_blade_and_narrows_what_follows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = load_case(_case(tmp_path / "truth", LABEL + "\nas_built = {angle_deg = 2.0}"))
    rpm = np.repeat(np.linspace(3000.0, 7000.0, 6), 2)
    J = np.tile([0.0, 0.3], 6)
    solve = coefficients(prepare_case(truth), truth.air())
    CT, CP = solve(truth.as_built().drawn, rpm, J, np.arange(12))
    random = np.random.default_rng(7)
    rows = [
        f"{n:.0f},{V:.6f},{t:.6f},{q:.6f}"
        for n, V, t, q in zip(
            rpm, J * rpm / 60 * 0.254, CT * 1.225 * (rpm / 60) ** 2 * 0.254**4 * (1 + 0.003 * random.normal(size=12)),
            CP / (2 * np.pi) * 1.225 * (rpm / 60) ** 2 * 0.254**5 * (1 + 0.003 * random.normal(size=12)), strict=True,
        )
    ]  # fmt: skip
    run = tmp_path / "run.csv"
    run.write_text("\n".join(["rpm,airspeed_m_s,thrust_N,torque_Nm", *rows]) + "\n")
    drawn = _case(tmp_path / "drawn")
    args = ["calibrate-rotor", str(run), "--case", str(drawn), "--out", str(tmp_path / "known"), "--json"]
    assert main(args) == 0
    found = json.loads(capsys.readouterr().out)["numbers"]["angle_deg"]
    assert abs(found["after"] - 2.0) < 2.0 * found["u_after"] and found["u_after"] < found["u_before"]
    known = load_case(tmp_path / "known")
    assert known.as_built().prior.known_from == "reference"
    u = {}
    for name in ("drawn", "known"):
        assert main(["sweep", str(tmp_path / name), "--out", str(tmp_path / "out" / name), "--json"]) == 0
        row = json.loads(capsys.readouterr().out)["cases"][0]["rows"][0]
        u[name] = row["u_model"] / row["thrust_N"]
    assert u["known"] < 0.5 * u["drawn"]


def test_a_calibrated_rotor_is_solved_with_all_that_its_run_tells(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Thrust in flight that no angle, camber or factor of the blade explains: at the run's own points it is met."""
    drawn = _case(tmp_path / "drawn")
    rpm = np.linspace(4000.0, 7000.0, 8)
    V = np.repeat([0.0, 0.35], 4) * rpm / 60 * 0.254
    before = propagate(load_case(drawn), rpm, V, bands=False).points
    thrust = before.thrust_N * np.where(V > 0.0, 0.85, 1.05)
    run = tmp_path / "run.csv"
    rows = [f"{n:.0f},{v:.6f},{t:.6f},{q:.6f}" for n, v, t, q in zip(rpm, V, thrust, before.torque_Nm, strict=True)]
    run.write_text("\n".join(["rpm,airspeed_m_s,thrust_N,torque_Nm", *rows]) + "\n")
    args = ["calibrate-rotor", str(run), "--case", str(drawn), "--out", str(tmp_path / "known"), "--quiet"]
    assert main(args) == 0
    capsys.readouterr()
    case = load_case(tmp_path / "known")
    known, banded = (propagate(case, rpm, V, bands=bands).points for bands in (False, True))
    np.testing.assert_allclose(known.thrust_N, thrust, rtol=0.025)
    np.testing.assert_array_equal(known.thrust_N, banded.thrust_N)
    np.testing.assert_allclose(known.power_W, known.torque_Nm * rpm * np.pi / 30.0, rtol=1e-12)
    grid, _ = channels_at(prepare_case(case), rpm, V, np.zeros(8), case.air())
    np.testing.assert_allclose(grid["thrust_N"], known.thrust_N, rtol=1e-9)


def test_calibrate_rotor_refuses_a_run_of_another_rotor_or_unit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Loads in mN moved nothing and were written down as the blade of this rotor."""
    run = tmp_path / "run.csv"
    run.write_text("rpm,thrust_N,torque_Nm\n5000,2500,50\n6000,3700,70\n7000,5100,100\n")
    drawn, known = _case(tmp_path / "drawn"), tmp_path / "known"
    assert main(["calibrate-rotor", str(run), "--case", str(drawn), "--out", str(known)]) == 2
    assert "loads of this rotor" in capsys.readouterr().err and not known.exists()


def test_paired_difference_knows_its_chance() -> None:
    random = np.random.default_rng(8)
    theirs = random.uniform(0.05, 0.2, 60)
    better = paired.difference(list(zip(theirs - 0.03, theirs, strict=True)))
    assert better["won"] == 60 and better["difference"] == pytest.approx(-0.03)
    assert better["interval95"] == pytest.approx([-0.03, -0.03])
    alike = paired.difference(list(zip(theirs + 0.02 * random.normal(size=60), theirs, strict=True)))
    low, high = alike["interval95"]
    assert low < 0.0 < high


def test_peer_agrees_with_the_solver_on_the_same_physics() -> None:
    """CCBlade on a light propeller, same stations, tables and physics: thrust and power within a few percent."""
    pytest.importorskip("wisdem", reason="the optional package wisdem is not installed")
    from bemt.physics import effects
    from bemt.physics.air import Air
    from bemt.physics.bem.model import Model
    from bemt.physics.sections.neuralfoil import neuralfoil_polar
    from geometry.airfoil import naca
    from geometry.laws import from_laws
    from geometry.rotor import Rotor

    blade = from_laws(0.254, "apc_like", "helix", 0.15, pitch={"pitch": 0.15}, anchors=((0.75, naca("4412")),))
    rotor, tables = Rotor(blade, 2), [(0.75, neuralfoil_polar(naca("4412")))]
    physics = tuple(e for e in effects.standard() if e.id in ("tip_loss", "hub_loss", "swirl", "reynolds"))
    J, rpm = np.array([0.2, 0.4, 0.5]), np.full(3, 6000.0)
    ours = Model(rotor, tables, effects=physics).solve(rpm, J * rpm / 60.0 * rotor.D)
    theirs = peer_ccblade.solve(rotor, tables, rpm, J, Air.from_density())
    assert theirs[0] == pytest.approx(ours.CT, rel=0.04) and theirs[1] == pytest.approx(ours.CP, rel=0.04)
