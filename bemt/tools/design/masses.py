"""What a rotor's motor, propeller, controller and arm weigh: declared laws with their spread.

* Motor from its greatest torque: 1341 direct-drive motors recorded by Drive Calculator with weight and three points or
  more; torque (I - I_0)/K_v with the typical share of idle current. Scaling laws have an exponent of 3/3.5
  (M. Budinger, A. Reysset, A. Ochotorena, S. Delbecq, Aerospace Sci. Technol. 98 (2020) 105658,
  doi:10.1016/j.ast.2019.105658).
* Propeller from its diameter: 17 APC propellers of 8 to 14 in, weights in APC's PE0 files; beyond them extrapolated.
  Slow flyers weigh a half, glow-engine blades twice as much. More blades: 11x7 with three over that with two.
* Controller from its input: 115 g at 3108 W (the reference of Budinger et al.; spread declared).
* Arm: a carbon tube that bends under full thrust at a quarter of 280 MPa, and 347/140 of it as frame (the references of
  S. Delbecq, M. Budinger et al., Aerospace Sci. Technol. 102 (2020) 105873, doi:10.1016/j.ast.2020.105873; numbers as
  in the authors' public notebooks, the papers were not checked). Tubes from 10 mm with a wall of 1 mm: declared.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array

MOTOR = (0.335, 0.79)
"""Mass at 1 N m [kg], and exponent of the torque [1]."""
PROPELLER = (0.336, 2.0)
"""Two blades: mass at 1 m [kg], and exponent of the diameter [1]."""
BLADES = 0.65  # Exponent of the number of blades [1]
ESC = 0.115 / 3108.0  # [kg/W]
ARM_PA, ARM_DENSITY, ARM_HOLLOW, FRAME = 70e6, 1700.0, 0.8, 0.347 / 0.14
ARM_LEAST_M = 0.01
SPREAD = {"motor": 0.25, "propeller": 0.33, "esc": 0.3, "arm": 0.5}
"""Standard deviations of the logarithms [1]."""
CLEARANCE = 1.05
"""Distance of neighbouring shafts over the diameter, at least: declared [1]."""
SHARE = 0.4
"""Share of a vehicle's mass that motors, propellers, controllers and frame have: declared, 35 to 45 % of multirotors
by the laws above [1]."""


@dataclass(frozen=True)
class Masses:
    """Mass of one rotor's parts, (M,) each [kg]."""

    motor: Array
    propeller: Array
    esc: Array
    arm: Array

    @property
    def total(self) -> Array:
        """All parts. [kg]"""
        return self.motor + self.propeller + self.esc + self.arm

    @property
    def u(self) -> Array:
        """Standard uncertainty of the sum. [kg]"""
        return np.asarray(np.sqrt(sum((s * getattr(self, part)) ** 2 for part, s in SPREAD.items())))


def masses(
    torque_Nm: ArrayLike, power_W: ArrayLike, thrust_N: ArrayLike, diameter_m: float, blades: int, arm_m: float
) -> Masses:
    """Parts of one rotor from what it has at full throttle: torque, electrical power and thrust, (M,) each.

    >>> one = masses(0.3, 300.0, 12.0, 0.3, 2, 0.22)
    >>> [round(float(1e3 * v)) for v in (one.motor, one.propeller, one.esc, one.arm)]
    [129, 30, 11, 26]
    """
    Q, P, T = (np.maximum(np.nan_to_num(np.asarray(v, dtype=float)), 0.0) for v in (torque_Nm, power_W, thrust_N))
    propeller = PROPELLER[0] * diameter_m ** PROPELLER[1] * (blades / 2.0) ** BLADES
    strong = (32.0 * T * arm_m / (math.pi * ARM_PA * (1.0 - ARM_HOLLOW**4))) ** (1.0 / 3.0)
    tube = 0.25 * math.pi * np.maximum(strong, ARM_LEAST_M) ** 2 * (1.0 - ARM_HOLLOW**2) * ARM_DENSITY * arm_m
    return Masses(MOTOR[0] * Q ** MOTOR[1], np.full(Q.shape, propeller), ESC * P, FRAME * tube)


def arm_for(diameter_m: float, arms: int) -> float:
    """Least distance of the shafts from the middle; no arm for one rotor. [m]"""
    return 0.0 if arms < 2 else 0.5 * CLEARANCE * diameter_m / math.sin(math.pi / arms)


def diameter_on(arm_m: float, arms: int) -> float:
    """Largest diameter that `arm_m` leaves room for: between neighbours, or between the shaft and what is next to it.

    >>> round(diameter_on(0.110, 4) / 0.0254, 2)
    5.83
    """
    return (2.0 * arm_m * math.sin(math.pi / arms) if arms > 1 else 2.0 * arm_m) / CLEARANCE
