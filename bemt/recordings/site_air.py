"""Density and speed of sound of each point, from what the recording says of the air; nothing is assumed.

The first of these that there is: a density, row by row or for the whole file; pressure and temperature (dry air
without humidity).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bemt.air import GAMMA, R_DRY, Air
from bemt.base.errors import InputError
from bemt.base.units import ZERO_CELSIUS

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class AirOfPoints:
    """Density [kg/m3] and speed of sound [m/s] of N points, NaN unknown; notes."""

    rho: Array
    a_sound: Array
    notes: tuple[str, ...] = ()


def air_of(values: Mapping[str, Array], n: int, constants: Mapping[str, float]) -> AirOfPoints:
    """Find the air of every point."""
    temperature = values.get("temperature_K", np.full(n, constants.get("temperature_K", np.nan)))
    found = None
    if "density_kg_m3" in values or "density_kg_m3" in constants:
        rho = values.get("density_kg_m3", np.full(n, constants.get("density_kg_m3", np.nan)))
        found = AirOfPoints(np.where(rho > 0.0, rho, np.nan), _sound(temperature))
    elif "pressure_Pa" in values and np.any(np.isfinite(temperature)):
        found = _moist(values, temperature)
    if found is not None and np.any(np.isfinite(found.rho)):
        return found
    note = "no density: no coefficients; give pressure and temperature, or a density"
    return AirOfPoints(np.full(n, np.nan), _sound(temperature), (*(found.notes if found else ()), note))


def _sound(temperature: Array) -> Array:
    """Speed of sound of dry air; NaN without a temperature that air of a laboratory can have."""
    T = np.where((temperature > 200.0) & (temperature < 340.0), temperature, np.nan)
    return np.asarray(np.sqrt(GAMMA * R_DRY * T))


def _moist(values: Mapping[str, Array], temperature: Array) -> AirOfPoints:
    n = len(temperature)
    humidity = values.get("humidity", np.full(n, np.nan))
    rho, a_sound = np.full((2, n), np.nan)
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
        rho[i], a_sound[i] = state.rho, state.a_sound
    notes = [
        "density from pressure and temperature" + (" and humidity" if np.any(np.isfinite(humidity)) else ", dry air")
    ]
    if bad:
        notes.append(f"no density in {len(bad)} points: {bad[0]}")
    return AirOfPoints(rho, a_sound, tuple(notes))
