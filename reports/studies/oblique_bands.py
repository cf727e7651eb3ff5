"""Bands of oblique points beside those of full solutions, and what a point costs.

``python reports/studies/oblique_bands.py`` takes seven propellers at 5 to 150 deg and J 0.05 to 0.9, and times 4,000
points of one at 10 to 90 deg.
"""

from __future__ import annotations

import time

import numpy as np

from bemt.physics.bem import oblique_near
from bemt.rotors.case import case_of, fresh
from bemt.rotors.case.propagate import propagate

LABELS = ("8x5", "10x4.5MR", "5x4x3", "15x10E", "9x6SF", "4x2.5", "20x6")
ANGLES, RATIOS = (5.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0, 105.0, 120.0, 150.0), np.linspace(0.05, 0.9, 12)
TIMED, POINTS = (10.0, 20.0, 30.0, 45.0, 60.0, 75.0, 80.0, 90.0), 4000


def main() -> int:
    """Print both."""
    off: dict[str, list[np.ndarray]] = {}
    for label in LABELS:
        case = case_of(fresh.label_text(label, measured=False), ends=False)
        angle, J = (v.ravel() for v in np.meshgrid(ANGLES, RATIOS))
        V, near = J * case.rpm / 60.0 * case.diameter_m, oblique_near.Near
        found = propagate(case, None, V, angle_deg=angle).points
        oblique_near.Near = lambda: None
        full = propagate(case, None, V, angle_deg=angle).points
        oblique_near.Near = near
        for q in ("CT", "CP"):
            off.setdefault(f"{q}, u of the unknowns", []).append(found.u_by["input"][q] / full.u_by["input"][q] - 1.0)
            off.setdefault(f"{q}, u", []).append(found.u[q] / full.u[q] - 1.0)
    for name, parts in off.items():
        size = 100.0 * np.abs(np.concatenate(parts))
        size = size[np.isfinite(size)]
        often = np.quantile(size, 0.95)
        print(f"{name:22} {size.size} points off by {np.median(size):.2f} % in the median, 95 % of them by up to "
              f"{often:.2f}, at worst by {size.max():.2f}")  # fmt: skip
    case = case_of(fresh.label_text("8x5", measured=False), ends=False)
    rpm, V = np.linspace(4000.0, 9000.0, POINTS), np.linspace(2.0, 15.0, POINTS)
    turned = np.tile(TIMED, POINTS // len(TIMED))
    for name, angle, bands in ((n, a, b) for b in (True, False) for n, a in (("oblique", turned), ("axial", 0.0))):
        took = []
        for _ in range(4):
            began = time.process_time()
            propagate(case, rpm, V, 1.225, angle_deg=angle, bands=bands)
            took.append(time.process_time() - began)
        print(f"{name}, {'with' if bands else 'without'} bands: {1e6 * min(took) / POINTS:.0f} us a point")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
