"""The figure of a calibration: how often each formula is how wrong at rest, and its bias over flight."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bemt.formula.points import FitPoints
from bemt.formula.score import FAR, NEAR, X_EDGES
from bemt.formula.text import NAMES

Array = NDArray[np.float64]

# Okabe and Ito (2008); dash and marker tell the same
_LOOK = {"thesis": ("#D55E00", "--", "s"), "compact_pitch": ("#E69F00", "-.", "^"), "compact": ("#0072B2", "-", "o"),
         "compact_no_chord": ("#56B4E9", ":", "D")}  # fmt: skip


def draw(sets: Mapping[str, tuple[FitPoints, Mapping[str, Array]]], path: Path) -> None:
    """Draw and write a PNG."""
    import io

    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from bemt.base.tables import write_atomic

    figure = Figure(figsize=(10.0, 3.9 * len(sets)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(sets), 2, squeeze=False)
    titles = {"calibration": "calibration, propeller left out", "test": "test, held out"}
    for (name, (points, models)), (left, right) in zip(sets.items(), axes, strict=True):
        still = (points.J == 0) & (points.CT > 0) & ~points.ducted
        moving = (points.J > 0) & (points.CT > 0) & ~points.ducted
        shown = [k for k in _LOOK if k in models]
        for key in shown:
            colour, dash, marker = _LOOK[key]
            if np.any(still):
                e = np.sort(np.abs(models[key][still] / points.CT[still] - 1.0))
                label = f"{NAMES[key]} ({100 * np.mean(e <= NEAR):.0f} %)"
                left.plot(100 * e, 100 * np.arange(1, e.size + 1) / e.size, color=colour, linestyle=dash, label=label)
            centre: list[float] = []
            spread: list[Array] = []
            for a, b in zip(X_EDGES[:-2], X_EDGES[1:-1], strict=True):
                m = moving & (points.x >= a) & (points.x < b)
                if m.sum() >= 10:
                    q = np.nanquantile(models[key][m] / points.CT[m], [0.16, 0.5, 0.84])
                    centre.append((a + b) / 2)
                    spread.append(q)
            if not centre:
                continue
            low, middle, high = np.array(spread).T
            right.plot(centre, middle, marker=marker, linestyle=dash, color=colour, label=NAMES[key])
            if key in ("thesis", "compact"):
                right.fill_between(centre, low, high, color=colour, alpha=0.15, linewidth=0)
        for limit in (NEAR, FAR):
            left.axvline(100 * limit, color="0.6", linewidth=0.8)
        left.set(xlim=(0, 60), ylim=(0, 100), xlabel="error of static thrust, not above [%]", ylabel="points [%]")
        left.set_title(f"Static: {titles[name]}")
        right.axhspan(0.9, 1.1, color="0.9", zorder=0)
        right.axhline(1.0, color="0.6", linewidth=0.8)
        right.set(xlim=(0, 1), ylim=(0, 1.8), xlabel="J/(P/D) [-]", ylabel="thrust, made/measured [-]")
        right.set_title(f"In flight: {titles[name]}")
        for axis in (left, right):
            if axis.get_legend_handles_labels()[0]:
                axis.legend(frameon=False, fontsize=8, loc="lower right" if axis is left else "best")
    figure.supxlabel("Legend: static points within 13 %. Shade: 68 % of the points; grey: within 10 %.", fontsize=8)
    page = io.BytesIO()
    figure.savefig(page, format="png", dpi=110)
    write_atomic(path, page.getvalue())
