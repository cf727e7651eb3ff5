"""The posterior of the parameters of the leading explanation, beside their prior ranges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.canvas import BLACK, BLUE, GREY, ORANGE, SKY, blank
from bemt.judge.diagnose import fit
from bemt.judge.diagnose.signatures import effect_of
from bemt.judge.explanation import Explanation, Size

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bemt.judge.diagnose.answer import Diagnosis
    from bemt.judge.diagnose.signatures import Candidate

_LEAST = 0.1  # probability from which the size of an effect is drawn [1]
_MOST_PANELS, _MOST_BARS = 6, 6


@dataclass(frozen=True, eq=False)
class _Panel:
    """Numbers or words of one effect: no key is a bar per setting, one an interval, two a map."""

    candidate: Candidate
    p: Array
    keys: tuple[str, ...]
    intervals: Mapping[str, Size]

    def values(self, key: str) -> Array:
        return np.array([float(s[key]) for s in self.candidate.settings])

    def words(self) -> list[str]:
        """Per setting what is not a number of the panel's own, in words."""
        own = {k for k in _keys(self.candidate) if _numeric(self.candidate, k)} if self.keys else set()
        return [_words({k: v for k, v in s.items() if k not in own}) for s in self.candidate.settings]

    def range(self, key: str) -> tuple[float, float]:
        """Prior range of a parameter."""
        x = self.values(key)
        return float(x.min()), float(x.max())

    def label(self, key: str) -> str:
        known = {q.name: q.unit for q in type(effect_of(self.candidate.id, self.candidate.settings[0])).parameters}
        return f"{self.candidate.id}: {key} [{known.get(key, '1')}]"


def _keys(candidate: Candidate) -> list[str]:
    return list(dict.fromkeys(k for s in candidate.settings for k in s))


def _numeric(candidate: Candidate, key: str) -> bool:
    return all(isinstance(s.get(key), (int, float)) for s in candidate.settings)


def _words(setting: dict[str, Any]) -> str:
    return ", ".join(f"{k} {v:.4g}" if isinstance(v, float) else str(v) for k, v in setting.items())


def posterior(answer: Diagnosis) -> Figure | None:
    """Draw one panel per parameter, or a map of two."""
    likely = max((answer.found.inclusion[i] for i in answer.best.ids), default=0.0) >= _LEAST
    if not answer.best.ids or not (likely or set(answer.best.ids) & set(answer.decision.effects)):
        return None
    panels = []
    for i, p in fit.weights(answer.found, Explanation.of(*answer.best.ids)).items():
        panels += _panels(answer.found.of(i), p, answer.parameters.get(i, {}))
    panels = panels[:_MOST_PANELS]
    if not panels:
        return None
    columns = min(len(panels), 2 if len(panels) in (2, 4) else 3)
    rows = -(-len(panels) // columns)
    height = 1.9 if all(len(panel.keys) == 1 for panel in panels) else 3.1
    figure, axes = blank(0.4 + height * rows, rows, columns)
    for axis, panel in zip(axes.ravel(), panels, strict=False):
        (_bars, _interval, _map)[len(panel.keys)](axis, panel)
    for axis in axes.ravel()[len(panels) :]:
        axis.set_visible(False)
    return figure


def _panels(candidate: Candidate, p: Array, intervals: Mapping[str, Size]) -> list[_Panel]:
    if len(candidate.settings) < 2:
        return []
    numbers = [k for k in _keys(candidate) if _numeric(candidate, k)]
    numbers = [k for k in numbers if len({s[k] for s in candidate.settings}) >= 3]
    words = {_words({k: v for k, v in s.items() if k not in numbers}) for s in candidate.settings}
    if not numbers or len(words) * 2 > len(candidate.settings):
        return [_Panel(candidate, p, (), intervals)]
    sizes = [len({s[k] for s in candidate.settings}) for k in numbers]
    if len(numbers) == 2 and len(words) == 1 and sizes[0] * sizes[1] == p.size:
        return [_Panel(candidate, p, tuple(numbers), intervals)]
    return [_Panel(candidate, p, (k,), intervals) for k in numbers]


def _bars(axis: Axes, panel: _Panel) -> None:
    words = panel.words()
    total = {w: sum(float(q) for v, q in zip(words, panel.p, strict=True) if v == w) for w in words}
    top = sorted(total, key=lambda w: -total[w])[:_MOST_BARS]
    top = [w for w in top if total[w] >= 0.005]
    bars = axis.barh(range(len(top)), [total[w] for w in top], color=BLUE, height=0.6)
    axis.bar_label(bars, fmt="%.2f", padding=3, fontsize=8)
    axis.axvline(1.0 / len(total), color=GREY, linestyle=":", label="prior")
    axis.set_yticks(range(len(top)), top)
    axis.invert_yaxis()
    axis.set(xlim=(0, 1.15), xlabel=f"{panel.candidate.id}: probability [1]")
    axis.legend(loc="lower right")


def _interval(axis: Axes, panel: _Panel) -> None:
    """The value and its 90 % interval as the answer states them, above where it was thought to lie before."""
    key = panel.keys[0]
    x = panel.values(key)
    order = np.argsort(x, kind="stable")
    weight = panel.candidate.weight[order] / panel.candidate.weight.sum()
    before = np.interp([0.05, 0.95], np.cumsum(weight) - 0.5 * weight, x[order])
    axis.plot(before, [0.0, 0.0], color=GREY, alpha=0.5, linewidth=9.0, solid_capstyle="butt", label="before, 90 %")
    told = panel.intervals.get(key)
    if told and isinstance(told.value, int | float):
        axis.plot([told.low, told.high], [1.0, 1.0], color=BLUE, linewidth=5.0, solid_capstyle="butt",
                  label="with the readings, 90 %")  # fmt: skip
        axis.plot(told.value, 1.0, "o", color=BLACK, markersize=7, zorder=3, label="value")
        unit = panel.label(key).rpartition("[")[2].rstrip("]")
        unit = "" if unit in ("", "1") else f" {unit}"
        words = f"{told.value:.3g} ({told.low:.3g} to {told.high:.3g}){unit}"
        axis.set_title(words)
    axis.set(ylim=(-0.7, 2.6), yticks=[], xlabel=panel.label(key))
    axis.spines["left"].set_visible(False)
    axis.margins(x=0.08)
    axis.locator_params(axis="x", nbins=5)
    axis.legend(loc="upper center", ncols=2, columnspacing=1.0, handlelength=1.6)


def _map(axis: Axes, panel: _Panel) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    a, b = panel.keys
    x, y = panel.values(a), panel.values(b)
    gx, gy = np.unique(x), np.unique(y)
    table = np.zeros((gy.size, gx.size))
    np.add.at(table, (np.searchsorted(gy, y), np.searchsorted(gx, x)), panel.p)
    colours = LinearSegmentedColormap.from_list("posterior", ["#ffffff", SKY, BLUE])
    axis.pcolormesh(gx, gy, table, cmap=colours, shading="nearest", vmin=0.0)
    order = np.sort(table.ravel())[::-1]
    level = float(order[min(int(np.searchsorted(np.cumsum(order), 0.9)), order.size - 1)])
    if order[-1] < level < order[0]:
        axis.contour(gx, gy, table, levels=[level], colors=[BLACK], linewidths=1.0)
        axis.plot([], [], color=BLACK, linewidth=1.0, label="90 % region")
    for k, key in enumerate((a, b)):
        inside, (low, high) = panel.intervals.get(key), panel.range(key)
        mark = axis.axvline if k == 0 else axis.axhline
        if inside:  # a bar at the edge of the panel, so that the map keeps its colours
            ends, edge = [inside.low, inside.high], [0.99 if k == 0 else 0.005] * 2
            frame = axis.get_xaxis_transform() if k == 0 else axis.get_yaxis_transform()
            axis.plot(*((ends, edge) if k == 0 else (edge, ends)), color=ORANGE, linewidth=5.0, transform=frame,
                      solid_capstyle="butt", label="90 % interval of one" if k == 0 else None)  # fmt: skip
        for end in (low, high):
            mark(end, color=GREY, linestyle=":", linewidth=1.2, label="prior range" if k == 0 and end == low else None)
    axis.set(xlabel=panel.label(a), ylabel=panel.label(b))
    axis.locator_params(axis="x", nbins=5)
    axis.legend(loc="upper right", frameon=True, framealpha=0.85, edgecolor="none")
