"""The promise of the exports: what is written is what the solver says, within the stated error, or it is refused."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
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


def script(project: Path, name: str) -> Any:
    """One of the scripts of docs/."""
    spec = importlib.util.spec_from_file_location(f"docs_{name}", project / f"docs/{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def flown(project: Path, name: str) -> dict[str, float]:
    """What a script of docs/ finds, in a process of its own."""
    code = "\n".join([
        "import importlib.util, os",
        f"spec = importlib.util.spec_from_file_location('{name}', 'docs/{name}.py')",
        "module = importlib.util.module_from_spec(spec)",
        "spec.loader.exec_module(module)",
        "print('found', module.main(), flush=True)",
        "os._exit(0)  # without what native libraries do on the way out",
    ])  # fmt: skip
    environment = os.environ | {"PYTHONPATH": str(project)}
    out = subprocess.run([sys.executable, "-c", code], cwd=project, capture_output=True, text=True, env=environment)
    lines = [line for line in out.stdout.splitlines() if line.startswith("found ")]
    assert lines, out.stderr[-2000:]
    found: dict[str, float] = eval(lines[-1].removeprefix("found "))
    return found


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
    assert 0.0 < known.band.thrust[0] < job.band.thrust[0] and known.band.torque[1] < job.band.torque[1]


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


PROGRAMS = {"table": 1e-8, "jsbsim": 1e-5, "mujoco": 1e-9, "rotorpy": 1e-9, "fmu": 1e-9, "flow360": 0.5}
"""Greatest error of what a program reads, over the greatest load; Flow360 builds its disk and solves nothing."""


@pytest.mark.parametrize("word", sorted(PROGRAMS))
def test_the_program_reads_what_was_written(word: str, project: Path) -> None:
    read_back = script(project, "read_back")
    if not read_back.installed(word):
        pytest.skip(f"no {read_back.PROGRAMS[word][0]}")
    assert read_back.measured(word) <= PROGRAMS[word]


def test_flow360_polars_span_the_circle(job: Job) -> None:
    disk = json.loads(str(written("flow360", job)["bet_disk.json"]))["BETDisks"][0]
    shape = (len(disk["MachNumbers"]), len(disk["ReynoldsNumbers"]), len(disk["alphas"]))
    assert disk["alphas"][0] == -180.0 and disk["alphas"][-1] == 180.0
    assert len(disk["sectionalPolars"]) == len(disk["sectionalRadiuses"])
    for polar in disk["sectionalPolars"]:
        assert np.shape(polar["liftCoeffs"]) == np.shape(polar["dragCoeffs"]) == shape


def test_a_quadrotor_hovers_at_the_speed_that_drive_predicts(project: Path) -> None:
    pytest.importorskip("mujoco")
    found = flown(project, "hover")
    assert 3000.0 < found["rpm"] < 8000.0
    assert abs(found["climb_m_s"]) < 0.02 and abs(found["height_m"]) < 0.02 and abs(found["yaw_rate_rad_s"]) < 1e-9


def test_an_aircraft_has_no_thrust_where_bemt_says_so(project: Path) -> None:
    pytest.importorskip("jsbsim")
    found = flown(project, "zero_thrust")
    assert abs(found["thrust_N"]) < 2e-3 * found["thrust_at_rest_N"] and found["rpm"] == pytest.approx(8000.0, rel=2e-3)


# ---------------------------------------------------------------- disks


@pytest.mark.parametrize("word", ["rotor-disk", "su2-disk"])
def test_a_prescribed_load_integrates_to_the_loads(word: str, job: Job, fan: Job) -> None:
    for asked in (job, fan):
        stated = entry(exports()[word], asked, written(word, asked))["fit_error_pct"]
        assert stated["thrust"] < 1e-4 and stated["torque"] < 1e-4


def test_rotor_disk_by_its_own_formula_at_rest_and_in_flight(job: Job) -> None:
    """f = q c B A/(2 pi r), force (0, -f Cd, f Cl), from the written text."""
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
    packaged = Path("/usr/share/openfoam")  # as Debian installs it, without its environment
    where = os.environ | ({"WM_PROJECT_DIR": str(packaged)} if packaged.is_dir() else {})
    for made in ("writeCellCentres", "writeCellVolumes"):
        command = ["postProcess", "-latestTime", "-func", made]
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, env=where)
    lift = float((tmp_path / "log.simpleFoam").read_text().split("Effective lift =")[-1].split()[0])
    force, centre, volume = (_field(tmp_path / "2" / name) for name in ("disk:rotorForce", "C", "V"))
    load = job.loading.rho * force * volume
    torque = float(np.sum(centre[:, 0] * load[:, 1] - centre[:, 1] * load[:, 0]))
    assert lift == pytest.approx(job.loading.thrust_N, rel=1e-3)
    assert load[:, 2].sum() == pytest.approx(job.loading.thrust_N, rel=1e-3)
    assert -torque == pytest.approx(job.loading.torque_Nm, rel=5e-3)


def _field(path: Path) -> np.ndarray:
    """Cells of an ASCII field."""
    text = path.read_text()
    head = re.search(r"internalField\s+nonuniform List<\w+>\s*(\d+)\s*\(", text)
    assert head is not None
    body = text[head.end() : text.index("\n)\n", head.end())]
    return np.array(body.replace("(", "").replace(")", "").split(), dtype=float).reshape(int(head[1]), -1)


@pytest.mark.parametrize("name", ["prop_8x5", "prop_10x5", "prop_12x6", "prop_14x8", "ds30"])
def test_every_case_becomes_every_disk(project: Path, name: str) -> None:
    asked = Job(load_case(project / f"cases/{name}/case.toml"), airspeed_m_s=25.0)
    for word in ("rotor-disk", "su2-disk", "su2-bem", "flow360"):
        files = written(word, asked)
        assert files and all(len(data) > 50 for data in files.values())
        assert "nan" not in " ".join(str(data).lower() for data in files.values() if isinstance(data, str))


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


def test_a_fan_that_dfdc_holds_comes_back_with_its_duct(fan: Job, tmp_path: Path) -> None:
    target, rpm = exports()["dfdc"], fan.loading.rpm
    (tmp_path / "first").mkdir()
    held = target.read_back(fan, target.write(fan), tmp_path / "first")  # type: ignore[attr-defined]
    assert held.duct() is not None
    for k, V in enumerate((0.0, 30.0)):
        (tmp_path / str(k)).mkdir()
        got, want = _again("dfdc", held, tmp_path / str(k), rpm, V)
        scale = 1.225 * (rpm / 60.0) ** 2 * fan.loading.R**4 * 16.0
        assert got.thrust_N / scale == pytest.approx(want.thrust_N / scale, abs=1e-6)
        assert got.torque_Nm / scale == pytest.approx(want.torque_Nm / scale, abs=1e-6)


def test_dfdc_comes_back_within_its_stated_error(fan: Job) -> None:
    stated = entry(exports()["dfdc"], fan, written("dfdc", fan))["fit_error_pct"]
    assert stated["thrust"]["at_point"] < 10.0 and stated["torque"]["at_point"] < 10.0
