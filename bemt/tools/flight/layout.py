"""Where the rotors are and how they turn: the matrix from rotor thrusts to the loads on the body."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.tables import number_text
from bemt.base.units import G0
from bemt.tools.flight.log import FlightLog

LAYOUTS = {
    "crazyflie": "-45+ -135- 135+ 45-",
    "px4-x": "-45+ 135+ 45- -135-",
    "betaflight-x": "-135- -45+ 135+ 45-",
    "quad-x": "-45+ 135+ 45- -135-",
    "quad-plus": "-90+ 90+ 0- 180-",
    "quad-h": "-45- 135- 45+ -135+",
    "quad-x-dji": "-45+ 45- 135+ -135-",
    "quad-x-cw": "-45+ -135- 135+ 45-",
    "betaflight-x-rev": "-135+ -45- 135- 45+",
    "hexa-x": "-90- 90+ 30- -150+ -30+ 150-",
    "hexa-plus": "0- 180+ 120- -60+ 60+ -120-",
    "hexa-x-dji": "-30+ 30- 90+ 150- -150+ -90-",
    "hexa-x-cw": "-30+ -90- -150+ 150- 90+ 30-",
    "y6": "-60+ 60- 60+ 180- -60- 180+",
    "y6b": "-60- -60+ 180- 180+ 60- 60+",
    "y6f": "180+ -60+ 60+ 180- -60- 60-",
    "octo-x": "-22.5- 157.5- -67.5+ -157.5+ 22.5+ 112.5+ 67.5- -112.5-",
    "octo-plus": "0- 180- -45+ -135+ 45+ 135+ 90- -90-",
    "octo-x-dji": "-22.5+ 22.5- 67.5+ 112.5- 157.5+ -157.5- -112.5+ -67.5-",
    "octo-x-cw": "-22.5+ -67.5- -112.5+ -157.5- 157.5+ 112.5- 67.5+ 22.5-",
    "x8": "-45+ 45- 135+ -135- 45+ -45- -135+ 135-",
    "x8-h": "-45- 45+ 135- -135+ 45- -45+ -135- 135+",
    "x8-plus": "0+ 90- 180+ -90- 90+ 0- -90+ 180-",
    "x8-cw": "-45+ -45- -135+ -135- 135+ 135- 45+ 45-",
    "dodeca-hexa-plus": "0+ 0- -60- -60+ -120+ -120- 180- 180+ 120+ 120- 60- 60+",
    "dodeca-hexa": "-30+ -30- -90- -90+ -150+ -150- 150- 150+ 90+ 90- 30- 30+",
}
"""Angle of each motor in its numbering [deg, from ahead to the left], and its turning seen from above: + to the left.

Sources: Bitcraze, Crazyflie 2.x motor numbering; PX4 airframes reference; Betaflight default motor order (the same as
ArduPilot's BF_X); all others ArduPilot, libraries/SITL/SIM_Frame.cpp and AP_MotorsMatrix.cpp, whose angles count to the
right; the orders of DJI and clockwise (cw) by memory, not checked. Without CA_ parameters PX4's hexa-, octo- and x8 are
the same (src/lib/mixer/MultirotorMixer/geometries). px4-x and quad-x are one.
"""


def layout_of(text: str, rotors: int) -> Array | None:
    """Angle [rad], turning (+1 or -1) and arm [unit of the text; 1] of each rotor of a log, (B, 3); None for no text.

    `text` is a name of :data:`LAYOUTS`, or angles with signs such as ``"-45+ 135+ 45- -135-"`` [deg], each with its arm
    where arms differ: ``"-30@0.29+"``. InputError for another number of rotors or an unknown word.

    >>> layout_of("crazyflie", 4)[:, 1]
    array([ 1., -1.,  1., -1.])
    """
    if not text:
        return None
    words = re.split(r"[\s,]+", LAYOUTS.get(text, text).strip())
    found = [re.fullmatch(r"(-?\d+(?:\.\d+)?)(?:@(\d+(?:\.\d+)?))?([+-])", w) for w in words]
    if not all(found):
        fitting = [name for name, places in LAYOUTS.items() if len(places.split()) == rotors] or list(LAYOUTS)
        expected = f"{', '.join(fitting)}, or angles with signs"
        raise InputError(Fault("", "--layout", repr(text), expected, 'For example "-45+ 135+ 45- -135-"'))
    if len(found) != rotors:
        raise InputError(Fault("", "--layout", f"{len(found)} rotors", f"{rotors}, as in the log"))
    return np.array([[np.radians(float(m[1])), 1.0 if m[3] == "+" else -1.0, float(m[2] or 1.0)] for m in found if m])


def layout_text(ahead: ArrayLike, left: ArrayLike, turning: Sequence[float]) -> str:
    """Layout from places [m] and turning (above zero: to the left, seen from above), as :func:`layout_of` reads it.

    >>> layout_text([0.1, -0.1], [0.0, 0.0], [1, -1])
    '0@0.1+ 180@0.1-'
    """
    x, y = np.asarray(ahead, dtype=float), np.asarray(left, dtype=float)
    angle, arm = np.degrees(np.arctan2(y, x)), np.hypot(x, y)
    return " ".join(f"{a:.5g}@{r:.4g}{'+' if s > 0 else '-'}" for a, r, s in zip(angle, arm, turning, strict=True))


def mixed(layout: Array, thrust: Array, torque: Array, gains: tuple[float, float, float]) -> Array:
    """Commands (N, B) of a mixer from its demands: thrust (N,) and roll, pitch and yaw (N, 3), each times its gain.

    The largest share of a motor in roll or pitch is one; in yaw all have one. So it is in ArduPilot
    (AP_MotorsMatrix::normalise_rpy_factors, gains 1/2), in PX4 for four rotors before version 1.13 (geometry quad_x,
    gains 0.707, 0.707, 1) and on a Crazyflie (power_distribution_quadrotor.c, gains 1/2, 1/2, 1): by memory, not
    checked. Limits of the mixer are left out.
    """
    rows = effect_matrix(layout)[:3]
    rows = rows / np.maximum(np.abs(rows).max(axis=1, keepdims=True), 1e-12) * np.array(gains)[:, None]
    return np.asarray(np.clip(thrust[:, None] + torque @ rows, 0.0, None), dtype=float)


def effect_matrix(layout: Array) -> Array:
    """Loads per rotor thrust, scaled to the mean arm, (4, B) [1].

    Rows: roll to the right, pitch nose up (rotors ahead lift the nose), yaw reaction, total.
    """
    angle, turn, arm = layout.T
    arm = arm / arm.mean()
    return np.stack([arm * np.sin(angle), arm * np.cos(angle), turn, np.ones_like(angle)])


# Whether a stated mass can hover on what the log shows: momentum theory against the power of the battery.
#
# A disk that carries T takes T sqrt(T/(2 rho A)) without any loss (Glauert, "Airplane Propellers", in Durand,
# "Aerodynamic Theory" IV, 1935). The disks are taken as large as the speed of the rotors allows, so that only an
# impossible mass is refused.
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
    size = f"{D:.2g} m, the largest at the logged speed" if D < _LARGEST else f"even {D:g} m"
    got = f"{mass_kg:g} kg, which takes {number_text(least, 2)} W to hover, with rotors of {size}"
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
