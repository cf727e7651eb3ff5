"""The case with what was found switched on: a case that ``sweep`` runs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomlkit

from bemt.judge.diagnose.signatures import effect_of
from bemt.physics import effects
from bemt.physics.bem import model as bem

if TYPE_CHECKING:
    from bemt.judge.diagnose.answer import Diagnosis
    from bemt.rotors.case import Case

_HEAD = "with what `bemt diagnose` found: "


def improved_case(answer: Diagnosis, case: Case, source: str) -> str:
    """Text of a case file with the effects of the verdict on."""
    named = answer.decision.verdict in ("named", "class")
    found = [effect_of(i, s) for i, s in zip(answer.best.ids, answer.best.settings, strict=True)]
    found = [e for e in found if bem.acts_on_rotor(e) or (e.kind == "air" and not e.needs)]
    if not named or not found:
        return ""
    ids = {e.id for e in found}
    on = [t for t in case.get("model.effects_on") if t.partition("(")[0] not in ids] + [
        effects.to_text(e) for e in found
    ]
    off = [i for i in case.get("model.effects_off") if i not in ids]
    if "duct" in ids and case.ducted:
        on = [t for t in on if t.partition("(")[0] != "duct"]  # the case's own duct is there again
    text = tomlkit.parse(source.lstrip("\ufeff"))
    if "model" not in text:
        text["model"] = tomlkit.table()
    model: Any = text["model"]
    model["effects_on"], model["effects_off"] = on, off
    text["name"] = _next_name(case.name)
    elsewhere(text, case)
    head = f"# {case.name} {_HEAD}{', '.join(effects.to_text(e) for e in found)}"
    return f"{head}\n{tomlkit.dumps(text).rstrip()}\n"


def _next_name(name: str) -> str:
    """Name of the improved case: its own, or a sweep of both could not tell them apart.

    >>> _next_name("prop_10x5"), _next_name("prop_10x5_improved"), _next_name("prop_10x5_improved_2")
    ('prop_10x5_improved', 'prop_10x5_improved_2', 'prop_10x5_improved_3')
    """
    base, mark, count = name.partition("_improved")
    if not mark or not re.fullmatch(r"(_[1-9]\d*)?", count):
        return f"{name}_improved"
    return f"{base}_improved_{int(count[1:] or 1) + 1}"


def beside(case: Case) -> list[Path]:
    """Files of a case that lie in its folder, and so go with it."""
    folder = case.folder.resolve()
    return [f for f in case.files() if f != case.path and f.resolve().is_relative_to(folder)]


def elsewhere(node: Any, case: Case) -> None:
    """Name files that lie elsewhere by their whole path: the improved case stands in another folder."""
    far = {f.resolve() for f in case.files()} - {case.path.resolve(), *(f.resolve() for f in beside(case))}
    keys = range(len(node)) if isinstance(node, list) else list(node)
    for key in keys:
        value = node[key]
        if isinstance(value, str):
            if (case.folder / value).resolve() in far:
                node[key] = (case.folder / value).resolve().as_posix()
        elif isinstance(value, (dict, list)):
            elsewhere(value, case)


def is_improved(source: str) -> bool:
    """Whether a case file was written here, not by hand."""
    first = source.partition("\n")[0]
    return first.startswith("#") and _HEAD in first
