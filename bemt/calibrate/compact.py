"""The compact formula: thrust and power of an open propeller from diameter, pitch and blade count, chord if known.

A helix blade (blade angle times radius constant) has a uniform inflow by momentum theory [1]_, so that the blade
integral closes. With the advance ratio J, lc = J/pi, the solidity s = B c/(pi R) at 0.75 R, r = 1/(1 + sqrt(Re0/Re))::

    theta = k (P/D)/pi + (2/3) a0 r^2                pitch and zero-lift (camber) angle of the helix
    K     = 5.73 s/4                                 lift slope 0.1 per degree [1]_
    li    = (-(2 lc + K) + sqrt((2 lc + K)^2 + 8 K (theta - lc)))/4       momentum: C = 2 li (lc + li)
    C     = r min(K (theta - lc - li), s m)          the blade loading C/s ends at m (stall)
    Cp    = C (lc + 1.15 li') + s cd0 sqrt(1e5/Re)/8 + d (C_unstalled - C) (P/D)/pi
    CT    = C pi^3/4,   CP = Cp pi^4/4               propeller convention; li' from C

Without a chord, c/R = c1 (D/10 in)^e. Zero thrust lies at J = k P/D + 2 pi a0 r^2/3. Eight constants were fitted
(:data:`CONSTANTS`); 5.73, 1.15 (induced power factor) and the square root in the drag are textbook values [1]_.

How it was found
----------------
On UIUC volume 1 only: thrust and power constants on the 51 propellers whose chord is published, Re0 by the change of
static CT with rpm WITHIN each propeller, robustly; the chord law on those 51 chords and the 41 that static thrust
implies. Forms were compared by leave-one-maker-out on volume 1: stall as a smooth saturation (powers 3, 6, 8, 12) or a
corner, Reynolds number on the camber angle, the lift slope, the stall or all of them, as a power or bounded, pitch with
and without k, a representative section at 0.7 R with exact angles, profile drag as quadratic or cubic in the loading.
Exact angles bought nothing; k and the corner did; r on thrust and r^2 on camber follow the measured change of CT and of
zero-thrust J with rpm within propellers (0.035 per unit of ln Re; measured, median of 83: 0.040).

Held out, not blind: volume 2 was scored with four versions. The first had r on thrust alone and a constant chord; r on
camber, the fit on known chords with the chord law, and r^2 came after scores had been seen, each settled on volume 1
(the chord law with the Drive Calculator table in view too). No constant was fitted to volume 2. There, static thrust is
within 13 % on 54 % of the points with measured chords (K1/K2: 41 %) and on 31 % with typical ones, and the medians in
flight run from 1.05 to 1.17: NOT the 70 % and 0.9 to 1.1 aimed at. Makers left out of volume 1, chord known: 82 %, and
0.97 to 1.01. See ``reports/calibration``.

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
from bemt.air import Air
from bemt.errors import Fault, InputError
from bemt.units import INCH, KGF

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
    """The eight fitted constants.

    Attributes
    ----------
    pitch_factor : float
        k, effective over nominal pitch. [-]
    zero_lift : float
        a0, zero-lift angle of a cambered section at high Reynolds number. [rad]
    loading_max : float
        m, largest blade loading C/s at high Reynolds number. [-]
    re_scale : float
        Re0 of r. [-]
    cd0 : float
        Profile drag at Re 1e5. [-]
    stall_drag : float
        d, share of the thrust lost to stall that returns as drag. [-]
    chord_R : float
        c1, chord over tip radius at 0.75 R of a 10 in propeller. [-]
    chord_exponent : float
        e, how it changes with diameter. [-]
    """

    pitch_factor: float
    zero_lift: float
    loading_max: float
    re_scale: float
    cd0: float
    stall_drag: float
    chord_R: float
    chord_exponent: float


CONSTANTS = Constants(0.8859, 0.1341, 0.1979, 2643.0, 0.03114, 0.7896, 0.146, -0.2329)
"""Fitted on UIUC volume 1; `python -m bemt calibrate` finds them again where the data are."""

BAND_X = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.1)
"""J/(P/D) of the error bands [-]; 0 is at rest."""
BANDS: dict[str, dict[str, tuple[float, ...]]] = {
    "known": {
        "CT68": (0.095, 0.092, 0.100, 0.118, 0.133, 0.115, 0.114),
        "CT95": (0.168, 0.159, 0.175, 0.181, 0.196, 0.204, 0.224),
        "CP68": (0.155, 0.136, 0.149, 0.165, 0.198, 0.191, 0.192),
        "CP95": (0.288, 0.254, 0.255, 0.284, 0.331, 0.356, 0.417),
    },
    "unknown": {
        "CT68": (0.160, 0.157, 0.160, 0.161, 0.155, 0.119, 0.113),
        "CT95": (0.330, 0.297, 0.286, 0.290, 0.269, 0.246, 0.238),
        "CP68": (0.171, 0.175, 0.155, 0.137, 0.150, 0.170, 0.201),
        "CP95": (0.385, 0.396, 0.355, 0.318, 0.336, 0.348, 0.430),
    },
}
"""Half-widths over the model's own static CT or CP [-] that hold 68 % (``CT68``) and 95 % (``CT95``) of the points when
the maker is left out of the fit, over `BAND_X`; ``known`` and ``unknown`` chord."""


def default_chord(diameter_m: ArrayLike, constants: Constants = CONSTANTS) -> Any:
    """Typical chord at 0.75 R of one blade of a two-bladed small propeller.

    Parameters
    ----------
    diameter_m : float or array
        Diameter. [m]
    constants : Constants
        Its law.

    Returns
    -------
    float or array
        Chord; single propellers scatter by 16 % about it. [m]

    Examples
    --------
    >>> round(1000 * default_chord(0.254), 1)
    18.5
    """
    D = np.asarray(diameter_m, dtype=float)
    out = 0.5 * D * constants.chord_R * (D / D_CHORD) ** constants.chord_exponent
    return float(out) if out.ndim == 0 else out


def coefficients(
    P_D: ArrayLike, J: ArrayLike, solidity: ArrayLike, Re: ArrayLike, constants: Constants = CONSTANTS
) -> tuple[Array, Array]:
    """Thrust and power coefficient by the formula of the module.

    Parameters
    ----------
    P_D, J : float or array
        Pitch over diameter; advance ratio. [-]
    solidity : float or array
        B c/(pi R) with the chord at 0.75 R. [-]
    Re : float or array
        Reynolds number of the section at 0.75 R. [-]
    constants : Constants
        Fitted constants.

    Returns
    -------
    CT, CP : array
        Propeller convention. [-]

    Notes
    -----
    At J = 0 without stall this is the hover of an ideally twisted rotor [1]_, C = 2 li^2 = K (theta - li) r.

    Examples
    --------
    >>> CT, CP = coefficients(0.5, [0.0, 0.3, 0.6], 0.0929, 5e4)
    >>> CT.round(3), CP.round(3)
    (array([0.095, 0.058, 0.006]), array([0.039, 0.036, 0.016]))
    """
    c = constants
    pd, J, s, Re = (np.asarray(x, dtype=float) for x in (P_D, J, solidity, Re))
    with np.errstate(divide="ignore", invalid="ignore"):
        r = 1.0 / (1.0 + np.sqrt(c.re_scale / Re))
        K, lc = LIFT_SLOPE * s / 4.0, J / np.pi
        theta = c.pitch_factor * pd / np.pi + 2.0 / 3.0 * c.zero_lift * r * r
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


@dataclass(frozen=True, eq=False)
class Estimate:
    """Outcome of the compact formula over N points.

    Attributes
    ----------
    thrust_N, power_W : (N,) float
        Thrust [N], shaft power [W].
    rpm, airspeed_m_s : (N,) float
        Rotational speed [rev/min], airspeed [m/s].
    CT, CP, J, M_tip, Re : (N,) float
        Propeller convention, advance ratio, rotational tip Mach number, Reynolds number at 0.75 R. [-]
    u_thrust_N, u_power_W : (N,) float
        Half-widths that held 68 % of the points of makers left out of the fit; NaN (unknown) for ducted rotors, near
        the speed of sound and beyond zero thrust. At flagged points too narrow: on volume 2 they hold about half. [N],
        [W]
    u95_thrust_N, u95_power_W : (N,) float
        The same for 95 %. [N], [W]
    flags : tuple of tuple of str
        Per point, why not to trust it; empty when inside the data.
    """

    thrust_N: Array
    power_W: Array
    rpm: Array
    airspeed_m_s: Array
    CT: Array
    CP: Array
    J: Array
    M_tip: Array
    Re: Array
    u_thrust_N: Array
    u_power_W: Array
    u95_thrust_N: Array
    u95_power_W: Array
    flags: tuple[tuple[str, ...], ...]

    @property
    def thrust_kgf(self) -> Array:
        """Thrust. [kgf]"""
        return self.thrust_N / KGF


def validity_flags(
    diameter_m: float, P_D: float, blades: float, Re: float, M_tip: float, x: float, chord_known: bool = True,
    ducted: bool = False,
) -> tuple[str, ...]:  # fmt: skip
    """Say where a point leaves the data of the calibration.

    Parameters
    ----------
    diameter_m : float
        Diameter. [m]
    P_D : float
        Pitch over diameter. [-]
    blades : float
        Number of blades. [-]
    Re, M_tip : float
        Reynolds number at 0.75 R, rotational tip Mach number. [-]
    x : float
        J/(P/D). [-]
    chord_known : bool
        Whether the chord was given.
    ducted : bool
        Whether the rotor runs in a duct.

    Returns
    -------
    tuple of str
        Empty inside the data.

    Examples
    --------
    >>> validity_flags(0.254, 0.5, 2, 5e4, 0.2, 0.3)
    ()
    >>> validity_flags(0.3556, 0.57, 2, 3e5, 1.09, 0.0)[-1]
    'tip Mach 1.09 is supersonic: extrapolated, the formula knows no Mach number'
    """
    out = []
    low, high = DIAMETER_RANGE
    if not low * 0.999 <= diameter_m <= high * 1.001:
        hint = "" if chord_known else "; give the chord, small propellers are wider than the default"
        out.append(f"diameter {diameter_m / INCH:.3g} in outside the data (7-19 in){hint}")
    low, high = P_OVER_D_RANGE
    if not low <= P_D <= high:
        out.append(f"P/D {P_D:.2f} outside the data ({low:g}-{high:g})")
    if blades != 2:
        out.append(f"{blades:g} blades: every propeller of the calibration has 2")
    if np.isfinite(Re) and not RE_RANGE[0] <= Re <= RE_RANGE[1]:
        out.append(f"Reynolds number {Re:.2g} outside the data ({RE_RANGE[0]:.2g}-{RE_RANGE[1]:.2g})")
    if M_tip >= 1.0:
        out.append(f"tip Mach {M_tip:.2f} is supersonic: extrapolated, the formula knows no Mach number")
    elif M_tip > M_TIP_LIMIT:
        out.append(f"tip Mach {M_tip:.2f} above {M_TIP_LIMIT:g}: extrapolated, the formula knows no Mach number")
    elif M_tip > M_TIP_DATA:
        out.append(f"tip Mach {M_tip:.2f} beyond the data ({M_TIP_DATA:g})")
    if ducted:
        out.append("ducted: a fit to open propellers (no duct, cascade or stator)")
    if x < 0.0:
        out.append("airspeed from behind: outside the model")
    elif x > X_LIMIT:
        out.append(f"J/(P/D) {x:.2f}: beyond zero thrust, outside the data")
    return tuple(out)


def _check(D: Array, pitch: Array, B: Array, rpm: Array, V: Array, chord: Array) -> None:
    hint = "Inches or millimetres given?"
    tests = (
        ("diameter_m", D, (D > 0) & (D < 100), "a positive length", hint),
        ("pitch_m", pitch, (pitch > 0) & (pitch < 100), "a positive length", hint),
        ("blades", B, (B >= 1) & (B <= 20) & (B == np.floor(B)), "a whole number from 1 to 20", ""),
        ("rpm", rpm, (rpm >= 0) & np.isfinite(rpm), "0 rev/min or more", "The model has no sense of rotation"),
        ("airspeed_m_s", V, np.isfinite(V), "a finite speed", ""),
        ("chord_m", chord, (chord > 0) & (chord < 0.5 * D), "more than 0 and less than the radius", hint),
    )
    faults = [
        Fault("", name, f"{float(x[~ok].ravel()[0]):g}", expected, hint)
        for name, x, ok, expected, hint in tests
        if not np.all(ok)
    ]
    if faults:
        raise InputError(faults)


def estimate(
    diameter_m: ArrayLike, pitch_m: ArrayLike, blades: ArrayLike, rpm: ArrayLike, airspeed_m_s: ArrayLike = 0.0,
    air: Air | None = None, chord_m: ArrayLike | None = None, ducted: bool = False,
) -> Estimate:  # fmt: skip
    """Thrust and power with their bands and flags.

    Parameters
    ----------
    diameter_m, pitch_m : float or array
        Diameter; geometric pitch, advance per turn. [m]
    blades : int or array
        Number of blades. [-]
    rpm : float or array
        Rotational speed. [rev/min]
    airspeed_m_s : float or array
        Airspeed along the axis. [m/s]
    air : Air, optional
        State of the air; 1.225 kg/m3 at 15 degC by default.
    chord_m : float or array, optional
        Chord of a blade at 0.75 R, by far the best fourth number; a typical one by default. [m]
    ducted : bool
        Whether the rotor runs in a duct; only flagged, the formula has no duct.

    Returns
    -------
    Estimate
        Arguments broadcast against each other and raveled to N points; NaN without rotation in moving air.

    Raises
    ------
    InputError
        For lengths that are not positive, a chord above the radius, a blade count that is not whole, negative rpm; all
        at once.

    Examples
    --------
    >>> e = estimate(10 * 0.0254, 5 * 0.0254, 2, 6000.0)
    >>> e.thrust_N.round(1), e.u_thrust_N.round(1), e.power_W.round(0), e.flags
    (array([5.2]), array([0.8]), array([51.]), ((),))
    """
    air = Air.from_density() if air is None else air
    known = chord_m is not None
    names = (diameter_m, pitch_m, blades, rpm, airspeed_m_s, default_chord(diameter_m) if chord_m is None else chord_m,
             air.rho, air.mu, air.a_sound)  # fmt: skip
    arrays = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in names))
    D, p, B, w, V, c, rho, mu, a = (np.ravel(x) for x in arrays)
    _check(D, p, B, w, V, c)
    n = w / 60.0
    J = np.asarray(co.J(V, n, D))
    Re = np.asarray(co.Re75(c, n, D, V, rho, mu))
    M = np.asarray(co.M_tip(n, D, a))
    pd, s = p / D, 2.0 * B * c / (np.pi * D)
    turning = np.where(n > 0, Re, np.nan)  # without rotation there is no coefficient
    CT, CP = coefficients(pd, J, s, turning)
    CT0, CP0 = coefficients(pd, np.zeros_like(pd), s, turning)
    still = (n == 0) & (V == 0)
    T = np.where(still, 0.0, co.thrust(CT, rho, n, D))
    P = np.where(still, 0.0, co.power(CP, rho, n, D))
    # without rotation J is NaN: the sign of V decides then
    x = np.where(np.isnan(J), np.copysign(np.where(V == 0, 0.0, np.inf), V), J / pd)
    rows = zip(D, pd, B, Re, M, x, strict=True)
    flags = tuple(validity_flags(d, ratio, b, re, m, at, known, ducted) for d, ratio, b, re, m, at in rows)
    unknown = ducted | (M > M_TIP_LIMIT) | (x < 0.0) | (x > X_LIMIT)
    band = BANDS["known" if known else "unknown"]

    def width(key: str, scale: Array) -> Array:
        return np.where(unknown, np.nan, np.interp(x, BAND_X, band[key]) * scale)

    T0, P0 = np.asarray(co.thrust(CT0, rho, n, D)), np.asarray(co.power(CP0, rho, n, D))
    return Estimate(T, P, w, V, CT, CP, J, M, Re, width("CT68", T0), width("CP68", P0), width("CT95", T0),
                    width("CP95", P0), flags)  # fmt: skip
