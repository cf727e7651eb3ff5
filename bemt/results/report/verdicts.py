"""Sentences about a case, in the language of ASME V&V 20: nothing is ever called correct."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from bemt.base.tables import number_text
from bemt.results.sweep.rows import Comparison, Result, Row, State

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


def _solved(result: Result) -> Row | tuple[str, str, str]:
    """BEMT at the operating point of the case, or the verdict where there is none."""
    if not result.rows:
        n = len(result.faults)
        return "fault", "not solved", f"{n} fault{'s' * (n != 1)} in the input; nothing was computed."
    own = result.first("bemt")
    if own is None or not _finite(own.thrust_N):
        return "fault", "no result", "BEMT did not converge at the operating point of the case."
    return own


def verdict(result: Result) -> tuple[str, str, str]:
    """Say how BEMT and the recordings of a case stand: kind and words of a badge, and sentences.

    >>> verdict(Result("mine", faults=("a", "b")))
    ('fault', 'not solved', '2 faults in the input; nothing was computed.')
    """
    row = _solved(result)
    if isinstance(row, tuple):
        return row
    words = f"BEMT gives {_n(row.thrust_N, 4)} N"
    if _finite(row.u):
        words += f" ± {_n(row.u, 2)} N (one standard uncertainty: inputs that the source does not state, and the model)"
    lines = _thrusts(result)
    if not lines:
        return "unknown", NOTHING_RECORDED, f"{words}. There is no recorded thrust to compare it with."
    parts = [f"{c.reference} {c.E_pct:+.1f} %" if c.D else c.reference for c in lines]
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
    main = next(iter([*far, *(c for c in lines if c.state == "agrees"), *lines]))
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
        told.append(
            f"Agrees only if the recording (no uncertainty stated) is at least this uncertain: {', '.join(wanted)}."
        )
    return told


def answer(result: Result) -> str:
    """Answer in one sentence: both numbers, and what their agreement hangs on; then the other recordings.

    >>> from bemt.data.recordings.audit import Audit
    >>> cfd = Comparison(source="cfd", reference="cfd", S=119.1, D=104.9, u_num=0.1, u_input=13.0)
    >>> audit = Audit("cfd", (), math.nan, 0.041)
    >>> answer(Result("mine", rows=(Row("bemt", "bemt", 119.1, u=13.0),), comparisons=(cfd,), audit=(audit,)))
    'BEMT 119.1 ± 13 N, CFD 104.9 N (BEMT +13.5 %): they agree if the CFD is uncertain by 5.4 % or more; our audit of the recording finds an error of 4.1 % or more.'
    """  # noqa: E501
    own = _solved(result)
    if isinstance(own, tuple):
        return own[2]
    band = f" ± {_n(own.u, 2)}" if _finite(own.u) else ""
    head = f"BEMT {_n(own.thrust_N, 4)}{band} N"
    lines = _thrusts(result)
    if not lines:
        power = f", {_n(own.power_W)} W at the shaft" if _finite(own.power_W) else ""
        return f"{head}{power}; nothing is recorded to compare it with."
    c = lines[0]
    name = NAMES[c.source]
    share = f" (BEMT {c.E_pct:+.1f} %)" if c.D else ""
    told = [f"{head}, {name} {_n(c.D, 4)} N{share}: {_hangs(c, name)}{_audited(result, c)}."]
    seen = {(c.source, _n(c.D, 3))}
    rest: dict[str, list[str]] = {}
    for c in lines[1:]:
        if (key := (c.source, _n(c.D, 3))) not in seen:
            seen.add(key)
            rest.setdefault(stand(c)[1], []).append(f"{NAMES[c.source]} {key[1]} N")
    told += [f"{', '.join(names)}: {words}." for words, names in rest.items()]
    return " ".join(t[:1].upper() + t[1:] for t in told)


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
    return f"; our audit of the recording finds an error of {100.0 * share:.2g} % or more"


def headline(result: Result) -> str:
    """Name a case for people."""
    words = (result.title or result.name or "case").split()
    text = " ".join(words)
    return text if len(text) <= 140 else text[:139] + "…"
