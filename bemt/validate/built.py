"""Measured propellers as built: what the population expects of each, how wide, and what each tells the population."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.readers._uiuc_names import class_of
from bemt.rotors.conditioning import condition
from bemt.rotors.fit import MeasuredRotor, law
from bemt.rotors.latents import Prior
from bemt.rotors.mixture import LEVELS, half_width, inside
from bemt.rotors.population import WEIGHTS, Population, label_angle_deg
from bemt.rotors.predict import predict, sense
from bemt.rotors.reference import ReferenceRun, noise_of_run, scatter
from bemt.sections import rule as section_rule
from bemt.validate.points import J_SHARE, Rows, Solver, Stations, counted, rows

if TYPE_CHECKING:
    from bemt.effects import Effect
    from bemt.readers.uiuc import UiucPropeller

Array = NDArray[np.float64]
RUN_POINTS = 24
"""Points of a run on which a rotor is conditioned [1]."""


@dataclass(frozen=True, eq=False)
class Observed:
    """One propeller of a folder: the solver as drawn at its points, and its sensitivities."""

    propeller: UiucPropeller  # As read
    solve: Solver  # For other latent numbers
    drawn: Rows  # All points, the solver on the stations
    record: MeasuredRotor  # The points that count, static ones first


@dataclass(frozen=True, eq=False)
class Expected:
    """Expectation for one propeller and how the measured points lie in it, over the points that count."""

    rows: Rows  # As `Observed.drawn`, the computed coefficients being expectations
    # (P,) ``static`` and ``forward``, CT and CP: of an interval as wide as the error [1]
    probability: dict[str, dict[str, Array]]
    width: dict[str, dict[str, Array]]  # (P,) half width of the 68 % interval over the expectation [1]
    log_density: dict[str, dict[str, Array]]  # (P,) logarithm of the predictive density of the reading over itself [1]


def observe(propeller: UiucPropeller, effects: Sequence[Effect], stations: Stations) -> Observed:
    """Solve one propeller at its points with the slopes."""
    solve = Solver(propeller, effects, None, stations)
    drawn = rows(propeller, solve)
    here = np.logical_or.reduce(list(counted(drawn).values())) & np.isfinite(drawn.CT_bemt)
    rotor = solve.rotor
    chord, beta = (float(v) for v in rotor.blade.at(0.75 * rotor.R)[:2])
    n, D = drawn.rpm[here] / 60.0, rotor.D
    speed = n * D * np.hypot(0.75 * math.pi, drawn.J[here])
    Re = solve.air.rho * speed * chord / solve.air.mu
    at = sense(solve, D, math.degrees(beta), drawn.rpm[here], drawn.J[here], Re)
    gap = math.nan
    if propeller.pitch_in:
        gap = math.degrees(beta) - label_angle_deg(propeller.pitch_in, propeller.diameter_in)
    y = np.array([drawn.CT[here], drawn.CP[here]])
    record = MeasuredRotor(
        **vars(at), name=propeller.name, family=propeller.family, section=section_rule.source(propeller.family),
        gap_deg=gap, static=drawn.static[here], y=y, blade_class=class_of(propeller.family),
    )  # fmt: skip
    return Observed(propeller, solve, drawn, record)


def conditioned(seen: Observed, p: Population, on: str) -> Expected:
    """Expectation after conditioning on points of one kind; those of the other count.

    ``on`` is ``static``, ``forward``, or ``static_and_one``: the forward point nearest to half of the zero-thrust J
    too.
    """
    m, drawn = seen.record, seen.drawn
    good = counted(drawn)
    here = np.logical_or.reduce(list(good.values())) & np.isfinite(drawn.CT_bemt)
    rpm, J = drawn.rpm[here], drawn.J[here]
    run = np.flatnonzero(good[on.removesuffix("_and_one")][here])
    run = run[np.unique(np.linspace(0, run.size - 1, min(run.size, RUN_POINTS)).round().astype(int))]
    if on.endswith("_and_one"):
        middle = 0.5 * (drawn.J0_bemt if math.isfinite(drawn.J0_bemt) else float(m.J.max()) / J_SHARE)
        run = np.append(run, np.argmin(np.where(m.static, np.inf, np.abs(m.J - middle))))
    prior, at, y = law(p, m), m.part(run), m.y[:, run]
    still = m.static[run]
    rough = np.array([[scatter(a, at.Re[still])] for a in (y - at.f)[:, still]]) * still
    noise = noise_of_run(p, at, y, np.hypot(p.noise_sd(at), rough))
    bias = p.bias(m)[:, run].reshape(-1)
    found = condition(
        lambda z: seen.solve(z, rpm[run], J[run]).reshape(-1) + bias, prior, y.reshape(-1), noise, p.rest_sizes, WEIGHTS
    )
    reference = ReferenceRun.given(at, noise, y.reshape(-1), found)
    posterior = Prior(found.mean, found.cov, np.ones(1), np.ones(1), "reference")
    return _lying(seen, p, posterior, reference)


def expect(seen: Observed, p: Population) -> Expected:
    """Expectation of a propeller and how its points lie in it."""
    return _lying(seen, p, law(p, seen.record))


def _lying(seen: Observed, p: Population, prior: Prior, reference: ReferenceRun | None = None) -> Expected:
    """How the points lie in a prediction."""
    m = seen.record
    now = rows(seen.propeller, seen.solve, prior.mean)
    good = counted(now)
    here = np.logical_or.reduce(list(good.values())) & np.isfinite(seen.drawn.CT_bemt)
    found = predict(p, prior, m, np.array([now.CT_bemt[here], now.CP_bemt[here]]), reference)
    CT, CP = now.CT_bemt.copy(), now.CP_bemt.copy()
    CT[here], CP[here] = found.mean
    now = replace(now, CT_bemt=CT, CP_bemt=CP)
    sds = found.sds(noise=True)
    density = found.log_density(m.y) + np.log(np.abs(m.y))
    probability: dict[str, dict[str, Array]] = {}
    width: dict[str, dict[str, Array]] = {}
    log_density: dict[str, dict[str, Array]] = {}
    for kind, mask in good.items():
        k = mask[here]
        probability[kind], width[kind], log_density[kind] = {}, {}, {}
        for i, q in enumerate(("CT", "CP")):
            mean, sd = found.mean[i][k], sds[i][k]
            probability[kind][q] = inside(m.y[i][k] - mean, sd, found.chances)
            width[kind][q] = half_width(LEVELS[0], sd, found.chances) / np.abs(mean)
            log_density[kind][q] = density[i][k]
    return Expected(now, probability, width, log_density)
