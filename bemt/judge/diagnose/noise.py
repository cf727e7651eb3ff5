"""What the readings may scatter by: noise, its correlation in time, nuisances, and what the solver gets wrong anyway.

Four things are not known beforehand and are marginalised over a small grid: how much larger the noise is than stated,
how it is correlated from point to point, what runs differ by, and how good blade element theory is for this rotor.  The
last scales the errors of the solver together: nuisances of its own (slope, bend, form and parameters of its laws) and a
smooth error over advance ratio, a tenth of whose variance may change with speed.  Its level stays as uncertain as
declared: a rotor whose curves have the right shape may still be off by a constant.  The readings decide between them.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.gaussian.kernels import alike, modes, smooth
from bemt.base.gaussian.whitening import Conditional, Whitener, conditional, whitener
from bemt.judge.diagnose.record import CHANNELS
from bemt.judge.diagnose.repeats import fell

if TYPE_CHECKING:
    from bemt.judge.diagnose.problem import Problem
    from bemt.physics.effects.base import Effect

# Noise over the stated uncertainty, or over the default where none is stated; correlation of neighbours.
_SCALES = {True: (0.7, 1.0, 1.6, 3.0), False: (0.15, 0.4, 1.0, 2.5)}
_AR = (0.0, 0.6)
_WHITE = 0.2
# How good the solver is: smooth error over advance ratio as a share of the largest coefficient, and a factor on its own
# nuisances, alike beforehand.  Declared after volume 1 of the UIUC database: thrust and torque at rest are off
# by 3 and 5 % (median) and one propeller in ten by more than 10 %. A reference shows that error, however large, and
# then the laws that the case has on may be better known than published, too; alone no recording tells that.
_MODEL = ((0.01, 1.0), (0.03, 1.0), (0.08, 1.0))
_MODEL_SHOWN = ((0.01, 0.33), *_MODEL[1:], (0.25, 1.0))
# From this size on the rotor may be any real one of which no more is known than the case says.
_REAL = 0.03
_MODEL_RPM = 0.1
_LENGTH_J = 0.3
_LENGTH_RPM = 0.7
# What a run may differ by from other runs (temperature of cells and blades, a mount put back), as a share, with its
# prior weight: of one stand and day 0.2 % (median) and 0.4 % (nine in ten) between alternate runs of UIUC volume 1, 0.3
# to 1.9 % between runs of one configuration on a hobby stand; of other days or stands; and where several runs tell
# themselves. Half of the variance is a gain, half smooth in speed and advance ratio (declared).
_SESSIONS = {
    "one": {0.002: 0.5, 0.007: 0.5},
    "apart": {0.007: 0.3, 0.02: 0.7},
    "told": {0.002: 0.35, 0.007: 0.35, 0.02: 0.3},
}
_SEVERAL = 4
_DAY = re.compile(r"(?<!\d)((?:19|20)\d{2}[-_.]?[01]\d[-_.]?[0-3]\d)(?!\d)")
_SESSION_GAIN = 0.5
# Below the smooth error there is a finer one: stall and transition set in at other advance ratios than computed.
_MODEL_FINE = 0.1
_LENGTH_FINE = 0.08
# Length, over the spread of each variable, on which the form of an effect may be off.
_FORM_LENGTH = 0.7
# Unknown smooth effect: lengths over the spread of a variable, sizes as a share of the largest coefficient.
_RIVAL_LENGTHS = (0.15, 0.5)
_RIVAL_SIZES = (0.03, 0.12)
# A balance or mount that stays behind while its load falls (hysteresis as ISO 376 and OIML R 60 define it, decreasing
# less increasing load; not checked): shares of the largest reading, length over the load, and fewest points of either
# kind.
_BEHIND, _BEHIND_LENGTH, _FEW = (0.01, 0.04), 0.5, 4


# What every law of the flow depends on, and the spread below which a variable hardly changes it: natural logarithms of
# speed, density and lengths, advance ratio, angles [rad], time [s].  Voltages and the weather's tenths of a kelvin are
# nothing to it.
_FLOW = {"rpm": 0.5, "J": 0.5, "density_kg_m3": 0.2}
# What some laws depend on besides, as they say themselves.
_BESIDES = {"tip_gap_m": 0.5, "wall_distance_m": 0.5, "sideslip_rad": 0.3, "time_s": 1.0,
            "second_rotor_rad_s": 100.0}  # fmt: skip
_LOGARITHMIC = ("rpm", "density_kg_m3", "tip_gap_m", "wall_distance_m")


@dataclass(frozen=True)
class Hyper:
    """One setting of the unknown numbers of the covariance."""

    scale: float  # Noise over stated uncertainty [1]
    ar: float  # Correlation of neighbouring points of a run [1]
    model: float  # Error of the solver, share of the largest coefficient [1]
    own: float  # Factor on the nuisances that are errors of the solver itself [1]
    weight: float  # Prior probability [1]
    session: float = 0.006  # What runs differ by, a share [1]
    real: float = 0.0  # Size of what real rotors differ by from the solver, over that of the population [1]


def hypers(problem: Problem) -> tuple[Hyper, ...]:
    """All settings, with prior weights that add up to 1."""
    stated = [p.record.repeatability for p in problem.parts if np.isfinite(p.record.repeatability)]
    apart = {max(stated): 1.0} if stated else _SESSIONS[_session(problem)]
    apart = apart if np.ptp(problem.covariates["run"]) > 0.0 else {0.0: 1.0}
    alone = bool(problem.free.all())
    real = alone and all(p.as_built is not None for p in problem.parts)
    grid = list(product(_SCALES[problem.u_known], _AR, _MODEL if alone else _MODEL_SHOWN))
    return tuple(
        Hyper(s, a, m, own, w / len(grid), d, 1.0 if real and m >= _REAL else 0.0)
        for s, a, (m, own) in grid
        for d, w in apart.items()
    )


def _session(problem: Problem) -> str:
    """Whether all runs are of one stand and day, as far as files say: by dates in their names, and by their columns.

    Several runs show themselves what they differ by.
    """
    records = [p.record for p in problem.parts]
    if np.unique(problem.covariates["run"]).size >= _SEVERAL:
        return "told"
    days = {day for r in records for day in _DAY.findall(r.name)}
    columns = {frozenset(r.measured) for r in records}
    return "one" if len(days) < 2 and len(columns) == 1 else "apart"


def in_time(covariates: Mapping[str, Array]) -> tuple[Array, Array]:
    """Run and position in time of every point."""
    run = covariates["run"]
    time = covariates.get("time_s", np.arange(run.size, dtype=float))
    place = np.zeros(run.size)
    for label in np.unique(run):
        mine = np.flatnonzero(run == label)
        place[mine[np.argsort(time[mine], kind="stable")]] = np.arange(mine.size)
    return run, place


def noise(problem: Problem, ar: float) -> Array:
    """Covariance of the noise at the stated uncertainty, (M, M)."""
    if ar == 0.0:
        return np.diag(problem.u**2)
    run, place = in_time(problem.covariates)
    p, c = problem.point, problem.channel
    same = alike(run[p], c)
    correlation = np.where(same, ar ** np.abs(place[p][:, None] - place[p][None, :]), 0.0)
    correlation = (1.0 - _WHITE) * correlation + _WHITE * np.eye(p.size)
    return np.asarray(correlation * problem.u[:, None] * problem.u[None, :])


def _places(problem: Problem) -> tuple[Array, Array]:
    """Logarithm of the speed and advance ratio of readings, (M,) each."""
    return np.log(problem.covariates["rpm"][problem.point]), problem.covariates["J"][problem.point]


def discrepancy(problem: Problem) -> Array:
    """Covariance of the solver's own error of relative size 1: smooth in J, nearly constant in speed, (M, M)."""
    n, J = _places(problem)
    spread = max(float(np.ptp(J)), 0.6)
    kernel = (1.0 - _MODEL_FINE) * smooth((J, spread * _LENGTH_J)) + _MODEL_FINE * smooth((J, spread * _LENGTH_FINE))
    kernel *= 1.0 - _MODEL_RPM + _MODEL_RPM * smooth((n, _LENGTH_RPM))
    same = alike(problem.channel, problem.rotor)
    load = (problem.channel < 2)[:, None] & (problem.channel < 2)[None, :]
    size = np.copysign(problem.scale, problem.stretch)
    return np.asarray(np.where(same & load, kernel, 0.0) * size[:, None] * size[None, :])


def sessions(problem: Problem) -> Array:
    """Covariance of what differs from run to run, of relative size 1, (M, M); zero for a single run."""
    run = problem.covariates["run"][problem.point]
    if np.ptp(run) == 0.0:
        return np.zeros((run.size, run.size))
    n, J = _places(problem)
    kernel = smooth((n, _LENGTH_RPM), (J, _LENGTH_J))
    same = alike(run, problem.channel)
    # a tachometer has no cells: what the speed at a pulse width does from run to run is what the drive does
    same &= (problem.channel != CHANNELS.index("rpm"))[:, None]
    bent = kernel * problem.scale[:, None] * problem.scale[None, :]
    gain = problem.y[:, None] * problem.y[None, :]
    return np.asarray(np.where(same, _SESSION_GAIN * gain + (1.0 - _SESSION_GAIN) * bent, 0.0))


def covariance(problem: Problem, h: Hyper) -> Array:
    """Covariance of noise, nuisances and solver for one setting, (M, M)."""
    stand, own = _tangents(problem)
    wrong = h.own**2 * own + h.model**2 * discrepancy(problem)
    if h.real > 0.0:
        wrong = wrong + h.real**2 * problem.of_real_rotors
    return np.asarray(h.scale**2 * noise(problem, h.ar) + h.session**2 * sessions(problem) + stand + wrong)


def covariances(problem: Problem) -> Iterator[tuple[Hyper, Array]]:
    """Covariance of noise, nuisances and solver for every setting."""
    stand, own = _tangents(problem)
    wrong, apart = discrepancy(problem), sessions(problem)
    by_ar = {ar: noise(problem, ar) for ar in _AR}
    for h in hypers(problem):
        C = h.scale**2 * by_ar[h.ar] + h.session**2 * apart + stand + h.own**2 * own + h.model**2 * wrong
        yield h, C + h.real**2 * problem.of_real_rotors if h.real > 0.0 else C


def _tangents(problem: Problem) -> tuple[Array, Array]:
    """Covariance of what nobody knows of stand and blade, and of the errors of the solver itself."""
    stand, own = problem.tangents[:, ~problem.own], problem.tangents[:, problem.own]
    return stand @ stand.T, own @ own.T


@dataclass(frozen=True, eq=False)
class SmoothAlternative:
    """An unknown smooth effect of the test."""

    name: str  # Channels, variables and size
    mine: NDArray[np.bool_]  # (M,) Readings that it changes
    kernel: Array  # (N, N) Its covariance in these at size 1 [square of the units of the readings]
    size: float  # Standard deviation, share of the largest coefficient [1]

    @property
    def covariance(self) -> Array:
        """Covariance of all readings, (M, M)."""
        out = np.zeros((self.mine.size, self.mine.size))
        out[np.ix_(self.mine, self.mine)] = self.size**2 * self.kernel
        return out


def unlike(covariance: Array, u: Array, chosen: Sequence[SmoothAlternative]) -> list[tuple[Conditional, Whitener]]:
    """What rivals change given the rest, without and with each of them beside a covariance."""
    found: dict[bytes, Conditional] = {}
    out = []
    for k in chosen:
        key = k.mine.tobytes()
        if key not in found:
            found[key] = conditional(covariance, u, k.mine)
        given = found[key]
        out.append((given, whitener(given.covariance + k.size**2 * k.kernel, u[k.mine])))
    return out


_WORDS = ("thrust", "torque", "speed")


def rivals(problem: Problem, told: Collection[str] = ()) -> tuple[SmoothAlternative, ...]:
    """Unknown smooth effects of the test: along each recorded variable but those ``told``, and pairs of them."""
    X: dict[str, Array] = {}
    for name, values in problem.covariates.items():
        if name in ("run", "Re", "M_tip", "pressure_Pa", "electrical_power_W", *told):
            continue
        x = np.log(values) if name == "rpm" and np.all(values > 0) else values
        spread = float(np.ptp(x))
        if spread > 1e-3 * max(float(np.max(np.abs(x))), 1e-12) and np.unique(np.round(x / spread, 6)).size >= 3:
            X[name] = (x - x.min()) / spread
    sets: list[tuple[str, ...]] = [(name,) for name in X]
    if {"rpm", "J"} <= set(X):
        sets.append(("rpm", "J"))
    p, c = problem.point, problem.channel
    # a cause of the test is not in the reference, whether it is in the library or not
    free = problem.free
    # what the losses of a motor do is smooth, too, and no cause
    lost = (1,) if any(p.record.electrical for p in problem.parts) else ()
    present = [k for k in (0, 1, 2) if k not in lost and np.any(c == k)]
    groups = [tuple(present)] if len(present) == 1 else [tuple(present), *((k,) for k in present)]
    out = []
    for names in sets:
        for length in _RIVAL_LENGTHS:
            for group in groups:
                mine = free & np.isin(c, group)
                kernel = smooth(*((X[name][p[mine]], length) for name in names)) * alike(c[mine])
                kernel *= np.multiply.outer(problem.scale[mine], problem.scale[mine])
                for size in _RIVAL_SIZES:
                    label = " and ".join(_WORDS[k] for k in group)
                    out.append(SmoothAlternative(f"{label} over {', '.join(names)}: {size:.0%}", mine, kernel, size))
    return (*out, *_behind(problem, groups))


def _behind(problem: Problem, groups: Sequence[tuple[int, ...]]) -> Iterator[SmoothAlternative]:
    """Readings of a balance or mount that stays behind while the load falls, by groups of channels.

    What went before the first reading of a run is not known: as likely as not the load fell to there.
    """
    (load, falling), free, c = loading(problem), problem.free, problem.channel
    for group in groups:
        here = free & np.isin(c, group)
        if min(np.count_nonzero(here & side) for side in (falling < 1.0, falling == 1.0)) < _FEW * len(group):
            continue
        mine = here & (falling > 0.0)
        size = np.zeros(c.size)
        for k in group:
            size[c == k] = np.max(np.abs(problem.y[c == k]))
        kernel = smooth((load[mine], _BEHIND_LENGTH)) * alike(c[mine])
        kernel = np.multiply.outer(falling[mine], falling[mine]) * kernel + np.diag(
            falling[mine] * (1.0 - falling[mine])
        )
        kernel *= np.multiply.outer(size[mine], size[mine])
        label = " and ".join(_WORDS[k] for k in group)
        for share in _BEHIND:
            yield SmoothAlternative(f"{label} while the load falls: {share:.0%}", mine, kernel, share)


def loading(problem: Problem) -> tuple[Array, Array]:
    """Computed load of every reading over the largest of its channel, and the probability that it fell to there, (M,).

    Speeds are no load.
    """
    run, place = in_time(problem.covariates)
    load, falling = np.zeros_like(problem.f0), np.zeros(problem.f0.size)
    for k in np.unique(problem.channel[problem.channel < 2]):
        mine = np.flatnonzero(problem.channel == k)
        load[mine] = np.abs(problem.f0[mine]) / max(float(np.max(np.abs(problem.f0[mine]))), 1e-300)
        runs = run[problem.point[mine]] + (float(np.max(run)) + 1.0) * problem.part[mine]
        falling[mine] = fell(load[mine], runs, place[problem.point[mine]])
    return load, falling


def law_of(effect: Effect | type[Effect], solved: bool = True) -> tuple[str, ...]:
    """What the law of an effect depends on, of speed, advance ratio and density; a solved blade needs no law."""
    if effect.kind == "stand" or effect.exact or (effect.geometric and solved):
        return ()
    return ("J",) if effect.inviscid else tuple(_FLOW)


@lru_cache(maxsize=64)
def _modes(points: int, axes: tuple[tuple[bytes, float], ...]) -> Array:
    """Modes over coordinates, given as bytes with their length scales: every cause and form asks for the same few."""
    kernel = smooth(*((np.frombuffer(x), length) for x, length in axes)) if axes else np.ones((points, points))
    return modes(kernel, 0.02)


def smooth_modes(problem: Problem, besides: Sequence[str] = (), flow: Sequence[str] = tuple(_FLOW)) -> Array:
    """Modes of a smooth function of unit variance, each channel for itself, (M, q) [1]."""
    axes = []
    for name, least in (_FLOW | _BESIDES).items():
        if name in (*flow, *besides) and name in problem.covariates:
            x = problem.covariates[name]
            x = np.log(x) if name in _LOGARITHMIC else x
            axes.append((np.asarray(x, dtype=float).tobytes(), _FORM_LENGTH * max(float(np.ptp(x)), least)))
    found = _modes(problem.covariates["rpm"].size, tuple(axes))[problem.point]
    channels = np.unique(problem.channel)
    return np.concatenate([np.where((problem.channel == c)[:, None], found, 0.0) for c in channels], axis=1)
