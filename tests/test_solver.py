"""The promise of the solver: it solves the stated equations and says what failed."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from numba import njit
from scipy.optimize import brentq

from bemt.physics import bem
from bemt.physics.air import Air
from bemt.physics.bem import kernel, residual, solver, vecmath
from bemt.physics.bem.duct import DuctFlow
from bemt.physics.effects import Effect, RotorBuild, standard, without
from bemt.physics.effects.lifting_surface import LiftingSurface
from bemt.physics.effects.swirl import Swirl
from bemt.physics.effects.tip_loss import TipLoss
from bemt.physics.sections.polars import Polar, linear_polar
from geometry.laws import helix
from geometry.rotor import Rotor, Stations

AIR = Air.from_density(1.2)
DUCT = DuctFlow(0.95, 0.05, 0.2, 0.8, 0.001, 0.08, 0.01, contraction=1.02, capture=0.9, bend=-0.2)
R = residual


# The pieces of the kernel -------------------------------------------------------------------------------------------


def test_elementary_functions_are_exact() -> None:
    @njit
    def run(x: Any, y: Any, out: Any) -> None:
        for i in range(x.size):
            out[i, 0], out[i, 1] = vecmath.sincos(x[i])
            out[i, 2] = vecmath.atan2(y[i], x[i])
            out[i, 3] = vecmath.log(abs(x[i]))

    rng = np.random.default_rng(1)
    x = np.concatenate([rng.uniform(-10, 10, 50_000), rng.uniform(-1, 1, 1000) * 1e-9, [1.0, -1.0, math.pi, 0.5]])
    y = rng.permutation(x) * 10.0 ** rng.uniform(-3, 3, x.size)
    out = np.empty((x.size, 4))
    run(x, y, out)
    exact = np.stack([np.sin(x), np.cos(x), np.arctan2(y, x), np.log(np.abs(x))], axis=1)
    assert np.max(np.abs(out - exact) / np.maximum(1.0, np.abs(exact))) < 1e-15


def test_prandtl_table_is_the_formula() -> None:
    @njit
    def run(u: Any, out: Any) -> None:
        for i in range(u.size):
            out[i, 0], out[i, 1] = R.loss(u[i])

    u = np.concatenate([np.linspace(0.0, 6.0, 20_001), [np.nan, np.inf]])
    out = np.empty((u.size, 2))
    run(u, out)
    with np.errstate(all="ignore"):
        exact = 2.0 / np.pi * np.arccos(np.exp(-(u[:-2] ** 2)))
    assert np.abs(out[:-2, 0] - exact).max() < 2e-9
    assert np.abs(np.gradient(exact, u[:-2], edge_order=2) - out[:-2, 1])[1:-1].max() < 1e-5
    assert np.all(out[-2:, 0] == 1.0)  # off, and not a number, count as far from the edge


def reynolds_polar() -> Polar:
    thin, thick = linear_polar(4.0, cd=0.02), linear_polar(6.0, alpha0=-0.05, cd=0.01)
    ramp = np.linspace(0.0, 1.0, thin.Re.size)[None, :, None]
    return dataclasses.replace(thin, cl=thin.cl + ramp * (thick.cl - thin.cl), cd=thin.cd + ramp * (thick.cd - thin.cd))


@pytest.mark.parametrize("layout", ["full", "factored"])
def test_section_tables_are_read_as_they_are(rotor: Rotor, layout: str) -> None:
    """cl, cd at any turn of alpha, any Re and M, held at the ends, against plain interpolation of the same tables."""
    effects = (*standard(), LiftingSurface()) if layout == "full" else standard()
    prep = solver.prepare(rotor, [(0.7, reynolds_polar())], effects, n_stations=5)
    assert prep.layout == layout
    lookup = R.lookup_full if layout == "full" else R.lookup_factored
    _, st, tab, par = prep.kernel
    tables = prep.tables

    @njit
    def run(alpha: float, lre: float, W: float, base: int, tab: Any, par: Any) -> Any:
        o = R.N_NUM
        g = (par[o], par[o + 1], par[o + 2], par[o + 3], par[o + 4], par[o + 5], par[o + 6], par[o + 7], par[o + 8],
             par[o + 9], par[o + 10] / 340.0**2, par[o + 11], par[o + 12], par[o + 13], par[o + 16])  # fmt: skip
        return lookup(alpha, lre, W * W, np.int32(base), tab, g)

    from bemt.physics.sections.polars import ALPHA_GRID, DEFAULT_RE

    rng = np.random.default_rng(4)
    for _ in range(500):
        k, alpha, W, lre = int(rng.integers(5)), rng.uniform(-9.0, 9.0), rng.uniform(1.0, 600.0), rng.uniform(0.0, 16.0)
        got = run(alpha, lre, W, int(par[R.N_NUM + 14]) * k, tab, par)
        a = math.remainder(alpha, 2.0 * math.pi)
        x = np.clip(lre + math.log(W), *np.log(DEFAULT_RE[[0, -1]]))
        m = min((W / 340.0) ** 2 / 0.1, tables.shape[1] - 1.0)
        over_alpha = np.array([[[np.interp(a, ALPHA_GRID, tables[k, i, j, :, c]) for c in (0, 1)]
                                for j in range(tables.shape[2])] for i in range(tables.shape[1])])  # fmt: skip
        over_re = np.array([[np.interp(x, np.log(DEFAULT_RE), row[:, c]) for c in (0, 1)] for row in over_alpha])
        for c in (0, 1):
            assert got[c] == pytest.approx(np.interp(m, np.arange(len(over_re)), over_re[:, c]), rel=1e-11, abs=1e-12)


@dataclasses.dataclass(frozen=True)
class Rougher(Effect):
    """Drag of every section, a tenth more; behind the effects of Mach number."""

    id = "rougher"
    order = 60

    def section(self, bake: RotorBuild) -> None:
        bake.cd *= 1.1


class RougherByMach(Rougher):
    uses_mach = True


def test_what_comes_behind_mach_number_changes_all_of_the_tables(rotor: Rotor) -> None:
    polars = [(0.7, reynolds_polar())]
    plain, rough = (solver.prepare(rotor, polars, e, n_stations=5) for e in (standard(), (*standard(), Rougher())))
    assert plain.layout == "factored"
    np.testing.assert_allclose(rough.tables[..., 1], 1.1 * plain.tables[..., 1], rtol=1e-14)
    with pytest.raises(ValueError, match="read-only"):  # it would act before the Mach number: add_drag does not
        solver.prepare(rotor, polars, (*standard(), RougherByMach()), n_stations=5)


# The equations ------------------------------------------------------------------------------------------------------


def test_against_an_independent_solution(rotor: Rotor, polar: Polar) -> None:
    """Induction factors after Ning 2014 eq. 6-13, thrust from the momentum side, by another root finder."""
    polar = dataclasses.replace(polar, Re=polar.Re[:1], cl=polar.cl[:, :1], cd=polar.cd[:, :1])
    prep = solver.prepare(rotor, [(0.7, polar)], (Swirl(), TipLoss(sheets="disk")), n_stations=15)
    Omega, V, B = 700.0, 9.0, rotor.B
    s = solver.solve(prep, Omega * 30.0 / np.pi, V, AIR, radial=True)
    T = Q = 0.0
    for r, dr, chord, beta in zip(*prep.stations, strict=True):
        sigma = B * chord / (2.0 * math.pi * r)

        def state(phi: float, r: float = r, beta: float = beta, sigma: float = sigma) -> tuple[float, float, float]:
            cl, cd = (float(v) for v in prepared_lookup(beta - phi))
            sin, cos = math.sin(phi), math.cos(phi)
            F = 2.0 / math.pi * math.acos(math.exp(-0.5 * B * (rotor.R - r) / (r * sin)))
            kappa = sigma * (cl * cos - cd * sin) / (4.0 * F * sin * sin)
            kappa_t = sigma * (cl * sin + cd * cos) / (4.0 * F * sin * cos)
            return F, kappa / (1.0 - kappa), kappa_t / (1.0 + kappa_t)

        def prepared_lookup(alpha: float) -> tuple[Any, Any]:
            return polar.on_grid(re=polar.Re).lookup(alpha, 1e5)

        def balance(phi: float, r: float = r, state: Any = state) -> float:
            _, a, ap = state(phi)
            return math.sin(phi) / (1.0 + a) - V / (Omega * r) * math.cos(phi) / (1.0 - ap)

        inflow = math.atan2(V, Omega * r)
        phi = brentq(balance, inflow * 0.9, inflow + 0.15, xtol=1e-14)
        F, a, ap = state(phi)
        T += 4.0 * math.pi * r * AIR.rho * V * V * (1.0 + a) * a * F * dr
        Q += 4.0 * math.pi * r**3 * AIR.rho * V * Omega * (1.0 + a) * ap * F * dr
    assert s.T[0] == pytest.approx(T, rel=1e-9)
    assert s.Q[0] == pytest.approx(Q, rel=1e-9)


@pytest.mark.parametrize("sheets", ["wake", "disk"])
def test_momentum_and_blade_agree_at_every_station(rotor: Rotor, polar: Polar, sheets: str) -> None:
    prep = solver.prepare(rotor, [(0.7, polar)], (*without(standard(), ["tip_loss"]), TipLoss(sheets=sheets)))
    V = np.concatenate([np.linspace(0.0, 22.0, 60), [-1.0, -2.0, -30.0]])
    s = solver.solve(prep, 6000.0, V, AIR, radial=True)
    r, dr = s.radial, prep.st[:, 1]
    y = r.w / np.where(s.V == 0.0, 1e-9, s.V)[:, None]
    momentum = y > 0.62
    assert momentum.mean() > 0.8
    ring = 2.0 * AIR.rho * 2.0 * np.pi * r.r * dr * r.F * np.abs(r.w)
    size = np.abs(r.dT).max()
    assert np.abs(ring * (r.w - s.V[:, None]) - r.dT)[momentum].max() < 1e-11 * size
    assert np.abs(ring * r.v_t - r.dQ / r.r)[momentum].max() < 1e-11 * size


def test_bernoulli_and_blade_agree_at_every_station_of_a_fan(rotor: Rotor, polar: Polar) -> None:
    prep = solver.prepare(rotor, [(0.7, polar)], duct=DUCT)
    V = np.linspace(0.0, 30.0, 60)
    s = solver.solve(prep, 6000.0, V, AIR, radial=True)
    r, dr = s.radial, prep.st[:, 1]
    area = 2.0 * np.pi * r.r * dr
    V_ = s.V[:, None]
    y = r.w / DUCT.wake_ratio / DUCT.contraction
    jet = V_ + (y - DUCT.capture / DUCT.contraction * V_) * (1.0 + DUCT.bend * V_ / np.hypot(y, V_))
    sucked, turned = np.maximum(r.w - V_, 0.0), np.maximum(r.v_t, 0.0)
    push = jet * np.abs(jet) + DUCT.wall_loss * r.w**2 - V_**2 + DUCT.lip_loss * sucked**2
    push -= 4.0 * DUCT.stator * turned**2
    size = np.abs(r.dT).max()
    assert np.abs(0.5 * AIR.rho * area * push - r.dT).max() < 1e-11 * size
    assert np.abs(2.0 * AIR.rho * area * r.w * r.v_t - r.dQ / r.r).max() < 1e-11 * size
    # one mass flow: through the disk, in the exit plane and in the momentum of the jet
    mass = (AIR.rho * area * r.w).sum(axis=1)
    assert np.allclose(mass, s.mass_flow, rtol=1e-12)
    assert np.allclose(mass, AIR.rho * rotor.annulus_area * DUCT.wake_ratio * s.V_exit, rtol=1e-9)
    drag = 0.5 * AIR.rho * s.V**2 * DUCT.drag_area
    assert np.allclose((AIR.rho * area * r.w * (jet - V_)).sum(axis=1) - drag, s.T, rtol=1e-11, atol=1e-9)
    assert np.allclose(s.T, s.T_rotor + s.T_stator + s.T_duct)


@pytest.mark.parametrize("sheets", ["wake", "disk"])
@pytest.mark.parametrize("V", [0.0, 6.0, 12.0])
def test_loss_factor_is_the_documented_one(rotor: Rotor, sheets: str, V: float) -> None:
    prep = solver.prepare(rotor, [(0.7, linear_polar())], (Swirl(), TipLoss(0.9, sheets)), n_stations=30)
    r = solver.Radial(*(v[0] for v in solver.solve(prep, 6000.0, V, AIR, radial=True).radial))
    q = (2.0 * r.w - V) / r.w if sheets == "wake" else np.ones(30)
    phi = np.arctan(np.tan(r.phi) * q**1.5)
    f = 0.9 * 0.5 * rotor.B * (rotor.R - r.r) / (r.r * np.sin(phi))
    assert np.allclose(r.F, 2.0 / np.pi * np.arccos(np.exp(-f)), rtol=1e-6, atol=2e-9)


# Use ----------------------------------------------------------------------------------------------------------------


def test_import_compiles_nothing() -> None:
    code = (
        "from numba.core import event\n"
        "with event.install_recorder('numba:compile') as record:\n"
        "    import bemt.physics.bem.solver, bemt.physics.bem.kernel as K\n"
        'assert not record.buffer and not K.entry(False, "plain").compiled.signatures'
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_disk_cache_sees_changes_of_other_files() -> None:
    before = vecmath.fingerprint(residual, vecmath)
    assert before == vecmath.fingerprint(residual, vecmath)
    assert before in [c.cell_contents for c in kernel.entry(True, "full").compiled.py_func.__closure__]
    kept = residual._EPS
    try:
        residual._EPS = 2.0 * kept
        assert vecmath.fingerprint(residual, vecmath) != before
    finally:
        residual._EPS = kept


@pytest.mark.parametrize("ducted", [False, True])
def test_interpreted_points_equal_compiled_ones(rotor: Rotor, polar: Polar, ducted: bool) -> None:
    duct = DuctFlow(0.95, wall_loss=0.05, lip_loss=0.1, stator=0.5, gap=1e-3) if ducted else None
    prep = solver.prepare(rotor, [(0.7, polar)], None, duct, n_stations=10)
    entry, *constant = prep.kernel
    assert isinstance(entry, kernel.KernelEntry)
    rpm, V = np.array([500.0, 4000.0, 9000.0, 6000.0, 3000.0]), np.array([0.0, 2.0, -4.0, 30.0, 12.0])
    points = np.column_stack([rpm * np.pi / 30.0, V, *(np.full(5, v) for v in (AIR.rho, AIR.mu, AIR.a_sound))])
    found = []
    for run in (entry.compiled, lambda *given: kernel.interpret(*entry.kind, *given)):
        out, radial = np.empty((5, kernel.N_OUT)), np.empty((5, 10, kernel.N_RADIAL))
        run(points, *constant, out, radial)
        found.append((out, radial))
    np.testing.assert_allclose(found[0][0], found[1][0], rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(found[0][1], found[1][1], rtol=1e-10, atol=1e-12)


def test_a_few_points_are_interpreted_and_many_compiled(
    rotor: Rotor, polar: Polar, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As long as there is no compiled code; after that always by it."""
    entry, *constant = solver.prepare(rotor, [(0.7, polar)], n_stations=10).kernel
    run: list[str] = []

    class Nothing:
        signatures = ()  # in this process, and no cache on the disk
        _cache = None

        def __call__(self, *given: object) -> None:
            run.append("compiled")

    monkeypatch.setenv("BEMT_COMPILE", "")
    monkeypatch.setattr(kernel, "interpret", lambda *given: run.append("interpreted"))
    fresh = kernel.KernelEntry(*entry.kind, Nothing())
    for count in (1, 2, kernel.INTERPRETED // 10, 1):
        fresh(np.zeros((count, kernel.N_POINT)), *constant, None, None)
    assert run == ["interpreted", "interpreted", "compiled", "compiled"]


def test_broadcasting_of_speeds_and_air(rotor: Rotor, polar: Polar) -> None:
    prep = solver.prepare(rotor, [(0.7, polar)], n_stations=10)
    s = solver.solve(prep, [[4000.0], [5000.0]], [0.0, 1.0, 2.0], AIR)
    assert s.rpm.tolist() == [4000.0] * 3 + [5000.0] * 3
    assert s.V.tolist() == [0.0, 1.0, 2.0] * 2
    rho = np.array([1.2, 0.6])
    thin = solver.solve(prep, 5000.0, 3.0, dataclasses.replace(AIR, rho=rho))
    assert thin.T[1] == pytest.approx(0.5 * thin.T[0], rel=1e-12)
    assert thin.P == pytest.approx(thin.Q * 5000.0 * np.pi / 30.0, rel=1e-14)
    assert solver.solve(prep, 5000.0).T[0] > 0  # standard air, at rest


@pytest.mark.parametrize(
    ("rpm", "V", "air", "match"),
    [
        (0.0, 0.0, {}, "rpm"), (-5.0, 0.0, {}, "rpm"), (math.nan, 0.0, {}, "rpm"), (5000.0, math.inf, {}, "airspeed"),
        (5000.0, 0.0, {"rho": 0.0}, "air"), (5000.0, 0.0, {"mu": -1.0}, "air"), (5000.0, 0.0, {"a_sound": 0.0}, "air"),
    ],
)  # fmt: skip
def test_bad_points_are_refused(
    rotor: Rotor, polar: Polar, rpm: float, V: float, air: dict[str, float], match: str
) -> None:
    prep = solver.prepare(rotor, [(0.7, polar)], n_stations=5)
    with pytest.raises(ValueError, match=match):
        solver.solve(prep, rpm, V, dataclasses.replace(AIR, **air))


def test_bad_rotors_are_refused(rotor: Rotor, polar: Polar) -> None:
    with pytest.raises(ValueError, match="at least one"):
        solver.prepare(rotor, [])
    with pytest.raises(ValueError, match="ascending"):
        solver.prepare(rotor, [(0.7, polar), (0.3, polar)])
    s = rotor.blade.midpoints(5)
    for bad in (s._replace(r=-s.r), s._replace(chord=-s.chord), s._replace(beta=s.beta * math.nan)):
        with pytest.raises(ValueError, match="stations"):
            solver.prepare(rotor, [(0.7, polar)], stations=Stations(*bad))


def test_a_failed_station_is_a_nan_with_words(rotor: Rotor, polar: Polar) -> None:
    prep = solver.prepare(rotor, [(0.7, polar)], n_stations=10)
    tab = prep.tab.copy()
    tab[3] = math.nan
    broken = dataclasses.replace(prep, tab=tab)
    s = solver.solve(broken, 5000.0, [0.0, 5.0], AIR, radial=True)
    assert not s.converged.any()
    assert np.isnan([s.T, s.Q, s.P, s.CT, s.CP, s.V_exit, s.T_rotor]).all()
    place = prep.stations.r[3] / rotor.R
    assert s.flags[0] == (f"not converged at r/R {place:.2f}: {solver.REASONS[kernel.NOT_FINITE]}",)
    assert np.isnan(s.radial.dT[:, 3]).all()
    assert np.isfinite(s.radial.dT[:, [2, 4]]).all()
    T, Q, ok = solver.solve_point(broken, 5000.0, 0.0, AIR)
    assert math.isnan(T) and math.isnan(Q) and not ok


@pytest.mark.parametrize(("K", "reason"), [(-1.0, kernel.JUMP), (math.nan, kernel.NOT_FINITE)])
def test_nonsense_in_the_balance_ends_in_words(rotor: Rotor, polar: Polar, K: float, reason: int) -> None:
    prep = solver.prepare(rotor, [(0.7, polar)], duct=DUCT, n_stations=10)
    num = prep.num.copy()
    num[R.N_WAKE] = K  # a diffuser that makes pressure out of nothing: no balance exists
    s = solver.solve(dataclasses.replace(prep, num=num), 6000.0, [0.0, 10.0], AIR)
    assert not s.converged.any()
    assert np.isnan(s.T).all()
    assert all(solver.REASONS[reason] in flags[0] for flags in s.flags)


def test_a_point_below_the_reynolds_numbers_of_its_tables_is_flagged() -> None:
    """Where they end, no sooner; tables of one Reynolds number state none, and without its effect none is read."""
    rotor, wide = Rotor(helix(0.254, 0.127), 2), linear_polar(cd=0.01)
    Re = np.array([5e4, 1e5, 2e5])
    some = dataclasses.replace(wide, Re=Re, cl=wide.cl[:, :3], cd=wide.cd[:, :3])
    one = dataclasses.replace(wide, Re=Re[:1], cl=wide.cl[:, :1], cd=wide.cd[:, :1])
    prep = solver.prepare(rotor, [(0.75, some)])
    assert prep.Re_bottom == pytest.approx(5e4)
    chord = float(np.interp(0.75 * rotor.R, prep.stations.r, prep.stations.chord))
    edge = 60.0 * 5e4 * AIR.mu / (AIR.rho * chord * 0.75 * math.pi * prep.D)  # rev/min at rest
    found = solver.solve(prep, edge * np.array([0.5, 0.98, 1.02, 2.0]), 0.0, AIR)
    assert [any("Re at 0.75 R below" in w for w in flags) for flags in found.flags] == [True, True, False, False]
    assert not any(solver.solve(prep, 0.98 * edge, 0.6 * edge / 60.0 * prep.D, AIR).flags), "wind counts"
    for polar, effects in ((one, standard()), (some, without(standard(), ["reynolds"]))):
        assert not any(solver.solve(solver.prepare(rotor, [(0.75, polar)], effects), 0.5 * edge, 0.0, AIR).flags)


def test_words_for_unusual_states(rotor: Rotor, polar: Polar) -> None:
    prep = solver.prepare(rotor, [(0.7, polar)], n_stations=20, mach_max=0.6)
    fan = solver.prepare(rotor, [(0.7, polar)], duct=DUCT, n_stations=20)
    quiet = solver.solve(prep, 6000.0, [0.0, 5.0, 10.0], AIR)
    assert quiet.flags == ((), (), ())
    n = 6000.0
    words = [" ".join(f) for f in solver.solve(prep, [n, n, 2.2e4], [-6.0, 40.0, 0.0], AIR).flags]
    assert "vortex-ring or windmill-brake state" in words[0]
    assert "turbulent windmill state" not in words[0]
    assert "tip Mach above" in words[2]
    assert solver.solve(fan, n, 0.0, AIR).flags == ((),)
    assert "from behind the duct" in " ".join(solver.solve(fan, n, -1.0, AIR).flags[0])
    assert "reversed" in " ".join(solver.solve(fan, 600.0, -20.0, AIR).flags[0])


def test_a_symmetric_blade_at_zero_pitch_is_not_silent(rotor: Rotor) -> None:
    """No thrust and no flow at rest: drag spins the air up with the blade, and the torque of that is no result."""
    flat = rotor.blade.midpoints(10)._replace(beta=np.zeros(10))
    plain = dataclasses.replace(rotor, blade=dataclasses.replace(rotor.blade, anchors=()))  # no camber in its row
    prep = solver.prepare(plain, [(0.7, linear_polar(cd=0.02))], stations=Stations(*flat))
    s = solver.solve(prep, 6000.0, 0.0, AIR)
    assert s.T[0] == pytest.approx(0.0, abs=1e-9)
    assert "drag swirls the flow" in s.flags[0][0]


def test_many_stations_and_few(rotor: Rotor, polar: Polar) -> None:
    """More stations than lanes, one station, and every count between: the padding of lanes changes nothing."""
    whole = rotor.blade.midpoints(150, "cosine")
    effects = without(standard(), ["compressibility", "drag_divergence"])
    s = solver.solve(solver.prepare(rotor, [(0.7, polar)], effects, stations=whole), 6000.0, 4.0, AIR, radial=True)
    assert s.converged[0]
    for part in (slice(0, 1), slice(3, 10), slice(60, 68), slice(60, 125), slice(100, 150)):
        some = Stations(*(v[part] for v in whole))
        t = solver.solve(solver.prepare(rotor, [(0.7, polar)], effects, stations=some), 6000.0, 4.0, AIR, radial=True)
        assert np.allclose(t.radial.dT, s.radial.dT[:, part], rtol=1e-9, atol=1e-12)
        assert t.T[0] == pytest.approx(s.radial.dT[0, part].sum(), rel=1e-9)


def test_the_face_takes_a_rotor_and_gives_a_dataset(rotor: Rotor, polar: Polar) -> None:
    s = solver.solve(solver.prepare(rotor, [(0.75, polar)]), [4000.0, 6000.0], 5.0, AIR)
    for tables in (polar, [(0.75, polar)]):
        found = bem.solve(rotor, tables, rpm=[4000.0, 6000.0], V=5.0, air=AIR)
        assert found.kind == "bemt" and found.converged.all() and found.flags == ((), ())
        np.testing.assert_array_equal([found.thrust_N, found.torque_Nm], [s.T, s.Q])
        np.testing.assert_allclose([found.CT, found.CP, found.J], [s.CT, s.CP, s.J], rtol=1e-14)
    bare = dataclasses.replace(rotor, blade=dataclasses.replace(rotor.blade, anchors=()))
    with pytest.raises(ValueError, match="no section"):
        bem.solve(bare, rpm=5000.0)


def test_shares_of_the_thrust_add_up(rotor: Rotor, polar: Polar) -> None:
    d = bem.solve(rotor, polar, duct=DUCT, rpm=[4000.0, 6000.0], V=[0.0, 5.0], air=AIR)
    np.testing.assert_allclose(d.rotor_thrust_N + d.duct_thrust_N + d.stator_thrust_N, d.thrust_N, rtol=1e-12)
    np.testing.assert_allclose(d.duct_share * d.thrust_N, d.duct_thrust_N, rtol=1e-12)
    unbalanced = bem.Model(rotor, [(0.75, polar)], dataclasses.replace(DUCT, wake_ratio=math.nan))
    lost = unbalanced.solve([4000.0, 6000.0], air=AIR)
    assert not lost.converged.any() and np.isnan([lost.thrust_N, lost.CT, lost.exhaust_speed_m_s]).all()
    assert all(solver.REASONS[kernel.NOT_FINITE] in flags[0] for flags in lost.flags)
