"""From a mesh back to blade stations: the axis, the blade count, the hub, and sections cut by cylinders.

The sections are cut by cylinders round the shaft and unrolled, as blade element theory takes them; the chord line joins
the ends of the mean line. Nothing is known of the mesh but its triangles: any place, any orientation, any unit of
length, blades joined to the hub or only touching it, a duct beside them or not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.airfoil import Airfoil
from geometry.common import Array, GeometryError
from geometry.rotor_axis import PROBES, Cut, blades, fit_section, frame, nose_first, pick

Faces = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class FoundRotor:
    """A rotor found in a mesh; lengths in the mesh's own unit, angles in radians."""

    B: int  # Blades
    rotation: int  # +1 turns right-handed about the direction of thrust, -1 left-handed
    # Tip radius, and the radius below which the blades are no longer free [unit of the mesh]
    R: float
    Rhub: float
    origin: Array  # (3,) a point on the shaft [unit of the mesh]
    axis: Array  # (3,) unit vector in the direction of thrust [-]
    # (N,) stations: radius and chord [unit of the mesh], blade angle [rad]
    r: Array
    chord: Array
    beta: Array
    # (N,) over the chord [-]
    thickness: Array
    camber: Array
    camber_position: Array
    sections: tuple[Airfoil, ...]  # The section of every station
    spread: float  # How far the blades differ from each other, relative [-]
    notes: tuple[str, ...] = ()  # What a user has to know: parts left out, doubts


def _hub(points: Array, faces: Faces, tip: float, count: int) -> float:
    """Smallest radius from which on the blades stand free."""

    def free(r: float) -> bool:
        found = blades(points, faces, r)
        return found is not None and len(found) == count

    high = next(x * tip for x in PROBES if free(x * tip))
    low = 0.0
    for step in np.arange(high / tip - 0.02, 0.0, -0.02):
        if not free(step * tip):
            low = step * tip
            break
        high = step * tip
    while high - low > 1e-5 * tip:
        mid = 0.5 * (low + high)
        low, high = (low, mid) if free(mid) else (mid, high)
    return high


def find_rotor(vertices: Array, faces: Faces, stations: int = 28) -> FoundRotor:
    """Find the rotor in a mesh and cut its blades.

    The shaft is the principal direction of inertia about which the cuts of all blades are alike to third moments. The
    leading edge is the thicker end of the section, and the direction of thrust the one towards which it is tilted.
    """
    chosen, count, spread, origin, axis, notes = pick(vertices, faces)
    local = (vertices - origin) @ frame(axis).T
    used = np.unique(chosen)
    tip = float(np.hypot(local[used, 0], local[used, 1]).max())
    hub = _hub(local, chosen, tip, count)
    s = 0.5 * (1 - np.cos(np.linspace(0.0, np.pi, stations)))
    lowest = hub + 0.01 * (tip - hub)
    at = (lowest + (0.992 * tip - lowest) * (0.5 * s + 0.5 * np.linspace(0, 1, stations))) / tip
    sign, rotation, doubt = _sense(local, chosen, tip, hub, count)
    if doubt:
        notes.append(doubt)
    rows: list[Cut] = []
    r = []
    for x in at:
        found = blades(local, chosen, float(x) * tip)
        if found is None or len(found) != count:
            continue
        cuts = [fit_section(loop * [sign * rotation, sign], 121) for loop in found]
        whole = [cut for cut in cuts if cut is not None]
        if whole:
            r.append(float(x) * tip)
            rows.append(_mean_cut(whole))
    if len(rows) < 4:
        raise GeometryError([("mesh", f"{len(rows)} radii with {count} free blades", "four or more", "A broken mesh?")])
    columns = np.array([[c.chord, c.beta, c.thickness, c.camber, c.camber_position] for c in rows]).T
    if spread > 0.05:
        notes.append(f"the blades differ from each other (spread {spread:.2g}): damaged, or no rotor of equal blades")
    return FoundRotor(
        count, rotation, tip, hub, origin, sign * axis / np.linalg.norm(axis), np.array(r), columns[0],
        columns[1], columns[2], columns[3], columns[4], tuple(c.section for c in rows), spread, tuple(notes),
    )  # fmt: skip


def _mean_cut(cuts: list[Cut]) -> Cut:
    """Mean of the blades' numbers, section of the first."""
    table = np.array([[c.chord, c.beta, c.thickness, c.camber, c.camber_position] for c in cuts]).mean(axis=0)
    chord, beta, thickness, camber, position = (float(v) for v in table)
    return Cut(chord, beta, thickness, camber, position, cuts[0].section)


def _sense(points: Array, faces: Faces, tip: float, hub: float, count: int) -> tuple[int, int, str]:
    """Whether thrust points along +z (+1) or -z (-1), the sense of rotation about it, and a doubt in words."""
    votes, lean = [], []
    for share in (0.45, 0.55, 0.65, 0.75, 0.85, 0.92):
        found = blades(points, faces, max(share * tip, 1.02 * hub))
        if found is None or len(found) != count:
            continue
        for loop in found[:2]:
            nose, tail, clear = nose_first(loop)
            ahead = nose - tail
            votes.append(ahead / np.linalg.norm(ahead) * math.copysign(1.0, clear))
            lean.append(abs(clear))
    if not votes:
        raise GeometryError([("mesh", "no cut with all blades", "free blades between hub and tip", "A broken mesh?")])
    ahead = np.sum(votes, axis=0)
    doubt = ""
    if np.median(lean) < 0.02:
        doubt = "both edges of the sections are alike: direction of rotation and thrust are guesses, two mirror choices"
    sign = 1 if ahead[1] >= 0 else -1
    rotation = sign if ahead[0] >= 0 else -sign
    return sign, rotation, doubt
