"""Every effect of the catalogue, its parameters and their sources, what gives it away."""

from __future__ import annotations

import dataclasses
import inspect
import re
import textwrap
from collections.abc import Container
from typing import TYPE_CHECKING, Any

from bemt.base.tables import text_table
from bemt.effects import catalogue

if TYPE_CHECKING:
    from bemt.effects import Effect

__all__ = ["document", "markdown", "text"]

SCHEMA = "bemt.effects/1"
KINDS = {
    "air": "Air: what the flow does",
    "stand": "Stand: instruments, and what was written down",
    "drive": "Drive: motor and battery",
}


def document() -> dict[str, Any]:
    """Give all effects, as ``--json`` prints them."""
    order = list(KINDS)
    known = sorted(catalogue().values(), key=lambda cls: (order.index(cls.kind), cls.id))
    return {"schema": SCHEMA, "effects": [_entry(cls) for cls in known]}


def _entry(cls: type[Effect]) -> dict[str, Any]:
    effect = cls()
    given = effect.variants() or ()
    numbers = {p.name for p in cls.parameters}
    words = {
        f.name: list(dict.fromkeys([getattr(effect, f.name), *(v[f.name] for v in given if f.name in v)]))
        for f in dataclasses.fields(cls)  # type: ignore[arg-type]
        if f.name not in numbers
    }
    return {
        "id": cls.id, "title": cls.title, "kind": cls.kind, "sign": cls.sign, "on_by_default": cls.on_by_default,
        "diagnosed": cls.diagnosed, "needs": list(cls.needs), "source": _notes(cls),
        "parameters": [
            {"name": p.name, "unit": p.unit, "default": getattr(effect, p.name), "low": p.low, "high": p.high,
             "off": p.off, "source": p.source}
            for p in cls.parameters
        ],
        "choices": words,
    }  # fmt: skip


def _notes(cls: type[Effect]) -> str:
    """Notes of the docstring, in one line."""
    text = inspect.cleandoc(cls.__doc__ or "").partition("Notes\n-----\n")[2]
    return re.sub(r":\w+:`([^`]+)`|``([^`]+)``", r"`\1\2`", " ".join(text.split()))


def _range(p: dict[str, Any]) -> str:
    unit = "" if p["unit"] == "1" else f" {p['unit']}"
    return f"{p['low']:.4g} to {p['high']:.4g}{unit}"


def text() -> str:
    """Give all effects as a table for a terminal."""
    lines = []
    for kind, head in KINDS.items():
        rows = []
        for e in document()["effects"]:
            if e["kind"] != kind:
                continue
            state = "on" if e["on_by_default"] else "off"
            rows.append([e["id"], state, e["title"], "", ""])
            rows += [["", "", "", p["name"], f"{_range(p)}, default {p['default']:.4g}"] for p in e["parameters"]]
        if rows:
            table = text_table(["effect", "default", "what", "parameter", "range"], rows, left=range(5))
            lines += [head, "\n".join(line.rstrip() for line in table.splitlines()), ""]
    return "\n".join(lines).rstrip()


def markdown(only: Container[str] | None = None) -> str:
    """Give effects as the page docs/effects.md."""
    found = [e for e in document()["effects"] if only is None or e["id"] in only]
    lines = [
        "# Effects",
        "",
        "The effects of the catalogue `bemt/effects/`, one file each. This page is written by",
        "`python -m bemt effects --markdown`; do not edit it.",
        "",
        "A case names them in `model.effects_on` and `model.effects_off`, with parameters where they differ from the",
        'defaults: `effects_on = ["tip_loss(strength=0.9)"]`.',
        "",
    ]
    for kind, head in KINDS.items():
        mine = [e for e in found if e["kind"] == kind]
        if not mine:
            continue
        lines += [f"## {head}", "", "| id | what | gives it away |", "|---|---|---|"]
        lines += [f"| [`{e['id']}`](#{e['id']}) | {e['title']} | {e['sign']} |" for e in mine]
        lines += [""]
        for e in mine:
            lines += _page(e)
    return "\n".join(lines).rstrip() + "\n"


def _page(e: dict[str, Any]) -> list[str]:
    state = ["On unless turned off." if e["on_by_default"] else "Off unless turned on."]
    if not e["diagnosed"]:
        state.append("A diagnosis does not name it.")
    if e["needs"]:
        state.append(f"A recording shows it only with {', '.join(f'`{n}`' for n in e['needs'])}.")
    lines = [f"### {e['id']}", "", *textwrap.wrap(" ".join(state), 118), ""]
    if e["parameters"]:
        lines += [
            "| parameter | unit | default | range | nothing at | source of the range |",
            "|---|---|---|---|---|---|",
        ]
        for p in e["parameters"]:
            off = "" if p["off"] is None else f"{p['off']:.4g}"
            number = f"{p['default']:.4g}"
            cells = [f"`{p['name']}`", p["unit"], number, _range(p | {"unit": "1"}), off, p["source"]]
            lines.append(f"| {' | '.join(cells)} |")
        lines.append("")
    for name, words in e["choices"].items():
        lines += [*textwrap.wrap(f"`{name}`: " + ", ".join(f"`{w}`" for w in words), 118), ""]
    return [*lines, *textwrap.wrap(e["source"], 118, break_on_hyphens=False), ""]
