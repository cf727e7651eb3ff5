"""Ducts: one mass flow, jets of potential theory, published rotors.

Sources
-------
F1: computed by DFDC (Drela and Youngren), ``shared/data/dfdc``: potential flow round duct and hub, one section table;
faults: no separation, no friction, its own pressure integral lies 4 % below its momentum.
X-22A: NASA TN D-4142, full scale, as digitised (``shared/data/x22a``); sections and exit are not known: assumed.
Ka 4-70 in nozzle 19A: Oosterveld (1970), regression in water (``shared/data/ducted_marine``); the nozzle is taken as
lip, bore and cone of its ordinates, the blades as face-pitch sections of half their thickness as camber; its torque
is 1 to 6 % too large here, see docs/duct.md. Its outer ordinates are not in the folder: widest at 0.2107 L, 0.04 L
thick at the exit (Oosterveld 1970, from memory, not checked).
76 mm fan: a hobbyist's bench (``shared/data/jmajew``), its blade is not known.
"""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import duct_fans as fans
import numpy as np
import pytest

from bemt.base.arrays import Array
from bemt.base.errors import InputError
from bemt.physics.air import Air
from bemt.physics.bem import duct as duct_model
from bemt.physics.bem import solver
from bemt.physics.bem.duct_stream import BASE_PRESSURE, Stream, jet_area
from bemt.physics.bem.model import Model, flow_of, respond
from bemt.physics.effects.oblique_inflow import ObliqueInflow
from bemt.physics.effects.tip_gap import TipGap
from bemt.rotors.case import load_case
from bemt.rotors.case.load import case_of
from bemt.rotors.case.prepare import duct_unknowns, prepare_case
from bemt.rotors.case.propagate import propagate
from bemt.rotors.population import population
from geometry.duct import Duct
from geometry.laws import helix
from geometry.rotor import Rotor

# Jets ---------------------------------------------------------------------------------------------------------------


def test_a_long_straight_pipe_neither_squeezes_nor_widens_its_jet() -> None:
    misses = []
    for length in (0.3, 0.6, 1.2):
        jet = jet_area(Duct(0.1, length, 0.002, te_thickness=0.0005), 0.0)
        misses.append(max(abs(jet.at_rest - 1.0), abs(jet.in_stream - 1.0)))
    assert max(misses) < 0.02 and misses[-1] < 0.01


def test_the_jet_knows_shapes_and_not_sizes() -> None:
    duct = Duct(0.15, 0.13, 0.018, exit_radius=0.14, exit_hub_radius=0.033, rotor_x=0.045)
    big = Duct(1.05, 0.91, 0.126, exit_radius=0.98, exit_hub_radius=0.231, rotor_x=0.315)
    outer = dataclasses.replace(duct, outer_radius=0.176), dataclasses.replace(big, outer_radius=1.232)
    for d, scaled in ((duct, big), outer):
        small, large = jet_area(d, 0.033), jet_area(scaled, 7.0 * 0.033)
        assert [*large[:3], *large.nose] == pytest.approx([*small[:3], *small.nose], rel=1e-6)


def test_nozzles_squeeze_the_jet_and_the_stream_does_where_the_duct_tapers() -> None:
    at = [jet_area(Duct(0.15, 0.13, 0.018, exit_radius=r, exit_hub_radius=0.033, rotor_x=0.045), 0.033)
          for r in (0.135, 0.15, 0.165)]  # fmt: skip
    assert at[0].at_rest < at[1].at_rest < at[2].at_rest
    assert at[0].in_stream < at[1].in_stream < at[2].in_stream
    assert all(jet.in_stream < jet.at_rest for jet in at)


@pytest.mark.parametrize("seed", range(6))
def test_the_bend_reproduces_the_potential_flow_of_any_duct(seed: int) -> None:
    """Rest, flight and free flow: the jet's speed from the flow through the exit, against the solved sheet."""
    rng = np.random.default_rng(seed)
    lip, hub = rng.uniform(0.03, 0.2), rng.uniform(0.0, 0.4)
    duct = Duct(1.0, rng.uniform(lip + 0.4, 1.6), lip, exit_radius=rng.uniform(0.93, 1.1), exit_hub_radius=hub * 0.9,
                te_thickness=0.02)  # fmt: skip
    jet, stream = jet_area(duct, hub), Stream.around(duct, hub)
    for nu in np.linspace(0.0, 1.0, 11):
        y = stream.through(nu) / duct.exit_area / jet.at_rest
        found = nu + (y - jet.in_stream / jet.at_rest * nu) * (1.0 + jet.bend * nu / math.hypot(y, nu))
        assert found == pytest.approx(1.0, abs=0.005)


def test_the_sheet_is_strongest_at_the_exit_and_sucks_more_than_one_of_its_final_strength() -> None:
    """Bernoulli's equation along the sheet: gamma V_m is the same everywhere."""
    stream = Stream.around(Duct(1.0, 0.9, 0.12, exit_radius=1.0, te_thickness=0.015), 0.22)
    for nu in (0.0, 0.5):
        gamma = stream.strength(nu)
        mean = np.hypot(*(nu * stream.sheet_in_stream + np.einsum("sjx,j->sx", stream.sheet_of_sheet, gamma)).T)
        near = ~stream.settled
        assert (gamma * mean)[near] == pytest.approx(0.5 * (1.0 - nu * nu), rel=1e-6)
        assert gamma[near].max() > 1.03 * (1.0 - nu)
        uniform = nu * stream.exit_in_stream + stream.exit_of_sheet.sum() * (1.0 - nu)
        assert stream.through(nu) > 1.01 * 2.0 * math.pi * uniform


def test_the_stream_leaves_a_steep_boattail() -> None:
    """Outer walls that fall by 18 to 24 degrees: from attached to left, with base pressure on what faces back."""
    found = []
    for angle in (15.0, 21.0, 30.0, 40.0):
        fall = 0.03 * math.tan(math.radians(angle))  # from the end of the lip to the exit
        duct = Duct(0.1, 0.04, 0.01, exit_radius=0.12 - fall - 0.001, rotor_x=0.02, te_thickness=0.001)
        x = np.linspace(0.0, duct.length, 201)
        r = duct.outer(x)
        assert math.degrees(math.atan2(r.max() - r[-1], x[-1] - x[r.argmax()])) == pytest.approx(angle, abs=1.0)
        rotor = Rotor(helix(0.2, 0.1), 4)
        flow = duct_model.duct_flow(duct, rotor)
        skin = duct_model.WALL_FRICTION * duct_model.FORM_FACTOR * 2.0 * math.pi * 0.11 * duct.length
        base = BASE_PRESSURE * math.pi * float(r.max() ** 2 - r[-1] ** 2)
        jet = jet_area(duct, rotor.Rhub)
        found.append((flow.drag_area - skin) / base)
        assert flow.capture == pytest.approx(jet.in_stream + found[-1] * (jet.at_rest - jet.in_stream))
        assert flow.bend == pytest.approx((1.0 - found[-1]) * jet.bend, abs=1e-12)
    assert found == pytest.approx([0.0, 0.5, 1.0, 1.0], abs=1e-6)


def test_the_stream_leaves_an_outer_nose_at_small_reynolds_numbers_and_light_load() -> None:
    """Section of nozzle 19A: lost in full up to Re 4e5, held from 6e5 on; less suction to lose the harder it works."""
    duct = Duct(0.12, 0.12, 0.0219, exit_radius=0.123, rotor_x=0.06, lip_aspect=2.2, te_thickness=0.005,
                outer_radius=0.145)  # fmt: skip
    rotor = Rotor(helix(0.24, 0.2, hub=0.167), 4)
    flow = duct_model.duct_flow(duct, rotor)
    V, jet = np.full(6, 20.0), 20.0 / np.array([1.0, 0.9, 0.8, 0.7, 0.6, 0.5])
    lost = flow.drag(V, jet, V * duct.length / 3e5) / (0.5 * V**2) - flow.drag_area
    assert np.all(np.diff(lost) < 0.0)
    assert lost[-1] > 0.0  # base pressure on what faces back
    held = flow.drag(V, jet, V * duct.length / 6e5)
    assert held == pytest.approx(0.5 * V**2 * flow.drag_area)
    for other in (dataclasses.replace(duct, outer_radius=None), duct):  # of no known shape; of no boundary layer
        friction = 0.005 if other.outer_radius is None else 0.0
        assert duct_model.duct_flow(other, rotor, friction).nose_drag == ()


def test_the_lip_loss_lies_in_the_range_of_its_sources() -> None:
    x = np.linspace(0.0, 0.3, 61)
    loss = [duct_model.lip_loss(v) for v in x]
    assert all(k.low <= k.nominal <= k.high for k in loss)
    assert np.all(np.diff([k.nominal for k in loss]) <= 0.0)
    assert 0.05 <= duct_model.lip_loss(0.12).nominal <= 0.10


# Whole fans ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def f1_case(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Any:
    return fans.f1(shared_data, tmp_path_factory.mktemp("f1"))


@pytest.fixture(scope="module")
def f1(f1_case: Any) -> Model:
    return prepare_case(f1_case.case)


def off(known: Any, **changes: float) -> tuple[Any, Any, Any]:
    """Error of CT and CQ, and of the duct's share, of a rotor beside what is known of it."""
    case = known.case.replaced({f"duct.{key}": value for key, value in changes.items()})
    p = prepare_case(case).solve(case.rpm, known.airspeed(known.J), case.air())
    assert p.converged.all()
    return p.CT / known.CT - 1.0, p.CP / (2.0 * np.pi) / known.CQ - 1.0, p.duct_share - known.share


@pytest.mark.parametrize(
    ("changes", "limits"), [({"wall_friction": 0.0}, (0.03, 0.03, 0.012)), ({}, (0.06, 0.03, 0.04))]
)
def test_f1_under_the_conditions_of_dfdc(
    f1_case: Any, changes: dict[str, float], limits: tuple[float, float, float]
) -> None:
    """No gap and no lip loss; DFDC has no friction either, which is 0.6 points of share at rest, 4 at J 0.55."""
    assert len(f1_case.J) == 5
    for error, limit in zip(off(f1_case, **changes), limits, strict=True):
        assert np.max(np.abs(error)) < limit


def test_kernel_and_balance_see_one_stream_leave_the_nose(f1: Model) -> None:
    """Reynolds numbers V length / nu from 4e4 to 9e5."""
    assert f1.duct is not None
    numbers: dict[str, Any] = {"exit_hub": math.nan, "nose_drag": ((0.2, 0.0), (1.0, 0.02)), "nose_capture": 0.05}
    duct = dataclasses.replace(f1.duct, **numbers)
    air, V = Air.from_density(1.225), np.array([5.0, 30.0, 50.0, 60.0, 105.0])
    nu = air.mu / air.rho
    left = duct.left(V, nu)
    assert left[0] == left[1] == 1.0 > left[2] > left[3] > left[4] == 0.0
    prep = solver.prepare(f1.rotor, f1.polars, f1.effects, duct)
    s = solver.solve(prep, 40000.0, V, air, radial=True)
    w = s.radial.w
    step = 1.225 * w * 2.0 * np.pi * s.radial.r * prep.st[:, 1]
    leaves = duct.jet_speed(w, V[:, None], nu)
    jet = (step * leaves).sum(axis=1) / s.mass_flow
    assert s.converged.all() and np.allclose(s.T, s.mass_flow * (jet - V) - 1.225 * duct.drag(V, jet, nu), rtol=1e-9)


def test_a_stator_ends_what_swirl_takes_from_the_jet(f1: Model) -> None:

    def thrust(**numbers: float) -> float:
        duct = dataclasses.replace(f1.duct, **numbers)  # type: ignore[type-var]
        prep = solver.prepare(f1.rotor, f1.polars, f1.effects, duct)
        return float(solver.solve(prep, 4898.98, 0.0, Air.from_density(1.225)).T[0])

    assert thrust(exit_hub=0.0) < thrust(exit_hub=math.nan)
    assert thrust(exit_hub=0.0, stator=1.0) == pytest.approx(thrust(exit_hub=math.nan, stator=1.0), rel=1e-12)


R, RHUB, RHO, V_JET = 0.3, 0.1, 1.2, 50.0
ANNULUS = math.pi * (R**2 - RHUB**2)


def swirl_drag(swirl: float, ratio: float, exit_hub: float) -> float:
    """What a uniform swirl behind a rotor takes from the jet of a duct."""
    duct = duct_model.DuctFlow(ratio, span=R - RHUB, area=ANNULUS, exit_hub=exit_hub)
    mdot = RHO * ratio * ANNULUS * V_JET
    given = (np.array([v]) for v in (RHO, mdot, mdot * V_JET, swirl**2 * math.log(R / RHUB), mdot * swirl**2))
    return float(duct._swirl_drag(*given)[0])


def test_swirl_costs_nothing_where_body_and_wall_stay_as_they_are() -> None:
    assert swirl_drag(5.0, 1.0, RHUB) == pytest.approx(0.0, abs=1e-9)
    assert swirl_drag(5.0, 1.0, 0.5 * RHUB) > 0.0


@pytest.mark.parametrize("swirl", [3.0, 6.0])
def test_a_swirling_jet_agrees_with_its_stream_tubes_followed_one_by_one(swirl: float) -> None:
    """Momentum of 2,000 tubes in radial equilibrium, none of it to first order."""
    sigma = 0.8
    mdot = RHO * sigma * ANNULUS * V_JET
    n = 2000
    r2 = RHUB**2 + (np.arange(n) + 0.5) / n * (R**2 - RHUB**2)
    y, p, T = sigma * ANNULUS / math.pi, 0.0, 0.0
    for r2_k in r2[::-1]:  # from the edge, at ambient pressure, inwards
        step = mdot / n / (RHO * math.pi * V_JET)
        for _ in range(20):
            middle = y - 0.5 * step
            v_t2 = swirl**2 * r2_k / middle
            half = 0.25 * RHO * v_t2 * step / middle
            w = math.sqrt(V_JET**2 - 2.0 * (p - half) / RHO + swirl**2 - v_t2)
            step = mdot / n / (RHO * math.pi * w)
        T += mdot / n * w + (p - half) * math.pi * step
        p -= 2.0 * half
        y -= step
    exact = mdot * V_JET - T - p * math.pi * y
    assert y > 0.0
    assert swirl_drag(swirl, sigma, 0.0) == pytest.approx(exact, rel=0.12 * (swirl / 6.0) ** 2)


@pytest.mark.parametrize("angle", [19, 29])
def test_x22a(shared_data: Path, tmp_path: Path, angle: int) -> None:
    known = fans.x22a(shared_data, tmp_path, angle)
    CT, CQ, _ = off(known)
    assert np.max(np.abs(CT)[known.J < 0.56]) < 0.05
    assert np.median(np.abs(CQ)) < 0.1


@pytest.mark.parametrize("pitch", fans.PITCHES)
def test_ka_4_70_in_nozzle_19a(shared_data: Path, tmp_path: Path, pitch: float) -> None:
    known = fans.nozzle_19a(shared_data, tmp_path, pitch)
    some = known.CT > 0.15 * known.CT[0]
    CT, CQ, _ = (np.abs(v) for v in off(known))
    assert np.median(CT[some]) < 0.03
    assert np.max(CT[some]) < 0.1
    assert np.max(CT[known.CT > 0.13 * known.CT[0]]) < 0.2  # light loads, where the nozzle drags
    assert np.median(CQ[some]) < 0.06


LIGHT_PITCH = pytest.mark.xfail(strict=True, reason="the pitch 0.6 gets 2.7 points too much, the others up to 1.9")


@pytest.mark.parametrize("pitch", [pytest.param(0.6, marks=LIGHT_PITCH), *fans.PITCHES[1:]])
def test_the_share_of_nozzle_19a(shared_data: Path, tmp_path: Path, pitch: float) -> None:
    known = fans.nozzle_19a(shared_data, tmp_path, pitch)
    some = known.CT > 0.15 * known.CT[0]
    assert np.median(np.abs(off(known)[2])[some]) < 0.02


FIVE_LIGHT = pytest.mark.xfail(strict=True, reason="the pitch 0.6 gets 3.4 points too much, the others up to 1.8")


@pytest.mark.parametrize("pitch", [pytest.param(0.6, marks=FIVE_LIGHT), *fans.PITCHES[1:]])
def test_ka_5_75_in_nozzle_19a_which_nothing_was_set_on(shared_data: Path, tmp_path: Path, pitch: float) -> None:
    """Five blades; first computed when all of the duct was settled.  The bounds are those of the four-bladed one."""
    known = fans.nozzle_19a(shared_data, tmp_path, pitch, "5-75")
    some = known.CT > fans.LIGHT * known.CT[0]
    CT, CQ, share = (np.median(np.abs(v[some])) for v in off(known))
    assert CT < 0.03 and CQ < 0.06 and share < 0.02


def test_bands_of_ducted_rotors_hold_families_that_were_left_out(shared_data: Path, tmp_path: Path) -> None:
    """The rest of ducted rotors from the others; families alike: 60 to 80 % within u, 90 % or more at 95."""
    levels = {name: [fans.level(one) for one in family] for name, family in fans.stated(shared_data, tmp_path).items()}
    found, kept = fans.ducted(levels), population().ducted
    assert kept is not None and kept.families == found.families == 5
    assert kept.size == pytest.approx(found.size, rel=1e-3)
    thrust, thrust95, torque, torque95 = (float(v) / 100.0 for v in fans.left_out(levels)[-1].split("|")[-5:-1])
    assert 0.6 <= thrust <= 0.8 and 0.6 <= torque <= 0.8 and thrust95 >= 0.9 and torque95 >= 0.9


def test_the_ds30_with_gap_lip_and_body_stated(project: Path) -> None:
    """What a user measures in five minutes; pitch, chord, section and exit stay as open as they are."""
    home = project / "cases" / "ds30"
    head, *assumed = (home / "case.toml").read_text().split("[[assumptions]]")
    text = "[[assumptions]]".join(
        [head, *(a for a in assumed if "duct.tip_gap_mm" not in a and "duct.lip_radius_mm" not in a)]
    ).replace("exit_area_ratio = 0.925", "exit_area_ratio = 0.925\nexit_hub_diameter_mm = 0")
    p = propagate(case_of(text, home)).points
    assert p.u["thrust_N"][0] / p.thrust_N[0] < 0.15


def test_the_duct_of_the_76_mm_fan_changes_its_torque_as_measured(shared_data: Path, tmp_path: Path) -> None:
    """Nobody described the blade: its pitch is that of the torque of the open runs; the ducted ones are left out."""
    pitch = fans.pitch_of_torque(shared_data, tmp_path)
    _, torque = fans.over_measured(*fans.fan_76(shared_data, tmp_path, pitch, True))
    assert np.max(np.abs(torque - 1.0)) < 0.1


def test_the_ds30_beside_our_cfd_that_settled(project: Path) -> None:
    """No vanes, gap closed by the cells, incompressible, mean of three grids (their spread: 5 % and 8 %)."""
    found = [r for r in fans.rows(project / "reports" / "cfd" / "ds30_spinner" / "recording.csv")
             if r["converged"] == "1" and float(r["tip_gap_mm"]) < 0.1]  # fmt: skip
    assert len(found) == 3
    case = load_case(project / "cases" / "ds30").replaced({
        "model.effects_off": ("compressibility", "drag_divergence"), "duct.stator.recovery": 0.0,
        "duct.tip_gap_mm": float(found[0]["tip_gap_mm"]),
    })  # fmt: skip
    p = prepare_case(case).solve(case.rpm, 0.0, case.air())
    assert p.thrust_N[0] == pytest.approx(np.mean([float(r["thrust_N"]) for r in found]), rel=0.08)
    assert p.torque_Nm[0] == pytest.approx(np.mean([float(r["torque_Nm"]) for r in found]), rel=0.08)


ALIKE = {  # ours, of alike(): mass flow [kg/s] and share of the duct at DFDC's thrust of the rotor, J 0 to 0.55
    "F1": ([1.2135, 1.2218, 1.2509, 1.3088, 1.3918], [0.519, 0.415, 0.303, 0.182, 0.077]),
    "F2": ([0.2889, 0.2902, 0.2934, 0.2989, 0.3063], [0.493, 0.411, 0.319, 0.213, 0.110]),
    "F3": ([0.5701, 0.5732, 0.5868, 0.6145, 0.6547], [0.648, 0.554, 0.454, 0.348, 0.258]),
}


@pytest.mark.parametrize("name", ALIKE)
def test_the_duct_of_three_fans_is_that_of_dfdc_where_neither_has_losses(shared_data: Path, name: str) -> None:
    found = fans.alike(shared_data, name)
    assert found.known.J == pytest.approx([0.0, 0.12, 0.25, 0.4, 0.55])
    assert found.ours == pytest.approx(ALIKE[name][0], rel=1e-3)
    assert found.share == pytest.approx(ALIKE[name][1], abs=1e-3)
    assert np.max(np.abs(found.ours / found.flow - 1.0)) < 0.02
    assert np.max(np.abs(found.share - found.known.share)) < 0.02


FANS = {"F1": "002", "F2": "004", "F3": "011"}


def as_stated(data: Path, name: str, open_body: bool) -> tuple[Any, Array, Array, Array]:
    """A fan as a user states it (NACA name, nominal gap, losses that DFDC does not have); CT, CQ and share of DFDC."""
    folder = data / "concealed_2" / FANS[name]
    text = (folder / "case.toml").read_text()
    if open_body:
        text = "\n".join(line for line in text.splitlines() if not line.startswith("exit_hub"))
    case = case_of(text, folder)
    table = np.array(json.loads((data / "concealed_2" / "tables3.json").read_text())[f"{name}:nom"])
    rpm, J, CT, duct, CQ = table[np.isclose(table[:, 0], np.unique(table[:, 0])[1])][:, :5].T
    return propagate(case, rpm, J * rpm / 60.0 * case.diameter_m).points, CT, CQ, duct / CT


@pytest.mark.parametrize("open_body", [False, True], ids=["as stated", "exit body not stated"])
@pytest.mark.parametrize("name", FANS)
def test_bands_of_a_fan_hold_what_dfdc_gives_it(shared_data: Path, name: str, open_body: bool) -> None:
    p, CT, CQ, share = as_stated(shared_data, name, open_body)
    assert np.max(np.abs(p.CT - CT) / p.u["CT"]) < 2.0
    assert np.max(np.abs(p.CP - 2.0 * np.pi * CQ) / p.u["CP"]) < 2.0
    assert np.max(np.abs(p.duct_share - share) / p.u["duct_share"]) < 2.0
    assert p.u["CT"][0] < 0.25 * p.CT[0]


UNSTATED = {
    "duct.exit_hub_diameter_mm": (0.0, 66.0), "duct.lip_radius_mm": (0.0, 30.0), "duct.rotor_position_mm": (20.0, 78.0),
    "duct.lip_loss": (0.0, 0.16), "duct.wall_friction": (0.003, 0.007), "duct.gap_loss": (1.0, 2.0),
    "duct.outer_diameter_mm": (345.0, 375.0),
}  # fmt: skip
"""Keys of a duct that a case may leave out, and what they may be for F1."""


@pytest.mark.parametrize("key", UNSTATED)
def test_what_a_case_does_not_say_of_its_duct_lies_in_its_bands(f1_case: Any, tmp_path: Path, key: str) -> None:
    out = (key.removeprefix("duct."), "lip_loss")
    text = "\n".join(line for line in fans.F1.splitlines() if not line.startswith(out))
    tables = {name: (f1_case.case.folder / f"{name}.csv").read_text() for name in ("stations", "polar")}
    case = fans.made(tmp_path, text.replace("tip_gap_mm = 0", "tip_gap_mm = 1.5"), **tables)
    assert key in {item.key for item in duct_unknowns(case)}
    V = f1_case.airspeed(np.array([0.0, 0.3]))
    found = propagate(case, case.rpm, V).points
    for value in UNSTATED[key]:
        moved = prepare_case(case.replaced({key: value})).solve(case.rpm, V, case.air())
        for name in ("thrust_N", "torque_Nm", "duct_share"):
            assert np.all(
                np.abs(moved[name] - found[name]) <= 2.5 * found.u[name]
            )  # ends of a range that is not centred
        changed = case.replaced({key: value})
        assert key not in {item.key for item in duct_unknowns(changed)}


def test_the_share_of_the_balance_is_that_of_the_solver_without_swirl(f1: Model) -> None:
    air = Air.from_density(1.225)
    p = f1.solve(4898.98, np.array([0.0, 5.0, 10.0]), air)
    assert f1.duct is not None
    found = f1.duct.share_at(p.thrust_N / air.rho, p.airspeed_m_s)
    assert found == pytest.approx(p.duct_share, abs=0.01)


# Losses that a case may state ---------------------------------------------------------------------------------------


def test_losses_that_a_case_does_not_state_are_in_its_bands(f1_case: Any) -> None:
    case = f1_case.case.replaced({"duct.tip_gap_mm": 1.5})  # states its lip's loss
    open_ones = {item.key: item for item in duct_unknowns(case)}
    outside = open_ones.pop("duct.outer_diameter_mm")
    assert outside.values[0] < outside.values[1] == outside.nominal
    assert set(open_ones) == {"duct.wall_friction", "duct.gap_loss"}
    assert all(item.values[0] < item.nominal < item.values[1] for item in open_ones.values())
    assert "duct.gap_loss" not in {item.key for item in duct_unknowns(f1_case.case)}  # no gap leaks nothing
    open_ones["duct.outer_diameter_mm"] = outside
    assert duct_unknowns(case.replaced({key: item.values[0] for key, item in open_ones.items()})) == ()
    V = f1_case.airspeed(np.array([0.0, 0.5]))
    u = propagate(case, case.rpm, V).points.u_by["input"]["duct_share"]
    assert 0.0 < u[0] < u[1]


def test_what_a_case_states_of_its_losses_is_taken(f1_case: Any) -> None:
    case = f1_case.case.replaced({"duct.tip_gap_mm": 1.5})
    stated = {"duct.wall_friction": duct_model.WALL_FRICTION, "duct.gap_loss": TipGap().loss}
    thrusts = []
    for changes in ({}, stated, *({key: 2.0 * value} for key, value in stated.items())):
        changed = case.replaced(changes)
        thrusts.append(float(prepare_case(changed).solve(case.rpm, 5.0, case.air()).thrust_N[0]))
    assert thrusts[0] == thrusts[1]
    assert max(thrusts[2:]) < thrusts[0]


def test_a_turned_wind_on_a_ducted_rotor_has_no_answer(project: Path) -> None:
    """An effect that turns the wind next to one that adds a duct: the point is lost, not the diagnosis."""
    case = load_case(project / "cases" / "ds30")
    model, air = prepare_case(case), case.air()
    flow = dataclasses.replace(flow_of(model.prep, [40000.0] * 2, [0.0, 10.0], air), ducted=False)  # the case has none
    loads, _, ok = respond(model.prepared, (*model.effects, ObliqueInflow(30.0)), flow)
    assert ok.tolist() == [True, False]
    assert np.isfinite(loads.T[0]) and np.isnan(loads.T[1]) and np.isnan(loads.Q[1])


def test_an_outer_wall_inside_of_its_lip_is_refused_by_its_key(f1_case: Any, tmp_path: Path) -> None:
    tables = {name: (f1_case.case.folder / f"{name}.csv").read_text() for name in ("stations", "polar")}
    text = fans.F1.replace("lip_radius_mm = 18", "lip_radius_mm = 18\nlip_length_mm = 140\nouter_diameter_mm = 330")
    with pytest.raises(InputError) as told:
        fans.made(tmp_path, text, **tables)
    assert [f.where for f in told.value.faults] == ["duct.outer_diameter_mm", "duct.lip_length_mm"]
    # a lip that is not stated stays inside of a wall that is
    open_lip = fans.F1.replace("lip_radius_mm = 18", "outer_diameter_mm = 330")
    case = fans.made(tmp_path, open_lip, **tables)
    (lip,) = (item for item in duct_unknowns(case) if item.key == "duct.lip_radius_mm")
    assert lip.values == pytest.approx((0.0, 15.0))
    assert np.isfinite(propagate(case, case.rpm, f1_case.airspeed(np.array([0.0, 0.3]))).points.u["thrust_N"]).all()
