"""Draw docs/img/overview.png from the cases of this project: ``.venv/bin/python docs/overview.py``.

The numbers drawn are stored in the picture itself (PNG text "bemt"), so that a test can tell when it is out of date.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.lines import Line2D

from bemt.results.sweep import sweep
from bemt.rotors.case import load_case
from bemt.rotors.case.prepare import k1k2_case, prepare_case

ROOT = Path(__file__).resolve().parents[1]
TARGET = ROOT / "docs" / "img" / "overview.png"

# Okabe and Ito (2008): colours that colour-blind readers tell apart; the markers differ too.
LOOK: dict[str, dict[str, Any]] = {
    "bemt": dict(color="#0072B2", marker="o", markersize=8),
    "k1k2": dict(color="#E69F00", marker="s", markersize=7),
    "cfd": dict(color="#D55E00", marker="D", markersize=7),
    "bench": dict(color="#009E73", marker="x", markersize=8, markeredgewidth=2.5),
    "vendor": dict(color="#CC79A7", marker="^", markersize=8),
}
LABEL = {
    "bemt": "BEMT",
    "k1k2": "K1/K2 formula",
    "cfd": "CFD (Fluent), no u stated",
    "bench": "bench",
    "vendor": "vendor",
}
LANE = {"bemt": 0.2, "k1k2": -0.2}
"""Of bars, in the row of a case, so that none lies under another source's mark."""
LIMITS = (0.7, 1.5)


def thrusts(ax: Any) -> dict[str, float]:
    """Thrust of the five cases, each as a ratio to its recorded CFD value; returns ours in newtons."""
    order = ["ds30", "prop_14x8", "prop_12x6", "prop_10x5", "prop_8x5"]
    cases = {c.name: c for c in sweep([ROOT / "cases" / name for name in order]).cases}
    ours = {}
    for y, name in enumerate(order):
        rows: dict[str, Any] = {}
        for row in cases[name].rows:
            rows.setdefault(row.source, row)
        base = rows["cfd"].thrust_N
        ours[name] = rows["bemt"].thrust_N
        for source in ("cfd", "vendor", "bench", "k1k2", "bemt"):
            if source not in rows:
                continue
            at, u, look = rows[source].thrust_N / base, rows[source].u, LOOK[source]
            lane = y + LANE.get(source, 0.0)
            if at < LIMITS[0]:  # stands at the edge with its value: one outlier does not flatten the rest
                ax.plot(LIMITS[0] + 0.015, lane, ls="none", **{**look, "marker": "<"})
                ax.text(LIMITS[0] + 0.035, lane, f"{at:.2f}", va="center", fontsize=8)
                continue
            if np.isfinite(u):
                ax.plot([at - u / base, at + u / base], [lane, lane], lw=6, alpha=0.3, color=look["color"],
                        solid_capstyle="butt")  # fmt: skip
            ax.plot(at, lane, ls="none", **look)
    ax.axvline(1.0, color="0.75", lw=1, zorder=0)
    names = [f"{n.replace('prop_', '').replace('ds30', 'DS-30 fan')}\n{ours[n]:.1f} N" for n in order]
    ax.set_yticks(range(len(order)), names)
    ax.set_ylim(-0.6, len(order) - 0.4)
    ax.set_xlim(*LIMITS)
    ax.set_xlabel("thrust / recorded CFD thrust [-]; bars: one standard uncertainty")
    ax.set_title("Static thrust, five cases (BEMT value under the name)", fontsize=10)
    handles = [Line2D([], [], ls="none", **look) for look in LOOK.values()]
    ax.legend(handles, [LABEL[k] for k in LOOK], fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncol=3,
              frameon=False, columnspacing=1.2, handletextpad=0.3)  # fmt: skip
    ax.grid(axis="x", color="0.92")
    return ours


def curves(ax: Any) -> None:
    """CT and CP of the 8x5 over advance ratio."""
    case = load_case(ROOT / "cases" / "prop_8x5" / "case.toml")
    ready = prepare_case(case)
    air = case.air()
    J = np.linspace(0.0, 1.0, 101)
    rpm = np.full(J.size, 20000.0)
    V = J * rpm / 60.0 * ready.diameter_m
    points = ready.solve(rpm, V, air)
    formula = k1k2_case(case, None, rpm, V, air)
    ax.plot(J, points.CT, color="#0072B2", lw=2, label="CT, BEMT")
    ax.plot(J, formula.CT, color="#E69F00", lw=2, ls="--", label="CT, K1/K2 formula")
    ax.plot(J, points.CP, color="#D55E00", lw=2, ls="-.", label="CP, BEMT")
    ax.axhline(0.0, color="0.5", lw=0.8)
    ax.set_xlabel("advance ratio J = V / (n D) [-]")
    ax.set_ylabel("CT = T/(ρ n² D⁴), CP = P/(ρ n³ D⁵) [-]")
    ax.set_title("8x5 propeller at 20,000 rev/min", fontsize=10)
    ax.set_xlim(0.0, 1.0)
    ax.legend(fontsize=8, frameon=False)
    ax.grid(color="0.92")


def main() -> None:
    """Draw and save."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.4), layout="constrained")
    drawn = thrusts(left)
    curves(right)
    for ax in (left, right):
        ax.spines[["top", "right"]].set_visible(False)
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(TARGET, dpi=110, metadata={"Software": None, "bemt": json.dumps({"thrust_N": drawn})})


if __name__ == "__main__":
    main()
