"""The promise of effects on blade and section: published forms at their known limits, and signs that are right."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from bemt import effects
from bemt.air import Air
from bemt.bem import solver
from bemt.effects import compressibility, drag_divergence, stall_delay
from bemt.effects.base import Effect
from bemt.effects.compressibility import Compressibility
from bemt.effects.drag_divergence import DragDivergence
from bemt.effects.pitch_offset import PitchOffset
from bemt.effects.post_stall import PostStall
from bemt.effects.section import Section
from bemt.effects.stall_delay import StallDelay
from bemt.sections.extrapolation import ExtrapolatedTable, from_tables
from bemt.sections.polars import ALPHA_GRID, Polar
from geometry.laws import helix
from geometry.rotor import Rotor

STALL = np.radians(13.0)
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
