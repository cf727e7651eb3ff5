"""The promise of bemt.physics.dataset: one currency, validated on entry, exact round trips, unknown stays unknown."""

from __future__ import annotations

import json
import math
import pickle
from collections.abc import Mapping
from dataclasses import replace
from typing import get_type_hints

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bemt.base.arrays import Array
from bemt.base.errors import InputError
from bemt.physics import coefficients as co
from bemt.physics.dataset import Dataset, concat, from_pandas


def stand(**kwargs: object) -> Dataset:
    values = {"rpm": [3000.0, 6000.0], "thrust_N": [2.0, 9.0], "torque_Nm": [0.03, 0.12], "airspeed_m_s": [0.0, 6.0]}
    return Dataset("bench", "stand", values, **kwargs)  # type: ignore[arg-type]


def test_all_faults_at_once() -> None:
    with pytest.raises(InputError) as caught:
        Dataset(
            "Bench!", "s", {"thrust_kgf": [1.0], "CT": [0.1, 0.2], "speed": [1.0], "J": [math.inf]},
            {"eta": [0.1], "J": [-1.0]}, flags=((), ()),
        )  # fmt: skip
    places = [fault.where for fault in caught.value.faults]
    assert places == ["kind", "values.thrust_kgf", "values.CT", "values.speed", "values.J", "flags", "u.eta", "u.J"]
    assert "Convert it with units.to_si(..., 'kgf')" in str(caught.value)


def test_arrays_are_copied_and_read_only() -> None:
    mine = np.array([1.0, 2.0])
    s = Dataset("bench", "s", {"J": mine})
    mine[0] = 99.0
    assert s["J"][0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        s["J"][0] = 5.0


def test_absent_uncertainty_is_unknown_not_zero() -> None:
    s = stand(u={"thrust_N": 0.05})
    assert np.array_equal(s.u["thrust_N"], [0.05, 0.05])
    assert np.all(np.isnan(s.u["torque_Nm"]))
    assert s.to_rows()[0]["u"]["torque_Nm"] is None


@settings(max_examples=60, deadline=None)
@given(
    D=st.floats(0.02, 5.0), rho=st.floats(0.1, 1000.0), rpm=st.floats(10.0, 60000.0), CT=st.floats(-0.5, 1.0),
    CP=st.floats(1e-4, 1.0), J=st.floats(0.0, 2.0),
)  # fmt: skip
def test_derive_round_trip(D: float, rho: float, rpm: float, CT: float, CP: float, J: float) -> None:
    start = Dataset("bemt", "s", {"rpm": [rpm], "CT": [CT], "CP": [CP], "J": [J]}, {"CT": 0.01, "CP": 0.002})
    full = start.derive(D, rho)
    names = ("rpm", "thrust_N", "torque_Nm", "airspeed_m_s")
    dimensional = Dataset("bemt", "s", {k: full[k] for k in names}, {k: full.u[k] for k in names})
    back = dimensional.derive(D, rho)
    for name in ("CT", "CP", "J", "CQ", "power_W", "eta"):
        assert np.allclose(back[name], full[name], rtol=1e-12, atol=1e-300)
    for name in ("CT", "CP"):
        assert np.allclose(back.u[name], start.u[name], rtol=1e-12)


def test_derive_uses_the_propeller_convention() -> None:
    d = stand().derive(0.254, 1.2)
    n = np.array([50.0, 100.0])
    assert np.allclose(d["CT"], np.array([2.0, 9.0]) / (1.2 * n**2 * 0.254**4), rtol=1e-14)
    assert np.allclose(d["CP"], 2 * math.pi * d["CQ"], rtol=1e-14)
    assert np.allclose(d["power_W"], 2 * math.pi * n * np.array([0.03, 0.12]), rtol=1e-14)
    assert d["eta"][0] == 0.0 and np.isclose(d["eta"][1], 9.0 * 6.0 / d["power_W"][1], rtol=1e-12)


def test_derive_never_replaces_and_needs_density_for_forces() -> None:
    s = Dataset("vendor", "s", {"rpm": [6000.0], "CT": [0.1], "thrust_N": [7.0]})
    assert s.derive(0.2, 1.2)["thrust_N"][0] == 7.0
    assert "CT" not in stand().derive(0.254)
    own = Dataset("bench", "s", {"rpm": [6000.0], "CT": [0.1], "density_kg_m3": [1.1]})
    assert np.isclose(own.derive(0.2)["thrust_N"][0], co.thrust(0.1, 1.1, 100.0, 0.2), rtol=1e-14)


def test_derive_at_zero_rpm_is_nan_not_zero() -> None:
    s = Dataset("bench", "s", {"rpm": [0.0], "thrust_N": [0.1], "airspeed_m_s": [3.0]})
    d = s.derive(0.2, 1.2)
    assert np.isnan(d["CT"][0]) and np.isnan(d["J"][0])


@pytest.mark.parametrize(
    ("diameter", "density"), [(0.0, 1.2), (math.nan, 1.2), (254.0, 1.2), (0.2, 0.0), (0.2, [1.2, -1.0])]
)
def test_derive_refuses_nonsense(diameter: float, density: object) -> None:
    with pytest.raises(InputError):
        stand().derive(diameter, density)  # type: ignore[arg-type]


def test_eta_uncertainty_adds_in_quadrature() -> None:
    s = Dataset("bench", "s", {"J": [0.5], "CT": [0.08], "CP": [0.05]}, {"CT": 0.0024, "CP": 0.002})
    d = s.derive(0.2)
    assert np.isclose(d.u["eta"][0], d["eta"][0] * math.hypot(0.03, 0.04), rtol=1e-12)


def test_from_rotor_convention() -> None:
    T, P, rho, R, Omega, V = 30.0, 400.0, 1.2, 0.5, 200.0, 10.0
    area, tip = math.pi * R**2, Omega * R
    rotor = {"CT_rotor": T / (rho * area * tip**2), "CP_rotor": P / (rho * area * tip**3), "mu_axial": V / tip}
    s = Dataset.from_rotor_convention(
        "bench", "rotor", {k: [v] for k, v in rotor.items()}, u={"CT_rotor": [rotor["CT_rotor"] / 10]}
    )
    n, D = Omega / (2 * math.pi), 2 * R
    assert np.isclose(s["CT"][0], co.CT(T, rho, n, D), rtol=1e-12)
    assert np.isclose(s["CP"][0], co.CP(P, rho, n, D), rtol=1e-12)
    assert np.isclose(s["J"][0], co.J(V, n, D), rtol=1e-12)
    assert np.isclose(s.u["CT"][0], s["CT"][0] / 10, rtol=1e-12)


def test_select_keeps_points_together() -> None:
    s = stand(u={"thrust_N": [0.1, 0.2]}, flags=(("a",), ("b",)), labels=("f:1", "f:2"), provenance={"file": "f"})
    back = s.select([1, 0])
    assert back["rpm"].tolist() == [6000.0, 3000.0]
    assert (back.flags, back.labels, back.u["thrust_N"].tolist()) == ((("b",), ("a",)), ("f:2", "f:1"), [0.2, 0.1])
    assert s.select(lambda x: x["rpm"] > 4000).labels == ("f:2",)
    assert len(s.select(slice(0, 0))) == 0


def test_concat_fills_with_nan_and_keeps_provenance() -> None:
    a = Dataset("bench", "a", {"J": [0.1]}, {"J": 0.01}, labels=("f:1",), provenance={"file": "f"})
    b = Dataset("bench", "b", {"J": [0.2], "CT": [0.1]}, flags=(("odd",),))
    s = concat([a, b], "both")
    assert np.array_equal(s["CT"], [np.nan, 0.1], equal_nan=True)
    assert np.array_equal(s.u["J"], [0.01, np.nan], equal_nan=True)
    assert (s.flags, s.labels) == (((), ("odd",)), ("f:1", ""))
    assert [(name, n) for name, n, _ in s.provenance["parts"]] == [("a", 1), ("b", 1)]
    with pytest.raises(InputError, match="kinds bench, cfd"):
        concat([a, Dataset("cfd", "c", {"J": [0.1]})])
    with pytest.raises(InputError, match="no series"):
        concat([])


def test_rows_are_json_and_nan_becomes_null() -> None:
    s = Dataset("bemt", "s", {"CT": [math.nan, 0.1]}, flags=(("not converged",), ()))
    rows = json.loads(json.dumps(s.to_rows(), allow_nan=False))
    assert rows[0] == {"source": "bemt", "name": "s", "CT": None, "u": {"CT": None}, "flags": ["not converged"]}


def test_pickles_for_worker_processes() -> None:
    s = pickle.loads(pickle.dumps(stand(u={"thrust_N": 0.1}, provenance={"file": "f"}, labels=("a", "b"))))
    assert s["rpm"].tolist() == [3000.0, 6000.0] and s.provenance["file"] == "f" and s.labels == ("a", "b")


def test_nobody_can_write_to_a_dataset() -> None:
    owned, free = np.array([1.0, 2.0]), np.array([3.0, 4.0])
    owned.setflags(write=False)
    view = free.view()
    view.setflags(write=False)
    spread, _ = np.broadcast_arrays(free, np.zeros((2, 2)))
    d = Dataset("bench", "s", {"rpm": owned, "J": view, "CT": spread[0], "CP": np.broadcast_to(free[0], 2)})
    again = replace(d, name="t")
    free[:] = 0.0
    assert [d[k].tolist() for k in ("J", "CT", "CP")] == [[3.0, 4.0], [3.0, 4.0], [3.0, 3.0]]
    assert d["rpm"] is owned and all(again[k] is d[k] and again.u[k] is d.u[k] for k in d.values)  # and copies nothing
    with pytest.raises(ValueError, match="read-only"):
        d["J"][0] = 1.0


def test_tables_go_out_and_come_back_the_same() -> None:
    d = Dataset(
        "bench", "stand", {"rpm": [6000.0, 7000.0], "thrust_N": [10.0, 13.6]},
        u_by={"random": {"thrust_N": 0.3}, "session": {"thrust_N": [0.4, 0.4]}}, flags=(("odd",), ()),
        labels=("a:1", "a:2"),
    )  # fmt: skip
    assert d.u["thrust_N"] == pytest.approx([0.5, 0.5])  # 3-4-5
    back = from_pandas(d.to_pandas(), "bench", "stand")
    assert back.labels == d.labels and back.flags == d.flags
    for key in d.values:
        assert np.array_equal(back[key], d[key])
    assert np.array_equal(back.u_by["random"]["thrust_N"], d.u_by["random"]["thrust_N"])
    with pytest.raises(InputError, match="u_by.luck"):
        Dataset("bench", "s", {"J": [0.1]}, u_by={"luck": {"J": 0.1}})


def test_headings_of_a_table_are_converted_by_their_unit_and_all_faults_are_said() -> None:
    frame = pd.DataFrame({"rpm": [6000], "thrust_gf": [1000.0], "temperature_C": [15.0], "airspeed_km_h": [36.0]})
    d = from_pandas(frame)
    assert d["thrust_N"][0] == pytest.approx(9.80665)
    assert d["temperature_K"][0] == pytest.approx(288.15) and d["airspeed_m_s"][0] == pytest.approx(10.0)
    with pytest.raises(InputError) as error:
        from_pandas(pd.DataFrame({"thrust": [1.0], "torque_Nm": ["x"]}))
    assert {fault.where for fault in error.value.faults} == {"thrust", "torque_Nm"}


def test_a_channel_that_is_not_there_is_named_with_the_nearest() -> None:
    d = Dataset("bemt", "p", {"rpm": [4000.0], "thrust_N": [2.1]})
    with pytest.raises(AttributeError, match="did you mean thrust_N"):
        d.thrust  # noqa: B018
    with pytest.raises(KeyError, match="did you mean thrust_N"):
        d["thrust"]


def test_columns_of_text_in_a_frame_stay_text() -> None:
    d = from_pandas(pd.DataFrame({"rpm": [6000, 7000], "Propeller": ["10x5", "9x6"]}))
    assert d.texts == {"Propeller": ("10x5", "9x6")} and list(d) == ["rpm"]
    with pytest.raises(InputError):
        from_pandas(pd.DataFrame({"rpm": [6000, 7000], "thrust": ["10", 6.0]}))


def test_it_iterates_over_the_names_that_in_and_brackets_take() -> None:
    d = Dataset("bemt", "p", {"rpm": [4000.0, 6000.0], "thrust_N": [2.1, 4.7]})
    assert list(d) == ["rpm", "thrust_N"] and all(name in d and len(d[name]) == len(d) for name in d)


def test_the_uncertainties_of_an_answer_are_typed_as_arrays() -> None:
    """As `d[channel]` is; the constructor takes numbers, too."""
    assert get_type_hints(Dataset)["u"] == Mapping[str, Array]
    d = Dataset("bench", "run", {"rpm": [6000.0, 7000.0]}, {"rpm": 10.0})
    assert isinstance(d.u["rpm"], np.ndarray) and d.u["rpm"].tolist() == [10.0, 10.0]
