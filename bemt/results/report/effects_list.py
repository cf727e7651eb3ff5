"""Every effect of the catalogue with its parameters, their sources and its signature."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from bemt.base.tables import text_table
from bemt.physics.effects import catalogue, source_of

if TYPE_CHECKING:
    from bemt.physics.effects import Effect
    from bemt.physics.effects.base import Parameter

SCHEMA = "bemt.effects/1"
KINDS = {
    "air": "Air: the flow around the rotor",
    "stand": "Stand: instruments and their records",
    "drive": "Drive: motor and battery",
}


def document() -> dict[str, Any]:
    """Give all effects, as ``--json`` prints them."""
    return {"schema": SCHEMA, "effects": [_entry(cls) for kind in KINDS for cls in known(kind)]}


def known(kind: str) -> list[type[Effect]]:
    """Effects of a kind by name."""
    return sorted((cls for cls in catalogue().values() if cls.kind == kind), key=lambda cls: cls.id)


def choices(cls: type[Effect]) -> dict[str, list[Any]]:
    """Words that each field of an effect may be, its default first."""
    effect = cls()
    given, numbers = effect.variants() or (), {p.name for p in cls.parameters}
    return {
        f.name: list(
            dict.fromkeys(
                [getattr(effect, f.name), *cls.words.get(f.name, ()), *(v[f.name] for v in given if f.name in v)]
            )
        )
        for f in dataclasses.fields(cls)  # type: ignore[arg-type]
        if f.name not in numbers
    }


def _entry(cls: type[Effect]) -> dict[str, Any]:
    return {
        "id": cls.id, "title": cls.title, "kind": cls.kind, "sign": cls.sign, "on_by_default": cls.on_by_default,
        "diagnosed": cls.diagnosed, "needs": list(cls.needs), "source": source_of(cls),
        "parameters": [
            {"name": p.name, "unit": p.unit, "default": getattr(cls(), p.name), "low": p.low, "high": p.high,
             "off": p.off, "source": p.source}
            for p in cls.parameters
        ],
        "choices": choices(cls),
    }  # fmt: skip


def range_text(p: Parameter) -> str:
    """Lowest and highest value of a parameter."""
    return f"{p.low:.4g} to {p.high:.4g}{f' {p.unit}' if p.unit != '1' else ''}"


def text() -> str:
    """Give all effects as a table for a terminal."""
    lines = []
    for kind, head in KINDS.items():
        rows = []
        for e in known(kind):
            rows.append([e.id, "on" if e.on_by_default else "off", e.title, "", ""])
            rows += [["", "", "", p.name, f"{range_text(p)}, default {getattr(e(), p.name):.4g}"] for p in e.parameters]
        if rows:
            table = text_table(["effect", "default", "what", "parameter", "range"], rows, left=range(5))
            lines += [head, "\n".join(line.rstrip() for line in table.splitlines()), ""]
    return "\n".join(lines).rstrip()
