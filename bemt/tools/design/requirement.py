"""What a blade is asked to do and within which limits; a request that cannot be is refused with all its faults."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, refuse

if TYPE_CHECKING:
    from bemt.physics.air import Air
    from geometry.airfoil import Airfoil


# What a blade is made of, and the stress in it: centrifugal force and bending, station by station.
#
# A straight blade without rake: the pull of all that turns further out, and the moments of its thrust and torque, act
# on the section's area and second moments of area (Euler-Bernoulli beam; Gere, Mechanics of Materials, ch. 5). The
# flapwise and edgewise parts are added at their worst points, which no section has in one place: a bound from above.
# Twist couples nothing here, and nothing relieves bending.


@dataclass(frozen=True)
class Material:
    """What a blade is made of: density [kg/m3], strength in its weakest direction [MPa], and where that is from."""

    name: str
    density: float
    strength_MPa: float
    source: str


MATERIALS = {
    m.name: m
    for m in (
        Material("pla", 1240.0, 35.0, "printed PLA, 35 to 45 MPa upright, 50 to 65 flat (additive.tools)"),
        Material("petg", 1270.0, 25.0, "printed PETG, 25 to 38 MPa upright, 44 to 56 flat (additive.tools)"),
        Material("pc", 1200.0, 35.0, "printed polycarbonate, 35 to 52 MPa upright, 58 to 75 flat (additive.tools)"),
        Material("pa12", 930.0, 43.0, "sintered PA12, 43 MPa (3D Systems, in PMC10406103, table 2); density of EOS "
                                      "PA 2200 (not checked)"),
        Material("pla_soft", 1310.0, 12.2, "printed matt PLA, 12.2 MPa upright, 23.2 flat (PolyTerra PLA sheet V5.3)"),
        Material("pa6_gf", 1270.0, 140.0, "glass-fibre nylon as moulded, 140 MPa at yield (CR-3D data sheet PA 6 G4)"),
        Material("al6061", 2700.0, 276.0, "aluminium 6061-T6, yield (ASM handbook value, not checked)"),
    )
}  # fmt: skip
"""Materials by name. Printed plastics count with the lower end across the layers."""
SAFETY = 3.0
"""Strength over stress that is asked for: declared, for fatigue, notches, creep and prints worse than test bars [1]."""


@dataclass(frozen=True, eq=False)
class SectionStrength:
    """Shape numbers of sections along a blade, (N,): of unit chord, about the centroid, along and across the chord.

    ``area`` over c^2, ``flap`` and ``edge`` second moments over c^4, ``y`` and ``x`` outermost distances over c [1].
    """

    area: Array
    flap: Array
    edge: Array
    y: Array
    x: Array


def strength(anchors: list[tuple[float, Airfoil]], weights: Array) -> SectionStrength:
    """Shape numbers at stations; ``weights`` (N, sections) blends those of the anchors.

    >>> from geometry.airfoil import plate
    >>> one = strength([(0.5, plate(0.0, 0.1))], np.ones((1, 1)))
    >>> bool(0.06 < one.area[0] < 0.1), bool(one.edge[0] > 20.0 * one.flap[0])
    (True, True)
    """
    rows = np.array([_numbers(np.asarray(a.x), np.asarray(a.y)) for _, a in anchors])
    return SectionStrength(*(weights @ rows).T)


def _numbers(x: Array, y: Array) -> tuple[float, float, float, float, float]:
    """Area, second moments about the centroid and outermost distances of a polygon (Green's theorem)."""
    x1, y1 = np.roll(x, -1), np.roll(y, -1)
    cross = x * y1 - x1 * y
    area = 0.5 * cross.sum()
    cx, cy = ((x + x1) * cross).sum() / (6.0 * area), ((y + y1) * cross).sum() / (6.0 * area)
    flap = ((y**2 + y * y1 + y1**2) * cross).sum() / 12.0 - area * cy**2
    edge = ((x**2 + x * x1 + x1**2) * cross).sum() / 12.0 - area * cx**2
    return abs(area), abs(flap), abs(edge), float(np.abs(y - cy).max()), float(np.abs(x - cx).max())


@dataclass(frozen=True, eq=False)
class Stress:
    """Stress at stations of one blade at a point, (N,) [Pa], and its derivatives by all chords and angles, (N, N)."""

    value: Array
    by_chord: Array
    by_beta: Array


def stress(
    shape: SectionStrength, density: float, blades: int, omega: float, r: Array, dr: Array, chord: Array, beta: Array,
    loads: Array, by_chord: Array | None = None, by_beta: Array | None = None,
) -> Stress:  # fmt: skip
    """Stress from the thrust [N] and torque [N m] of all blades' elements, (2, N), with their own derivatives.

    >>> one = SectionStrength(*(np.full(2, v) for v in (0.1, 1e-5, 1e-3, 0.05, 0.5)))
    >>> r, dr = np.array([0.05, 0.10]), np.array([0.05, 0.05])
    >>> found = stress(one, 1000.0, 2, 100.0, r, dr, np.full(2, 0.02), np.zeros(2), np.zeros((2, 2)))
    >>> (found.value / (1000.0 * 100.0**2)).round(6)  # half of the own element, and what is outside of it
    array([0.00625, 0.0025 ])
    """
    outer = np.triu(np.ones((r.size, r.size)), 1) + 0.5 * np.eye(r.size)
    arm = np.maximum(r[None, :] - r[:, None], 0.0) / blades
    twist = arm / r[None, :]  # torque acts as a force at its radius
    s, c = np.sin(beta), np.cos(beta)
    pull = outer * (density * omega**2 * r * dr * shape.area)[None, :]
    up, back = arm @ loads[0], twist @ loads[1]
    flap, edge = up * c + back * s, back * c - up * s
    k_flap, k_edge = shape.y / shape.flap, shape.x / shape.edge
    inertia = (pull @ chord**2) / (shape.area * chord**2)
    bending = (np.abs(flap) * k_flap + np.abs(edge) * k_edge) / chord**3
    value = inertia + bending
    n = np.zeros((r.size, r.size))
    if by_chord is None or by_beta is None:
        return Stress(value, n, n)
    sign_f, sign_e = np.sign(flap) * k_flap / chord**3, np.sign(edge) * k_edge / chord**3

    def moved(d: Array) -> Array:
        d_up, d_back = arm * d[0][None, :], twist * d[1][None, :]
        return np.asarray(
            sign_f[:, None] * (d_up * c[:, None] + d_back * s[:, None])
            + sign_e[:, None] * (d_back * c[:, None] - d_up * s[:, None])
        )

    own_c = np.diag(-2.0 * inertia / chord - 3.0 * bending / chord)
    own_b = np.diag(sign_f * edge - sign_e * flap)
    pulled = pull * (2.0 * chord)[None, :] / (shape.area * chord**2)[:, None]
    return Stress(value, moved(by_chord) + own_c + pulled, moved(by_beta) + own_b)


STALL_MARGIN = 0.15
"""Share of the section's largest lift coefficient that is kept in hand: declared [1]."""
LIGHTEST = 1.0
"""Least disk loading of a request: human-powered helicopters have 3 and more [N/m2]."""
MIN_CHORD_MM = 5.0
"""Least chord: a printed tip narrower than this has no section left; of small rotors `MIN_CHORD` [mm]."""
MIN_CHORD = 0.04
"""Least chord of small rotors over their diameter [1]."""
FAST = 150.0  # No airspeed of a propeller of section theory [m/s]
WIDEST = 0.3
"""Largest chord over the tip radius; that of slow flyers is 0.28 [1]."""


@dataclass(frozen=True)
class DesignPoint:
    """One operating point."""

    thrust_N: float  # Least thrust [N]
    airspeed_m_s: float = 0.0  # Along the shaft [m/s]
    rpm: float | None = None  # Speed; None: whatever gives the thrust with the least power [rev/min]
    weight: float = 1.0  # Share of the time, of which the mean power is taken; 0: a floor only [1]

    @property
    def at(self) -> str:
        """Its airspeed in words."""
        return "static" if self.airspeed_m_s == 0.0 else f"at {self.airspeed_m_s:g} m/s"


@dataclass(frozen=True)
class BladeLimits:
    """What the blade must keep to."""

    # Least chord and least greatest thickness anywhere [m]
    min_chord_m: float = MIN_CHORD_MM * 1e-3
    min_thickness_m: float = 0.0
    max_tip_mach: float = 0.8  # Helical tip Mach number
    # The lift coefficient stays below (1 - margin) times the section's largest at the same Reynolds number
    stall_margin: float = STALL_MARGIN
    material: Material = MATERIALS["pla"]  # Gives density and strength
    safety: float = SAFETY  # Strength over stress, at least


@dataclass(frozen=True)
class Requirement:
    """Points, size and limits of a blade, checked."""

    points: tuple[DesignPoint, ...]  # The static floor, if any, is the last
    # Tip and hub radius [m]
    R: float
    Rhub: float
    blades: int  # Number of blades
    limits: BladeLimits  # What it must keep to
    air: Air  # State of the air

    @property
    def slow(self) -> float:
        """Speed above which the tip is too fast at the fastest airspeed [rev/min]."""
        fast = max(abs(p.airspeed_m_s) for p in self.points)
        tip = math.sqrt(max((self.limits.max_tip_mach * float(self.air.a_sound)) ** 2 - fast**2, 0.0))
        return 60.0 * tip / (2.0 * math.pi * self.R)


def point_of(text: str) -> DesignPoint:
    """Read ``thrust=6,airspeed=15,rpm=7000,weight=1``; rpm and weight may be left out.

    >>> point_of("thrust=6,airspeed=15")
    DesignPoint(thrust_N=6.0, airspeed_m_s=15.0, rpm=None, weight=1.0)
    """
    names = {"thrust": "thrust_N", "airspeed": "airspeed_m_s", "rpm": "rpm", "weight": "weight"}
    found: dict[str, float] = {}
    faults = []
    for part in text.split(","):
        key, _, value = (word.strip() for word in part.partition("="))
        try:
            if key not in names or names[key] in found:
                raise ValueError
            found[names[key]] = float(value)
        except ValueError:
            fault = Fault("--points", "", part or text, "thrust=N,airspeed=M/S,rpm=REV/MIN,weight=SHARE, each once")
            faults.append(fault)
    if "thrust_N" not in found and not faults:
        faults.append(Fault("--points", "", text, "a thrust", "As in thrust=6,airspeed=15,rpm=7000,weight=1"))
    refuse(faults)
    return DesignPoint(**found)


def _outside(name: str, value: float, low: float, high: float, unit: str = "", hint: str = "") -> Fault | None:
    """What is wrong with a number; one that is none fails too."""
    if low <= value <= high:
        return None
    return Fault(name, "", f"{value:g}", f"a number from {low:g} to {high:g} {unit}".rstrip(), hint)


def _of_point(p: DesignPoint) -> list[Fault | None]:
    """What is wrong with the numbers of a point."""
    windmill = "A windmill is no propeller" if p.thrust_N < 0.0 else ""
    found = [
        _outside("--thrust-N", p.thrust_N, 1e-3, 1e4, "N", windmill),
        _outside("--airspeed-m-s", p.airspeed_m_s, 0.0, FAST, "m/s",
                 "In km/h? Divide by 3.6" if p.airspeed_m_s > FAST else ""),
        _outside("--points", p.weight, 0.0, 1e6, "", "weight is a share of time"),
    ]  # fmt: skip
    if p.rpm is not None:
        slow = "In rev/s? Times 60" if 0.0 < p.rpm < 100.0 else ""
        found.append(_outside("--rpm", p.rpm, 100.0, 3e5, "rev/min", slow))
    return found


def _tip(rpm: float | None, V: float, diameter_m: float, a: float, max_tip_mach: float) -> Fault | None:
    """A tip that is too fast: by its speed, or by the airspeed alone where the speed is free."""
    mach = math.hypot(math.pi * diameter_m * (rpm or 0.0) / 60.0, V) / a
    if not mach > max_tip_mach:
        return None
    if rpm is None:
        return Fault("--airspeed-m-s", "", f"{V:g} m/s, Mach {mach:.2f}", f"a Mach number up to {max_tip_mach:g}",
                     "The tip is faster still: raise --max-tip-mach")  # fmt: skip
    top = 60.0 * math.sqrt(max((max_tip_mach * a) ** 2 - V**2, 0.0)) / (math.pi * diameter_m)
    return Fault("--rpm", "", f"{rpm:g} rev/min, tip Mach {mach:.2f}", f"a tip Mach up to {max_tip_mach:g}",
                 f"That is {top:.0f} rev/min at {V:g} m/s")  # fmt: skip


def _on_disk(
    points: Sequence[DesignPoint], static_rpm: float | None, diameter_m: float, air: Air, max_tip_mach: float
) -> list[Fault]:
    """Points that are too light for the disk, or too fast for its tip."""
    light = LIGHTEST * 0.25 * math.pi * diameter_m**2
    expected = f"{light:.2g} N or more on this disk"
    faint = [Fault("--thrust-N", "", f"{p.thrust_N:g} N", expected, "Or a smaller diameter")
             for p in points if p.thrust_N < light]  # fmt: skip
    at = [*((p.rpm, p.airspeed_m_s) for p in points), (static_rpm, 0.0)]
    tips = [_tip(rpm, V, diameter_m, float(air.a_sound), max_tip_mach) for rpm, V in at]
    return [*faint, *(fault for fault in tips if fault)]


def required(
    points: Sequence[DesignPoint], diameter_m: float, hub_ratio: float, blades: int, air: Air, *,
    static_thrust_N: float | None = None, static_rpm: float | None = None, min_chord_mm: float | None = None,
    min_thickness_mm: float = 0.0, max_tip_mach: float = 0.8, stall_margin: float = STALL_MARGIN,
    material: str = "pla", safety: float = SAFETY,
) -> Requirement:  # fmt: skip
    """Check a request; all faults at once."""
    D = 1e3 * diameter_m
    if min_chord_mm is None:
        min_chord_mm = min(MIN_CHORD_MM, MIN_CHORD * D)
    found = [fault for p in points for fault in _of_point(p)]
    if static_thrust_N is not None:
        found.append(_outside("--static-thrust-N", static_thrust_N, 1e-3, 1e4, "N"))
    if static_rpm is not None:
        found.append(_outside("--static-rpm", static_rpm, 100.0, 3e5, "rev/min"))
        if static_thrust_N is None:
            found.append(Fault("--static-rpm", "", f"{static_rpm:g}", "nothing without --static-thrust-N"))
    percent = "In percent? Divide by 100" if stall_margin > 1.0 else ""
    wide, thick = (0.2 * D, 0.05 * D) if D > 0.0 else (1e3, 1e3)
    found += [
        _outside("--min-chord-mm", min_chord_mm, 0.1, wide, "mm", "At most a fifth of the diameter"),
        _outside("--min-thickness-mm", min_thickness_mm, 0.0, thick, "mm", "At most D / 20"),
        _outside("--max-tip-mach", max_tip_mach, 0.05, 0.95, "", "Section theory ends below Mach 1"),
        _outside("--stall-margin", stall_margin, 0.0, 0.8, "", percent),
        _outside("--safety", safety, 1.0, 50.0),
    ]  # fmt: skip
    if not points:
        found.append(Fault("--thrust-N, --points", "", "neither", "one of them", "As in --thrust-N 6 --rpm 7000"))
    elif sum(p.weight for p in points) == 0.0:
        found.append(Fault("--points", "", "weight 0 everywhere", "one weight above 0"))
    if material not in MATERIALS:
        found.append(Fault("--material", "", material, f"one of {', '.join(MATERIALS)}"))
    faults = [fault for fault in found if fault]
    if not faults:
        faults = _on_disk(points, static_rpm, diameter_m, air, max_tip_mach)
    refuse(dict.fromkeys(faults))
    every = tuple(points)
    if static_thrust_N is not None:
        every = (*every, DesignPoint(static_thrust_N, 0.0, static_rpm, 0.0))
    limits = BladeLimits(
        min_chord_mm * 1e-3, min_thickness_mm * 1e-3, max_tip_mach, stall_margin, MATERIALS[material], safety
    )
    return Requirement(every, 0.5 * diameter_m, 0.5 * hub_ratio * diameter_m, blades, limits, air)
