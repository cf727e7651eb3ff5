"""Section tables from NeuralFoil: kept within what it knows, continued to +-180 degrees, cached by content.

Sections of the rule come from the shipped table of its answers (:mod:`bemt.physics.sections.neuralfoil`); any other
needs NeuralFoil itself, the extra ``[neuralfoil]``.

:func:`neuralfoil_polar` is what the section of a propeller gets (the rule of :mod:`bemt.physics.sections.rule`),
:func:`tunnel_polar` a smooth section in an ordinary wind tunnel.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bemt.base import cache
from bemt.base.arrays import Array
from bemt.base.cache import Kept, shipped_arrays
from bemt.base.document import Documented
from bemt.base.errors import needs
from bemt.physics.sections import rule
from bemt.physics.sections.polars import ALPHA_GRID, DEFAULT_RE, METHODS, Polar, extend, first_stall, viterna_cd_max

if TYPE_CHECKING:
    from geometry.airfoil import Airfoil


# NeuralFoil's answers for NACA four-digit sections, tabulated: the section rule needs no NeuralFoil.
#
# Made by ``reports/studies/section_table.py``: our own runs over camber, thickness, n_crit, Reynolds number and angle
# of attack, camber position 0.40 (the rule's) and 0.45 (fans); no weights of the network. Cubic in camber, thickness
# and n_crit between the nodes; angles and Reynolds numbers are those of the tables themselves. The nodes hold the
# rule's section and the ends of its ranges. There only rounding is left: cl 1e-4, cd 0.025 %, up to 0.01 % of the
# static CT and CP of the shipped cases. Between them (60 random sections, ``section_table.py check``), cl and ln cd
# from -4 to 10 deg and Re 3e4 to 1e6 are off by 4e-4 and 1.4e-3 in the median, 95 % within 8e-3 and 2e-2. CT and CP of
# a 10x5 with that section, over those at rest, are off by 0.03 % in the median, 95 % within 0.5 %, 2.2 % at worst
# (3,000 rev/min, where laminar separation sets in).

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


def unpack(packed: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Values of bytes: differences along camber, thickness and n_crit in units of `STEPS`."""
    whole = np.ascontiguousarray(np.moveaxis(packed, 0, -1)).view("<i2")[..., 0].astype(np.int32)
    for axis in (1, 2, 3):
        np.cumsum(whole, axis=axis, out=whole)
    out = whole.astype(np.float32)
    out[..., 2, :, :] += 0.5
    return out * np.array(STEPS, dtype=np.float32)[:, None, None]


@functools.cache
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


TABLE_VERSION = 6
"""Raise when the making of tables changes: older cache entries are then ignored."""
RAW_LIMIT_DEG = 20.0
"""NeuralFoil is used up to this |alpha| at most (beyond 20-25 deg it has no training data)."""
CONFIDENCE_MIN = 0.5
"""Past its stall, NeuralFoil is used while its own confidence is above this."""
BLEND_DEG = 2.0
"""Half-width of the blend between the section data and the post-stall model. [deg]"""
RE_REFERENCE = 3e5
"""Reynolds number whose lift bounds that of lower ones (`lift_floor`)."""
RE_LOWEST = 1e4
"""Lowest Reynolds number at which NeuralFoil is asked; below it lift stays and drag follows laminar friction."""
LIFT_SLACK = 0.1
"""Lift coefficient by which lower Reynolds numbers may miss that bound (room for a shift of the zero-lift angle)."""


def _confident_range(alpha: Array, cl: Array, confidence: Array, past_stall: float) -> tuple[float, float]:
    """Find the matching angles of one column of NeuralFoil numbers: past the stall while confident, 5 to 20 deg."""
    edge = []
    for sign in (1.0, -1.0):
        use = np.argsort(sign * alpha)
        use = use[(sign * alpha[use] >= -1e-9) & (sign * alpha[use] <= np.deg2rad(RAW_LIMIT_DEG) + 1e-9)]
        i = int(first_stall(sign * cl[use]))
        end = sign * alpha[use[i]] + past_stall + 1e-9
        while i + 1 < use.size and confidence[use[i + 1]] >= CONFIDENCE_MIN and sign * alpha[use[i + 1]] <= end:
            i += 1
        edge.append(max(abs(float(alpha[use[i]])), float(np.deg2rad(5.0))))
    return -edge[1], edge[0]


def neuralfoil_polar(airfoil: Airfoil, n_crit: float = rule.N_CRIT, drag_level: float = rule.DRAG_LEVEL) -> Polar:
    """Section table of a propeller blade by the general rule (:mod:`bemt.physics.sections.rule`), kept."""
    key = airfoil.key(), airfoil.name, airfoil.four_digit, float(n_crit), float(drag_level)
    if cache.watched():  # whoever collects the tables that are used is to see them
        return _by_rule(airfoil, n_crit, drag_level)
    return _POLARS.get(key, lambda: _by_rule(airfoil, n_crit, drag_level))


_POLARS: Kept[Polar] = Kept(128, lambda _: 1.0)


def _by_rule(airfoil: Airfoil, n_crit: float, drag_level: float) -> Polar:
    small = tunnel_polar(airfoil, n_crit=n_crit, lift_floor=0.0)
    large = tunnel_polar(airfoil, n_crit=max(n_crit, rule.N_CRIT_LARGE))
    w = np.clip(np.log(DEFAULT_RE / rule.SMALL_RE) / np.log(2.0), 0.0, 1.0)[None, :, None]
    return dataclasses.replace(
        small,
        cl=(1.0 - w) * small.cl + w * large.cl,
        cd=(1.0 - w) * small.cd * drag_level + w * large.cd,
        source=f"{small.source}; general rule: n_crit {n_crit:g} and drag x{drag_level:g} below Re {rule.SMALL_RE:.0e}",
    )


class _Settings(Documented):
    """What decides a polar besides the section and the Reynolds numbers."""

    n_crit: float
    xtr: tuple[float, float]
    model: str
    cd_max: float
    method: str
    past_stall: float
    lift_floor: float


def tunnel_polar(
    airfoil: Airfoil, *, re: Array = DEFAULT_RE, n_crit: float = 9.0, xtr_upper: float = 1.0, xtr_lower: float = 1.0,
    model: str = "xlarge", ar: float = 10.0, cd_max: float | None = None, method: str = "viterna",
    past_stall: float = np.pi, lift_floor: float = 0.5,
) -> Polar:  # fmt: skip
    """Incompressible polar of a smooth section in a wind tunnel, continued to +-180 deg, cached on disk by content. [0]

    Two bounds keep low Reynolds numbers sane. NeuralFoil mirrors XFOIL, whose steady laminar separation without
    reattachment takes nearly all lift (NACA 2415, Re 2e4, n_crit 9: cl(0) < 0, slope 0.45 of 2 pi), while the mean
    lift of the unsteady flow keeps about half: hence `lift_floor` (own assumption). And no cd is below laminar friction
    on both sides, 2.656 / sqrt(Re) (Blasius).

    Below Re 1e4 the network is not asked: lift is that at 1e4, and the least drag of the section grows as laminar
    friction does, with 1 / sqrt(Re) (Schlichting 1979, Boundary-Layer Theory, eq. 7.34), at other angles with cos^2.

    Sharpe, P., Hansman, R. J.: NeuralFoil: an airfoil aerodynamics analysis tool using physics-informed machine
    learning. arXiv:2503.16323 (2025).
    """
    re = np.asarray(re, dtype=float)
    if method not in METHODS:
        raise ValueError(f"method: got {method!r}; expected one of {', '.join(METHODS)}.")
    if re.ndim != 1 or re.size == 0 or not np.all(re > 0.0) or np.any(np.diff(re) <= 0.0):
        raise ValueError(f"re: got {re}; expected ascending Reynolds numbers above 0.")
    top = viterna_cd_max(ar) if cd_max is None else float(cd_max)
    xtr = (float(xtr_upper), float(xtr_lower))
    settings = _Settings(float(n_crit), xtr, model, top, method, float(past_stall), float(lift_floor))
    shape = airfoil.four_digit if _tabulated(airfoil, re, settings) else None
    asked = table().made_with if shape else f"NeuralFoil {_version()} {model}"
    key = cache.content_key(TABLE_VERSION, asked, shape, airfoil.key(), settings.document(), re, ALPHA_GRID)
    made = cache.cached_arrays("polar", key, lambda: _make(airfoil, re, settings))
    source = f"{asked}{', tabulated' if shape else ''}, n_crit {n_crit:g}, xtr {xtr_upper:g}/{xtr_lower:g}"
    return Polar(ALPHA_GRID, re, np.zeros(1), made["cl"][:, :, None], made["cd"][:, :, None], made["confidence"],
                 airfoil.name, f"{source}; {method} cd_max {top:g}")  # fmt: skip


RAW_DEG = np.arange(-2 * (RAW_LIMIT_DEG + BLEND_DEG), 2 * (RAW_LIMIT_DEG + BLEND_DEG) + 1) / 2.0
"""Angles of attack at which the network is asked [deg]."""


def to_install(sections: Iterable[Airfoil], n_crit: float) -> bool:
    """Whether the polars of sections need the network, and it is not installed."""
    return not all(covers(s.four_digit, n_crit) for s in sections) and not cache.is_installed("neuralfoil")


def _version() -> str:
    if not cache.is_installed("neuralfoil"):
        needs("neuralfoil", "neuralfoil")
    return cache.installed_version("neuralfoil")


def _tabulated(airfoil: Airfoil, re: Array, settings: _Settings) -> bool:
    """Whether the shipped table answers."""
    ordinary = settings.xtr == (1.0, 1.0) and settings.model == "xlarge"
    if not ordinary or not covers(airfoil.four_digit, settings.n_crit):
        return False
    return bool(np.all(np.isin(_asked(re), table().Re)))


def _asked(wanted: Array) -> Array:
    return np.unique(np.maximum(wanted, RE_LOWEST))


def ask(
    airfoil: Airfoil, re: Array, n_crit: float, xtr: Sequence[float] = (1.0, 1.0), model: str = "xlarge"
) -> RawPolar:
    """Ask NeuralFoil for cl, cd and confidence at `RAW_DEG` and Reynolds numbers, (Na, Nr) each [1]."""
    nf = needs("neuralfoil", "neuralfoil")
    a, r = np.meshgrid(RAW_DEG, re, indexing="ij")
    outline = np.column_stack([airfoil.x, airfoil.y])
    aero = nf.get_aero_from_coordinates(
        outline, a.ravel(), r.ravel(), n_crit=n_crit, xtr_upper=xtr[0], xtr_lower=xtr[1], model_size=model
    )
    return RawPolar(*(np.asarray(aero[k], dtype=float).reshape(a.shape) for k in ("CL", "CD", "analysis_confidence")))


def _raw(airfoil: Airfoil, re: Array, settings: _Settings) -> RawPolar:
    """The network's answers, from the shipped table where it has them; the last column is at RE_REFERENCE."""
    if not _tabulated(airfoil, re, settings):
        return ask(airfoil, np.append(re, RE_REFERENCE), settings.n_crit, settings.xtr, settings.model)
    assert airfoil.four_digit is not None  # the table covers it
    held = raw_polar(airfoil.four_digit, settings.n_crit)
    columns = np.argmax(table().Re == re[:, None], axis=1)
    return RawPolar(*(np.column_stack([v[:, columns], v[:, -1]]) for v in held))


def _make(airfoil: Airfoil, wanted: Array, settings: _Settings) -> dict[str, Array]:
    """Tables (Na, Nr) from one set of the network's answers."""
    re = _asked(wanted)
    cl, cd, conf = _raw(airfoil, re, settings)
    if settings.lift_floor > 0.0:
        up, down, keep = np.maximum(cl[:, -1:], 0.0), np.minimum(cl[:, -1:], 0.0), settings.lift_floor
        sane = np.clip(cl, keep * up + down / keep - LIFT_SLACK, keep * down + up / keep + LIFT_SLACK)
        cl = np.where(np.append(re, np.inf) < RE_REFERENCE, sane, cl)
    cl, cd, conf = cl[:, :-1], cd[:, :-1], conf[:, :-1]
    cd = np.maximum(cd, 2.656 / np.sqrt(re))
    alpha = np.deg2rad(RAW_DEG)
    full_cl, full_cd, confidence = np.zeros((3, ALPHA_GRID.size, re.size))
    half = np.deg2rad(BLEND_DEG)
    for j in range(re.size):
        lo, hi = _confident_range(alpha, cl[:, j], conf[:, j], settings.past_stall)
        full_cl[:, j], full_cd[:, j] = extend(
            alpha, cl[:, j], cd[:, j], lo=lo, hi=hi, cd_max=settings.cd_max, half=half, method=settings.method
        )
        inside = (ALPHA_GRID > lo - half) & (ALPHA_GRID < hi + half)
        confidence[:, j] = np.where(inside, np.interp(ALPHA_GRID, alpha, conf[:, j]), 0.0)
    below = wanted < RE_LOWEST
    if np.any(below):
        of = np.searchsorted(re, np.maximum(wanted, RE_LOWEST))
        full_cl, full_cd = full_cl[:, of], full_cd[:, of]
        friction = np.sqrt(RE_LOWEST / np.minimum(wanted, RE_LOWEST)) - 1.0
        along = np.cos(ALPHA_GRID[:, None]) ** 2  # friction acts along the chord
        full_cd = full_cd + friction * np.min(full_cd, axis=0) * along
        confidence = np.where(below, 0.0, confidence[:, of])
    return {"cl": full_cl, "cd": full_cd, "confidence": confidence}
