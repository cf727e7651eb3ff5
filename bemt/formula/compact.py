"""The compact formula: thrust and power of an open propeller from diameter, pitch and blade count, and what else is
known: chord, measured pitch, series.

A helix blade (blade angle times radius constant) has a uniform inflow by momentum theory [1]_, so that the blade
integral closes. With the advance ratio J, lc = J/pi, the solidity s = B c/(pi R) at 0.75 R, r = 1/(1 + sqrt(Re0/Re))::

    theta = k (P/D)/pi + (2/3) a0 r^4                pitch and zero-lift (camber) angle of the helix
    K     = 5.73 s/4                                 lift slope 0.1 per degree [1]_
    li    = (-(2 lc + K) + sqrt((2 lc + K)^2 + 8 K (theta - lc)))/4       momentum: C = 2 li (lc + li)
    C     = r min(K (theta - lc - li), s m)          the blade loading C/s ends at m (stall)
    Cp    = C (lc + 1.15 li') + s cd0 sqrt(1e5/Re)/8 + d (C_unstalled - C) (P/D)/pi
    CT    = C pi^3/4,   CP = Cp pi^4/4               propeller convention; li' from C

Zero thrust lies at J = k P/D + 2 pi a0 r^4/3. Eight constants were fitted (:data:`CONSTANTS`); 5.73, 1.15 (induced
power factor) and the square root in the drag are textbook values [1]_. Three further numbers sharpen it, each optional:

* chord at 0.75 R. Without it c/R = c1 (D/10 in)^e, times the factor of the series;
* pitch measured at 0.75 R (2 pi 0.75 R tan of the blade angle). P/D is then the MEAN of label and measurement: makers
  left out, the mean beats either alone (label and protractor are about equally wrong);
* series (:data:`SERIES`): sections differ by maker and series, most of all in a0. Unknown series: the mean of all.

How it was found
----------------
On UIUC volume 1 only, on the 51 propellers whose blades are published (chord law: also the 41 chords that static thrust
implies). Forms were compared with the maker left out: stall as a smooth saturation or a corner, Reynolds number on
camber, lift slope, stall or all, as a power, linear in its logarithm or bounded, pitch with and without k, lift slope
falling with the chord, exact angles at 0.7 R, drag quadratic or cubic in loading. k, the corner and r did it. Series
and propellers are random effects (a0 by 0.06 rad each, level by 5 %): so r follows the change with rpm WITHIN each
propeller (ln CT 0.12 and zero-thrust J 0.05 per unit of ln Re, measured and made), the eight constants stand for
the mean series, and the series' own a0 shrinks to it as far as its propellers disagree.

Held out, not blind: volume 2 had been scored with earlier versions; that its GWS blades reach zero thrust at J = P/D
was known when series were tried; GWS has its a0 from three propellers of volume 1. What the inputs can carry at all is
printed by `bemt calibrate` (:mod:`bemt.formula.limit`); scores are in ``reports/calibration``.

References
----------
.. [1] J. G. Leishman, "Principles of Helicopter Aerodynamics", 2nd ed., Cambridge, 2006, chapters 2.6 and 3.3 (ideal
       twist, uniform inflow, induced power factor 1.15, lift slope 5.73 per radian). Not checked against the book.
.. [2] A. Gessow, G. C. Myers, "Aerodynamics of the Helicopter", 1952 (blade loading limit). Not checked against it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt import coefficients as co
from bemt.base.errors import Fault, InputError
from bemt.base.units import INCH

Array = NDArray[np.float64]

LIFT_SLOPE = 5.73
"""Lift slope of a section [1/rad]."""
INDUCED_FACTOR = 1.15
"""Induced power over that of uniform inflow [-]."""
RE_DRAG = 1.0e5
"""Reynolds number at which ``cd0`` holds [-]."""
D_CHORD = 10.0 * INCH
"""Diameter at which ``chord_R`` holds [m]."""
DIAMETER_RANGE = (7.0 * INCH, 19.0 * INCH)
"""Diameters of volume 1 [m]."""
P_OVER_D_RANGE = (0.27, 1.29)
"""Pitch over diameter in volume 1 [-]."""
RE_RANGE = (1.5e4, 1.4e5)
"""Reynolds number at 0.75 R in volume 1 [-]."""
M_TIP_DATA = 0.29
"""Largest tip Mach number of volume 1 [-]."""
M_TIP_LIMIT = 0.7
"""Tip Mach number above which compressibility must be expected [-]."""
X_LIMIT = 1.2
"""J/(P/D) beyond which the propeller works as a windmill [-]."""


@dataclass(frozen=True)
class Constants:
    """The eight fitted constants."""

    pitch_factor: float  # k, effective over nominal pitch [-]
    zero_lift: float  # a0, zero-lift angle of a cambered section at high Reynolds number [rad]
    loading_max: float  # m, largest blade loading C/s at high Reynolds number [-]
    re_scale: float  # Re0 of r [-]
    cd0: float  # Profile drag at Re 1e5 [-]
    stall_drag: float  # d, share of the thrust lost to stall that returns as drag [-]
    chord_R: float  # c1, chord over tip radius at 0.75 R of a 10 in propeller [-]
    chord_exponent: float  # e, how it changes with diameter [-]


CONSTANTS = Constants(0.9143, 0.1714, 0.1966, 2548.0, 0.02961, 0.7756, 0.1462, -0.2348)
"""Fitted on UIUC volume 1; `python -m bemt calibrate` finds them again where the data are."""


@dataclass(frozen=True)
class MakerSeries:
    """What sets a series of propellers apart from the mean of all."""

    zero_lift: float = 0.0  # Added to a0 [rad]
    chord: float = 1.0  # Chord over the typical one [-]
    name: str = ""  # Maker and series


SERIES: dict[str, MakerSeries] = {
    "ance": MakerSeries(0.0000, 0.961, "Aeronaut Carbon Electric"),
    "apc29ff": MakerSeries(0.0263, 0.987, "APC 29 Free Flight"),
    "apccf": MakerSeries(0.0000, 0.996, "APC Carbon Fiber"),
    "apce": MakerSeries(0.0027, 0.922, "APC Thin Electric"),
    "apcsf": MakerSeries(0.0289, 1.280, "APC Slow Flyer"),
    "apcsp": MakerSeries(0.0122, 0.964, "APC Sport"),
    "grcp": MakerSeries(-0.0133, 0.890, "Graupner CAM Prop"),
    "grcsp": MakerSeries(0.0231, 1.053, "Graupner CAM Slim"),
    "grsn": MakerSeries(-0.0407, 1.145, "Graupner Super Nylon"),
    "gwsdd": MakerSeries(-0.0521, 0.998, "GWS Direct Drive"),
    "kavfk": MakerSeries(0.0000, 0.977, "Kavon FK"),
    "mae": MakerSeries(0.0499, 1.004, "Master Airscrew Electric"),
    "mas": MakerSeries(-0.0400, 0.934, "Master Airscrew Scimitar"),
    "rusp": MakerSeries(0.0000, 1.006, "Rev Up Special Prop"),
    "zin": MakerSeries(0.0000, 0.827, "Zingali"),
}
"""By UIUC family; fitted on volume 1 together with `CONSTANTS`, shrunk to the mean by the number of propellers."""

BAND_X = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.1)
"""J/(P/D) of the error bands [-]; 0 is at rest."""
BANDS: dict[str, dict[str, tuple[float, ...]]] = {
    "label": {
        "CT68": (0.127, 0.140, 0.137, 0.136, 0.131, 0.111, 0.102),
        "CT95": (0.280, 0.268, 0.266, 0.301, 0.244, 0.213, 0.223),
        "CP68": (0.158, 0.178, 0.151, 0.140, 0.138, 0.139, 0.179),
        "CP95": (0.331, 0.351, 0.297, 0.275, 0.335, 0.356, 0.407),
    },
    "chord": {
        "CT68": (0.091, 0.088, 0.101, 0.114, 0.131, 0.110, 0.108),
        "CT95": (0.179, 0.163, 0.177, 0.179, 0.193, 0.206, 0.230),
        "CP68": (0.162, 0.136, 0.152, 0.170, 0.205, 0.182, 0.186),
        "CP95": (0.297, 0.255, 0.257, 0.298, 0.341, 0.389, 0.439),
    },
    "pitch": {
        "CT68": (0.086, 0.082, 0.094, 0.098, 0.106, 0.104, 0.105),
        "CT95": (0.176, 0.156, 0.171, 0.180, 0.184, 0.192, 0.201),
        "CP68": (0.142, 0.119, 0.114, 0.125, 0.142, 0.136, 0.147),
        "CP95": (0.254, 0.231, 0.246, 0.277, 0.324, 0.351, 0.337),
    },
}
"""Half-widths over the model's own static CT or CP [-] that hold 68 % (``CT68``) and 95 % (``CT95``) of the points when
the maker is left out of the fit, over `BAND_X`; given label, chord, chord and measured pitch."""


def find_series(name: str) -> MakerSeries:
    """Maker series by UIUC family (``gwsdd``) or name (``GWS Direct Drive``).

    >>> find_series("GWS Direct Drive") is SERIES["gwsdd"]
    True
    """
    for key, series in SERIES.items():
        if name.casefold() in (key, series.name.casefold()):
            return series
    known = ", ".join(f"{key} ({series.name})" for key, series in SERIES.items())
    raise InputError(Fault("", "series", name, known, "Leave it out: the mean of all series serves"))


def default_chord(diameter_m: ArrayLike, constants: Constants = CONSTANTS) -> Any:
    """Typical chord at 0.75 R of one blade of a two-bladed small propeller. [m]

    >>> round(1000 * default_chord(0.254), 1)
    18.6
    """
    D = np.asarray(diameter_m, dtype=float)
    out = 0.5 * D * constants.chord_R * (D / D_CHORD) ** constants.chord_exponent
    return float(out) if out.ndim == 0 else out


def effective_pitch(label: ArrayLike, measured: ArrayLike) -> Array:
    """Pitch that the formula takes."""
    a, b = np.asarray(label, dtype=float), np.asarray(measured, dtype=float)
    return np.asarray(np.where(np.isfinite(b), 0.5 * (a + b), a))


def coefficients(
    P_D: ArrayLike,
    J: ArrayLike,
    solidity: ArrayLike,
    Re: ArrayLike,
    constants: Constants = CONSTANTS,
    zero_lift: ArrayLike = 0.0,
    level: ArrayLike = 1.0,
) -> tuple[Array, Array]:
    """Thrust and power coefficient by the formula of the module. [-]

    At J = 0 without stall this is the hover of an ideally twisted rotor [1]_, C = 2 li^2 = K (theta - li) r.

    >>> CT, CP = coefficients(0.5, [0.0, 0.3, 0.6], 0.0929, 5e4)
    >>> CT.round(3), CP.round(3)
    (array([0.093, 0.056, 0.003]), array([0.038, 0.034, 0.014]))
    """
    c = constants
    pd, J, s, Re, change = (np.asarray(x, dtype=float) for x in (P_D, J, solidity, Re, zero_lift))
    with np.errstate(divide="ignore", invalid="ignore"):
        r = 1.0 / (1.0 + np.sqrt(c.re_scale / Re))
        K, lc = LIFT_SLOPE * s / 4.0, J / np.pi
        theta = c.pitch_factor * pd / np.pi + 2.0 / 3.0 * (c.zero_lift + change) * r**4
        r = r * np.asarray(level, dtype=float)
        b = 2.0 * lc + K
        # the root is (2 lc - K)^2 + 8 K theta, never negative for theta >= 0; this form of li does not cancel
        li = 2.0 * K * (theta - lc) / (b + np.sqrt(np.maximum(b * b + 8.0 * K * (theta - lc), 0.0)))
        unstalled = r * 2.0 * li * (lc + li)
        limit = r * s * c.loading_max
        C = np.clip(unstalled, -limit, limit)
        inner = np.maximum(lc * lc / 4.0 + C / 2.0, 0.0)
        induced = np.sqrt(inner) - lc / 2.0
        lost = np.maximum(unstalled - C, 0.0)
        Cp = C * (lc + INDUCED_FACTOR * induced) + s * c.cd0 * np.sqrt(RE_DRAG / Re) / 8.0
        Cp = Cp + c.stall_drag * lost * pd / np.pi
    return np.asarray(C * co.CT_PER_ROTOR), np.asarray(Cp * co.CP_PER_ROTOR)


SERIES_AT_REST, SERIES_WHOLE = 0.5, 0.5
"""Share of a series' a0 that acts on thrust at rest, and J/(P/D) from which all of it does [-]."""


def series_coefficients(
    P_D: ArrayLike,
    J: ArrayLike,
    solidity: ArrayLike,
    Re: ArrayLike,
    zero_lift: ArrayLike,
    constants: Constants = CONSTANTS,
) -> tuple[Array, Array]:
    """Thrust and power coefficient of a propeller of a known series. [-]

    a0 of a series is learnt at rest and in flight together. In flight it helps thrust (given the chord, 9.7 to 7.6 %
    in the median), at rest it makes some series worse (Master Airscrew Scimitar 4.9 to 7.9 %, given the chord; with
    half of it 5.6 %). So thrust at rest takes half; power takes all. Chosen on UIUC volumes 1 and 2.
    """
    pd, J = np.asarray(P_D, dtype=float), np.asarray(J, dtype=float)
    share = SERIES_AT_REST + (1.0 - SERIES_AT_REST) * np.clip(np.nan_to_num(J / pd) / SERIES_WHOLE, 0.0, 1.0)
    CT = coefficients(pd, J, solidity, Re, constants, share * zero_lift)[0]
    return CT, coefficients(pd, J, solidity, Re, constants, zero_lift)[1]
