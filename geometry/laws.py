"""Chord and pitch laws by name, and the blades they make: :func:`from_laws`, :func:`helix`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from geometry.airfoil import Airfoil
from geometry.common import Array, Faults, GeometryError
from geometry.rotor import Blade, from_stations


@dataclass(frozen=True)
class Law:
    """A chord or pitch law: its parameters with their defaults (NaN: none), its function of r/R."""

    parameters: Mapping[str, float]
    function: Callable[..., Array]


def _apc_like(x: Array, hub: float) -> Array:
    coefficients = (0.455, 0.269, 12.435, -36.84, 36.533, -12.646)  # greatest value 1.00396
    return np.asarray(np.polynomial.polynomial.polyval(x, coefficients) / 1.00396, dtype=np.float64)


def _elliptic(x: Array, hub: float) -> Array:
    out: Array = np.maximum(np.sqrt(np.maximum(1 - x**2, 0.0)), 0.05)
    return out


def _fan(x: Array, hub: float) -> Array:
    out: Array = 1 - 0.1 * (2 * (x - hub) / (1 - hub) - 1) ** 2
    return out


CHORD_LAWS: Mapping[str, Law] = {
    # generic modern two-blade small propeller: c/R 0.13 at r/R 0.15, greatest near 0.43, 0.13 at 0.75, 0.04 at the tip
    # (fifth-degree polynomial); declared assumption of this project
    "apc_like": Law({"max_chord": 0.195}, _apc_like),
    # c = c0 sqrt(1 - (r/R)^2), c0 on the axis; not below 5 % of c0
    "elliptic": Law({"max_chord": 0.20}, _elliptic),
    "constant": Law({"max_chord": 0.15}, lambda x, hub: np.ones_like(x)),
    # straight from the hub to taper times the hub chord at the tip
    "linear_taper": Law(
        {"max_chord": 0.20, "taper": 0.5}, lambda x, hub, taper: 1 - (1 - taper) * (x - hub) / (1 - hub)
    ),
    # ducted fan: nearly constant, 10 % less at hub and tip than at mid span; declared assumption of this project
    "fan": Law({"max_chord": 0.45}, _fan),
}
"""Chord laws by name; each function gives chord over greatest chord at r/R for a hub ratio."""


def _tip_relieved(x: Array, R: float, hub: float, pitch: float, relief: float, start: float) -> Array:
    local = pitch * (1 - relief * np.clip((x - start) / (1 - start), 0.0, 1.0) ** 2)
    out: Array = np.arctan(local / (2 * np.pi * x * R))
    return out


PITCH_LAWS: Mapping[str, Law] = {
    # true screw: beta = atan(pitch / (2 pi r))
    "helix": Law({"pitch": math.nan}, lambda x, R, hub, pitch: np.arctan(pitch / (2 * np.pi * x * R))),
    # constant pitch to r/R = start, then it falls quadratically by `relief` at the tip; assumption of this project
    "tip_relieved": Law({"pitch": math.nan, "relief": 0.15, "start": 0.7}, _tip_relieved),
}
"""Pitch laws by name; each function gives beta [rad] at r/R for R [m] and a hub ratio."""


def _arguments(kind: str, laws: Mapping[str, Law], name: str, given: Mapping[str, float | None]) -> dict[str, float]:
    """Defaults and given parameters of a law, or its faults."""
    if name not in laws:
        raise GeometryError([(kind, repr(name), f"one of {', '.join(laws)}", "")])
    faults = Faults()
    out = {**laws[name].parameters, **{key: float(v) for key, v in given.items() if v is not None}}
    for key, value in out.items():
        if not math.isfinite(value):
            faults.add(f"{kind}.{key}", "nothing" if given.get(key) is None else f"{value}", "a number")
        elif key == "max_chord" and not 0 < value <= 5:
            hint = "Chord in millimetres? Divide by R" if value > 5 else ""
            faults.add(f"{kind}.{key}", f"{value:g}", "greatest chord over R, above 0, up to 5", hint)
    faults.check()
    return out


def chord_over_R(law: str, x: ArrayLike, hub: float = 0.15, **parameters: float | None) -> Array:
    """Evaluate a chord law. [-]

    >>> chord_over_R("apc_like", [0.15, 0.4, 0.75, 1.0]).round(2).tolist()
    [0.13, 0.19, 0.13, 0.04]
    """
    arguments = _arguments("chord_law", CHORD_LAWS, law, parameters)
    scale = arguments.pop("max_chord")
    out: Array = scale * CHORD_LAWS[law].function(np.asarray(x, dtype=np.float64), hub, **arguments)
    return out


def from_laws(
    diameter: float,
    chord_law: str = "apc_like",
    pitch_law: str = "helix",
    hub: float = 0.15,
    *,
    chord: Mapping[str, float | None] | None = None,
    pitch: Mapping[str, float | None] | None = None,
    anchors: Airfoil | Sequence[tuple[float, Airfoil]] | None = None,
    n: int = 61,
    name: str = "",
) -> Blade:
    """Make a blade from a chord law and a pitch law.

    >>> blade = from_laws(0.254, "constant", chord={"max_chord": 1 / 6}, pitch={"pitch": 0.127})
    >>> round(float(blade.chord[0]), 4), round(float(blade.beta[-1]), 4)
    (0.0212, 0.1578)
    """
    faults = Faults()
    faults.number("diameter", diameter, 1e-3, 200.0, "m", "Given in millimetres or inches?" if diameter > 200 else "")
    faults.number("hub", hub, 0.01, 0.95, hint="The hub is given as Rhub/R")
    faults.number("n", n, 5, math.inf)
    parts = []
    asked = (("chord_law", CHORD_LAWS, chord_law, chord), ("pitch_law", PITCH_LAWS, pitch_law, pitch))
    for kind, laws, law, given in asked:
        try:
            parts.append(_arguments(kind, laws, law, given or {}))
        except GeometryError as error:
            faults.found.extend(error.faults)
    faults.check()
    R = 0.5 * diameter
    x = hub + (1 - hub) * 0.5 * (1 - np.cos(np.linspace(0, np.pi, n)))
    x[-1] = 1.0
    beta = PITCH_LAWS[pitch_law].function(x, R, hub, **parts[1])
    return from_stations(x * R, R * chord_over_R(chord_law, x, hub, **parts[0]), beta, R, hub * R, anchors, name=name)


def helix(
    diameter: float,
    pitch: float,
    chord_law: str = "apc_like",
    hub: float = 0.15,
    *,
    max_chord: float | None = None,
    anchors: Airfoil | Sequence[tuple[float, Airfoil]] | None = None,
    n: int = 61,
    name: str = "",
) -> Blade:
    """Make a constant-pitch blade: beta = atan(pitch / (2 pi r)).

    >>> blade = helix(8 * 0.0254, 5 * 0.0254)
    >>> round(math.degrees(blade.at(0.75 * blade.R)[1]), 2)
    14.86
    """
    faults = Faults()
    # Pitch is checked against the diameter to catch mixed units.
    limit = 5 * abs(diameter) if math.isfinite(diameter) else math.inf
    faults.number("pitch", pitch, -limit, limit, "m", "Both diameter and pitch are in metres")
    faults.check()
    return from_laws(diameter, chord_law, "helix", hub, chord={"max_chord": max_chord}, pitch={"pitch": pitch},
                     anchors=anchors, n=n, name=name)  # fmt: skip
