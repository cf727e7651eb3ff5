"""Recordings made with the project's own solver, for tests of the diagnosis: a necessary check, not a proof."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from bemt.judge.diagnose import chain, record
from bemt.physics import effects
from bemt.physics.bem import model as bem
from bemt.physics.dataset import Dataset
from bemt.physics.effects.base import Effect, Reading
from bemt.rotors.case import Case, load_case
from bemt.rotors.case.prepare import prepare_case

CASES = Path(__file__).resolve().parent.parent / "cases"
NOISE = 0.01


@cache
def case(name: str = "prop_8x5") -> Case:
    return load_case(CASES / name / "case.toml")


def points(plan: str, D: float = 0.2032) -> dict[str, np.ndarray]:
    """Conditions of a plan: a static sweep, a grid over speed and advance ratio, or two densities and temperatures."""
    if plan == "static":
        rpm, V = np.linspace(6000.0, 22000.0, 17), np.zeros(17)
    else:
        n, J = np.meshgrid(np.linspace(7000.0, 22000.0, 6), np.linspace(0.0, 0.6, 7))
        rpm, V = n.ravel(), (J * n / 60.0 * D).ravel()
    out = {"rpm": rpm, "airspeed_m_s": V, "density_kg_m3": np.full(rpm.size, 1.225)}
    if plan == "air":
        out = {k: np.concatenate([v, v]) for k, v in out.items()}
        out["density_kg_m3"][rpm.size :] = 0.95
    out["time_s"] = 20.0 * np.arange(out["rpm"].size)
    return out


def recording(
    truth: Case, given: dict[str, np.ndarray], extra: tuple[Effect, ...] = (), noise: float = NOISE, seed: int = 0,
    ar: float = 0.0,
) -> Dataset:  # fmt: skip
    """What a stand would record of a case with effects on, instruments included."""
    rng = np.random.default_rng(seed)
    ready = prepare_case(truth)
    ids = {e.id for e in extra}
    chosen = (*(e for e in ready.effects if e.id not in ids), *extra)
    ready = replace(ready, effects=chosen)
    base = record.from_series(Dataset("bench", "x", {**given, "thrust_N": np.ones_like(given["rpm"])}), truth)
    plain = [e for e in chosen if not bem.acts_on_points(e)]
    flow = bem.flow_of(ready.prepared(plain), base.rpm, base.V, base.air, base.extra)
    loads, met, ok = bem.respond(ready.prepared, chosen, flow)
    assert ok.all()
    top = {"thrust_N": float(np.abs(flow.T0).max()), "torque_Nm": float(np.abs(flow.Q0).max())}
    reading = Reading({"thrust_N": loads.T.copy(), "torque_Nm": loads.Q.copy()}, top)
    for e in chosen:
        e.reading(reading, met)
    values, u = dict(given), {}
    for name, y in reading.values.items():
        e = rng.standard_normal(y.size)
        for i in range(1, y.size if ar else 0):
            e[i] = ar * e[i - 1] + np.sqrt(1.0 - ar * ar) * e[i]
        u[name] = noise * np.abs(y) + 1e-3 * float(np.abs(y).max())
        values[name] = y + u[name] * e
    return Dataset("bench", "generated", values, u)


def diagnose(series: Dataset, baseline: Case) -> chain.Diagnosis:
    return chain.diagnose([record.from_series(series, baseline)], [baseline])


@cache
def compressibility_missed() -> chain.Diagnosis:
    """Answer on a grid of conditions beside a case without compressibility, of which several promises are asked."""
    return diagnose(recording(case(), points("grid")), left_out("compressibility", case()))


def left_out(name: str, base: Case) -> Case:
    return base.replaced({"model.effects_off": [name]})


def from_text(text: str) -> Effect:
    return effects.from_text(text)
