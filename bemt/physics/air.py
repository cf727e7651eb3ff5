"""Air: density, viscosity, speed of sound, from the standard atmosphere or from what a weather station reads.

References
----------
.. [1] U.S. Standard Atmosphere, 1976, NOAA-S/T 76-1562 (identical to ISO 2533 / ICAO Doc 7488 below 32 km):
       layers and constants table 1-4, pressure eqs. 33a-33b, sound speed eq. 50, viscosity eq. 51
       (equation numbers not checked against the document; its table values are in the tests).
.. [2] A. Picard, R. S. Davis, M. Glaeser, K. Fujii, "Revised formula for the density of moist air (CIPM-2007)",
       Metrologia 45 (2008) 149-155, doi:10.1088/0026-1394/45/2/004; eq. 1 and appendix A
       (coefficients checked against a public implementation, not against the paper).
.. [3] Water. Density: Kell, J. Chem. Eng. Data 20 (1975) 97, eq. 16; viscosity: Kestin, Sokolov and Wakeham, J. Phys.
       Chem. Ref. Data 7 (1978) 941, eq. 15; sound: Marczak, J. Acoust. Soc. Am. 102 (1997) 2776, eq. 3, and the salt
       term of Medwin, ibid. 58 (1975) 1318; salt in density and viscosity: Sharqawy, Lienhard and Zubair, Desalination
       and Water Treatment 16 (2010) 354, eqs. 8, 22 and 23 (not checked; ITTC 7.5-02-01-03 tabulates for 15 degC
       999.10 kg/m3 and 1.1386e-6 m2/s fresh, 1026.02 and 1.1892e-6 at 35.165 g/kg: within 0.1 %).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError, refuse
from bemt.base.units import G0, ZERO_CELSIUS

R_DRY = 287.05287
"""Specific gas constant of dry air in the standard atmosphere [J/(kg K)]."""
GAMMA = 1.4
"""Ratio of specific heats of dry air [-]."""
P0 = 101325.0
"""Standard sea-level pressure [Pa]."""
T0 = 288.15
"""Standard sea-level temperature [K]."""

# Base geopotential altitude [m], temperature [K], lapse rate [K/m] of [1], table 4.
_LAYERS = ((-5000.0, 320.65, -0.0065), (11000.0, 216.65, 0.0), (20000.0, 216.65, 0.001))
_TOP = 32000.0

LIQUID = (900.0, 1100.0)
"""Densities that are those of water, not of air [kg/m3]."""
_SALT = 45.0

# CIPM-2007, [2] appendix A.1: T in K, t in degC, p in Pa.
_R_GAS = 8.314472
_M_WATER = 18.01528e-3
_M_DRY = 28.96546e-3


def sutherland(temperature_K: float) -> float:
    """Dynamic viscosity of air by Sutherland's law.

    Reference [1] of the module, eq. 51: mu = 1.458e-6 T^1.5 / (T + 110.4).  Good to about 2 % from 170 K to 1900 K.
    Humidity is left out: it lowers the viscosity by less than 1 % below 35 degC.

    >>> round(sutherland(288.15) * 1e5, 4)
    1.7894
    """
    if not temperature_K > 0.0:
        raise InputError(Fault("", "temperature_K", f"{temperature_K:g}", "above 0 K", "Degrees Celsius given?"))
    return 1.458e-6 * temperature_K * math.sqrt(temperature_K) / (temperature_K + 110.4)


def isa_pressure(altitude_m: float) -> tuple[float, float]:
    """Pressure and temperature of the standard atmosphere.

    Reference [1] of the module, eqs. 23, 33a (lapse) and 33b (isothermal).

    >>> p, T = isa_pressure(11000.0)
    >>> round(p), round(T, 2)
    (22632, 216.65)
    """
    if not -5000.0 <= altitude_m <= _TOP:
        raise InputError(Fault("", "altitude_m", f"{altitude_m:g}", "-5000 to 32000 m", "Feet given?"))
    # The layer below 11 km is anchored at sea level, so that p(0) is exact.
    p, T, base, lapse = P0, T0, 0.0, _LAYERS[0][2]
    for i, (h, t, rate) in enumerate(_LAYERS):
        if i > 0:
            if altitude_m <= h:
                break
            p, T = _step(p, T, lapse, h - base), t
            base, lapse = h, rate
    dh = altitude_m - base
    return _step(p, T, lapse, dh), T + lapse * dh


def _step(p: float, T: float, lapse: float, dh: float) -> float:
    if lapse == 0.0:
        return p * math.exp(-G0 * dh / (R_DRY * T))
    return p * math.pow(1.0 + lapse * dh / T, -G0 / (R_DRY * lapse))


def saturation_pressure(temperature_K: float) -> float:
    """Saturation pressure of water vapour over liquid water.

    CIPM-2007, reference [2] of the module, appendix A.1.

    >>> round(saturation_pressure(293.15))
    2339
    """
    T = temperature_K
    return math.exp(1.2378847e-5 * T * T - 1.9121316e-2 * T + 33.93711047 - 6.3431645e3 / T)


def vapour_fraction(pressure_Pa: float, temperature_K: float, humidity_pct: float) -> float:
    """Mole fraction of water vapour.

    CIPM-2007, reference [2] of the module, appendix A.1: x_v = h f(p, t) p_sv / p with enhancement factor f.

    >>> round(vapour_fraction(101325.0, 293.15, 50.0), 5)
    0.01159
    """
    t = temperature_K - ZERO_CELSIUS
    f = 1.00062 + 3.14e-8 * pressure_Pa + 5.6e-7 * t * t
    return humidity_pct / 100.0 * f * saturation_pressure(temperature_K) / pressure_Pa


def _positive(value: Any) -> bool:
    if isinstance(value, str):  # numpy would read "1.2" as a number
        return False
    try:
        v = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        return False
    return v.size > 0 and bool(np.all(np.isfinite(v) & (v > 0.0)))


AIR_C = (-60.0, 60.0)
"""Temperatures that the air around a rotor can have. [degC]"""


def _degrees(value: float) -> str:
    """What a temperature that no air has may be in, instead of degrees Celsius."""
    if AIR_C[0] <= (kelvin := value - ZERO_CELSIUS) <= AIR_C[1]:
        return f"Kelvin given? {value:g} K is {kelvin:.3g} C"
    if AIR_C[0] <= (from_F := (value - 32.0) / 1.8) <= AIR_C[1]:
        return f"Fahrenheit given? {value:g} F is {from_F:.3g} C"
    return ""


def _within(given: Sequence[tuple[str, float, float, float, str, str]]) -> None:
    """Refuse all that lies outside: name, value, bounds, unit, hint."""
    faults = [
        Fault("", f"air.{name}", f"{value:g}", f"{low:g} to {high:g} {unit}", hint)
        for name, value, low, high, unit, hint in given
        if not low <= value <= high
    ]
    refuse(faults)


@dataclass(frozen=True)
class Air:
    """State of the air; `Air.stack` makes one of arrays, for a batch in which the air differs from point to point.

    Raises InputError: if a value is not a positive finite number; all faults at once.

    >>> air = Air.isa(0.0)
    >>> round(air.rho, 4), round(air.a_sound, 2)
    (1.225, 340.29)
    """

    rho: float  # Density [kg/m3]
    mu: float  # Dynamic viscosity [Pa s]
    a_sound: float  # Speed of sound [m/s]
    temperature_K: float = T0  # Static temperature [K]
    source: str = "given"  # How the state was made; printed in reports

    def __post_init__(self) -> None:
        faults = [
            Fault("", f"air.{name}", repr(value), "a positive finite number")
            for name in ("rho", "mu", "a_sound", "temperature_K")
            if not _positive(value := getattr(self, name))
        ]
        refuse(faults)

    @property
    def temperature(self) -> float:
        """Static temperature. [K]"""
        return self.temperature_K

    @property
    def nu(self) -> float:
        """Kinematic viscosity. [m2/s]"""
        return self.mu / self.rho

    @classmethod
    def stack(cls, airs: Sequence[Air]) -> Air:
        """Join states into one whose fields are arrays.

        >>> Air.stack([Air.isa(0.0), Air.isa(1000.0)]).rho.round(4)
        array([1.225 , 1.1116])
        """
        rho, mu, a, T = (
            np.array([getattr(x, f) for x in airs], dtype=float) for f in ("rho", "mu", "a_sound", "temperature_K")
        )
        make: Any = cls  # the annotations of the fields say float, the common case
        air: Air = make(rho, mu, a, T, "; ".join(dict.fromkeys(x.source for x in airs)))
        return air

    @classmethod
    def from_density(cls, rho: float = 1.225, temperature_C: float = 15.0) -> Air:
        """Air of a given density; viscosity and sound speed of dry air, or of water where it is as dense as water.

        >>> air = Air.from_density()
        >>> air.rho, round(air.a_sound, 1)
        (1.225, 340.3)
        """
        if LIQUID[0] <= rho <= LIQUID[1]:
            water = cls.water(temperature_C)
            source = f"water, {rho:g} kg/m3 at {temperature_C:g} degC; cavitation is not modelled"
            return cls(rho, water.mu, water.a_sound, water.temperature_K, source)
        T = temperature_C + ZERO_CELSIUS
        mu = sutherland(T)
        return cls(rho, mu, math.sqrt(GAMMA * R_DRY * T), T, f"density {rho:g} kg/m3 at {temperature_C:g} degC")

    @classmethod
    def water(cls, temperature_C: float = 15.0, salinity_g_kg: float = 0.0) -> Air:
        """Fresh water or sea water at one atmosphere; a propeller does not know that it is not air.

        Reference [3] of the module.

        >>> fresh, sea = Air.water(15.0), Air.water(15.0, 35.0)
        >>> round(fresh.rho, 1), round(fresh.nu * 1e6, 3), round(fresh.a_sound)
        (999.1, 1.139, 1466)
        >>> round(sea.rho, 1), round(sea.nu * 1e6, 3)
        (1026.2, 1.189)
        """
        _within(
            [
                ("temperature_C", temperature_C, 0.0, 60.0, "degC", _degrees(temperature_C)),
                ("salinity_g_kg", salinity_g_kg, 0.0, _SALT, "g/kg", "The oceans have 35"),
            ]
        )
        t, S = temperature_C, 1e-3 * salinity_g_kg
        kell = (999.83952, 16.945176, -7.9870401e-3, -46.170461e-6, 105.56302e-9, -280.54253e-12)
        rho = sum(a * t**k for k, a in enumerate(kell)) / (1.0 + 16.879850e-3 * t)
        rho += S * (802.0 - 2.001 * t + 1.677e-2 * t**2 - 3.060e-5 * t**3) - 1.613e-5 * S**2 * t**2
        d = 20.0 - t
        mu = 1.002e-3 * 10.0 ** (d / (t + 96.0) * (1.2364 - 1.37e-3 * d + 5.7e-6 * d**2))
        mu *= 1.0 + (1.541 + 1.998e-2 * t - 9.52e-5 * t**2) * S + (7.974 - 7.561e-2 * t + 4.724e-4 * t**2) * S**2
        marczak = (1402.385, 5.038813, -5.799136e-2, 3.287156e-4, -1.398845e-6, 2.787860e-9)
        a = sum(c * t**k for k, c in enumerate(marczak)) + (1.34 - 0.01 * t) * salinity_g_kg
        kind = f"sea water, {salinity_g_kg:g} g/kg" if S else "fresh water"
        return cls(rho, mu, a, t + ZERO_CELSIUS, f"{kind}, {t:g} degC; cavitation is not modelled")

    @classmethod
    def isa(cls, altitude_m: float = 0.0, dT: float = 0.0) -> Air:
        """Air of the International Standard Atmosphere.

        Reference [1] of the module, eqs. 33a, 33b, 42, 50 and 51.

        >>> air = Air.isa(5000.0)
        >>> round(air.rho, 5), round(air.a_sound, 2), round(air.mu * 1e5, 4)
        (0.73612, 320.53, 1.6281)
        >>> air = Air.isa(11000.0)
        >>> round(air.rho, 5), round(air.a_sound, 2)
        (0.36392, 295.07)
        """
        p, T = isa_pressure(altitude_m)
        T += dT
        mu = sutherland(T)
        return cls(p / (R_DRY * T), mu, math.sqrt(GAMMA * R_DRY * T), T, f"ISA {altitude_m:g} m, dT {dT:g} K")

    @classmethod
    def from_state(cls, pressure_Pa: float, temperature_C: float, humidity_pct: float = 0.0) -> Air:
        """Moist air from a barometer, a thermometer and a hygrometer.

        Density: CIPM-2007, eq. 1 of [2] with 400 ppm CO2, rho = p M_a / (Z R T) (1 - 0.3780 x_v); uncertainty 2.2e-5
        for 600-1100 hPa, 15-27 degC, and a smooth extrapolation outside.  Sound speed: ideal mixture,
        gamma = cp/(cp - R) with cp/R of 3.5 (dry) and 4.0 (vapour), within 0.1 % of real air.  Viscosity: dry.

        >>> air = Air.from_state(101325.0, 20.0, 50.0)
        >>> round(air.rho, 3), round(air.a_sound, 1)
        (1.199, 343.9)
        """
        _within(
            [
                ("pressure_Pa", pressure_Pa, 1e4, 1.2e5, "Pa", "hPa given?"),
                ("temperature_C", temperature_C, *AIR_C, "degC", _degrees(temperature_C)),
                ("humidity_pct", humidity_pct, 0.0, 100.0, "%", "Relative humidity in per cent"),
            ]
        )
        T, t, p = temperature_C + ZERO_CELSIUS, temperature_C, pressure_Pa
        x = vapour_fraction(p, T, humidity_pct)
        virial = 1.58123e-6 - 2.9331e-8 * t + 1.1043e-10 * t * t
        virial += (5.707e-6 - 2.051e-8 * t) * x + (1.9898e-4 - 2.376e-6 * t) * x * x
        Z = 1.0 - p / T * virial + (p / T) ** 2 * (1.83e-11 - 0.765e-8 * x * x)
        rho = p * _M_DRY / (Z * _R_GAS * T) * (1.0 - x * (1.0 - _M_WATER / _M_DRY))
        cp = 3.5 * (1.0 - x) + 4.0 * x
        molar = _M_DRY * (1.0 - x) + _M_WATER * x
        a = math.sqrt(cp / (cp - 1.0) * _R_GAS * T / molar)
        return cls(rho, sutherland(T), a, T, f"{p:g} Pa, {t:g} degC, {humidity_pct:g} % (CIPM-2007)")


def air_arrays(states: Sequence[Air], index: NDArray[np.intp]) -> Air:
    """One state of the air per point: an object whose fields are (P,) arrays; ``index`` (P,) says which state holds."""
    names = ("rho", "mu", "a_sound", "temperature_K")
    fields = {name: np.array([getattr(s, name) for s in states], dtype=float)[index] for name in names}
    return cast("Air", SimpleNamespace(**fields))
