"""How far a cause stands out of the noise of a stand, and from which other causes: measured on the truth itself.

The yardstick of the proof.  It knows the truth's own signatures and the stand's real covariance and nothing of the
diagnosis; a plan that cannot show a cause is told from one that can before anybody tries.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.gaussian.whitening import Whitener, whitener
from bemt.judge.proof.stand import StandErrors, covariance, full_scales
from bemt.judge.proof.truth_world import TrueLoads, World

# One standard deviation of what nobody knows of a blade and a stand (DIAGNOSIS 2.2): pitch [deg], drag level, lift
# slope, gains, zeros over full scale, tachometer, density, constants of motor and controller (no case states them).
FREEDOM = {"pitch": 0.3, "drag": 0.10, "slope": 0.03, "gain": 0.01, "zero": 0.003, "rpm": 0.003, "density": 0.01,
           "drive": 0.10}  # fmt: skip
_RELATIVE = {"voltage_V": 0.001, "current_A": 0.004, "pwm_us": 0.002}


@dataclass(frozen=True)
class Yardstick:
    """Whitening by noise alone, and by noise and nuisances."""

    channels: tuple[str, ...]  # Columns in the order of the stacked signature
    # Of the covariance: noise; noise and nuisances
    noise: Whitener
    whole: Whitener

    def stack(self, columns: Mapping[str, Array]) -> Array:
        """Signature as one vector, (M,)."""
        return np.asarray(np.nan_to_num(np.concatenate([columns[name] for name in self.channels])))

    def separation(self, signature: Array) -> tuple[float, float]:
        """Length of a signature over noise, and over noise and nuisances. [1]"""
        return float(np.linalg.norm(self.noise(signature))), float(np.linalg.norm(self.whole(signature)))

    def alike(self, own: Array, others: Mapping[str, Array], limit: float = 3.0) -> list[str]:
        """Causes whose signature this one cannot be told from: its part across theirs is shorter than ``limit``."""
        a = self.whole(own)
        found = []
        for name, signature in others.items():
            b = self.whole(signature)
            length = float(np.linalg.norm(b))
            if length > 1e-9:
                across = a - (a @ b) / length**2 * b
                if float(np.linalg.norm(across)) < limit:
                    found.append(name)
        return found


def freedom(world: World) -> dict[str, World]:
    """Worlds with one thing off by a standard deviation of what nobody knows."""
    section = world.section
    return {
        "pitch": replace(world, pitch_offset=world.pitch_offset + FREEDOM["pitch"]),
        "drag": replace(world, section=replace(section, drag_level=section.drag_level * (1.0 + FREEDOM["drag"]))),
        "slope": replace(world, section=replace(section, slope_level=section.slope_level * (1.0 + FREEDOM["slope"]))),
        "density": replace(world, density_error=world.density_error + FREEDOM["density"]),
    }


def yardstick(
    loads: TrueLoads, run: NDArray[np.int64], stand: StandErrors, tangents: Sequence[Mapping[str, Array]],
    electric: Mapping[str, Array],
) -> Yardstick:  # fmt: skip
    """Build the yardstick of a recording."""
    n = loads.thrust.size
    scales = full_scales(loads)
    channels = ("thrust_N", "torque_Nm", *electric)
    size = n * len(channels)
    cov = np.zeros((size, size))
    for k, (value, scale) in enumerate(zip((loads.thrust, loads.torque), scales, strict=True)):
        cov[k * n : (k + 1) * n, k * n : (k + 1) * n] = covariance(np.nan_to_num(value), run, scale, stand)
    for k, (name, value) in enumerate(electric.items(), start=2):
        cov[k * n : (k + 1) * n, k * n : (k + 1) * n] = np.diag((_RELATIVE[name] * value) ** 2 + 1e-12)
    noise = whitener(cov)
    wide = cov.copy()
    rows = [np.concatenate([np.nan_to_num(t[c]) if c in t else np.zeros(n) for c in channels]) for t in tangents]
    for k, (value, scale) in enumerate(zip((loads.thrust, loads.torque), scales, strict=True)):
        for vector in (FREEDOM["gain"] * np.nan_to_num(value), np.full(n, FREEDOM["zero"] * scale)):
            row = np.zeros(size)
            row[k * n : (k + 1) * n] = vector
            rows.append(row)
    for k, value in enumerate(electric.values(), start=2):
        row = np.zeros(size)
        row[k * n : (k + 1) * n] = FREEDOM["drive"] * value
        rows.append(row)
    for row in rows:
        wide += np.outer(row, row)
    return Yardstick(channels, noise, whitener(wide))
