"""Two CFD recordings on two grids: that is said before any physics, for another grid alone changes the loads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bemt import __version__
from bemt.base.errors import InputError
from bemt.data.recordings.cfd_setup import GRID_FLOOR, GRID_FLOOR_SOURCE, conditions_that_differ, grid_that_differs
from bemt.data.recordings.channels import named
from bemt.judge.compare.selection import selected
from bemt.physics.dataset import Dataset

_LIKE = 0.01  # speeds and airspeeds that are one point, share


def compare_grids(a: str, b: str, rows_a: Sequence[str] = (), rows_b: Sequence[str] = ()) -> dict[str, Any] | None:
    """Answer for two CFD recordings whose grid differs; None where it does not, or is not stated.

    ``bemt.comparison/1`` with the verdict ``insufficient``: what differs, ratios B over A at equal points. Rows to use
    are named as ``level=5``.
    """
    from bemt.data.recordings.load import import_file

    try:
        first, second = (selected(import_file(p), list(rows), p) for p, rows in ((a, rows_a), (b, rows_b)))
    except InputError:  # the comparison says it
        return None
    words = grid_that_differs(first, second)
    if not words:
        return None
    differ = conditions_that_differ(first, second)
    ratios = _ratios(named(first), named(second))
    rest = GRID_FLOOR["rest"]
    told = [
        f"{words[0].upper()}{words[1:]}. No physics is named before the grid is the same.",
        f"The next grid alone changes thrust by {rest['thrust_N']:.0%} and torque by {rest['torque_Nm']:.0%} "
        f"({GRID_FLOOR_SOURCE}).",
    ]
    also = {k: v for k, v in differ.items() if k not in ("grid_level", "cells")}
    if also:
        told.append("Also: " + "; ".join(f"{k.replace('_', ' ')} {x} and {y}" for k, (x, y) in also.items()) + ".")
    return {
        "schema": "bemt.comparison/1", "version": __version__, "recordings": [a, b],
        "rows": {"A": list(rows_a), "B": list(rows_b)}, "verdict": "insufficient", "effects": [], "rule": words,
        "conditions": {k: list(v) for k, v in differ.items()}, "ratios": ratios, "told": told,
        "next_measurement": {"text": "Compare runs on one grid, or state the u of a grid study", "command": ""},
    }  # fmt: skip


def _ratios(a: Dataset, b: Dataset) -> dict[str, Any]:
    """B over A at equal speed and airspeed: lowest, mean, highest, number of pairs."""
    out: dict[str, Any] = {}
    if "rpm" not in a or "rpm" not in b:
        return out
    V = [np.nan_to_num(d.values.get("airspeed_m_s", np.zeros(len(d)))) for d in (a, b)]
    for name in ("thrust_N", "torque_Nm"):
        if name not in a or name not in b:
            continue
        found = []
        for i in range(len(a)):
            same = np.abs(b["rpm"] - a["rpm"][i]) <= _LIKE * a["rpm"][i]
            same &= np.abs(V[1] - V[0][i]) <= _LIKE * max(V[0][i], 1.0)
            found += [float(y / a[name][i]) for y in b[name][same] if np.isfinite(y) and a[name][i]]
        found = [r for r in found if np.isfinite(r)]
        if found:
            out[name] = {"ratio": float(np.mean(found)), "low": min(found), "high": max(found), "pairs": len(found)}
    return out


def text(document: dict[str, Any]) -> str:
    """The answer in a few lines."""
    lines = [*document["told"], f"verdict: {document['verdict']}"]
    for name, r in document["ratios"].items():
        wide = f" ({r['low'] - 1:+.1%} to {r['high'] - 1:+.1%})" if r["pairs"] > 1 else ""
        pairs = f"{r['pairs']} pair{'s' if r['pairs'] > 1 else ''} of equal speed and airspeed"
        lines.append(f"  {name.split('_')[0]}: B is {r['ratio'] - 1:+.1%} of A{wide}, {pairs}")
    if not document["ratios"]:
        lines.append("  no point at equal speed and airspeed")
    return "\n".join([*lines, f"Next: {document['next_measurement']['text']}."])
