"""What ``import`` shows of a recording beyond its columns: findings of the sanity checks, and its steady points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

from bemt.base import tables
from bemt.base.errors import InputError
from bemt.data.recordings.check import Finding, check
from bemt.data.recordings.reduce import reduce, reduction
from bemt.physics.dataset import Dataset

SHOWN = ("run", "pwm_s", "throttle", "rpm", "airspeed_m_s", "J", "thrust_N", "torque_Nm", "power_W",
         "electrical_power_W", "CT", "CP", "eta", "FM")  # fmt: skip
"""Channels of the table of points, as far as they are there."""
MOST = 40
"""Points shown; JSON has all."""


def is_recording(record: Dataset, adapted: bool) -> bool:
    """Whether a record is a table of measurements as a stand wrote it: to be checked and reduced."""
    if adapted:
        return False
    known = {name for name in record.values if record.unit(name)}
    loads = {"thrust_N", "torque_Nm", "T_N", "Q_Nm", "power_W"} & known
    return record.kind == "bench" or (record.kind == "table" and bool(loads) and any("rpm" in n for n in known))


def findings(record: Dataset) -> tuple[Finding, ...]:
    """Faults of a recording."""
    return check(record) if record.kind in ("bench", "table") else ()


def reduction_of(record: Dataset) -> Dataset | str:
    """Reduce, or say why not."""
    try:
        return reduce(record)
    except InputError as error:
        return "; ".join(
            f"got {f.got}; expected {f.expected}" + (f". {f.hint}" if f.hint else "") for f in error.faults
        )


def reduction_document(reduced: Dataset | str | None) -> dict[str, Any] | None:
    """The part of the JSON document that holds the steady points."""
    if reduced is None:
        return None
    if isinstance(reduced, str):
        return {"mode": None, "points": [], "correlated": {}, "dropped": [], "notes": [], "error": reduced}
    how = reduction(reduced)
    rows = [{**row, "direction": way} for row, way in zip(reduced.to_rows(), how.directions, strict=True)]
    return {
        "mode": how.mode,
        "points": rows,
        "correlated": {k: dict(v) for k, v in how.correlated.items()},
        "dropped": [asdict(lost) for lost in how.dropped],
        "notes": list(reduced.notes),
        "error": None,
    }


def ranges(lines: Iterable[tuple[int, int]]) -> str:
    """First and last lines as ranges.

    >>> ranges([(5, 5), (2, 3), (4, 4), (9, 9)])
    '2-5, 9'
    """
    out: list[list[int]] = []
    for first, last in sorted(set(lines)):
        if out and first <= out[-1][1] + 1:
            out[-1][1] = max(last, out[-1][1])
        else:
            out.append([first, last])
    return ", ".join(f"{a}" if a == b else f"{a}-{b}" for a, b in out)


def points_text(found: Mapping[str, Any]) -> list[str]:
    """Steady points, what was dropped and the notes, as lines of text."""
    if found["error"] is not None:
        return [f"  not reduced: {found['error']}"]
    points = found["points"]
    names = [k for k in SHOWN if any(_number(p.get(k)) is not None for p in points)]
    names = [k for k in names if k != "pwm_s" or "throttle" not in names]  # one command
    head = ["from"]
    for name in names:
        head += [name] + ([f"u({name})"] if any(_number(p["u"].get(name)) is not None for p in points) else [])
    rows = []
    for p in points[:MOST]:
        row = [str(p.get("label", "")).rsplit(":", 1)[-1]]
        for name in names:
            row.append(tables.number_text(_number(p.get(name)), 5))
            if f"u({name})" in head:
                row.append(tables.number_text(_number(p["u"].get(name)), 2))
        rows.append([*row, ", ".join(p["flags"]) or "-"])
    many = "" if len(points) <= MOST else f", the first {MOST} of them"
    what = "one per row" if found["mode"] == "points" else "means of plateaus"
    out = [f"  {len(points)} steady point{'s' if len(points) > 1 else ''}, {what}{many}:"]
    out.append(tables.text_table([*head, "flags"], rows, (len(head),), "    "))
    reasons: dict[tuple[str, str], list[tuple[int, int]]] = {}
    for lost in found["dropped"]:
        what = "rows" if not lost["channel"] else f"values of {lost['channel']}"
        reasons.setdefault((what, lost["reason"]), []).append((lost["line"], lost["last"]))
    for (what, reason), lines in reasons.items():
        text = ranges(lines)
        text = text if len(text) <= 90 else text[:90].rsplit(",", 1)[0] + ", ..."
        out.append(f"  dropped {sum(b - a + 1 for a, b in lines)} {what} (lines {text}): {reason}")
    for channel, parts in found["correlated"].items():
        words = ", ".join(f"{part} {value:.3g}" for part, value in parts.items())
        out.append(f"  shared by all points, {channel}: {words}")
    return out + [f"  . {note}" for note in found["notes"]]


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else None
