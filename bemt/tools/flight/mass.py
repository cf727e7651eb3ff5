"""Whether a stated mass can hover on what the log shows: momentum theory against the power of the battery.

A disk that carries T takes T sqrt(T/(2 rho A)) without any loss (Glauert, "Airplane Propellers", in Durand,
"Aerodynamic Theory" IV, 1935). The disks are taken as large as the speed of the rotors allows, so that only an
impossible mass is refused.
"""

from __future__ import annotations

import math

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault
from bemt.base.tables import number_text
from bemt.base.units import G0
from bemt.tools.flight.log import FlightLog

LEAST_KG, MOST_KG = 0.005, 1000.0
_TIP, _LARGEST = 170.0, 2.0  # fastest tip in hover, Mach 0.5 [m/s]; largest rotor where no speed is logged [m]
_MOST_A = 300.0  # battery current in hover where none is logged [A]
_RHO = 1.225  # logs hold no density [kg/m3]
_MARGIN = 2.0  # of a logged power: a current sensor that nobody calibrated


def mass_faults(log: FlightLog, mass_kg: float | None, name: str) -> list[Fault]:
    """Why a flight cannot have had a mass; nothing where the log does not tell.

    Parameters
    ----------
    log : FlightLog
        The flight.
    mass_kg : float or None
        Mass that is stated [kg].
    name : str
        Option or argument that states it.

    Returns
    -------
    list of Fault
        One or none.
    """
    if mass_kg is None:
        return []
    if not LEAST_KG <= mass_kg <= MOST_KG:
        hint = "In grams? Divide by 1000" if mass_kg > MOST_KG else ""
        return [Fault("", name, f"{mass_kg:g} kg", f"{LEAST_KG:g} to {MOST_KG:g} kg", hint)]
    amps = _current(log)
    volts = math.nan if log.voltage is None else _mean(log, log.voltage)
    most = volts * (_MARGIN * amps if amps > 0.0 else _MOST_A)
    if not most > 0.0 or not log.rotors:
        return []
    D = _LARGEST
    if log.rpm is not None:
        D = min(D, 60.0 * _TIP / (math.pi * _mean(log, log.rpm)))
    area = log.rotors * 0.25 * math.pi * D**2
    least = mass_kg * G0 * math.sqrt(mass_kg * G0 / (2.0 * _RHO * area))
    if not least > most:
        return []
    lifted = (2.0 * _RHO * area * most**2) ** (1.0 / 3.0) / G0
    source = f"{_MARGIN:g} times the {number_text(amps, 2)} A logged" if amps > 0.0 else f"{_MOST_A:g} A"
    got = f"{mass_kg:g} kg, which takes {number_text(least, 2)} W to hover on rotors of {D:.2g} m"
    expected = f"less than {number_text(lifted, 2)} kg, hovering on the battery's voltage and {source}"
    return [Fault(log.file, name, got, expected, "In grams? Divide by 1000")]


def _current(log: FlightLog) -> float:
    """Mean current of the battery in the air, else of all speed controllers; NaN where none is logged. [A]"""
    battery = math.nan if log.battery_current is None else _mean(log, log.battery_current)
    if battery > 0.0 or log.current is None:  # an autopilot without the sensor writes -1
        return battery
    return _mean(log, log.current.sum(axis=1))


def _mean(log: FlightLog, values: Array) -> float:
    """Mean in the air of the readings that are numbers; NaN without one."""
    found = values[log.flying]
    found = found[np.isfinite(found)]
    return float(found.mean()) if found.size else math.nan
