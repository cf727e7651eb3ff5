"""NeuralFoil's answers for NACA four-digit sections, tabulated: the section rule needs no NeuralFoil.

Made by ``reports/studies/section_table.py``: our own runs over camber, thickness, n_crit, Reynolds number and angle of
attack, camber position 0.40 (the rule's) and 0.45 (fans); no weights of the network. Cubic in camber, thickness and
n_crit between the nodes; angles and Reynolds numbers are those of the tables themselves. The nodes hold the rule's
section and the ends of its ranges. There only rounding is left: cl 1e-4, cd 0.025 %, up to 0.01 % of the static CT and
CP of the shipped cases. Between them (60 random sections, ``section_table.py check``), cl and ln cd from -4 to 10 deg
and Re 3e4 to 1e6 are off by 4e-4 and 1.4e-3 in the median, 95 % within 8e-3 and 2e-2. CT and CP of a 10x5 with that
section, over those at rest, are off by 0.03 % in the median, 95 % within 0.5 %, 2.2 % at worst (3,000 rev/min, where
laminar separation sets in).
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.cache import shipped_arrays

FILE = "four_digit.npz"
STEPS = (2e-4, 5e-4, 1e-2)
"""Rounding units of cl, ln cd and confidence [1]."""
AXES = ("position", "camber", "thickness", "n_crit")
_EXACT = 1e-9


class RawPolar(NamedTuple):
    """cl, cd and confidence over angle of attack and Reynolds number, (Na, Nr) each [1]."""

    cl: Array
    cd: Array
    confidence: Array


class ShippedTable(NamedTuple):
    """The whole table."""

    axes: tuple[Array, ...]  # Nodes of `AXES` [1]
    alpha_deg: Array
    Re: Array  # [1]
    values: NDArray[np.float32]  # (position, camber, thickness, n_crit, 3, Na, Nr): cl, ln cd, confidence [1]
    made_with: str


def pack(values: Array) -> NDArray[np.uint8]:
    """Round to `STEPS` and take differences along camber, thickness and n_crit: bytes that compress well.

    Confidence is rounded to the middle of its unit: what was above one half stays so.
    """
    units = [np.rint(values[..., 0, :, :] / STEPS[0]), np.rint(values[..., 1, :, :] / STEPS[1]),
             np.floor(values[..., 2, :, :] / STEPS[2])]  # fmt: skip
    whole = np.stack(units, axis=4).astype(np.int32)
    for axis in (1, 2, 3):
        whole = np.diff(whole, axis=axis, prepend=0)
    flat = whole.astype("<i2")
    if not np.array_equal(flat, whole):
        raise ValueError("got differences beyond 16 bits; expected a finer grid")
    return np.ascontiguousarray(np.moveaxis(flat.view(np.uint8).reshape(*flat.shape, 2), -1, 0))


def unpack(packed: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Values of `pack`, rounded."""
    whole = np.ascontiguousarray(np.moveaxis(packed, 0, -1)).view("<i2")[..., 0].astype(np.int32)
    for axis in (1, 2, 3):
        np.cumsum(whole, axis=axis, out=whole)
    out = whole.astype(np.float32)
    out[..., 2, :, :] += 0.5
    return out * np.array(STEPS, dtype=np.float32)[:, None, None]


@cache
def table() -> ShippedTable:
    """The shipped table, read once."""
    found = shipped_arrays("bemt.physics.sections", FILE)
    axes = tuple(found[name] for name in AXES)
    return ShippedTable(axes, found["alpha_deg"], found["Re"], unpack(found["packed"]), str(found["made_with"]))


def covers(shape: tuple[float, float, float] | None, n_crit: float) -> bool:
    """Whether the table holds a section, given as camber, its position and thickness over chord, at an n_crit [1].

    >>> covers((0.035, 0.4, 0.09), 3.0), covers((0.035, 0.4, 0.20), 3.0), covers(None, 3.0)
    (True, False, False)
    """
    if shape is None:
        return False
    camber, position, thickness = shape
    nodes = table().axes
    inside = zip((camber, thickness, n_crit), nodes[1:], strict=True)
    on_node = bool(np.min(np.abs(nodes[0] - position)) < _EXACT)
    return on_node and all(axis[0] - _EXACT <= x <= axis[-1] + _EXACT for x, axis in inside)


def raw_polar(shape: tuple[float, float, float], n_crit: float) -> RawPolar:
    """Interpolate the table for a section that it :func:`covers`."""
    camber, position, thickness = shape
    found = table()
    values = found.values[int(np.argmin(np.abs(found.axes[0] - position)))]
    for x, nodes in zip((camber, thickness, n_crit), found.axes[1:], strict=True):
        first, weights = _cubic(nodes, x)
        values = np.tensordot(weights, values[first : first + weights.size], axes=1)
    return RawPolar(values[0], np.exp(values[1]), np.clip(values[2], 0.0, 1.0))


def _cubic(nodes: Array, x: float) -> tuple[int, Array]:
    """First of the nodes around x, and Lagrange's weights of up to four of them."""
    nearest = int(np.argmin(np.abs(nodes - x)))
    if abs(nodes[nearest] - x) < _EXACT:
        return nearest, np.ones(1)
    first = int(np.clip(np.searchsorted(nodes, x) - 2, 0, max(nodes.size - 4, 0)))
    near = nodes[first : first + 4]
    return first, np.array([np.prod([(x - b) / (a - b) for b in near if b != a]) for a in near])
