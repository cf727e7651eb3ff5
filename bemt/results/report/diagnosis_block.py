"""A diagnosis (schema ``bemt.diagnosis/1``) as part of a page; whatever has another type than expected is left out."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from bemt.base.page import FIRST, num, table
from bemt.results.report.book import CasePage, Diagnosed
from bemt.results.report.values import Part, picture
from bemt.results.report.verdicts import NOTHING_RECORDED, verdict

KIND = {"none": "same", "named": "differs", "class": "doubtful", "sensor": "differs", "unknown": "unknown",
        "insufficient": "unknown"}  # fmt: skip
BADGE = {"none": "no cause shows", "named": "cause", "class": "one of", "sensor": "sensor",
         "unknown": "cause not in the library", "insufficient": "cause not known"}  # fmt: skip
"""Words of the badge; the verdict alone reads as if nothing agreed."""
RANKED, LEAST = 8, 1e-3
"""Most effects of the ranking that are shown, and the probability below which none is."""
FIT = ("before", "after", "noise", "gp_only", "holdout_before", "holdout_after")
FIT_HEAD = ("channel", "RMSE before", "after", "noise", "smooth fit without physics", "held out, before",
            "held out, after")  # fmt: skip


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _list(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list | tuple) else []


def _parameters(value: Any) -> str:
    words = []
    for name, p in _mapping(value).items():
        p = _mapping(p)
        if p.get("value") is None:  # of another form of the law
            continue
        if isinstance(p.get("value"), str):  # a form of the law, not a number
            words.append(f"{name} {p['value'].replace('_', ' ')}")
            continue
        shown, low, high = (num(p.get(k), 3).text for k in ("value", "low", "high"))
        unit = str(p.get("unit") or "")
        words.append(f"{name} {shown} ({low} to {high}){' ' + unit if unit not in ('', '-', '1') else ''}")
    return "; ".join(words)


def diagnosis_verdict(item: Diagnosed) -> tuple[str, str, str]:
    """Give kind and words of a badge, and sentences."""
    d = item.document
    said = str(d.get("verdict") or "unknown")
    effects = ", ".join(str(e) for e in _list(d.get("effects")))
    why = str(d.get("explanation") or "").partition(" Not tried: ")[0].partition(" Next: ")[0]
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
    d = item.document
    said = str(d.get("verdict") or "unknown")
    out: list[Part] = [("verdict", diagnosis_verdict(item)), ("figures", first_pictures(item) if first else [])]
    place = _mapping(d.get("location"))
    if place.get("channel") and said != "none":
        low, high, size, z = (num(place.get(k), 3).text for k in ("low", "high", "size", "z"))
        variable = place.get("variable") or "?"
        out.append(
            ("words", f"Located in {place['channel']} where {variable} is {low} to {high} (size {size}, z {z}).")
        )
    ranking = [_mapping(r) for r in _list(d.get("ranking"))[:RANKED]]
    rows = [
        [str(r.get("effect", "")), p, _parameters(r.get("parameters"))]
        for r in ranking
        if (p := num(r.get("probability"), 3)).value is None or p.value >= LEAST
    ]
    out.append(("table", table(["effect", "probability [-]", "parameters (90 % interval)"], rows)))
    fits = [
        [str(channel), *(num(_mapping(fit).get(k), 3) for k in FIT)] for channel, fit in _mapping(d.get("fit")).items()
    ]
    out.append(("table", table(FIT_HEAD, fits)))
    classes = [c for c in _list(d.get("classes")) if isinstance(c, list) and len(c) > 1]
    if classes:
        told = "; ".join(" = ".join(str(e) for e in c) for c in classes[:12])
        out.append(("words", f"Not distinguished by these data: {told}."))
    step = _mapping(d.get("next_measurement"))
    if step.get("text"):
        out.append(("words", f"Next measurement: {step['text']}."))
        out += [("command", str(command)) for command in _list(step.get("commands"))]
    absent = [f"{effect}: {reason}" for effect, reason in _mapping(d.get("not_tried")).items()]
    out.append(("more", (f"{len(absent)} effects not tried, and why", [("list", absent)])) if absent else ("list", []))
    rest = [picture(name, data) for name, data in item.figures if not name.startswith(FIRST)]
    return [*out, ("figures", rest)]
