"""The promise of `plan` and `diagnose` together, over the whole registry: what a plan calls visible is named, or its
class is; what it calls invisible gives no name, nor does noise alone.  The solver's own data: a necessary check.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from diagnosing import case, diagnose, left_out, points, recording

from bemt.judge import loss
from bemt.judge.diagnose import assemble, document, plan, posterior, problem, record, signatures
from bemt.judge.diagnose.signatures import effect_of
from bemt.physics import effects
from bemt.physics.bem import model as bem
from bemt.physics.dataset import Dataset
from bemt.physics.effects.base import Reading
from bemt.rotors.case import Case

pytestmark = pytest.mark.slow

DIAGNOSED = tuple(i for i, cls in effects.catalogue().items() if cls.diagnosed)
NULLS, SHARE = 300, 0.02
MISSED = {
    "rpm_scale": "of median size, six times; a factor of three is told by the level alone: doubt 0.57, this 0.43",
    "unit_slip": "of median size, m/s taken for mph: thrust 0.27 times, and that level knows no airspeed; doubt 0.85",
}


def at_work(name: str) -> str:
    """What an effect needs to be known: a long run, a run that speeds up and slows down, a duct; else two densities."""
    needs = effects.catalogue()[name].needs
    return ("pulse widths" if "pwm_s" in needs else "swings" if name in ("rotor_inertia", "inflow_lag")
            else "duct" if name in ("duct", "tip_gap", "lip_separation") else "air")  # fmt: skip


@cache
def conditions(kind: str) -> dict[str, np.ndarray]:
    """Points at which such an effect can be at work."""
    if kind == "pulse widths":  # a long run at five powers
        rpm = np.tile([9000.0, 14000.0, 20000.0, 12000.0, 17000.0], 10)
        return {"rpm": rpm, "airspeed_m_s": 0.0 * rpm, "density_kg_m3": np.full(rpm.size, 1.225),
                "time_s": 30.0 * np.arange(rpm.size), "pwm_s": 1e-3 + rpm / 24e6}  # fmt: skip
    if kind == "swings":
        t = 0.025 * np.arange(120)
        rpm = 14000.0 + 5000.0 * np.sin(2.0 * np.pi * t / 1.5)
        return {"rpm": rpm, "airspeed_m_s": 0.0 * rpm, "density_kg_m3": np.full(t.size, 1.225), "time_s": t}
    if kind == "duct":
        return points("grid", case("ds30").diameter_m) | {"rpm": points("grid")["rpm"] * 2.0}
    return points("air")


@cache
def planned(kind: str, off: str) -> tuple[Case, Case, problem.Problem, dict[str, str]]:
    """Truth, baseline, its problem and what a plan sees at these points: one plan a baseline."""
    truth = case("ds30" if kind == "duct" else "prop_8x5")
    baseline = left_out(off, truth) if off else truth
    given = conditions(kind)
    ones = np.ones_like(given["rpm"])
    rec = record.from_series(Dataset("bench", "points", {**given, "thrust_N": ones, "torque_Nm": ones}), baseline)
    return truth, baseline, assemble.build([rec], [baseline]), plan.plan(rec, baseline).sight


@pytest.mark.parametrize("name", [
    pytest.param(i, marks=pytest.mark.xfail(strict=True, reason=MISSED[i])) if i in MISSED else i for i in DIAGNOSED
])  # fmt: skip
def test_what_a_plan_sees_is_named_and_nothing_else(name: str) -> None:
    kind, on = at_work(name), name in {e.id for e in effects.standard()} or name == "duct"
    truth, baseline, whole, seen = planned(kind, name if on else "")
    given, sight = conditions(kind), seen.get(name, "invisible")
    found, absent = signatures.candidates(whole, [name])
    if not found:
        assert sight == "invisible" and name in absent
        return
    extra: tuple[effects.Effect, ...] = (effect_of(name, found[0].settings[found[0].middle]),)  # as strong as planned
    if effects.catalogue()[name].kind == "drive":  # the same pulse width gives another speed
        part = whole.parts[0]
        rec = part.record
        flow = bem.flow_of(part.model.prepared([]), rec.rpm, rec.V, rec.air, rec.extra)
        reading = Reading({"rpm": rec.rpm.copy()}, {"rpm": float(rec.rpm.max())})
        extra[0].reading(reading, flow)
        given, extra = given | {"rpm": reading.values["rpm"]}, ()
    answer = diagnose(recording(truth, given, extra), baseline)
    said = answer.decision
    if sight == "visible":
        assert name in said.effects, document.text(answer)
    elif sight == "marginal":  # may be named, but nothing else may
        assert not said.effects or name in said.effects, document.text(answer)
    else:
        assert said.verdict in ("none", "insufficient"), document.text(answer)


def test_correlated_noise_and_a_stand_within_its_calibration_name_nothing() -> None:
    n, J = np.meshgrid(np.linspace(8000.0, 20000.0, 4), np.linspace(0.0, 0.5, 4))
    given = {"rpm": n.ravel(), "airspeed_m_s": (J * n / 60.0 * case().diameter_m).ravel(),
             "density_kg_m3": np.full(n.size, 1.225), "time_s": 20.0 * np.arange(n.size)}  # fmt: skip
    plain = assemble.build([record.from_series(recording(case(), given), case())], [case()])
    candidates, _ = signatures.candidates(plain)
    rng = np.random.default_rng(2026)
    stand = plain.tangents[:, ~plain.own]
    named = []
    for _ in range(NULLS):
        e = rng.standard_normal((2, n.size))
        for i in range(1, n.size):
            e[:, i] = 0.8 * e[:, i - 1] + 0.6 * e[:, i]
        y = plain.f0 + plain.u * e[plain.channel, plain.point] + stand @ rng.standard_normal(stand.shape[1])
        said = loss.decide(posterior.weigh(replace(plain, y=y), candidates).probability)
        named += [said.effects] if said.effects else []
    assert len(named) <= SHARE * NULLS, named
