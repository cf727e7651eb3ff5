"""The chain of a diagnosis, from records and cases to one answer."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt import effects
from bemt.compare.scaling_laws import law
from bemt.diagnose import (
    blocks,
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
from bemt.diagnose import fit as fitting
from bemt.diagnose import locate as location
from bemt.diagnose import suggest as suggestion
from bemt.diagnose.assemble import build
from bemt.diagnose.explanation import NONE, Explanation
from bemt.diagnose.problem import Problem
from bemt.diagnose.record import CHANNELS

if TYPE_CHECKING:
    from bemt.case import Case
    from bemt.compare.recordings import RunChange
    from bemt.diagnose.record import Record

__all__ = ["Diagnosis", "diagnose"]

Array = NDArray[np.float64]


# Computed loads below this share of the largest have no ratio; departures above it are said where the median is small.
_NEAR_ZERO, _FAR = 0.1, 0.05


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything that was found.

    Attributes
    ----------
    found : Evidence
        Outcome of the weighing, with the problem in it.
    decision : Decision
        Verdict of the evidence in the case.
    said : Decision
        What is said in the end: the same, unless the ratios to the reference answer.
    best : Fit
        Leading explanation at its best setting.
    parameters : dict
        Effect to parameter to value and 90 % interval, of the leading explanation.
    p_value : float
        Of the gate [1].
    where : Location
        Of the mismatch; of the largest scatter when the verdict is none.
    scores : dict
        Channel to RMSE in its unit: before, after, noise, gp_only, holdout_before, holdout_after; mean and largest
        magnitude of the readings.
    blocks : str
        What was left out in turn for the held-out scores.
    after, held : (M,) float
        Readings as the improved model gives them: fitted, and each block from the others [units of the readings].
    next : Suggestion
        What would decide.
    alike : Confusion
        Distances of effects in this plan.
    absent : dict of str to str
        Effects that could not be tried, and why.
    drive : Diagnosis or None
        Of the motor's speed over pulse width, a problem of its own; None where it was not recorded.
    loads : Diagnosis or None
        Of thrust and torque, where they name nothing and the answer is that of the drive.
    change : RunChange or None
        Change from the references, where there is one recording beside them.
    """

    found: evidence.Evidence
    decision: verdict.Decision
    said: verdict.Decision
    best: fitting.Fit
    parameters: dict[str, dict[str, dict[str, Any]]]
    p_value: float
    where: location.Location
    scores: dict[str, dict[str, float]]
    blocks: str
    after: Array
    held: Array
    next: suggestion.Suggestion
    alike: confusion.Confusion
    absent: dict[str, str]
    drive: Diagnosis | None = None
    loads: Diagnosis | None = None
    change: RunChange | None = None

    @property
    def by_ratios(self) -> bool:
        """Whether the ratios to the reference answer."""
        return self.said.by == "ratios"

    @property
    def systems(self) -> dict[str, dict[str, Any]]:
        """Verdict and effects of air, stand and drive, each for itself."""
        said = self.said
        listed = said.verdict in ("named", "class", "sensor")
        kinds = {i: _kind(i) for i in said.effects}
        out: dict[str, dict[str, Any]] = {}
        for system in ("air", "stand", "drive"):
            mine = [i for i, kind in kinds.items() if kind == system]
            word = ("none" if not mine else said.verdict) if listed else said.verdict
            if self.loads is not None and system != "drive":
                word = self.loads.decision.verdict
            out[system] = {"verdict": word, "effects": mine}
        if self.drive is not None and self.drive is not self:
            out["drive"] = {"verdict": self.drive.decision.verdict, "effects": list(self.drive.decision.effects)}
        elif not any("rpm" in p.channels for p in self.problem.parts):
            out["drive"] = {"verdict": "not recorded", "effects": []}
        return out

    @property
    def problem(self) -> Problem:
        """Readings, baseline, nuisances."""
        return self.found.problem

    @property
    def off(self) -> dict[str, tuple[float, bool]]:
        """How far each channel is from the case: median of the ratio, less 1 [1]; or how far most go, and True."""
        p, out = self.problem, {}
        for c, name in enumerate(CHANNELS):
            here = (p.channel == c) & p.free
            here &= np.abs(p.f0) > _NEAR_ZERO * np.max(np.abs(p.f0), where=here, initial=0.0)
            if here.any():
                change = p.y[here] / p.f0[here] - 1.0
                order = np.argsort(np.abs(change))
                median, far = float(np.median(change)), float(change[order[int(0.9 * (change.size - 1))]])
                wide = abs(far) > _FAR and abs(median) < 0.5 * abs(far)
                out[name] = (far if wide else median), wide
        return out

    @property
    def marked(self) -> location.Location | None:
        """Location of the mismatch; None without one."""
        return None if self.decision.verdict == "none" else self.where


def _kind(name: str) -> str:
    """Sub-system of an effect; of a cause that only the comparison knows, that of its scaling law."""
    if name in effects.catalogue():
        return effects.catalogue()[name].kind
    row = law(name)
    return "air" if row is None else row.kind


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
            return change or ratio_check.change_of(records, each[0].diameter_m, absent, files)

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
    candidates, absent = signatures.candidates(problem, only, lambda name: say(f"solving with {name}"))
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
    if chosen.kind == "reference":
        file = "reference.csv"
        commands: tuple[str, ...] = (given.command(reference=file), given.comparison(file))
    elif chosen.kind == "run":
        commands = (given.command(run="new_run.csv"),)
    elif chosen.kind == "look":
        commands = (given.command(),)
    elif chosen.kind == "air":
        commands = given.of_days()
    elif chosen.kind == "rotor":
        commands = (f"python -m bemt calibrate-rotor REFERENCE {given.rest}", given.command(reference="REFERENCE"))
    elif chosen.kind == "mend":
        commands = tuple(f"python -m bemt import {f}" for f in given.recordings)
    else:
        commands = ()
    return replace(chosen, commands=commands)


def _settling(found: evidence.Evidence, decision: verdict.Decision, best: fitting.Fit) -> suggestion.Suggestion:
    """Run against the strongest rival of the leading explanation, "nothing" included where no name is given."""
    single = {i: found.probability[Explanation.of(i)] for i in found.spans}
    singles = sorted(single, key=lambda i: -single[i])
    if decision.verdict == "none":
        return suggestion.nothing_called_for(found)
    if mend := wrong_rotor_check.to_mend(found.problem, decision):
        return suggestion.Suggestion(mend, (), (), 0.0, 0.0, "mend")
    if decision.verdict in ("insufficient", "unknown") and wrong_rotor_check.another_label(found.problem):
        return suggestion.Suggestion(suggestion.ROTOR, (), (), 0.0, 0.0, "rotor")
    if not singles:
        return suggestion.Suggestion(suggestion.REFERENCE, (), (), 0.0, 0.0, "reference")
    if decision.verdict == "insufficient" and (note := suggestion.weather(found)):
        return note
    sure = decision.effects[:1] if decision.rule == verdict.BESIDE_IT else decision.effects
    claimed = decision.verdict in ("named", "sensor") or decision.rule == verdict.BESIDE_IT
    if claimed and (mended := suggestion.correction(sure, dict(zip(best.ids, best.settings, strict=True)))):
        return mended
    lead = best.ids[0] if best.ids else singles[0]
    listed = (*decision.effects, *(j for g in decision.classes for j in g), *singles)
    rivals = [i for i in listed if i != lead and i in found.spans]
    first = (lead, fitting.fit(found, Explanation.of(lead)).settings[0])
    likelier = bool(rivals) and single[rivals[0]] > found.probability[NONE]
    open_ = decision.verdict in ("class", "unknown", "insufficient")
    second = None
    if rivals and (decision.verdict != "insufficient" or likelier):
        second = (rivals[0], fitting.fit(found, Explanation.of(rivals[0])).settings[0])
    return suggestion.suggest(found, first, second, reference=open_)
