"""The promise of the limits: the solver gives theory's closed answers, in any fluid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from bemt.base.errors import InputError
from bemt.physics.air import Air
from bemt.physics.bem import solver
from bemt.physics.bem.duct import DuctFlow
from bemt.physics.cavitation import keller_N
from bemt.physics.effects import Effect, standard
from bemt.physics.effects.high_induction import HighInduction
from bemt.physics.effects.swirl import Swirl
from bemt.physics.effects.tip_loss import TipLoss
from bemt.physics.sections.polars import Polar, linear_polar
from bemt.rotors.case import load_case
from bemt.rotors.case.prepare import prepare_case
from geometry.laws import helix
from geometry.rotor import Blade, Rotor, Stations, from_stations

AIR = Air.from_density(1.2)
R, RHUB, RPM = 0.5, 0.1, 2400.0
OMEGA = RPM * np.pi / 30.0
AREA = np.pi * (R**2 - RHUB**2)
SLOPE = 2.0 * np.pi
CL = 0.5
IDEAL = linear_polar(SLOPE)  # no drag worth the name


def uniform_rotor(w: float, V: float = 0.0, B: int = 4, ducted: float | None = None, swirl: bool = False) -> Rotor:
    """Blade of constant cl that gives every annulus the speed w through the disk; ``ducted`` is sigma_w."""
    r = np.linspace(RHUB, R, 400)
    if swirl:
        # F m v_t = sigma/4 W^2 ct and F m (w - V) = sigma/4 W^2 cn with cd = 0: v_t / (w - V) = tan(phi)
        phi = np.array([brentq(lambda p, x=x: OMEGA * x - (w - V) * np.tan(p) - w / np.tan(p), 1e-3, 1.2) for x in r])
    else:
        phi = np.arctan2(w, OMEGA * r)
    W = w / np.sin(phi)
    push = 4.0 * w * (w - V) if ducted is None else w**2 / ducted**2 - V**2
    chord = push / (W**2 * CL * np.cos(phi)) * 2.0 * np.pi * r / B
    return Rotor(from_stations(r, chord, phi + CL / SLOPE, R, RHUB), B)


def run(
    rotor: Rotor, polar: Polar = IDEAL, effects: tuple[Effect, ...] = (), V: float = 0.0, duct: DuctFlow | None = None,
    n: int = 60,
) -> solver.Solution:  # fmt: skip
    prep = solver.prepare(rotor, [(0.7, polar)], effects, duct, stations=rotor.blade.midpoints(n))
    return solver.solve(prep, RPM, V, AIR, radial=True)


def test_ideal_hover_has_figure_of_merit_one() -> None:
    w = 8.0
    s = run(uniform_rotor(w))
    assert np.allclose(s.radial.w, w, rtol=1e-5)
    assert s.T[0] == pytest.approx(2.0 * AIR.rho * AREA * w**2, rel=1e-5)
    assert s.T[0] * np.sqrt(s.T[0] / (2.0 * AIR.rho * AREA)) / s.P[0] == pytest.approx(1.0, abs=1e-5)
    assert s.V_exit[0] == pytest.approx(2.0 * w, rel=1e-5)


@pytest.mark.parametrize("V", [3.0, 15.0])
def test_actuator_disk_in_flight(V: float) -> None:
    w = V + 4.0
    s = run(uniform_rotor(w, V), V=V)
    assert s.T[0] == pytest.approx(2.0 * AIR.rho * AREA * w * (w - V), rel=1e-5)
    assert s.T[0] * V / s.P[0] == pytest.approx(V / w, rel=1e-5)  # Froude efficiency
    assert s.V_exit[0] == pytest.approx(2.0 * w - V, rel=1e-5)


def test_swirl_costs_its_own_kinetic_energy_and_nothing_else() -> None:
    s = run(uniform_rotor(8.0, swirl=True), effects=(Swirl(),))
    w, v_t, dT, dQ, r = (getattr(s.radial, k)[0] for k in ("w", "v_t", "dT", "dQ", "r"))
    assert np.allclose(w, 8.0, rtol=1e-5)
    # lift does no work on the flow that the blade meets, so the shaft pays for push and spin
    assert np.allclose(dQ * OMEGA, dT * w + dQ / r * v_t, rtol=1e-10)
    # and that is half the mass flow times (2 v)^2 + (2 v_t)^2
    dm = dT / (2.0 * w)
    assert np.allclose(dQ * OMEGA, 0.5 * dm * ((2.0 * w) ** 2 + (2.0 * v_t) ** 2), rtol=1e-9)
    figure = s.T[0] * np.sqrt(s.T[0] / (2.0 * AIR.rho * AREA)) / s.P[0]
    assert 0.95 < figure < 0.999


@pytest.mark.parametrize("sigma_w", [0.5, 0.8, 1.0, 1.25])
def test_duct_carries_its_share_at_rest(sigma_w: float) -> None:
    w = 12.0
    s = run(uniform_rotor(w, ducted=sigma_w), duct=DuctFlow(sigma_w))
    assert np.allclose(s.radial.w, w, rtol=1e-5)
    assert s.T[0] == pytest.approx(AIR.rho * AREA * w**2 / sigma_w, rel=1e-5)
    assert s.T_rotor[0] / s.T[0] == pytest.approx(1.0 / (2.0 * sigma_w), rel=1e-5)
    assert s.V_exit[0] == pytest.approx(w / sigma_w, rel=1e-5)
    # power against an open rotor of the same thrust and disk
    alone = s.T[0] * np.sqrt(s.T[0] / (2.0 * AIR.rho * AREA))
    assert s.P[0] / alone == pytest.approx((2.0 * sigma_w) ** -0.5, rel=1e-5)


def test_duct_of_half_the_exit_area_is_the_open_rotor() -> None:
    rotor = uniform_rotor(8.0)
    for V in (0.0, 6.0):
        open_, ducted = run(rotor, V=V), run(rotor, V=V, duct=DuctFlow(0.5))
        if V == 0.0:
            assert ducted.T[0] == pytest.approx(open_.T[0], rel=1e-9)
            assert ducted.P[0] == pytest.approx(open_.P[0], rel=1e-9)
        else:  # in flight the open rotor's wake does not contract to half
            assert ducted.T[0] != pytest.approx(open_.T[0], rel=1e-3)


def test_duct_in_flight() -> None:
    w, V, sigma_w = 15.0, 6.0, 0.9
    s = run(uniform_rotor(w, V, ducted=sigma_w), V=V, duct=DuctFlow(sigma_w))
    jet = w / sigma_w
    assert s.T[0] == pytest.approx(AIR.rho * AREA * w * (jet - V), rel=1e-5)
    assert s.T_rotor[0] == pytest.approx(0.5 * AIR.rho * AREA * (jet**2 - V**2), rel=1e-5)
    assert s.P[0] == pytest.approx(0.5 * AIR.rho * AREA * w * (jet**2 - V**2), rel=1e-5)


@pytest.mark.parametrize("ducted", [False, True])
@pytest.mark.parametrize("V", [-2.0, 0.0, 9.0])
def test_zero_chord_does_nothing(ducted: bool, V: float) -> None:
    rotor = Rotor(helix(0.254, 0.127), 2)
    s = rotor.blade.midpoints(30, "cosine")
    bare = Stations(s.r, s.dr, np.zeros_like(s.chord), s.beta)
    duct = DuctFlow(1.0) if ducted else None
    prep = solver.prepare(rotor, [(0.7, IDEAL)], duct=duct, stations=bare)
    out = solver.solve(prep, 6000.0, V, AIR, radial=True)
    assert out.converged[0]
    assert out.T_rotor[0] == 0.0
    assert out.Q[0] == 0.0
    if not ducted:
        assert out.T[0] == 0.0
        assert np.allclose(out.radial.w, V, atol=1e-12)


def test_many_blades_tend_to_the_disk_without_tip_loss() -> None:
    thrust = [run(uniform_rotor(8.0, B=B), effects=(TipLoss(),), n=2000).T[0] for B in (2, 4, 8, 16, 32, 64)]
    lost = 1.0 - np.array(thrust) / run(uniform_rotor(8.0)).T[0]
    assert np.all(lost > 0)
    # the lossy rim is as wide as the distance between vortex sheets: a first-order loss
    assert np.allclose(lost[2:-1] / lost[3:], 2.0, rtol=0.05)
    assert lost[-1] < 0.01


@pytest.mark.parametrize("ducted", [False, True])
def test_rest_is_the_limit_of_slow_flight_from_both_sides(rotor: Rotor, polar: Polar, ducted: bool) -> None:
    duct = DuctFlow(0.95, 0.05, 0.2, 0.8, 0.001, 0.08, 0.01) if ducted else None
    prep = solver.prepare(rotor, [(0.7, polar)], duct=duct)
    V = np.array([0.0, 1e-12, -1e-12, 1e-9, -1e-9, 1e-7, -1e-7])
    s = solver.solve(prep, 6000.0, V, AIR)
    assert s.converged.all()
    assert np.allclose(s.T, s.T[0], rtol=1e-6)
    assert np.allclose(s.Q, s.Q[0], rtol=1e-6)
    assert np.allclose(s.T[1:3], s.T[0], rtol=1e-10)
    # one order more of speed is one order more of difference, on either side
    steps = np.abs(solver.solve(prep, 6000.0, [1e-3, 1e-4, -1e-3, -1e-4], AIR).T - s.T[0])
    assert steps[0] / steps[1] == pytest.approx(10.0, rel=0.02)
    assert steps[2] / steps[3] == pytest.approx(10.0, rel=0.02)


def test_windmill_does_not_beat_betz() -> None:
    """Without drag and swirl a windmill takes at most 16/27 of the power flowing to its disk, and nearly that."""
    best = 0.0
    V = 10.0
    for a in np.linspace(0.1, 0.5, 9):
        w = V * (1.0 - a)
        r = np.linspace(RHUB, R, 400)
        phi = np.arctan2(w, OMEGA * r)
        W = w / np.sin(phi)
        chord = 4.0 * w * (V - w) / (W**2 * CL * np.cos(phi)) * 2.0 * np.pi * r / 3
        rotor = Rotor(from_stations(r, chord, phi - CL / SLOPE, R, RHUB), 3)
        s = run(rotor, effects=(HighInduction(),), V=V)
        share = -s.P[0] / (0.5 * AIR.rho * AREA * V**3)
        if a < 0.4:
            assert share == pytest.approx(4.0 * a * (1.0 - a) ** 2, rel=1e-4)
        best = max(best, share)
    assert 0.58 < best < 16.0 / 27.0 * (1.0 + 1e-4)


def test_thin_air_drag_alone_gives_the_textbook_profile_power() -> None:
    """A feather-light load: CP tends to sigma cd / 8 (helicopter convention), the torque of drag alone."""
    chord, cd, B = 0.02, 0.02, 2
    blade: Blade = from_stations([RHUB, R], [chord, chord], [0.004, 0.004], R, RHUB)
    s = run(Rotor(blade, B), linear_polar(SLOPE, cd=cd))
    profile = 0.5 * AIR.rho * B * chord * cd * OMEGA**3 * (R**4 - RHUB**4) / 4.0
    induced = s.T[0] * np.sqrt(s.T[0] / (2.0 * AIR.rho * AREA))
    assert s.P[0] == pytest.approx(profile + induced, rel=5e-3)


def test_standard_physics_stays_below_the_ideal_disk(rotor: Rotor, polar: Polar) -> None:
    prep = solver.prepare(rotor, [(0.7, polar)], standard())
    V = np.linspace(0.0, 10.0, 40)
    s = solver.solve(prep, 6000.0, V, AIR)
    push = s.T > 0
    assert push.sum() > 20
    area = np.pi * (rotor.R**2 - rotor.Rhub**2)
    T, V = s.T[push], V[push]
    v = -0.5 * V + np.sqrt(0.25 * V**2 + T / (2.0 * AIR.rho * area))
    assert np.all(s.P[push] > T * (V + v))


# The promise of water: a propeller has the coefficients of its Reynolds number, whatever the fluid.


CASE = """schema = "bemt.case/1"
name = "hydro"
[rotor]
kind = "propeller"
blades = 3
diameter_mm = 250
hub_ratio = 0.18
[blade]
pitch_mm = 250
chord_law = "apc_like"
max_chord_over_R = 0.3
[blade.section]
camber = 0.03
thickness = 0.08
[operating]
rpm = 300
airspeed_m_s = 0.6
[air]
{air}
"""


def coefficients(folder: Path, air: str, rpm: float, J: float = 0.5) -> tuple[float, float]:
    folder.mkdir()
    (folder / "case.toml").write_text(CASE.format(air=air), "utf-8")
    case = load_case(folder / "case.toml")
    made = case.air()
    point = prepare_case(case).solve(np.array([rpm]), np.array([J * rpm / 60.0 * 0.25]), made)
    q = made.rho * (rpm / 60.0) ** 2 * 0.25**4
    return float(point.thrust_N[0]) / q, float(point.torque_Nm[0]) / (q * 0.25)


def test_water_and_air_agree_at_one_reynolds_number(tmp_path: Path) -> None:
    wet = coefficients(tmp_path / "wet", 'fluid = "water"\ntemperature_C = 15', 150.0)
    faster = 1.4607e-5 / 1.1386e-6  # kinematic viscosities of air at 15 C, 1.225 kg/m3, and of fresh water
    dry = coefficients(tmp_path / "dry", "density_kg_m3 = 1.225\ntemperature_C = 15", 150.0 * faster)
    assert wet == pytest.approx(dry, rel=0.01)


def test_a_density_between_gas_and_water_is_refused(tmp_path: Path) -> None:
    for k, air in enumerate(("density_kg_m3 = 500", "density_kg_m3 = 1.2\nsalinity_g_kg = 35",
                             'fluid = "water"\ntemperature_C = -5', 'fluid = "water"\naltitude_m = 0')):  # fmt: skip
        with pytest.raises(InputError):
            coefficients(tmp_path / str(k), air, 300.0)
    assert coefficients(tmp_path / "by_density", "density_kg_m3 = 999.1", 300.0) == pytest.approx(
        coefficients(tmp_path / "by_name", 'fluid = "water"', 300.0), rel=1e-3
    )


def test_a_blade_in_water_that_wants_more_area_is_said_to_cavitate(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(CASE.format(air='fluid = "water"'), "utf-8")
    case = load_case(tmp_path / "case.toml")
    limit = keller_N(case.rotor())
    rpm = np.array([300.0, 600.0, 900.0, 1200.0, 1500.0, 1800.0, 3000.0])
    for wet, made in ((True, case.air()), (False, Air.from_density(1.225))):
        found = prepare_case(case).solve(rpm, 0.0, made)
        told = [any("cavitates" in word for word in words) for words in found.flags]
        assert told == [wet and bool(T > limit) for T in found.thrust_N]
        assert not wet or set(told) == {True, False}
