"""The promise of the terms: slopes are derivatives, published curves are held.

Each of these was once changed by hand without another test noticing; tests/mutants.py has the changes.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from bemt.base import units
from bemt.physics import air
from bemt.physics.bem import kernel, oblique, packing, residual
from bemt.physics.bem.duct import DuctFlow, duct_flow
from bemt.physics.effects.compressibility import Compressibility
from bemt.physics.effects.drag_divergence import DragDivergence
from bemt.physics.effects.tip_gap import TipGap
from bemt.physics.sections.polars import ALPHA_GRID
from bemt.rotors import validity
from bemt.rotors.case import load_case
from bemt.tools.flight.repeat import flight_scatter

SPACE = kernel._source()
"""The functions of the kernel as plain Python."""


def lookup(alpha: float, lre0: float, W2: float, base: int, tab: Any, g: Any) -> tuple[float, ...]:
    """A section whose slopes are known."""
    x = lre0 + 0.5 * math.log(W2)
    by_re = 1.0 + 0.05 * x
    return (5.0 * math.sin(alpha) * by_re, 0.02 + 0.5 * alpha**2 - 0.001 * x, 5.0 * math.cos(alpha) * by_re, alpha,
            0.25 * math.sin(alpha), -0.001)  # fmt: skip


@pytest.mark.parametrize("element", ["open_rotor", "ducted_rotor"])
@pytest.mark.parametrize(("swirl", "bridge", "far"), [(1, 1, 0), (1, 1, 1), (0, 1, 0), (1, 0, 0)])
@pytest.mark.parametrize("UP", [-3.0, 0.5, 12.0])
def test_the_slope_of_a_residual_is_its_derivative(element: str, swirl: int, bridge: int, far: int, UP: float) -> None:
    """Otherwise Newton's method is a guess; with it each term of the residual stands twice, by two hands."""
    fx = np.zeros(residual.N_NUM)
    fx[[residual.N_SWIRL, residual.N_BRIDGE, residual.N_FAR]] = swirl, bridge, far
    fx[[residual.N_WAKE, residual.N_LIP, residual.N_STATOR, residual.N_GAP]] = 0.9, 0.1, 0.6, 0.4
    fx[[residual.N_LEAK, residual.N_WALL, residual.N_STREAM, residual.N_BEND]] = 0.05, 0.02, 0.1, 0.2
    UP = abs(UP) if element == "ducted_rotor" else UP

    def at(phi: float) -> Any:
        return SPACE[element](lookup, phi, 40.0, UP, 1.0 / UP, 0.5, 0.03, 0.9, 1.2, 2.0, 0, None, None, fx)

    step = 1e-6
    for phi in (0.15, 0.3, 0.45):
        slope = (at(phi + step)[0] - at(phi - step)[0]) / (2.0 * step)
        assert at(phi)[1] == pytest.approx(slope, rel=2e-5, abs=1e-6 * abs(at(phi)[0]) + 1e-6)


def test_a_table_is_linear_between_its_nodes() -> None:
    """In the angle, in ln Re and in the squared Mach number, with the slope in ln W of both together."""
    Re, M2 = np.geomspace(1e4, 1e6, 5), 0.1 * np.arange(4)

    def cl(a: Any, x: Any, m: Any) -> Any:
        return (0.3 + 2.0 * a) * (1.0 + 0.1 * x) * (1.0 + 0.5 * m)

    def cd(a: Any, x: Any, m: Any) -> Any:
        return (0.02 + 0.1 * a) * (2.0 - 0.1 * x) * (1.0 + 3.0 * m)

    axes = (ALPHA_GRID[None, None, None, :], np.log(Re)[None, None, :, None], M2[None, :, None, None])
    bake: Any = SimpleNamespace(cl=cl(*axes), cd=cd(*axes), M2=M2, Re=Re, B=2, mach_lift=None, mach_drag=None)
    tab, g = packing.pack_tables(bake).ravel(), packing.pack_grid(bake)
    for alpha, mach2, re in ((0.05, 0.13, 3e4), (-0.1, 0.24, 2e5), (0.2, 0.05, 7e5)):
        lre0, x = math.log(re) - 0.5 * math.log(mach2), math.log(re)
        got = SPACE["lookup_full"](alpha, lre0, mach2, 0, tab, g)
        assert got[0] == pytest.approx(cl(alpha, x, mach2), rel=1e-9)
        assert got[1] == pytest.approx(cd(alpha, x, mach2), rel=1e-9)
        assert got[2] == pytest.approx(2.0 * (1.0 + 0.1 * x) * (1.0 + 0.5 * mach2), rel=1e-9)
        by_lnW = (0.3 + 2.0 * alpha) * (0.1 * (1.0 + 0.5 * mach2) + (1.0 + 0.1 * x) * 0.5 * 2.0 * mach2)
        assert got[4] == pytest.approx(by_lnW, rel=1e-9)


def test_a_table_of_angles_alone_is_linear_between_its_nodes() -> None:
    a = ALPHA_GRID[None, None, None, :]
    bake: Any = SimpleNamespace(cl=0.3 + 2.0 * a, cd=0.02 + 0.1 * a, M2=np.zeros(1), Re=np.array([1e5]), B=2)
    tab, g = packing.pack_tables(bake).ravel(), packing.pack_grid(bake)
    for alpha in (-0.103, 0.052, 0.7):
        got = SPACE["lookup_plain"](alpha, 0.0, 1.0, 0, tab, g)
        assert got == pytest.approx((0.3 + 2.0 * alpha, 0.02 + 0.1 * alpha, 2.0, 0.1, 0.0, 0.0), rel=1e-9)


def test_descent_follows_the_measured_curve_and_climb_momentum_theory() -> None:
    """v over that of hover at sink rate x: 1 + 1.125 x - 1.372 x^2 + 1.718 x^3 - 0.655 x^4 (Leishman 2006)."""

    def flow(x: float, v: float) -> float:
        return float(SPACE["mass_flow"]((v - x) / -x)[0]) * x * v  # m v over the square of the speed in hover

    for x in (1.05, 1.2, 1.5):
        v = 1.0 + 1.125 * x - 1.372 * x**2 + 1.718 * x**3 - 0.655 * x**4
        assert flow(x, v) == pytest.approx(1.0, rel=2e-3)
    for x in (0.1, 0.3, 0.44):  # up to the ring, Johnson's 0.45
        assert flow(x, 0.5 * x + math.sqrt(0.25 * x * x + 1.0)) == pytest.approx(1.0, rel=1e-3)
    ring = 0.45 / (0.225 + math.sqrt(0.225**2 + 1.0))
    assert pytest.approx(1.0 - 1.0 / ring) == residual.Y_RING


def test_the_gradient_of_oblique_flow_is_that_of_pitt_and_peters() -> None:
    """15 pi / 32 (Pitt and Peters 1981; Moriarty and Hansen 2005, AeroDyn Theory Manual)."""
    assert pytest.approx(1.4726, abs=1e-4) == oblique.PITT_PETERS


def test_the_jet_of_a_duct_is_that_of_the_kernel() -> None:
    """Both write down how its speed departs from a straight line between rest and stream."""
    fx = np.zeros(residual.N_NUM)
    fx[[residual.N_WAKE, residual.N_STREAM, residual.N_BEND]] = 1.0 / (0.9 * 0.95), 0.98 / 0.95 - 1.0, 0.15
    flow = DuctFlow(wake_ratio=0.9, contraction=0.95, capture=0.98, bend=0.15)
    for w, V in ((20.0, 0.0), (20.0, 15.0), (30.0, 40.0)):
        assert float(flow.jet_speed(np.array(w), np.array(V))) == pytest.approx(
            SPACE["jet_speed"](w, V, fx)[0], rel=1e-9
        )


def test_drag_diverges_earlier_with_lift_as_korn_says() -> None:
    """M_dd = kappa - t/c - cl/10 (Korn; Mason 1990): the wave drag at one Mach number is that of M_dd at the lift."""
    effect, added = DragDivergence(), []
    alpha, M2, cl = (
        np.radians([-20.0, 2.0, 3.0, 20.0]),
        np.array([0.0, 0.68**2, 0.76**2]),
        np.array([0.3, 0.0, 0.7, 0.9]),
    )
    bake: Any = SimpleNamespace(
        r=np.ones(1), M2=M2, alpha=alpha, thickness=np.array([0.12]), own_mach=np.zeros(1), fast=slice(0, 1),
        cl=np.broadcast_to(cl, (1, 3, 1, 4)), add_drag=added.append,
    )  # fmt: skip
    effect.section(bake)
    for k, lift in ((1, 0.0), (2, 0.7)):
        for m in (1, 2):
            rise = float(effect.rise(math.sqrt(M2[m]), 0.87 - 0.12 - 0.1 * lift))
            cap = 4.0 * (alpha[k] ** 2 + 0.12**2) / math.sqrt(1.1025 - 1.0)
            assert added[0][0, m, 0, k] == pytest.approx(min(rise, cap), rel=1e-9)
    assert added[0][0, 1, 0, 2] > 2.0 * added[0][0, 1, 0, 1]


def test_lift_diverges_earlier_at_more_lift() -> None:
    """A tenth of the lift, as Korn's drag divergence does."""
    at = Compressibility().lift_divergence(0.12, np.array([0.0, 0.5, 1.0, 3.0]))
    assert at[0] - at == pytest.approx([0.0, 0.05, 0.10, 0.12])


def test_a_tip_gap_costs_its_share_of_the_span_times_the_stated_loss() -> None:
    bake: Any = SimpleNamespace(ducted=True, level=1.0, gap=1e-3, R=0.06, Rhub=0.02, num=SimpleNamespace())
    TipGap(loss=1.5, scale=0.05).momentum(bake)
    assert bake.num.gap_loss == pytest.approx(1.5 * 1.0 / 40.0)
    assert bake.num.gap_share == pytest.approx(1.0 - math.exp(-1.0 / (0.05 * 60.0)))


def test_pressures_of_one_atmosphere_and_the_vapour_in_it() -> None:
    """29.921 inHg, 760 mmHg and 14.696 psi are 101,325 Pa; saturated air of 20 deg C has 2.318 % vapour."""
    for value, unit in ((29.921, "inHg"), (760.0, "mmHg"), (14.696, "psi")):
        assert units.to_si(value, unit) == pytest.approx(101_325.0, rel=3e-5)
    assert air.vapour_fraction(101_325.0, 293.15, 100.0) == pytest.approx(0.02318, abs=2e-5)


def test_the_walls_of_a_duct_rub_on_all_that_they_wet(project: Any) -> None:
    """Loss over 1/2 rho w^2: friction times wetted area of both walls over that of the passage."""
    case = load_case(project / "cases" / "ds30" / "case.toml")
    rotor, duct = case.rotor(), case.duct()
    assert duct is not None
    wet = 2.0 * math.pi * (duct.inner_radius + rotor.Rhub) * duct.length
    passage = math.pi * (duct.inner_radius**2 - rotor.Rhub**2)
    assert duct_flow(duct, rotor, 0.004).wall_loss == pytest.approx(0.004 * wet / passage, rel=1e-9)


def test_scatter_of_flights_joins_the_prior_with_their_own() -> None:
    """0.7 % with three degrees of freedom (docs/flight_logs.md), and each further flight one more."""
    assert flight_scatter([]) == pytest.approx((0.007, stats.t.ppf(0.975, 3)))
    sd, factor = flight_scatter([0.99, 1.0, 1.01])
    assert (sd, factor) == pytest.approx((math.sqrt((3 * 0.007**2 + 2e-4) / 5), stats.t.ppf(0.975, 5)))


def test_the_band_of_descent_grows_with_the_sink_rate_and_no_further_than_hover_s() -> None:
    """12.5 % of the load at the induced speed of hover; with climb and without wind from the side nothing."""
    loads = np.array([[0.1] * 4, [0.04] * 4])
    got = validity.aside(loads, loads, np.array([-1.0, 0.0, 0.5, 3.0]))
    assert got == pytest.approx(loads * 0.125 * np.array([0.0, 0.0, 0.5, 1.0]))
