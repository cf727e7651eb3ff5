"""What an effect does on the blade, which effects look alike, how probable they are."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from bemt.base.canvas import BLACK, BLUE, GREY, ORANGE, PURPLE, RED, SKY, blank
from bemt.bem import model as bem
from bemt.bem import solver
from bemt.diagnose import confusion
from bemt.diagnose.explanation import NONE, Explanation
from bemt.diagnose.fit import fit
from bemt.diagnose.record import CHANNELS
from bemt.diagnose.signatures import effect_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bemt.air import Air
    from bemt.diagnose.answer import Diagnosis

__all__ = ["blade_loads", "matrix", "radius", "ranking"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_MOST_EFFECTS, _MOST_BARS = 15, 8
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
        curves.append([s.radial[k][0] / prep.stations.dr for k in ("dT", "dQ")])
    return reading, s.radial["r"][0], prep.stations.dr, np.array(curves)


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
        for i in what.ids:
            share.setdefault(i, p)
    return share


def _as_found(answer: Diagnosis) -> confusion.Confusion:
    """Distances, those of the leading effects that are too faint at usual strength at the strength that was found."""
    alike, found = answer.alike, answer.found
    sizes = dict(zip(alike.ids, alike.size, strict=True))
    faint = [i for i, p in _likely(answer).items() if p >= _LEADING and sizes.get(i, np.inf) < confusion.ALIKE]
    if not faint:
        return alike
    at = {i: fit(found, Explanation.of(i)).columns[0] - found.spans[i].start for i in faint}
    return confusion.confusion(found, at)


def matrix(answer: Diagnosis) -> Figure | None:
    """Draw which effects look alike in this plan: the likely ones first, at the strength that was found."""
    from matplotlib.colors import LinearSegmentedColormap, TwoSlopeNorm
    from matplotlib.patches import Rectangle

    alike, share = _as_found(answer), _likely(answer)
    seen = np.flatnonzero(alike.size >= confusion.ALIKE)
    if seen.size < 2:
        return None
    strongest = sorted(seen, key=lambda i: (-round(share.get(alike.ids[i], 0.0), 3), -alike.size[i]))[:_MOST_EFFECTS]
    drawn = {alike.ids[i] for i in seen}
    hidden = [i for i, p in share.items() if p >= _LEADING and i not in drawn]
    usual = dict(zip(answer.alike.ids, answer.alike.size, strict=True))
    rows = _neighbours(alike.distance, np.array(sorted(strongest)))
    D = alike.distance[np.ix_(rows, rows)]
    names, n = [alike.ids[i] for i in rows], rows.size
    figure, axes = blank(max(1.9 + 0.32 * n, 3.6), 1, 1)
    axis: Axes = axes[0, 0]
    top = 4.0 * confusion.ALIKE
    colours = LinearSegmentedColormap.from_list("alike", [ORANGE, "#fff4da", "#ffffff", "#d7ecf9", SKY])
    norm = TwoSlopeNorm(confusion.ALIKE, 0.0, top)
    shown = np.ma.masked_array(np.minimum(D, top), np.eye(n, dtype=bool))
    axis.set_facecolor("#e4e4e4")
    image = axis.imshow(shown, cmap=colours, norm=norm, aspect="auto")
    for i in range(n):
        for j in range(n):
            if i == j:
                continue
            text = f"{D[i, j]:.1f}" if D[i, j] < 9.95 else f"{D[i, j]:.0f}" if D[i, j] < 999.5 else ">999"
            axis.text(j, i, text, ha="center", va="center", fontsize=7)
            if D[i, j] < confusion.ALIKE:
                axis.add_patch(Rectangle((j - 0.47, i - 0.46), 0.94, 0.92, fill=False, linewidth=1.1))
    axis.set_xticks(range(n), names, rotation=40, ha="right", rotation_mode="anchor")
    axis.set_yticks(range(n), [f"{i}, as found" if usual[i] < confusion.ALIKE else i for i in names])
    axis.tick_params(length=0)
    axis.spines[:].set_visible(False)
    axis.set(xlabel="from the nearest setting of", ylabel="distance of")
    left = "" if seen.size <= n else f"; {n} of {seen.size} visible effects"
    faint = f"\nLikely, but too faint in this plan to be told from nothing: {', '.join(hidden)}" if hidden else ""
    axis.set_title(f"Framed: closer than {confusion.ALIKE:g} standard deviations, alike in this plan{left}{faint}")
    bar = figure.colorbar(image, ax=axis, label="distance [standard deviations]", extend="max", pad=0.02)
    bar.set_ticks([0.0, 1.0, 2.0, confusion.ALIKE, 6.0, 9.0, top])
    bar.ax.axhline(confusion.ALIKE, color=BLACK, linewidth=1.6)
    return figure


def _neighbours(distance: Array, rows: Index) -> Index:
    """Order that puts alike effects side by side."""
    from scipy.cluster.hierarchy import leaves_list, linkage
    from scipy.spatial.distance import squareform

    if rows.size < 3:
        return rows
    D = distance[np.ix_(rows, rows)]
    near = np.minimum(np.minimum(D, D.T), 100.0)
    np.fill_diagonal(near, 0.0)
    return np.asarray(rows[leaves_list(linkage(squareform(near, checks=False), "average"))])


def ranking(answer: Diagnosis) -> Figure:
    """Draw the explanations by their probability."""
    found = answer.found
    names = sorted(found.probability, key=lambda k: -found.probability[k])[:_MOST_BARS]
    odds = [0.0 if k == NONE else found.log_bayes(k) for k in names]
    chosen = set(answer.decision.effects)

    def colour(what: Explanation) -> str:
        if not what:
            return GREY if what == NONE else PURPLE
        return BLUE if chosen & what.ids else SKY

    figure, axes = blank(1.1 + 0.3 * len(names), 1, 2, sharey=True)
    left, right = axes[0]
    rows = np.arange(len(names))
    shares = [found.probability[k] for k in names]
    tint = [colour(k) for k in names]
    for axis, sizes, digits in ((left, shares, 3), (right, odds, 1)):
        bars = axis.barh(rows, sizes, color=tint)
        axis.bar_label(bars, fmt=f"%.{digits}f", padding=3, fontsize=8)
    left.set(
        xlim=(0, 1.15), xlabel="probability [1]", yticks=rows, yticklabels=[" + ".join(k) or str(k) for k in names]
    )
    left.set_xticks([0, 0.25, 0.5, 0.75, 1])
    left.invert_yaxis()
    right.axvline(0.0, color=BLACK, linewidth=0.8)
    right.set(xlabel="ln odds of the readings over none [1]")
    right.margins(x=0.15)
    right.locator_params(axis="x", nbins=6)  # beyond that, labels with two digits run into each other
    words = " ".join(["verdict:", answer.decision.verdict, ", ".join(answer.decision.effects)]).strip()
    words += f"; p = {answer.p_value:.2g}"
    figure.suptitle(words, fontsize=9)
    return figure
