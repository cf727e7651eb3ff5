"""Where the rotors are and how they turn: the matrix from rotor thrusts to the loads on the body."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError

__all__ = ["LAYOUTS", "effect_matrix", "layout_of"]

Array = NDArray[np.float64]

LAYOUTS = {
    "crazyflie": "-45+ -135- 135+ 45-",
    "px4-x": "-45+ 135+ 45- -135-",
    "betaflight-x": "-135- -45+ 135+ 45-",
    "hexa-x": "-90- 90+ 30- -150+ -30+ 150-",
    "octo-x": "-22.5- 157.5- -67.5+ -157.5+ 22.5+ 112.5+ 67.5- -112.5-",
}
"""Angle of each motor in its numbering [deg, from ahead to the left], and its turning seen from above: + to the left.

Sources: Bitcraze, Crazyflie 2.x motor numbering; PX4 airframes reference; Betaflight default motor order; ArduPilot
AP_MotorsMatrix (hexa X and octa X); not checked against their files here.
"""


def layout_of(text: str, rotors: int) -> Array | None:
    """Angles and turning.

    Parameters
    ----------
    text : str
        A name of :data:`LAYOUTS`, or angles with signs such as ``"-45+ 135+ 45- -135-"`` [deg]; empty: not known.
    rotors : int
        Number of rotors in the log.

    Returns
    -------
    (B, 2) float or None
        Angle [rad] and turning, +1 or -1 [1].

    Raises
    ------
    InputError
        For another number of rotors or an unknown word.

    Examples
    --------
    >>> layout_of("crazyflie", 4)[:, 1]
    array([ 1., -1.,  1., -1.])
    """
    if not text:
        return None
    words = re.split(r"[\s,]+", LAYOUTS.get(text, text).strip())
    found = [re.fullmatch(r"(-?\d+(?:\.\d+)?)([+-])", w) for w in words]
    if not all(found):
        expected = f"{', '.join(LAYOUTS)}, or angles with signs"
        raise InputError(Fault("", "--layout", repr(text), expected, 'For example "-45+ 135+ 45- -135-"'))
    if len(found) != rotors:
        raise InputError(Fault("", "--layout", f"{len(found)} rotors", f"{rotors}, as in the log"))
    return np.array([[np.radians(float(m[1])), 1.0 if m[2] == "+" else -1.0] for m in found if m])


def effect_matrix(layout: Array) -> Array:
    """Loads per rotor thrust, scaled to the arm.

    Parameters
    ----------
    layout : (B, 2) float
        Angle [rad] and turning [1].

    Returns
    -------
    (4, B) float
        Rows: roll to the right, pitch nose down reversed (rotors ahead lift the nose), yaw reaction, total [1].
    """
    angle, turn = layout.T
    return np.stack([np.sin(angle), np.cos(angle), turn, np.ones_like(angle)])
