"""Figures of a diagnosis: where the mismatch sits, what explains it, what cannot be told apart."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.canvas import BLACK, BLUE, DPI, GREEN, GREY, ORANGE, PURPLE, RED, SKY, STYLE, blank, png
from bemt.base.page import FIRST
from bemt.base.tables import write_atomic
from bemt.judge.compare.first_picture import LABEL, PredictionView, against_band
from bemt.judge.diagnose import figures_effects
from bemt.judge.diagnose.answer import CHANNEL_WORDS, VARIABLES, Diagnosis
from bemt.judge.diagnose.document import headline
from bemt.judge.diagnose.record import CHANNELS, Record
from bemt.judge.loss import CLAIMS
from bemt.physics.dataset import Dataset

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bemt.rotors.case import Case

Index = NDArray[np.intp]

NAMES = ("residual", "before_after", "posterior", "radius", "confusion", "ranking")
"""Stems of the files, after the first picture."""

LARGEST = 120_000
"""Largest file that is written [B]; a larger one loses colours."""

_COEFFICIENT = {"thrust_N": LABEL["CT"], "torque_Nm": LABEL["CP"], "rpm": "rpm [rev/min]"}
_AXIS = {name: f"{words} [{unit.strip() or '1'}]" for name, (words, unit, _) in VARIABLES.items()} | {
    "J": "advance ratio J [1]", "Re": "Reynolds number at 0.75 R [1]", "density_kg_m3": "density [kg/m³]", "run": "run"
}  # fmt: skip
_CONDITIONS = ("J", "rpm", "M_tip", "Re", "density_kg_m3")
# Most panels, fewest points of a curve, and how far advance ratios of one line are apart.
_MOST_LINES, _LONG, _ONE_J = 4, 3, 0.02
_BOLD = 3.0  # width of a line in the located region
_SHADES = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY, BLACK)


def draw(answer: Diagnosis, out: Path, cases: Sequence[Case] = ()) -> list[Path]:
    """Draw all figures that have something to show; with its cases, the recording inside their band comes first."""
    import matplotlib

    makers: dict[str, Callable[[Diagnosis], Figure | None]] = {
        "residual": residual, "before_after": _before_after, "posterior": figures_effects.posterior,
        "radius": figures_effects.radius, "confusion": figures_effects.matrix, "ranking": figures_effects.ranking,
    }  # fmt: skip
    written = []
    for old in out.glob(f"{FIRST}*.png"):
        old.unlink()
    records = [part.record for part in answer.problem.parts if not part.record.reference]
    for view in first_picture(records, cases) if len(cases) in (1, len(records)) else ():
        stem = FIRST if len({c.path.resolve() for c in cases}) == 1 else f"{FIRST}_{view.case}"
        written.append(out / f"{stem}.png")
        write_atomic(written[-1], slim(view.png()))
    with matplotlib.rc_context(STYLE):
        for name in NAMES:
            figure = makers[name](answer)
            for kind in ("png", "svg"):  # earlier versions wrote both
                (out / f"{name}.{kind}").unlink(missing_ok=True)
            if figure is not None:
                written.append(out / f"{name}.png")
                write_atomic(written[-1], slim(png(figure, DPI, optimize=True)))
    return written


def slim(whole: bytes) -> bytes:
    """PNG with fewer colours until it is small enough."""
    from PIL import Image

    small = whole
    for colours in (256, 64, 16):
        if len(small) <= LARGEST:
            break
        page = io.BytesIO()
        with Image.open(io.BytesIO(whole)) as image:
            image.convert("RGB").quantize(colours).save(page, format="png", optimize=True)
        small = page.getvalue()
    return small


def _title(text: str, columns: int) -> str:
    """Words in lines that fit over one of so many panels."""
    width = 96 // columns
    parts = [text] if len(text) <= width else text.rsplit(", ", 1)  # the recording, then what was held
    return "\n".join("\n".join(textwrap.wrap(part, width, max_lines=2, placeholder=" …")) for part in parts)


def _varies(x: Array) -> bool:
    return bool(np.ptp(x) > 0.02 * max(float(np.max(np.abs(x))), 1e-12))


def _channels(answer: Diagnosis) -> list[int]:
    return [int(c) for c in np.unique(answer.problem.channel)]


def _across(answer: Diagnosis) -> str:
    """Covariate to draw over: that of the mismatch if it is no condition, else the first that varies in the test."""
    X, where = answer.problem.covariates, answer.marked
    if where is not None and where.variable in X and where.variable not in _CONDITIONS:
        return where.variable
    judged = np.unique(answer.problem.point[answer.problem.free])
    return next(
        (name for name in dict.fromkeys((*_CONDITIONS, *_AXIS)) if name in X and _varies(X[name][judged])), "rpm"
    )


def _lines(x: Array) -> Index:
    """Line of each point: values closer than 3 % are one, a range without gaps is cut into equal counts."""
    order = np.argsort(x, kind="stable")
    size = max(float(np.max(np.abs(x))), 1e-12)
    step = np.diff(x[order]) > 0.03 * np.maximum(np.abs(x[order][1:]), 1e-3 * size)
    line = np.empty(x.size, dtype=np.intp)
    line[order] = np.cumsum(np.r_[0, step])
    if any(np.ptp(x[line == k]) > 0.1 * size for k in np.unique(line)):
        line[order] = np.arange(x.size) * 3 // x.size
    return line


# Residual


def residual(answer: Diagnosis) -> Figure:
    """Draw where recording and baseline differ, as a map or along one variable."""
    X, where = answer.problem.covariates, answer.marked
    x = _across(answer)
    y = where.variable if where is not None and where.variable in ("M_tip", "Re") else "rpm"
    judged = np.unique(answer.problem.point[answer.problem.free])
    if x == "J" and _varies(X["rpm"][judged]):
        return _map(answer, x, y)
    return _strip(answer, y if x in ("rpm", "M_tip", "Re") else x)


def _shares(answer: Diagnosis, c: int) -> tuple[NDArray[np.bool_], Array]:
    """Readings of a channel that are judged, and what the heading is the mean of: the located mismatch, if any."""
    problem, where = answer.problem, answer.marked
    here = (problem.channel == c) & problem.free
    d = problem.y - problem.f0 if where is None else where.mismatch
    return here, 100.0 * (d / problem.largest)[here]


def _shown(answer: Diagnosis) -> str:
    calibration = "" if answer.marked is None else " − calibration"
    return f"recording − baseline{calibration}\n[% of the largest]"


def _located(answer: Diagnosis, c: int, name: str) -> tuple[float, float] | None:
    """Located interval of a covariate in a channel, with half a gap to the next points on either side."""
    where = answer.marked
    if where is None or where.channel != CHANNELS[c] or where.variable != name:
        return None
    problem = answer.problem
    values = np.unique(problem.covariates[name][problem.point[problem.channel == c]])
    below, above = values[values < where.low], values[values > where.high]
    least = 0.05 * float(np.ptp(values))
    low = where.low - (max(0.4 * (where.low - below[-1]), 0.25 * least) if below.size else least)
    high = where.high + (max(0.4 * (above[0] - where.high), 0.25 * least) if above.size else least)
    return float(low), float(high)


def _heading(answer: Diagnosis, c: int, region: bool) -> str:
    text, where = CHANNEL_WORDS[CHANNELS[c]], answer.marked
    if region and where is not None:
        text += f": mean {100.0 * where.size:+.1f} % of the largest, in the marked region"
    return text


def _map(answer: Diagnosis, x: str, y: str) -> Figure:
    """One line over x for each group of y, so that a trend of either is seen at once."""
    from matplotlib.lines import Line2D

    problem, channels = answer.problem, _channels(answer)
    figure, axes = blank(4.3, 1, len(channels), sharex=True, sharey=True)
    judged = np.unique(problem.point[problem.free])
    line = np.full(problem.covariates[y].size, -1)
    line[judged] = _lines(problem.covariates[y][judged])
    groups = list(np.unique(line[judged]))
    while len(groups) > len(_SHADES):  # neighbours together
        line[np.isin(line, groups)] //= 2
        groups = list(np.unique(line[judged]))
    for axis, c in zip(axes[0], channels, strict=True):
        here, e = _shares(answer, c)
        at = problem.point[here]
        axis.axhline(0.0, color=GREY, linewidth=0.8)
        along, across = (_located(answer, c, n) for n in (x, y))
        if along:
            axis.axvspan(*along, facecolor=ORANGE, alpha=0.25, edgecolor="none", zorder=1)
        for k, colour in zip(groups, _SHADES, strict=False):
            own = line[at] == k
            if not own.any():
                continue
            value = problem.covariates[y][at][own]
            inside = across is not None and bool(np.all((value >= across[0]) & (value <= across[1])))
            curve = _curve(problem.covariates[x][at][own], e[own])
            axis.plot(problem.covariates[x][at][own], e[own], ".", color=colour, markersize=4)
            axis.plot(*curve, color=colour, linewidth=_BOLD if inside else 1.5, label=_label(y, value))
        axis.set(title=_title(_heading(answer, c, bool(along or across)), len(channels)), xlabel=_AXIS.get(x, x))
        axis.margins(0.05)
    axes[0, 0].set_ylabel(_shown(answer))
    handles, labels = axes[0, 0].get_legend_handles_labels()
    if any(drawn.get_linewidth() == _BOLD for axis in axes[0] for drawn in axis.lines):
        handles.append(Line2D([], [], color=GREY, linewidth=_BOLD))
        labels.append("bold: the marked region")
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def _strip(answer: Diagnosis, name: str) -> Figure:
    problem, channels = answer.problem, _channels(answer)
    figure, axes = blank(3.4, 1, len(channels), sharex=True)
    factor = answer.found.states[0].hyper.scale
    for axis, c in zip(axes[0], channels, strict=True):
        here, e = _shares(answer, c)
        x = problem.covariates[name][problem.point[here]]
        span = _located(answer, c, name)
        if span is not None:
            axis.axvspan(*span, facecolor=ORANGE, alpha=0.25, edgecolor="none")
        axis.axhline(0.0, color=GREY, linewidth=0.8)
        u = 100.0 * factor * (problem.u / problem.largest)[here]
        axis.errorbar(x, e, u, fmt="o", color=BLUE, markersize=4, elinewidth=1.0)
        axis.set(title=_title(_heading(answer, c, span is not None), len(channels)), xlabel=_AXIS.get(name, name))
    axes[0, 0].set_ylabel(_shown(answer))
    return figure


# Before and after


class _Line(NamedTuple):
    """Points to draw in one panel."""

    words: str  # What else was held
    points: NDArray[np.bool_]
    recording: int
    over: str  # Covariate of the abscissa


def _groups(answer: Diagnosis, name: str) -> list[_Line]:
    """Lines of points to draw over a covariate; of advance ratios with too few of its points, over the speed."""
    problem = answer.problem
    X, P = problem.covariates, problem.covariates["rpm"].size
    part = np.concatenate([np.full(len(p.record), i) for i, p in enumerate(problem.parts)])
    held = next((n for n in ("rpm", "J") if n != name and _varies(X[n])), "")
    found = []
    for i, p in enumerate(problem.parts):
        if name not in (*_CONDITIONS, *p.record.extra):
            continue  # a reference without it
        mine = part == i
        tag = p.record.name if len(problem.parts) > 1 else ""
        line = np.zeros(P, dtype=np.intp)
        if held and _varies(X[held][mine]):
            line[mine] = _lines(X[held][mine])
        own = [mine & (line == k) for k in np.unique(line[mine])]
        sweeps = _sweeps(X, mine, own) if name == "J" else []
        drawn = np.any([np.zeros(P, dtype=bool), *sweeps], axis=0)
        own = [here for here in own if _count(X[name][here]) >= _LONG or not drawn[here].all()]
        for over, what, lines in ((name, held, own), ("rpm", "J", sweeps)):
            for here in lines:
                words = [tag, _label(what, X[what][here]) if what else ""]
                found.append(_Line(", ".join(filter(None, words)), here, i, over))
    return found


def _sweeps(X: dict[str, Array], mine: NDArray[np.bool_], lines: list[NDArray[np.bool_]]) -> list[NDArray[np.bool_]]:
    """Points of a recording at one advance ratio and many speeds, which are no line over the advance ratio."""
    J = X["J"]
    rest = np.any([here for here in lines if _count(J[here]) < _LONG] or [np.zeros_like(mine)], axis=0)
    if not rest.any():
        return []
    line = np.full(J.size, -1)
    line[rest] = _lines(J[rest])
    found = []
    for k in np.unique(line[rest]):
        low, high = float(J[line == k].min()), float(J[line == k].max())
        here = mine & (low <= J) & (high >= J)
        if high - low <= _ONE_J and _count(X["rpm"][here]) >= _LONG:
            found.append(here)
    return found


def _count(x: Array) -> int:
    return int(np.unique(x.round(12)).size)


def _chosen(parts: list[int], sizes: list[int]) -> list[int]:
    """Lines to show of recordings and positions: long ones evenly picked, and one of each recording that has none."""
    long = [i for i, size in enumerate(sizes) if size >= _LONG]
    own = {p: max((i for i, q in enumerate(parts) if q == p), key=lambda i: sizes[i]) for p in dict.fromkeys(parts)}
    lone = [i for p, i in own.items() if all(parts[k] != p for k in long)][:_MOST_LINES]
    room = _MOST_LINES - len(lone)
    picked = [long[i] for i in np.unique(np.linspace(0, len(long) - 1, room).round().astype(int))] if long else []
    return sorted({*picked, *lone})


def _label(name: str, x: Array) -> str:
    unit, digits = (" rev/min", 0) if name == "rpm" else ("", 0 if name == "Re" else 2)
    lead = "" if name == "rpm" else f"{name} = "
    if np.ptp(x) <= 0.1 * float(np.max(np.abs(x))):
        return f"{lead}{float(np.mean(x)):.{digits}f}{unit}"
    return f"{lead}{float(x.min()):.{digits}f} to {float(x.max()):.{digits}f}{unit}"


def _coefficients(answer: Diagnosis) -> Array:
    """Factor of every reading that makes it CT or CP; 1 for the speed of rotation."""
    problem, out = answer.problem, []
    for p in problem.parts:
        f, D = p.flow, 2.0 * p.flow.R
        unit = {"thrust_N": 1.0 / (f.rho * f.n**2 * D**4), "torque_Nm": 2.0 * np.pi / (f.rho * f.n**2 * D**5)}
        out += [unit.get(c, np.ones_like(f.rho)) for c in p.channels]
    return np.concatenate(out)[problem.kept]


def _before_after(answer: Diagnosis) -> Figure:
    problem, channels = answer.problem, _channels(answer)
    groups = _groups(answer, _across(answer))
    sizes = [_count(problem.covariates[g.over][g.points]) for g in groups]
    shown = [groups[i] for i in _chosen([g.recording for g in groups], sizes)]
    height = 0.9 + 2.2 * len(channels)
    figure, axes = blank(height, len(channels), len(shown), sharex="col", sharey="row")
    unit, factor = _coefficients(answer), answer.found.states[0].hyper.scale
    what = " and ".join([" + ".join(answer.best.ids), "calibration"]).removeprefix(" and ")
    everywhere = np.ones_like(problem.free)
    fitted = "improved" if answer.decision.verdict in CLAIMS else "best fit, not confirmed"
    models = (
        ("baseline", problem.f0, RED, "--", everywhere),
        (f"{fitted} ({what})", answer.after, BLUE, "-", everywhere),
        # a reference is never held out
        (f"the same, {answer.blocks} held out", answer.held, GREEN, ":", problem.free),
    )
    for row, c in zip(axes, channels, strict=True):
        for axis, line in zip(row, shown, strict=True):
            here = (problem.channel == c) & line.points[problem.point]
            x = problem.covariates[line.over][problem.point]
            u = (factor * problem.u * unit)[here]
            axis.errorbar(x[here], (problem.y * unit)[here], u, fmt="o", color=BLACK, markersize=3, elinewidth=0.8,
                          label="recording, standard uncertainty", zorder=2)  # fmt: skip
            for words, model, colour, style, told in models:
                curve = _curve(x[here & told], (model * unit)[here & told])
                single = "_" if curve[0].size == 1 else ""
                axis.plot(*curve, style, color=colour, label=words, zorder=3, marker=single, markersize=14)
            if c == channels[0]:
                axis.set_title(_title(line.words, len(shown)))
                axis.margins(x=0.08)
            if c == channels[-1]:
                axis.set_xlabel(_AXIS.get(line.over, line.over))
                if len(shown) > 2:
                    axis.locator_params(axis="x", nbins=4)
        row[0].set_ylabel(_COEFFICIENT[CHANNELS[c]])
    _one_range(axes[0], [line.over for line in shown])
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    some = f" ({len(shown)} of {len(groups)} series shown)" if len(shown) < len(groups) else ""
    figure.suptitle(textwrap.fill(f"{headline(answer)}{some}", 100), fontsize=9)
    return figure


def _one_range(axes: NDArray[Any], over: list[str]) -> None:
    """Panels over the same covariate from and to the same value."""
    for name in dict.fromkeys(over):
        same = [axis for axis, own in zip(axes, over, strict=True) if own == name]
        ends = np.array([axis.get_xlim() for axis in same])
        for axis in same:
            axis.set_xlim(ends[:, 0].min(), ends[:, 1].max())


def _curve(x: Array, y: Array) -> tuple[Array, Array]:
    """Means of y over equal x, in the order of x."""
    if not x.size:
        return x, y
    order = np.argsort(x, kind="stable")
    step = np.diff(x[order]) > 5e-3 * max(float(np.ptp(x)), 1e-12)
    group = np.cumsum(np.r_[0, step])
    count = np.bincount(group)
    return np.bincount(group, x[order]) / count, np.bincount(group, y[order]) / count


# The first picture of a diagnosis: what was recorded, inside the prediction band of its case.
def points_of(record: Record) -> Dataset:
    """Give the points of a record, with their loads and what these are uncertain by."""
    loads = [c for c in ("thrust_N", "torque_Nm") if c in record.measured]
    rho = np.broadcast_to(np.asarray(record.air.rho, dtype=float), record.rpm.shape)
    state = {"rpm": record.rpm, "airspeed_m_s": record.V, "density_kg_m3": rho}
    values = state | {c: record.measured[c] for c in loads}
    first, *more = record.name.split(", ")  # a legend has no room for several
    name = f"{first} and {len(more)} more" if more else first
    return Dataset("points", name, values, {c: record.u[c] for c in loads})


def first_picture(records: Sequence[Record], cases: Sequence[Case]) -> list[PredictionView]:
    """Put records beside their cases, one view a case; ``cases`` are one for all records, or one for each."""
    each = list(cases) * len(records) if len(cases) == 1 else list(cases)
    groups: dict[str, tuple[Case, list[Record]]] = {}
    for record, case in zip(records, each, strict=True):
        groups.setdefault(str(case.path.resolve()), (case, []))[1].append(record)
    views = []
    for case, own in groups.values():
        view, bare = against_band(case, list(map(points_of, own))), [r.name for r in own if not r.air_recorded]
        some = f" in {' and '.join(bare)}" if len(bare) < len(own) else ""
        told = [f"No density recorded{some}: {case.air().rho:.4g} kg/m³, that of the case."] if bare else []
        views.append(replace(view, notes=(*told, *view.notes)))
    return views
