"""A rotor from a run of its own: the case with what its recording tells of the rotor as built."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base import unit_errors
from bemt.base.arrays import Array
from bemt.base.cache import Kept, content_key
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_text
from bemt.physics import coefficients as co
from bemt.rotors.conditioning import SESSION, TOLERANCE, Conditioned, ReferenceRun, condition, noise_of_run, scatter
from bemt.rotors.latents import Prior, Sensed
from bemt.rotors.model import air_fields, air_of_points, beta75_deg, coefficients
from bemt.rotors.population import WEIGHTS, population
from bemt.rotors.predict import sense

if TYPE_CHECKING:
    from bemt.physics.air import Air
    from bemt.physics.bem.model import Model
    from bemt.rotors.case import Case

# Advance ratio below which a point is at rest [1].
_STILL = 0.01
FACTOR = 3.0
"""Load over that of the case, or under it, that is another rotor's [1]."""
FAR = 4.0
"""Standard deviations off what was known of the rotor from which on a reading is doubted [1]."""
MOST_PASSES = 4
"""Rest and bias go by the loads of the rotor that they help to find: taken anew so often at most [1]."""
MOST_POINTS = 40
"""Points beyond this number are averaged with their neighbours in (J, rpm) [1]."""


@dataclass(frozen=True, eq=False)
class AsMeasured:
    """Outcome of `as_measured`."""

    prior: Prior  # What the case and the population said
    posterior: Prior  # After the run; ``known_from`` is ``reference``
    reference: ReferenceRun  # Rows of the run, for predictions near them
    found: Conditioned  # Steps, convergence, evidence
    points: int  # Points of the run that were used [1]
    times: dict[str, float]  # The run's loads over those of the case [1]
    # Standard deviations by which its furthest reading lies off what was known of the rotor, and its torque above what
    # its thrust tells besides [1]
    far: float
    thirst: float

    @property
    def told(self) -> str:
        """How large the run's loads are."""
        return _told(self.times)


def _told(times: Mapping[str, float]) -> str:
    return " and ".join(f"{word} {number_text(ratio, 3)} times" for word, ratio in times.items())


def _check(where: str, times: Mapping[str, float], far: float, typed: bool) -> None:
    """Refuse loads that no blade of the case's label has: they would move nothing, as if they agreed.

    Numbers that were typed each with its unit slip by a digit, not by the unit.
    """
    word, ratio = next(iter(times.items()), ("", 1.0))
    if 1.0 / FACTOR < abs(ratio) < FACTOR or far < FAR:
        return
    units = unit_errors.errors(word.replace("thrust", "force"))
    slips = [(e.factor, e.rarity, f"The nearest slip is {e.words}") for e in units if not typed]
    slips += [(10.0**k, 0.0, f"{abs(k)} digit{'s' * (abs(k) > 1)} too {'many' if k > 0 else 'few'} in the {word}?")
              for k in (-3, -2, -1, 1, 2, 3) if typed]  # fmt: skip
    slips += [(r.ratio**-2, r.rarity, f"The nearest slip is speed: {r.words}") for r in unit_errors.speed_ratios()]
    near = min(slips, key=lambda s: (math.log(max(abs(ratio), 1e-12) / s[0]) / 0.25) ** 2 + s[1])
    got, expected = f"{_told(times)} what the case gives", f"loads of this rotor, within a factor of {FACTOR:g}"
    hint = f"Look at {'numbers' if typed else 'units'}, speed, diameter and pitch. {near[2]}"
    raise InputError(Fault(where, "", got, expected, hint))


def _groups(rpm: Array, J: Array) -> list[NDArray[np.intp]]:
    """Points that are averaged together: runs of neighbours in (J, rpm)."""
    order = np.lexsort((rpm, np.round(J, 2)))
    return [np.sort(part) for part in np.array_split(order, min(rpm.size, MOST_POINTS)) if part.size]


def as_measured(
    case: Case, rpm: Array, airspeed_m_s: Array, air: Air, CT: Array, CP: Array,
    u_CT: Array | float = 0.0, u_CP: Array | float = 0.0, gain: tuple[float, float] = (SESSION, SESSION),
    others: Array | None = None, theirs: NDArray[np.bool_] | None = None,
    prior: Prior | None = None, where: str | None = None, typed: bool = False,
) -> AsMeasured:  # fmt: skip
    """Posterior of a rotor's latent numbers from a reference run.

    ``others`` as in `noise_of_run`, for the points ``theirs`` that another piece or campaign gave, (P,); all of them
    where that is not said.  ``prior``: what is known before, as the case says by default.  ``where`` names readings
    that are refused, with InputError and before the search, where no blade of the label has such loads; ``typed`` says
    that each of their numbers stands with its unit.
    """
    from bemt.rotors.case.prepare import prepare_case

    if prior is None:
        prior = case.as_built().prior
        prior = prior if prior.known_from == "reference" else case.as_built(counting_assumptions=False).prior
    ready, fields = prepare_case(case), air_fields(air)
    given = content_key(rpm, airspeed_m_s, CT, CP, *map(np.asarray, (u_CT, u_CP, gain)), *fields.values(),
                        *(np.zeros(0) if v is None else v for v in (others, theirs)), prior.known_from,
                        prior.mean, prior.cov, prior.sizes, prior.weights)  # fmt: skip
    return _MEASURED.get((ready.key, given, where is None, typed, population()), lambda: _searched(
        ready, prior, rpm, airspeed_m_s, fields, CT, CP, u_CT, u_CP, gain, others, theirs, where, typed,
    ))  # fmt: skip


_MEASURED: Kept[AsMeasured] = Kept(64, lambda _: 1.0)
"""Rotors of this process by model and readings: many questions are asked of one."""


def _searched(
    ready: Model, prior: Prior, rpm: Array, airspeed_m_s: Array, fields: Mapping[str, Array], CT: Array, CP: Array,
    u_CT: Array | float, u_CP: Array | float, gain: tuple[float, float], others: Array | None,
    theirs: NDArray[np.bool_] | None, where: str | None, typed: bool,
) -> AsMeasured:  # fmt: skip
    """Posterior of :func:`as_measured`."""
    people = population()
    J = airspeed_m_s / (rpm / 60.0 * ready.diameter_m)
    usable = np.isfinite(CT) | np.isfinite(CP)
    if not usable.any():
        raise ValueError("reference: got no thrust and no torque; expected at least one reading")
    keep = np.flatnonzero(usable)
    groups = [keep[g] for g in _groups(rpm[keep], J[keep])]

    def mean(values: Array | float) -> Array:
        full = np.broadcast_to(np.asarray(values, float), rpm.shape)
        return np.array([full[g].mean() for g in groups])

    foreign = None if theirs is None else mean(theirs.astype(np.float64)) > 0.5
    share = np.array([1.0 / np.sqrt(g.size) for g in groups])
    state = air_of_points({k: v if v.size == 1 else mean(v) for k, v in fields.items()})
    rpm_, J_ = mean(rpm), mean(J)
    solve = coefficients(ready, state)
    points = np.arange(rpm_.size)
    speed = J_ * rpm_ / 60.0 * ready.diameter_m
    Re = np.asarray(co.Re75(ready.chord75_m, rpm_ / 60.0, ready.diameter_m, speed, state.rho, state.mu))
    y = np.array([mean(CT), mean(CP)])
    target, u, still = y.reshape(-1), np.array([mean(u_CT), mean(u_CP)]), np.abs(J_) < _STILL

    def sensed(z: Array | None = None) -> tuple[Sensed, Array, Array]:
        """The solver at the points, what it lacks in the mean and the covariance of the rest: both go by the loads."""
        at = sense(solve, ready.diameter_m, beta75_deg(ready), rpm_, J_, Re, z)
        rough = np.array([[scatter(a, Re[still])] for a in (y - at.f)[:, still]]) * still
        single = np.maximum(np.hypot(u, people.noise_sd(at)) * share, rough)
        return at, people.bias(at).reshape(-1), noise_of_run(people, at, y, single, gain, others, foreign)

    at, bias, noise = sensed()
    mine = np.tile(np.ones(rpm_.size, bool) if foreign is None else ~foreign, 2) & np.isfinite(
        target + at.f.reshape(-1)
    )
    size = np.abs(at.f.reshape(-1)) * mine
    rows = {word: mine & (np.arange(mine.size) // rpm_.size == k) for k, word in enumerate(("thrust", "torque"))}
    times = {w: float(np.abs(target[r]).sum() / size[r].sum()) for w, r in rows.items() if size[r].sum() > 0.0}
    off = target - at.f.reshape(-1) - bias
    far = float(np.max(np.abs(_off_by(prior, at, off, noise, mine)), initial=0.0))
    thirst = float(np.max(_off_by(prior, at, off, noise, rows["torque"]), initial=0.0))
    if where is not None:
        _check(where, times, far, typed)
    z, settled, passes = prior.mean, False, 0
    while passes < MOST_PASSES and not settled:
        passes += 1
        found = condition(
            lambda z, b=bias: solve(z, rpm_, J_, points).reshape(-1) + b,  # type: ignore[misc]
            prior, target, noise, people.rest_sizes, WEIGHTS, start=z,
        )  # fmt: skip
        settled = bool(np.all(np.abs(found.mean - z) <= TOLERANCE * np.sqrt(np.diag(found.cov))))
        z = found.mean
        at, bias, noise = sensed(z)  # as predictions will see it
    slopes = at.T.transpose(0, 2, 1).reshape(target.size, -1)
    found = replace(found, at=z, f=at.f.reshape(-1) + bias, T=slopes, converged=found.converged and settled)
    posterior = Prior(found.mean, found.cov, np.ones(1), np.ones(1), "reference")
    reference = ReferenceRun.given(at, noise, target, found)
    return AsMeasured(prior, posterior, reference, found, int(keep.size), times, far, thirst)


def _off_by(prior: Prior, at: Sensed, off: Array, noise: Array, mine: NDArray[np.bool_]) -> Array:
    """``off`` of `mine`, readings less the case (2 P,), over its standard deviation given the others."""
    T = at.T.transpose(0, 2, 1).reshape(off.size, -1)
    S = noise + T @ prior.cov @ T.T * float(prior.weights @ prior.sizes**2)
    off, rest = off - T @ prior.mean, ~mine & np.isfinite(off)
    gain = np.linalg.solve(S[np.ix_(rest, rest)], S[np.ix_(rest, mine)]).T
    variance = np.diag(S)[mine] - np.einsum("ij,ij->i", gain, S[np.ix_(mine, rest)])
    return np.asarray((off[mine] - gain @ off[rest]) / np.sqrt(variance))
