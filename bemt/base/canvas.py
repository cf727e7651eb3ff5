"""Colours, settings and blank figures of every picture drawn by matplotlib."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["STYLE", "blank", "png"]

# Okabe and Ito 2008, Color Universal Design.
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, RED, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#8a8a8a"

WIDTH = 8.0
DPI = 150
STYLE: dict[Any, Any] = {
    "font.size": 9.0, "axes.titlesize": 9.0, "axes.spines.top": False, "axes.spines.right": False,
    "figure.facecolor": "white", "savefig.facecolor": "white", "legend.frameon": False, "legend.fontsize": 8.0,
    "lines.linewidth": 1.5,
}  # fmt: skip
"""Settings of matplotlib."""


def blank(height: float, rows: int, columns: int, **options: Any) -> tuple[Figure, NDArray[Any]]:
    """Give a figure that no window knows of, so that nothing stays open."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def png(figure: Figure, dpi: int = 110) -> bytes:
    """PNG of a figure, its axes open above and to the right."""
    for ax in figure.axes:
        ax.spines[["top", "right"]].set_visible(False)
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=dpi, metadata={"Software": None})
    return out.getvalue()
