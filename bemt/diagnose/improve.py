"""The case with what was found switched on: a case that ``sweep`` runs."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from bemt import effects, forward
from bemt.diagnose.signatures import effect_of

if TYPE_CHECKING:
    from bemt.case import Case
    from bemt.diagnose.chain import Diagnosis

__all__ = ["improved_case", "is_improved"]

_HEAD = "with what `python -m bemt diagnose` found: "
_LINE = re.compile(r"^(effects_on|effects_off)\s*=.*$")


def improved_case(answer: Diagnosis, case: Case, source: str) -> str:
    """Text of a case file with the effects of the verdict on.

    Parameters
    ----------
    answer : Diagnosis
        The answer.
    case : Case
        The case that was diagnosed.
    source : str
        Text of its file.

    Returns
    -------
    str
        TOML, or "" when the verdict names nothing that a simulation can have (faults of a stand are not simulated).
    """
    named = answer.decision.verdict in ("named", "class")
    found = [effect_of(i, s) for i, s in zip(answer.best.ids, answer.best.settings, strict=True)]
    found = [e for e in found if forward.acts_on_rotor(e) or (e.kind == "air" and not e.needs)]
    if not named or not found:
        return ""
    ids = {e.id for e in found}
    on = [t for t in case.get("model.effects_on") if t.partition("(")[0] not in ids] + [
        effects.to_text(e) for e in found
    ]
    off = [i for i in case.get("model.effects_off") if i not in ids]
    if "duct" in ids and case.document.get("duct"):
        on = [t for t in on if t.partition("(")[0] != "duct"]  # the case's own duct is there again
    lines = source.splitlines()
    quoted = {"effects_on": on, "effects_off": off}
    new = [f"{key} = [{', '.join(_quote(t) for t in values)}]" for key, values in quoted.items()]
    out, inside, done = [], False, False
    for line in lines:
        if line.strip().startswith("["):
            inside = line.split("#")[0].strip() == "[model]"
            out.append(line)
            if inside:
                out += new
                done = True
            continue
        if inside and _LINE.match(line.strip()):
            continue
        out.append(line)
    if not done:
        out += ["", "[model]", *new]
    head = f"# {case.name} {_HEAD}{', '.join(effects.to_text(e) for e in found)}"
    return "\n".join([head, *out]) + "\n"


def is_improved(source: str) -> bool:
    """Whether a case file was written here, not by hand.

    Parameters
    ----------
    source : str
        Text of the file.

    Returns
    -------
    bool
        True if its first line says so.

    >>> is_improved("# mine with what `python -m bemt diagnose` found: swirl()"), is_improved("# mine")
    (True, False)
    """
    first = source.partition("\n")[0]
    return first.startswith("#") and _HEAD in first


def _quote(text: str) -> str:
    """TOML literal string; ids and numbers hold no quotes but those of words."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
