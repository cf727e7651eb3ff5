"""Blades in a row turn the flow as measured cascades do.

Sources
-------
Plates: Weinig (1935) with the closed forms at stagger 0 and 90 deg (tanh and tan).  A thick cambered row: an exact
potential flow by another method (Martensen's), ``shared/data/dfdc/DS30_row_lift.csv``, read where it is there.
Measured: NACA 65-410 and 65-(12)10 compressor cascades, Herrig, Emery and Erwin (1951), NACA RM L51G31 (Report 1368):
lift on the dynamic pressure ahead against the angle between the flow ahead and the chord, some points as digitised
by byuflowlab/DuctAPE.jl (test/data/NACA_cascade_data_65-410.jl, -1210.jl); thickness form from its table 1, mean line
a = 1 in closed form (Abbott and von Doenhoff 1959, eq. 4.26).  Faults: porous side walls, lift from pressures and
turning; theory is known to lift 8 to 16 % more (Katzoff, Bogdonoff and Boyet 1947, NACA TN 1376).
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bemt.physics.bem.packing import zero_and_slope
from bemt.physics.effects.base import RotorBuild
from bemt.physics.effects.cascade import Cascade
from bemt.physics.sections.polars import ALPHA_GRID, Polar
from bemt.physics.sections.row import row_lift, weinig_factor
from geometry.airfoil import Airfoil, naca4

Array = NDArray[np.float64]

X = np.array([0, 0.5, 0.75, 1.25, 2.5, 5, 7.5, *range(10, 101, 5)]) / 100
HALF = [0, 0.752, 0.890, 1.124, 1.571, 2.222, 2.709, 3.111, 3.746, 4.218, 4.570, 4.824, 4.982]
HALF += [5.057, 5.029, 4.870, 4.570, 4.151, 3.627, 3.038, 2.451, 1.847, 1.251, 0.749, 0.354, 0.150]

# design lift, inlet angle [deg], solidity: (angle of attack [deg], lift coefficient), both against the flow ahead
MEASURED: dict[tuple[float, float, float], tuple[tuple[float, float], ...]] = {
    (0.4, 30, 1.0): ((3.03, 0.205), (9.08, 0.391), (15.02, 0.544)),
    (0.4, 45, 1.0): ((5.02, 0.282), (9.04, 0.381), (14.03, 0.513)),
    (0.4, 45, 1.5): ((3.00, 0.148), (8.01, 0.258), (13.07, 0.353)),
    (0.4, 60, 1.0): ((8.01, 0.398), (12.04, 0.505)),
    (1.2, 30, 1.0): ((7.12, 0.522), (13.04, 0.683), (18.13, 0.804)),
    (1.2, 45, 1.0): ((5.22, 0.455), (10.19, 0.588), (14.22, 0.689)),
    (1.2, 45, 1.5): ((8.11, 0.392), (12.05, 0.461), (16.08, 0.511)),
    (1.2, 60, 1.0): ((12.00, 0.643), (16.04, 0.717)),
    (1.2, 60, 1.5): ((14.08, 0.470), (18.08, 0.516)),
}


def compressor_section(design_lift: float) -> Airfoil:
    """NACA 65-series compressor section of 10 % thickness."""
    from scipy.interpolate import PchipInterpolator

    x = 0.5 * (1 - np.cos(np.linspace(0, np.pi, 81)))
    half = PchipInterpolator(np.sqrt(X), np.array(HALF) / 100)(np.sqrt(x))
    inner = np.clip(x, 1e-12, 1 - 1e-12)
    mean = -design_lift / (4 * np.pi) * ((1 - inner) * np.log(1 - inner) + inner * np.log(inner))
    y = np.concatenate([(mean + half)[::-1], (mean - half)[1:]])
    return Airfoil("NACA 65 compressor", np.concatenate([x[::-1], x[1:]]), y)


def bake(solidity: float, stagger: float, polar: Polar, sections: tuple[tuple[float, Airfoil], ...]) -> RotorBuild:
    """One station of a row."""
    Re = polar.Re if polar.Re.size == 1 else np.array([245_000.0])
    q = polar.on_grid(ALPHA_GRID, Re, polar.M[:1])
    cl, cd = (v.transpose(2, 1, 0)[None].copy() for v in (q.cl, q.cd))
    zero, slope = zero_and_slope(ALPHA_GRID, cl[:, 0])
    one, none = np.ones(1), np.zeros(1)
    return RotorBuild(
        r=one, dr=one, chord=one, beta=one * (0.5 * np.pi - stagger), sigma=one * solidity, R=1.0, Rhub=0.2, B=8,
        alpha=ALPHA_GRID, Re=Re, M2=none, cl=cl, cd=cd, alpha0=zero, cla=slope, Vx_factor=one, Vy_factor=one,
        Vx_add=none, Vy_add=none, thickness=one * 0.1, own_mach=none, sections=sections,
    )  # fmt: skip


def lift_ahead(
    row: Cascade, section: Airfoil | None, polar: Polar, solidity: float, inlet: float, attack: float
) -> float:
    """Lift of the row on the dynamic pressure ahead of it."""
    from scipy.optimize import brentq

    stagger, b1 = np.radians(inlet - attack), np.radians(inlet)
    b = bake(solidity, stagger, polar, () if section is None else ((0.75, section),))
    row.section(b)

    def mean(b2: float) -> tuple[float, float]:
        bm = np.arctan(0.5 * (np.tan(b1) + np.tan(b2)))
        return float(bm), float(2 / solidity * np.cos(bm) * (np.tan(b1) - np.tan(b2)))

    def miss(b2: float) -> float:
        bm, cl = mean(b2)
        return cl - float(np.interp(bm - stagger, b.alpha, b.cl[0, 0, 0]))

    bm, cl = mean(brentq(miss, -1.0, b1))
    return float(cl * (np.cos(b1) / np.cos(bm)) ** 2)


def test_rows_of_plates_have_the_closed_forms() -> None:
    s = np.linspace(0.1, 2.5, 9)
    assert weinig_factor(s, 0.0 * s) == pytest.approx(2 / (np.pi * s) * np.tanh(np.pi * s / 2), rel=1e-6)
    s = s[s < 0.9]
    in_line = weinig_factor(s, np.full(s.size, np.radians(89.9)))
    assert in_line == pytest.approx(2 / (np.pi * s) * np.tan(np.pi * s / 2), rel=0.02)


@pytest.mark.parametrize("stagger", [0, 20, 40, 55, 65, 70])
def test_thin_rows_approach_weinig(stagger: float) -> None:
    lam = np.radians(float(stagger))
    for solidity in (0.3, 0.7, 1.2):
        exact = float(weinig_factor(np.array([solidity]), np.array([lam]))[0])
        thick, thin = (
            row_lift(s, solidity, lam).slope / row_lift(s, 0.0, 0.0).slope
            for s in (naca4(0, 0.4, 0.06), naca4(0, 0.4, 0.015))
        )
        assert thin == pytest.approx(exact, rel=0.015)
        assert abs(thin - exact) < abs(thick - exact) + 1e-3


def test_a_thick_cambered_row_agrees_with_another_exact_method(shared_data: Path) -> None:
    section = naca4(0.05, 0.45, 0.09)  # of cases/ds30
    assert np.degrees(row_lift(section, 0.0, 0.0).zero) == pytest.approx(-5.5, abs=0.05)
    with (shared_data / "dfdc" / "DS30_row_lift.csv").open(encoding="utf-8") as stream:
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(stream)]
    for row in rows:
        slope, zero = row_lift(section, row["solidity"], np.radians(row["stagger_deg"]))
        assert slope == pytest.approx(row["lift_slope_over_2pi"], rel=0.006)
        assert np.degrees(zero) == pytest.approx(row["zero_lift_deg"], abs=0.05)


def test_far_apart_a_row_is_single_sections() -> None:
    section = naca4(0.04, 0.4, 0.10)
    alone = row_lift(section, 0.0, 0.0)
    misses = []
    for solidity in (0.2, 0.1, 0.05):
        row = row_lift(section, solidity, np.radians(60.0))
        misses.append((abs(row.slope / alone.slope - 1), abs(row.zero - alone.zero)))
    # the images' velocity gradient goes with the square of chord over spacing, lift and camber alike
    order = np.log2(np.array(misses[:-1]) / np.array(misses[1:]))
    assert np.all(order > 1.8)
    assert np.max(misses[-1]) < 2e-3


def beside_measured(row: Cascade) -> list[float]:
    """How far the lift of the model is off what compressor cascades have shown."""
    from bemt.physics.sections.neuralfoil import neuralfoil_polar

    off = []
    for (design, inlet, solidity), points in MEASURED.items():
        section = compressor_section(design)
        polar = neuralfoil_polar(section, n_crit=5.0)
        off += [lift_ahead(row, section, polar, solidity, inlet, a) / cl - 1 for a, cl in points]
    return off


def test_measured_compressor_cascades() -> None:
    for form, spread, bias in (("potential", 0.14, 0.09), ("carter", 0.20, 0.10)):
        off = beside_measured(Cascade(form=form))
        assert np.max(np.abs(off)) < spread
        assert 0.0 < np.median(off) < bias  # theory lifts more, see above


def test_the_isolated_zero_lift_angle_misses_what_cascades_show() -> None:
    scatter = {share: np.std(beside_measured(Cascade(zero_lift=share))) for share in (0.0, 1.0)}
    assert scatter[1.0] < 0.5 * scatter[0.0]


def test_a_blade_without_sections_gets_one_of_its_zero_lift_angle() -> None:
    from bemt.physics.sections.neuralfoil import neuralfoil_polar

    section = naca4(0.04, 0.5, 0.10)
    polar = neuralfoil_polar(section)
    for solidity, stagger in ((1.0, 0.9), (0.6, 1.1)):
        known, guessed = (bake(solidity, stagger, polar, s) for s in (((0.75, section),), ()))
        for b in (known, guessed):
            Cascade().section(b)
        assert np.degrees(guessed.alpha0 - known.alpha0) == pytest.approx(0.0, abs=0.3)
        assert guessed.cla == pytest.approx(known.cla, rel=0.02)


def test_separated_flow_does_not_know_the_row() -> None:
    from bemt.physics.sections.neuralfoil import neuralfoil_polar

    section = naca4(0.04, 0.4, 0.10)
    polar = neuralfoil_polar(section)
    single, row = (bake(1.0, 0.9, polar, ((0.75, section),)) for _ in range(2))
    Cascade().section(row)
    far = np.abs(ALPHA_GRID) > np.radians(100.0)
    assert np.array_equal(single.cl[..., far], row.cl[..., far])
    near = np.abs(ALPHA_GRID) < np.radians(100.0)
    assert np.max(np.abs(np.diff(row.cl[0, 0, 0, near]))) < 3.0 * np.max(np.abs(np.diff(single.cl[0, 0, 0, near])))
