"""What is known beside the readings: how likely each explanation is before, and factors of the posterior.

The factors are laws of ratios, exact relations, files that are not right. The signatures of the solver and those of
scaling laws are two banks for the same hypotheses. How loads changed from a reference at equal speed is measured and
needs no blade: the laws tell what is unknown to the solver, and have their share where it misses the reference itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.errors import InputError
from bemt.judge.compare import drive_laws
from bemt.judge.compare.matched import StandRun, stand_run
from bemt.judge.compare.recordings import RunChange, changed
from bemt.judge.diagnose import along_blade, other_rotor, record
from bemt.judge.diagnose.record import merged
from bemt.judge.explanation import CHANGED, DOUBT, NONE, UNKNOWN, Explanation, KindPrior
from bemt.physics import effects
from bemt.physics.dataset import Dataset
from bemt.physics.effects import base as effect_base
from bemt.physics.effects.air_density import AirDensity
from bemt.physics.effects.duct import DuctEffect

if TYPE_CHECKING:
    from bemt.judge.compare.drive_laws import Judgement
    from bemt.judge.diagnose.posterior import Evidence
    from bemt.judge.diagnose.problem import Problem
    from bemt.judge.diagnose.record import Record
    from bemt.judge.diagnose.signatures import Candidate
    from bemt.judge.loss import Decision

PRIOR = KindPrior(none=0.4, single=0.45, pair=0.1, unknown=0.05)
"""Prior probability of the kinds of explanation; shared within a kind by the weights of the effects. [1]"""
LEFT_OUT, PRESENT = 10.0, 0.01
"""Weight of an effect of every real rotor that the baseline leaves out, and of one that the baseline has, with other
parameters, beside 1 for all others, where no reference shows the rotor [1]."""
BOTH, ELSE = 0.01, 0.2
"""Beside a reference: weight of what blade and air do in every run and the baseline has, in which two runs do not
differ, and of other physics that it has [1]."""
ALWAYS = 9.0
"""Odds that physics of every rotor is at work, in every run, where the case leaves it out: nobody takes it away [1]."""
# Recorded conditions that differ by less are the same, share.
_SAME = 0.1
EVIDENT = 0.2
"""Weight of what anybody at the stand would see: a second rotor is seldom overlooked [1]."""
RECORDED = 0.3
"""Weight of a wrong density where thermometer and barometer stand in every file: declared [1]."""


def prior_weights(problem: Problem, ids: Sequence[str]) -> dict[str, float]:
    """Weight of each effect: physics that every rotor has is likelier to be missing than a fault is to be there. [1]"""
    usual = {e.id for e in effects.standard()} | {i for p in problem.parts for i in p.left_out}
    shown = any(p.record.reference for p in problem.parts)
    on, everywhere = present(problem), {e.id for e in effects.standard() if not e.along}

    def weight(i: str) -> float:
        cls = effects.catalogue()[i]
        if i in problem.told:
            return CHANGED
        if recorded_change(problem, i):
            return LEFT_OUT
        if i in on and not cls.evident:
            return PRESENT if not shown else BOTH if i in everywhere else ELSE
        if i == AirDensity.id and all(p.record.air_recorded for p in problem.parts):
            return RECORDED
        # between two recordings the change is often one that was made and is known
        rest = EVIDENT if cls.evident and not shown else 1.0
        return LEFT_OUT if i in usual and (not shown or i in problem.shared) else rest

    return {i: weight(i) for i in ids}


def recorded_change(problem: Problem, name: str) -> bool:
    """Whether recording and reference tell themselves that what an effect follows differs between them."""
    if problem.free.all():
        return False
    test, known = ([p.record.extra for p in problem.parts if p.record.reference is which] for which in (False, True))
    for v in (v for v in effects.catalogue()[name].along if v != "time_s"):
        now = [float(np.median(x[v])) for x in test if v in x]
        before = [float(np.median(x[v])) for x in known if v in x]
        if now and (not before or abs(now[0] - before[0]) > _SAME * max(abs(now[0]), abs(before[0]))):
            return True
    return False


def present(problem: Problem) -> set[str]:
    """Effects that the baseline of every recording has; the case's own duct is one."""
    ducts = [{DuctEffect.id} if p.model.duct is not None else set() for p in problem.parts]
    return set.intersection(*({e.id for e in p.baseline} | d for p, d in zip(problem.parts, ducts, strict=True)))


def kinds(problem: Problem) -> KindPrior:
    """Prior of the kinds of explanation: a drive shows in the speed alone."""
    return drive_laws.PRIOR if np.all(problem.channel == record.CHANNELS.index("rpm")) else PRIOR


def log_priors(
    weights: dict[str, float], pairs: bool = True, of: KindPrior = PRIOR,
    alone: Mapping[Explanation, float] | None = None,
) -> dict[Explanation, float]:  # fmt: skip
    """Logarithm of the prior probability of every explanation, of effects and of what stands ``alone``, in no pair.

    ``of``: of their kinds.
    """
    single = {Explanation.of(i): w for i, w in weights.items()} | dict(alone or {})
    total = sum(single.values()) or 1.0
    out = {NONE: of.none, UNKNOWN: of.unknown} | {k: of.single * w / total for k, w in single.items()}
    if pairs:
        names = list(weights)
        both = {Explanation.of(a, b): weights[a] * weights[b] for k, a in enumerate(names) for b in names[k + 1 :]}
        total = sum(both.values()) or 1.0
        out |= {k: of.pair * w / total for k, w in both.items()}
    return {k: float(np.log(v)) for k, v in out.items()}


EXACT = 1e4
"""Odds that a relation of one file which must hold, and holds after one listed repair to 0.1 %, was broken by that: as
many ratios fit in between [1]."""
DOUBTFUL = 9.0
"""Odds that a file which cannot be right, or loads of a factor of three, are a fault of file or case before any physics
[1]."""
_LOADS = {"thrust_N": "thrust", "torque_Nm": "torque"}


def possible(problem: Problem, candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Candidates without what cannot be: what nobody read has no wrong unit and no cell, a coefficient no unit."""
    tested = [p.record for p in problem.parts if not p.record.reference]
    unread = set() if any(r.air_recorded for r in tested) else {"density_kg_m3"}
    unread |= {"torque_Nm"} if any(r.electrical for r in tested) else set()
    bare = frozenset[str]().union(*(r.unitless for r in tested))
    unsensed, absent = unread, tuple[str, ...]()
    if all(r.computed for r in tested):  # by no cell and no anemometer, of stiff blades; units and speed were typed in
        unsensed, absent = unread | {"thrust_N", "torque_Nm", "airspeed_m_s"}, along_blade.RIGID
    able = (c for c in candidates if effects.catalogue()[c.id].sensor not in unsensed and c.id not in absent)

    def read(setting: Mapping[str, Any]) -> bool:  # a sign needs no unit
        of = setting.get("channel")
        return of not in unread and (of not in bare or setting.get("factor", -1.0) < 0.0)

    kept = (c.only(np.array([read(s) for s in c.settings])) for c in able)
    return tuple(_repaired(problem, c) for c in kept if c is not None)


def _repaired(problem: Problem, candidate: Candidate) -> Candidate:
    """Slips of units; where loads are off by a factor of three, those that the level tells."""
    if candidate.id != "unit_slip" or not _unlike(problem):
        return candidate
    told = other_rotor.units_by_level(problem)
    near = [any(s.get("channel") == c and math.isclose(s["factor"], k, rel_tol=1e-3) for c, k in told)
            for s in candidate.settings]  # fmt: skip
    return candidate.only(np.array(near)) or candidate


def _unlike(problem: Problem) -> bool:
    """Whether loads are too far off for any law, and no reference shows that they should be."""
    shown = any(p.record.reference for p in problem.parts)
    return other_rotor.foreign(problem) and not shown and not problem.by_laws


def combined(found: Evidence, change: RunChange | None = None) -> dict[Explanation, float]:
    """Posterior with all factors; ``change`` from the reference, where ratios are a measure of it."""
    # relations that must hold: power is torque times speed, two counters of one shaft agree
    broken = {name for name, _ in other_rotor.exact_faults(found.problem)}
    odds = {k: p * (EXACT if k.ids & broken else 1.0) for k, p in found.probability.items()}
    P = {k: p / sum(odds.values()) for k, p in odds.items()}
    if change is not None and change.loads.ranked:
        P = both(P, change.loads.ranked, _law_share(found))
    return _doubted(found.problem, P)


def _law_share(found: Evidence) -> float:
    """Probability that laws, and not the solver, change as this rotor does: by what each is off, e^2/(e^2 + f^2). [1]

    The solver is off by what it lacks of the reference, laws by their form.
    """
    solver, law = found.solver_error**2, sum(w * f**2 for f, w in effect_base.FORM.items())
    return solver / (solver + law)


def both(
    P: Mapping[Explanation, float], laws: Mapping[Explanation, float], share: float = 0.0
) -> dict[Explanation, float]:  # fmt: skip
    """Posterior over two banks of signatures, of which ``share`` [1] is the probability that the laws are the better.

    Causes that laws know share what is unknown to the solver as well. Of causes that they do not know the solver tells.

    >>> one, two, own = map(Explanation.of, ("duct", "section", "hub_loss"))
    >>> found = both({one: 0.1, UNKNOWN: 0.9}, {one: 0.8, two: 0.1, UNKNOWN: 0.1})
    >>> [round(found[k], 2) for k in (one, two, UNKNOWN)]
    [0.82, 0.09, 0.09]
    >>> found = both({one: 0.5, own: 0.5}, {one: 0.2, two: 0.8}, 0.5)
    >>> [round(found[k], 2) for k in (one, two, own)]
    [0.3, 0.2, 0.5]
    >>> round(both({one: 0.8, own: 0.2}, {DOUBT: 1.0, one: 0.0}, 0.5)[one], 6)
    0.8
    """
    known = frozenset[str]().union(*(k.ids for k in laws))
    beyond = {k: p for k, p in P.items() if not k.ids <= known}
    heard = max(1.0 - laws.get(DOUBT, 0.0), 1e-12)  # two recordings that are no pair tell nothing
    share *= heard
    by_laws = beyond | {k: (1.0 - sum(beyond.values())) * p / heard for k, p in laws.items() if not k.doubt}
    open_, by_solver = P.get(UNKNOWN, 0.0), {UNKNOWN: 0.0, **P}
    for k, p in laws.items():
        if k.ids:
            by_solver[k] = by_solver.get(k, 0.0) + open_ * p
            by_solver[UNKNOWN] -= open_ * p
    every = by_solver | by_laws
    return {k: (1.0 - share) * by_solver.get(k, 0.0) + share * by_laws.get(k, 0.0) for k in every}


def reason(problem: Problem, said: Decision) -> Decision:
    """The same decision; of a broken relation the relation itself is the reason, of another set-up that."""
    if said.by == "files" and problem.other_setup:
        return replace(said, why=f"recording and reference were computed otherwise: {problem.other_setup}")
    for name, finding in other_rotor.exact_faults(problem):
        if said.effects == (name,):
            return replace(said, why=f"{finding.evidence}, by definition")
    return said


def _doubted(problem: Problem, P: Mapping[Explanation, float]) -> dict[Explanation, float]:
    """Share of the fault of file or case: of what no listed cause explains where a file cannot be right, of nearly all
    where repeats differ as on no stand, another rotor is recorded, or CFD and its reference have another set-up.
    """  # noqa: D205
    if problem.other_setup:
        return shared_with_files(P, {k for k in P if k.ids or k == UNKNOWN})
    if _unlike(problem):
        return _by_level(P, other_rotor.by_level(problem))
    if other_rotor.unrepeatable(problem):
        return shared_with_files(P, {k for k in P if k.ids})
    return shared_with_files(P, {UNKNOWN}) if other_rotor.impossible(problem) else dict(P)


def shared_with_files(P: Mapping[Explanation, float], some: Collection[Explanation]) -> dict[Explanation, float]:
    """Posterior in which file or case are to blame for some explanations, with the odds of that."""
    lost = {k: P[k] * DOUBTFUL / (1.0 + DOUBTFUL) for k in some}
    out = {k: p - lost.get(k, 0.0) for k, p in P.items()}
    return out | {DOUBT: P.get(DOUBT, 0.0) + sum(lost.values())}


def _by_level(P: Mapping[Explanation, float], level: Mapping[str, float]) -> dict[Explanation, float]:
    """Posterior where loads are off by a factor of three: no law is known to a per cent there, and slips of units and
    of speed are told from each other and from another rotor by the level alone.
    """  # noqa: D205
    weight = {Explanation.of(i): level[i] for i in other_rotor.SLIPS if i in level and Explanation.of(i) in P}
    weight[DOUBT] = max(DOUBTFUL * level.get("", 0.0), 1e-12)
    slips = {k for k in P if k.ids & set(other_rotor.SLIPS)}
    out = {k: 0.0 if k in slips else p / (1.0 + DOUBTFUL) for k, p in P.items() if not k.doubt}
    rest = 1.0 - sum(out.values())
    return out | {k: rest * w / sum(weight.values()) for k, w in weight.items()}


def change_of(
    records: Sequence[Record], diameter_m: float, absent: Collection[str], judge: Callable[[RunChange], Judgement],
    gone: Collection[str] = (), told: Collection[str] = (),
) -> RunChange | None:  # fmt: skip
    """Change of the one recording from its references; None where ratios are no measure of it.

    ``absent``: effects that cannot show; ``judge`` of the loads; the user has ruled out what is ``gone`` and changed
    what he has ``told``.
    """
    known, tested = [[r for r in records if r.reference is which] for which in (True, False)]
    # where the speed changes within a second the rows are no steady points
    if len(tested) != 1 or not known or {"inflow_lag", "rotor_inertia"} - set(absent):
        return None
    pair = [merged(known), tested[0]]
    sums = [[float(np.nansum(r.measured[k])) for r in pair] for k in _LOADS if all(k in r.measured for r in pair)]
    if any(a * b < 0.0 for a, b in sums):  # of a load that changed its sign, ratios are those of sizes
        return None
    alike = all(r.whole is not None for r in pair)
    try:
        runs = [_run(r, diameter_m, r.whole if alike else None) for r in pair]
        return changed(runs[0], runs[1], diameter_m, judge, gone, told)
    except InputError:
        return None


def _run(record: Record, diameter_m: float, whole: Dataset | None) -> StandRun:
    """Points of a record as a comparison takes them: of its ``whole`` file where that is known, which says more."""
    if whole is not None:
        run = stand_run(whole, whole.file or record.name, diameter_m)
        if {"airspeed_m_s", "J"} & run.points.values.keys() or not np.any(record.V > 0.0):
            return run
    loads = [k for k in _LOADS if k in record.measured]
    values = {"rpm": record.rpm, "airspeed_m_s": record.V, **{k: record.measured[k] for k in loads}}
    u = {k: np.nan_to_num(record.u[k]) for k in loads}
    if "run" in record.extra:
        values["run"] = record.extra["run"]
    density = float(np.mean(record.air.rho)) if record.air_recorded else math.nan
    return StandRun(Dataset("bench", record.name, values, u), "", density, diameter_m)
