"""Sentences about a case, in the language of ASME V&V 20: nothing is ever called correct."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bemt.base.tables import number_text

__all__ = ["answer", "headline", "recorded", "verdict"]

SAME, DIFFERS, UNKNOWN = "not distinguishable from noise", "differs", "no verdict"


def _n(value: Any, digits: int = 3) -> str:
    good = isinstance(value, int | float) and math.isfinite(value)
    return number_text(float(value), digits) if good else "unknown"


def _known(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def recorded(result: Mapping[str, Any], source: str) -> list[Mapping[str, Any]]:
    """Rows of one source."""
    return [row for row in result.get("rows", []) if row.get("source") == source]


def verdict(result: Mapping[str, Any]) -> tuple[str, str, str]:
    """Say in a sentence how BEMT and the recordings of a case stand.

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
        words[0] += (
            f" ± {_n(row['u'], 2)} N (one standard uncertainty: inputs that the source does not state, and the model)"
        )
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


NAMES = {"cfd": "CFD", "openfoam": "own CFD", "bench": "bench", "vendor": "vendor", "flight": "flight"}


def answer(result: Mapping[str, Any]) -> str:
    """Say in one sentence how BEMT and the recordings stand: both numbers, and what agreement would need.

    Examples
    --------
    >>> row = {"source": "bemt", "thrust_N": 119.1, "u": 13.0}
    >>> cfd = {"model": "bemt", "quantity": "thrust_N", "source": "cfd", "reference": "cfd", "D": 104.9, "E": 14.2,
    ...        "E_pct": 13.5, "u_num": 0.1, "u_input": 13.0, "u_val": None}
    >>> answer({"rows": [row], "comparisons": [cfd]})
    'BEMT 119.1 ± 13 N, CFD 104.9 N (+13.5 %): they agree if the CFD is no better than 5.4 %.'
    """
    own = recorded(result, "bemt")
    if not own or not _known(own[0].get("thrust_N")):
        return verdict(result)[2]
    band = f" ± {_n(own[0]['u'], 2)}" if _known(own[0].get("u")) else ""
    head = f"BEMT {_n(own[0]['thrust_N'], 4)}{band} N"
    said = []
    for source, name in NAMES.items():
        lines = [
            c
            for c in result.get("comparisons", [])
            if c.get("model") == "bemt" and c.get("quantity") == "thrust_N" and c.get("source") == source
        ]
        if lines and _known(lines[0].get("E")):
            c = lines[0]
            share = f" ({c['E_pct']:+.1f} %)" if _known(c.get("E_pct")) else ""
            said.append(f"{name} {_n(c['D'], 4)} N{share}: {_stand(c, name)}")
    return f"{head}, " + "; ".join(said) + "." if said else f"{head}; nothing is recorded to compare it with."


def _stand(c: Mapping[str, Any], name: str) -> str:
    """How one comparison stands."""
    if _known(c.get("u_val")):
        return (
            "they agree within u_val"
            if abs(c["E"]) <= c["u_val"]
            else f"they differ by {abs(c['E']) / c['u_val']:.1f} u_val"
        )
    known = _inputs(c)
    if abs(c["E"]) <= known:
        return "within BEMT's own band"
    u = math.sqrt(c["E"] ** 2 - known**2)
    return f"they agree if the {name} is no better than {100.0 * u / abs(c['D']):.2g} %"


def _inputs(c: Mapping[str, Any]) -> float:
    """Standard uncertainty of BEMT in a comparison, the recording's left out, [N]."""
    return math.hypot(*(c[k] for k in ("u_num", "u_input", "u_model") if _known(c.get(k))))


def _needed(lines: Sequence[Mapping[str, Any]]) -> str:
    """What uncertainty recordings that state none would have to have, for agreement after V&V 20."""
    inside, wanted = [], []
    for c in lines:
        known = _inputs(c)
        if abs(c["E"]) <= known:
            inside.append(str(c["reference"]))
        else:
            u = math.sqrt(c["E"] ** 2 - known**2)
            share = f" ({100.0 * u / abs(c['D']):.2g} %)" if c.get("D") else ""
            wanted.append(f"{c['reference']} to {_n(u, 2)} N{share}")
    said = []
    if inside:
        said.append(f"{', '.join(inside)}: inside BEMT's own band, however good the recording is")
    if wanted:
        said.append(f"BEMT and the recording agree only if it is no better than this: {', '.join(wanted)}")
    return "No uncertainty is stated for some recordings. " + "; ".join(said) + "."


def headline(result: Mapping[str, Any]) -> str:
    """Name a case for people."""
    words = str(result.get("title") or result.get("name") or "case").split()
    text = " ".join(words)
    return text if len(text) <= 140 else text[:139] + "…"
