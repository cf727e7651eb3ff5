"""What an effect does on the blade, which effects look alike, how probable they are."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np

from bemt.base.arrays import Array
from bemt.base.canvas import BLUE, GREY, ORANGE, PURPLE, RED, SKY, blank
from bemt.judge.diagnose import confusion
from bemt.judge.diagnose.fit import fit
from bemt.judge.diagnose.record import CHANNELS
from bemt.judge.diagnose.signatures import effect_of
from bemt.judge.explanation import NONE, Explanation
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
        for i in what.ids & set(answer.found.spans):
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
    """Draw what this plan cannot tell from each effect: the likely ones first, at the strength that was found."""
    alike, share = _as_found(answer), _likely(answer)
    seen = np.flatnonzero(alike.size >= confusion.ALIKE)
    if seen.size < 2:
        return None
    D = np.where(np.eye(len(alike.ids), dtype=bool), np.inf, np.minimum(alike.distance, alike.distance.T))
    near = D[np.ix_(seen, seen)].min(axis=1)
    order = sorted(range(seen.size), key=lambda k: (-round(share.get(alike.ids[seen[k]], 0.0), 3), near[k]))
    rows = [int(seen[k]) for k in order][:_MOST_EFFECTS]
    drawn = {alike.ids[i] for i in seen}
    hidden = [i for i, p in share.items() if p >= _LEADING and i not in drawn]
    usual = dict(zip(answer.alike.ids, answer.alike.size, strict=True))
    top = 4.0 * confusion.ALIKE
    figure, axes = blank(1.7 + 0.34 * len(rows), 1, 1)
    axis: Axes = axes[0, 0]
    axis.axvspan(0.0, confusion.ALIKE, facecolor=ORANGE, alpha=0.25, edgecolor="none")
    alone = 0
    for y, i in enumerate(rows):
        others = np.array([j for j in seen if j != i])
        d = D[i, others]
        twins = [alike.ids[j] for j in others[np.argsort(d, kind="stable")] if D[i, j] < confusion.ALIKE]
        alone += not twins
        axis.plot(np.minimum(d, top), np.full(d.size, y), "o", color=GREY, markersize=4, alpha=0.5)
        axis.plot(d[d < confusion.ALIKE], np.full(len(twins), y), "o", color=RED, markersize=7)
        more = f" and {len(twins) - 2} more" if len(twins) > 2 else ""
        words = ", ".join(twins[:2]) + more if twins else "told from all others"
        axis.text(1.02, y, words, transform=axis.get_yaxis_transform(), va="center", color=RED if twins else GREY)
    axis.set(xlim=(0.0, top * 1.02), xlabel="distance to every other effect [standard deviations]")
    axis.set_xticks([0.0, confusion.ALIKE, 6.0, 9.0, top], ["0", f"{confusion.ALIKE:g}", "6", "9", f"{top:g} or more"])
    names = [alike.ids[i] for i in rows]
    axis.set_yticks(range(len(rows)), [f"{i}, as found" if usual[i] < confusion.ALIKE else i for i in names])
    axis.set_ylim(len(rows) - 0.5, -0.5)
    axis.tick_params(axis="y", length=0)
    axis.text(1.02, -0.75, "looks like", transform=axis.get_yaxis_transform(), va="bottom", weight="bold")
    left = "" if seen.size <= len(rows) else f"{len(rows)} of {seen.size} effects are shown"
    told = f"In this plan {len(rows) - alone} of {len(rows)} effects look like another"
    told = told if alone < len(rows) else "This plan tells all these effects apart"
    faint = f"\nLikely, but too faint in this plan to be told from nothing: {', '.join(hidden)}" if hidden else ""
    red = f"red: closer than {confusion.ALIKE:g} standard deviations" if alone < len(rows) else ""
    more = "\n" + "; ".join(filter(None, (red, left))) if red or left else ""
    figure.suptitle(f"{told}{more}{faint}", x=0.01, ha="left", fontsize=11)
    return figure


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
