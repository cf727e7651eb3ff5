"""Which K_v, battery and diameter go together: the speed of the tip without load."""

from __future__ import annotations

import math

from bemt.base.units import INCH

TIPS = (126.0, 190.0, 218.0, 310.0)
"""Tip speed of K_v times the loaded voltage, without load: 68 % of 1088 motors; 95 % and 99 % below. Racers of 5 in
have 222 to 265 on 4S (2300 to 2750 rev/min/V), up to 300 on 6S [m/s]."""


def fastest_kv(loaded_V: float, diameter_m: float, tip_m_s: float = TIPS[3]) -> float:
    """K_v that turns the tip at a speed without load, by default the most motors with a propeller have [rev/min/V].

    >>> round(fastest_kv(14.4, 0.127))
    3237
    """
    return 60.0 * tip_m_s / (math.pi * diameter_m * loaded_V)


def fast_words(kv: float, loaded_V: float, battery: str, diameter_m: float) -> str:
    """Say when K_v, battery and diameter seldom go together; "" where they do.

    >>> fast_words(2000.0, 14.4, "4S", 0.127)
    ''
    """
    tips = TIPS[3] * kv / fastest_kv(loaded_V, diameter_m)
    if tips <= TIPS[2]:
        return ""
    speed = f"without load the tip speed would be {tips:.0f} m/s; 95 % of 1088 recorded motors are below {TIPS[2]:.0f}"
    if tips <= TIPS[3]:
        return f"a fast combination, common for racing: the motor gets hot at full throttle\n  ({speed})"
    fit = [diameter_m * v / tips / INCH for v in TIPS[:2]]
    slower = [fastest_kv(loaded_V, diameter_m, v) for v in TIPS[:2]]
    return (
        "an unusual combination: a typical motor would overload and burn out; the numbers assume one that is large "
        f"enough.\n  {speed[0].upper()}{speed[1:]}.\n  {kv:g} rev/min/V on {battery} suits propellers of "
        f"{fit[0]:.1f} to {fit[1]:.1f} in; one of {diameter_m / INCH:.3g} in suits {slower[0]:.0f} to "
        f"{slower[1]:.0f} rev/min/V."
    )
