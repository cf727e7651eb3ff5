"""Picture and table of the page on coaxial pairs: ``python docs/coaxial_spacing.py`` writes docs/img/coaxial.png.

The curves need nothing. The measured points (two rotors of 15 and 11 in, New Dexterity stand) are read from the folder
named by the variable ``BEMT_DATA``, if it is set; then the table is printed too.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import bemt
from bemt.data.readers import read
from bemt.physics.dataset import Dataset

HERE = Path(__file__).resolve().parent
PAIRS = (("15x5", 15, 5000.0), ("11x5", 11, 6000.0))
SPACINGS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
EQUAL = 0.06  # speeds that differ by no more count as equal


def predicted(label: str, rpm: float, spacings: tuple[float, ...] | np.ndarray) -> list[Dataset]:
    """The pair of a label at each spacing, with bands."""
    return [bemt.propeller(label).coaxial(float(z)).solve(rpm=rpm) for z in spacings]


def coefficient(d: Dataset, load: str, rpm: str) -> np.ndarray:
    """A load over the square of the speed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(d[rpm] > 1500.0, d[load] / d[rpm] ** 2, np.nan)


def measured(folder: Path, inches: int) -> Mapping[float, np.ndarray]:
    """Thrust and torque over those of the rotors alone by spacing: upper T, lower T, its scatter, lower Q, mount.

    The last is what the lower load cell reads while the upper rotor turns alone, over the thrust of that rotor: the
    drag of the parts that carry the lower rotor, in its wake.
    """
    single = [read(p) for p in sorted(folder.glob(f"{inches}in*single*"))]
    bottom = [read(p) for p in sorted(folder.glob(f"{inches}in*bottom*"))]
    alone = [np.nanmedian(np.concatenate([coefficient(d, load, "rpm") for d in runs]))
             for runs, load in ((single, "thrust_N"), (bottom, "thrust_N"), (bottom, "torque_Nm"))]  # fmt: skip
    mount = np.median(np.concatenate([_other_side(p) for p in sorted(folder.glob(f"{inches}in*single*"))]))
    out = {}
    for path in folder.glob(f"{inches}in*_zD_*"):
        d, code = read(path), re.search(r"zD_(\d+)__", path.name)
        assert code is not None
        near = np.abs(d["speed_ratio"] - 1.0) < EQUAL
        upper = coefficient(d, "thrust_left_N", "left_rpm")[near] / alone[0]
        lower = coefficient(d, "thrust_right_N", "right_rpm")[near] / alone[1]
        torque = coefficient(d, "torque_right_Nm", "right_rpm")[near] / alone[2]
        spacing = 1.0 if code[1] == "1" else int(code[1]) / 10.0
        out[spacing] = np.array([np.nanmean(upper), np.nanmean(lower), np.nanstd(lower), np.nanmean(torque), mount])
    return dict(sorted(out.items()))


def _other_side(path: Path) -> np.ndarray:
    """Reading of the lower load cell over that of the upper one, while the upper rotor turns alone."""
    rows = np.genfromtxt(path, delimiter=",", names=True, deletechars="", encoding="utf-8-sig")
    rows = rows[rows["Speed_Left_[rpm]"] > 1500.0]
    return np.asarray(rows["Thrust_Right_[g]"] / rows["Thrust_Left_[g]"])


def main() -> None:
    """Draw thrust of the lower rotor over that alone, over the spacing; print the table."""
    data = os.environ.get("BEMT_DATA")
    z = np.linspace(0.02, 1.1, 28)
    fig, axes = plt.subplots(1, 2, figsize=(11, 4.8), sharey=True, layout="constrained")
    for axis, (label, inches, rpm) in zip(axes, PAIRS, strict=True):
        found = predicted(label, rpm, z)
        ratio, u = (np.array([d["lower_thrust_ratio"][0] if k == 0 else d.u["lower_thrust_ratio"][0] for d in found])
                    for k in (0, 1))  # fmt: skip
        upper = np.array([d["upper_thrust_ratio"][0] for d in found])
        axis.fill_between(z, ratio - 2 * u, ratio + 2 * u, color="C0", alpha=0.15, lw=0, label="95 %")
        axis.fill_between(z, ratio - u, ratio + u, color="C0", alpha=0.3, lw=0, label="68 %")
        axis.plot(z, ratio, "C0", label="second rotor, BEMT")
        axis.plot(z, upper, "C1", label="first rotor, BEMT")
        if data is not None:
            points = measured(Path(data) / "contrasts" / "coax_spacing_15in_11in", inches)
            at, values = np.array(list(points)), np.array(list(points.values()))
            axis.plot(at, values[:, 0], "s", color="C1", mec="k", ms=5, label="first rotor, measured")
            axis.errorbar(at, values[:, 1], values[:, 2], fmt="o", color="C0", mec="k", ms=5, capsize=2,
                          label="second rotor, measured")  # fmt: skip
            for d, s in zip(predicted(label, rpm, SPACINGS), SPACINGS, strict=True):
                row = points[s]
                thrust, both = d["lower_thrust_ratio"][0], d["thrust_ratio"][0]
                torque = d["lower_torque_Nm"][0] / d["upper_torque_Nm"][0]
                print(f"{inches} in, z/D {s:g}: lower {thrust:.3f} (u {d.u['lower_thrust_ratio'][0]:.3f}), measured "
                      f"{row[1]:.3f}; both {both:.3f}, measured {0.5 * (row[0] + row[1]):.3f}; lower torque over upper "
                      f"{torque:.3f}, measured over alone {row[3]:.3f}; mount {row[4]:+.3f}")  # fmt: skip
        axis.set(
            xlabel="distance over diameter z/D", xlim=(0, 1.1), ylim=(0.3, 1.1), title=f"{label}, equal speeds, at rest"
        )
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("thrust over that of the rotor alone")
    handles, words = axes[0].get_legend_handles_labels()
    fig.legend(handles, words, fontsize=8, ncols=4, loc="outside lower center")
    fig.savefig(HERE / "img" / "coaxial.png", dpi=110)


if __name__ == "__main__":
    main()
