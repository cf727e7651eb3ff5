"""Bands of labels against UIUC's readings: the rotor's own band and that of a reading, by class of blades.

``python reports/studies/label_bands.py uiuc uiuc_2`` prints errors and how many readings the bands hold.  Labels carry
size and class, not the maker; nobody of them counts as measured.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
from label_classes import readings

from bemt.data.readers.uiuc_names import class_of
from bemt.rotors.case import case_of, fresh
from bemt.rotors.case.propagate import propagate
from bemt.rotors.validate.propellers import where

SUFFIX = {None: "", "electric": "E", "slow_flyer": "SF", "folding": " folding", "sport": " sport"}


def main(words: list[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Bands of labels against UIUC.")
    parser.add_argument("folders", metavar="DIR", nargs="+", help="folders in the UIUC layout, or uiuc")
    args = parser.parse_args(words)
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
