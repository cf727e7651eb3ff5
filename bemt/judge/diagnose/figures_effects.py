"""What an effect does on the blade, which effects look alike, how probable they and their parameters are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np

from bemt.base.arrays import Array
from bemt.base.canvas import BLACK, BLUE, GREY, ORANGE, PURPLE, RED, SKY, blank
from bemt.judge.diagnose import form
from bemt.judge.diagnose.fit import fit, weights
from bemt.judge.diagnose.record import CHANNELS
from bemt.judge.diagnose.signatures import Candidate, Setting, effect_of
from bemt.judge.explanation import NONE, Explanation, Size
from bemt.physics.bem import model as bem
from bemt.physics.bem import solver

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bemt.judge.diagnose.answer import Diagnosis
    from bemt.physics.air import Air

_MOST_EFFECTS, _MOST_BARS = 10, 8
# Probability below which an explanation is summed up with others.
_LEAST_BAR = 0.01
# Probability of an explanation from which its effects lead the ranking.
_LEADING = 0.05


def _representative(answer: Diagnosis) -> int:
    """Reading of median signature among those of the located region."""
    problem, where = answer.problem, answer.marked
    size = np.abs(answer.best.signature / problem.scale)
    inside = np.isfinite(size)
    if where is not None:
        x = problem.covariates[where.variable][problem.point]
        inside &= (problem.channel == CHANNELS.index(where.channel)) & (x >= where.low) & (x <= where.high)
    rows = np.flatnonzero(inside)
    return int(rows[np.argsort(size[rows], kind="stable")[rows.size // 2]])


def blade_loads(answer: Diagnosis) -> tuple[int, Array, Array, Array] | None:
    """Loads along the blade without and with what was found, where the effect acts on the rotor."""
    best, problem = answer.best, answer.problem
    extra = [effect_of(i, s) for i, s in zip(best.ids, best.settings, strict=True)]
    extra = [e for e in extra if e.kind == "air" and bem.acts_on_rotor(e)]
    if not extra:
        return None
    reading = _representative(answer)
    part = problem.parts[problem.part[reading]]
    point = int(problem.point[reading] - sum(len(p.record) for p in problem.parts[: problem.part[reading]]))
    ids = {e.id for e in extra}
    curves = []
    for chosen in (part.baseline, (*(e for e in part.baseline if e.id not in ids), *extra)):
        met = replace(part.flow, **{k: getattr(part.flow, k).copy() for k in ("rpm", "V", "rho", "mu", "a_sound")})
        for e in chosen:
            e.flow(met)
        shares = [s for e in chosen if (s := e.share(met)) is not None]
        prep = part.model.prepared(chosen, float(shares[-1][point]) if shares else 1.0)
        air = cast("Air", SimpleNamespace(rho=met.rho[point], mu=met.mu[point], a_sound=met.a_sound[point]))
        s = solver.solve(prep, met.rpm[point], met.V[point], air, radial=True)
        if not s.converged.all():
            return None
        curves.append([getattr(s.radial, k)[0] / prep.stations.dr for k in ("dT", "dQ")])
    return reading, s.radial.r[0], prep.stations.dr, np.array(curves)


def radius(answer: Diagnosis) -> Figure | None:
    """Draw what the effect changes along the blade."""
    found = blade_loads(answer)
    if found is None:
        return None
    reading, r, _, curves = found
    problem = answer.problem
    x = r / problem.parts[problem.part[reading]].flow.R
    figure, axes = blank(4.6, 2, 2, sharex=True, height_ratios=(3, 2))
    units = (("dT/dr [N/m]", "change of dT/dr [N/m]"), ("dQ/dr [N]", "change of dQ/dr [N]"))
    for (top, bottom), (before, after), unit in zip(axes.T, curves.swapaxes(0, 1), units, strict=True):
        top.plot(x, before, "--", color=RED, label="baseline")
        top.plot(x, after, color=BLUE, label="with " + " + ".join(answer.best.ids))
        bottom.axhline(0.0, color=GREY, linewidth=0.8)
        bottom.fill_between(x, after - before, color=SKY, alpha=0.6, linewidth=0)
        bottom.plot(x, after - before, color=BLUE)
        top.set_ylabel(unit[0])
        bottom.set(ylabel=unit[1], xlabel="r/R [1]")
    at = {k: float(problem.covariates[k][problem.point[reading]]) for k in ("rpm", "J", "M_tip")}
    figure.suptitle(
        f"All blades at {at['rpm']:.0f} rev/min, J = {at['J']:.2f}, tip Mach number {at['M_tip']:.2f}", fontsize=9
    )
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _likely(answer: Diagnosis) -> dict[str, float]:
    """Effects of the ranking with the probability of the likeliest explanation that each is in, likeliest first."""
    share: dict[str, float] = {}
    for what, p in sorted(answer.found.probability.items(), key=lambda kv: -kv[1]):
        for i in what.ids & set(answer.found.spans):
            share.setdefault(i, p)
    return share


def _as_found(answer: Diagnosis) -> form.Confusion:
    """Distances, those of the leading effects that are too faint at usual strength at the strength that was found."""
    alike, found = answer.alike, answer.found
    sizes = dict(zip(alike.ids, alike.size, strict=True))
    faint = [i for i, p in _likely(answer).items() if p >= _LEADING and sizes.get(i, np.inf) < form.ALIKE]
    if not faint:
        return alike
    at = {i: fit(found, Explanation.of(i)).columns[0] - found.spans[i].start for i in faint}
    return form.confusion(found, at)


def matrix(answer: Diagnosis) -> Figure | None:
    """Draw what this plan cannot tell from each effect: the likely ones first, at the strength that was found."""
    alike, share = _as_found(answer), _likely(answer)
    seen = np.flatnonzero(alike.size >= form.ALIKE)
    if seen.size < 2:
        return None
    D = np.where(np.eye(len(alike.ids), dtype=bool), np.inf, np.minimum(alike.distance, alike.distance.T))
    near = D[np.ix_(seen, seen)].min(axis=1)
    order = sorted(range(seen.size), key=lambda k: (-round(share.get(alike.ids[seen[k]], 0.0), 3), near[k]))
    rows = [int(seen[k]) for k in order][:_MOST_EFFECTS]
    drawn = {alike.ids[i] for i in seen}
    hidden = [i for i, p in share.items() if p >= _LEADING and i not in drawn]
    usual = dict(zip(answer.alike.ids, answer.alike.size, strict=True))
    top = 4.0 * form.ALIKE
    figure, axes = blank(1.7 + 0.34 * len(rows), 1, 1)
    axis: Axes = axes[0, 0]
    axis.axvspan(0.0, form.ALIKE, facecolor=ORANGE, alpha=0.25, edgecolor="none")
    alone = 0
    for y, i in enumerate(rows):
        others = np.array([j for j in seen if j != i])
        d = D[i, others]
        twins = [alike.ids[j] for j in others[np.argsort(d, kind="stable")] if D[i, j] < form.ALIKE]
        alone += not twins
        axis.plot(np.minimum(d, top), np.full(d.size, y), "o", color=GREY, markersize=4, alpha=0.5)
        axis.plot(d[d < form.ALIKE], np.full(len(twins), y), "o", color=RED, markersize=7)
        colour = RED if twins else GREY
        axis.text(1.02, y, _told(twins), transform=axis.get_yaxis_transform(), va="center", color=colour)
    axis.set(xlim=(0.0, top * 1.02), xlabel="distance to every other effect [standard deviations]")
    axis.set_xticks([0.0, form.ALIKE, 6.0, 9.0, top], ["0", f"{form.ALIKE:g}", "6", "9", f"{top:g} or more"])
    as_found = {i: f"{i}, as found" for i, size in usual.items() if size < form.ALIKE}
    axis.set_yticks(range(len(rows)), [as_found.get(alike.ids[i], alike.ids[i]) for i in rows])
    axis.set_ylim(len(rows) - 0.5, -0.5)
    axis.tick_params(axis="y", length=0)
    axis.text(1.02, -0.75, "looks like", transform=axis.get_yaxis_transform(), va="bottom", weight="bold")
    told, more = "This plan tells all these effects apart", []
    if alone < len(rows):
        told = f"In this plan {len(rows) - alone} of {len(rows)} effects look like another"
        more = [f"red: closer than {form.ALIKE:g} standard deviations"]
    if seen.size > len(rows):
        more.append(f"{len(rows)} of {seen.size} effects are shown")
    faint = f"\nLikely, but too faint in this plan to be told from nothing: {', '.join(hidden)}" if hidden else ""
    figure.suptitle("\n".join(filter(None, (told, "; ".join(more)))) + faint, x=0.01, ha="left", fontsize=11)
    return figure


def _told(twins: list[str]) -> str:
    """Effects that one looks like, in a few words."""
    if not twins:
        return "told from all others"
    return ", ".join(twins[:2]) + (f" and {len(twins) - 2} more" if len(twins) > 2 else "")


def ranking(answer: Diagnosis) -> Figure:
    """Draw the explanations by their probability; they add up to 100 %."""
    found = answer.found
    order = sorted(found.probability, key=lambda k: -found.probability[k])
    chosen = set(answer.decision.effects)
    names = [k for k in order[:_MOST_BARS] if found.probability[k] >= _LEAST_BAR]
    rest = [k for k in order if k not in names]

    def colour(what: Explanation) -> str:
        if not what:
            return GREY if what == NONE else PURPLE
        return BLUE if chosen & what.ids else SKY

    labels = [" + ".join(k) or {NONE: "nothing"}.get(k, "none of the known") for k in names]
    shares = [100.0 * found.probability[k] for k in names]
    tint = [colour(k) for k in names]
    if rest:
        labels.append(f"{len(rest)} other{'s' if len(rest) > 1 else ''}, together")
        shares.append(100.0 * sum(found.probability[k] for k in rest))
        tint.append("#d9d9d9")
    figure, axes = blank(1.6 + 0.36 * len(labels), 1, 1)
    axis: Axes = axes[0, 0]
    bars = axis.barh(np.arange(len(labels)), shares, color=tint)
    axis.bar_label(bars, [f"{v:.0f} %" if v >= 0.95 else f"{v:.1f} %" for v in shares], padding=4, fontsize=11)
    axis.set(xlim=(0.0, 112.0), xlabel="probability that it explains the recording [%]")
    axis.set_yticks(np.arange(len(labels)), labels, fontsize=11)
    axis.set_xticks([0, 25, 50, 75, 100])
    axis.tick_params(axis="y", length=0)
    axis.invert_yaxis()
    first = f"{labels[0]} {shares[0]:.0f} %"
    next_one = f", then {labels[1]} {shares[1]:.0f} %" if len(names) > 1 else ""
    words = " ".join(["Verdict:", answer.decision.verdict, ", ".join(answer.decision.effects)]).strip()
    figure.suptitle(f"{words}\nMost probable: {first}{next_one}", x=0.01, ha="left", fontsize=11)
    return figure


_LEAST = 0.1  # probability from which the size of an effect is drawn [1]
_MOST_PANELS, _MOST_SETTINGS = 6, 6


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

    def label(self, key: str) -> str:
        known = {q.name: q.unit for q in type(effect_of(self.candidate.id, self.candidate.settings[0])).parameters}
        return f"{self.candidate.id}: {key} [{known.get(key, '1')}]"


def _keys(candidate: Candidate) -> list[str]:
    return list(dict.fromkeys(k for s in candidate.settings for k in s))


def _numeric(candidate: Candidate, key: str) -> bool:
    return all(isinstance(s.get(key), (int, float)) for s in candidate.settings)


def _words(setting: Setting) -> str:
    return ", ".join(f"{k} {v:.4g}" if isinstance(v, float) else str(v) for k, v in setting.items())


def posterior(answer: Diagnosis) -> Figure | None:
    """Draw one panel per parameter, or a map of two."""
    likely = max((answer.found.inclusion[i] for i in answer.best.ids), default=0.0) >= _LEAST
    if not answer.best.ids or not (likely or set(answer.best.ids) & set(answer.decision.effects)):
        return None
    panels = []
    for i, p in weights(answer.found, Explanation.of(*answer.best.ids)).items():
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
    sizes = {k: len({s[k] for s in candidate.settings}) for k in _keys(candidate) if _numeric(candidate, k)}
    numbers = tuple(k for k, size in sizes.items() if size >= 3)
    words = {_words({k: v for k, v in s.items() if k not in numbers}) for s in candidate.settings}
    keys: list[tuple[str, ...]] = [(k,) for k in numbers]
    if not numbers or len(words) * 2 > len(candidate.settings):
        keys = [()]
    elif len(numbers) == 2 and len(words) == 1 and sizes[numbers[0]] * sizes[numbers[1]] == p.size:
        keys = [numbers]
    return [_Panel(candidate, p, k, intervals) for k in keys]


def _bars(axis: Axes, panel: _Panel) -> None:
    words = panel.words()
    total = {w: sum(float(q) for v, q in zip(words, panel.p, strict=True) if v == w) for w in words}
    top = sorted(total, key=lambda w: -total[w])[:_MOST_SETTINGS]
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
    for k, (key, grid) in enumerate(((a, gx), (b, gy))):
        inside = panel.intervals.get(key)
        mark = axis.axvline if k == 0 else axis.axhline
        if inside:  # a bar at the edge of the panel, so that the map keeps its colours
            ends, edge = [inside.low, inside.high], [0.99 if k == 0 else 0.005] * 2
            frame = axis.get_xaxis_transform() if k == 0 else axis.get_yaxis_transform()
            axis.plot(*((ends, edge) if k == 0 else (edge, ends)), color=ORANGE, linewidth=5.0, transform=frame,
                      solid_capstyle="butt", label="90 % interval of one" if k == 0 else None)  # fmt: skip
        for end in (grid[0], grid[-1]):
            mark(end, color=GREY, linestyle=":", linewidth=1.2,
                 label="prior range" if k == 0 and end == grid[0] else None)  # fmt: skip
    axis.set(xlabel=panel.label(a), ylabel=panel.label(b))
    axis.locator_params(axis="x", nbins=5)
    axis.legend(loc="upper right", frameon=True, framealpha=0.85, edgecolor="none")
