"""The chain of a diagnosis, from records and cases to one answer."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.judge.diagnose import (
    blocks,
    by_laws,
    confusion,
    evidence,
    gate,
    interval_scales,
    ratio_check,
    rules,
    signatures,
    verdict,
    wrong_rotor_check,
)
from bemt.judge.diagnose import fit as fitting
from bemt.judge.diagnose import locate as location
from bemt.judge.diagnose import suggest as suggestion
from bemt.judge.diagnose.answer import Diagnosis
from bemt.judge.diagnose.assemble import build
from bemt.judge.diagnose.explanation import NONE, UNKNOWN, Explanation
from bemt.judge.diagnose.record import CHANNELS
from bemt.judge.diagnose.shared_physics import ask_reference
from bemt.physics import effects

if TYPE_CHECKING:
    from bemt.judge.compare.recordings import RunChange
    from bemt.judge.diagnose.record import Record
    from bemt.rotors.case import Case

__all__ = ["Diagnosis", "diagnose"]

# Explanations that the next run is to tell apart.
_MOST_RIVALS = 5


def diagnose(
    records: Sequence[Record],
    cases: Sequence[Case],
    only: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
    nulls: int = gate.NULLS,
    baseline: str = "bemt",
    given: suggestion.Given | None = None,
    channels: Sequence[str] | None = None,
    change: RunChange | None = None,
) -> Diagnosis:
    """Say what was left out; ``change`` from the reference to the recording, where it was compared already."""
    say = progress or (lambda _: None)
    speed = CHANNELS[2]
    each = list(cases) * len(records) if len(cases) == 1 else list(cases)
    told = [(r.only(channels) if channels else r, c) for r, c in zip(records, each, strict=True)]
    loads = [(r.only(CHANNELS[:2]), c) for r, c in told if set(r.measured) - {speed}]
    turns = [(r.only((speed,)), c) for r, c in told if speed in r.measured]

    files = None if given is None else (*given.references[:1], *given.recordings[:1])
    free = only is None and channels is None and baseline == "bemt"

    def chain(
        some: Sequence[tuple[Record, Case]], ids: Sequence[str] | None, motor: Diagnosis | None = None,
        compared: bool = False,
    ) -> Diagnosis:  # fmt: skip
        def ratios(absent: Collection[str]) -> RunChange | None:
            if not (compared and free):
                return None
            return change or ratio_check.change_of(records, each[0].diameter_m, absent, by_laws.judged, files)

        return _diagnose([r for r, _ in some], [c for _, c in some], ids, say, nulls, baseline,
                         given or suggestion.Given(), motor, ratios)  # fmt: skip

    def tested(some: Sequence[tuple[Record, Case]]) -> bool:
        return any(not r.reference for r, _ in some)

    with evidence.one_thread():
        if not turns:
            return chain(told, only, compared=True)
        ids = [i for i in effects.catalogue() if only is None or i in only]
        # what drives the rotor cannot be seen in the loads at the measured speed, nor loads in the speed of a motor
        drives = [i for i in ids if effects.catalogue()[i].kind == "drive"]
        motor = chain(turns, drives) if drives and tested(turns) else None
        if not tested(loads):
            return motor or chain(told, only)
        rotor = chain(loads, [i for i in ids if i not in drives], motor, compared=True)
        if motor is not None and rotor.said.by == "drive":
            return replace(motor, drive=motor, loads=rotor, absent=rotor.absent)
        return rotor


def _diagnose(
    records: Sequence[Record],
    cases: Sequence[Case],
    only: Sequence[str] | None,
    say: Callable[[str], None],
    nulls: int,
    baseline: str,
    given: suggestion.Given,
    motor: Diagnosis | None,
    change: Callable[[Collection[str]], RunChange | None],
) -> Diagnosis:
    say("baseline and nuisances")
    problem = build(records, cases, baseline)
    if question := wrong_rotor_check.finding(problem):
        problem = replace(problem, between=(question, *problem.between))
    problem = replace(problem, shared=problem.missing)  # until the reference is asked
    candidates, absent = signatures.candidates(problem, only, lambda name: say(f"solving with {name}"))
    candidates = tuple(c for c in candidates if c.id not in given.ruled_out)
    absent |= dict.fromkeys(given.ruled_out, "ruled out by a check")
    problem, candidates = ask_reference(problem, candidates)
    say("weighing explanations")
    found = evidence.weigh(problem, candidates)
    say("bootstrapped nulls")
    p = gate.p_value(found, nulls)
    for state in found.states:  # factors that only nulls ask for are the largest arrays there are
        state.rivals.clear()
    query = verdict.VerdictQuery(found, p, None if motor is None else motor.decision, lambda: change(absent.keys()))
    said, decision = rules.decide(query), query.of_loads
    best, parameters = query.refined(decision.leading)
    parameters = interval_scales.widened(parameters)
    say("held-out blocks")
    words, held, gp_only = blocks.held_out(found, decision.leading if decision.verdict != "unknown" else NONE)
    if decision.verdict == "unknown":  # what is not in the library is predicted as what it is: something smooth
        held = gp_only
    smooth = fitting.smooth(found, best)
    after = problem.centre + best.signature + smooth
    # without a verdict the likeliest explanation still says best which part of the mismatch is not calibration
    listed = max((k for k in found.probability if k), key=lambda k: found.probability[k], default=None)
    where = location.locate(found, best if best.ids or listed is None else fitting.fit(found, listed))
    say("next measurement")
    step = _next(found, decision, best, given)
    if said.by == "ratios" and query.change is not None:
        files = (*given.references[:1], *given.recordings[:1])
        step = ratio_check.next_of(query.change, files) or step
    if said.by == "both" and motor is not None:
        decision, parameters = said, parameters | motor.parameters
    return Diagnosis(
        found, decision, said, best, parameters, p, where, _scores(found, after, held, gp_only), words, after, held,
        step, confusion.confusion(found), absent, motor, None, query.change,
    )  # fmt: skip


def _scores(found: evidence.Evidence, after: Array, held: Array, gp_only: Array) -> dict[str, dict[str, float]]:
    problem, scale = found.problem, found.states[0].hyper.scale
    out = {}
    for c, name in enumerate(CHANNELS):
        here = (problem.channel == c) & problem.free
        if not here.any():
            continue

        def rmse(model: Array, here: NDArray[np.bool_] = here) -> float:
            return float(np.sqrt(np.mean((problem.y - model)[here] ** 2)))

        out[name] = {
            "before": rmse(problem.f0), "after": rmse(after),
            "noise": float(np.sqrt(np.mean((scale * problem.u[here]) ** 2))),
            "gp_only": rmse(gp_only), "holdout_before": rmse(problem.f0), "holdout_after": rmse(held),
            "mean": float(np.mean(np.abs(problem.y[here]))),
            "largest": float(np.max(np.abs(problem.y[here]))),
        }  # fmt: skip
    return out


def _next(
    found: evidence.Evidence, decision: verdict.Decision, best: fitting.Fit, given: suggestion.Given
) -> suggestion.Suggestion:
    """What settles the question, and what to type then."""
    chosen = _settling(found, decision, best)
    other = chosen.otherwise
    if other is not None:
        other = replace(other, commands=_commands(other, given))
    return replace(chosen, commands=_commands(chosen, given), otherwise=other)


def _commands(chosen: suggestion.Suggestion, given: suggestion.Given) -> tuple[str, ...]:
    """What to type after a step."""
    if chosen.kind == "reference":
        file = "reference.csv"
        return given.command(reference=file), given.comparison(file)
    if chosen.kind == "run":
        return (given.command(run="new_run.csv"),)
    if chosen.kind == "look":
        return (given.command(ruled_out=chosen.checks),)
    if chosen.kind == "air":
        return given.of_days()
    if chosen.kind == "rotor":
        return f"bemt calibrate-rotor REFERENCE {given.rest}", given.command(reference="REFERENCE")
    if chosen.kind == "mend":
        return tuple(f"bemt import {f}" for f in given.recordings)
    return ()


def _settling(found: evidence.Evidence, decision: verdict.Decision, best: fitting.Fit) -> suggestion.Suggestion:
    """Run against the strongest rival of the leading explanation, "nothing" included where no name is given."""
    single = {i: found.probability[Explanation.of(i)] for i in found.spans}
    singles = sorted(single, key=lambda i: -single[i])

    def rivals_of(ids: Sequence[str]) -> list[suggestion.Rival]:
        settings = {i: fitting.fit(found, Explanation.of(i)).settings[0] for i in ids if i}
        return [suggestion.Rival(i, settings.get(i, {}), weight[i]) for i in ids]

    weight = single | {"": found.probability[NONE]}
    if decision.verdict == "none":
        faint = rivals_of(["", *singles][:_MOST_RIVALS])
        return suggestion.nothing_called_for(found, faint, found.probability[UNKNOWN])
    if mend := wrong_rotor_check.to_mend(found.problem, decision):
        return suggestion.mended(found, mend)
    if decision.verdict in ("insufficient", "unknown") and wrong_rotor_check.another_label(found.problem):
        return suggestion.Suggestion(suggestion.ROTOR, (), (), 0.0, 0.0, "rotor")
    if not singles:
        return suggestion.Suggestion(suggestion.REFERENCE, (), (), 0.0, 0.0, "reference")
    if decision.verdict == "insufficient" and (note := suggestion.weather(found)):
        return note
    sure = decision.effects[:1] if decision.rule == verdict.BESIDE_IT else decision.effects
    claimed = decision.verdict in ("named", "sensor") or decision.rule == verdict.BESIDE_IT
    if claimed and (
        mended := suggestion.correction(
            sure, dict(zip(best.ids, best.settings, strict=True)), found.problem.parts[0].record
        )
    ):
        return mended
    lead = best.ids[0] if best.ids else singles[0]
    listed = (*decision.effects, *(j for g in decision.classes for j in g), *singles)
    rivals = [i for i in dict.fromkeys(listed) if i != lead and i in found.spans]
    none = found.probability[NONE]
    likelier = bool(rivals) and single[rivals[0]] > none
    if not rivals or (decision.verdict == "insufficient" and not likelier):
        rivals.insert(0, "")
    else:
        rivals.append("")
    order = [lead, rivals[0], *sorted(rivals[1:], key=lambda i: -weight[i])][:_MOST_RIVALS]
    open_ = decision.verdict in ("class", "unknown", "insufficient")
    return suggestion.suggest(found, rivals_of(order), found.probability[UNKNOWN], reference=open_)
