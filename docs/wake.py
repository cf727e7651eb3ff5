"""Axial speed behind a rotor from runs of OpenFOAM, averaged over azimuth: ``python docs/wake.py R RUN ...``.

A run is a folder of fields in ASCII (``foamFormatConvert`` makes them so), whole or in ``processor*``, to which
``postProcess -latestTime -func writeCellCentres`` and ``writeCellVolumes`` were applied. Prints CSV.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np

EDGES = np.r_[0.15, np.linspace(0.2, 1.2, 11)]
PLANES = (-0.25, -0.5, -1.0, -2.0)
HALF = 0.06  # of a slab of cells around a plane [R]


def field(path: Path) -> np.ndarray:
    """Values of the cells, (n, 1) or (n, 3)."""
    text = path.read_text(encoding="utf-8", errors="replace")
    head = re.search(r"internalField\s+nonuniform List<\w+>\s*(\d+)\s*\(", text)
    if head is None:
        raise SystemExit(f"{path}: got no list of ASCII values; convert with foamFormatConvert")
    body = text[head.end() : text.index("\n)\n", head.end())]
    return np.array(body.replace("(", "").replace(")", "").split(), dtype=float).reshape(int(head[1]), -1)


def profile(run: Path, R: float) -> list[tuple[float, float, float]]:
    """z/R, r/R and speed along -z [m/s], weighted by the volume of the cells."""
    parts = sorted(run.glob("processor*")) or [run]
    times = {max((p for p in part.iterdir() if re.fullmatch(r"[1-9]\d*", p.name)), key=lambda p: int(p.name))
             for part in parts}  # fmt: skip
    centre, speed, volume = (np.concatenate([field(t / name) for t in sorted(times)]) for name in ("C", "U", "V"))
    r, z = np.hypot(centre[:, 0], centre[:, 1]) / R, centre[:, 2] / R
    rows = []
    for plane in PLANES:
        near = np.abs(z - plane) < HALF
        for low, high in zip(EDGES[:-1], EDGES[1:], strict=True):
            cells = near & (r >= low) & (r < high)
            if cells.any():
                w = volume[cells, 0]
                rows.append((plane, 0.5 * (low + high), float(-(w @ speed[cells, 2]) / w.sum())))
    return rows


if __name__ == "__main__":
    radius = float(sys.argv[1])
    print("run,z_over_R,r_over_R,axial_speed_m_s")
    for name in sys.argv[2:]:
        for plane, r, value in profile(Path(name), radius):
            print(f"{Path(name).name},{plane:g},{r:.3f},{value:.2f}")
