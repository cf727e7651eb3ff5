"""Whether the probability that `choose` states is true: motors of makers that its law of losses has not seen.

    python docs/choose_truth.py FOLDER [COUNT]

FOLDER holds the two tables of Drive Calculator. A target is met when the recorded speed gives the thrust by the
propeller's own law. The voltage was recorded, so cells are those whose loaded voltage is within 5 % of it.
"""

from __future__ import annotations

import sys
import zlib
from pathlib import Path

import numpy as np
import pandas as pd

from bemt import choose
from bemt.base.units import G0
from bemt.tools.design.motors_file import KnownMotor

LOADED_CELL_V = 3.84 * 0.94
"""Voltage of a cell at half charge and full throttle, as `choose` takes it [V]."""
TARGETS = (0.75, 0.95, 1.15, 1.35)
BINS = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)


def seen(motor: str) -> bool:
    """Whether the law of losses was calibrated on the maker, the first word of a motor's name."""
    return zlib.crc32(motor.split()[0].lower().encode()) % 2 == 0


def points(folder: Path, count: int) -> pd.DataFrame:
    """One point of each of some motors of makers that were not seen, each with another propeller."""
    motors = pd.read_csv(folder / "motor_prop_points_V_rpm_I.csv")
    laws = pd.read_csv(folder / "props_static_fits.csv")
    table = motors[(motors.no_load == 0) & (motors.gear_ratio == 1) & (motors.I_A > 0.5) & (motors.Rm > 0)]
    table = table.merge(laws, left_on="prop_id", right_on="myid")
    table = table[~table.motor.map(seen) & (table.a > 0) & table.D_in.between(4, 20)]
    table = table[table.Rm * table.I_A < 0.6 * table.U_V]
    cells = (table.U_V / LOADED_CELL_V).round().clip(lower=1)
    thrust = 1e-3 * G0 * table.a * (table.n_rpm / 1000) ** table.b
    table = table.assign(cells=cells.astype(int), thrust_N=thrust)
    table = table[(table.U_V / (LOADED_CELL_V * table.cells) - 1).abs() < 0.05]
    table = table.sample(frac=1.0, random_state=0).drop_duplicates("motor_id").drop_duplicates("prop_id")
    return table.head(count)


def answers(table: pd.DataFrame, known: bool) -> np.ndarray:
    """Probability stated and whether it was met, (N, 2)."""
    out = []
    for row in table.itertuples():
        label = f"{row.D_in:g}x{row.P_in:g}"
        motor = KnownMotor("M", row.kV, row.Rm if known else np.nan)
        expected = choose(0.2 * row.thrust_N, row.cells, labels=[label], motors=[motor]).full_thrust_N.iloc[0]
        for share in TARGETS:
            target = share * expected
            stated = choose(target, row.cells, labels=[label], motors=[motor], max_tip_mach=0.95).probability.iloc[0]
            out.append((stated, row.thrust_N >= target))
    return np.array(out, dtype=float)


def curve(found: np.ndarray) -> list[tuple[str, int, float, float]]:
    """Bin, targets, mean of the stated probability and share that was met."""
    rows = []
    for low, high in zip(BINS, BINS[1:], strict=False):
        inside = (found[:, 0] >= low) & ((found[:, 0] < high) | (high == 1.0))
        if inside.any():
            stated, met = (float(v) for v in found[inside].mean(axis=0))
            rows.append((f"{low:.0%} to {high:.0%}", int(inside.sum()), stated, met))
    return rows


def main() -> None:
    """Print the reliability curve and the Brier score, with and without the motor's resistance."""
    table = points(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 60)
    for known in (False, True):
        found = answers(table, known)
        score = float(np.mean((found[:, 0] - found[:, 1]) ** 2))
        print(f"{'resistance known' if known else 'K_v alone'}: {len(table)} motors, Brier score {score:.3f}, "
              f"mean stated {found[:, 0].mean():.0%}, met {found[:, 1].mean():.0%}")  # fmt: skip
        for name, number, stated, met in curve(found):
            print(f"  {name:12} {stated:4.0%} / {met:4.0%} ({number})")


if __name__ == "__main__":
    main()
