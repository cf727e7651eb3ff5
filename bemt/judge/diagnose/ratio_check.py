"""What the ratios to the reference say beside a diagnosis that stays open, and what they rule out.

The diagnosis asks which effect the solver lacks; its answer stays open where blade element theory is off for this
blade. The ratios of :mod:`bemt.compare` know no blade: how thrust and torque changed from the reference to the test, at
equal speed, is measured, and only some causes scale like that. Neither knows everything the other does: the class
holds what the ratios allow and what the diagnosis holds likely and no scaling law describes.
"""

from __future__ import annotations

import math
import os
import shlex
from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.errors import InputError
from bemt.data.recordings.load import import_file
from bemt.judge.compare.change_document import Invocation, next_step
from bemt.judge.compare.matched import LOADS
from bemt.judge.compare.recordings import RunChange, changed
from bemt.judge.compare.stand_run import StandRun, stand_run
from bemt.judge.diagnose.record import merged
from bemt.judge.diagnose.suggest import Suggestion
from bemt.physics.dataset import Dataset

if TYPE_CHECKING:
    from bemt.judge.compare.drive_laws import Judgement
    from bemt.judge.diagnose.record import Record

# Standard deviations from which a load has changed.
_CLEAR = 3.0
_LOADS = {"thrust_N": "thrust", "torque_Nm": "torque"}


def change_of(
    records: Sequence[Record],
    diameter_m: float,
    absent: Collection[str],
    judge: Callable[[RunChange], Judgement],
    files: Sequence[str] | None = None,
) -> RunChange | None:
    """Change of the one recording from its references; None where ratios are no measure of it.

    ``absent``: effects that cannot show; ``judge`` of the loads; ``files``: reference and test as a command names them.
    """
    known, tested = [[r for r in records if r.reference is which] for which in (True, False)]
    if len(tested) != 1 or not known or _transient(absent):
        return None
    pair = [merged(known), tested[0]]
    if _turned(pair):
        return None
    try:
        whole = _paths(files) if len(known) == 1 else []
        runs = [_run(r, diameter_m, f) for r, f in zip(pair, whole or (None, None), strict=True)]
        return changed(runs[0], runs[1], diameter_m, judge)
    except InputError:
        return None


def next_of(found: RunChange, files: Sequence[str] | None) -> Suggestion | None:
    """What settles an answer of the ratios; None where the step of the diagnosis stands."""
    reference, test = _paths(files) or ["REFERENCE", "RECORDING"]
    step = next_step(found, Invocation(reference, test))
    command = () if "CASE" in step["command"] or not step["command"] else (step["command"],)
    text = step["text"].removeprefix("to be sure, ")
    return Suggestion(text, (), (), 0.0, 0.0, "look", command) if text else None


def _transient(absent: Collection[str]) -> bool:
    """Whether the speed changes within a second in what was recorded: these rows are no steady points."""
    return bool({"inflow_lag", "rotor_inertia"} - set(absent))


def _turned(pair: Sequence[Record]) -> bool:
    """Whether a load changed its sign: ratios are those of sizes."""
    sums = [[float(np.nansum(r.measured[k])) for r in pair] for k in _LOADS if all(k in r.measured for r in pair)]
    return any(a * b < 0.0 for a, b in sums)


def _paths(files: Sequence[str] | None) -> list[str]:
    """Files without the quotes that a command needs; none where they are not both there."""
    names = [shlex.split(f)[0] for f in files or ()]
    return names if len(names) == 2 and all(os.path.exists(n) for n in names) else []


def _run(record: Record, diameter_m: float, file: str | None = None) -> StandRun:
    """Points of a record as a comparison takes them: of its file where that is known, which says more."""
    if file is not None:
        whole = stand_run(import_file(file), file, diameter_m)
        if {"airspeed_m_s", "J"} & whole.points.values.keys() or not np.any(record.V > 0.0):
            return whole
    loads = [k for k in _LOADS if k in record.measured]
    values = {"rpm": record.rpm, "airspeed_m_s": record.V, **{k: record.measured[k] for k in loads}}
    u = {k: np.nan_to_num(record.u[k]) for k in loads}
    if "run" in record.extra:
        values["run"] = record.extra["run"]
    density = float(np.mean(record.air.rho)) if record.air_recorded else math.nan
    return StandRun(Dataset("bench", record.name, values, u), "", density, diameter_m)


def clear_changes(change: RunChange) -> str:
    """Loads that changed by more than three standard deviations, set-up included; "" where there is none."""
    words = []
    for c in change.channels.values():
        r = change.ratios[c.channel]
        if c.name not in LOADS or r["extrapolated"]:
            continue
        unsure = math.hypot(math.log(r["high95"] / r["ratio"]) / 1.96, c.session)
        if abs(math.log(r["ratio"])) > _CLEAR * unsure:
            words.append(f"{c.name} differs by {r['ratio'] - 1.0:+.1%}".replace("%", " %"))
    return " and ".join(words)
