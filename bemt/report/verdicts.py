"""Sentences about a case, in the language of ASME V&V 20: nothing is ever called correct."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bemt.base.tables import number_text

__all__ = ["headline", "recorded", "verdict"]

SAME, DIFFERS, UNKNOWN = "not distinguishable from noise", "differs", "no verdict"


def _n(value: Any, digits: int = 3) -> str:
    good = isinstance(value, int | float) and math.isfinite(value)
    return number_text(float(value), digits) if good else "unknown"


def _known(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def recorded(result: Mapping[str, Any], source: str) -> list[Mapping[str, Any]]:
    """Rows of one source.

    Parameters
    ----------
    result : mapping
        Result of a case, as a sweep gives it.
    source : str
        Such as ``cfd``.

    Returns
    -------
    list of mapping
        Rows in their order.
    """
    return [row for row in result.get("rows", []) if row.get("source") == source]


def verdict(result: Mapping[str, Any]) -> tuple[str, str, str]:
    """Say in a sentence how BEMT and the recordings of a case stand.

    Parameters
    ----------
    result : mapping
        Result of a case.

    Returns
    -------
    tuple of str
        Kind (``same``, ``differs``, ``unknown``, ``fault``), a word or two, and the sentence.

    Examples
    --------
    >>> verdict({"rows": [], "faults": ["a", "b"]})
    ('fault', 'not solved', '2 faults in the input; nothing was computed.')
    """
    if not result.get("rows"):
        n = len(result.get("faults", []))
        return "fault", "not solved", f"{n} fault{'s' * (n != 1)} in the input; nothing was computed."
    own = recorded(result, "bemt")
    if not own or not _known(own[0].get("thrust_N")):
        return "fault", "no result", "BEMT did not converge at the operating point of the case."
    row = own[0]
    words = [f"BEMT gives {_n(row['thrust_N'], 4)} N"]
    if _known(row.get("u")):
        words[0] += f" ± {_n(row['u'], 2)} N (one standard uncertainty of what the source does not state)"
    words[0] += "."
    lines = [
        c
        for c in result.get("comparisons", [])
        if c.get("model") == "bemt"
        and c.get("quantity") == "thrust_N"
        and c.get("source") in ("cfd", "openfoam", "bench", "vendor", "flight")
        and _known(c.get("E"))
    ]
    if not lines:
        return (
            "unknown",
            f"{UNKNOWN}: nothing recorded",
            " ".join([*words, "There is no recorded thrust to compare it with."]),
        )
    parts = [f"{c['reference']} {c['E_pct']:+.1f} %" if _known(c.get("E_pct")) else str(c["reference"]) for c in lines]
    words.append(f"Difference from {'; '.join(parts)}.")
    judged = [c for c in lines if _known(c.get("u_val"))]
    far = [c for c in judged if abs(c["E"]) > c["u_val"]]
    if far:
        names = ", ".join(f"{c['reference']} (|E| {_n(abs(c['E']))} N, u_val {_n(c['u_val'])} N)" for c in far)
        words.append(f"It differs by more than the validation uncertainty from {names}.")
    near = [c for c in judged if c not in far]
    if near:
        names = ", ".join(str(c["reference"]) for c in near)
        words.append(f"Not distinguishable from noise against {names}: |E| is within the validation uncertainty.")
    open_ones = [c for c in lines if c not in judged]
    if open_ones:
        words.append(_needed(open_ones))
    if not judged:
        return "unknown", f"{UNKNOWN}: u_D unknown", " ".join(words)
    part = f" ({len(judged)} of {len(lines)} recordings)" if open_ones else ""
    return ("differs", DIFFERS + part, " ".join(words)) if far else ("same", SAME + part, " ".join(words))


def _needed(lines: Sequence[Mapping[str, Any]]) -> str:
    """What uncertainty recordings that state none would have to have, for agreement after V&V 20."""
    inside, wanted = [], []
    for c in lines:
        known = math.hypot(*(c[k] for k in ("u_num", "u_input", "u_model") if _known(c.get(k))))
        if abs(c["E"]) <= known:
            inside.append(str(c["reference"]))
        else:
            u = math.sqrt(c["E"] ** 2 - known**2)
            share = f" ({100.0 * u / abs(c['D']):.2g} %)" if c.get("D") else ""
            wanted.append(f"{c['reference']} to {_n(u, 2)} N{share}")
    said = []
    if inside:
        said.append(f"{', '.join(inside)}: inside what BEMT's own inputs leave open, however good the recording is")
    if wanted:
        said.append(f"BEMT and the recording agree only if it is no better than this: {', '.join(wanted)}")
    return "No uncertainty is stated for some recordings. " + "; ".join(said) + "."


def headline(result: Mapping[str, Any]) -> str:
    """Name a case for people.

    Parameters
    ----------
    result : mapping
        Result of a case.

    Returns
    -------
    str
        Its title, else its name, cut to one line.
    """
    words = str(result.get("title") or result.get("name") or "case").split()
    text = " ".join(words)
    return text if len(text) <= 140 else text[:139] + "…"
