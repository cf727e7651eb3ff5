"""Wind from any side: limits, continuity, balances, convergence over the azimuth, measured rotors."""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import bemt
from bemt.base.errors import InputError
from bemt.bem import oblique, solver
from bemt.sections.polars import linear_polar
from geometry.laws import helix
from geometry.rotor import Rotor

Array = NDArray[np.float64]


@cache
def prepared() -> solver.Prepared:
    return solver.prepare(Rotor(helix(0.254, 0.127), 2), [(0.75, linear_polar(cd=0.012))])


def wind(angle_deg: Array | float, speed: float, rpm: float = 6000.0, radial: bool = False) -> solver.Solution:
    angle = np.radians(np.atleast_1d(angle_deg))
    return solver.solve(
        prepared(), np.full(angle.size, rpm), speed * np.cos(angle), side=np.abs(speed * np.sin(angle)), radial=radial
    )


def test_without_side_wind_nothing_changes_and_a_breath_of_it_changes_nothing() -> None:
    V = np.array([0.0, 2.0, 5.0, 9.0, 14.0, 25.0])
    axial = solver.solve(prepared(), 6000.0, V)
    mixed = solver.solve(prepared(), 6000.0, np.append(V, 5.0), side=[0.0] * 6 + [3.0])
    assert np.array_equal(mixed.T[:6], axial.T) and np.array_equal(mixed.Q[:6], axial.Q)
    assert mixed.hub is not None and not mixed.hub[:6].any()
    near = solver.solve(prepared(), 6000.0, V, side=1e-7)
    np.testing.assert_allclose(near.T, axial.T, rtol=1e-8)
    np.testing.assert_allclose(near.Q, axial.Q, rtol=1e-8)


@pytest.mark.parametrize("speed", [1.0, 5.0, 12.0, 20.0])
def test_thrust_is_continuous_from_climb_to_descent(speed: float) -> None:
    found = wind(np.linspace(0.0, 180.0, 721), speed)
    assert found.converged.all()
    assert all(found.converged[i] or words for i, words in enumerate(found.flags))
    kink = np.nan_to_num(np.abs(np.diff(found.T, 2)) / np.nanmax(np.abs(found.T)))
    loud = np.array([bool(a or b or c) for a, b, c in zip(found.flags, found.flags[1:], found.flags[2:], strict=False)])
    assert np.all((kink < 0.01) | loud)


def test_thrust_is_continuous_over_speed_of_rotation_in_edgewise_wind() -> None:
    rpm = np.linspace(3000.0, 9000.0, 241)
    found = solver.solve(prepared(), rpm, 0.0, side=15.0)
    assert found.converged.all()
    assert np.max(np.abs(np.diff(found.CT, 2))) < 0.01 * np.max(found.CT)


def test_fast_edgewise_flow_meets_glauert_s_momentum_balance() -> None:
    side = 20.0
    found = solver.solve(prepared(), 6000.0, 0.0, side=side)
    # far above the induced speed the disk is a wing: T = 2 rho A v V, so power = T v + profile power
    ideal = found.T[0] ** 2 / (2.0 * 1.225 * np.pi * 0.127**2 * side)
    assert 0.0 < ideal < found.P[0] + found.hub[0, oblique.H_FORCE] * side  # type: ignore[index]
    hover = solver.solve(prepared(), 6000.0, 0.0)
    assert found.T[0] > hover.T[0]


def test_hub_loads_follow_the_wind() -> None:
    found = wind(np.array([30.0, 60.0, 90.0]), 10.0)
    assert found.hub is not None
    assert np.all(found.hub[:, oblique.H_FORCE] > 0.0)  # blown downstream
    assert np.all(found.hub[:, oblique.ROLL] > 0.0)  # the advancing side lifts more
    assert np.all(found.hub[:, oblique.PITCH] > 0.0)  # less inflow upstream, more lift there


def test_disk_loading_sums_to_the_thrust() -> None:
    found = wind(70.0, 10.0, radial=True)
    assert found.disk is not None
    st = prepared().st
    ring = 2.0 * np.pi * prepared().stations.r * prepared().stations.dr
    assert found.disk.shape == (1, st.shape[0], oblique.AZIMUTHS)
    assert float((found.disk[0].mean(axis=1) * ring).sum()) == pytest.approx(found.T[0], rel=1e-9)


def test_sixteen_azimuths_are_enough() -> None:
    entry, st, tab, par = prepared().kernel
    points = np.array([[628.0, V, 1.225, 1.8e-5, 340.0, side] for V in (0.0, 5.0) for side in (3.0, 10.0, 18.0)])
    few, many = (oblique.run(prepared().layout, points, st, tab, par, 0.127, n=n)[:2] for n in (16, 96))
    np.testing.assert_allclose(few[0][:, :2], many[0][:, :2], rtol=2e-3)


def test_bad_input_is_refused() -> None:
    p = bemt.propeller("10x5")
    for angle in (-1.0, 181.0, float("nan"), [0.0, 10.0, 20.0]):
        with pytest.raises(InputError):
            p.solve([5000.0, 6000.0], 5.0, angle_deg=angle, bands=False)
    with pytest.raises(InputError, match="ducted"):
        bemt.load("cases/ds30").solve(angle_deg=20.0, bands=False)
    with pytest.raises(ValueError, match="side"):
        solver.solve(prepared(), 6000.0, 5.0, side=-1.0)


def test_descent_by_angle_is_descent_by_sign_of_the_airspeed() -> None:
    p = bemt.propeller("10x5")
    turned, negative = p.solve(6000, 8.0, angle_deg=180.0, bands=False), p.solve(6000, -8.0, bands=False)
    assert turned.thrust_N == pytest.approx(negative.thrust_N, rel=1e-12)


def test_bands_and_flags_of_oblique_points() -> None:
    found = bemt.propeller("8x4.5").solve(7000, 8.0, angle_deg=[0.0, 30.0])
    assert np.all(found.u["thrust_N"] > 0.0)
    assert not any("oblique" in word for word in found.flags[0]) and any("oblique" in word for word in found.flags[1])
    assert found["sideslip_rad"][1] == pytest.approx(np.radians(30.0))
    assert np.array_equal(found.airspeed_m_s, [8.0, 8.0])


def test_measured_propeller_at_30_deg(shared_data: Path) -> None:
    """APC 8x4.5MR, Davoudi (2019) fig. 9 as digitised by others; nothing fitted."""
    folder = shared_data / "oblique" / "apc_8x45mr"
    with (folder / "tilt_30deg.csv").open() as file:
        rows = np.array([[float(v) for v in row.values()] for row in csv.DictReader(file)])
    p = bemt.propeller(stations=folder / "stations.csv", diameter_m=0.2032, blades=2)
    found = p.solve(rows[:, 0], rows[:, 1], angle_deg=30.0, bands=False)
    assert found.converged.all()
    off = found.thrust_N - rows[:, 2]
    assert np.sqrt(np.mean(off**2)) < 0.11 * rows[:, 2].max()  # 9.4 %: too high, as in axial wind
