r"""Grid convergence: observed order, extrapolated value and grid convergence index (GCI) from two or three grids.

Grid 1 is the finest. With representative cell sizes h1 < h2 < h3, r21 = h2/h1, r32 = h3/h2, e21 = f2 - f1,
e32 = f3 - f2 and s = sign(e32/e21), Celik's procedure solves

    p = | ln|e32/e21| + q(p) | / ln r21,      q(p) = ln( (r21^p - s) / (r32^p - s) )

(q = 0 when both ratios are equal), then f0 = (r21^p f1 - f2) / (r21^p - 1) and
GCI21 = Fs |e21/f1| / (r21^p - 1) with Fs = 1.25 for three grids and 3.0 for two, whose order is assumed.

The index means something only when the values fall into line: `flags` name oscillation, divergence, an implausible
order and small refinement ratios. Then `u_relative` no longer rests on the order but on the largest difference between
the grids (factor 3, after Eca and Hoekstra).

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

from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_text

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
    safety: float  # Factor Fs [1]
    u_relative: float  # Standard uncertainty of f1 by the grid, relative [1]
    flags: tuple[str, ...]  # What is wrong with the study; empty when nothing is


LOADS = {"thrust_N": "N", "duct_thrust_N": "N", "torque_Nm": "N m", "power_W": "W", "CT": "", "CQ": "", "CP": ""}
"""Loads that are extrapolated, and their units."""


class LoadStudy(Documented):
    """Grid study of one load at one condition; the finest grid comes first."""

    channel: str
    cells: tuple[float, ...]
    values: tuple[float, ...]  # unit of the channel
    u_relative: float  # Standard uncertainty on the finest grid [1]
    # As in `GridStudy`, of the finest three grids
    order: float | None = None
    extrapolated: float | None = None
    gci_fine: float | None = None
    gci_coarse: float | None = None
    asymptotic: float | None = None
    flags: tuple[str, ...] = ()
    rpm: float = math.nan
    airspeed_m_s: float = math.nan
    density_kg_m3: float = math.nan
    J: float = math.nan

    @property
    def name(self) -> str:
        """Load in words."""
        return self.channel if not LOADS[self.channel] else self.channel.rsplit("_", 1)[0].replace("_", " ")

    def sentence(self) -> str:
        """What the grids say.

        >>> s = grid_study([7.57, 7.42, 7.05], ratios([5.8e6, 1.7e6, 0.5e6]))
        >>> told = s.u_relative, s.order, s.extrapolated, s.gci_fine
        >>> LoadStudy("thrust_N", (5.8e6, 1.7e6, 0.5e6), s.values, *told, rpm=6000.0).sentence()
        'thrust on 5.8, 1.7, 0.5 million cells at 6000 rev/min: 7.57, 7.42, 7.05 N; order 2.22, 7.672 N at cell size 0, GCI 1.68 %, u 1.5 %'
        """  # noqa: E501
        unit, many = LOADS[self.channel], max(self.cells) >= 1e5
        grids = ", ".join(f"{c / (1e6 if many else 1.0):.3g}" for c in self.cells)
        state = "one speed" if math.isnan(self.rpm) else f"{self.rpm:g} rev/min"
        state += f", {self.airspeed_m_s:g} m/s" if self.airspeed_m_s > 0.0 else ""
        state += f", J {self.J:g}" if self.J > 0.0 else ""
        values = ", ".join(f"{v:.4g}" for v in self.values)
        lead = f"{self.name} on {grids}{' million' if many else ''} cells at {state}: {values} {unit}".rstrip()
        end = f"u {100 * self.u_relative:.1f} %" + (f" ({'; '.join(self.flags)})" if self.flags else "")
        if self.order is None or self.gci_fine is None:
            return f"{lead}; no order: three times their spread is taken, {end}"
        best = f"{number_text(self.extrapolated, 4)} {unit}".rstrip()
        return f"{lead}; order {self.order:.2f}, {best} at cell size 0, GCI {100 * self.gci_fine:.2f} %, {end}"


def cell_size(cells: float, volume: float = 1.0, dimensions: int = 3) -> float:
    """Give the representative cell size (V/N)^(1/d). [m]

    >>> round(cell_size(1e6) / cell_size(8e6), 3)
    2.0
    """
    if not (cells > 0 and volume > 0 and dimensions in (2, 3)):
        got = f"{cells:g} cells, volume {volume:g}, {dimensions} dimensions"
        raise InputError(Fault("", "grid", got, "positive numbers and 2 or 3 dimensions"))
    return float((volume / cells) ** (1.0 / dimensions))


def ratios(cells: Sequence[float], dimensions: int = 3) -> tuple[float, ...]:
    """Give refinement ratios from cell counts, finest grid first. [1]

    >>> [round(r, 3) for r in ratios([8e6, 1e6, 125e3])]
    [2.0, 2.0]
    """
    sizes = [cell_size(n, 1.0, dimensions) for n in cells]
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


def grid_study(
    values: Sequence[float], ratios: Sequence[float], formal_order: float = 2.0, safety: float | None = None
) -> GridStudy:
    """Estimate the discretization error of a value.

    >>> s = grid_study([0.97050, 0.96854, 0.96178], [2, 2])
    >>> f"{s.order:.4f} {s.extrapolated:.5f} {s.gci_fine:.4%} {s.gci_coarse:.4%} {s.asymptotic:.3f}"
    '1.7862 0.97130 0.1031% 0.3562% 1.002'
    >>> round(grid_study([10.0, 9.0], [1.5]).gci_fine, 6)
    0.24
    """
    f, r = tuple(float(v) for v in values), tuple(float(v) for v in ratios)
    faults = []
    if len(f) not in (2, 3):
        faults.append(Fault("", "values", f"{len(f)} grids", "two or three grids, finest first"))
    elif len(r) != len(f) - 1:
        faults.append(Fault("", "ratios", f"{len(r)} ratios for {len(f)} grids", f"{len(f) - 1}"))
    if not all(math.isfinite(v) for v in f) or any(v == 0.0 for v in f[:2]):
        faults.append(Fault("", "values", ", ".join(f"{v:g}" for v in f), "finite values other than zero"))
    if not all(math.isfinite(v) and v > 1.0 for v in r):
        hint = "List the finest grid first; a ratio is coarse over fine cell size"
        faults.append(Fault("", "ratios", ", ".join(f"{v:g}" for v in r), "numbers above 1", hint))
    if not (math.isfinite(formal_order) and 0.0 < formal_order <= 10.0):
        faults.append(Fault("", "formal_order", f"{formal_order:g}", "a number from 0 to 10"))
    if safety is not None and not (math.isfinite(safety) and safety >= 1.0):
        faults.append(Fault("", "safety", f"{safety:g}", "a factor of 1 or more"))
    if faults:
        raise InputError(faults)
    flags = [f"ratio {v:.3g} below {MIN_RATIO}: the index is uncertain" for v in r if v < MIN_RATIO - 1e-9]
    fs = (FS_THREE if len(f) == 3 else FS_TWO) if safety is None else float(safety)
    e21 = f[1] - f[0]
    spread = (max(f) - min(f)) / abs(f[0])
    p: float | None = formal_order
    bad = False
    if len(f) == 2:
        flags.append(f"two grids: order {formal_order:g} is assumed")
    else:
        e32 = f[2] - f[1]
        p, flag, bad = _three(e21, e32, r, formal_order)
        flags += flag
    if p is None:
        return GridStudy(f, r, None, None, None, None, None, fs, 3.0 * spread / COVERAGE, tuple(flags))
    factor = r[0] ** p - 1.0
    fine = fs * abs(e21 / f[0]) / factor
    coarse = fs * abs((f[2] - f[1]) / f[1]) / (r[1] ** p - 1.0) if len(f) == 3 else None
    asymptotic = coarse / (r[0] ** p * fine) if coarse is not None and fine > 0.0 else None
    u = max(fine, 3.0 * spread if bad else 0.0) / COVERAGE
    return GridStudy(f, r, p, f[0] - e21 / factor, fine, coarse, asymptotic, fs, u, tuple(flags))


def _three(e21: float, e32: float, r: tuple[float, ...], formal_order: float) -> tuple[float | None, list[str], bool]:
    """Order of three grids with its flags, and whether the index must not be trusted."""
    if e21 == 0.0 or e32 == 0.0:
        which = "the two finest grids agree exactly" if e21 == 0.0 else "the two coarser grids agree exactly"
        return None, [f"{which}: no order can be determined"], True
    if not math.isfinite(e32 / e21) or e32 / e21 == 0.0:
        return None, ["differences of unlike size: no order can be determined"], True
    if e32 / e21 < 0.0:
        return None, ["oscillatory: the values do not converge monotonically; no order can be determined"], True
    # equal orders on both sides of the threshold: |e32/e21| = (r32^p - 1) r21^p / (r21^p - 1) falls to ln r32/ln r21
    if abs(e32 / e21) <= math.log(r[1]) / math.log(r[0]):
        return None, ["divergent: the change grows with refinement; no order can be determined"], True
    p = _order(e21, e32, *r)
    if p is None:
        return None, ["an order above 60: no order can be determined"], True
    low, high = ORDERS[0], ORDERS[1] * formal_order
    if not low <= p <= high:
        return p, [f"implausible order {p:.3g}: expected {low:g} to {high:g} (formal order {formal_order:g})"], True
    return p, [], False
