"""The promise of the exports: what is written is what the solver says, within the stated error, or it is refused."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bemt.base.tables import write_atomic
from bemt.case import Case, load_case
from bemt.commands.cli import main
from bemt.exports import exports, target_ids
from bemt.exports.base import FEATURES, Files, Job, LoadsExport, entry
from bemt.exports.performance import solve_points

NUMBERS = [word for word in target_ids() if word not in ("stl", "obj", "step", "openfoam")]
LOADS = [word for word in NUMBERS if word in ("jsbsim", "mujoco", "rotorpy", "gazebo", "px4", "ardupilot", "simulink",
                                              "table", "fmu")]  # fmt: skip
TABLES = ("jsbsim", "mujoco", "simulink", "table", "fmu")


@pytest.fixture(scope="module")
def job(project: Path) -> Job:
    return Job(load_case(project / "cases/prop_10x5/case.toml"), rpm=10_000.0, airspeed_m_s=8.0)


@pytest.fixture(scope="module")
def fan(project: Path) -> Job:
    return Job(load_case(project / "cases/ds30/case.toml"), airspeed_m_s=20.0)


def written(word: str, job: Job) -> Files:
    for package in exports()[word].needs:
        pytest.importorskip(package)
    assert not exports()[word].faults(job), exports()[word].faults(job)
    return exports()[word].write(job)


def grid(job: Job, seed: int = 7, count: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Speeds and airspeeds inside the flight range."""
    t = job.performance
    rng = np.random.default_rng(seed)
    rpm = rng.uniform(t.rpm[0], t.rpm[-1], count)
    return rpm, rng.uniform(0.0, 1.0, count) * np.interp(rpm, t.rpm, t.J_zero) * rpm / 60.0 * t.diameter_m


def save(files: Files, folder: Path) -> Path:
    for name, data in files.items():
        write_atomic(folder / name, data)
    return folder


# ---------------------------------------------------------------- the contract


def test_every_target_says_what_it_holds() -> None:
    assert {"jsbsim", "mujoco", "rotorpy", "gazebo", "px4", "ardupilot", "simulink", "table", "fmu", "rotor-disk",
            "su2-disk", "su2-bem", "flow360", "xrotor", "qprop", "dfdc", "c81"} <= set(exports())  # fmt: skip
    for word, target in exports().items():
        assert target.id == word and target.title and target.holds and target.source and target.conventions
        assert target.kind in ("solid", "loads", "disk", "blade") and target.features <= set(FEATURES)


@pytest.mark.parametrize("word", [word for word in NUMBERS if word != "fmu"])  # an FMU carries a fresh GUID
def test_two_runs_write_the_same_bytes(word: str, job: Job, fan: Job) -> None:
    asked = fan if word == "dfdc" else job
    assert written(word, asked) == written(word, Job(asked.case, asked.rpm, asked.airspeed_m_s))


@pytest.mark.parametrize("word", LOADS)
def test_the_stated_error_holds_at_points_nobody_fitted(word: str, job: Job) -> None:
    target = exports()[word]
    assert isinstance(target, LoadsExport)
    files = written(word, job)
    stated = entry(target, job, files)["fit_error_pct"]
    rpm, V = grid(job)
    truth = solve_points(job.case, rpm, V)
    t = job.performance
    for name, got, exact, most in zip(("thrust", "torque"), target.loads(files, rpm, V),
                                      (truth.thrust_N, truth.torque_Nm),
                                      (t.thrust_N[:, t.at_rest], t.torque_Nm.max(axis=1)), strict=True):  # fmt: skip
        if stated[name]["flight"] is None:
            assert np.isnan(got).all()
            continue
        share = 100.0 * np.abs(got - exact) / np.interp(rpm, t.rpm, most)
        assert share.max() <= 1.3 * stated[name]["flight"] + 0.05, (name, share.max(), stated)
        if word in TABLES:
            assert share.max() < 0.3


def test_the_better_model_class_has_the_smaller_error(job: Job) -> None:
    error = {word: entry(exports()[word], job, written(word, job))["fit_error_pct"]["thrust"]["flight"]
             for word in ("table", "px4", "rotorpy", "gazebo")}  # fmt: skip
    assert error["table"] < error["px4"] < error["rotorpy"] < error["gazebo"]


def test_the_band_grows_with_what_is_not_known(job: Job, project: Path) -> None:
    assert 0.02 < job.band.thrust[0] < 0.5
    sure = job.case.replaced({})
    known = Job(Case(sure.path, sure.written, sure.file), job.rpm)
    assert known.band.thrust == (0.0, 0.0) and "not an uncertainty" in known.band.origin


# ---------------------------------------------------------------- refused, not dropped


def test_a_target_that_cannot_hold_what_is_asked_is_refused(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case, out = str(project / "cases/prop_10x5"), tmp_path / "o"
    for arguments, words in (
        (["rotorpy", "--hold", "mach"], ("rotorpy", "Mach")),
        (["table", "gazebo", "--hold", "airspeed"], ("gazebo", "airspeed")),
        (["su2-disk"], ("su2-disk", "ADV_RATIO")),
        (["dfdc"], ("dfdc", "open rotor")),
        (["jsbsim", "--airspeed", "3"], ("--airspeed", "jsbsim")),
        (["stl", "--hold", "torque"], ("--hold", "Solids")),
        (["table", "--hold", "lift"], ("--hold", "lift")),
    ):
        assert main(["export", case, "--out", str(out), "--format", *arguments]) == 2
        told = capsys.readouterr().err
        assert all(word in told for word in words), told
        assert not out.exists() or not any(out.iterdir())
    for word in ("xrotor", "qprop", "c81"):
        assert main(["export", str(project / "cases/ds30"), "--out", str(out), "--format", word]) == 2
        assert "duct" in capsys.readouterr().err


def test_the_command_writes_a_manifest_and_takes_the_last_export_away(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case, out = str(project / "cases/prop_10x5"), tmp_path / "o"
    assert main(["export", case, "--out", str(out), "--format", "table", "rotorpy", "--rpm", "9000", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["cases"][0]["targets"]
    assert [item["target"] for item in told] == ["table", "rotorpy"]
    for item in told:
        assert {"fit_error_pct", "band", "range", "holds", "conventions", "source", "notes"} <= set(item)
        assert item["range"]["rpm"][1] == 9000.0
        assert all((out / item["target"] / f["path"]).is_file() for f in item["files"])
    assert main(["export", case, "--out", str(out), "--format", "px4"]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["manifest.json", "px4"]


# ---------------------------------------------------------------- read back by the programs


def test_c_header_compiled(job: Job, tmp_path: Path) -> None:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    save(written("table", job), tmp_path)
    rpm, V = grid(job)
    calls = "".join(f"prop_10x5_loads({n!r}, {v!r}, 1.0, &T, &Q); printf(\"%.17g %.17g\\n\", T, Q);\n"
                    for n, v in zip(rpm.tolist(), V.tolist(), strict=True))  # fmt: skip
    text = f'#include <stdio.h>\n#include "prop_10x5.h"\nint main(void) {{ double T, Q;\n{calls}return 0; }}\n'
    (tmp_path / "main.c").write_text(text)
    program = str(tmp_path / "program")
    subprocess.run([compiler, "-std=c99", "-Wall", "-Werror", "-o", program, str(tmp_path / "main.c")], check=True)
    out = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    got = np.array([line.split() for line in out.splitlines()], dtype=float)
    want = np.transpose(job.performance.lookup(rpm, V)) / job.performance.rho
    assert got == pytest.approx(want, rel=1e-8, abs=1e-9)


def test_jsbsim(job: Job, tmp_path: Path) -> None:
    jsbsim = pytest.importorskip("jsbsim")
    save(written("jsbsim", job), tmp_path)
    for V, throttle in ((0.0, 0.1), (0.0, 0.6), (6.0, 0.05), (12.0, 0.5), (20.0, 0.8)):
        fdm = jsbsim.FGFDMExec(str(tmp_path))
        fdm.set_debug_level(0)
        for setter, folder in ((fdm.set_aircraft_path, "aircraft"), (fdm.set_engine_path, "engine"),
                               (fdm.set_systems_path, "systems")):  # fmt: skip
            setter(folder)
        assert fdm.load_model("prop_10x5_stand")
        fdm.set_dt(1.0 / 2000.0)
        fdm.run_ic()
        fdm["forces/hold-down"] = 1
        fdm["atmosphere/wind-north-fps"] = -V / 0.3048
        fdm["propulsion/set-running"] = -1
        fdm["fcs/throttle-cmd-norm"] = throttle
        for _ in range(6000):
            rpm = fdm["propulsion/engine/propeller-rpm"]
            fdm.run()
        rho = fdm["atmosphere/rho-slugs_ft3"] * 515.378818
        thrust = fdm["propulsion/engine/thrust-lbs"] * 4.4482216152605 / rho
        torque = fdm["propulsion/engine/propeller-power-ftlbps"] * 1.3558179483314 / (rpm * np.pi / 30.0) / rho
        (T,), (Q,) = job.performance.lookup(np.array([rpm]), np.array([V]))
        assert (thrust, torque) == pytest.approx((T / job.performance.rho, Q / job.performance.rho), rel=1e-5)


def test_mujoco(job: Job, tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    save(written("mujoco", job), tmp_path)
    space: dict[str, Any] = {}
    exec((tmp_path / "prop_10x5_mujoco.py").read_text(), space)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "prop_10x5.xml"))
    data = mujoco.MjData(model)
    propeller = space["Propeller"](model)
    for rpm, V in zip(*grid(job, count=8), strict=True):
        mujoco.mj_resetData(model, data)
        data.qvel[2] = V
        mujoco.mj_forward(model, data)
        propeller.rpm = rpm
        propeller(model, data)
        mujoco.mj_forward(model, data)
        (T,), (Q,) = job.performance.lookup(np.array([rpm]), np.array([V]))
        force = data.qfrc_actuator[:6]
        assert force[2] == pytest.approx(T, rel=1e-9, abs=1e-12) and force[5] == pytest.approx(-Q, rel=1e-9)
        assert force[[0, 1, 3, 4]] == pytest.approx(0.0, abs=1e-12)


def test_rotorpy(job: Job) -> None:
    pytest.importorskip("rotorpy")
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    files = written("rotorpy", job)
    space: dict[str, Any] = {}
    exec(str(next(iter(files.values()))), {}, space)
    still = dict.fromkeys(("c_Dx", "c_Dy", "c_Dz", "k_d", "k_h", "k_flap"), 0.0)
    vehicle = Multirotor({**quad_params, **space["rotor_params"], **still}, aero=True)
    target = exports()["rotorpy"]
    assert isinstance(target, LoadsExport)
    for rpm, V in zip(*grid(job, count=8), strict=True):
        speeds = np.array([rpm * np.pi / 30.0, 0.0, 0.0, 0.0])
        force, moment = vehicle.compute_body_wrench(np.zeros(3), speeds, np.array([0.0, 0.0, V]))
        T, Q = target.loads(files, np.array([rpm]), np.array([V]))
        assert force[2] == pytest.approx(T[0], rel=1e-9)
        assert abs(moment[2]) == pytest.approx(Q[0], rel=1e-9)


def test_fmu(job: Job, tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    save(written("fmu", job), tmp_path)
    rpm, V = grid(job, count=6)
    signals = np.array([(float(i), n, v) for i, (n, v) in enumerate(zip(rpm, V, strict=True))],
                       dtype=[("time", "<f8"), ("rpm", "<f8"), ("airspeed_m_s", "<f8")])  # fmt: skip
    found = fmpy.simulate_fmu(str(tmp_path / "prop_10x5.fmu"), stop_time=5.0, step_size=1.0, output_interval=1.0,
                              input=signals, output=["thrust_N", "torque_Nm"])  # fmt: skip
    T, Q = job.performance.lookup(rpm, V)
    # co-simulation: the loads of an input stand at the end of its step
    assert found["thrust_N"][1:] == pytest.approx(T[: len(found) - 1], rel=1e-9)
    assert found["torque_Nm"][1:] == pytest.approx(Q[: len(found) - 1], rel=1e-9)


def test_flow360(job: Job, tmp_path: Path) -> None:
    disk = json.loads(str(written("flow360", job)["bet_disk.json"]))["BETDisks"][0]
    shape = (len(disk["MachNumbers"]), len(disk["ReynoldsNumbers"]), len(disk["alphas"]))
    assert disk["alphas"][0] == -180.0 and disk["alphas"][-1] == 180.0
    assert len(disk["sectionalPolars"]) == len(disk["sectionalRadiuses"])
    for polar in disk["sectionalPolars"]:
        assert np.shape(polar["liftCoeffs"]) == np.shape(polar["dragCoeffs"]) == shape
    pytest.importorskip("flow360")
    import flow360 as fl

    with fl.SI_unit_system:
        made = fl.BETDisk(
            entities=[fl.Cylinder(name="disk", center=(0, 0, 0) * fl.u.m, axis=(0, 0, 1),
                                  height=disk["thickness"] * fl.u.m, outer_radius=disk["radius"] * fl.u.m)],
            rotation_direction_rule=disk["rotationDirectionRule"], number_of_blades=disk["numberOfBlades"],
            omega=disk["omega"] * 340.0 * fl.u.rad / fl.u.s, chord_ref=disk["chordRef"] * fl.u.m,
            n_loading_nodes=disk["nLoadingNodes"], mach_numbers=disk["MachNumbers"],
            reynolds_numbers=disk["ReynoldsNumbers"], alphas=disk["alphas"] * fl.u.deg,
            twists=[fl.BETDiskTwist(radius=t["radius"] * fl.u.m, twist=t["twist"] * fl.u.deg) for t in disk["twists"]],
            chords=[fl.BETDiskChord(radius=c["radius"] * fl.u.m, chord=c["chord"] * fl.u.m) for c in disk["chords"]],
            sectional_polars=[fl.BETDiskSectionalPolar(lift_coeffs=p["liftCoeffs"], drag_coeffs=p["dragCoeffs"])
                              for p in disk["sectionalPolars"]],
            sectional_radiuses=disk["sectionalRadiuses"] * fl.u.m,
        )  # fmt: skip
    assert made.number_of_blades == 2


# ---------------------------------------------------------------- disks


@pytest.mark.parametrize("word", ["rotor-disk", "su2-disk"])
def test_a_prescribed_load_integrates_to_the_loads(word: str, job: Job, fan: Job) -> None:
    for asked in (job, fan):
        stated = entry(exports()[word], asked, written(word, asked))["fit_error_pct"]
        assert stated["thrust"] < 1e-4 and stated["torque"] < 1e-4


def test_rotor_disk_by_its_own_formula_at_rest_and_in_flight(job: Job) -> None:
    """f = q c B A/(2 pi r), force (0, -f Cd, f Cl), from the written text."""
    import re

    for V in (0.0, 8.0):
        asked = Job(job.case, job.rpm, V)
        text = str(written("rotor-disk", asked)["system/fvOptions"])
        rows = re.findall(r"\((s\d+) \(([-\d.e+]+) 0 1\)\)", text)
        tables = {name: (float(cd), float(cl)) for name, cd, cl in
                  re.findall(r"(s\d+)\s*\{[^}]*data \(\(-180 ([-\d.e+]+) ([-\d.e+]+)\)", text)}  # fmt: skip
        r = np.array([float(x) for _, x in rows])
        cd, cl = np.array([tables[name] for name, _ in rows]).T
        p = asked.loading
        fine = np.linspace(p.Rhub, p.R, 40001)
        q = 0.5 * p.rho * (V**2 + (p.omega * fine) ** 2)
        thrust = np.trapezoid(np.interp(fine, r, cl) * q * p.blades, fine)
        torque = np.trapezoid(np.interp(fine, r, cd) * q * p.blades * fine, fine)
        assert thrust == pytest.approx(p.thrust_N, rel=1e-3) and torque == pytest.approx(p.torque_Nm, rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.0, 27.0933])
def test_rotor_disk_in_openfoam(project: Path, tmp_path: Path, speed: float) -> None:
    """Two iterations: the load does not answer to the flow, so they show it whole."""
    if shutil.which("simpleFoam") is None:
        pytest.skip("no OpenFOAM")
    job = Job(load_case(project / "cases/prop_8x5/case.toml"), 20_000.0, speed)
    save(written("rotor-disk", job), tmp_path)
    control = tmp_path / "system/controlDict"
    control.write_text(control.read_text().replace("400;", "2;"))
    subprocess.run(["sh", "Allrun"], cwd=tmp_path, check=True)
    subprocess.run(["postProcess", "-latestTime", "-func", "writeCellCentres"], cwd=tmp_path, check=True,
                   capture_output=True)  # fmt: skip
    lift = float((tmp_path / "log.simpleFoam").read_text().split("Effective lift =")[-1].split()[0])
    assert lift == pytest.approx(job.loading.thrust_N, rel=1e-3)


# ---------------------------------------------------------------- blades, there and back


def _again(word: str, case: Case, tmp_path: Path, rpm: float, V: float) -> tuple[Any, Any]:
    job = Job(case, rpm, V)
    target = exports()[word]
    files = target.write(job)
    (tmp_path / "again").mkdir()
    back = target.read_back(job, files, tmp_path / "again")  # type: ignore[attr-defined]
    return solve_points(back, rpm, V), solve_points(target.compared(job), rpm, V)  # type: ignore[attr-defined]


@pytest.mark.parametrize("word", ["xrotor", "qprop"])
def test_a_file_that_holds_the_sections_comes_back_the_same(word: str, job: Job, tmp_path: Path) -> None:
    """The first file fits the case; what is read from it is a case that the format can hold."""
    target = exports()[word]
    (tmp_path / "first").mkdir()
    held = target.read_back(job, target.write(job), tmp_path / "first")  # type: ignore[attr-defined]
    for k, V in enumerate((0.0, 8.0)):
        folder = tmp_path / str(k)
        folder.mkdir()
        got, want = _again(word, held, folder, 10_000.0, V)
        scale = 1.225 * (10_000.0 / 60.0) ** 2 * 0.254**4
        assert got.thrust_N / scale == pytest.approx(want.thrust_N / scale, abs=1e-6)
        assert 2 * np.pi * got.torque_Nm / scale / 0.254 == pytest.approx(
            2 * np.pi * want.torque_Nm / scale / 0.254, abs=1e-6
        )


def test_c81_holds_the_polars_at_the_operating_point(job: Job, tmp_path: Path) -> None:
    got, want = _again("c81", job.case, tmp_path, 10_000.0, 8.0)
    scale = 1.225 * (10_000.0 / 60.0) ** 2 * 0.254**4
    assert got.thrust_N / scale == pytest.approx(want.thrust_N / scale, abs=1e-6)
    assert got.torque_Nm / scale == pytest.approx(want.torque_Nm / scale, abs=1e-6)


def test_dfdc_comes_back_within_its_stated_error(fan: Job) -> None:
    stated = entry(exports()["dfdc"], fan, written("dfdc", fan))["fit_error_pct"]
    assert stated["thrust"]["at_point"] < 10.0 and stated["torque"]["at_point"] < 10.0
