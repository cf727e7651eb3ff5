"""Bands of labels against UIUC's readings: the rotor's own band and that of a reading, by class of blades.

``python reports/studies/label_bands.py uiuc uiuc_2`` prints errors and how many readings the bands hold.  Labels carry
size and class, not the maker; nobody of them counts as measured. ``--stands DATA`` does so for thrust and torque of the
stands in the folders jmajew and rcbenchmark of DATA, propeller by propeller: points above half of the highest speed.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from label_classes import readings

from bemt.base.units import G0
from bemt.data.readers.uiuc_names import class_of
from bemt.rotors.case import case_of, fresh
from bemt.rotors.case.propagate import propagate
from bemt.rotors.validate.propellers import where

SUFFIX = {None: "", "electric": "E", "slow_flyer": "SF", "folding": " folding", "sport": " sport"}


STANDS = {
    "jmajew/*_aeronaut-12x6_3s_*": "12x6", "jmajew/*_graupner-12x6_3s_*": "12x6", "jmajew/*_graupner-10x6_4s_*": "10x6",
    "jmajew/*_aeronaut-9x7_4s_*": "9x7", "jmajew/*_gemfanbull6045_3s_*": "6x4.5", "jmajew/*_hqprop6x3-5_3s_*": "6x3.5",
    "jmajew/*_hqprop6x4x3_3s_*": "6x4x3", "rcbenchmark/a1_*": "5x4x3", "rcbenchmark/a2_*": "5x4.5x3",
    "rcbenchmark/a3_*": "5x4.5x3", "rcbenchmark/a4_*": "5x4", "rcbenchmark/Log_2019-11-05_171350": "7x5.6x3",
}  # fmt: skip
_COLUMNS = {"rpm": ("rpm", 1.0), "th": ("thrust_N", 1e-3 * G0), "tq": ("torque_Nm", 1e-5 * G0),
            "Motor Electrical Speed (RPM)": ("rpm", 1.0), "Thrust (gf)": ("thrust_N", 1e-3 * G0),
            "Torque (N·m)": ("torque_Nm", 1.0)}  # fmt: skip


def stands(data: Path) -> Iterator[str]:
    """Medians of the errors of each propeller, and how many readings u and the 95 % interval of a reading hold."""
    held: dict[str, list[list[float]]] = {}
    for pattern, label in STANDS.items():
        table = pd.concat([pd.read_csv(f, encoding="utf-8-sig") for f in sorted(data.glob(f"{pattern}.csv"))])
        read = {name: factor * table[c].to_numpy(float) for c, (name, factor) in _COLUMNS.items() if c in table}
        fast = read["rpm"] > 0.5 * np.nanmax(read["rpm"])
        for name in ("thrust_N", "torque_Nm"):
            if name in read:
                rows = fast & np.isfinite(read[name])  # load cells of logs have rows of their own
                case = case_of(fresh.label_text(label, measured=False), ends=False)
                found, y = propagate(case, read["rpm"][rows], 0.0, 1.2), read[name][rows]
                off = np.asarray(found.points[name]) - y
                shares = [float(np.mean(np.abs(off) <= u)) for u in (found.u_reading(name), found.reading95(name))]
                held.setdefault(name, []).append(shares)
                yield (f"{label:8} {pattern:36} {name:10} {y.size:4d} off by {100 * np.median(off / y):6.1f} %   "
                       f"{100 * shares[0]:4.0f}/{100 * shares[1]:4.0f}")  # fmt: skip
    for name, each in held.items():
        yield f"{name}: {len(each)} propellers, {' / '.join(f'{100 * v:.0f}' for v in np.mean(each, axis=0))}"


def main(words: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Bands of labels against UIUC.")
    parser.add_argument("folders", metavar="DIR", nargs="*", help="folders in the UIUC layout, or uiuc")
    parser.add_argument("--stands", metavar="DATA", type=Path, help="folder that holds jmajew and rcbenchmark")
    args = parser.parse_args(words)
    if args.stands:
        print("\n".join(stands(args.stands)))
        return 0
    rows: dict[str, list[tuple[str, float, float, float, float, float]]] = {}
    for p, rpm, J, y in readings([where(f) for f in args.folders]):
        kind = class_of(p.family)
        blades = f"x{p.blades}" if p.blades != 2 else ""
        label = f"{p.diameter_in:.4g}x{p.pitch_in:.4g}{blades}{SUFFIX[kind]}"
        case = case_of(fresh.label_text(label, measured=False), ends=False)
        found = propagate(case, rpm, J * rpm / 60.0 * case.diameter_m, 1.225)
        for i, q in enumerate(("CT", "CP")):
            off = np.abs(found.points[q] - y[i])
            bands = (found.points.u[q], found.half_width95(q), found.u_reading(q), found.reading95(q))
            for where_, here in (("rest", J == 0.0), ("flight", J > 0.0)):
                good = here & np.isfinite(off)
                if good.any():
                    held = [float(np.mean(off[good] <= band[good])) for band in bands]
                    error = float(np.median(off[good] / y[i][good]))
                    for group in ("all", str(kind)):
                        rows.setdefault(f"{group:12} {where_:6} {q}", []).append((label, error, *held))
    print(f"{'':22} {'n':>4} {'median':>7} {'p90':>6}   {'u':>9}   u_reading")
    for name, found_ in sorted(rows.items()):
        values = 100.0 * np.array([row[1:] for row in found_])
        held = values[:, 1:].mean(axis=0)
        p90 = math.nan if len(values) < 3 else float(np.quantile(values[:, 0], 0.9))
        print(f"{name:22} {len(values):4d} {np.median(values[:, 0]):7.1f} {p90:6.1f}   "
              f"{held[0]:4.0f}/{held[1]:4.0f}   {held[2]:4.0f}/{held[3]:4.0f}")  # fmt: skip
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
