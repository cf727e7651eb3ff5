"""The promise of the truth of the proof: a vortex rotor that stands on its own limits and on measurements.

Sources: elliptic wing (Prandtl 1918), rigid helicoid (Goldstein 1929 in Prandtl's limit), Caradonna and Tung 1981,
UIUC Propeller Database volume 1.  Nothing here compares it with the solver.
"""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bemt.proof import causes, rigs, truth, truth_duct, truth_section, truth_wake, truth_world
from bemt.proof.items import Bench
from bemt.proof.stand import Stand, covariance, full_scales, record

P_ROOM, T_ROOM = 101325.0, 20.0


def settled(rpm: list[float], airspeed: list[float], **more: np.ndarray) -> truth_world.Conditions:
    n = len(rpm)
    nan = np.full(n, np.nan)
    fields = {
        "rpm": np.array(rpm, float), "airspeed": np.array(airspeed, float), "temperature_C": np.full(n, T_ROOM),
        "pressure_Pa": np.full(n, P_ROOM), "time": 10.0 * np.arange(n), "since_start": np.full(n, 600.0), "wall": nan,
        "gap": nan, "run": np.zeros(n, dtype=np.int64),
    }  # fmt: skip
    return truth_world.Conditions(**{**fields, **more})


@pytest.fixture(scope="module")
def rig() -> rigs.Rig:
    return rigs.draw_rig("open", False, np.random.default_rng(5))


@pytest.fixture(scope="module")
def ducted() -> rigs.Rig:
    return rigs.draw_rig("ducted", True, np.random.default_rng(6))


def test_straight_wake_of_elliptic_loading_gives_uniform_downwash() -> None:
    hub, panels = 0.1, 40
    edges, x = truth_wake.edges_and_centres(hub, panels)
    # so long an advance that the helices are straight lines: a wing from hub to tip
    _, swirl = truth_wake._influence(x, edges, edges, 1, 500.0, 0.0)
    middle, half = 0.5 * (1.0 + hub), 0.5 * (1.0 - hub)
    gamma = np.sqrt(1.0 - ((x - middle) / half) ** 2)
    downwash = truth_wake._horseshoe(swirl) @ gamma
    assert downwash[3:-3] == pytest.approx(1.0 / (2.0 * 2.0 * half), rel=0.01)


def test_many_blades_become_the_vortex_tube() -> None:
    hub, panels, blades = 0.17, 20, 8
    axial, swirl = truth_wake.wake_tables(hub, panels, blades, False)
    h = np.array([0.06])
    _, x = truth_wake.edges_and_centres(hub, panels)
    inside = (x > 0.2) & (x < 0.92)
    ua = truth_wake.interpolate(axial, h, np.zeros(1))[0].sum(axis=1)
    ut = truth_wake.interpolate(swirl, h, np.zeros(1))[0].sum(axis=1)
    assert ua[inside] == pytest.approx(blades / (4.0 * np.pi * 0.06), rel=0.02)
    assert (ut * x)[inside] == pytest.approx(blades / (4.0 * np.pi), rel=0.02)


def test_rigid_helicoid_carries_the_circulation_of_goldstein() -> None:
    """Four blades, advance 0.1: Goldstein's function is Prandtl's F x^2 / (x^2 + lambda^2) there."""
    hub, panels, blades, h = 0.05, 30, 4, 0.1
    _, x = truth_wake.edges_and_centres(hub, panels)
    axial, swirl = truth_wake.wake_tables(hub, panels, blades, False)
    ma, ms = (truth_wake.interpolate(t, np.array([h]), np.zeros(1))[0] for t in (axial, swirl))
    phi = np.arctan2(h, x)
    # Betz: what is induced normal to the sheet is that of a rigid screw moving back, half of it at the disk
    gamma = np.linalg.solve(ma * np.cos(phi)[:, None] + ms * np.sin(phi)[:, None], 0.5 * np.cos(phi))
    found = gamma * blades / (2.0 * np.pi * h)
    f = 2.0 / np.pi * np.arccos(np.exp(-0.5 * blades * (1.0 - x) * np.sqrt(1.0 + h**2) / h))
    outer = (x > 0.3) & (x < 0.9)
    assert found[outer] == pytest.approx((f * x**2 / (x**2 + h**2))[outer], rel=0.03)


def test_power_and_thrust_converge_with_panels(rig: rigs.Rig) -> None:
    rows = settled([0.6 * rig.top_rpm] * 3, [0.0, 5.0, 10.0])
    coarse, fine = (truth_world.loads(replace(rig.rotor, panels=n), truth_world.World(), rows) for n in (14, 21))
    assert coarse.thrust == pytest.approx(fine.thrust, rel=0.01)
    assert coarse.torque == pytest.approx(fine.torque, rel=0.01)


def test_induced_power_is_never_below_momentum_theory(rig: rigs.Rig) -> None:
    rows = settled([0.5 * rig.top_rpm] * 4, [0.0, 3.0, 6.0, 9.0])
    got = truth_world.loads(rig.rotor, truth_world.World(), rows)
    rho, area = float(truth.air(np.array(T_ROOM), np.array(P_ROOM))[0]), np.pi * rig.rotor.radius**2
    v = rows.airspeed
    ideal = got.thrust * (0.5 * v + np.sqrt(0.25 * v**2 + got.thrust / (2.0 * rho * area)))
    assert np.all(got.torque * rows.rpm * np.pi / 30.0 > ideal)


def test_forces_scale_with_density_and_speed_when_sections_do_not_care(rig: rigs.Rig) -> None:
    plain = truth_section.SectionPhysics(reynolds=0.0, compressibility=0.0, drag_divergence=0.0)
    world = truth_world.World(section=plain)
    rows = settled([3000.0, 6000.0], [2.0, 4.0])
    got = truth_world.loads(rig.rotor, world, rows)
    assert got.thrust[1] == pytest.approx(4.0 * got.thrust[0], rel=1e-4)
    denser = truth_world.loads(rig.rotor, replace(world, density_error=0.1), rows)
    assert denser.torque == pytest.approx(1.1 * got.torque, rel=1e-4)


def test_caradonna_tung_hover(shared_data: Path) -> None:
    """Two blades, NACA 0012, untwisted, R 1.143 m, c 0.1905 m; measured CT is known to some 4 %."""
    ratios: dict[float, list[float]] = {}
    with (shared_data / "caradonna_tung" / "caradonna_tung_CT_vs_tipMach.csv").open(encoding="utf-8") as file:
        for row in csv.reader(file):
            if not row[0][0].isdigit() or float(row[2]) > 0.65:
                continue
            angle, rpm, _, ct = map(float, row)
            rotor = truth.TruthRotor(
                1.143, 2, (0.17, 1.0), (0.1905 / 1.143,) * 2, (np.radians(angle),) * 2,
                truth_section.TrueSection(0.0, 0.4, 0.12), panels=20,
            )  # fmt: skip
            got = truth.solve(rotor, np.array([rpm]), np.zeros(1), np.array([15.0]), np.array([P_ROOM]))
            tip = rpm * np.pi / 30.0 * 1.143
            mine = float(got.thrust[0]) / (1.225 * np.pi * 1.143**2 * tip**2)
            ratios.setdefault(angle, []).append(mine / ct)
    print({k: np.round(v, 3).tolist() for k, v in ratios.items()})
    assert set(ratios) == {5.0, 8.0, 12.0}
    assert all(0.9 < v < 1.18 for group in ratios.values() for v in group)


@pytest.mark.parametrize(("name", "camber"), [("apce_10x7", 0.035), ("apce_9x6", 0.035), ("apcsf_10x4.7", 0.065)])
def test_uiuc_propellers(shared_data: Path, name: str, camber: float) -> None:
    """Measured stations; the section is the family's usual one, not known: static CT within 12 %, CP within 15 %."""
    folder = shared_data / "uiuc" / "volume-1"
    x, c, beta = np.loadtxt(folder / f"{name}_geom.txt", skiprows=1).T
    keep = x >= 0.15
    diameter = float(name.split("_")[1].split("x")[0]) * 0.0254
    section = truth_section.TrueSection(camber, 0.4, 0.09)
    rotor = truth.TruthRotor(0.5 * diameter, 2, tuple(x[keep]), tuple(c[keep]), tuple(np.radians(beta[keep])), section)
    errors: dict[str, list[np.ndarray]] = {"static": [], "flight": []}
    for path in sorted(folder.glob(f"{name}_*.txt")):
        if "geom" in path.name:
            continue
        table = np.loadtxt(path, skiprows=1)
        static = "static" in path.name
        rpm = table[:, 0] if static else np.full(len(table), float(re.findall(r"_(\d+)\.txt", path.name)[0]))
        v = np.zeros(len(table)) if static else table[:, 0] * rpm / 60.0 * diameter
        loaded = table[:, 1] > 0.3 * table[:, 1].max()  # near zero thrust a ratio says nothing
        got = truth.solve(rotor, rpm, v, np.full(len(rpm), T_ROOM), np.full(len(rpm), P_ROOM))
        unit = 1.2041 * (rpm / 60.0) ** 2 * diameter**4
        ratio = np.stack([got.thrust / unit / table[:, 1], 2 * np.pi * got.torque / unit / diameter / table[:, 2]])
        errors["static" if static else "flight"].append(ratio[:, loaded] - 1.0)
    found = {k: np.median(np.abs(np.concatenate(v, axis=1)), axis=1) for k, v in errors.items()}
    print(name, {k: np.round(v, 3).tolist() for k, v in found.items()})
    assert found["static"][0] < 0.12 and found["static"][1] < 0.16
    assert found["flight"][0] < 0.16 and found["flight"][1] < 0.18


def test_duct_goes_from_none_to_the_endless_one() -> None:
    x = (0.4, 0.6, 0.8)
    none, _ = truth_duct.disk_speeds(truth_duct.TruthDuct(0.02, 0.01, lip_radius=1e-4), 0.35, x)
    endless, still = truth_duct.disk_speeds(truth_duct.TruthDuct(8.0, 4.0), 0.35, x)
    assert none == pytest.approx(0.5, abs=0.01)  # half of the jet's excess at the disk: the open rotor
    assert endless == pytest.approx(1.0, abs=0.05)  # the whole of it: no contraction
    assert still == pytest.approx(0.0, abs=0.01)


def test_duct_gives_more_thrust_for_less_torque_and_fades_with_speed(ducted: rigs.Rig) -> None:
    rows = settled([0.6 * ducted.top_rpm] * 2, [0.0, 0.3 * ducted.top_rpm / 60.0 * 2.0 * ducted.rotor.radius])
    world = truth_world.World()
    with_duct = truth_world.loads(ducted.rotor, world, rows, ducted.duct)
    open_rotor = truth_world.loads(replace(ducted.rotor, wall=float("nan")), world, rows)
    per_torque = (with_duct.thrust / with_duct.torque) / (open_rotor.thrust / open_rotor.torque)
    assert per_torque[0] > 1.15
    assert per_torque[0] > per_torque[1]


def test_wall_effect_follows_hayden(rig: rigs.Rig) -> None:
    z = np.array([1.5, 2.0, 3.0])
    rows = settled([0.5 * rig.top_rpm] * 3, [0.0] * 3, wall=z * rig.rotor.radius)
    free, near = (truth_world.loads(rig.rotor, truth_world.World(ground=g), rows) for g in (0.0, 1.0))
    thrust = near.thrust / free.thrust
    power = near.torque / free.torque / thrust**1.5
    assert power == pytest.approx(1.0 / (0.9926 + 0.0379 * (2.0 / z) ** 2), abs=0.025)
    assert np.all(np.diff(thrust) < 0.0)


@pytest.mark.parametrize("name", sorted(causes.CAUSES))
def test_no_strength_is_no_cause(rig: rigs.Rig, ducted: rigs.Rig, name: str) -> None:
    """The plainest check of every cause: nothing of it leaves the readings as they were, some of it does not."""
    cause = causes.CAUSES[name]
    on = ducted if cause.ducted else rig
    plan = next(p for p in ("transient", "wall", "gap", "static_narrow", "single_line", "endurance", "static_sweep",
                            "grid_shuffled") if p in cause.plans and (p != "gap" or on.duct))  # fmt: skip
    bench = Bench.draw(on, plan, np.random.default_rng(1))
    keep = np.linspace(0, bench.rows.rpm.size - 1, min(bench.rows.rpm.size, 14)).astype(int)
    fields = {k: v[keep] if isinstance(v, np.ndarray) else v for k, v in vars(bench.rows).items()}
    bench.rows = truth_world.Conditions(**fields)
    rng = np.random.default_rng(2)
    some = cause.make(1.0, on, bench.rows, rng)
    if name in ("unit_slip", "duct"):  # nothing of a unit is still a unit
        assert np.any(bench.signature(some, cause)["thrust_N"]) or np.any(bench.signature(some, cause)["torque_Nm"])
        return
    world, stand = causes.applied(bench.plain(), Stand(), cause.make(0.0, on, bench.rows, rng))
    without_world, without_stand = causes.applied(bench.plain(), Stand(), cause.without)
    if name == "ground_effect":
        without_world = replace(without_world, ground=0.0)
    a, b = bench.measure(world, stand)[1], bench.measure(without_world, without_stand)[1]
    for channel in a:
        assert np.nan_to_num(a[channel]) == pytest.approx(np.nan_to_num(b[channel]), rel=1e-4, abs=1e-12), channel
    differs = bench.signature(some, cause)
    if name != "drag_divergence":  # needs more tip speed than every rig has
        assert max(np.nanmax(np.abs(v)) for v in differs.values()) > 0.0


def test_fault_of_one_cell_leaves_the_other_alone(rig: rigs.Rig) -> None:
    bench = Bench.draw(rig, "static_narrow", np.random.default_rng(1))
    loads, base = bench.measure(bench.plain(), Stand())
    for name, other in (("thrust_gain", "torque_Nm"), ("thrust_zero", "torque_Nm"), ("torque_gain", "thrust_N"),
                        ("torque_zero", "thrust_N"), ("thrust_drift", "torque_Nm")):  # fmt: skip
        _, got = bench.measure(bench.plain(), Stand(**{name: 0.05}))
        assert got[other] == pytest.approx(base[other], rel=1e-4)
        mine = "thrust_N" if other == "torque_Nm" else "torque_Nm"
        assert not np.allclose(got[mine], base[mine], rtol=3e-3)
    zero = bench.measure(bench.plain(), Stand(thrust_zero=0.05))[1]["thrust_N"] - base["thrust_N"]
    assert zero == pytest.approx(0.05 * full_scales(loads)[0], rel=1e-2)


def test_noise_has_the_covariance_that_the_yardstick_uses() -> None:
    n = 8
    rows = settled([5000.0] * n, [0.0] * n, run=np.repeat([0, 1], n // 2))
    ones = np.linspace(0.5, 1.0, n)
    empty = np.zeros((n, 1))
    still = truth.TrueAnswer(ones, ones, ones > 0, empty, empty, empty, ones, ones, ones, ones, ones)
    loads = truth_world.TrueLoads(ones, ones, ones, ones, still)
    stand = Stand(noise=0.01, session=0.01, step=1e-6)
    rng = np.random.default_rng(3)
    sample = np.array([record(loads, rows, 0.1, None, stand, rng)["thrust_N"] for _ in range(6000)])
    wanted = covariance(ones, rows.run, 1.2, stand)
    found = np.cov(sample.T)
    assert found == pytest.approx(wanted, abs=0.06 * wanted.max())
    assert found[0, 1] > 5 * abs(found[0, n - 1])  # correlated within a run, not between runs
