"""The chain of a diagnosis, from records and cases to one answer."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.gaussian.evidence import shares
from bemt.base.gaussian.whitening import whitener
from bemt.judge import loss
from bemt.judge.compare.change_document import ONE_SETUP
from bemt.judge.compare.recordings import RunChange
from bemt.judge.diagnose import by_laws, form, knowledge, noise, other_rotor, posterior, signatures
from bemt.judge.diagnose import fit as fitting
from bemt.judge.diagnose import suggest as suggestion
from bemt.judge.diagnose.answer import Diagnosis, locate
from bemt.judge.diagnose.assemble import build
from bemt.judge.diagnose.knowledge import ALWAYS
from bemt.judge.diagnose.nuisance import following
from bemt.judge.diagnose.problem import Problem
from bemt.judge.diagnose.record import CHANNELS, Record
from bemt.judge.diagnose.signatures import Candidate
from bemt.judge.explanation import NONE, UNKNOWN, Explanation
from bemt.physics import effects
from bemt.rotors.case import Case

__all__ = ["MOTOR", "Diagnosis", "diagnose"]

MOTOR = "motor"
"""Another motor, controller or setting: what nothing in the catalogue describes, and all that is left of an unknown
change of the speed at a pulse width."""
# Explanations that the next run is to tell apart.
_MOST_RIVALS = 5


def diagnose(
    records: Sequence[Record], cases: Sequence[Case], only: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None, baseline: str = "bemt", given: suggestion.Given | None = None,
    channels: Sequence[str] | None = None, change: RunChange | None = None,
) -> Diagnosis:  # fmt: skip
    """Say what was left out; ``change`` from the reference to the recording, where it was compared already."""
    say = progress or (lambda _: None)
    speed = CHANNELS[2]
    given = given or suggestion.Given()
    each = list(cases) * len(records) if len(cases) == 1 else list(cases)
    told = [(r.only(channels) if channels else r, c) for r, c in zip(records, each, strict=True)]
    loads = [(r.only(CHANNELS[:2]), c) for r, c in told if set(r.measured) - {speed}]
    # the formula knows no torque, which is what loads a drive
    turns = [(r.only((speed,)), c) for r, c in told if speed in r.measured and baseline == "bemt"]
    gone = {*given.ruled_out, *(() if only is None else effects.catalogue().keys() - set(only))}

    def compared(absent: Collection[str]) -> RunChange | None:
        if channels is not None or baseline != "bemt":
            return None
        judged = partial(by_laws.judged, only=only)
        known = given.ruled_out, given.changed
        return change or knowledge.change_of(records, each[0].diameter_m, absent, judged, *known)

    def chain(
        some: Sequence[tuple[Record, Case]], ids: Sequence[str] | None,
        ratios: Callable[[Collection[str]], RunChange | None] = lambda _: None, rotor: Diagnosis | None = None,
    ) -> Diagnosis:  # fmt: skip
        return _diagnose([r for r, _ in some], [c for _, c in some], ids, say, baseline, given, ratios, rotor, gone)

    def tested(some: Sequence[tuple[Record, Case]]) -> bool:
        return any(not r.reference for r, _ in some)

    with posterior.one_thread():
        if not turns:
            return chain(told, only, compared)
        ids = [i for i, cls in effects.catalogue().items() if (cls.diagnosed if only is None else i in only)]
        # what drives the rotor cannot be seen in the loads at the measured speed, nor loads in the speed of a motor
        drives = [i for i in ids if effects.catalogue()[i].kind == "drive"]
        rotor = chain(loads, [i for i in ids if i not in drives], compared) if tested(loads) else None
        motor = chain(turns, drives, rotor=rotor) if drives and tested(turns) else None
        if rotor is None or motor is None:
            return rotor or motor or chain(told, only)
        return _with_drive(rotor, motor)


def _diagnose(
    records: Sequence[Record], cases: Sequence[Case], only: Sequence[str] | None, say: Callable[[str], None],
    baseline: str, given: suggestion.Given, ratios: Callable[[Collection[str]], RunChange | None],
    rotor: Diagnosis | None, gone: Collection[str],
) -> Diagnosis:  # fmt: skip
    say("baseline and nuisances")
    problem = build(records, cases, baseline)
    if question := other_rotor.finding(problem):
        problem = replace(problem, between=(question, *problem.between))
    problem = following(problem, rotor.problem) if rotor is not None else problem
    # until the reference is asked
    problem = replace(problem, shared=problem.missing, told=frozenset(given.changed))
    candidates, absent = signatures.candidates(problem, only, lambda name: say(f"solving with {name}"))
    candidates = tuple(c for c in knowledge.possible(problem, candidates) if c.id not in given.ruled_out)
    absent |= dict.fromkeys(given.ruled_out, "ruled out by a check")
    problem, candidates = ask_reference(problem, candidates)
    change = ratios(absent.keys()) if any(p.record.reference for p in problem.parts) else None
    if change is not None:
        candidates = tuple(by_laws.as_driven(c, change, problem) for c in candidates)
    say("weighing explanations")
    found = posterior.weigh(problem, candidates, gone=gone)
    found = replace(found, probability=knowledge.combined(found, change))
    P = _of_motor(found)
    decision = _decided(P, found.probability)
    decision = knowledge.reason(problem, decision)
    shown = decision.leading if all(i in found.spans for i in decision.leading) else _solved(found)
    best, parameters = fitting.refined(found, fitting.fit(found, shown))
    parameters = fitting.widened(parameters) if shown == decision.leading or decision.verdict not in loss.CLAIMS else {}
    say("held-out blocks")
    words, held, gp_only = held_out(found, shown if decision.verdict != "unknown" else NONE)
    if decision.verdict == "unknown":  # what is not in the library is predicted as what it is: something smooth
        held = gp_only
    smooth = fitting.smooth(found, best)
    after = problem.centre + best.signature + smooth
    # without a verdict the likeliest explanation still says best which part of the mismatch is not calibration
    where = locate(found, best if best.ids or not found.spans else fitting.fit(found, _solved(found)))

    @cache
    def settling() -> suggestion.Suggestion:
        with posterior.one_thread():
            return _next(found, decision, best, given)

    return Diagnosis(
        found, decision, decision, best, parameters, found.p_value, where, _scores(found, after, held, gp_only), words,
        after, held, settling, form.confusion(found), absent, None, None, change,
    )  # fmt: skip


def _solved(found: posterior.Evidence) -> Explanation:
    """Likeliest explanation of which the solver has signatures; that of nothing where it has none."""
    listed = (k for k in found.probability if k.ids and all(i in found.spans for i in k))
    return max(listed, key=lambda k: found.probability[k], default=NONE)


def _of_motor(found: posterior.Evidence) -> dict[Explanation, float]:
    """Posterior; beside a reference only supply, heat, motor and controller change the speed at a pulse width."""
    problem = found.problem
    if problem.free.all() or not np.all(problem.channel == CHANNELS.index("rpm")):
        return found.probability
    return {Explanation.of(MOTOR) if k == UNKNOWN else k: p for k, p in found.probability.items()}


def _decided(P: Mapping[Explanation, float], plain: Mapping[Explanation, float]) -> loss.Decision:
    """Decision; that nothing listed fits is no name."""
    decision = loss.decide(P)
    return loss.decide(plain) if decision.effects == (MOTOR,) else decision


def _with_drive(rotor: Diagnosis, motor: Diagnosis) -> Diagnosis:
    """Answer on loads and drive, measured apart: loads at the measured speed, the speed at the pulse width."""
    P, Q = loss.parts(rotor.found.probability, motor.found.probability)
    beside = replace(motor.found, probability=Q)
    loads, drive = loss.decide(P).reasoned_as(rotor.said), _decided(_of_motor(beside), Q)
    said = loss.joined(loads, drive, P.get(NONE, 0.0))
    if said.by == "drive":  # each part keeps the posterior that is its own
        return replace(motor, found=beside, said=said, drive=motor, loads=rotor, absent=rotor.absent)
    whole = replace(rotor, found=replace(rotor.found, probability=P), said=said, drive=motor)
    if said.by == "both":
        return replace(whole, decision=said, parameters={**rotor.parameters, **motor.parameters})
    return whole


def _scores(found: posterior.Evidence, after: Array, held: Array, gp_only: Array) -> dict[str, dict[str, float]]:
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
    found: posterior.Evidence, decision: loss.Decision, best: fitting.Fit, given: suggestion.Given
) -> suggestion.Suggestion:  # fmt: skip
    """What settles the question, and what to type then."""
    chosen = _settling(found, decision, best)
    if not chosen.kind and decision.verdict == "named":  # nothing is open: into the case with it
        return replace(chosen, text="no further run is needed; write the case with it",
                       commands=(f"{given.command()} --out improved",))  # fmt: skip
    other = chosen.otherwise
    if other is not None:
        other = replace(other, commands=_commands(other, given))
    return replace(chosen, commands=_commands(chosen, given), otherwise=other)


def _commands(chosen: suggestion.Suggestion, given: suggestion.Given) -> tuple[str, ...]:
    """What to type after a step, unless it would ask the same again."""
    return tuple(c for c in _all_commands(chosen, given) if c != given.command())


def _all_commands(chosen: suggestion.Suggestion, given: suggestion.Given) -> tuple[str, ...]:
    if chosen.kind == "reference":
        file = "reference.csv"
        return given.command(reference=file), given.comparison(file)
    if chosen.kind == "run":
        return (given.command(run="new_run.csv"),)
    if chosen.kind == "look" and chosen.commands:  # what the file does not say of itself
        return given.kept(*chosen.commands)
    if chosen.kind == "look":
        return (given.command(ruled_out=chosen.checks),)
    if chosen.kind == "air":
        return given.of_days()
    if chosen.kind == "case":
        return (replace(given, case="--case LABEL").command(),)
    if chosen.kind == "mend":
        return tuple(f"bemt import {f}" for f in given.recordings)
    return ()


def _settling(found: posterior.Evidence, decision: loss.Decision, best: fitting.Fit) -> suggestion.Suggestion:
    """Run against the strongest rival of the leading explanation, "nothing" included where no name is given."""
    single = {i: found.probability.get(Explanation.of(i), 0.0) for i in found.spans}
    singles = sorted(single, key=lambda i: -single[i])

    def rivals_of(ids: Sequence[str]) -> list[suggestion.Rival]:
        settings = {i: fitting.fit(found, Explanation.of(i)).settings[0] for i in ids if i}
        return [suggestion.Rival(i, settings.get(i, {}), weight[i]) for i in ids]

    weight = single | {"": found.probability[NONE]}
    if decision.verdict == "none":
        faint = rivals_of(["", *singles][:_MOST_RIVALS])
        return suggestion.nothing_called_for(found, faint, found.probability[UNKNOWN])
    if decision.by == "files" and found.problem.other_setup:
        return suggestion.Suggestion(ONE_SETUP, "cfd")
    if decision.verdict == "insufficient" and (mend := other_rotor.to_mend(found.problem)):
        return suggestion.mended(found, mend)
    if other_rotor.doubted(found.problem, decision):
        return suggestion.mended(found, suggestion.WHOSE, "case")
    claimed = decision.leading if decision.verdict in loss.CLAIMS else NONE
    by_law = [i for i in claimed if i not in found.spans]  # nothing was solved for these: a look tells
    if by_law and (looked := suggestion.look(by_law[:1], found.problem.parts[0].record)):
        return looked
    if not singles:
        return suggestion.Suggestion(suggestion.REFERENCE, "reference")
    if decision.verdict == "insufficient" and (note := suggestion.weather(found)):
        return note
    sure = decision.effects[:1] if decision.beside else decision.effects
    if decision.verdict in ("named", "sensor") or decision.beside:
        settings = dict(zip(best.ids, best.settings, strict=True))
        if mended := suggestion.correction(sure, settings, found.problem.parts[0].record):
            return mended
    lead = best.ids[0] if best.ids else singles[0]
    rivals = [i for i in dict.fromkeys((*decision.effects, *singles)) if i != lead and i in found.spans]
    likelier = bool(rivals) and single[rivals[0]] > found.probability[NONE]
    rivals.insert(0 if not rivals or (decision.verdict == "insufficient" and not likelier) else len(rivals), "")
    order = [lead, rivals[0], *sorted(rivals[1:], key=lambda i: -weight[i])][:_MOST_RIVALS]
    open_ = decision.verdict in ("class", "unknown", "insufficient")
    return suggestion.suggest(found, rivals_of(order), found.probability[UNKNOWN], reference=open_)


# Physics that the case leaves out and a reference shows as well: what every rotor has is in both runs.
#
# The runs do not differ in it, yet it is why the case fits neither. The reference alone is asked whether it shows it:
# the recording may have another cause, which must not answer for it.
def ask_reference(problem: Problem, candidates: Sequence[Candidate]) -> tuple[Problem, tuple[Candidate, ...]]:
    """Problem that knows what its runs share; candidates were solved in both.

    Of what a reference clearly lacks (a code that can switch it off made it) only the recording's part stays.
    """
    asked = [c for c in candidates if c.id in problem.missing]
    if not asked:
        return replace(problem, shared=frozenset()), tuple(candidates)
    rows = ~problem.free
    shows = posterior.log_odds(problem.of(rows), [c.seen_as(c.signatures[rows]) for c in asked])
    both = frozenset(i for i, odds in shows.items() if odds + np.log(ALWAYS) > 0.0)
    alone = problem.missing - both
    kept = (c.seen_as(np.where(rows[:, None], 0.0, c.signatures)) if c.id in alone else c for c in candidates)
    return replace(problem, shared=both, predicted={}), tuple(kept)


# Blocks of readings that are left out in turn, and what an explanation predicts of them.
REFERENCE = -1
"""Block of points that are always given: readings without the cause."""


def partitions(problem: Problem, most: int = 6) -> list[tuple[str, NDArray[np.intp]]]:
    """All ways to leave out whole blocks, never random rows: recordings, lines of rpm or J; else intervals."""
    P = problem.covariates["rpm"].size
    mine = np.zeros(P, dtype=bool)
    mine[problem.point[problem.free]] = True
    X = {k: v[mine] for k, v in problem.covariates.items()}
    count = int(mine.sum())
    run = X["run"].astype(int)
    out: list[tuple[str, NDArray[np.intp]]] = []

    def whole(block: NDArray[np.intp]) -> NDArray[np.intp]:
        every = np.full(P, REFERENCE, dtype=np.intp)
        every[mine] = block
        return every

    if len(problem.parts) > 1 and 3 <= np.unique(run).size <= most:
        out.append(("recordings", whole(np.unique(run, return_inverse=True)[1])))
    for name, x, gap in (("rpm", np.log(X["rpm"]), 0.03), ("J", X["J"], 0.02)):
        order = np.argsort(x, kind="stable")
        line = np.empty(count, dtype=np.intp)
        line[order] = np.cumsum(np.r_[0, np.diff(x[order]) > gap])
        lines = int(line.max()) + 1
        if 3 <= lines <= max(count // 2, 3):
            few = np.minimum(line * most // max(lines, most), most - 1) if lines > most else line
            out.append((f"all readings at one {name}", whole(few)))
    if out:
        return out
    spread = {
        k: float(np.ptp(v)) / max(float(np.max(np.abs(v))), 1e-12) for k, v in X.items() if k in ("rpm", "J", "time_s")
    }
    name = max(spread, key=lambda k: spread[k])
    rank = np.argsort(np.argsort(X[name], kind="stable"))
    return [(f"intervals of {name}", whole(rank * min(4, count) // count))]


def held_out(found: posterior.Evidence, what: Explanation) -> tuple[str, Array, Array]:
    """Predict every block from the others, with and without an explanation."""
    problem = found.problem
    words, block = partitions(problem)[0]
    member = block[problem.point]
    hyper = found.states[0].hyper
    C = noise.covariance(problem, hyper)
    K = next((k.covariance for k in found.rivals if k.name == found.states[0].best_rival), np.zeros_like(C))
    S, log_w = _columns(found, what)
    r = problem.residual
    after, smooth_part = np.array(problem.centre), np.array(problem.centre)
    systematic = C - hyper.scale**2 * noise.noise(problem, hyper.ar)
    own = fitting.form_covariance(found, fitting.fit(found, what))
    for b in np.unique(member[member != REFERENCE]):
        test, train = member == b, member != b
        if not train.any():
            continue
        white = whitener((C + own)[np.ix_(train, train)], problem.u[train])
        w = white(np.column_stack([r[train], S[train]]))
        gain = w[:, 1:].T @ w[:, 0] - 0.5 * np.sum(w[:, 1:] ** 2, axis=0) + log_w
        p = shares(gain) if gain.size else np.zeros(0)
        expected = S @ p if gain.size else np.zeros_like(r)
        cross = (systematic + own)[np.ix_(test, train)]
        after[test] += expected[test] + cross @ white.solve((r - expected)[train])
        white = whitener((C + K)[np.ix_(train, train)], problem.u[train])
        smooth_part[test] += (systematic + K)[np.ix_(test, train)] @ white.solve(r[train])
    return words, after, smooth_part


def _columns(found: posterior.Evidence, what: Explanation) -> tuple[Array, Array]:
    """Signatures of an explanation; of a pair the settings near the best one."""
    M = found.problem.y.size
    ids = tuple(what)
    if not ids:
        return np.zeros((M, 0)), np.zeros(0)
    if len(ids) == 1:
        c = found.of(ids[0])
        return c.signatures, np.log(c.weight)
    best = fitting.fit(found, what)
    a, b = (found.of(i) for i in ids)
    i, j = (col - found.spans[k].start for col, k in zip(best.columns, ids, strict=True))
    interaction = best.signature - a.signatures[:, i] - b.signatures[:, j]
    rows, weight = [], []
    for k in range(a.weight.size):
        for m in range(b.weight.size):
            rows.append(a.signatures[:, k] + b.signatures[:, m] + interaction)
            weight.append(np.log(a.weight[k] * b.weight[m]))
    return np.stack(rows, axis=1), np.array(weight)
