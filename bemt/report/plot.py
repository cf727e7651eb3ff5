"""Plots as inline SVG: small, self-contained, readable in light and dark; numbers travel with the picture for hovering.

Colours are those of Okabe and Ito (2008), which colour-blind readers tell apart; marker shape and dash tell the same.
"""

from __future__ import annotations

import html
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from bemt.base.tables import number_text, plain

__all__ = ["COLOURS", "Mark", "Plot", "Trace", "figure", "ticks"]

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


@dataclass(frozen=True)
class Trace:
    """One source in a plot.

    Parameters
    ----------
    name : str
        For the key.
    x, y : sequence of float
        Points, in the units of the axes; NaN and None break a line.
    u : sequence of float or None
        Standard uncertainty of y, same unit: a band round a line, bars through points.
    colour : str
        ``#rrggbb``.
    dash : str
        SVG dash pattern; empty is a full line.
    shape : str
        Marker of points: circle, square, triangle, diamond, cross, bar, star.
    points : bool
        Points instead of a line.
    labels : sequence of str
        Words per point, shown on hovering.
    horizontal : bool
        The uncertainty belongs to x.
    """

    name: str
    x: Sequence[Any]
    y: Sequence[Any]
    u: Sequence[Any] | None = None
    colour: str = SERIES[0]
    dash: str = ""
    shape: str = "circle"
    points: bool = False
    labels: Sequence[str] = ()
    horizontal: bool = False


@dataclass(frozen=True)
class Mark:
    """A place on an axis: a line across the plot with words, or a shaded range beyond it.

    Parameters
    ----------
    at : float
        Where, in the unit of the axis.
    words : str
        What is there.
    axis : str
        ``x`` or ``y``.
    beyond : str
        Empty, ``above`` or ``below``: which side is outside of the range of a model.
    """

    at: float
    words: str
    axis: str = "x"
    beyond: str = ""


@dataclass(frozen=True)
class Plot:
    """A plot with axes.

    Parameters
    ----------
    title, x_label, y_label : str
        Words; the labels hold the units.
    traces : sequence of Trace
        What is drawn; traces without a finite point are left out.
    marks : sequence of Mark
        Places.
    note : str
        Sentence below the plot.
    y_names : sequence of str
        Names of the rows 0, 1, ... when y counts categories.
    zero : bool
        Whether the y axis holds zero.
    x_zero : bool
        Whether the x axis holds zero.
    log_x : bool
        Whether the x axis is logarithmic.
    wide : bool
        Whether it takes the width of the page.
    """

    title: str
    x_label: str
    y_label: str
    traces: Sequence[Trace]
    marks: Sequence[Mark] = field(default_factory=tuple)
    note: str = ""
    y_names: Sequence[str] = ()
    zero: bool = True
    x_zero: bool = False
    log_x: bool = False
    wide: bool = False


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

    Examples
    --------
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

    def __init__(self, plot: Plot, traces: Sequence[dict[str, Any]], width: int, left: int, height: int) -> None:
        xs = [v for t in traces for v, w in zip(t["x"], t["y"], strict=True) if not math.isnan(v + w)]
        ys = [w for t in traces for v, w in zip(t["x"], t["y"], strict=True) if not math.isnan(v + w)]
        for t in traces:
            for v, w, e in zip(t["x"], t["y"], t["u"], strict=True):
                if not math.isnan(v + w + e):
                    (xs if t["horizontal"] else ys).extend([(v if t["horizontal"] else w) + s * e for s in (-1, 1)])
        self.log = plot.log_x and all(x > 0 for x in xs)
        xs = [math.log10(x) for x in xs] if self.log else xs
        self.x0, self.x1 = _fit(xs, plot.x_zero and not self.log)
        self.y0, self.y1 = (-0.6, len(plot.y_names) - 0.4) if plot.y_names else _fit(ys, plot.zero)
        above = 14 * sum(m.axis == "x" for m in plot.marks) if plot.y_names else 0  # words clear of the rows
        self.left, self.right, self.top, self.bottom = left, width - RIGHT, TOP + above, height - BOTTOM
        self.words = TOP

    def x(self, v: float) -> float:
        v = math.log10(v) if self.log else v
        return self.left + (v - self.x0) / (self.x1 - self.x0) * (self.right - self.left)

    def y(self, v: float) -> float:
        return self.bottom - (v - self.y0) / (self.y1 - self.y0) * (self.bottom - self.top)


def _marker(shape: str, x: float, y: float, colour: str) -> str:
    s = 4.5
    fill = f'fill="{colour}"'
    line = f'fill="none" stroke="{colour}" stroke-width="2.4"'
    if shape == "square":
        return f'<rect x="{x - s:.1f}" y="{y - s:.1f}" width="{2 * s}" height="{2 * s}" {fill}/>'
    if shape == "triangle":
        return f'<path d="M{x - 5.5:.1f} {y + 4.5:.1f}h11l-5.5 -10z" {fill}/>'
    if shape == "diamond":
        return f'<path d="M{x:.1f} {y - 6:.1f}l5.5 6l-5.5 6l-5.5 -6z" {fill}/>'
    if shape == "cross":
        return f'<path d="M{x - s:.1f} {y - s:.1f}l9 9m0 -9l-9 9" {line}/>'
    if shape == "star":
        return f'<path d="M{x:.1f} {y - 6:.1f}v12m-5.2 -9l10.4 6m0 -6l-10.4 6" {line}/>'
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4.5" {fill}/>'


def _draw(t: dict[str, Any], f: _Frame) -> str:
    """Band, line or points of one trace."""
    trace: Trace = t["trace"]
    colour, out = trace.colour, []
    good = [not math.isnan(a + b) for a, b in zip(t["x"], t["y"], strict=True)]
    if trace.points:
        for a, b, e, ok in zip(t["x"], t["y"], t["u"], good, strict=True):
            if not ok:
                continue
            x, y = f.x(a), f.y(b)
            if not math.isnan(e):
                ends = (f.x(a - e), y, f.x(a + e), y) if trace.horizontal else (x, f.y(b - e), x, f.y(b + e))
                out.append(
                    '<path d="M{:.1f} {:.1f}L{:.1f} {:.1f}" '.format(*ends)
                    + f'stroke="{colour}" stroke-width="7" class="bar"/>'
                )
            out.append(_marker(trace.shape, x, y, colour))
        return "".join(out)
    runs: list[list[int]] = [[]]
    for i, ok in enumerate(good):
        if ok:
            runs[-1].append(i)
        elif runs[-1]:
            runs.append([])
    for run in filter(None, runs):
        band = [i for i in run if not math.isnan(t["u"][i])]
        if len(band) > 1:
            up = [f"{f.x(t['x'][i]):.1f} {f.y(t['y'][i] + t['u'][i]):.1f}" for i in band]
            down = [f"{f.x(t['x'][i]):.1f} {f.y(t['y'][i] - t['u'][i]):.1f}" for i in reversed(band)]
            out.append(f'<path d="M{"L".join(up + down)}z" fill="{colour}" class="band"/>')
        path = "L".join(f"{f.x(t['x'][i]):.1f} {f.y(t['y'][i]):.1f}" for i in run)
        dash = f' stroke-dasharray="{trace.dash}"' if trace.dash else ""
        out.append(
            _marker("circle", f.x(t["x"][run[0]]), f.y(t["y"][run[0]]), colour)
            if len(run) == 1
            else f'<path d="M{path}" fill="none" stroke="{colour}" stroke-width="2"{dash}/>'
        )
        if 1 < len(run) <= 8:
            out += [f'<circle cx="{f.x(t["x"][i]):.1f}" cy="{f.y(t["y"][i]):.1f}" r="3" fill="{colour}"/>' for i in run]
    return "".join(out)


def _text(x: float, y: float, words: str, anchor: str = "middle", extra: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{extra}>{html.escape(words)}</text>'


def _axes(plot: Plot, f: _Frame, width: int, height: int) -> str:
    out = []
    if f.log:
        marks = sorted({10.0**k * m for k in range(math.floor(f.x0), math.ceil(f.x1) + 1) for m in (1, 2, 5)})
        marks = [v for v in marks if f.x0 - 1e-9 <= math.log10(v) <= f.x1 + 1e-9]
    else:
        marks = ticks(f.x0, f.x1, 6 if width == WIDTH else 8)
    for v in marks:
        x = f.x(v)
        out.append(f'<path class="grid" d="M{x:.1f} {f.top}V{f.bottom}"/>' + _text(x, f.bottom + 16, _tick(v)))
    if plot.y_names:
        for i, name in enumerate(plot.y_names):
            short = name if len(name) <= 18 else name[:17] + "…"
            out.append(
                f'<path class="grid" d="M{f.left} {f.y(i):.1f}H{f.right}"/>'
                + _text(f.left - 7, f.y(i) + 4, short, "end")
            )
    else:
        for v in ticks(f.y0, f.y1):
            y = f.y(v)
            out.append(
                f'<path class="grid" d="M{f.left} {y:.1f}H{f.right}"/>' + _text(f.left - 7, y + 4, _tick(v), "end")
            )
    out.append(f'<path class="axis" d="M{f.left} {f.top}V{f.bottom}H{f.right}"/>')
    middle = 0.5 * (f.top + f.bottom)
    out.append(_text(0.5 * (f.left + f.right), height - 8, plot.x_label, "middle", ' class="label"'))
    if plot.y_label:
        turn = f' class="label" transform="rotate(-90 14 {middle:.0f})"'
        out.append(_text(14, middle, plot.y_label, "middle", turn))
    return "".join(out)


def _tick(value: float) -> str:
    return f"{value:,.10g}".replace(",", " ") if abs(value) >= 1e4 else f"{value:.10g}"


def _marks(plot: Plot, f: _Frame) -> str:
    out, shown = [], 0
    for mark in plot.marks:
        v = _number(mark.at)
        if math.isnan(v) or (mark.axis == "x" and f.log and v <= 0):
            continue
        p = f.x(v) if mark.axis == "x" else f.y(v)
        if mark.axis == "x":
            inside = f.left <= p <= f.right
            start, end = (p, f.right) if mark.beyond == "above" else (f.left, p)
            start, end = max(start, f.left), min(end, f.right)
            if mark.beyond and end > start:
                out.append(
                    f'<rect class="beyond" x="{start:.1f}" y="{f.top}" width="{end - start:.1f}" '
                    f'height="{f.bottom - f.top}"/>'
                )
            if inside:
                start = f.words if plot.y_names else f.top
                out.append(f'<path class="mark" d="M{p:.1f} {start}V{f.bottom}"/>')
                late = p > 0.62 * f.right
                out.append(
                    _text(
                        p + (-4 if late else 4),
                        f.words + 12 + 14 * (shown % 4),
                        mark.words,
                        "end" if late else "start",
                        ' class="note"',
                    )
                )
                shown += 1
        elif f.top <= p <= f.bottom:
            out.append(
                f'<path class="mark" d="M{f.left} {p:.1f}H{f.right}"/>'
                + _text(f.right - 4, p - 4, mark.words, "end", ' class="note"')
            )
    return "".join(out)


def _key(i: int, trace: Trace) -> str:
    if trace.points:
        swatch = _marker(trace.shape, 12, 9, trace.colour)
    else:
        dash = f' stroke-dasharray="{trace.dash}"' if trace.dash else ""
        swatch = f'<path d="M1 9H23" stroke="{trace.colour}" stroke-width="2.6"{dash}/>'
    return (
        f'<button type="button" class="key" data-t="{i}" aria-pressed="true"><svg width="24" height="18" '
        f'aria-hidden="true">{swatch}</svg>{html.escape(trace.name[:60])}</button>'
    )


def figure(plot: Plot) -> str:
    """Draw a plot.

    Examples
    --------
    >>> figure(Plot("t", "x [m]", "y [N]", [Trace("a", [1.0], [float("nan")])]))
    ''
    >>> "</svg>" in figure(Plot("t", "x [m]", "y [N]", [Trace("a", [1.0, 2.0], [3.0, 4.0])]))
    True
    """
    traces: list[dict[str, Any]] = []
    for trace in plot.traces:
        n = min(len(trace.x), len(trace.y))
        x, y = [_number(v) for v in trace.x[:n]], [_number(v) for v in trace.y[:n]]
        u = [_number(v) for v in trace.u[:n]] if trace.u is not None else []
        u += [math.nan] * (n - len(u))
        if any(not math.isnan(a + b) for a, b in zip(x, y, strict=True)):
            traces.append({"trace": trace, "x": x, "y": y, "u": u, "horizontal": trace.horizontal})
    if not traces:
        return ""
    width = WIDE if plot.wide else WIDTH
    height = 76 + 40 * len(plot.y_names) + 14 * len(plot.marks) if plot.y_names else HEIGHT
    f = _Frame(plot, traces, width, 120 if plot.y_names else LEFT, height)
    if not plot.y_names:  # room for long numbers
        f.left = max(LEFT, 34 + 8 * max(len(_tick(v)) for v in ticks(f.y0, f.y1)))
    drawn = "".join(f'<g class="trace" data-t="{i}">{_draw(t, f)}</g>' for i, t in enumerate(traces))
    data = {
        "x": [f.x0, f.x1, f.left, f.right],
        "y": [f.y0, f.y1, f.bottom, f.top],
        "log": f.log,
        "xl": plot.x_label,
        "yl": plot.y_label,
        "rows": list(plot.y_names),
        "t": [
            {
                "n": t["trace"].name,
                "x": _short(t["x"]),
                "y": _short(t["y"]),
                "u": _short(t["u"]) if any(not math.isnan(v) for v in t["u"]) else [],
                "l": [str(w)[:200] for w in t["trace"].labels],
                "h": t["horizontal"],
            }
            for t in traces
        ],
    }
    blob = html.escape(json.dumps(plain(data), ensure_ascii=True, allow_nan=False, separators=(",", ":")))
    keys = "".join(_key(i, t["trace"]) for i, t in enumerate(traces)) if len(traces) > 1 else ""
    keys = f'<div class="keys">{keys}</div>' if keys else ""
    title = html.escape(plot.title)
    note = f"<p>{html.escape(plot.note)}</p>" if plot.note else ""
    kind = ' class="plot wide"' if plot.wide else ' class="plot"'
    slug = re.sub(r"[^a-z0-9]+", "-", plot.title.lower()).strip("-")[:60]
    save = f'<button type="button" class="csv" data-name="{slug}" hidden>CSV</button>'  # shown where scripts run
    return (
        f'<figure{kind}><figcaption>{title}</figcaption><div class="canvas"><svg viewBox="0 0 {width} {height}" '
        f'role="img" aria-label="{title}" data-plot="{blob}">{_axes(plot, f, width, height)}'
        f'<g class="marks">{_marks(plot, f)}</g>{drawn}<circle class="here" r="7"/></svg><div class="tip" hidden></div>'
        f"</div>{keys}{note}{save}{_values(plot, traces)}</figure>"
    )


def _short(values: Sequence[float]) -> list[Any]:
    return [None if math.isnan(v) else float(f"{v:.6g}") for v in values]


def _values(plot: Plot, traces: Sequence[dict[str, Any]]) -> str:
    """Give the same numbers as a table, for readers without a pointer."""
    rows = []
    for t in traces:
        for i, (x, y, u) in enumerate(zip(t["x"], t["y"], t["u"], strict=True)):
            if math.isnan(x + y):
                continue
            k = round(y)
            row = plot.y_names[k] if plot.y_names and 0 <= k < len(plot.y_names) else number_text(y, 5)
            word = str(t["trace"].labels[i])[:200] if i < len(t["trace"].labels) else ""
            cells = (t["trace"].name[:60], number_text(x, 5), row, number_text(u, 3), word)
            rows.append("<tr>" + "".join(f"<td>{html.escape(c)}</td>" for c in cells) + "</tr>")
    head = "".join(f"<th>{html.escape(w)}</th>" for w in ("source", plot.x_label, plot.y_label or "row", "± u", ""))
    return (
        f'<details class="values"><summary>Values</summary><div class="scroll"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div></details>"
    )
