"""The few numbers in which a real rotor differs from its drawing, and how well they are known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.physics.effects.base import Effect

if TYPE_CHECKING:
    from bemt.physics.effects.base import RotorBuild

KNOWN_FROM = ("cad", "scan", "stations", "label", "measured", "reference")
"""How the blade of a case is known; ``measured``: from another piece of the same propeller in a database,
``reference``: from a run of this very rotor."""

# A camber acts on attached flow only: whole up to 30 deg, gone at 60.
_ATTACHED, _SEPARATED = math.radians(30.0), math.radians(60.0)


@dataclass(frozen=True)
class AsBuilt(Effect):
    """What the rotor as built has and its drawing has not."""

    angle_deg: float = 0.0  # Turn of the whole blade [deg]
    # Natural logarithm of the factor on cl and on cd [1]
    lift: float = 0.0
    drag: float = 0.0
    camber_deg: float = 0.0  # Lowering of the zero-lift angle at the same drag [deg]

    id = "as_built"
    title = "Rotor as built"
    order = 15
    diagnosed = False

    def blade(self, bake: RotorBuild) -> None:
        """Turn the blade."""
        bake.beta += np.radians(self.angle_deg)

    def section(self, bake: RotorBuild) -> None:
        """Shift and scale the section tables."""
        if self.camber_deg:
            whole = np.clip((_SEPARATED - np.abs(bake.alpha)) / (_SEPARATED - _ATTACHED), 0.0, 1.0)
            at = bake.alpha + math.radians(self.camber_deg) * whole
            place = np.interp(at, bake.alpha, np.arange(float(at.size)))
            left = np.minimum(place.astype(np.intp), at.size - 2)
            low = bake.cl[..., left]
            bake.cl = low + (place - left) * (bake.cl[..., left + 1] - low)
        bake.cl = bake.cl * math.exp(self.lift)
        bake.cd = bake.cd * math.exp(self.drag)


NAMES: tuple[str, ...] = tuple(f.name for f in fields(AsBuilt))
"""Latent numbers, in the order of every mean, covariance and tangent."""
UNITS = {"angle_deg": "deg", "lift": "1", "drag": "1", "camber_deg": "deg"}
STEP = np.array([0.5, 0.05, 0.1, 0.5])
"""Half steps of the central differences, in the units of the numbers."""


def as_built(z: Array) -> AsBuilt:
    """Effect of a vector of latent numbers."""
    return AsBuilt(*(float(v) for v in z))


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of the latent numbers of one rotor: a normal law whose size is itself uncertain."""

    mean: Array  # (K,) Expectation, in the order and units of `NAMES`
    cov: Array  # (K, K) Covariance at size 1 [units of `NAMES`, squared]
    # (S,) Factors on all standard deviations of this rotor, and their probabilities: the heavy tail [1]
    sizes: Array
    weights: Array
    known_from: str = "stations"  # One of `KNOWN_FROM`

    @property
    def sd(self) -> Array:
        """Standard deviations at size 1, (K,)."""
        return np.sqrt(np.diag(self.cov))

    def scaled(self, sds: Mapping[str, float]) -> Prior:
        """Prior with other standard deviations of some numbers; correlations stay."""
        factor = np.ones(len(NAMES))
        for name, sd in sds.items():
            k = NAMES.index(name)
            factor[k] = sd / max(float(self.sd[k]), 1e-12)
        return replace(self, cov=self.cov * np.outer(factor, factor))


def arrays_of(document: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a file with its lists as arrays."""
    return {k: np.array(v, dtype=float) if isinstance(v, list) else v for k, v in document.items()}


@dataclass(frozen=True, eq=False)
class Sensed:
    """The solver at points of one rotor, with its slopes."""

    diameter_m: float
    # (P,) Advance ratio; angle of attack at 0.75 R with the momentum theory's induction [deg]; Reynolds number there
    J: Array
    alpha_deg: Array
    Re: Array
    # (2, P) CT and CP, and those at rest at the same rpm [1]
    f: Array
    top: Array
    T: Array  # (2, K, P) Slopes of CT and CP with the latent numbers [1 over their units]

    @property
    def beta75_deg(self) -> Array:
        """Blade angle at 0.75 R with which each point was solved, (..., P) [deg]."""
        return self.alpha_deg + inflow_angle_deg(self.J, self.f[..., 0, :])

    def part(self, points: NDArray[np.intp] | NDArray[np.bool_]) -> Sensed:
        """Some of the points."""
        return Sensed(self.diameter_m, *(getattr(self, f.name)[..., points] for f in fields(Sensed)[1:]))


def inflow_angle_deg(J: Array, CT: Array) -> Array:
    """Angle of the flow at 0.75 R to the disk, with the induction of CT, CT = pi/2 (J + l) l, (..., P) [deg].

    Thrust below zero induces none here: what is asked for is a place on the section's polar, no load.
    """
    lifted = 2.0 / math.pi * np.maximum(np.nan_to_num(CT), 0.0)
    induced = np.where(J >= 0.0, -0.5 * J + np.sqrt(0.25 * J**2 + lifted), np.sqrt(lifted))
    return np.asarray(np.degrees(np.arctan((J + induced) / (0.75 * math.pi))))
