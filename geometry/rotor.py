"""Rotors: equal blades round a hub, their direction of rotation, and the spinner."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from geometry.blade import Blade
from geometry.common import Array, Faults


@dataclass(frozen=True, eq=False)
class Rotor:
    """A rotor of equal blades.

    Raises GeometryError: with all faults at once.

    >>> from geometry.laws import helix
    >>> rotor = Rotor(helix(0.2032, 0.127), 2)
    >>> rotor.D, round(rotor.solidity, 3)
    (0.2032, 0.079)
    """

    blade: Blade  # One blade
    B: int  # Number of blades, 1 to 100
    # +1 is a right-hand propeller: clockwise seen from behind, right-handed about the direction of thrust
    rotation: int = 1
    name: str = ""  # For people
    # Axial length of the hub cylinder, centred on the blades; None takes the axial extent of the root section [m]
    hub_length: float | None = None
    spinner_length: float = 0.0  # Length of the nose ahead of the hub, a half ellipsoid; 0 is a flat hub face [m]

    def __post_init__(self) -> None:
        faults = Faults()
        if self.B not in range(1, 101):
            faults.add("B", f"{self.B}", "a whole number of blades from 1 to 100")
        if self.rotation not in (1, -1):
            faults.add("rotation", f"{self.rotation}", "+1 or -1")
        if self.hub_length is not None:
            faults.number("hub_length", self.hub_length, 0.0, 10 * self.R, "m")
        faults.number("spinner_length", self.spinner_length, 0.0, 10 * self.R, "m")
        faults.check()

    @property
    def R(self) -> float:
        """Tip radius [m]."""
        return self.blade.R

    @property
    def Rhub(self) -> float:
        """Hub radius [m]."""
        return self.blade.Rhub

    @property
    def D(self) -> float:
        """Tip diameter [m]."""
        return 2 * self.blade.R

    @property
    def span(self) -> float:
        """Blade length from hub to tip [m]."""
        return self.blade.R - self.blade.Rhub

    @property
    def disk_area(self) -> float:
        """Area of the whole disk, hub included [m^2]."""
        return math.pi * self.R**2

    @property
    def annulus_area(self) -> float:
        """Area swept by the blades, from hub to tip [m^2]."""
        return math.pi * (self.R**2 - self.Rhub**2)

    @property
    def hub_extent(self) -> float:
        """Axial length of the hub: `hub_length`, or the axial extent of the root chord [m]."""
        if self.hub_length is not None:
            return self.hub_length
        chord, beta = self.blade.at(self.Rhub)
        return float(chord * abs(np.sin(beta)))

    def sigma(self, r: ArrayLike) -> Array:
        """Local solidity B c / (2 pi r). [-]"""
        r = np.asarray(r, dtype=np.float64)
        out: Array = self.B * self.blade.at(r)[0] / (2 * np.pi * r)
        return out

    @property
    def solidity(self) -> float:
        """Geometric solidity: blade area from hub to tip over disk area [-]."""
        st = self.blade.midpoints(400)
        return float(self.B * np.sum(st.chord * st.dr)) / self.disk_area

    def with_pitch_offset(self, dbeta: float) -> Rotor:
        """Return the rotor with all blades turned by `dbeta` [rad]."""
        return replace(self, blade=self.blade.with_pitch_offset(dbeta))

    def scaled(self, factor: float) -> Rotor:
        """Return the rotor with every length multiplied by `factor` [-]."""
        hub = None if self.hub_length is None else self.hub_length * factor
        blade, spinner = self.blade.scaled(factor), self.spinner_length * factor
        return replace(self, blade=blade, hub_length=hub, spinner_length=spinner)

    def key(self) -> str:
        """Return a text that is equal for equal rotors (the name aside)."""
        return f"{self.blade.key()}:{self.B}:{self.rotation:+d}:{self.hub_length}:{self.spinner_length:.12g}"
