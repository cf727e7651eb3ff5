"""Ducts (shrouds) and stators round a rotor: areas, ratios and wall profiles.

Axial coordinate x runs downstream from the leading edge of the lip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from geometry.airfoil import Airfoil
from geometry.common import Array, Faults
from geometry.rotor import Rotor


@dataclass(frozen=True)
class Stator:
    """A row of straight vanes behind the rotor."""

    B: int  # Number of vanes
    chord: float  # Vane chord, the same from hub to wall [m]
    x: float | None = None  # Axial position of the leading edges behind the lip; None is unknown [m]
    beta: float = math.pi / 2  # Vane angle from the plane of rotation to the chord line; pi/2 is axial [rad]
    section: Airfoil | None = None  # Vane section; None is unknown

    def __post_init__(self) -> None:
        faults = Faults()
        if self.B not in range(1, 201):
            faults.add("stator.B", f"{self.B}", "a whole number of vanes from 1 to 200")
        if not (math.isfinite(self.chord) and self.chord > 0):
            faults.add("stator.chord", f"{self.chord:g} m", "a positive number")
        if self.x is not None:
            faults.number("stator.x", self.x, 0.0, math.inf, "m")
        faults.number("stator.beta", self.beta, 0.0, math.pi, "rad", "Given in degrees?" if self.beta > math.pi else "")
        faults.check()


@dataclass(frozen=True)
class Duct:
    """A duct of revolution: elliptic lip, straight bore past the rotor, diffuser or nozzle to the exit.

    Raises GeometryError: with all faults at once.

    >>> duct = Duct(0.0349, 0.060, 0.003, 0.0004, exit_radius=0.033, exit_hub_radius=0.010)
    >>> round(duct.exit_area * 1e4, 2)
    31.07
    """

    inner_radius: float  # Bore radius at the rotor: tip radius plus gap [m]
    length: float  # Axial length from lip to exit [m]
    # Radial half thickness of the lip: the bore widens by this much to the leading edge; 0 is a flat face [m]
    lip_radius: float = 0.0
    gap: float = 0.0  # Tip clearance, radial [m]
    exit_radius: float | None = None  # Inner radius at the exit; None is the bore's [m]
    exit_hub_radius: float = 0.0  # Radius of the body in the exit plane (motor or tail cone); 0 is an open exit [m]
    # Axial position of the blades' pitch axis behind the lip; None is a third of the length [m]
    rotor_x: float | None = None
    stator: Stator | None = None  # Vanes behind the rotor
    lip_aspect: float = 1.0  # Axial over radial half axis of the lip's ellipse, 0.2 to 10 [-]
    diffuser_x: float | None = None  # Where the bore ends; None is a quarter of the way from rotor to exit [m]
    # Least wall thickness and the thickness at the exit; None is 2 % of the bore radius [m]
    te_thickness: float | None = None
    # Radius of the outer wall at its widest, behind a nose round as a quarter circle; None is a lip as thick outside as
    # inside [m]
    outer_radius: float | None = field(default=None, repr=False)
    name: str = ""  # For people

    def __post_init__(self) -> None:
        faults, ri, length = Faults(), self.inner_radius, self.length
        for key, value in (("inner_radius", ri), ("length", length)):
            if not (math.isfinite(value) and 0 < value <= 100):
                hint = "Given in millimetres?" if value > 100 else ""
                faults.add(f"duct.{key}", f"{value:g} m", "a positive number of metres", hint)
        faults.check()  # the limits below hang on these two
        object.__setattr__(self, "exit_radius", ri if self.exit_radius is None else float(self.exit_radius))
        object.__setattr__(self, "rotor_x", length / 3 if self.rotor_x is None else float(self.rotor_x))
        object.__setattr__(self, "te_thickness", 0.02 * ri if self.te_thickness is None else float(self.te_thickness))
        faults.number("duct.lip_radius", self.lip_radius, 0.0, 2 * ri, "m")
        hint = "Bore and tip radius in the same unit?" if self.gap > 0.2 * ri else ""
        faults.number("duct.gap", self.gap, 0.0, 0.2 * ri, "m", hint or "A bore smaller than the rotor cuts the blades")
        faults.number("duct.exit_radius", self._exit, 0.2 * ri, 3 * ri, "m")
        faults.number("duct.exit_hub_radius", self.exit_hub_radius, 0.0, 0.99 * self._exit, "m")
        faults.number("duct.rotor_x", self._rotor, 0.0, length, "m", "Counted from the leading edge of the lip")
        faults.number("duct.lip_aspect", self.lip_aspect, 0.2, 10.0)
        faults.number("duct.te_thickness", self._te, 0.0, ri, "m")
        if self.diffuser_x is not None:
            faults.number("duct.diffuser_x", self.diffuser_x, 0.0, length, "m")
        if self.outer_radius is not None:
            faults.number("duct.outer_radius", self.outer_radius, ri + self.lip_radius, 10 * ri, "m",
                          "Bore and lip lie inside of it")  # fmt: skip
        if self.lip_length > length:
            expected = f"a lip shorter than the duct, {length:g} m"
            faults.add("duct.lip_radius", f"a lip {self.lip_length:g} m long", expected, "Smaller lip_aspect?")
        faults.check()

    @property
    def _exit(self) -> float:
        return self.inner_radius if self.exit_radius is None else self.exit_radius

    @property
    def _rotor(self) -> float:
        return self.length / 3 if self.rotor_x is None else self.rotor_x

    @property
    def _te(self) -> float:
        return 0.02 * self.inner_radius if self.te_thickness is None else self.te_thickness

    @property
    def exit_area(self) -> float:
        """Flow area in the exit plane, the body there taken off [m^2]."""
        return math.pi * (self._exit**2 - self.exit_hub_radius**2)

    @property
    def lip_length(self) -> float:
        """Axial length of the lip [m]."""
        return self.lip_aspect * self.lip_radius

    def key(self) -> str:
        """Text that tells this shape from others; an outer wall that is not stated is no part of it."""
        return f"{self!r}{'' if self.outer_radius is None else f' outer_radius={self.outer_radius!r}'}"

    @property
    def nose(self) -> tuple[float, float]:
        """Length and height of the outer nose, from the leading edge to the widest place [m]."""
        if self.outer_radius is None:
            return self.lip_length, max(self.lip_radius, self._te - self.lip_radius)
        rise = self.outer_radius - self.inner_radius - self.lip_radius
        return min(rise, self.length), rise

    @property
    def bore_end(self) -> float:
        """Axial position where the straight bore ends [m]."""
        default = self._rotor + 0.25 * (self.length - self._rotor)
        return max(default if self.diffuser_x is None else self.diffuser_x, self.lip_length)

    def check(self, rotor: Rotor) -> None:
        """Raise GeometryError unless inner_radius is R + gap within 1e-6 m + 0.1 % of R."""
        faults = Faults()
        miss = self.inner_radius - (rotor.R + self.gap)
        if abs(miss) > 1e-6 + 1e-3 * rotor.R:
            expected = f"tip radius plus gap, {rotor.R:g} + {self.gap:g} = {rotor.R + self.gap:g} m"
            hint = "The blades cut the wall" if self.inner_radius < rotor.R else "Change the gap or the bore"
            faults.add("duct.inner_radius", f"{self.inner_radius:g} m", expected, hint)
        faults.check()

    def inner(self, x: ArrayLike) -> Array:
        """Radius of the inner wall. [m]"""
        x = np.clip(np.asarray(x, dtype=np.float64), 0.0, self.length)
        cone = self._exit - self.inner_radius
        t = np.clip((x - self.bore_end) / max(self.length - self.bore_end, 1e-12), 0.0, 1.0)
        out: Array = self.inner_radius + cone * t + self.lip_radius * (1 - self._ellipse(x, self.lip_length))
        return out

    def outer(self, x: ArrayLike) -> Array:
        """Return the radius of the outer wall [m] at x [m]: quarter ellipse, then straight to the exit."""
        x = np.clip(np.asarray(x, dtype=np.float64), 0.0, self.length)
        a, rise = self.nose
        top = self.inner_radius + self.lip_radius + rise
        t = np.clip((x - a) / max(self.length - a, 1e-12), 0.0, 1.0)
        line = top + (self._exit + self._te - top) * t - rise * (1 - self._ellipse(x, a))
        # Thickness grows from nothing at the nose, so the least thickness holds only behind the lip.
        least = np.where(x >= max(a, self.lip_length), self.inner(x) + self._te, -np.inf)
        out: Array = np.maximum(line, least)
        return out

    def _ellipse(self, x: Array, a: float) -> Array:
        """Ordinate of a unit quarter ellipse of the length a: 0 at the nose, 1 behind it."""
        if a < 1e-9 * self.length:
            return np.ones_like(x)
        out: Array = np.sqrt(np.clip(1 - (1 - np.minimum(x / a, 1.0)) ** 2, 0.0, 1.0))
        return out

    def profile(self, n: int = 61) -> tuple[Array, Array]:
        """Return both walls as points for a solid of revolution. [m]"""
        m = max(n // 2, 5)
        quarter = 1 - np.cos(np.linspace(0, np.pi / 2, m))
        nose = self.lip_length * quarter
        if self.outer_radius is not None:
            nose = np.concatenate([nose, self.nose[0] * quarter])
        body = np.linspace(self.lip_length, self.length, max(n - m, 5))
        x = np.unique(np.concatenate([nose, body, [self.bore_end, self._rotor]]))
        return np.stack([x, self.inner(x)], axis=1), np.stack([x, self.outer(x)], axis=1)


def around(rotor: Rotor, length: float, gap: float, lip_radius: float = 0.0, *, exit_area_ratio: float | None = None,
           exit_hub_radius: float = 0.0, rotor_x: float | None = None, stator: Stator | None = None,
           lip_length: float | None = None, outer_radius: float | None = None, te_thickness: float | None = None,
           name: str = "") -> Duct:  # fmt: skip
    """Fit a duct round a rotor.

    >>> from geometry.laws import helix
    >>> rotor = Rotor(helix(0.069, 0.1, "fan", hub=0.368), 8)
    >>> round(around(rotor, 0.06, 0.0004, exit_area_ratio=0.9).exit_area / rotor.annulus_area, 6)
    0.9
    """
    exit_radius = None
    if exit_area_ratio is not None:
        faults = Faults()
        faults.number("exit_area_ratio", exit_area_ratio, 0.1, 5.0)
        faults.check()
        exit_radius = math.sqrt(exit_area_ratio * rotor.annulus_area / math.pi + exit_hub_radius**2)
    aspect = 1.0 if lip_length is None or lip_radius <= 0.0 else lip_length / lip_radius
    return Duct(
        rotor.R + gap, length, lip_radius, gap, exit_radius, exit_hub_radius, rotor_x, stator, aspect,
        te_thickness=te_thickness, outer_radius=outer_radius, name=name,
    )  # fmt: skip
