"""A diagnosis (schema ``bemt.diagnosis/1``) as part of a page; whatever has another type than expected is left out."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from bemt.base.page import FIRST, Cell, num, table
from bemt.data.recordings.audit import Audit
from bemt.data.recordings.grid_study import LOADS, LoadStudy
from bemt.results.report.book import CasePage, Diagnosed, Part, ShownParameter, picture
from bemt.results.report.plot import COLOURS, DASHES, Plot, Trace, figure
from bemt.results.report.verdicts import NOTHING_RECORDED, verdict

# An audit of a CFD result, and its grid study, as parts of a page.

SCATTER_KIND = {"fine": "fine", "doubtful": "doubtful", "fault": "fault", "not stated": "unknown"}


def _share(value: float) -> str:
    return "unknown" if value != value else f"{100 * value:.1f} %"


def audit_parts(audit: Audit) -> list[Part]:
    """Say what an audit comes to, and give its lines."""
    rows = []
    for line in audit.lines:
        rows.append([line.topic, Cell(line.status, badge=SCATTER_KIND.get(line.status, "unknown")), line.finding,
                     line.consequence, num(100 * line.u_relative, 2, none="unknown")])  # fmt: skip
    known = audit.u_relative_known
    rest = f"the known parts make {_share(known)} together" if known else "no part of it is known"
    words = f"{audit.reference}: uncertainty of the thrust {_share(audit.u_relative)}; {rest}."
    head = ["setting", "status", "what is known", "consequence for the thrust", "u %"]
    return [("words", words), ("table", table(head, rows))]


def study_parts(studies: Sequence[Mapping[str, Any]]) -> list[Part]:
    """Grid studies: a picture each, values over the size of the cells down to zero, and what they say."""
    figures = []
    for s in map(LoadStudy.from_document, studies):
        h = [(s.cells[0] / n) ** (1.0 / 3.0) for n in s.cells]
        unit = f" [{LOADS[s.channel]}]" if LOADS[s.channel] else ""
        u = [s.u_relative * abs(s.values[0]), *[math.nan] * (len(h) - 1)]
        words = [f"{n:,.0f} cells" for n in s.cells]
        grids = Trace("grids; on the finest its u", h, s.values, u, COLOURS["cfd"], points=True, labels=words)
        traces = [grids]
        if s.order is not None and s.extrapolated is not None:
            x = [k * max(h) / 40 for k in range(41)]
            y = [s.extrapolated + (s.values[0] - s.extrapolated) * v**s.order for v in x]
            traces.append(Trace(f"order {s.order:.3g}", x, y, dash=DASHES[1]))
        title, label = f"Grid study: {s.name} at {s.rpm:g} rev/min", "cell size over the finest grid's"
        plot = Plot(title, label, s.name + unit, traces, note=f"{s.sentence()}.", zero=False, x_zero=True)
        figures.append(figure(plot))
    return [("figures", figures)] if figures else []


KIND = {"none": "same", "named": "differs", "class": "doubtful", "sensor": "differs", "unknown": "unknown",
        "insufficient": "unknown"}  # fmt: skip
BADGE = {"none": "no cause shows", "named": "cause", "class": "one of", "sensor": "sensor",
         "unknown": "cause not in the library", "insufficient": "cause not known"}  # fmt: skip
"""Words of the badge; the verdict alone reads as if nothing agreed."""
RANKED, LEAST = 8, 1e-3
"""Most effects of the ranking that are shown, and the probability below which none is."""
FIT_HEAD = ("channel", "RMSE before", "after", "noise", "smooth fit without physics", "held out, before",
            "held out, after")  # fmt: skip


def _parameters(told: Mapping[str, ShownParameter]) -> str:
    words = []
    for name, p in told.items():
        if p.value is None:  # of another form of the law
            continue
        if isinstance(p.value, str):  # a form of the law, not a number
            words.append(f"{name} {p.value.replace('_', ' ')}")
            continue
        shown, low, high = (num(v, 3).text for v in (p.value, p.low, p.high))
        words.append(f"{name} {shown} ({low} to {high}){' ' + p.unit if p.unit not in ('', '-', '1') else ''}")
    return "; ".join(words)


def diagnosis_verdict(item: Diagnosed) -> tuple[str, str, str]:
    """Give kind and words of a badge, and sentences."""
    d = item.told
    said, effects = d.verdict or "unknown", ", ".join(d.effects)
    why = d.explanation.partition(" Not tried: ")[0].partition(" Next: ")[0]
    word = BADGE.get(said, said)
    return KIND.get(said, "unknown"), f"{word}: {effects}" if effects else word, why


def page_verdict(page: CasePage) -> tuple[str, str, str]:
    """Say how a case stands; where only its diagnosis knows recordings, that says it."""
    own = verdict(page.result)
    item = page.diagnosis
    if own[1] != NOTHING_RECORDED or not item:
        return own
    kind, word, why = diagnosis_verdict(item)
    return kind, word, f"{own[2].partition('. ')[0]}. {re.split(r'(?<=[.]) (?=[A-Z])', why)[0]}"


def first_pictures(item: Diagnosed) -> list[dict[str, Any]]:
    """Pictures of the recordings inside the prediction band."""
    own = [(name, data) for name, data in item.figures if name.startswith(FIRST)]
    return [picture(name, data) | {"alt": "Recording and prediction", "narrow": True} for name, data in own]


def diagnosis_parts(item: Diagnosed, first: bool = True) -> list[Part]:
    """Give one diagnosis: verdict, first picture, place, ranking, errors before and after, what to measure, figures.

    ``first`` is False where the first picture stands elsewhere on the page.
    """
    d = item.told
    out: list[Part] = [("verdict", diagnosis_verdict(item)), ("figures", first_pictures(item) if first else [])]
    at = d.location
    if at.channel and d.verdict != "none":
        low, high, size, z = (num(v, 3).text for v in (at.low, at.high, at.size, at.z))
        where = f"{at.channel} where {at.variable or '?'} is {low} to {high}"
        out.append(("words", f"Located in {where} (size {size}, z {z})."))
    rows = [
        [r.effect, p, _parameters(r.parameters)]
        for r in d.ranking[:RANKED]
        if (p := num(r.probability, 3)).value is None or p.value >= LEAST
    ]
    out.append(("table", table(["effect", "probability [-]", "parameters (90 % interval)"], rows)))
    fits = [[channel, *(num(v, 3) for v in vars(fit).values())] for channel, fit in d.fit.items()]
    out.append(("table", table(FIT_HEAD, fits)))
    classes = [c for c in d.classes if len(c) > 1]
    if classes:
        told = "; ".join(map(" = ".join, classes[:12]))
        out.append(("words", f"Not distinguished by these data: {told}."))
    step = d.next_measurement
    if step.text:
        out.append(("words", f"Next measurement: {step.text}."))
        out += [("command", command) for command in step.commands]
    absent = [f"{effect}: {reason}" for effect, reason in d.not_tried.items()]
    out.append(("more", (f"{len(absent)} effects not tried, and why", [("list", absent)])) if absent else ("list", []))
    rest = [picture(name, data) for name, data in item.figures if not name.startswith(FIRST)]
    return [*out, ("figures", rest)]
