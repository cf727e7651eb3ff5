"""Measured propellers as built: what the population expects of each, how wide, and what each tells the population."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.data.readers.uiuc_names import class_of
from bemt.physics.sections import rule as section_rule
from bemt.rotors.latents import Prior, Sensed
from bemt.rotors.mixture import LEVELS, half_width, inside
from bemt.rotors.population import Population, label_angle_deg
from bemt.rotors.predict import predict, sense
from bemt.rotors.reference import ReferenceRun
from bemt.rotors.validate.points import KINDS, Rows, Solver, Stations, counted, errors, rows, statistics

if TYPE_CHECKING:
    from bemt.data.readers.uiuc import UiucPropeller
    from bemt.physics.effects import Effect


@dataclass(frozen=True, eq=False)
class MeasuredRotor(Sensed):
    """One measured propeller beside the solver at P readings; ``y`` (2, P) are CT and CP measured [1]."""

    name: str
    family: str
    section: str
    gap_deg: float
    static: NDArray[np.bool_]
    y: Array
    blade_class: str | None = None
    known_from: str = "stations"


def law(p: Population, m: MeasuredRotor) -> Prior:
    """What is known of a propeller before it is measured."""
    return p.prior(m.known_from, m.diameter_m, m.gap_deg, m.family, m.section, blade_class=m.blade_class)


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


def expect(seen: Observed, p: Population) -> Expected:
    """Expectation of a propeller and how its points lie in it."""
    return lying(seen, p, law(p, seen.record))


def lying(seen: Observed, p: Population, prior: Prior, reference: ReferenceRun | None = None) -> Expected:
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


class Pool:
    """Errors of many propellers, together; with intervals also how many points they hold and how wide they are."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str, str], list[Array]] = {}

    def add(self, rows: Rows, expected: Expected | None = None) -> dict[str, Any]:
        """Take the points of one propeller; returns its own statistics."""
        own = Pool()
        for kind, found in errors(rows).items():
            for q, e in found.items():
                own._found[kind, q, "error"] = [e]
                if expected is not None:
                    own._found[kind, q, "probability"] = [expected.probability[kind][q]]
                    own._found[kind, q, "width"] = [expected.width[kind][q]]
                    own._found[kind, q, "log_density"] = [expected.log_density[kind][q]]
        for key, values in own._found.items():
            self._found.setdefault(key, []).extend(values)
        out = own.total()
        for kind in KINDS:
            out[kind].pop("propellers")
        return out

    def add_kind(self, expected: Expected, kind: str) -> None:
        """Take the points of one kind only."""
        own = Pool()
        own.add(expected.rows, expected)
        for key, values in own._found.items():
            if key[0] == kind:
                self._found.setdefault(key, []).extend(values)

    def total(self) -> dict[str, Any]:
        """Statistics over all points; ``log_score`` is a mean over propellers of the mean log density of their
        points.
        """
        out: dict[str, Any] = {}
        for kind in KINDS:
            sizes = [e.size for e in self._found.get((kind, "CT", "error"), [])]
            out[kind] = {"propellers": sum(size > 0 for size in sizes), "points": sum(sizes)}
            for q in ("CT", "CP"):
                e, probability, width = (
                    np.concatenate([*self._found.get((kind, q, what), []), np.empty(0)])
                    for what in ("error", "probability", "width")
                )
                out[kind][q] = statistics(e)
                if (kind, q, "probability") in self._found:
                    out[kind][q] |= coverage(probability, width)
                    means = [float(np.mean(v)) for v in self._found[kind, q, "log_density"] if v.size]
                    out[kind][q]["log_score"] = float(np.mean(means)) if means else None
        return out


def coverage(probability: Array, width: Array) -> dict[str, Any]:
    """Share of points inside the 68 and 95 % intervals, and the median half width of the first [1]."""
    if probability.size == 0:
        return {"coverage": {"68": None, "95": None}, "width68": None}
    held = {name: float(np.mean(probability <= level)) for name, level in zip(("68", "95"), LEVELS, strict=True)}
    return {"coverage": held, "width68": float(np.median(width))}
