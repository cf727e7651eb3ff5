"""Rotors: equal blades round a hub, their direction of rotation, and the spinner."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from geometry.airfoil import Airfoil, blend
from geometry.common import Array, Faults, GeometryError, frozen, pchip, pchip_slopes

# Blades: stations of chord and blade angle, with sections between anchors.
#
# Frame of a blade: radius r outward along the blade, blade angle beta from the plane of rotation to the chord line
# (positive pitch gives thrust at rest), sweep in the plane of rotation, rake along the shaft.


class Stations(NamedTuple):
    """Blade elements as a solver consumes them: centre radius, width, chord [m] and blade angle [rad], each (n,)."""

    r: Array
    dr: Array
    chord: Array
    beta: Array


@dataclass(frozen=True, eq=False)
class Blade:
    """One blade; arrays are read-only, lengths in metres, angles in radians.

    Raises GeometryError: with all faults at once.

    >>> from geometry.laws import helix
    >>> blade = helix(0.2032, 0.127)
    >>> round(blade.pitch_m(), 4)
    0.127
    """

    r: Array  # (N,) station radii, strictly ascending, N >= 2, between 0 and R [m]
    chord: Array  # (N,) chord, positive [m]
    beta: Array  # (N,) blade angle of the chord line [rad]
    # Tip and hub radius, 0 <= Rhub < R. The stations need not reach either: values are held outside them [m]
    R: float
    Rhub: float
    # Sections at ascending r/R; between them the section is blended linearly in r/R, outside them held. Empty when the
    # sections are not known.
    anchors: tuple[tuple[float, Airfoil], ...] = ()
    # (N,) offset of the pitch axis in the plane of rotation, positive towards the trailing edge [m]
    sweep: Array | None = None
    rake: Array | None = None  # (N,) offset of the pitch axis along the shaft, positive downstream [m]
    axis: float = 0.25  # Chord fraction that lies on the pitch axis and that beta turns about [-]
    name: str = ""  # For people
    _columns: Array = field(init=False, repr=False)
    _slopes: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        faults = Faults()
        for key in ("r", "chord", "beta", "sweep", "rake"):
            value = getattr(self, key)
            if value is None and key in ("sweep", "rake"):
                continue
            try:
                object.__setattr__(self, key, frozen(value))
            except (TypeError, ValueError):
                faults.add(key, f"{value!r:.60}", "numbers")
        faults.check()
        object.__setattr__(self, "anchors", tuple((float(x), section) for x, section in self.anchors))
        _check_radii(self, faults)
        _check_arrays(self, faults)
        faults.number("axis", self.axis, 0.0, 1.0)
        positions = [x for x, _ in self.anchors]
        if any(not 0 <= x <= 1 for x in positions) or any(np.diff(positions) <= 0):
            faults.add("anchors", f"r/R = {positions}", "ascending r/R from 0 to 1", "Anchors sit at r/R, not at r")
        faults.check()
        zero = np.zeros_like(self.r)
        columns = [self.chord, self.beta, *(zero if a is None else a for a in (self.sweep, self.rake))]
        object.__setattr__(self, "_columns", frozen(np.stack(columns, axis=1)))
        object.__setattr__(self, "_slopes", pchip_slopes(self.r, self._columns))

    def _at(self, r: ArrayLike) -> Array:
        """Chord, beta, sweep, rake (..., 4) at radii, held outside the stations."""
        return pchip(self.r, self._columns, r, self._slopes)

    def at(self, r: ArrayLike) -> tuple[Array, Array]:
        """Interpolate chord and blade angle; outside the stations the end values are held."""
        columns = self._at(r)
        return columns[..., 0], columns[..., 1]

    def midpoints(self, n: int, spacing: str = "uniform") -> Stations:
        """Cut the blade into n elements between Rhub and R: what the solver consumes. [m, rad]

        ``dr.sum() == R - Rhub`` exactly and in any order of summation: the widths are whole multiples of the rounding
        unit of R - Rhub.

        >>> from geometry.laws import helix
        >>> st = helix(0.2032, 0.127).midpoints(40, "cosine")
        >>> bool(st.dr.sum() == 0.1016 - 0.15 * 0.1016)
        True
        """
        faults = Faults()
        faults.number("n", n, 1, math.inf)
        if spacing not in ("uniform", "cosine"):
            faults.add("spacing", repr(spacing), "'uniform' or 'cosine'")
        faults.check()
        s = np.linspace(0.0, 1.0, n + 1)
        if spacing == "cosine":
            s = 0.5 * (1.0 - np.cos(np.pi * s))
        s[-1] = 1.0
        span = self.R - self.Rhub
        unit = np.spacing(span)
        steps = np.rint(span * s / unit) * unit
        r = self.Rhub + 0.5 * (steps[1:] + steps[:-1])
        return Stations(r, np.diff(steps), *self.at(r))

    def with_pitch_offset(self, dbeta: float) -> Blade:
        """Return the blade turned as a whole by `dbeta` [rad]."""
        return replace(self, beta=self.beta + dbeta)

    def pitch_m(self, r_over_R: float = 0.75) -> float:
        """Return the geometric pitch 2 pi r tan(beta), the advance per turn, at one r/R (0.75 unless told) [m]."""
        r = r_over_R * self.R
        return float(2 * math.pi * r * np.tan(self.at(r)[1]))

    def section(self, r: float) -> Airfoil:
        """Return the section at a radius."""
        if not self.anchors:
            raise GeometryError([("anchors", "none", "one section or more", "Give the blade anchors=[(r/R, Airfoil)]")])
        x = r / self.R
        below = [a for a in self.anchors if a[0] <= x] or [self.anchors[0]]
        above = [a for a in self.anchors if a[0] >= x] or [self.anchors[-1]]
        (x0, first), (x1, second) = below[-1], above[0]
        w = 0.0 if x1 <= x0 else (x - x0) / (x1 - x0)
        w = round(w) if min(w, 1 - w) < 1e-9 else w  # r/R is rounded: an anchor is met as it is
        return blend(first, second, w)

    def section_curve(self, r: float, n: int | None = None) -> Array:
        """Return the true section outline at a radius: chord, blade angle, sweep and rake applied. [m]

        The planar outline; a solid modeller places it on the plane, or wraps it on the cylinder, of radius r.
        """
        section = self.section(r)
        if n is not None:
            section = section.repanel(n)
        chord, beta, sweep, rake = self._at(float(r))
        along, across = (self.axis - section.x) * chord, section.y * chord
        # Along points from trailing to leading edge: forward and, with beta > 0, upstream.
        tangential = along * math.cos(beta) - across * math.sin(beta) - sweep
        axial = along * math.sin(beta) + across * math.cos(beta) - rake
        out: Array = np.stack([tangential, axial], axis=1)
        return out

    def key(self) -> str:
        """Return the SHA-256 (hex) of all numbers to 12 digits and the section keys: equal blades, equal keys."""
        numbers = np.concatenate([self.r, self._columns.ravel(), [self.R, self.Rhub, self.axis]])
        text = ",".join(f"{v + 0.0:.12g}" for v in numbers) + "pchip"
        text += "".join(f"{x:.12g}{section.key()}" for x, section in self.anchors)
        return hashlib.sha256(text.encode()).hexdigest()


def _check_radii(blade: Blade, faults: Faults) -> None:
    R, Rhub = blade.R, blade.Rhub
    if not (math.isfinite(R) and R > 0):
        faults.add("R", f"{R:g} m", "a positive tip radius in metres")
        return
    if R > 100:
        faults.add("R", f"{R:g} m", "a tip radius in metres, up to 100 m", "Given in millimetres or inches?")
    if not 0 <= Rhub < R:
        faults.add("Rhub", f"{Rhub:g} m", f"a hub radius from 0 to below R = {R:g} m")


def _check_arrays(blade: Blade, faults: Faults) -> None:
    r, R = blade.r, blade.R
    if r.ndim != 1 or r.size < 2:
        faults.add("r", f"an array of shape {r.shape}", "two stations or more")
        return
    for key in ("r", "chord", "beta", "sweep", "rake"):
        values = getattr(blade, key)
        if values is None:
            continue
        if values.shape != r.shape:
            faults.add(key, f"shape {values.shape}", f"one value per station, {r.shape}")
            continue
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            faults.add(f"{key}[{bad[0]}]", f"{values[bad[0]]}", "a finite number")
            continue
        if key == "r":
            _check_stations(r, R, faults)
        elif key == "chord":
            bad = np.flatnonzero(values <= 0)
            if bad.size:
                faults.add(f"chord[{bad[0]}]", f"{values[bad[0]]:g} m", "a positive number")
            elif values.max() > 5 * R > 0:
                k, limit = int(values.argmax()), f"up to five tip radii ({5 * R:g} m)"
                faults.add(f"chord[{k}]", f"{values[k]:g} m", limit, "Given in millimetres or inches?")
        elif key == "beta":
            k = int(np.argmax(np.abs(values)))
            if abs(values[k]) > math.pi / 2 + 1e-9:
                faults.add(
                    f"beta[{k}]", f"{values[k]:g} rad", "radians from -pi/2 to pi/2",
                    "Given in degrees? Multiply by pi/180",
                )  # fmt: skip


def _check_stations(r: Array, R: float, faults: Faults) -> None:
    bad = np.flatnonzero(np.diff(r) <= 0)
    if bad.size:
        k = int(bad[0]) + 1
        hint = "Listed from the tip inwards? Reverse all columns" if (np.diff(r) < 0).all() else ""
        faults.add(f"r[{k}]", f"{r[k]:g} m after {r[k - 1]:g} m", "strictly ascending radii", hint)
    if r.min() < 0:
        faults.add("r", f"{r.min():g} m", "radii of 0 or more")
    if math.isfinite(R) and R > 0 and r.max() > R * (1 + 1e-9):
        hint = f"Given as r/R? Multiply by R = {R:g} m" if abs(r.max() - 1) < 0.05 and R < 0.9 else ""
        faults.add("r", f"{r.max():g} m", f"radii up to R = {R:g} m", hint)


def from_stations(
    r: ArrayLike,
    chord: ArrayLike,
    beta: ArrayLike,
    R: float,
    Rhub: float,
    anchors: Airfoil | Sequence[tuple[float, Airfoil]] | None = None,
    *,
    sweep: ArrayLike | None = None,
    rake: ArrayLike | None = None,
    axis: float = 0.25,
    name: str = "",
) -> Blade:
    """Make a blade from tabulated stations.

    >>> from_stations([0.02, 0.1], [0.01, -0.01], [20.0, 10.0], 0.1, 0.01)
    Traceback (most recent call last):
        ...
    geometry.common.GeometryError: chord[1]: got -0.01 m; expected a positive number.
    beta[0]: got 20 rad; expected radians from -pi/2 to pi/2. Given in degrees? Multiply by pi/180.
    """
    pairs = ((0.0, anchors),) if isinstance(anchors, Airfoil) else tuple(anchors or ())
    return Blade(r, chord, beta, R, Rhub, pairs, sweep, rake, axis, name)  # type: ignore[arg-type]


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

    @property
    def solidity(self) -> float:
        """Geometric solidity: blade area from hub to tip over disk area [-]."""
        st = self.blade.midpoints(400)
        return float(self.B * np.sum(st.chord * st.dr)) / (math.pi * self.R**2)

    def with_pitch_offset(self, dbeta: float) -> Rotor:
        """Return the rotor with all blades turned by `dbeta` [rad]."""
        return replace(self, blade=self.blade.with_pitch_offset(dbeta))

    def key(self) -> str:
        """Return a text that is equal for equal rotors (the name aside)."""
        return f"{self.blade.key()}:{self.B}:{self.rotation:+d}:{self.hub_length}:{self.spinner_length:.12g}"
