"""Whether the run that a diagnosis recommends would settle the tie, measured on the truth."""

from __future__ import annotations

import numpy as np

from bemt.judge.proof.causes import CAUSES
from bemt.judge.proof.items import Bench
from bemt.judge.proof.rigs import extended
from bemt.judge.proof.rows import Entry, ToldAnswer
from bemt.judge.proof.separation import yardstick
from bemt.judge.proof.stand import Stand

_ENOUGH = 3.0


def resolves(bench: Bench, entry: Entry, answer: ToldAnswer) -> bool | None:
    """Whether the recommended points separate the concealed cause from what it was confused with."""
    points = answer.step.points
    if len(entry.causes) != 1 or not points or answer.verdict not in ("class", "insufficient"):
        return None
    name = entry.causes[0]
    named = [*answer.effects, *answer.step.separates]
    more = Bench(bench.rig, bench.plan, extended(bench.rows, points))
    able = {c.id: c for c in more.allowed()}
    rivals = [i for i in dict.fromkeys(named) if i != name and i in able]
    if not rivals or name not in CAUSES:
        return None
    cause = CAUSES[name]
    change = cause.make(entry.strengths[0], bench.rig, bench.rows, np.random.default_rng(entry.seed))
    plain, columns = more.measure(more.plain(), Stand())
    electric = {str(n): columns[n] for n in ("voltage_V", "current_A", "pwm_us") if n in columns}
    rule = yardstick(plain, more.rows.run, Stand(**entry.stand), more.tangents(), electric)
    rng = np.random.default_rng(0)
    others = {i: rule.stack(more.signature(able[i].make(1.0, more.rig, more.rows, rng), able[i])) for i in rivals}
    own = rule.stack(more.signature(change, cause))
    return rule.separation(own)[1] >= _ENOUGH and not rule.alike(own, others, _ENOUGH)
