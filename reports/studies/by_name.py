"""What a name tells: multirotor labels beside APC's tables, motors of makers' sheets beside Drive Calculator's points.

``python reports/studies/by_name.py drivecalc/motor_prop_points_V_rpm_I.csv``; needs the extra ``motors``.  The current
is that at which the torque of the propeller's label, the sheet's winding and idle current and the usual share of
controller and leads meet the recorded voltage.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
from pathlib import Path

import numpy as np
import pandas as pd

from bemt.base.units import INCH
from bemt.rotors.case import case_of, fresh
from bemt.rotors.case.motor import NamedMotor, _words, motors_on_sale
from bemt.rotors.case.propagate import propagate
from bemt.rotors.case.unknowns import ESC_DROP
from geometry.common import GeometryError
from geometry.designation import parse_designation

SPEEDS = np.linspace(0.25, 1.0, 40)
"""Over K_v and voltage [1]."""


def multirotor() -> str:
    """Errors of labels of APC's multirotor propellers over its tables, at the tip speed nearest to 120 m/s."""
    from pythrust import dataset_dir

    miss = []
    for file in sorted((Path(dataset_dir()) / "propellers").glob("*/APC_*.json")):
        about = json.loads(file.read_text(encoding="utf-8"))
        if parse_designation(f"APC {about['model']}").blade_class != "multirotor":
            continue
        with file.with_suffix(".csv").open(encoding="utf-8") as text:
            rows = np.array([[float(r[k]) for k in ("rpm", "advance_ratio", "thrust_coeff", "power_coeff")]
                             for r in csv.DictReader(text)])  # fmt: skip
        speeds = np.unique(rows[:, 0])
        here = speeds[np.argmin(np.abs(speeds - 120.0 * 60.0 / (math.pi * about["diameter_in"] * INCH)))]
        rpm, J, CT, CP = rows[(rows[:, 0] == here) & (rows[:, 2] > 0.3 * rows[rows[:, 0] == here, 2].max())].T
        case = case_of(fresh.label_text(about["model"], measured=False), ends=False)
        found = propagate(case, rpm, J * rpm / 60.0 * case.diameter_m, 1.225, bands=False).points
        off = np.abs(np.array([found.CT / CT, found.CP / CP]) - 1.0)
        miss.append([*off[:, 0], *np.median(off[:, 1:], axis=1)])
    cells = "; ".join(f"{name} {np.median(v):.1%}, at most {np.max(v):.1%}" for name, v in zip(
        ("CT at rest", "CP at rest", "CT in flight", "CP in flight"), np.transpose(miss), strict=True))  # fmt: skip
    return f"{len(miss)} multirotor labels beside APC's tables: median of {cells}"


def called(name: str, kv: float, sheets: list[tuple[NamedMotor, frozenset[str]]]) -> NamedMotor | None:
    """The one motor of the sheets that a name with its K_v [rev/min/V] calls."""
    words = [w for w in _words(name) if len(w) > 1]
    near = [(len(own), one) for one, own in sheets if abs(one.kv / kv - 1.0) < 0.06 and one.is_called(words)]
    fewest = [one for n, one in near if n == min(n for n, _ in near)]
    return fewest[0] if len(words) > 1 and len(fewest) == 1 else None


def full_A(one: NamedMotor, rpm: np.ndarray, volts: float, torque_Nm: np.ndarray) -> float:
    """Current [A] where the torque over the speed leaves no voltage; more speed leaves less."""
    amps = torque_Nm * math.pi * one.kv / 30.0 + (one.no_load_A or 0.0)
    return float(np.interp(0.0, rpm / one.kv + 1e-3 * (one.resistance_mohm or 0.0) * amps - volts, amps))


def currents(file: Path) -> str:
    """Errors of the current of recorded motors with a propeller, and how many of u hold it."""
    table = pd.read_csv(file)
    table = table[(table.no_load == 0) & (table.D_in >= 4.0) & (table.gear_ratio == 1.0) & (table.I_A > 1.0)]
    table = table[(table.P_in / table.D_in).between(0.3, 0.95)]
    sheets = [(one, frozenset(one.words)) for one in motors_on_sale() if one.resistance_mohm and one.no_load_A]
    rows = []
    for name, points in table.groupby("motor"):
        one = called(str(name), float(points.kV.iloc[0]), sheets)
        for _, point in points.iterrows() if one is not None else ():
            try:
                text = fresh.label_text(f"{point['prop']} {point.D_in:g}x{point.P_in:g}", measured=False)
            except GeometryError:
                continue
            rpm = SPEEDS * one.kv * point.U_V
            found = propagate(case_of(text, ends=False), rpm, 0.0, 1.2).points
            Q, u, sd = found.torque_Nm, found.u["torque_Nm"], (ESC_DROP.high - ESC_DROP.low) / math.sqrt(12.0)
            middle, *ends = (
                full_A(one, rpm, point.U_V * (1.0 - ESC_DROP.value - drop), Q + k * u)
                for k, drop in ((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, sd), (0.0, -sd))
            )
            band = 0.5 * math.hypot(ends[0] - ends[1], ends[2] - ends[3])
            rows.append((name, middle / point.I_A - 1.0, abs(middle - point.I_A) / band))
    found_ = pd.DataFrame(rows, columns=["motor", "off", "z"])
    each = found_.assign(off=found_.off.abs()).groupby("motor").off.median()
    return (f"{len(each)} motors by name, {len(found_)} points: current off by {found_.off.abs().median():.1%} in the "
            f"median ({found_.off.median():+.1%}), over motors {each.median():.1%}; {(found_.z < 1).mean():.0%} within "
            f"one u, {(found_.z < 2).mean():.0%} within two")  # fmt: skip


def main(words: list[str] | None = None) -> int:
    """Print both."""
    parser = argparse.ArgumentParser(description="What the name of a propeller or motor tells.")
    parser.add_argument("points", metavar="FILE", type=Path, help="motors with propellers of Drive Calculator")
    args = parser.parse_args(words)
    print(multirotor(), currents(args.points), sep="\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
