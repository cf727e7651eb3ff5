"""The promise of the derivatives: those of whole solves, open rotors and ducts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bemt.base.errors import InputError
from bemt.physics.bem import solver
from bemt.physics.bem.gradient import Gradient, gradient
from bemt.physics.bem.model import Model
from bemt.physics.effects import from_text
from bemt.rotors.case import load_case
from bemt.rotors.case.prepare import prepare_case

STEP = 1e-6
POINTS = (("prop_10x5", 12_000.0, 8.0), ("prop_14x8", 16_000.0, 0.0), ("ds30", 40_000.0, 20.0))


def _solved(ready: Model, rpm: float, V: float, air: object, stations: object) -> np.ndarray:
    prep = solver.prepare(ready.rotor, ready.polars, ready.effects, ready.duct, stations=stations)  # type: ignore[arg-type]
    s = solver.solve(prep, rpm, V, air)  # type: ignore[arg-type]
    return np.array([s.T_rotor[0], s.Q[0]])


@pytest.mark.parametrize(("name", "rpm", "V"), POINTS)
def test_derivatives_are_those_of_whole_solves(project: Path, name: str, rpm: float, V: float) -> None:
    case = load_case(project / f"cases/{name}/case.toml")
    ready, air = prepare_case(case), case.air()
    found: Gradient = gradient(ready, ready.effects, rpm, V, air)
    s = found.stations
    assert _solved(ready, rpm, V, air, s) == pytest.approx([found.thrust_N, found.torque_Nm], rel=1e-12)
    for key in ("chord", "beta"):
        scale = np.abs(getattr(found, key)).max(axis=1)
        for i in (1, 9, 20, 31, 38):
            values = getattr(s, key)
            d = STEP * (values[i] if key == "chord" else 1.0)
            one = np.arange(values.size) == i
            moved = [s._replace(**{key: values + sign * d * one}) for sign in (-1.0, 1.0)]
            low, high = (_solved(ready, rpm, V, air, one) for one in moved)
            slope = (high - low) / (2 * d)
            assert slope / scale == pytest.approx(getattr(found, key)[:, i] / scale, abs=1e-6), (key, i)
    turned = [s._replace(beta=s.beta + sign * STEP) for sign in (-1.0, 1.0)]
    low, high = (_solved(ready, rpm, V, air, one) for one in turned)
    assert (high - low) / (2 * STEP) == pytest.approx(found.pitch, rel=1e-6)
    for key, d, points in (
        ("rpm", 1e-6 * rpm, lambda d: (rpm + d, V, air)),
        ("airspeed", 1e-4, lambda d: (rpm, V + d, air)),
        ("density", 1e-6, lambda d: (rpm, V, replace(air, rho=air.rho + d))),
    ):
        low, high = (_solved(ready, *points(sign * d), s) for sign in (-1.0, 1.0))
        assert (high - low) / (2 * d) == pytest.approx(getattr(found, key), rel=1e-6), key


def test_what_they_say_is_what_a_propeller_does(project: Path) -> None:
    case = load_case(project / "cases/prop_10x5/case.toml")
    ready, air = prepare_case(case), case.air()
    g = gradient(ready, ready.effects, 10_000.0, 8.0, air)
    assert g.rpm[0] > 0 and g.airspeed[0] < 0 and g.pitch[0] > 0 and g.pitch[1] > 0
    # without Reynolds number loads go with density
    dry = tuple(e for e in ready.effects if e.id not in ("reynolds",))
    g = gradient(ready, dry, 10_000.0, 8.0, air)
    assert g.density * air.rho == pytest.approx([g.thrust_N, g.torque_Nm], rel=1e-6)


def test_effects_around_the_rotor_are_refused(project: Path) -> None:
    case = load_case(project / "cases/prop_10x5/case.toml")
    ready = prepare_case(case)
    with pytest.raises(InputError, match="ground_effect"):
        gradient(ready, (*ready.effects, from_text("ground_effect")), 8000.0, 0.0, case.air())
