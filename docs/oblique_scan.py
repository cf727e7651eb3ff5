"""Continuity of oblique points: ``python docs/oblique_scan.py [FIRST LAST]`` scans 300 usual propellers over the angle.

A kink is the second difference of thrust (or torque) over 1 deg, over the largest of that propeller at that advance
ratio or at rest. docs/oblique.md states the result; tests/test_oblique.py scans a few of the same propellers.
"""

from __future__ import annotations

import sys

import numpy as np

from bemt.physics.bem import solver
from bemt.physics.sections.neuralfoil import neuralfoil_polar
from geometry.airfoil import naca4
from geometry.laws import helix
from geometry.rotor import Rotor

SEED, J = 20261124, (0.1, 0.25, 0.4, 0.6, 0.8, 1.0)
ANGLE = np.arange(181.0)


def propeller(k: int) -> tuple[solver.Prepared, float]:
    """The k-th propeller, 4 to 18 in and P/D 0.35 to 1, and its speed [rev/min], tip at 60 to 160 m/s."""
    rng = np.random.default_rng([SEED, k])
    D, ratio, B = 0.0254 * rng.uniform(4.0, 18.0), rng.uniform(0.35, 1.0), int(rng.choice([2, 2, 2, 3, 4]))
    section = naca4(float(rng.choice([0.02, 0.03, 0.035, 0.05])), 0.4, float(rng.choice([0.06, 0.09, 0.12])))
    rotor = Rotor(helix(D, ratio * D, max_chord=rng.uniform(0.12, 0.26)), B)
    return solver.prepare(rotor, [(0.75, neuralfoil_polar(section))]), rng.uniform(60.0, 160.0) / D * 60.0 / np.pi


def kinks(k: int, advance: float) -> tuple[dict[str, tuple[float, float]], int]:
    """Largest kink of thrust and torque at points without and with flags, and points that did not converge."""
    prep, rpm = propeller(k)
    V, angle = advance * rpm / 60.0 * prep.D, np.radians(ANGLE)
    side = np.where(ANGLE % 180.0 == 0.0, 0.0, V * np.sin(angle))
    s, rest = solver.solve(prep, rpm, V * np.cos(angle), side=side), solver.solve(prep, rpm)
    loud = np.array([bool(f) for f in s.flags])
    loud = loud[:-2] | loud[1:-1] | loud[2:]
    found = {}
    for name in ("T", "Q"):
        x, still = getattr(s, name), abs(float(getattr(rest, name)[0]))
        kink = np.nan_to_num(np.abs(np.diff(x, 2))) / max(still, float(np.nanmax(np.abs(x))))
        found[name] = (float(np.max(kink, initial=0.0, where=~loud)), float(np.max(kink, initial=0.0, where=loud)))
    return found, int((~s.converged).sum())


def main() -> None:
    """Scan, and print the largest."""
    first, last = (int(v) for v in sys.argv[1:3]) if len(sys.argv) == 3 else (0, 300)
    rows, lost = [], 0
    for k in range(first, last):
        for advance in J:
            found, bad = kinks(k, advance)
            rows.append((*found["T"], *found["Q"]))
            lost += bad
            if bad:
                print(f"propeller {k}, J {advance}: {bad} points did not converge")
    most, above = np.max(rows, axis=0), (np.array(rows) > 0.01).sum(axis=0)
    for name, i in (("thrust", 0), ("torque", 2)):
        print(f"{name}: largest kink without flag {most[i]:.2%} ({above[i]} curves above 1 %), with {most[i + 1]:.1%}")
    print(f"{len(rows)} curves, {len(rows) * ANGLE.size} points, {lost} not converged")


if __name__ == "__main__":
    main()
