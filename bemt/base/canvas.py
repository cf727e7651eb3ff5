"""Colours, settings and blank figures of every picture drawn by matplotlib."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito 2008, Color Universal Design.
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, RED, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#8a8a8a"
CYCLE = (BLUE, ORANGE, GREEN, PURPLE, SKY, RED, BLACK)
"""Colours of lines, first to last."""

WIDTH = 8.0
DPI = 150
STYLE: dict[Any, Any] = {
    "font.size": 9.0, "axes.titlesize": 9.0, "axes.spines.top": False, "axes.spines.right": False,
    "figure.facecolor": "white", "savefig.facecolor": "white", "legend.frameon": False, "legend.fontsize": 8.0,
    "lines.linewidth": 1.5,
}  # fmt: skip
"""Settings of matplotlib."""


def figure(width: float, height: float) -> Figure:
    """Give a figure that no window knows of, so that nothing stays open [in]."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    made = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(made)
    return made


def blank(height: float, rows: int, columns: int, **options: Any) -> tuple[Figure, NDArray[Any]]:
    """Figure of the usual width with axes in rows and columns."""
    made = figure(WIDTH, height)
    return made, made.subplots(rows, columns, squeeze=False, **options)


def frame(ax: Any) -> None:
    """Grid, and no frame above and to the right."""
    ax.grid(True, alpha=0.3)
    ax.spines[["top", "right"]].set_visible(False)


def png(made: Figure, dpi: int = 110, optimize: bool = False) -> bytes:
    """PNG bytes that depend on the figure alone; to `optimize` takes time and saves bytes."""
    out = io.BytesIO()
    made.savefig(out, format="png", dpi=dpi, metadata={"Software": None}, pil_kwargs={"optimize": optimize})
    return out.getvalue()


_DATES = {"pdf": "CreationDate", "svg": "Date"}


def kind_of(name: str) -> str:
    """Kind of picture that a file name asks for by its ending: png, pdf or svg.

    >>> kind_of("out/E8.PDF")
    'pdf'
    """
    kind = Path(name).suffix.lower().removeprefix(".")
    if kind not in ("png", *_DATES):
        raise InputError(Fault("", "picture", name, "a name that ends in .png, .pdf or .svg"))
    return kind


def drawn(made: Figure, kind: str, dpi: int = 110) -> bytes:
    """A picture of a `kind` as :func:`kind_of` gives it, in bytes that depend on the figure alone."""
    import matplotlib

    if kind == "png":
        return png(made, dpi)
    out = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "bemt"}):
        made.savefig(out, format=kind, metadata={_DATES[kind]: None})
    return out.getvalue()
