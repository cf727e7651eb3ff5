r"""Grid convergence: observed order, extrapolated value and grid convergence index (GCI) from two or three grids.

Grid 1 is the finest. With representative cell sizes h1 < h2 < h3, r21 = h2/h1, r32 = h3/h2, e21 = f2 - f1,
e32 = f3 - f2 and s = sign(e32/e21), Celik's procedure solves

    p = | ln|e32/e21| + q(p) | / ln r21,      q(p) = ln( (r21^p - s) / (r32^p - s) )

(q = 0 when both ratios are equal), then f0 = (r21^p f1 - f2) / (r21^p - 1) and
GCI21 = Fs |e21/f1| / (r21^p - 1) with Fs = 1.25 for three grids and 3.0 for two, whose order is assumed.

The index means something only when the values fall into line: `flags` name oscillation, divergence, an implausible
order and small refinement ratios. Then `u_relative` no longer rests on the order but on the largest difference between
the grids (factor 3, after Eca and Hoekstra). Above the highest plausible order it goes over from the index at that
order to the spread, linearly up to twice the order: that an excess over the formal order costs in proportion is Xing's
and Stern's idea (J. Fluids Eng. 132(6), 061403, 2010; not checked against the paper), the ramp is ours.

References
----------
P.J. Roache, "Perspective: A Method for Uniform Reporting of Grid Refinement Studies", J. Fluids Eng. 116(3), 1994.
I.B. Celik et al., "Procedure for Estimation and Reporting of Uncertainty Due to Discretization in CFD Applications",
J. Fluids Eng. 130(7), 078001, 2008. L. Eca, M. Hoekstra, J. Comput. Phys. 262, 2014, 104-130. The factor 1.15 from an
index to a standard uncertainty is that of ASME V&V 20-2009 (not checked against the paper).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bemt.base.errors import Fault, InputError

FS_THREE = 1.25
"""Safety factor with three grids."""
FS_TWO = 3.0
"""Safety factor with two grids."""
MIN_RATIO = 1.3
"""Refinement ratio below which the index is mostly noise (Celik)."""
ORDERS = (0.5, 1.5)
"""Plausible observed orders: from 0.5 up to 1.5 times the formal one."""
COVERAGE = 1.15
"""Index over standard uncertainty."""


@dataclass(frozen=True)
class GridStudy:
    """Outcome of a grid study; index 1 is the finest grid."""

    values: tuple[float, ...]  # f1, f2 (, f3) [unit of the quantity]
    ratios: tuple[float, ...]  # r21 (, r32) [1]
    # Observed order; the assumed one with two grids; None when it cannot be told (oscillation, no difference) [1]
    order: float | None
    extrapolated: float | None  # Value at cell size zero; None without an order [unit of the quantity]
    # GCI21 and GCI32 as fractions of f1 and f2; None without an order (gci_coarse: also with two grids) [1]
    gci_fine: float | None
    gci_coarse: float | None
    asymptotic: float | None  # GCI32 / (r21^p GCI21), near 1 in the asymptotic range [1]
    u_relative: float  # Standard uncertainty of f1 by the grid, relative [1]
    flags: tuple[str, ...]  # What is wrong with the study; empty when nothing is


def ratios(cells: Sequence[float]) -> tuple[float, ...]:
    """Give refinement ratios from cell counts, finest grid first. [1]

    >>> [round(r, 3) for r in ratios([8e6, 1e6, 125e3])]
    [2.0, 2.0]
    """
    if min(cells) <= 0:
        raise InputError(Fault("", "grid", f"{', '.join(f'{n:g}' for n in cells)} cells", "positive numbers"))
    sizes = [float((1.0 / n) ** (1.0 / 3.0)) for n in cells]
    return tuple(b / a for a, b in zip(sizes, sizes[1:], strict=False))


def _order(e21: float, e32: float, r21: float, r32: float) -> float | None:
    """Observed order; None above 60.

    Celik's equation for s = 1 says e32/e21 = (r32^p - 1) r21^p / (r21^p - 1), whose right side grows with p: bisection
    finds its one root, where the fixed-point iteration may fail for unequal ratios.
    """
    a, b, wanted = math.log(r21), math.log(r32), math.log(e32 / e21)

    def excess(p: float) -> float:
        return p * b + math.log(-math.expm1(-p * b)) - math.log(-math.expm1(-p * a)) - wanted

    low, high = 1e-9, 60.0
    if excess(high) < 0.0:
        return None
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


def _refuse_unfit(f: Sequence[float], r: Sequence[float]) -> None:
    """Refuse values and ratios that no study can use."""
    if not (np.all(np.isfinite(f)) and np.all(f[:2])):
        raise InputError(Fault("", "values", ", ".join(f"{v:g}" for v in f), "finite values other than zero"))
    if not all(1.0 < v < math.inf for v in r):
        hint = "List the finest grid first; a ratio is coarse over fine cell size"
        raise InputError(Fault("", "ratios", ", ".join(f"{v:g}" for v in r), "numbers above 1", hint))


def grid_study(values: Sequence[float], ratios: Sequence[float], formal_order: float = 2.0) -> GridStudy:
    """Estimate the discretization error of a value on two or three grids.

    >>> s = grid_study([0.97050, 0.96854, 0.96178], [2, 2])
    >>> f"{s.order:.4f} {s.extrapolated:.5f} {s.gci_fine:.4%} {s.gci_coarse:.4%} {s.asymptotic:.3f}"
    '1.7862 0.97130 0.1031% 0.3562% 1.002'
    >>> round(grid_study([10.0, 9.0], [1.5]).gci_fine, 6)
    0.24
    """
    f, r = tuple(float(v) for v in values), tuple(float(v) for v in ratios)
    _refuse_unfit(f, r)
    flags = [f"ratio {v:.3g} below {MIN_RATIO}: the index is uncertain" for v in r if v < MIN_RATIO - 1e-9]
    fs = {3: FS_THREE, 2: FS_TWO}[len(f)]
    e21, spread = f[1] - f[0], (max(f) - min(f)) / abs(f[0])
    p: float | None = formal_order
    flag, e32 = f"two grids: order {formal_order:g} is assumed", f[-1] - f[-2]
    if len(f) == 3:
        p, flag = _three(e21, e32, r, formal_order)
    flags += [flag] * bool(flag)
    if p is None:
        return GridStudy(f, r, None, None, None, None, None, 3.0 * spread / COVERAGE, tuple(flags))
    factor = r[0] ** p - 1.0
    fine = fs * abs(e21 / f[0]) / factor
    coarse = fs * abs(e32 / f[1]) / (r[1] ** p - 1.0) if len(f) == 3 else None
    asymptotic = coarse / (r[0] ** p * fine) if coarse is not None and fine > 0.0 else None
    highest = ORDERS[1] * formal_order
    if flag and len(f) == 3 and p > highest:  # no jump at the limit: the index there goes over into the spread
        least, over = fs * abs(e21 / f[0]) / (r[0] ** highest - 1.0), min(p / highest - 1.0, 1.0)
        u = (least + over * max(3.0 * spread - least, 0.0)) / COVERAGE if math.isfinite(spread) else math.inf
    else:
        u = max(fine, 3.0 * spread if flag and len(f) == 3 else 0.0) / COVERAGE
    return GridStudy(f, r, p, f[0] - e21 / factor, fine, coarse, asymptotic, u, tuple(flags))


def _three(e21: float, e32: float, r: tuple[float, ...], formal_order: float) -> tuple[float | None, str]:
    """Order of three grids, and why the index must not be trusted; "" where it may."""
    ratio, why = (e32 / e21 if e21 else math.inf), ""
    if e21 == 0.0 or e32 == 0.0:
        why = f"the two {'finest' if e21 == 0.0 else 'coarser'} grids agree exactly:"
    elif not math.isfinite(ratio) or ratio == 0.0:
        why = "differences of unlike size:"
    elif ratio < 0.0:
        why = "oscillatory: the values do not converge monotonically;"
    # equal orders at the threshold: |e32/e21| = (r32^p - 1) r21^p / (r21^p - 1) falls to ln r32/ln r21
    elif ratio <= math.log(r[1]) / math.log(r[0]):
        why = "divergent: the change grows with refinement;"
    p = None if why else _order(e21, e32, *r)
    if p is None:
        return None, f"{why or 'an order above 60:'} no order can be determined"
    low, high = ORDERS[0], ORDERS[1] * formal_order
    plausible = low <= p <= high
    told = f"implausible order {p:.3g}: expected {low:g} to {high:g} (formal order {formal_order:g})"
    return p, "" if plausible else told
