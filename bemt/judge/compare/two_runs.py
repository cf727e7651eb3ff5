"""Two CFD runs with one speed of rotation: their differences with both errors. One point names no physics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt import __version__
from bemt.base.errors import InputError
from bemt.base.tables import number_text, text_table
from bemt.data.recordings.cfd_run import is_run
from bemt.data.recordings.cfd_setup import conditions_of, conditions_that_differ
from bemt.judge.compare.one_run import cfd_points
from bemt.judge.compare.selection import selected
from bemt.physics.dataset import Dataset

__all__ = ["compare_runs", "text"]

_LIKE = 0.01  # speeds, airspeeds and densities that are equal, share
_LOADS = {"thrust_N": "thrust [N]", "torque_Nm": "torque [N m]", "CT": "CT", "CP": "CP", "CQ": "CQ"}


def compare_runs(a: str, b: str, rows_a: Sequence[str] = (), rows_b: Sequence[str] = ()) -> dict[str, Any] | None:
    """Answer for two recordings of CFD of which one has a single speed; None for all others.

    ``bemt.comparison/1`` with the verdict ``insufficient`` and ``points``: at each equal speed and airspeed the loads
    of both with their standard uncertainties, the difference, and both uncertainties together.
    """
    from bemt.data.recordings.load import import_file

    if Path(a).resolve() == Path(b).resolve() and sorted(rows_a) == sorted(rows_b):
        return None  # refused by the comparison
    try:
        read = [selected(import_file(p), list(rows), p) for p, rows in ((a, rows_a), (b, rows_b))]
        if not all(is_run(d) or conditions_of(d) for d in read):
            return None
        first, second = (cfd_points(p, d)[0] for p, d in zip((a, b), read, strict=True))
    except InputError:  # the comparison says it
        return None
    if "rpm" not in first or "rpm" not in second or min(_speeds(first), _speeds(second)) > 1:
        return None
    points = [_point(first, second, i, j) for i, j in _pairs(first, second)]
    notes = [f"{name}: {note}" for name, d in (("A", first), ("B", second)) for note in d.notes]
    differ = {k.replace("_", " "): pair for k, pair in conditions_that_differ(*read).items()}
    return {
        "schema": "bemt.comparison/1", "version": __version__, "recordings": [a, b],
        "rows": {"A": list(rows_a), "B": list(rows_b)}, "verdict": "insufficient", "effects": [],
        "rule": "one speed of rotation cannot tell causes apart", "points": points,
        "conditions": {k: list(v) for k, v in differ.items()}, "notes": list(dict.fromkeys(notes)),
        "told": [_sentence(points, first, second)],
        "next_measurement": {
            "text": "Run both at two more speeds or airspeeds: one point fits any cause", "command": "",
        },
    }  # fmt: skip


def _speeds(d: Dataset) -> int:
    """Speeds of rotation that differ by more than a per cent."""
    known = np.sort(d["rpm"][np.isfinite(d["rpm"]) & (d["rpm"] > 0.0)])
    return 0 if not known.size else 1 + int(np.sum(np.diff(np.log(known)) > _LIKE))


def _airspeed(d: Dataset) -> NDArray[np.float64]:
    known = d.values.get("airspeed_m_s", np.zeros(len(d)))
    return np.asarray(np.nan_to_num(known), dtype=np.float64)


def _pairs(a: Dataset, b: Dataset) -> list[tuple[int, int]]:
    V, W = _airspeed(a), _airspeed(b)
    return [
        (i, j)
        for i in range(len(a))
        for j in range(len(b))
        if abs(b["rpm"][j] - a["rpm"][i]) <= _LIKE * a["rpm"][i] and abs(W[j] - V[i]) <= _LIKE * max(V[i], 1.0)
    ]


def _point(a: Dataset, b: Dataset, i: int, j: int) -> dict[str, Any]:
    loads: dict[str, Any] = {}
    for name in _LOADS:
        if name not in a or name not in b:
            continue
        x, y, u, w = (float(v) for v in (a[name][i], b[name][j], a.u[name][i], b.u[name][j]))
        if math.isfinite(x) and math.isfinite(y):
            both = math.hypot(u, w) if math.isfinite(u) and math.isfinite(w) else math.nan
            loads[name] = {"A": x, "u_A": u, "B": y, "u_B": w, "difference": y - x, "u_both": both}
    air = [float(d["density_kg_m3"][k]) if "density_kg_m3" in d else math.nan for d, k in ((a, i), (b, j))]
    return {"rpm": float(a["rpm"][i]), "airspeed_m_s": float(_airspeed(a)[i]), "density_kg_m3": air, "loads": loads}


def _percent(load: dict[str, Any]) -> str:
    return f"{load['difference'] / abs(load['A']):+.1%}" if load["A"] else "-"


def _sentence(points: list[dict[str, Any]], a: Dataset, b: Dataset) -> str:
    if not any(p["loads"] for p in points):
        where = [f"{number_text(d['rpm'][0], 5)} rev/min at {_airspeed(d)[0]:g} m/s" for d in (a, b)]
        return f"The two runs have no load at equal speed and airspeed: A {where[0]}, B {where[1]}."
    loads = next(p["loads"] for p in points if p["loads"])
    parts = ", ".join(f"{name.split('_')[0]} {_percent(load)}" for name, load in loads.items())
    sizes = [abs(load["difference"]) / load["u_both"] for load in loads.values() if load["u_both"] > 0.0]
    if not sizes:
        judged = "no run states its error, so nothing says whether that is much"
    elif max(sizes) <= 1.0:
        judged = "within the errors of both"
    elif max(sizes) <= 2.0:
        judged = "within twice the errors of both"
    else:
        judged = f"up to {max(sizes):.1f} times the errors of both: the runs differ"
    return f"B against A at one point: {parts}; {judged}."


def text(document: dict[str, Any]) -> str:
    """The answer in a few lines."""
    lines = [*document["told"], f"verdict: {document['verdict']} ({document['rule']})", ""]
    rows = []
    for p in document["points"]:
        head = [number_text(p["rpm"], 6), number_text(p["airspeed_m_s"], 4)]
        for name, load in p["loads"].items():
            size = abs(load["difference"]) / load["u_both"] if load["u_both"] else math.nan
            both = [f"{number_text(load[k], 4)} ± {_u(load['u_' + k])}" for k in ("A", "B")]
            rows.append([*head, _LOADS[name], *both, f"{number_text(load['difference'], 3)} ({_percent(load)})",
                         number_text(size, 2)])  # fmt: skip
            head = ["", ""]
    if rows:
        lines.append(text_table(["rev/min", "V [m/s]", "", "A", "B", "B - A", "in u"], rows, (2,), "  "))
        lines += ["  ±: one standard uncertainty of each run; in u: over both together", ""]
    for p in document["points"]:
        x, y = p["density_kg_m3"]
        if abs(y - x) > _LIKE * x:
            lines.append(f"! air: {x:.4g} and {y:.4g} kg/m3, which alone changes the loads by {y / x - 1:+.1%}")
    lines += [f"! {k}: {x} and {y}" for k, (x, y) in document["conditions"].items()]
    lines += [f"! {note}" for note in document["notes"]]
    return "\n".join([*lines, f"Next: {document['next_measurement']['text']}."])


def _u(value: float) -> str:
    return number_text(value, 2) if math.isfinite(value) else "?"
