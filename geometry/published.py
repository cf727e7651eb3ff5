"""Sections with published coordinates that whole families of propellers use."""

from __future__ import annotations

import numpy as np

from geometry.airfoil import Airfoil
from geometry.common import Array, Faults, pchip

# Deters, Ananda and Selig (2014), Reynolds Number Effects on the Performance of Small-Scale Propellers, AIAA 2014-2151,
# appendix A, table 4 (read from a transcription, not from the paper): x, y in Selig order.  The trailing edge is blunt
# (0.011) so that 5 in blades could be printed.
# fmt: off
_SDA1075 = (
    (1.000137, 0.005557), (0.996593, 0.005916), (0.986424, 0.007201), (0.970307, 0.009369), (0.948605, 0.012241),
    (0.921585, 0.015743), (0.889621, 0.019963), (0.853243, 0.024878), (0.813012, 0.030409), (0.769531, 0.036448),
    (0.72343, 0.042837), (0.675369, 0.049377), (0.625945, 0.055764), (0.575694, 0.061768), (0.525145, 0.067169),
    (0.474806, 0.071778), (0.425168, 0.075411), (0.376692, 0.077929), (0.329814, 0.0792), (0.284932, 0.079143),
    (0.242417, 0.077694), (0.202594, 0.074839), (0.165758, 0.070588), (0.132147, 0.06501), (0.101982, 0.058221),
    (0.075425, 0.050381), (0.052643, 0.041731), (0.033775, 0.032527), (0.01896, 0.023081), (0.008287, 0.013758),
    (0.001894, 0.005047), (0.00028, -0.001921), (0.004701, -0.007905), (0.015056, -0.014217), (0.030301, -0.020208),
    (0.050355, -0.025609), (0.075069, -0.03029), (0.104265, -0.034146), (0.137711, -0.03714), (0.175126, -0.039253),
    (0.216177, -0.040503), (0.260479, -0.040926), (0.307602, -0.040585), (0.357073, -0.039554),
    (0.408381, -0.037928), (0.460985, -0.035812), (0.514304, -0.033341), (0.567727, -0.030638),
    (0.620617, -0.027832), (0.672308, -0.025029), (0.72215, -0.0223), (0.76951, -0.019711), (0.813783, -0.017302),
    (0.854396, -0.015105), (0.890816, -0.013128), (0.922559, -0.011366), (0.949178, -0.009777),
    (0.970411, -0.008207), (0.986204, -0.006742), (0.996295, -0.005793), (0.999851, -0.005553),
)
# NACA's Clark Y (Report 431, 1932, table of ordinates; from memory, not checked): x, upper and lower side above the
# flat bottom.  [%]
_CLARK_Y = (
    (0.0, 3.50, 3.50), (1.25, 5.45, 1.93), (2.5, 6.50, 1.47), (5.0, 7.90, 0.93), (7.5, 8.85, 0.63), (10.0, 9.60, 0.42),
    (15.0, 10.68, 0.15), (20.0, 11.36, 0.03), (30.0, 11.70, 0.0), (40.0, 11.40, 0.0), (50.0, 10.52, 0.0),
    (60.0, 9.15, 0.0), (70.0, 7.35, 0.0), (80.0, 5.22, 0.0), (90.0, 2.80, 0.0), (95.0, 1.49, 0.0), (100.0, 0.12, 0.0),
)
# fmt: on
PUBLISHED = ("sda1075", "clark_y")
"""Names that :func:`published` knows."""


def published(name: str) -> Airfoil:
    """Make a published section.

    >>> for name in PUBLISHED:
    ...     print(name, round(published(name).thickness, 3), round(published(name).camber, 3))
    sda1075 0.12 0.02
    clark_y 0.117 0.036
    """
    if name == "sda1075":
        x, y = np.array(_SDA1075).T
        return Airfoil(name, x, y)
    faults = Faults()
    if name != "clark_y":
        faults.add("published section", repr(name), " or ".join(PUBLISHED))
    faults.check()
    s, upper, lower = 0.01 * np.array(_CLARK_Y).T
    x = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 81)))
    # both sides leave the nose like a root
    high, low = (pchip(np.sqrt(s), side, np.sqrt(x)) for side in (upper, lower))
    nose, tail = np.array([0.0, upper[0]]), np.array([1.0, 0.5 * (upper[-1] + lower[-1])])
    return Airfoil(name, *_on_chord(np.r_[x[::-1], x[1:]], np.r_[high[::-1], low[1:]], nose, tail))


def _on_chord(x: Array, y: Array, nose: Array, tail: Array) -> tuple[Array, Array]:
    """Turn and stretch points so that a chord lies from 0 to 1 along x."""
    along = tail - nose
    c, s = along / float(along @ along)
    dx, dy = x - nose[0], y - nose[1]
    return c * dx + s * dy, c * dy - s * dx


def thickened(section: Airfoil, thickness: float) -> Airfoil:
    """Scale the ordinates of a section to a thickness; its camber goes along.

    >>> thin = thickened(published("clark_y"), 0.0585)
    >>> round(thin.thickness, 4), round(thin.camber / published("clark_y").camber, 4)
    (0.0585, 0.5)
    """
    faults = Faults()
    hint = "Fractions of the chord: 4 % is 0.04" if thickness >= 1 else ""
    faults.number("thickness", thickness, 0.002, 0.6, hint=hint)
    faults.check()
    return Airfoil(f"{section.name}:{thickness:.4f}", section.x, section.y * (thickness / section.thickness))
