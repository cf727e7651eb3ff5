"""The blade before and after: outline, chord, twist, lift coefficient and loading."""

from __future__ import annotations

from typing import Any

import numpy as np

from bemt.base import canvas
from bemt.base.arrays import Array
from bemt.base.canvas import BLUE, GREY, ORANGE
from bemt.tools.design.blade_design import Design

BEFORE: dict[str, Any] = {"color": ORANGE, "ls": "--", "lw": 1.4}
AFTER: dict[str, Any] = {"color": BLUE, "ls": "-", "lw": 1.8}
LIMIT: dict[str, Any] = {"color": GREY, "ls": ":", "lw": 1.3}


def picture(d: Design) -> bytes:
    """Draw the start and the result. PNG bytes."""
    figure = canvas.figure(10.0, 7.2)
    axes = figure.subplot_mosaic([["blade", "blade"], ["chord", "twist"], ["lift", "load"]],
                                 height_ratios=[0.75, 1.0, 1.0])  # fmt: skip
    shape, R = d.found.problem.shape, d.need.R
    x = shape.r / R
    tables = [shape.table(d.found.start), shape.table(d.found.best)]
    start = "before: minimum induced loss" if d.start is not None else "before: blade of the case"
    looks: tuple[Any, ...] = (
        (tables[0], d.found.before, {**BEFORE, "label": start}),
        (tables[1], d.values, {**AFTER, "label": "after"}),
    )
    for (r, chord, beta), v, look in looks:
        _outline(axes["blade"], 1e3 * R * r, 1e3 * R * chord, look)
        axes["chord"].plot(r, 1e3 * R * chord, **look)
        axes["twist"].plot(r, np.degrees(beta), **look)
        for k in d.found.problem.flown:
            label = look if k == d.found.problem.flown[0] else {**look, "label": None, "alpha": 0.5}
            axes["lift"].plot(x, v.cl[k], **label)
            axes["load"].plot(x, v.load[k], **label)
    low, _ = d.found.problem.chord_range
    axes["chord"].plot(tables[1][0], 1e3 * R * np.exp(low), **LIMIT, label="least")
    for k in d.found.problem.flown:
        axes["lift"].plot(
            x, d.values.limit[k], **LIMIT, label="largest allowed" if k == d.found.problem.flown[0] else None
        )
    later = "" if len(d.found.problem.flown) == 1 else " (later points lighter)"
    axes["blade"].set(xlabel="radius [mm]", ylabel="[mm]", aspect="equal")
    axes["blade"].set_title(
        d.name + f": {d.need.blades} blades, outline along the quarter chord, unrolled", fontsize=10
    )
    for key, y in (("chord", "chord [mm]"), ("twist", "blade angle [deg]"), ("lift", "lift coefficient" + later),
                   ("load", "thrust per radius [N/m]")):  # fmt: skip
        axes[key].set(xlabel="r/R", ylabel=y, xlim=(0.0, 1.0))
        axes[key].set_ylim(bottom=min(0.0, axes[key].get_ylim()[0]))
    axes["chord"].legend(frameon=False, fontsize=8)
    axes["lift"].legend(frameon=False, fontsize=8)
    for ax in axes.values():
        canvas.frame(ax)
    return canvas.png(figure)


def _outline(ax: Any, r: Array, chord: Array, look: dict[str, Any]) -> None:
    """Leading and trailing edge around the quarter chord, closed."""
    edge = np.r_[0.25 * chord, (-0.75 * chord)[::-1]]
    ax.plot(np.r_[r, r[::-1], r[0]], np.r_[edge, edge[0]], **look)
