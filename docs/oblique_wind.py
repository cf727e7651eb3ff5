"""Picture of the page on oblique wind: ``python docs/oblique_wind.py`` writes docs/img/oblique.png.

The measured points (APC 8x4.5MR, wind at 0 and 30 deg) are read from the folder named by the variable ``BEMT_DATA``.
"""

from __future__ import annotations

import csv
import os
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import resample

import bemt
from bemt.physics.bem import oblique, solver

HERE = Path(__file__).resolve().parent
RPM, SPEED = 8500.0, 5.0


def measured(folder: Path, angle: int) -> np.ndarray:
    """Rows of rpm, airspeed [m/s], thrust [N]."""
    with (folder / f"tilt_{angle:02d}deg.csv").open(encoding="utf-8") as file:
        return np.array([[float(v) for v in row.values()] for row in csv.DictReader(file)])


def main() -> None:
    """Draw disk loading over azimuth, and thrust over angle with band and points."""
    folder = Path(os.environ["BEMT_DATA"]) / "oblique" / "apc_8x45mr"
    p = bemt.propeller(stations=folder / "stations.csv", diameter_m=0.2032, blades=2)
    fig = plt.figure(figsize=(11, 4.6), layout="constrained")
    left, right = fig.add_subplot(1, 2, 1, projection="polar"), fig.add_subplot(1, 2, 2)
    prep = p._model.prep
    found = solver.solve(prep, RPM, SPEED * 0.5, p.case.air(), side=SPEED * np.sqrt(0.75), radial=True)
    assert found.disk is not None
    psi = np.append(oblique.azimuths(96), 2.0 * np.pi)
    load = resample(found.disk[0], 96, axis=1)  # as a Fourier series
    load = np.concatenate([load, load[:, :1]], axis=1)
    drawn = left.contourf(psi, prep.stations.r / prep.rotor.R, load, levels=24, cmap="viridis")
    left.set_title(f"Thrust per area, wind 60 deg from the shaft\n{RPM:g} rev/min, {SPEED:g} m/s")
    left.set_xticks(np.radians([0, 90, 180, 270]), ["downstream", "advancing", "upstream", "retreating"])
    left.set_yticks([])
    left.grid(False)
    left.tick_params(axis="x", pad=22)
    fig.colorbar(drawn, ax=left, label="N/m²", shrink=0.8)
    angle = np.linspace(0.0, 180.0, 37)
    for speed, color in ((5.0, "C0"), (10.0, "C1")):
        curve = p.solve(RPM, speed, angle_deg=angle)
        T, u = curve.thrust_N, curve.u["thrust_N"]
        right.plot(angle, T, color=color, label=f"BEMT, {speed:g} m/s")
        right.fill_between(angle, T - u, T + u, color=color, alpha=0.2, lw=0)
        for at in (0, 30):
            rows = measured(folder, at)
            rows = rows[rows[:, 1] == speed]
            at_rpm = np.interp(RPM, rows[:, 0], rows[:, 2])
            right.plot(
                at,
                at_rpm,
                "o",
                color=color,
                mec="k",
                clip_on=False,
                zorder=3,
                label=f"measured, {speed:g} m/s" if at == 0 else None,
            )
    right.set(xlabel="angle between wind and shaft [deg]", ylabel="thrust [N]", xlim=(0, 180))
    right.set_title(f"APC 8x4.5MR as drawn, {RPM:g} rev/min\nBand: one standard deviation")
    right.legend(fontsize=8)
    fig.savefig(HERE / "img" / "oblique.png", dpi=110)


if __name__ == "__main__":
    main()
