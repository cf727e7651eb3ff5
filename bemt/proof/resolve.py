"""Whether the run that a diagnosis recommends would settle the tie, measured on the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bemt.proof.causes import CAUSES
from bemt.proof.items import Bench
from bemt.proof.separation import yardstick
from bemt.proof.stand import Stand
from bemt.proof.truth_world import Conditions

__all__ = ["extended", "resolves"]

_ENOUGH = 3.0


def extended(rows: Conditions, points: Sequence[Mapping[str, float]]) -> Conditions:
    """Rows of a plan with recommended points behind them, as a run of its own."""

    def column(name: str, key: str, usual: float, scale: float = 1.0) -> np.ndarray[Any, np.dtype[np.float64]]:
        new = [float(p[key]) * scale if key in p else usual for p in points]
        return np.concatenate((getattr(rows, name), new))

    last = float(rows.time[-1]) + 240.0
    moment = np.concatenate((rows.time, [float(p.get("time_s", last + 12.0 * k)) for k, p in enumerate(points)]))
    wall, gap = (float(np.median(v)) for v in (rows.wall, rows.gap))
    return Conditions(
        column("rpm", "rpm", float(np.median(rows.rpm))), column("airspeed", "airspeed_m_s", 0.0),
        column("temperature_C", "temperature_C", float(np.median(rows.temperature_C))),
        column("pressure_Pa", "pressure_Pa", float(np.median(rows.pressure_Pa))), moment,
        np.concatenate((rows.since_start, np.full(len(points), 600.0))), column("wall", "wall_distance_m", wall),
        column("gap", "tip_gap_mm", gap, 1e-3), np.concatenate((rows.run, np.full(len(points), rows.run.max() + 1))),
        rows.transient,
    )  # fmt: skip


def resolves(bench: Bench, entry: Mapping[str, Any], answer: Mapping[str, Any]) -> bool | None:
    """Whether the recommended points separate the concealed cause from what it was confused with."""
    points = (answer.get("next_measurement") or {}).get("points") or []
    if len(entry["causes"]) != 1 or not points or answer.get("verdict") not in ("class", "insufficient"):
        return None
    name = entry["causes"][0]
    named = [*answer.get("effects", ()), *answer["next_measurement"].get("separates", ())]
    more = Bench(bench.rig, bench.plan, extended(bench.rows, points))
    able = {c.id: c for c in more.allowed()}
    rivals = [i for i in dict.fromkeys(named) if i != name and i in able]
    if not rivals or name not in CAUSES:
        return None
    cause = CAUSES[name]
    change = cause.make(entry["strengths"][0], bench.rig, bench.rows, np.random.default_rng(int(entry["seed"])))
    plain, columns = more.measure(more.plain(), Stand())
    electric = {str(n): columns[n] for n in ("voltage_V", "current_A", "pwm_us") if n in columns}
    rule = yardstick(plain, more.rows.run, Stand(**entry["stand"]), more.tangents(), electric)
    rng = np.random.default_rng(0)
    others = {i: rule.stack(more.signature(able[i].make(1.0, more.rig, more.rows, rng), able[i])) for i in rivals}
    own = rule.stack(more.signature(change, cause))
    return rule.separation(own)[1] >= _ENOUGH and not rule.alike(own, others, _ENOUGH)
