"""Plots as values of a small SVG that is readable in light and dark; its numbers travel with it as CSV.

Colours are those of Okabe and Ito (2008), which colour-blind readers tell apart; marker shape and dash tell the same.
"""

from __future__ import annotations

import base64
import io
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar
from urllib.parse import quote

import numpy as np

from bemt.base.arrays import Array
from bemt.base.tables import number_text
from geometry.mesh import Surface

# A rotor for the page: grids of points that a viewer turns, and a still picture of the same for paper and cards.

PART_COLOURS = {"blade": "#4f93c4", "hub": "#8d99a6", "duct": "#c9973f", "cut": "#e3c58c", "stator": "#b58a4a"}
OPEN, CUT_OPEN = (-0.25, 0.95, 1.25), (0.45, 1.05, 0.95)
"""How the rotor first stands: turned about its shaft, then tipped towards the eye [rad]; its size in the viewer. [-]"""
LIGHT = np.array([0.35, 0.45, 0.82])


def _view(surfaces: Sequence[Surface]) -> tuple[float, float, float]:
    return CUT_OPEN if any(s.name == "duct" for s in surfaces) else OPEN


@dataclass(frozen=True)
class RotorView:
    """A rotor that a reader turns: a still picture with its words, grids and first view as JSON."""

    alt: str
    src: str
    mesh: str
    view: str
    kind: ClassVar[str] = "rotor"


def viewer(surfaces: Sequence[Surface], alt: str = "", src: str = "") -> RotorView:
    """Pack the grids for the viewer: 16-bit integers round their middle, which keeps 1/32767 of the farthest point."""
    everything = np.concatenate([s.points.reshape(-1, 3) for s in surfaces])
    middle = np.array([0.0, 0.0, 0.5 * (everything[:, 2].max() + everything[:, 2].min())])
    size = float(np.linalg.norm(everything - middle, axis=1).max())
    mesh = []
    for s in surfaces:
        data = np.round((s.points - middle) / size * 32767).astype("<i2").tobytes()
        mesh.append({"rows": s.points.shape[0], "columns": s.points.shape[1], "copies": s.copies,
                     "colour": PART_COLOURS[s.name], "data": base64.b64encode(data).decode()})  # fmt: skip
    return RotorView(alt, src, json.dumps(mesh), json.dumps(_view(surfaces)))


def _turned(points: Array, angle: float, axis: int) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    out = points.copy()
    out[..., i], out[..., j] = c * points[..., i] - s * points[..., j], s * points[..., i] + c * points[..., j]
    return out


def still(surfaces: Sequence[Surface], width: int = 560) -> bytes:
    """Draw the surfaces as PNG, facets from back to front, in parallel projection on nothing."""
    from PIL import Image, ImageDraw

    yaw, pitch, _ = _view(surfaces)
    facets, colours = [], []
    for s in surfaces:
        colour = np.array([int(PART_COLOURS[s.name][i : i + 2], 16) for i in (1, 3, 5)], float)
        for k in range(s.copies):
            p = _turned(_turned(s.points, yaw + 2 * np.pi * k / s.copies, 2), -pitch, 0)
            quads = np.stack([p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]], axis=2).reshape(-1, 4, 3)
            normal = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
            normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
            facets.append(quads)
            colours.append(colour * (0.38 + 0.62 * np.abs(normal @ LIGHT)[:, None]))
    quads, tones = np.concatenate(facets), np.concatenate(colours).clip(0, 255).astype(int)
    low, high = quads[..., :2].min(axis=(0, 1)), quads[..., :2].max(axis=(0, 1))
    scale = (2 * width - 8) / (high[0] - low[0])
    page = Image.new("RGBA", (2 * width, int(scale * (high[1] - low[1])) + 8))
    draw = ImageDraw.Draw(page)
    at = 4 + scale * (quads[..., :2] - low)
    at[..., 1] = page.height - at[..., 1]
    for i in np.argsort(quads[..., 2].mean(axis=1), kind="stable"):
        tone = (*tones[i].tolist(), 255)
        draw.polygon([tuple(corner) for corner in at[i].tolist()], fill=tone, outline=tone)
    out = io.BytesIO()
    page.resize((width, page.height // 2), Image.Resampling.BOX).save(out, "png", optimize=True)
    return out.getvalue()


COLOURS = {
    "bemt": "#0072B2",
    "bemt variant": "#56B4E9",
    "k1k2": "#E69F00",
    "cfd": "#D55E00",
    "openfoam": "#8C564B",
    "openfoam incompressible": "#7f7f7f",
    "bench": "#009E73",
    "vendor": "#CC79A7",
    "other": "#7f7f7f",
}
SERIES = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9", "#7f7f7f")
DASHES = ("", "7 4", "2 3", "9 3 2 3", "12 4", "4 4", "1 4")
SHAPES = ("circle", "square", "triangle", "diamond", "cross", "star")
WIDTH, HEIGHT, WIDE = 480, 320, 760
LEFT, RIGHT, TOP, BOTTOM = 62, 12, 14, 46
ROW = 56
"""Height of a row of categories."""


@dataclass(frozen=True)
class Trace:
    """One source in a plot."""

    name: str  # For the key
    # Points, in the units of the axes; NaN and None break a line
    x: Sequence[Any] | Array
    y: Sequence[Any] | Array
    u: Sequence[Any] | Array | None = None  # Standard uncertainty of y: a band round a line, bars through points
    colour: str = COLOURS["bemt"]  # ``#rrggbb``
    dash: str = ""  # SVG dash pattern; empty is a full line
    shape: str = "circle"  # Marker of points: circle, square, triangle, diamond, cross, bar, star
    points: bool = False  # Points instead of a line
    labels: Sequence[str] = ()  # Words per point, shown on hovering
    horizontal: bool = False  # The uncertainty belongs to x
    ceiling: Sequence[Any] | Array | None = None  # What y cannot pass: a band ends there

    def top(self, x: float, y: float, u: float) -> float:
        """Upper end of the band at a point of the trace."""
        if self.ceiling is None:
            return y + u
        most = next((c for at, c in zip(self.x, self.ceiling, strict=True) if at == x), math.inf)
        return max(y, min(y + u, float(most)))


def points(
    name: str, rows: Sequence[tuple[Any, Any, Any, str]], source: str, shape: str, horizontal: bool = False
) -> Trace:
    """Make a trace of points from rows of x, y, standard uncertainty, words."""
    x, y, u, words = ([row[k] for row in rows] for k in range(4))
    return Trace(
        name, x, y, u, COLOURS.get(source, COLOURS["other"]), "", shape, True, list(map(str, words)), horizontal
    )


@dataclass(frozen=True)
class Mark:
    """A place on the x axis: a line across the plot with words."""

    at: float  # Where, in the unit of the axis
    words: str  # What is there


@dataclass(frozen=True)
class Plot:
    """A plot with axes."""

    # Words; the labels hold the units
    title: str
    x_label: str
    y_label: str
    traces: Sequence[Trace]  # What is drawn; traces without a finite point are left out
    marks: Sequence[Mark] = field(default_factory=tuple)  # Places
    note: str = ""  # Sentence below the plot
    y_names: Sequence[str] = ()  # Names of the rows 0, 1, ... when y counts categories.
    zero: bool = True  # Whether the y axis holds zero
    x_zero: bool = False  # Whether the x axis holds zero
    log_x: bool = False  # Whether the x axis is logarithmic
    wide: bool = False  # Whether it takes the width of the page
    # Points beyond stand at the edge as an arrow with their value, so that one of them does not flatten the rest
    x_limits: tuple[float, float] | None = None


def _number(value: Any) -> float:
    """A finite float of moderate size, else NaN."""
    if isinstance(value, bool) or value is None:
        return math.nan
    try:
        out = float(value)
    except (TypeError, ValueError):
        return math.nan
    return out if math.isfinite(out) and abs(out) < 1e30 else math.nan


def ticks(low: float, high: float, n: int = 6) -> list[float]:
    """Round numbers between two ends.

    >>> ticks(0.0, 1.0)
    [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    """
    span = high - low
    if not (math.isfinite(span) and span > 0):
        return [low]
    raw = span / max(n - 1, 1)
    step = 10.0 ** math.floor(math.log10(raw))
    step *= next(m for m in (1, 2, 2.5, 5, 10) if m * step >= raw * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [float(f"{k * step:.10g}") for k in range(first, int(math.floor(high / step + 1e-9)) + 1)]


def _fit(values: list[float], zero: bool) -> tuple[float, float]:
    low, high = (min(values), max(values)) if values else (0.0, 1.0)
    if zero:
        low, high = min(low, 0.0), max(high, 0.0)
    if high <= low:
        pad = abs(low) * 0.1 or 1.0
        return low - pad, high + pad
    pad = 0.04 * (high - low)
    return (low if zero and low == 0.0 else low - pad), (high if zero and high == 0.0 else high + pad)


class _Frame:
    """Where numbers land on the paper."""

    def __init__(self, plot: Plot, traces: Sequence[_Numbers], width: int, left: int, height: int) -> None:
        low, high = plot.x_limits or (-math.inf, math.inf)
        xs: list[float] = []
        ys: list[float] = []
        for t in traces:
            for x, y, u in t.points:
                if not low <= x <= high:
                    continue
                xs.append(x)
                ys.append(y)
                if not math.isnan(u):
                    if t.trace.horizontal:
                        xs += [x - u, x + u]
                    else:
                        ys += [y - u, t.trace.top(x, y, u)]
        xs = [min(max(x, low), high) for x in xs]
        self.log = plot.log_x and all(x > 0 for x in xs)
        xs = [math.log10(x) for x in xs] if self.log else xs
        self.x0, self.x1 = _fit(xs, plot.x_zero and not self.log)
        self.y0, self.y1 = (-0.6, len(plot.y_names) - 0.4) if plot.y_names else _fit(ys, plot.zero)
        above = 14 * len(plot.marks) if plot.y_names else 0  # words clear of the rows
        self.left, self.right, self.top, self.bottom = left, width - RIGHT, TOP + above, height - BOTTOM

    def x(self, v: float) -> float:
        v = math.log10(v) if self.log else v
        return self.left + (v - self.x0) / (self.x1 - self.x0) * (self.right - self.left)

    def y(self, v: float) -> float:
        return self.bottom - (v - self.y0) / (self.y1 - self.y0) * (self.bottom - self.top)

    def inside(self, x: float) -> float:
        return min(max(x, self.left), self.right)


@dataclass(frozen=True)
class _Numbers:
    """Finite points of a trace, and the runs between its gaps."""

    trace: Trace
    points: list[tuple[float, float, float]]
    runs: list[list[int]]
    labels: list[str]


def _numbers(trace: Trace) -> _Numbers:
    points, runs, labels = [], [[]], []  # type: ignore[var-annotated]
    for i, (x, y) in enumerate(zip(trace.x, trace.y, strict=False)):
        p = _number(x), _number(y), _number(trace.u[i]) if trace.u is not None and i < len(trace.u) else math.nan
        if not math.isnan(p[0] + p[1]):
            runs[-1].append(len(points))
            points.append(p)
            labels.append(str(trace.labels[i])[:200] if i < len(trace.labels) else "")
        elif runs[-1]:
            runs.append([])
    return _Numbers(trace, points, [run for run in runs if run], labels)


def _marker(shape: str, x: float, y: float) -> tuple[str, str]:
    """Kind and path of a marker."""
    at = f"{x:.1f} {y:.1f}"
    return {
        "square": ("dot", f"M{at}m-4.5 -4.5h9v9h-9z"),
        "triangle": ("dot", f"M{at}m-5.5 4.5h11l-5.5 -10z"),
        "diamond": ("dot", f"M{at}m0 -6l5.5 6l-5.5 6l-5.5 -6z"),
        "cross": ("line", f"M{at}m-4.5 -4.5l9 9m0 -9l-9 9"),
        "star": ("line", f"M{at}m0 -6v12m-5.2 -9l10.4 6m0 -6l-10.4 6"),
        "small": ("dot", f"M{at}m-3 0a3 3 0 1 0 6 0a3 3 0 1 0 -6 0z"),
        "left": ("dot", f"M{at}l9 -5v10z"),
        "right": ("dot", f"M{at}l-9 -5v10z"),
    }.get(shape, ("dot", f"M{at}m-4.5 0a4.5 4.5 0 1 0 9 0a4.5 4.5 0 1 0 -9 0z"))


def _path(points: Sequence[tuple[float, float]]) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points)


@dataclass(frozen=True)
class _Label:
    """Words at a place of the picture [px], as its template writes them."""

    x: str
    y: str
    words: str
    anchor: str
    kind: str
    turn: bool


_Drawn = tuple[list[tuple[str, str]], list[_Label]]
"""Paths with their kind, and words."""


def _points(t: _Numbers, f: _Frame) -> _Drawn:
    """Bars and markers of a trace; words where a point lies beyond the edge."""
    out, words = [], []
    for x, y, u in t.points:
        px, py = f.x(x), f.y(y)
        if px != f.inside(px):
            end, at = ("start", f.left + 13) if px < f.left else ("end", f.right - 13)
            out.append(_marker("left" if px < f.left else "right", f.inside(px), py))
            words.append(_text(at, py + 4, number_text(x, 2), end, "edge"))
            continue
        if not math.isnan(u):
            ends = [(f.inside(f.x(x + s * u)), py) if t.trace.horizontal else (px, f.y(y + s * u)) for s in (-1, 1)]
            out.append(("bar", _path(ends)))
        out.append(_marker(t.trace.shape, px, py))
    return out, words


def _curves(t: _Numbers, f: _Frame) -> _Drawn:
    """Bands and lines of a trace; markers where there are few points."""
    out = []
    for run in t.runs:
        at = [t.points[i] for i in run]
        band = [p for p in at if not math.isnan(p[2])]
        if len(band) > 1:
            upper = [(f.x(x), f.y(t.trace.top(x, y, u))) for x, y, u in band]
            out.append(("band", _path(upper + [(f.x(x), f.y(y - u)) for x, y, u in reversed(band)]) + "z"))
        if len(at) > 1:
            out.append(("line", _path([(f.x(x), f.y(y)) for x, y, _ in at])))
        if len(at) <= 8:
            out += [_marker("circle" if len(at) == 1 else "small", f.x(x), f.y(y)) for x, y, _ in at]
    return out, []


def _text(x: float, y: float, words: str, anchor: str = "middle", kind: str = "", turn: bool = False) -> _Label:
    return _Label(f"{x:.1f}", f"{y:.1f}", words, anchor, kind, turn)


def _axes(plot: Plot, f: _Frame, width: int, height: int) -> _Drawn:
    """Grid, axes and their words."""
    lines, words = [], []
    if f.log:
        marks = sorted({10.0**k * m for k in range(math.floor(f.x0), math.ceil(f.x1) + 1) for m in (1, 2, 5)})
        marks = [v for v in marks if f.x0 - 1e-9 <= math.log10(v) <= f.x1 + 1e-9]
    else:
        marks = ticks(f.x0, f.x1, 6 if width == WIDTH else 8)
    for v in marks:
        lines.append(("grid", f"M{f.x(v):.1f} {f.top}V{f.bottom}"))
        words.append(_text(f.x(v), f.bottom + 16, _tick(v)))
    rows: list[tuple[float, str]] = [(i, n if len(n) <= 18 else n[:17] + "…") for i, n in enumerate(plot.y_names)]
    for v, name in rows or [(v, _tick(v)) for v in ticks(f.y0, f.y1)]:
        y = f.y(v) if not rows else f.y(v - 0.5)
        lines += [("grid", f"M{f.left} {y:.1f}H{f.right}")] if not rows or v else []
        words.append(_text(f.left - 7, f.y(v) + 4, name, "end"))
    lines.append(("axis", f"M{f.left} {f.top}V{f.bottom}H{f.right}"))
    words.append(_text(0.5 * (f.left + f.right), height - 8, plot.x_label, kind="label"))
    if plot.y_label:
        words.append(_text(14, round(0.5 * (f.top + f.bottom)), plot.y_label, kind="label", turn=True))
    return lines, words


def _tick(value: float) -> str:
    return f"{value:,.10g}".replace(",", " ") if abs(value) >= 1e4 else f"{value:.10g}"


def _marks(plot: Plot, f: _Frame) -> _Drawn:
    """Places on the axes: lines, shaded ranges, words."""
    lines: list[tuple[str, str]] = []
    words: list[_Label] = []
    for mark in plot.marks:
        v = _number(mark.at)
        if math.isnan(v) or (f.log and v <= 0):
            continue
        p = f.x(v)
        if f.left <= p <= f.right:
            lines.append(("mark", f"M{p:.1f} {TOP if plot.y_names else f.top}V{f.bottom}"))
            late = p > 0.62 * f.right
            row = 12 + 14 * (len(words) % 4)
            words.append(_text(p + (-4 if late else 4), TOP + row, mark.words, "end" if late else "start", "note"))
    return lines, words


def _csv(plot: Plot, traces: Sequence[_Numbers]) -> str:
    """Every number of a plot as a data URI; no cell that a spreadsheet would run as a formula."""

    def cell(value: Any) -> str:
        if isinstance(value, float):
            return "" if math.isnan(value) else f"{value:.6g}"
        text = " ".join(str(value).split())
        return '"' + ("'" if text[:1] in "=+-@" and text else "") + text.replace('"', '""') + '"'

    lines = [["source", plot.x_label, plot.y_label or "row", "standard uncertainty", "point"]]
    for t in traces:
        for (x, y, u), label in zip(t.points, t.labels, strict=True):
            k = round(y)
            row = plot.y_names[k] if 0 <= k < len(plot.y_names) else y
            lines.append([t.trace.name, x, row, u, label])  # type: ignore[list-item]
    text = "\n".join(",".join(map(cell, line)) for line in lines) + "\n"
    return "data:text/csv;charset=utf-8," + quote(text.encode("utf-8", "replace"), safe=",.-_ ()[]:/")


@dataclass(frozen=True)
class DrawnTrace:
    """A trace as its template writes it."""

    name: str
    colour: str
    dash: str
    paths: list[tuple[str, str]]
    words: list[_Label]
    key: tuple[str, str]


@dataclass(frozen=True)
class Figure:
    """A plot as its template writes it."""

    title: str
    note: str
    wide: bool
    width: int
    height: int
    frame: list[tuple[str, str]]
    words: list[_Label]
    traces: list[DrawnTrace]
    at: str  # Trace and place of every point [px]
    csv: str
    kind: ClassVar[str] = "plot"

    @property
    def slug(self) -> str:
        """Its title as the name of a file."""
        return re.sub(r"[^a-z0-9]+", "-", self.title.lower()).strip("-")[:60]


def figure(plot: Plot) -> Figure | None:
    """Draw a plot; None where nothing is finite.

    >>> figure(Plot("t", "x [m]", "y [N]", [Trace("a", [1.0], [float("nan")])]))
    >>> figure(Plot("t", "x [m]", "y [N]", [Trace("a", [1.0, 2.0], [3.0, 4.0])])).traces[0].paths[0][0]
    'line'
    """
    traces = [t for t in map(_numbers, plot.traces) if t.points]
    if not traces:
        return None
    width = WIDE if plot.wide else WIDTH
    height = 76 + ROW * len(plot.y_names) + 14 * len(plot.marks) if plot.y_names else HEIGHT
    f = _Frame(plot, traces, width, 120 if plot.y_names else LEFT, height)
    if not plot.y_names:  # room for long numbers
        f.left = max(LEFT, 34 + 8 * max(len(_tick(v)) for v in ticks(f.y0, f.y1)))
    (lines, words), (more, notes) = _axes(plot, f, width, height), _marks(plot, f)
    drawn = []
    for t in traces:
        look = t.trace
        paths, beyond = (_points if look.points else _curves)(t, f)
        key = _marker(look.shape, 12, 9) if look.points else ("line", "M1 9H23")
        drawn.append(DrawnTrace(look.name, look.colour, look.dash, paths, beyond, key))
    at = " ".join(f"{i},{f.inside(f.x(x)):.0f},{f.y(y):.0f}" for i, t in enumerate(traces) for x, y, _ in t.points)
    return Figure(plot.title, plot.note, plot.wide, width, height, [*lines, *more], [*words, *notes], drawn, at,
                  _csv(plot, traces))  # fmt: skip
