"""Density and speed of sound of each point, from what the recording says of the air; nothing is assumed.

The first of these that there is: a density, row by row or for the whole file; pressure and temperature (dry air
without humidity); the air state that the caller declares; the standard atmosphere, only at an altitude that the caller
declares, and then every point is flagged ``standard air``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bemt.air import Air
from bemt.base.errors import InputError
from bemt.base.units import ZERO_CELSIUS

__all__ = ["AirOfPoints", "air_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AirOfPoints:
    """Density [kg/m3], speed of sound [m/s], viscosity [Pa s] of N points, NaN unknown; flag of the points; notes."""

    rho: Array
    a_sound: Array
    mu: Array
    flag: str = ""
    notes: tuple[str, ...] = ()


def air_of(
    values: Mapping[str, Array], n: int, constants: Mapping[str, float], air: Air | None, isa_altitude_m: float | None
) -> AirOfPoints:
    """Find the air of every point."""
    nan = np.full(n, np.nan)
    temperature = values.get("temperature_K", np.full(n, constants.get("temperature_K", np.nan)))
    notes: list[str] = []
    found = None
    flag = ""
    if "density_kg_m3" in values or "density_kg_m3" in constants:
        rho = values.get("density_kg_m3", np.full(n, constants.get("density_kg_m3", np.nan)))
        rho = np.where(rho > 0.0, rho, np.nan)
        found = AirOfPoints(rho, *_sound(temperature, nan))
    elif "pressure_Pa" in values and np.any(np.isfinite(temperature)):
        found, notes = _moist(values, temperature)
    if found is None or not np.any(np.isfinite(found.rho)):
        if air is not None:
            rho, a, mu = (np.broadcast_to(np.asarray(x, dtype=float), (n,)) for x in (air.rho, air.a_sound, air.mu))
            found = AirOfPoints(rho, a, mu)
            notes.append(f"air as declared: {air.source}")
        elif isa_altitude_m is not None:
            flag = "standard air"
            standard = Air.isa(isa_altitude_m)
            warm = np.where(np.isfinite(temperature), temperature, standard.temperature_K)
            a, mu = _sound(warm, nan)
            found = AirOfPoints(standard.rho * standard.temperature_K / warm, a, mu)
            notes.append(f"no air was recorded: standard atmosphere at {isa_altitude_m:g} m, as declared")
        else:
            notes.append("no density: no coefficients; give pressure and temperature, a density, or declare the air")
            found = AirOfPoints(nan, *_sound(temperature, nan))
    elif air is not None:
        share = float(np.nanmedian(found.rho)) / float(np.mean(air.rho)) - 1.0
        if abs(share) > 0.005:
            notes.append(f"the recorded density is {share:+.1%} of the declared one; the recorded one was taken")
    return AirOfPoints(found.rho, found.a_sound, found.mu, flag, tuple(notes))


def _sound(temperature: Array, nan: Array) -> tuple[Array, Array]:
    """Speed of sound and viscosity of dry air; NaN without a temperature that air of a laboratory can have."""
    a, mu = nan.copy(), nan.copy()
    for i, T in enumerate(temperature):
        if 200.0 < T < 340.0:
            state = Air.from_density(1.0, float(T) - ZERO_CELSIUS)
            a[i], mu[i] = state.a_sound, state.mu
    return a, mu


def _moist(values: Mapping[str, Array], temperature: Array) -> tuple[AirOfPoints, list[str]]:
    n = len(temperature)
    humidity = values.get("humidity", np.full(n, np.nan))
    out = [np.full(n, np.nan) for _ in range(3)]
    bad: list[str] = []
    for i in range(n):
        p, T, h = (float(x[i]) for x in (values["pressure_Pa"], temperature, humidity))
        if not (np.isfinite(p) and np.isfinite(T)):
            continue
        try:
            state = Air.from_state(p, T - ZERO_CELSIUS, 100.0 * h if np.isfinite(h) else 0.0)
        except InputError as error:
            bad.append(str(error.faults[0]))
            continue
        out[0][i], out[1][i], out[2][i] = state.rho, state.a_sound, state.mu
    notes = [
        f"density from pressure and temperature{' and humidity' if np.any(np.isfinite(humidity)) else ', dry air'}"
    ]
    if bad:
        notes.append(f"no density in {len(bad)} points: {bad[0]}")
    return AirOfPoints(out[0], out[1], out[2]), notes
