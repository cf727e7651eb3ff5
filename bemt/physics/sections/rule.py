"""The declared general rule for blade sections, which hardly anybody publishes.

Propellers come with a diameter, a pitch and at best stations; sections, surface and transition are unknown.  The rule
gives every one of them the same answer unless its family has published its section.  Its numbers were calibrated on
UIUC volume 1 (51 propellers with stations, static and wind-tunnel data).  How far the section of a family may be from
it, and what slow flyers have more, is part of the population of measured rotors (`bemt.rotors`).

* RuleSection: NACA four-digit, camber 3.5 % at 40 % chord, thickness 9 %; six of the nine families of volume 1 with two
  or more propellers come out at 3.0 to 3.5 %.  APC publishes sections too (its PE0 files: E63 to NACA 4412, or Clark Y,
  scaled); with them static CT of volume 1 is off by 5.3 % in the median, with the rule by 3.7 %: not taken.
* Transition: n_crit 3.  Rotating small blades keep their lift down to Re 20,000, which n_crit 9 does not (static CT
  at Re 20,000-30,000 relative to the same propellers' top speed: -14 to -16 % with n_crit 9, -3 to +3 % with 3).
* Lift at small angles and Re below 20,000: as computed, without the bound of :func:`tunnel_polar` (``lift_floor``),
  which is for n_crit 9.  Volume 1 cannot tell (static CT 3.6 with the bound, 3.7 % without; zero-thrust J 3.4, 3.3 %);
  it was taken out with volume 2 in view (8.8, 7.9 %).
* Drag: 1.1 times the smooth section's, for moulded blades: static CP of volume 1 is then right in the median (-1.7 %
  at 1.0, +1.5 % at 1.2); in flight it is 2 % low.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from geometry.airfoil import Airfoil

N_CRIT = 3.0
DRAG_LEVEL = 1.1
# Above this Reynolds number the blade is no small moulded propeller; the smooth section's drag and an ordinary wind
# tunnel's n_crit are used from twice this on, blended in log Re between.
SMALL_RE = 3.0e5
N_CRIT_LARGE = 9.0


@dataclass(frozen=True)
class RuleSection:
    """A section at one radius: NACA four-digit, or a published one."""

    r_R: float  # Where it applies, r/R [1]
    # Fractions of the chord [1]; a published section has its own camber, which goes with its thickness
    camber: float
    position: float
    thickness: float
    shape: str = "naca4"  # ``naca4``, or a name of :data:`geometry.airfoil.PUBLISHED`


def _one(camber: float, thickness: float = 0.09) -> tuple[RuleSection, ...]:
    return (RuleSection(0.75, camber, 0.4, thickness),)


DEFAULT = _one(0.035)

# Deters, Ananda and Selig (2014), AIAA 2014-2151: SDA1075 over the whole blade of DA4002 and DA4022.
_SDA1075 = (RuleSection(0.75, 0.0196, 0.4, 0.11996, "sda1075"),)

# Clark Y thinned towards the tip: the standard propeller 5868-9 of NACA Report 640, which the UIUC family nr640 copies
# at model scale.  The thickness law is from memory of that report, not checked; a thickness file replaces it.
_CLARK_Y_640 = (0.2, 0.3, 0.45, 0.6, 0.75, 0.95), (0.25, 0.20, 0.13, 0.10, 0.085, 0.075)
# A root thicker than this is part of the hub, and no section.
_THICKEST = 0.25

FAMILIES: dict[str, tuple[RuleSection, ...]] = {"da4002": _SDA1075, "da4022": _SDA1075}
"""Families whose makers published their section, besides nr640."""


def source(family: str | None) -> str:
    """Where the section of a family comes from: ``published``, or ``rule`` for one nobody knows.

    >>> source("da4002"), source("apcsf")
    ('published', 'rule')
    """
    return "published" if family == "nr640" or family in FAMILIES else "rule"


def _clark_y(r_R: ArrayLike, thickness: ArrayLike) -> tuple[RuleSection, ...]:
    """Clark Y at a few radii of a thickness law."""
    x, t = np.asarray(r_R, dtype=float), np.asarray(thickness, dtype=float)
    at = np.linspace(x[0], x[-1], 6)
    law = np.minimum(np.interp(at, x, t), _THICKEST)
    return tuple(
        RuleSection(float(a), 0.306 * float(b), 0.4, float(b), "clark_y") for a, b in zip(at, law, strict=True)
    )


def sections(family: str | None = None, law: tuple[ArrayLike, ArrayLike] | None = None) -> tuple[RuleSection, ...]:
    """Sections of the rule, root first; ``law`` is a thickness file's r/R and t/c, for families that scale a section.

    >>> sections("da4002")[0].shape, sections("somebody")[0].camber
    ('sda1075', 0.035)
    >>> [(round(s.r_R, 2), round(s.thickness, 3)) for s in sections("nr640")][-2:]
    [(0.8, 0.083), (0.95, 0.075)]
    """
    if family == "nr640":
        return _clark_y(*(law or _CLARK_Y_640))
    return FAMILIES.get(family or "", DEFAULT)


def section_at(r_R: float, family: str | None = None) -> RuleSection:
    """Section of the rule nearest to r/R, for cases that take one section for the whole blade."""
    return min(sections(family), key=lambda s: abs(s.r_R - r_R))


@lru_cache(maxsize=256)
def airfoil(section: RuleSection) -> Airfoil:
    """Coordinates of a section of the rule."""
    from geometry.airfoil import naca4, published, thickened

    if section.shape == "naca4":
        return naca4(section.camber, section.position, section.thickness)
    return thickened(published(section.shape), section.thickness)
