"""Sentences about a case, in the language of ASME V&V 20: nothing is ever called correct."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bemt.base.tables import number_text
from bemt.sweep.agreement import doubted, needed

NAMES = {"cfd": "CFD", "bench": "bench", "vendor": "vendor", "flight": "flight", "openfoam": "own CFD"}
"""Sources in the order in which they are spoken of."""


NOTHING_RECORDED = "nothing recorded"
"""Words of the badge of a case without recordings."""


def _n(value: Any, digits: int = 3) -> str:
    return number_text(float(value), digits) if _finite(value) else "unknown"


def _finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def recorded(result: Mapping[str, Any], source: str) -> list[Mapping[str, Any]]:
    """Rows of one source."""
    return [row for row in result.get("rows", []) if row.get("source") == source]


def stand(c: Mapping[str, Any]) -> tuple[str, str]:
    """Kind of a badge, and how model and recording stand or what agreement would need, in few words.

    >>> stand({"E": 14.2, "D": 104.9, "u_num": 0.1, "u_input": 13.0, "u_model": 0.0, "u_val": None})
    ('unknown', 'needs u_D ≥ 5.4 %')
    >>> stand({"E": 1.0, "D": 9.0, "u_num": 0.1, "u_input": 2.0, "u_model": 0.0, "doubts": ["supersonic tip"]})
    ('unknown', "inside the model's band, but flagged: supersonic tip")
    """
    kind, words = _stand(c)
    return ("unknown" if c.get("doubts") and kind == "same" else kind), words + doubted(c)


def _stand(c: Mapping[str, Any]) -> tuple[str, str]:
    if not _finite(c.get("E")):
        return "fault", "no result"
    if _finite(c.get("u_val")):
        far = abs(c["E"]) / c["u_val"] if c["u_val"] else math.inf
        return ("same", "agrees within u_val") if far <= 1.0 else ("differs", f"differs by {far:.2g} u_val")
    if not _finite(needed(c)):
        return "unknown", "model's u unknown"
    if needed(c) == 0.0:
        return "same", "inside the model's band"
    share = f"{_share(c)} %" if c.get("D") else _n(needed(c), 2)
    return "unknown", f"needs u_D ≥ {share}"


def _share(c: Mapping[str, Any]) -> str:
    """Uncertainty of the recording that agreement needs, in per cent of it."""
    return f"{100.0 * needed(c) / abs(c['D']):.2g}"


def _thrusts(result: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Recorded thrusts that BEMT is compared with, in the order of the sources."""
    lines = [
        c
        for c in result.get("comparisons", [])
        if c.get("model") == "bemt" and c.get("quantity") == "thrust_N" and _finite(c.get("E"))
    ]
    return [c for source in NAMES for c in lines if c.get("source") == source]


def _unsolved(result: Mapping[str, Any]) -> tuple[str, str, str] | None:
    if not result.get("rows"):
        n = len(result.get("faults", []))
        return "fault", "not solved", f"{n} fault{'s' * (n != 1)} in the input; nothing was computed."
    own = recorded(result, "bemt")
    if not own or not _finite(own[0].get("thrust_N")):
        return "fault", "no result", "BEMT did not converge at the operating point of the case."
    return None


def verdict(result: Mapping[str, Any]) -> tuple[str, str, str]:
    """Say how BEMT and the recordings of a case stand: kind and words of a badge, and sentences.

    >>> verdict({"rows": [], "faults": ["a", "b"]})
    ('fault', 'not solved', '2 faults in the input; nothing was computed.')
    """
    if (unsolved := _unsolved(result)) is not None:
        return unsolved
    row = recorded(result, "bemt")[0]
    words = f"BEMT gives {_n(row['thrust_N'], 4)} N"
    if _finite(row.get("u")):
        words += (
            f" ± {_n(row['u'], 2)} N (one standard uncertainty: inputs that the source does not state, and the model)"
        )
    lines = _thrusts(result)
    if not lines:
        return "unknown", NOTHING_RECORDED, f"{words}. There is no recorded thrust to compare it with."
    parts = [f"{c['reference']} {c['E_pct']:+.1f} %" if _finite(c.get("E_pct")) else str(c["reference"]) for c in lines]
    told = [f"{words}. Difference from {'; '.join(parts)}."]
    judged = [c for c in lines if _finite(c.get("u_val"))]
    far = [c for c in judged if abs(c["E"]) > c["u_val"]]
    if far:
        names = ", ".join(f"{c['reference']} (|E| {_n(abs(c['E']))} N, u_val {_n(c['u_val'])} N)" for c in far)
        told.append(f"It differs by more than the validation uncertainty from {names}.")
    near = [str(c["reference"]) for c in judged if c not in far]
    if near:
        told.append(f"Not distinguishable from noise against {', '.join(near)}: |E| is within u_val.")
    told += _open([c for c in lines if c not in judged])
    told += [f"Flagged: {flag}." for flag in row.get("flags", ())]
    main = next((c for c in lines if c in far), (judged or lines)[0])
    return (*stand(main), " ".join(told))


def _open(lines: Sequence[Mapping[str, Any]]) -> list[str]:
    """What recordings that state no uncertainty would need for agreement."""
    inside = [str(c["reference"]) for c in lines if needed(c) == 0.0]
    wanted = [
        f"{c['reference']} {_n(needed(c), 2)} N" + (f" ({_share(c)} %)" if c.get("D") else "")
        for c in lines
        if needed(c) > 0.0
    ]
    told = []
    if inside:
        told.append(f"Within BEMT's own band, whatever the uncertainty of the recording: {', '.join(inside)}.")
    if wanted:
        told.append(
            f"Agrees only if the recording (no uncertainty stated) is at least this uncertain: {', '.join(wanted)}."
        )
    return told


def answer(result: Mapping[str, Any]) -> str:
    """Answer in one sentence: both numbers, and what their agreement hangs on; then the other recordings.

    >>> row = {"source": "bemt", "thrust_N": 119.1, "u": 13.0}
    >>> cfd = {"model": "bemt", "quantity": "thrust_N", "source": "cfd", "reference": "cfd", "D": 104.9, "E": 14.2,
    ...        "E_pct": 13.5, "u_num": 0.1, "u_input": 13.0, "u_model": 0.0, "u_val": None}
    >>> audit = {"reference": "cfd", "u_relative_known": 0.041}
    >>> answer({"rows": [row], "comparisons": [cfd], "audit": [audit]})
    'BEMT 119.1 ± 13 N, CFD 104.9 N (BEMT +13.5 %): they agree if the CFD is uncertain by 5.4 % or more; our audit of the recording finds an error of 4.1 % or more.'
    """  # noqa: E501
    if (unsolved := _unsolved(result)) is not None:
        return unsolved[2]
    own = recorded(result, "bemt")[0]
    band = f" ± {_n(own['u'], 2)}" if _finite(own.get("u")) else ""
    head = f"BEMT {_n(own['thrust_N'], 4)}{band} N"
    lines = _thrusts(result)
    if not lines:
        power = f", {_n(own['power_W'])} W at the shaft" if _finite(own.get("power_W")) else ""
        return f"{head}{power}; nothing is recorded to compare it with."
    c = lines[0]
    name = NAMES[c["source"]]
    share = f" (BEMT {c['E_pct']:+.1f} %)" if _finite(c.get("E_pct")) else ""
    told = [f"{head}, {name} {_n(c['D'], 4)} N{share}: {_hangs(c, name)}{_audited(result, c)}."]
    seen = {(c["source"], _n(c["D"], 3))}
    rest: dict[str, list[str]] = {}
    for c in lines[1:]:
        if (key := (c["source"], _n(c["D"], 3))) not in seen:
            seen.add(key)
            rest.setdefault(stand(c)[1], []).append(f"{NAMES[c['source']]} {key[1]} N")
    told += [f"{', '.join(names)}: {words}." for words, names in rest.items()]
    return " ".join(t[:1].upper() + t[1:] for t in told)


def _hangs(c: Mapping[str, Any], name: str) -> str:
    """What the agreement of one comparison hangs on."""
    return _hangs_on(c, name) + doubted(c)


def _hangs_on(c: Mapping[str, Any], name: str) -> str:
    if _finite(c.get("u_val")):
        far = abs(c["E"]) / c["u_val"] if c["u_val"] else math.inf
        return "they agree within u_val" if far <= 1.0 else f"they differ by {far:.1f} times u_val"
    if not _finite(needed(c)):
        return "BEMT's own uncertainty is unknown here"
    if needed(c) == 0.0:
        return "they agree within BEMT's own band"
    return f"they agree if the {name} is uncertain by {_share(c)} % or more"


def _audited(result: Mapping[str, Any], c: Mapping[str, Any]) -> str:
    """What the audit of a recorded CFD value knows of its uncertainty."""
    audit = next((a for a in result.get("audit", []) if a.get("reference") == c.get("reference")), None)
    share: Any = audit.get("u_relative_known") if audit else None
    if not _finite(share) or share <= 0:
        return ""
    return f"; our audit of the recording finds an error of {100.0 * share:.2g} % or more"


def headline(result: Mapping[str, Any]) -> str:
    """Name a case for people."""
    words = str(result.get("title") or result.get("name") or "case").split()
    text = " ".join(words)
    return text if len(text) <= 140 else text[:139] + "…"
