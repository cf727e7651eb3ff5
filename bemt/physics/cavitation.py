"""Cavitation: the thrust beyond which blades in water want more area."""

from __future__ import annotations

import math

import numpy as np

from geometry.rotor import Rotor

WET = 500.0
"""Density above which the fluid is a liquid [kg/m3]."""
_ROOM_PA = 101_325.0 + 9_800.0 - 1_700.0  # Pressure at a depth of 1 m over that of vapour at 15 C. [Pa]


def keller_N(rotor: Rotor) -> float:
    """Largest thrust of the blade area at a depth of 1 m: A_E/A_0 >= (1.3 + 0.3 Z) T / ((p - p_v) D^2) + K [N].

    J. auf'm Keller, "Enige aspecten bij het ontwerpen van scheepsschroeven", Schip en Werf 24 (1966); K = 0, for a
    screw without a hull before it, as in textbooks (not checked).
    """
    s = rotor.blade.midpoints(60)
    D = 2.0 * rotor.R
    ratio = rotor.B * float(np.sum(s.chord * s.dr)) / (0.25 * math.pi * D**2)
    return ratio * _ROOM_PA * D**2 / (1.3 + 0.3 * rotor.B)
