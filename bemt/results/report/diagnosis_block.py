"""A diagnosis (schema ``bemt.diagnosis/1``) as part of a page; whatever has another type than expected is left out."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from bemt.base.page import FIRST, Cell, num, table
from bemt.base.tables import number_text
from bemt.data.recordings.audit import Audit
from bemt.data.recordings.grids import LOADS, LoadStudy
from bemt.physics.effects import catalogue
from bemt.results.report.book import CasePage, Diagnosed, Part, Picture, ShownParameter, picture
from bemt.results.report.plot import COLOURS, DASHES, Plot, Trace, figure
from bemt.results.sweep.rows import Comparison, Result, Row, State, beside

# Sentences about a case, in the language of ASME V&V 20: nothing is ever called correct.

NAMES = {"cfd": "CFD", "bench": "bench", "vendor": "vendor", "flight": "flight", "openfoam": "own CFD"}
"""Sources in the order in which they are spoken of."""


NOTHING_RECORDED = "nothing recorded"
"""Words of the badge of a case without recordings."""


def _n(value: Any, digits: int = 3) -> str:
    return number_text(float(value), digits) if _finite(value) else "unknown"


def _finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def stand(c: Comparison) -> tuple[str, str]:
    """Kind of a badge, and how model and recording stand or what agreement would need, in few words.

    >>> stand(Comparison(S=119.1, D=104.9, u_num=0.1, u_input=13.0))
    ('unknown', 'needs u_D ≥ 5.4 %')
    >>> stand(Comparison(S=10.0, D=9.0, u_input=2.0, doubts=("supersonic tip",)))
    ('unknown', "inside the model's band, but flagged: supersonic tip")
    """
    kinds: dict[State, tuple[str, str]] = {
        "no result": ("fault", "no result"), "model unknown": ("unknown", "model's u unknown"),
        "agrees": ("same", "agrees within u_val"), "differs": ("differs", f"differs by {_far(c):.2g} u_val"),
        "inside": ("same", "inside the model's band"),
        "open": ("unknown", f"needs u_D ≥ {c.needed_pct or _n(c.needed, 2)}"),
    }  # fmt: skip
    kind, words = kinds[c.state]
    return ("unknown" if c.doubts and kind == "same" else kind), words + c.but_flagged


def _far(c: Comparison) -> float:
    """Difference in validation uncertainties."""
    return abs(c.E) / c.u_val if c.u_val else math.inf


def _thrusts(result: Result) -> list[Comparison]:
    """Recorded thrusts that BEMT is compared with, in the order of the sources."""
    lines = [c for c in result.comparisons if c.model == "bemt" and c.quantity == "thrust_N" and math.isfinite(c.E)]
    return [c for source in NAMES for c in lines if c.source == source]


def lead(result: Result) -> Row | None:
    """BEMT at the point that a front page shows: the case's own, else that of the first recorded thrust."""
    own, recorded = result.first("bemt"), _thrusts(result)
    if own is None or not recorded or any(beside(c, own) for c in recorded):
        return own
    return next((row for row in result.of("bemt") if beside(row, recorded[0])), own)


def _at(value: Row | Comparison | None) -> str:
    """The speeds of a value: " at 6000 rev/min, 5 m/s"."""
    if value is None or not _finite(value.rpm):
        return ""
    return f" at {value.rpm:.6g} rev/min" + (f", {value.airspeed_m_s:.4g} m/s" if value.airspeed_m_s > 0.0 else "")


def _elsewhere(c: Comparison, at: Row) -> str:
    """The speeds of a comparison that is not at a point; nothing of one that is."""
    air = f", {c.density_kg_m3:.4g} kg/m3" if abs(c.density_kg_m3 - at.density_kg_m3) > 1e-9 else ""
    return "" if beside(c, at) else f"{_at(c)}{air}"


def _solved(result: Result) -> Row | tuple[str, str, str]:
    """BEMT at the point that is shown, or the verdict where there is none."""
    if not result.rows:
        n = len(result.faults)
        return "fault", "not solved", f"{n} fault{'s' * (n != 1)}; nothing was computed."
    own = lead(result)
    if own is None or not _finite(own.thrust_N):
        return "fault", "no result", f"BEMT did not converge{_at(own) or ' at the operating point of the case'}."
    return own


def verdict(result: Result) -> tuple[str, str, str]:
    """Say how BEMT and the recordings of a case stand: kind and words of a badge, and sentences.

    >>> verdict(Result("mine", faults=("a", "b")))
    ('fault', 'not solved', '2 faults; nothing was computed.')
    """
    row = _solved(result)
    if isinstance(row, tuple):
        return row
    words = f"BEMT gives {_n(row.thrust_N, 4)} N{_at(row)}"
    if _finite(row.u):
        words += f", ± {_n(row.u, 2)} N (one standard uncertainty: what the source leaves open, and the model)"
    lines = _thrusts(result)
    if not lines:
        return "unknown", NOTHING_RECORDED, f"{words}. There is no recorded thrust to compare it with."
    parts = [f"{c.reference}{_elsewhere(c, row)}{f' {c.E_pct:+.1f} %' if c.D else ''}" for c in lines]
    told = [f"{words}. Difference from {'; '.join(parts)}."]
    far = [c for c in lines if c.state == "differs"]
    if far:
        names = ", ".join(f"{c.reference} (|E| {_n(abs(c.E))} N, u_val {_n(c.u_val)} N)" for c in far)
        told.append(f"It differs by more than the validation uncertainty from {names}.")
    near = [c.reference for c in lines if c.state == "agrees"]
    if near:
        told.append(f"Not distinguishable from noise against {', '.join(near)}: |E| is within u_val.")
    told += _open(lines)
    told += [f"Flagged: {flag}." for flag in row.flags]
    told += _no_check(result)
    here = [c for c in lines if not _elsewhere(c, row)]
    main = next(iter([*far, *(c for c in lines if c.state == "agrees"), *here, *lines]))
    return (*stand(main), " ".join(told))


def _open(lines: Sequence[Comparison]) -> list[str]:
    """What recordings that state no uncertainty would need for agreement."""
    inside = [c.reference for c in lines if c.state == "inside"]
    wanted = [
        f"{c.reference} {_n(c.needed, 2)} N" + (f" ({c.needed_pct})" if c.needed_pct else "")
        for c in lines
        if c.state == "open"
    ]
    told = []
    if inside:
        told.append(f"Within BEMT's own band, whatever the uncertainty of the recording: {', '.join(inside)}.")
    if wanted:
        text = f"Agrees only if the recording (no uncertainty stated) is at least this uncertain: {', '.join(wanted)}."
        told.append(text)
    return told


def answer(result: Result) -> str:
    """Answer in one sentence: both numbers, and what their agreement hangs on; then the other recordings.

    >>> from bemt.data.recordings.audit import Audit
    >>> cfd = Comparison(source="cfd", reference="cfd", S=119.1, D=104.9, u_num=0.1, u_input=13.0)
    >>> audit = Audit("cfd", (), math.nan, 0.041)
    >>> answer(Result("mine", rows=(Row("bemt", "bemt", 119.1, u=13.0),), comparisons=(cfd,), audit=(audit,)))
    'BEMT 119.1 ± 13 N, CFD 104.9 N (BEMT +13.5 %): they agree if the CFD is uncertain by 5.4 % or more; by our audit the recording itself is off by 4 % or more (the error of its grid is not known).'
    """  # noqa: E501
    own = _solved(result)
    if isinstance(own, tuple):
        return own[2]
    band = f" ± {_n(own.u, 2)}" if _finite(own.u) else ""
    lines = sorted(_thrusts(result), key=lambda c: bool(_elsewhere(c, own)))
    if not lines:
        power = f", {_n(own.power_W)} W at the shaft" if _finite(own.power_W) else ""
        return f"BEMT {_n(own.thrust_N, 4)}{band} N{power}{_at(own)}; nothing is recorded to compare it with."
    c = lines[0]
    name = NAMES[c.source]
    share = f" (BEMT {c.E_pct:+.1f} %)" if c.D else ""
    band = f" ± {_n(c.known, 2)}" if _finite(c.known) else ""
    head = f"BEMT {_n(c.S, 4)}{band} N, {name} {_n(c.D, 4)} N{share}{_at(c) or _at(own)}"
    told = [f"{head}: {_hangs(c, name)}{_audited(result, c)}."]
    seen = {(c.source, _n(c.D, 3))}
    rest: dict[str, list[str]] = {}
    for c in lines[1:]:
        if (key := (c.source, _n(c.D, 3))) not in seen:
            seen.add(key)
            rest.setdefault(stand(c)[1], []).append(f"{NAMES[c.source]} {key[1]} N{_elsewhere(c, own)}")
    told += [f"{', '.join(names)}: {words}." for words, names in rest.items()]
    told += _no_check(result)
    return " ".join(t[:1].upper() + t[1:] for t in told)


def _no_check(result: Result) -> list[str]:
    return [f"{words[:1].upper()}{words[1:]}." for words in result.no_check or ()]


def _hangs(c: Comparison, name: str) -> str:
    """What the agreement of one comparison hangs on."""
    words: dict[State, str] = {
        "model unknown": "BEMT's own uncertainty is unknown here", "agrees": "they agree within u_val",
        "differs": f"they differ by {_far(c):.1f} times u_val", "inside": "they agree within BEMT's own band",
        "open": f"they agree if the {name} is uncertain by {c.needed_pct or f'{_n(c.needed, 2)} N'} or more",
    }  # fmt: skip
    return words[c.state] + c.but_flagged


def _audited(result: Result, c: Comparison) -> str:
    """What the audit of a recorded CFD value knows of its uncertainty."""
    audit = result.audit_of(c.reference)
    share = audit.u_relative_known if audit else 0.0
    if not _finite(share) or share <= 0:
        return ""
    lines = audit.lines if audit else ()
    grid = next((line.u_relative for line in lines if line.topic == "grid study"), math.nan)
    rest = f"the grid alone makes {100.0 * grid:.1g} %" if _finite(grid) else "the error of its grid is not known"
    return f"; by our audit the recording itself is off by {100.0 * share:.1g} % or more ({rest})"


def headline(result: Result) -> str:
    """Name a case for people."""
    words = (result.title or result.name or "case").split()
    text = " ".join(words)
    return text if len(text) <= 140 else text[:139] + "…"


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
        h, words = list(s.h), [f"{v:,.4g}{'' if s.sizes else ' cells'}" for v in s.sizes or s.cells]
        unit = f" [{LOADS[s.channel]}]" if LOADS[s.channel] else ""
        u = [s.u_relative * abs(s.values[0]), *[math.nan] * (len(h) - 1)]
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
BADGE = {"none": "no cause shows", "named": "cause", "sensor": "the stand",
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


def _title(effect: str) -> str:
    """What an effect is called; an explanation may be several."""
    known = catalogue()
    return " and ".join(known[k].title if k in known else k for k in effect.split("+"))


def diagnosis_verdict(item: Diagnosed) -> tuple[str, str, str]:
    """Give kind and words of a badge, and sentences."""
    d = item.told
    said, effects = d.verdict or "unknown", ", ".join(map(_title, d.effects))
    why = d.explanation.partition(" Not tried: ")[0].partition(" Next: ")[0]
    if said == "class" and d.ranking:
        word = f"one of {len(d.effects)}, likeliest {_title(d.ranking[0].effect)}"
    else:
        word = f"{BADGE.get(said, said)}{f': {effects}' if effects else ''}"
    return KIND.get(said, "unknown"), word, why


def page_verdict(page: CasePage) -> tuple[str, str, str]:
    """Say how a case stands; where only its diagnosis knows recordings, that says it."""
    own = verdict(page.result)
    item = page.diagnosis
    if own[1] != NOTHING_RECORDED or not item:
        return own
    kind, word, why = diagnosis_verdict(item)
    return kind, word, f"{own[2].partition('. ')[0]}. {sentences(why)[0]}"


def sentences(words: str) -> list[str]:
    """Sentences of a text; a point inside a number or a unit ends none.

    >>> sentences("Thrust is +1.5 % off. Torque is not.")
    ['Thrust is +1.5 % off.', 'Torque is not.']
    """
    return re.split(r"(?<=[.]) (?=[A-Z])", words)


def first_pictures(item: Diagnosed) -> list[Picture]:
    """Pictures of the recordings inside the prediction band."""
    own = [(name, data) for name, data in item.figures if name.startswith(FIRST)]
    return [picture(name, data, "Recording and prediction", narrow=True) for name, data in own]


def diagnosis_parts(item: Diagnosed, first: bool = True) -> list[Part]:
    """Give one diagnosis: verdict, first picture, place, ranking, errors before and after, what to measure, figures.

    ``first`` is False where the first picture stands elsewhere on the page.
    """
    d = item.told
    out: list[Part] = [("verdict", diagnosis_verdict(item)), ("figures", first_pictures(item) if first else [])]
    at = d.location
    if at.channel and d.verdict != "none":
        low, high, size, z = (num(v, 3).text for v in (at.low, at.high, at.size, at.z))
        where = f"in {at.channel}, where {at.variable or '?'} is {low} to {high}"
        out.append(("words", f"Largest mismatch {where}: {size} of the largest value, {z} standard deviations in all."))
    rows = [
        [_title(r.effect), p, _parameters(r.parameters)]
        for r in d.ranking[:RANKED]
        if (p := num(r.probability, 3)).value is None or p.value >= LEAST
    ]
    out.append(("table", table(["effect", "probability [-]", "parameters (90 % interval)"], rows)))
    fits = [[channel, *(num(v, 3) for v in vars(fit).values())] for channel, fit in d.fit.items()]
    out.append(("table", table(FIT_HEAD, fits)))
    classes = [c for c in d.classes if len(c) > 1]
    if classes:
        told = "; ".join(" or ".join(map(_title, one)) for one in classes[:12])
        out.append(("words", f"At their usual size such points cannot tell apart: {told}."))
    step = d.next_measurement
    if step.text:
        out.append(("words", f"Next measurement: {step.text}."))
        out += [("command", command) for command in step.commands]
    absent = [f"{_title(effect)}: {reason}" for effect, reason in d.not_tried.items()]
    out.append(("more", (f"{len(absent)} effects not tried, and why", [("list", absent)])) if absent else ("list", []))
    rest = [picture(name, data) for name, data in item.figures if not name.startswith(FIRST)]
    return [*out, ("figures", rest)]
