"""A diagnosis (schema ``bemt.diagnosis/1``) as part of a page; whatever has another type than expected is left out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bemt.report.markup import badge, esc, image, num, section, table

__all__ = ["diagnosis_block", "diagnosis_parts", "figure_of"]

KIND = {
    "none": "same",
    "named": "differs",
    "class": "doubtful",
    "sensor": "differs",
    "unknown": "unknown",
    "insufficient": "unknown",
}
RANKED = 8


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


def figure_of(name: str, data: bytes) -> str:
    """Show a picture with its file name in words below."""
    words = name.rpartition(".")[0].replace("_", " ")
    picture = image(data, words, "png" if name.endswith(".png") else "svg+xml")
    return f'<figure class="picture">{picture}<figcaption>{esc(words)}</figcaption></figure>'


def diagnosis_parts(item: Mapping[str, Any]) -> str:
    """Write one diagnosis."""
    d = _mapping(item.get("document"))
    verdict = str(d.get("verdict") or "unknown")
    effects = ", ".join(str(e) for e in _list(d.get("effects")))
    words = f"{verdict}: {effects}" if effects else verdict
    out = [f"<p>{badge(KIND.get(verdict, 'unknown'), words)} {esc(d.get('explanation') or '')}</p>"]
    place = _mapping(d.get("location"))
    if place.get("channel") and verdict != "none":
        low, high = num(place.get("low"), 3).text, num(place.get("high"), 3).text
        out.append(
            f"<p>Located in {esc(place['channel'])} where {esc(place.get('variable') or '?')} is {esc(low)} "
            f"to {esc(high)} "
            f"(size {esc(num(place.get('size'), 3).text)}, z {esc(num(place.get('z'), 3).text)}).</p>"
        )
    ranking = [_mapping(r) for r in _list(d.get("ranking"))[:RANKED]]
    rows = [[str(r.get("effect", "")), num(r.get("probability"), 3), _parameters(r.get("parameters"))] for r in ranking]
    out.append(table(["effect", "probability [-]", "parameters (90 % interval)"], rows))
    fits = []
    for channel, fit in _mapping(d.get("fit")).items():
        fit = _mapping(fit)
        fits.append(
            [
                str(channel),
                *(
                    num(fit.get(k), 3)
                    for k in ("before", "after", "noise", "gp_only", "holdout_before", "holdout_after")
                ),
            ]
        )
    out.append(
        table(
            [
                "channel",
                "RMSE before",
                "after",
                "noise",
                "smooth unknown effect only",
                "held out, before",
                "held out, after",
            ],
            fits,
        )
    )
    classes = [c for c in _list(d.get("classes")) if isinstance(c, list) and len(c) > 1]
    if classes:
        told = "; ".join(" = ".join(str(e) for e in c) for c in classes[:12])
        out.append(f"<p>Not told apart by these data: {esc(told)}.</p>")
    step = _mapping(d.get("next_measurement"))
    if step.get("text"):
        out.append(f"<p>Next measurement: {esc(step['text'])}</p>")
    figures = "".join(figure_of(name, data) for name, data in item.get("figures", []))
    if figures:
        out.append(f'<div class="figures">{figures}</div>')
    return "".join(out)


def diagnosis_block(item: Mapping[str, Any] | None) -> str:
    """Write the diagnosis of a case."""
    return "" if not item else section("Diagnosis: what physics was left out", diagnosis_parts(item))
