"""What effects do: published forms, known limits, right signs."""

from __future__ import annotations

import dataclasses
import math
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from bemt import propeller
from bemt.physics import effects
from bemt.physics.air import Air
from bemt.physics.bem import model as bem
from bemt.physics.bem import solver
from bemt.physics.effects import compressibility, drag_divergence, stall_delay, untwist
from bemt.physics.effects.air_density import AirDensity
from bemt.physics.effects.airspeed_offset import AirspeedOffset
from bemt.physics.effects.base import Effect, Flow, Loads, Reading
from bemt.physics.effects.battery_sag import BatterySag
from bemt.physics.effects.compressibility import Compressibility
from bemt.physics.effects.cross_talk import CrossTalk
from bemt.physics.effects.drag_divergence import DragDivergence
from bemt.physics.effects.drift import ThrustDrift
from bemt.physics.effects.gain import ThrustGain
from bemt.physics.effects.ground_effect import FORMS, GroundEffect
from bemt.physics.effects.inflow_lag import InflowLag
from bemt.physics.effects.lip_separation import LipSeparation
from bemt.physics.effects.motor_heating import MotorHeating
from bemt.physics.effects.mounted_backwards import MountedBackwards
from bemt.physics.effects.nacelle import Nacelle
from bemt.physics.effects.oblique_inflow import ObliqueInflow
from bemt.physics.effects.pitch_offset import PitchOffset
from bemt.physics.effects.post_stall import PostStall
from bemt.physics.effects.recirculation import Recirculation
from bemt.physics.effects.rotor_inertia import RotorInertia, slope
from bemt.physics.effects.rpm_scale import RpmScale
from bemt.physics.effects.section import Section
from bemt.physics.effects.stall_delay import StallDelay
from bemt.physics.effects.supply_voltage import SupplyVoltage
from bemt.physics.effects.tip_gap import TipGap
from bemt.physics.effects.tunnel_blockage import TunnelBlockage
from bemt.physics.effects.unit_slip import UnitSlip
from bemt.physics.effects.untwist import Untwist
from bemt.physics.effects.zero import ThrustZero
from bemt.physics.sections.polars import ALPHA_GRID, ExtrapolatedTable, Polar, from_tables, linear_polar
from bemt.rotors.case.load import load_case
from bemt.rotors.case.prepare import prepare_case
from geometry.laws import helix
from geometry.rotor import Rotor

DEG = np.degrees(ALPHA_GRID)


@cache
def table(cd_max: float = 1.3) -> Polar:
    """Section whose data end at its stall, 13 deg on both sides; Viterna beyond."""
    alpha = np.radians(np.linspace(-13.0, 13.0, 53))
    cl = 5.9 * (alpha + np.radians(2.0))
    return from_tables([ExtrapolatedTable(alpha, cl, 0.012 + 0.008 * cl**2)], cd_max=cd_max)


@cache
def rotor(pitch: float = 0.127) -> Rotor:
    return Rotor(helix(0.254, pitch, hub=0.1), 2)


def tab(*chosen: Effect, polar: Polar | None = None) -> np.ndarray:
    """Tables cl, cd of the middle station at Mach 0, (Na, 2)."""
    prep = solver.prepare(rotor(), [(0.7, polar or table())], chosen, n_stations=9)
    return np.asarray(prep.tables[4, 0, 0])


def loads(*more: Effect, rpm: float = 6000.0, V: float = 0.0, pitch: float = 0.127) -> tuple[float, float]:
    on = (*effects.without(effects.standard(), [e.id for e in more]), *more)
    s = solver.solve(solver.prepare(rotor(pitch), [(0.7, table())], on, n_stations=20), rpm, V, Air.from_density(1.2))
    assert s.converged.all()
    return float(s.T[0]), float(s.Q[0])


def test_viterna_of_another_cd_max_is_the_table_made_with_it() -> None:
    there, wanted = tab(PostStall("viterna", 1.8)), tab(polar=table(1.8))
    # within the stall angle of 180 deg the table joins straight lines, which the effect leaves alone
    told = np.abs(DEG) <= 165.0
    np.testing.assert_allclose(there[told], wanted[told], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("form", ["viterna", "plate"])
def test_post_stall_reaches_its_drag_at_90_deg_and_leaves_attached_flow_alone(form: str) -> None:
    before, after = tab(), tab(PostStall(form, 1.9))
    for side in (-90.0, 90.0):
        assert after[np.argmin(np.abs(DEG - side)), 1] == pytest.approx(1.9)
    attached = np.abs(DEG) <= 13.0
    assert np.array_equal(after[attached], before[attached])
    # joined without a jump: the change grows from the stall on, and drag stays positive
    near = np.argmin(np.abs(DEG - 13.5))
    assert np.all(np.abs(after[near] - before[near]) < 0.05)
    assert np.all(after[:, 1] > 0.0)


def test_a_stalled_blade_pays_in_torque() -> None:
    for form in ("viterna", "plate"):
        high, low = (loads(PostStall(form, c), pitch=0.4) for c in (2.0, 1.1))
        assert high[1] > 1.02 * low[1]
    (T, Q), (T0, Q0) = loads(PostStall("viterna", 2.0), V=10.0), loads(V=10.0)
    assert [T, Q] == pytest.approx([T0, Q0], rel=1e-3), "attached blade"


def test_camber_shifts_the_zero_lift_angle_by_twice_itself() -> None:
    before, after = tab(), tab(Section(camber=0.01, drag=1.0))
    near = np.abs(DEG) < 6.0

    def zero(t: np.ndarray) -> float:
        return float(np.interp(0.0, t[near, 0], ALPHA_GRID[near]))

    assert zero(after) - zero(before) == pytest.approx(-0.02, rel=1e-3)
    assert np.array_equal(after[:, 1], before[:, 1])
    peak = np.argmax(before[np.abs(DEG) < 30.0, 0]), np.argmax(after[np.abs(DEG) < 30.0, 0])
    assert peak[0] == peak[1], "the stall angle stays"
    rough = tab(Section(camber=0.0, drag=1.5))
    np.testing.assert_allclose(rough[np.abs(DEG) <= 15.0, 1], 1.5 * before[np.abs(DEG) <= 15.0, 1])
    assert np.array_equal(rough[np.abs(DEG) >= 30.0], before[np.abs(DEG) >= 30.0])


def test_pitch_moves_the_speed_of_zero_thrust() -> None:
    speeds = np.linspace(12.0, 18.0, 25)

    def zero(*more: Effect) -> float:
        return float(np.interp(0.0, [-loads(*more, V=float(V))[0] for V in speeds], speeds))

    assert zero(PitchOffset(-1.0)) < zero() < zero(PitchOffset(1.0))
    a, b = tab(PitchOffset(1.0)), tab()
    assert np.array_equal(a, b), "the section is the same"


def test_karman_and_tsien_tend_to_prandtl_and_glauert_for_small_pressures() -> None:
    pg, kt = (Compressibility(form=f) for f in compressibility.FORMS)
    M = np.linspace(0.0, 0.75, 16)
    np.testing.assert_allclose(pg.growth(M), 1.0 / np.sqrt(1.0 - M**2))
    np.testing.assert_allclose(kt.growth(M, 1e-9, 1e-9), pg.growth(M), rtol=1e-7)
    thick = np.asarray(kt.growth(M, 0.5, 0.12))
    assert np.all(thick[1:] > np.asarray(pg.growth(M))[1:]) and thick[0] == 1.0
    assert np.all(thick <= 1.5 * np.asarray(pg.growth(M)) + 1e-12)


def test_karman_and_tsien_act_on_both_sides_of_the_section() -> None:
    M, cl, tc = 0.6, 0.7, 0.1
    b = np.sqrt(1.0 - M**2)

    def pressure(cp: float) -> float:
        return float(cp / (b + M**2 / (1.0 + b) * cp / 2.0))

    lower, upper = pressure(-2.0 * tc + cl / 2.0), pressure(-2.0 * tc - cl / 2.0)
    assert Compressibility(form="karman_tsien").growth(M, cl, tc) == pytest.approx((lower - upper) / cl, rel=1e-12)


def test_form_and_amplitude_reach_the_thrust() -> None:
    # inside the range of both forms, tip Mach 0.59: Karman-Tsien lifts more, and amplitude 0 is no Mach number at all
    fast = {f: loads(Compressibility(form=f), rpm=15000.0)[0] for f in compressibility.FORMS}
    none = loads(Compressibility(amplitude=0.0), rpm=15000.0)[0]
    assert none < fast["prandtl_glauert"] < fast["karman_tsien"] < 1.3 * none


def test_wave_drag_has_the_published_values_at_divergence() -> None:
    lock, cubic = (DragDivergence(form=f) for f in drag_divergence.FORMS)
    h = 1e-6
    slope = (float(lock.rise(0.75 + h, 0.75)) - float(lock.rise(0.75 - h, 0.75))) / (2.0 * h)
    assert slope == pytest.approx(0.1, rel=1e-6)  # the definition of M_dd behind 20 (M - M_cr)^4
    assert float(cubic.rise(0.75, 0.75)) == pytest.approx(0.002)
    for e in (lock, cubic):
        assert float(e.rise(0.6, 0.75)) == 0.0
        assert np.all(np.diff(np.asarray(e.rise(np.linspace(0.7, 0.9, 30), 0.75))) > 0.0)
    for form in drag_divergence.FORMS:
        early, late = (loads(DragDivergence(k, form), rpm=20000.0)[1] for k in (0.80, 0.95))
        assert early > 1.01 * late


def test_stall_delay_forms_at_published_strength() -> None:
    x = np.array([0.25, 0.5, 0.75, 1.0])
    c = np.array([0.6, 0.4, 0.2, 0.05])
    beta = np.radians([40.0, 25.0, 16.0, 10.0])
    whole, snel, du_selig = (np.asarray(StallDelay(form=f).weight(c, x, beta)) for f in stall_delay.FORMS)
    np.testing.assert_allclose(whole, 2.2 * c * np.cos(beta) ** 4)
    np.testing.assert_allclose(snel, 3.0 * c**2)
    power = c ** (1.0 / x)
    np.testing.assert_allclose(du_selig, (1.6 * c / 0.1267 * (1 - power) / (1 + power) - 1.0) / (2.0 * np.pi))
    assert du_selig[-1] < 0.0, "taken as none at the tip"
    np.testing.assert_allclose(StallDelay(1.5, form="du_selig").weight(c, x, beta), 0.5 * du_selig)


@pytest.mark.parametrize("form", stall_delay.FORMS)
def test_stall_delay_lifts_stalled_sections_only(form: str) -> None:
    prep = [solver.prepare(rotor(), [(0.7, table())], e, n_stations=9) for e in ((StallDelay(form=form),), ())]
    gain = prep[0].tables[:, 0, 0, :, 0] - prep[1].tables[:, 0, 0, :, 0]
    stalled = (DEG > 14.0) & (DEG < 50.0)
    assert np.all(gain[0, stalled] > 0.0) and np.all(gain >= 0.0)
    assert np.max(np.abs(gain[:, np.abs(DEG) <= 13.0])) < 1e-9
    assert np.all(gain[0, stalled] >= gain[-1, stalled]), "inboard most"


# The promise of effects that act on points of a recording: known limits, right directions, nothing invented.


Array = np.ndarray
FULL = {"thrust_N": 40.0, "torque_Nm": 0.8, "rpm": 9000.0}


@cache
def model() -> bem.Model:
    return bem.Model(Rotor(helix(0.254, 0.127, hub=0.12), 2), [(0.7, linear_polar(cd=0.012))], None, 16)


def recorded(rpm: Array | list[float], V: Array | list[float] | float = 0.0, **extra: Array) -> Flow:
    return bem.flow_of(model().prepared(effects.standard()), rpm, V, Air.from_density(1.2), extra)


def flow_loads(flow: Flow, *more: Effect) -> tuple[Array, Array]:
    found, _, ok = bem.respond(model().prepared, (*effects.standard(), *more), flow)
    assert ok.all()
    return found.T, found.Q


def met(flow: Flow, effect: Effect) -> Flow:
    changed = dataclasses.replace(flow)
    effect.flow(changed)
    return changed


def shown(flow: Flow, effect: Effect) -> dict[str, Array]:
    reading = Reading({"thrust_N": flow.T0.copy(), "torque_Nm": flow.Q0.copy(), "rpm": flow.rpm.copy()}, FULL)
    effect.reading(reading, flow)
    return reading.values


# ---- the flow


def test_induced_speed_is_that_of_momentum_theory() -> None:
    flow = recorded([4000.0, 6000.0], [0.0, 6.0])
    v = flow.induced
    np.testing.assert_allclose(2.0 * flow.rho * flow.area * v * (flow.V + v), flow.T0, rtol=1e-12)


def test_clock_starts_with_every_run_and_order_of_rows_does_not_matter() -> None:
    t, run = np.array([5.0, 3.0, 100.0, 4.0, 107.0]), np.array([1.0, 1.0, 2.0, 1.0, 2.0])
    flow = recorded([6000.0] * 5, time_s=t, run=run)
    assert flow.clock.tolist() == [2.0, 0.0, 0.0, 1.0, 7.0]
    assert [r.tolist() for r in flow.runs] == [[1, 3, 0], [2, 4]]
    assert recorded([6000.0]).clock.tolist() == [0.0] and recorded([6000.0]).runs == []


@pytest.mark.parametrize("form", FORMS)
def test_a_wall_raises_thrust_at_rest_and_less_with_speed_and_distance(form: str) -> None:
    flow = recorded([6000.0] * 4, [0.0, 2.0, 4.0, 8.0])
    gain = flow_loads(flow, GroundEffect(form=form, z_over_R=0.6))[0] / flow_loads(flow)[0] - 1.0
    assert np.all(gain > 0.0) and np.all(np.diff(gain) < 0.0) and gain[3] < 0.3 * gain[0]
    far = flow_loads(flow, GroundEffect(form=form, z_over_R=3.0))[0] / flow_loads(flow)[0] - 1.0
    assert np.all(far < 0.35 * gain) and np.all(far >= 0.0)


@pytest.mark.parametrize("z", [0.7, 1.0, 2.0])
@pytest.mark.parametrize("V", [0.0, 3.0])
def test_the_flow_through_the_disk_is_that_of_the_law_at_equal_thrust(z: float, V: float) -> None:
    """Momentum balanced anew with the onset speed that the rotor is given, as the solver does."""
    flow = recorded([6000.0], [V])
    flow = dataclasses.replace(flow, dT_dV=np.zeros(1))  # equal thrust
    onset, v = met(flow, GroundEffect(z_over_R=z)).V[0], flow.induced[0]
    own = np.sqrt(0.25 * onset**2 + v * (V + v)) - 0.5 * onset
    fade = v**2 / (v**2 + V**2)
    law = 1.0 - (1.0 - (1.0 - (1.0 / (4.0 * z)) ** 2) ** 1.5) * fade
    assert (onset + own - V) / v == pytest.approx(law, rel=1e-9)


@pytest.mark.parametrize("z", [0.7, 1.0, 2.0])
def test_cheeseman_and_bennett_hold_at_constant_power_where_all_power_is_induced(z: float) -> None:
    # what T^(3/2) over power falls by at one speed is what it falls by at constant power, where T goes with its 2/3
    ideal = bem.Model(Rotor(helix(0.254, 0.127, hub=0.12), 2), [(0.7, linear_polar())], None, 16)
    flow = bem.flow_of(ideal.prepared(effects.standard()), [6000.0], 0.0, Air.from_density(1.2), {})
    found, _, ok = bem.respond(ideal.prepared, (*effects.standard(), GroundEffect(z_over_R=z)), flow)
    assert ok.all()
    gain = ((found.T / flow.T0) ** 1.5 / (found.Q / flow.Q0)) ** (2.0 / 3.0)
    law = 1.0 / (1.0 - (1.0 / (4.0 * z)) ** 2)
    assert 0.65 * (law - 1.0) < gain[0] - 1.0 < law - 1.0  # tip loss and uneven inflow take power, too


@pytest.mark.parametrize("z", [0.3, 1.0, 4.0])
def test_a_plate_dams_the_wind_as_a_disk_does(z: float) -> None:
    """Potential of a disk broadside on by its sources: the normal speed on the axis, integrated over the disk.

    A disk moving broadside on is a layer of doublets of strength (4/pi) U sqrt(a^2 - s^2), Lamb art. 102.
    """
    from scipy.integrate import quad

    def doublets(s: float) -> float:
        # speed on the axis at z of a ring of unit axial doublets: s (2 z^2 - s^2) / (2 (z^2 + s^2)^(5/2))
        return 4.0 / np.pi * np.sqrt(1.0 - s**2) * s * (2.0 * z**2 - s**2) / (2.0 * (z**2 + s**2) ** 2.5)

    dammed = GroundEffect(plate_radius_over_R=1.0).dammed(np.array([z]))
    assert dammed == pytest.approx(quad(doublets, 0, 1)[0], rel=1e-6)


def test_wind_is_dammed_where_the_wall_was_measured_only() -> None:
    plate = GroundEffect(strength=0.0, plate_radius_over_R=1.5)
    there = recorded([6000.0] * 3, [8.0] * 3, wall_distance_m=np.array([0.05, 0.2, np.nan]))
    V = met(there, plate).V
    assert V[0] < V[1] < V[2] == 8.0
    hidden = recorded([6000.0], [8.0])
    assert met(hidden, plate).V[0] == 8.0


def test_a_recorded_distance_replaces_the_assumed_one() -> None:
    flow = recorded([6000.0] * 3, wall_distance_m=np.array([0.127, 0.254, np.nan]))
    a, b = (met(flow, GroundEffect(z_over_R=z)).V for z in (0.5, 3.0))
    assert np.array_equal(a, b) and a[0] < a[1] < a[2] == 0.0


def test_recirculation_grows_from_the_start_of_a_run() -> None:
    t = np.array([0.0, 5.0, 10.0, 1000.0])
    flow = recorded([6000.0] * 4, time_s=t)
    V = met(flow, Recirculation(k=0.1, tau_s=10.0)).V
    np.testing.assert_allclose(V / flow.induced, 0.1 * (1.0 - np.exp(-t / 10.0)), atol=1e-15)
    T = flow_loads(flow, Recirculation(k=0.1, tau_s=10.0))[0]
    assert T[0] == flow.T0[0] and np.all(np.diff(T) < 0.0)
    assert "time_s" in Recirculation().applies(recorded([6000.0]))


def test_blockage_is_glauert_s() -> None:
    flow = recorded([6000.0] * 3, [0.0, 4.0, 8.0])
    V = met(flow, TunnelBlockage(area_ratio=0.06)).V
    tau = flow.T0[1:] / (flow.rho[1:] * flow.area * flow.V[1:] ** 2)
    np.testing.assert_allclose(V[1:] / flow.V[1:], 1.0 - 0.06 * tau / (2.0 * np.sqrt(1.0 + 2.0 * tau)), rtol=1e-12)
    T, T0 = flow_loads(flow, TunnelBlockage(area_ratio=0.06))[0], flow_loads(flow)[0]
    assert T[0] == T0[0] and np.all(T[1:] > T0[1:])
    still = recorded([6000.0] * 3, [0.0, 0.05, 0.2])  # what a pitot reads in a room
    assert np.array_equal(met(still, TunnelBlockage(area_ratio=0.06)).V, still.V)


def test_a_nacelle_costs_drag_and_slows_the_root() -> None:
    flow = recorded([6000.0] * 3, [0.0, 4.0, 8.0])
    body = Nacelle(deficit=0.0, cd=0.8)
    T, Q = flow_loads(flow, body)
    T0, Q0 = flow_loads(flow)
    np.testing.assert_allclose(T0 - T, 0.8 * 0.5 * 1.2 * flow.V**2 * np.pi * flow.Rhub**2, rtol=1e-9, atol=1e-12)
    assert np.array_equal(Q, Q0)
    slow, wide = (flow_loads(flow, Nacelle(deficit=0.2, cd=0.0, body_over_R=b))[0] for b in (0.0, 0.4))
    assert slow[0] == wide[0] == T0[0] and np.all(T0[1:] < slow[1:]) and np.all(slow[1:] < wide[1:])
    drag = T0 - flow_loads(flow, Nacelle(deficit=0.0, cd=0.8, body_over_R=0.4))[0]
    np.testing.assert_allclose(drag, 0.8 * 0.5 * 1.2 * flow.V**2 * np.pi * (0.4 * flow.R) ** 2, rtol=1e-9, atol=1e-12)


def test_oblique_inflow_parts_the_wind_and_the_solver_does_the_rest() -> None:
    flow = recorded([6000.0] * 3, [0.0, 5.0, 10.0])
    assert np.array_equal(met(flow, ObliqueInflow(0.0)).V, flow.V)
    for angle in (20.0, 60.0, 90.0):
        m = met(flow, ObliqueInflow(angle))
        assert m.side is not None
        np.testing.assert_allclose(np.hypot(m.V, m.side), flow.V, rtol=1e-12)
    turned = recorded([6000.0], [8.0], sideslip_rad=np.array([math.radians(40.0)]))
    assert met(turned, ObliqueInflow(5.0)).V == pytest.approx(met(recorded([6000.0], [8.0]), ObliqueInflow(40.0)).V)
    T = [float(flow_loads(recorded([6000.0], [8.0]), ObliqueInflow(a))[0][0]) for a in (0.0, 30.0, 60.0, 90.0)]
    assert np.all(np.diff(T) > 0.0)


def test_density_moves_thrust_and_torque_alike() -> None:
    flow = recorded([6000.0, 6000.0], [0.0, 5.0])
    T, Q = flow_loads(flow, AirDensity(-0.2))
    T0, Q0 = flow_loads(flow)
    np.testing.assert_allclose(T / T0, 0.8, rtol=1e-6)  # sections without a Reynolds number
    np.testing.assert_allclose(Q / Q0, 0.8, rtol=1e-6)


def test_airspeed_offset_leaves_static_points_alone_and_never_blows_backwards() -> None:
    flow = recorded([6000.0] * 3, [0.0, 0.4, 6.0])
    assert met(flow, AirspeedOffset(0.5)).V.tolist() == [0.0, 0.9, 6.5]
    assert met(flow, AirspeedOffset(-0.5)).V.tolist() == [0.0, 0.0, 5.5]


def test_a_pitot_that_reads_nothing_at_rest_does_not_read_too_much() -> None:
    live = recorded([6000.0] * 3, [0.01, -0.02, 6.0])
    assert [AirspeedOffset(v).plausible(live) for v in (-1.0, -0.2, 0.0, 1.0)] == [False, True, True, True]
    low = recorded([6000.0] * 2, [-0.7, 5.3])  # its zero is 0.7 m/s too low
    assert met(low, AirspeedOffset(0.7)).V.tolist() == [0.0, 6.0]
    assert AirspeedOffset(-1.0).plausible(recorded([6000.0] * 2, [0.0, 6.0])), "typed as static"
    assert AirspeedOffset(-1.0).plausible(recorded([6000.0] * 2, [1.1, 6.0])), "it reads too much at rest"


# ---- what is written down


def test_electrical_speed_is_pole_pairs_times_the_true_one() -> None:
    flow = recorded([42000.0])
    assert met(flow, RpmScale(factor=7.0, eps=0.0)).rpm[0] == pytest.approx(6000.0, rel=1e-15)
    assert flow.rpm[0] == 42000.0, "the recording stays"
    ratios = {v["factor"] for v in RpmScale().variants()}
    assert {7.0, 1 / 7.0, 2 / 3, 6 / 7, 12 / 14, 0.5, 1.0} <= ratios


def test_a_counter_that_reads_too_much_turns_the_rotor_slower() -> None:
    assert met(recorded([6120.0]), RpmScale(factor=1.0, eps=0.02)).rpm[0] == pytest.approx(6000.0, rel=1e-12)
    assert met(recorded([5880.0]), RpmScale(factor=1.0, eps=-0.02)).rpm[0] == pytest.approx(6000.0, rel=1e-12)


def test_what_instruments_got_wrong_comes_before_the_flow() -> None:
    """The pitot was off in the tunnel: the tunnel turns the true airspeed, whatever order the effects are named in."""
    flow = recorded([6000.0], [6.0])
    pitot, askew = AirspeedOffset(2.0), ObliqueInflow(angle_deg=60.0)
    want = met(met(flow, pitot), askew).V
    assert not np.allclose(want, met(met(flow, askew), pitot).V)
    for order in ((pitot, askew), (askew, pitot)):
        _, found, _ = bem.respond(model().prepared, (*effects.standard(), *order), flow)
        assert pytest.approx(want, rel=1e-12) == found.V


@pytest.mark.parametrize(
    ("channel", "factor"),
    [
        ("thrust_N", 1.0 / 9.80665), ("thrust_N", 9.80665), ("thrust_N", 4.4482216), ("thrust_N", 101.97162),
        ("thrust_N", 1000.0), ("thrust_N", 0.45359237), ("torque_Nm", 10.197162), ("torque_Nm", 141.61193),
        ("torque_Nm", 8.8507458), ("torque_Nm", 0.73756215), ("torque_Nm", 1000.0), ("torque_Nm", 2.0 * math.pi),
        ("torque_Nm", 60.0), ("torque_Nm", 25.4), ("rpm", 2.0 * math.pi / 60.0), ("rpm", 60.0),
        ("airspeed_m_s", 3.6), ("airspeed_m_s", 0.44704), ("density_kg_m3", 0.06242796), ("density_kg_m3", 1e-3),
    ],
)  # fmt: skip
def test_slips_of_units_are_known_by_their_exact_ratio(channel: str, factor: float) -> None:
    known = [v for v in UnitSlip().variants() if v["channel"] == channel]
    assert any(math.isclose(float(v["factor"]), factor, rel_tol=1e-7) for v in known)


def test_a_slip_touches_one_channel() -> None:
    flow = recorded([6000.0], [5.0])
    plain = shown(flow, UnitSlip(factor=1.0))
    for channel in ("thrust_N", "torque_Nm"):
        slip = UnitSlip(channel=channel, factor=1.0 / 9.80665)
        after, m = shown(flow, slip), met(flow, slip)
        assert {c for c in plain if after[c] != plain[c]} == {channel}
        assert after[channel] == pytest.approx(plain[channel] / 9.80665)
        assert (m.rpm, m.V, m.rho) == (flow.rpm, flow.V, flow.rho)
    for channel, field in (("rpm", "rpm"), ("airspeed_m_s", "V"), ("density_kg_m3", "rho")):
        slip = UnitSlip(channel=channel, factor=3.6)
        m = met(flow, slip)
        assert {f for f in ("rpm", "V", "rho") if getattr(m, f) != getattr(flow, f)} == {field}
        assert getattr(m, field) == pytest.approx(getattr(flow, field) / 3.6)
        assert shown(flow, slip) == plain


# ---- instruments


@pytest.mark.parametrize(
    "name", [n for n, c in effects.catalogue().items() if c.kind == "stand" and "reading" in vars(c)]
)
def test_a_stand_error_of_readings_leaves_the_air_alone(name: str) -> None:
    cls = effects.catalogue()[name]
    assert not bem.acts_on_rotor(cls()) and "loads" not in vars(cls)
    assert "flow" not in vars(cls) or name == "unit_slip"


def test_zero_gain_and_cross_talk() -> None:
    flow = recorded([3000.0, 6000.0, 9000.0], [0.0, 3.0, 9.0])
    T, Q = flow.T0, flow.Q0
    np.testing.assert_allclose(shown(flow, ThrustGain(0.04))["thrust_N"], 1.04 * T)
    np.testing.assert_allclose(shown(flow, ThrustZero(0.02))["thrust_N"] - T, 0.8)
    np.testing.assert_allclose(shown(flow, CrossTalk(k=0.03))["thrust_N"] - T, 0.03 * Q / flow.R)
    np.testing.assert_allclose(shown(flow, CrossTalk("thrust_in_torque", -0.03))["torque_Nm"] - Q, -0.03 * T * flow.R)


def test_drift_follows_clock_and_temperature_of_its_run() -> None:
    t = np.array([0.0, 300.0, 3000.0, 9000.0])
    flow = recorded([6000.0] * 4, time_s=t, run=np.array([1.0, 1.0, 1.0, 2.0]),
                    temperature_K=np.array([290.0, 295.0, 300.0, 310.0]))  # fmt: skip
    creep = (shown(flow, ThrustDrift(0.05, 300.0))["thrust_N"] - flow.T0) / 40.0
    np.testing.assert_allclose(creep, [0.0, 0.05 * (1 - math.exp(-1)), 0.05 * (1 - math.exp(-10)), 0.0], atol=1e-15)
    warm = (shown(flow, ThrustDrift(0.0, 300.0, 0.001))["thrust_N"] - flow.T0) / 40.0
    np.testing.assert_allclose(warm, [0.0, 0.005, 0.010, 0.0], atol=1e-15)
    once = (shown(flow, ThrustDrift(0.05, 300.0, tared="once"))["thrust_N"] - flow.T0) / 40.0
    np.testing.assert_allclose(once, 0.05 * (1.0 - np.exp(-t / 300.0)), atol=1e-15)
    assert ThrustDrift().applies(flow) == ""
    assert ThrustDrift().applies(recorded([6000.0] * 2)) != ""
    assert ThrustDrift().applies(recorded([6000.0] * 2, temperature_K=np.array([290.0, 291.0]))) == ""


def test_inertia_is_the_derivative_of_the_speed() -> None:
    t = np.linspace(0.0, 1.0, 101)
    rpm = 6000.0 + 1500.0 * np.sin(2.0 * np.pi * t)
    shuffled = np.random.default_rng(3).permutation(t.size)
    flow = recorded(rpm[shuffled], time_s=t[shuffled])
    exact = 1500.0 * np.pi / 30.0 * 2.0 * np.pi * np.cos(2.0 * np.pi * t)
    found = np.empty_like(t)
    found[shuffled] = slope(flow)
    assert np.max(np.abs(found - exact)[1:-1]) < 1e-3 * exact.max()
    inertia = 2 * 1300.0 * 0.068 * flow.chord**2 * flow.R**3 / 3.0
    np.testing.assert_allclose(shown(flow, RotorInertia(3.0))["torque_Nm"] - flow.Q0, 3.0 * inertia * slope(flow))
    assert np.all(slope(recorded(rpm, time_s=100.0 * t * 2)) == 0.0), "steps of 2 s are plateaus"
    # a sweep up and down, averaged by speed: all means have one time but for rounding
    once = 60.0 + 1e-14 * np.arange(t.size)
    assert np.all(slope(recorded(rpm, time_s=once)) == 0.0), "means of two sweeps are no transient"


def test_inflow_lag_overshoots_when_the_speed_rises_and_settles() -> None:
    t = np.arange(0.0, 1.0, 0.01)
    rpm = np.where(t < 0.3, 5000.0, 7000.0)
    flow = recorded(rpm, time_s=t)
    found = Loads(flow.T0.copy(), flow.Q0.copy(), np.zeros_like(t))
    InflowLag(0.05).loads(found, flow)
    extra = found.T - flow.T0
    assert np.all(extra[:30] == 0.0) and extra[30] > 0.05 * flow.T0[30]
    decay = extra[31:60] / extra[30:59]
    np.testing.assert_allclose(decay, math.exp(-0.01 / 0.05), rtol=1e-6)
    # a jump between two points 10 ms apart: the induced speed has gone a share 1 - (1 - exp(-x))/x of the way
    late = flow.induced[29] - flow.induced[30]
    x = 0.01 / 0.05
    frozen = extra[30] / (late * (1.0 - math.exp(-x)) / x)
    assert frozen < flow.dT_dV[30] < 0.0, "with the induced speed held, thrust falls faster with onset speed"
    down = recorded(rpm[::-1].copy(), time_s=t)
    InflowLag(0.05).loads(less := Loads(down.T0.copy(), down.Q0.copy(), np.zeros_like(t)), down)
    assert np.min(less.T - down.T0) < 0.0 and np.max(less.T - down.T0) == 0.0


def test_inflow_lag_matches_blades_at_frozen_inflow() -> None:
    # blades whose induced speed is held: thrust at V + dv with the momentum balance shifted by -dv; by definition
    # dT/dw = dT/dV / (1 + dv/dV), checked here against the induced speed of the solved thrust itself
    flow, h = recorded([6000.0], [4.0]), 1e-3
    up, down = recorded([6000.0], [4.0 + h]), recorded([6000.0], [4.0 - h])
    total = (up.T0 - down.T0) / (up.V + up.induced - down.V - down.induced)
    v, disk = flow.induced, 2.0 * flow.rho * flow.area
    follow = (flow.dT_dV / disk - v) / (flow.V + 2.0 * v)
    assert flow.dT_dV / (1.0 + follow) == pytest.approx(total, rel=1e-3)


# ---- duct and blade


def mouth(thrust: list[float], V: float | list[float] = 0.0, **extra: Array) -> Flow:
    """Points of a ducted rotor whose baseline has this thrust."""
    flow = dataclasses.replace(recorded([6000.0] * len(thrust), **extra), ducted=True)
    return dataclasses.replace(flow, V=np.broadcast_to(np.asarray(V, float), flow.rpm.shape), T0=np.array(thrust))


def test_the_lip_separates_above_its_limit_only() -> None:
    flow = mouth([1.0, 6.0, 8.0, 10.0])
    np.testing.assert_allclose(LipSeparation(onset=0.6, loss=0.5).share(flow), [0.0, 0.0, 0.25, 0.5], atol=1e-12)
    assert LipSeparation().applies(recorded([6000.0])) == "the rotor has no duct"
    bit_by_bit = LipSeparation(onset=0.2, loss=0.5, width=1.0)  # whole from twice the onset
    np.testing.assert_allclose(bit_by_bit.share(mouth([1.0, 3.0, 4.0, 10.0])), [0.0, 0.25, 0.5, 0.5], atol=1e-12)


def test_the_lip_by_advance_separates_at_rest_first() -> None:
    lost = LipSeparation(onset=0.25, loss=0.4, by="advance").share(mouth([4.0] * 3, [0.0, 10.0, 20.0]))
    assert lost[0] == pytest.approx(0.4)
    assert np.all(np.diff(lost) < 0.0)
    # at rest an inviscid flow loses the same share at any load
    np.testing.assert_allclose(LipSeparation(onset=0.9, loss=0.4, by="advance").share(mouth([4.0, 8.0])), 0.4)


def test_the_lip_by_turning_is_that_of_a_straight_duct() -> None:
    # momentum: thrust rho A Ve (Ve - V) at jet speed Ve, which turns Ve - V into the mouth
    V, jet = np.array([0.0, 8.0, 16.0]), np.array([20.0, 20.0, 20.0])
    one = recorded([6000.0])
    flow = mouth(list(float(one.rho[0] * one.area) * jet * (jet - V)), list(V))
    share = LipSeparation(onset=0.01, loss=1.0, width=99.0, by="turning").share(flow)
    turned = ((jet - V) / jet) ** 2
    np.testing.assert_allclose(share, (turned - 0.01) / 0.99, atol=1e-9)


def test_the_lip_remembers() -> None:
    lost = LipSeparation(onset=0.6, loss=0.5, hysteresis=0.2).share(
        mouth([2.0, 5.5, 8.0, 10.0, 8.0, 5.5, 2.0], time_s=np.arange(7.0))
    )
    assert lost[1] == 0.0 < lost[5] and lost[0] == lost[6] == 0.0
    assert lost[2] == pytest.approx(lost[4])


def test_a_separated_lip_is_one_that_loses_as_much_head() -> None:
    """Less flow: less thrust and more torque, the same as of a duct whose own lip loses that, at rest and in flight."""
    fan = prepare_case(load_case("cases/ds30"))
    assert fan.duct is not None
    V = np.array([0.0, 10.0, 20.0])
    flow = bem.flow_of(fan.prep, 30000.0, V, Air.from_density(1.2))
    lip = LipSeparation(onset=0.01, loss=0.3, width=0.01, by="advance")
    apart, _, ok = bem.respond(fan.prepared, (*fan.effects, lip), flow)
    lossy = dataclasses.replace(fan, duct=dataclasses.replace(fan.duct, lip_loss=fan.duct.lip_loss + 0.3))
    same = lossy.solve(30000.0, V, Air.from_density(1.2))
    assert ok.all()
    np.testing.assert_allclose(apart.T, same.thrust_N, rtol=3e-3)
    np.testing.assert_allclose(apart.Q, same.torque_Nm, rtol=3e-3)
    np.testing.assert_allclose(apart.T_duct, same.duct_thrust_N, rtol=2e-2)
    assert np.all(apart.T < flow.T0) and np.all(apart.Q > flow.Q0)


def test_untwist_is_measured_at_the_hardest_point() -> None:
    flow = recorded([3000.0, 6000.0, 9000.0])
    share = Untwist().share(flow)
    np.testing.assert_allclose(share, [1 / 9, 4 / 9, 1.0])
    CT, CT0 = (flow_loads(flow, *e)[0] / flow.rpm**2 for e in ((Untwist(1.0),), ()))
    fall = 1.0 - CT / CT0
    assert np.all(fall > 0.0) and np.all(np.diff(fall) > 0.0)
    np.testing.assert_allclose(fall / fall[2], share, rtol=0.08)
    assert np.all(flow_loads(flow, Untwist(-1.0))[0] > flow_loads(flow)[0])


@pytest.mark.parametrize("form", untwist.FORMS)
def test_a_blade_twists_as_a_rod_that_is_free_at_its_tip(form: str) -> None:
    """Beside the integrals of a rod of one section: moment as r^2, or, at one blade angle, the same everywhere."""
    hub, n = 0.1, 400
    r = hub + (1.0 - hub) * (np.arange(n) + 0.5) / n
    same = np.ones(n)
    thin, beta = 0.1 * same, 0.3 * same
    bake = SimpleNamespace(r=r, dr=same * (1.0 - hub) / n, R=1.0, chord=thin, thickness=thin, beta=beta, level=1.0)
    Untwist(2.0, form).blade(bake)
    turn = np.degrees(0.3 - bake.beta)
    x, s = r - hub, r**4 - hub**4
    exact = x - s / 4.0 if form == "aerodynamic" else x - x**2 / (2.0 * (1.0 - hub))
    np.testing.assert_allclose(turn, 2.0 * exact / np.interp(0.75, r, exact), atol=0.02)
    assert turn[-1] - turn[-2] < 0.02 * (turn[1] - turn[0]), "no moment at the tip"


def test_gaps_of_a_recording_are_in_proportion_to_the_largest() -> None:
    gaps = np.array([1e-4, 4e-4, np.nan])
    assert TipGap().share(recorded([6000.0] * 3, tip_gap_m=gaps)) == pytest.approx([0.25, 1.0, 1.0])
    assert TipGap().share(recorded([6000.0])) is None
    assert TipGap().applies(recorded([6000.0])) == "the rotor has no duct"


# ---- drive


def test_the_drive_never_shows_in_thrust() -> None:
    t = np.array([0.0, 50.0, 500.0])
    flow = recorded([5000.0, 7000.0, 9000.0], time_s=t, pwm_s=np.array([1.3e-3, 1.5e-3, 1.8e-3]))
    for e in (MotorHeating(), BatterySag(), SupplyVoltage()):
        values = shown(flow, e)
        assert np.array_equal(values["thrust_N"], flow.T0) and np.array_equal(values["torque_Nm"], flow.Q0)
        assert not np.array_equal(values["rpm"], flow.rpm)
        still = Reading({"thrust_N": flow.T0, "torque_Nm": flow.Q0}, FULL)
        e.reading(still, flow)
        assert set(still.values) == {"thrust_N", "torque_Nm"}, "no speed channel is made up"
        assert "pwm_s" in e.applies(recorded([6000.0], time_s=np.zeros(1)))


@pytest.mark.parametrize("copper", [0.03, 0.15, 0.4])
def test_a_hot_motor_obeys_its_voltage_balance(copper: float) -> None:
    flow = recorded([9000.0, 9000.0], time_s=np.array([0.0, 1e9]))
    cold, hot = shown(flow, MotorHeating(60.0, 120.0, copper))["rpm"] / 9000.0
    assert cold == 1.0
    k, R = 1.0 - 0.06, copper * (1.0 + 0.0039 * 60.0)  # in units of the cold motor at this point
    assert k * hot + R * hot**2 / k == pytest.approx(1.0 + copper, rel=1e-12)
    assert bool(hot < 1.0) is (copper > 0.3), "weaker magnets speed a lightly loaded motor up"


def test_a_winding_that_is_hot_before_its_magnets_are_slows_the_motor_first() -> None:
    flow = recorded([9000.0] * 3, time_s=np.array([0.0, 400.0, 1e7]))
    cold, early, late = shown(flow, MotorHeating(60.0, 100.0, 0.1, magnets=10.0))["rpm"] / 9000.0
    assert early < cold == 1.0 < late


def test_a_motor_that_stands_cools_and_a_new_clock_starts_cold() -> None:
    t, run = np.array([0.0, 200.0, 400.0, 1e9, 2e9]), np.array([1.0, 1.0, 2.0, 3.0, 3.0])
    share = shown(recorded([9000.0] * 5, time_s=t, run=run), MotorHeating(60.0, 100.0, 0.05))["rpm"] / 9000.0 - 1.0
    assert share[0] == share[3] == 0.0, "cold at the start and after a long stand"
    assert 0.0 < share[2] < 0.2 * share[1] < share[1] < share[4]
    again = shown(recorded([9000.0] * 4, time_s=np.array([0.0, 200.0, 0.0, 200.0]), run=np.array([1.0, 1.0, 2.0, 2.0])),
                  MotorHeating(60.0, 100.0, 0.05))["rpm"]  # fmt: skip
    assert again[0] == again[2] < again[1] == again[3]


@pytest.mark.parametrize("change", [-0.3, 0.0, 0.5])
def test_a_supply_obeys_its_voltage_balance(change: float) -> None:
    flow = recorded([4500.0, 9000.0], pwm_s=np.full(2, 1.8e-3))
    y = shown(flow, SupplyVoltage(change, 0.2))["rpm"] / flow.rpm
    lever = flow.Q0 / flow.omega
    u = 0.2 * lever / lever.max()
    np.testing.assert_allclose(y + u * y**2, (1.0 + change) * (1.0 + u), rtol=1e-12)


def test_a_wider_gap_costs_what_the_gap_of_another_case_costs() -> None:
    from bemt.rotors.case import load_case
    from bemt.rotors.case.prepare import prepare_case

    def thrust(changed: dict[str, object]) -> float:
        case = load_case("cases/ds30/case.toml").replaced(changed)
        return float(prepare_case(case).solve(case.rpm, case.airspeed_m_s, case.air()).thrust_N[0])

    own = thrust({})
    wider = thrust({"model.effects_on": ["wider_gap(extra_mm=0.4)"]})
    assert wider < own
    # the wall itself moves in the other case, by a hundredth of the bore
    assert wider / own == pytest.approx(thrust({"duct.tip_gap_mm": 0.8}) / own, abs=0.02)
    sealed = thrust({"model.effects_on": ["wider_gap(extra_mm=-1.0)"]})
    assert own < sealed == thrust({"model.effects_on": ["wider_gap(extra_mm=-0.4)"]})


def test_a_recorded_voltage_is_taken_as_it_is() -> None:
    volts = np.array([16.0, 15.2, 14.4])
    flow = recorded([9000.0] * 3, voltage_V=volts, pwm_s=np.full(3, 1.8e-3))
    y = shown(flow, BatterySag(copper=0.03))["rpm"] / 9000.0
    assert np.array_equal(y, shown(flow, BatterySag(sag=0.2, discharge=0.0, copper=0.03))["rpm"] / 9000.0)
    np.testing.assert_allclose(y * 1.0 + 0.03 * y**2, 1.03 * volts / 16.0, rtol=1e-12)
    late = recorded([9000.0] * 3, time_s=np.array([0.0, 60.0, 120.0]))
    np.testing.assert_allclose(np.diff(shown(late, BatterySag(sag=0.0, discharge=0.1))["rpm"]) < 0.0, True)


def test_noise_of_a_voltmeter_does_not_reach_the_speed() -> None:
    """Where one resistance and the charge drawn explain the voltage; a supply that jumps is taken as recorded."""
    rng = np.random.default_rng(3)
    t, amps = np.linspace(0.0, 600.0, 80), np.tile([10.0, 20.0, 40.0, 60.0], 20)
    true = 22.0 - 0.02 * amps - 1.5 * t / 600.0
    common = {"time_s": t, "current_A": amps, "pwm_s": np.full(80, 1.6e-3)}

    def speed(volts: np.ndarray) -> np.ndarray:
        return shown(recorded([9000.0] * 80, voltage_V=volts, **common), BatterySag(copper=0.03))["rpm"]

    noisy = true * (1.0 + 0.001 * rng.standard_normal(80))
    assert np.std(speed(noisy) / speed(true)) < 0.4e-3
    jumps = np.where(t > 300.0, 0.8, 1.0) * true
    assert speed(jumps)[-1] / speed(true)[-1] == pytest.approx(0.8, abs=0.02)


def test_a_propeller_turned_over_is_a_screw_with_its_camber_upside_down() -> None:
    flow = recorded([4000.0, 6000.0, 8000.0])
    plain, turned, rough = (flow_loads(flow, *e) for e in ((), (MountedBackwards(1.0),), (MountedBackwards(3.0),)))
    np.testing.assert_allclose(turned, plain, rtol=1e-9)  # these sections are symmetric
    assert np.all(rough[1] > plain[1])
    cambered = propeller("10x4.5")
    backwards = cambered.replaced({"model.effects_on": ["mounted_backwards"]})
    T, less = (float(p.solve(6000.0, bands=False).thrust_N[0]) for p in (cambered, backwards))
    assert 0.0 < less < 0.8 * T
