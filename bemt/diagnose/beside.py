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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.errors import InputError
from bemt.compare.change_document import document, next_step
from bemt.compare.contrast_text import headline
from bemt.compare.invocation import Invocation
from bemt.compare.recordings import RunChange, changed
from bemt.compare.scaling_laws import LAWS
from bemt.compare.stand_run import StandRun, stand_run
from bemt.dataset import Dataset
from bemt.diagnose.suggest import Suggestion
from bemt.effects import catalogue
from bemt.recordings.load import import_file

if TYPE_CHECKING:
    from bemt.diagnose.chain import Diagnosis
    from bemt.diagnose.record import Record

__all__ = ["Beside", "beside"]

_CLAIMS = ("named", "sensor", "class")
# Loads that agree to the first while an effect would change one by the second, natural logarithm.
_AGREE, _WOULD = 0.03, 0.1
# Probability in the diagnosis from which an effect that no scaling law describes is in the class.
_LIKELY = 0.1
_SAME_ROTOR = "make sure that the case is this rotor: both runs differ from it in the same way"
_LOADS = {"thrust_N": "thrust", "torque_Nm": "torque"}


@dataclass(frozen=True)
class Beside:
    """Answer of the ratios, in place of the diagnosis' own."""

    verdict: str
    effects: tuple[str, ...]
    probability: float
    why: str
    headline: str
    told: str  # Both answers, in a sentence
    ranking: tuple[Mapping[str, Any], ...]
    next: Suggestion | None  # What settles it; None where that of the diagnosis stands


def beside(
    answer: Diagnosis, records: Sequence[Record], diameter_m: float, files: Sequence[str] | None = None
) -> Beside | None:
    """Answer of the ratios where they have one and the diagnosis has none, or none that they allow.

    ``files``: reference and test as a command names them.
    """
    pair = [r for known in (True, False) for r in records if r.reference is known]
    if len(pair) != 2 or not pair[0].reference or pair[1].reference or _transient(answer) or _turned(pair):
        return None
    try:
        runs = [_run(r, diameter_m, f) for r, f in zip(pair, _paths(files) or (None, None), strict=True)]
        found = changed(runs[0], runs[1], diameter_m)
    except InputError:
        return None
    said, ratios = answer.decision, found.loads
    doc = document(found)
    ranking = tuple(doc["ranking"])
    words = headline(doc)
    if said.verdict in _CLAIMS:
        if ratios.verdict != "none" or found.leading is not ratios or not (too_large := _too_large(answer, found)):
            return None
        why = f"{' and '.join(said.effects)} would change {too_large}"
        told = f"Recording and reference agree, {ratios.why}; {why}."
        known = Suggestion(_SAME_ROTOR, (), (), 0.0, 0.0, "look")
        return Beside("none", (), ratios.probability["none"], why, words, told, ranking, known)
    if said.verdict != "insufficient" or ratios.verdict not in _CLAIMS or not _of_label(answer):
        return None
    likely = {i: sum(p for k, p in answer.found.probability.items() if i in k.ids) for i in answer.found.spans}
    # a single name is not for the ratios to give: they know no blade, and what the diagnosis holds likely may be it
    weighed = {*ratios.probability, *(row.id for row in LAWS)} if ratios.verdict == "class" else set(ratios.effects)
    lone = [i for i, p in sorted(likely.items(), key=lambda kv: -kv[1]) if p >= _LIKELY and i not in weighed]
    effects = (*ratios.effects, *lone)
    verdict = ratios.verdict if not lone else "class"
    # a cut tip is another diameter
    titles = " or ".join(catalogue()[i].title for i in lone if i != "tip_cut" or "diameter" not in ratios.effects)
    words = f"{words[:-1]}; the model also allows {titles}." if titles else words
    told = f"The ratios to the reference: {ratios.why}. The diagnosis with the case: {said.verdict}: {said.why}."
    chance = sum(ratios.probability.get(k, 0.0) for k in ratios.effects)
    return Beside(verdict, effects, chance, ratios.why, words, told, ranking, _next(found, files))


def _next(found: RunChange, files: Sequence[str] | None) -> Suggestion | None:
    """Step of the comparison, without asking for the case that is there."""
    reference, test = _paths(files) or ["REFERENCE", "RECORDING"]
    step = next_step(found, Invocation(reference, test))
    command = () if "CASE" in step["command"] or not step["command"] else (step["command"],)
    text = step["text"].removeprefix("to be sure, ")
    return Suggestion(text, (), (), 0.0, 0.0, "look", command) if text else None


def _of_label(answer: Diagnosis) -> bool:
    """Whether the case was made from a label. A blade that is better known speaks for itself, silent or not."""
    built = [p.as_built for p in answer.problem.parts]
    return any(b is not None and b.prior.known_from == "label" for b in built)


def _transient(answer: Diagnosis) -> bool:
    """Whether the speed changes within a second in what was recorded: these rows are no steady points."""
    return bool({"inflow_lag", "rotor_inertia"} - answer.absent.keys())


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


def _too_large(answer: Diagnosis, found: RunChange) -> str:
    """Load that the named effect would change and that did not change; "" where there is none."""
    problem, change = answer.problem, answer.best.signature
    for c, (name, word) in enumerate(_LOADS.items()):
        here = (problem.channel == c) & problem.free
        r = found.ratios.get(name)
        if r is None or not here.any() or abs(math.log(r["ratio"])) > _AGREE:
            continue
        would = float(np.median(change[here] / problem.f0[here]))
        if abs(would) > _WOULD:
            return f"{word} by {would:+.0%}; it differs by {r['ratio'] - 1.0:+.1%}"
    return ""
