"""The door: every line that the README tells people to type, typed with files as people have them."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import bemt
from bemt.app import face, registry
from bemt.app.cli import main
from bemt.base.errors import InputError

ROOT = Path(__file__).resolve().parents[1]
STATIONS = """Blattgeometrie 10x5
Radius [mm];Profiltiefe [mm];Einstellwinkel [°]
25,4;16,8;23,9
50,8;25,4;18,9
63,5;26,3;15,7
88,9;22,5;11,5
101,6;18,7;10,2
127;6,4;7,8
"""


def forces(folder: Path) -> None:
    """Forces and moments of OpenFOAM at 6000 rev/min that settle within three revolutions."""
    place = folder / "postProcessing" / "forces" / "0"
    place.mkdir(parents=True)
    t = np.arange(1, 901) * 1e-4
    for file, size in (("force", 4.75), ("moment", 0.0735)):
        x = size * (1.0 + 1.5 * np.exp(-t / 2e-3))
        head = "# Time total_x total_y total_z pressure_x pressure_y pressure_z viscous_x viscous_y viscous_z\n"
        rows = "".join(f"{a:.6g} {b:.7g} 0 0 {b:.7g} 0 0 0 0 0\n" for a, b in zip(t, x, strict=True))
        (place / f"{file}.dat").write_text(f"# {file.capitalize()}\n{head}{rows}")


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a case, two bench recordings, stations, a scan, a CFD run and flights."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "stations.csv").write_text(STATIONS)
    forces(tmp_path / "run")
    assert main(["new", "10x5"]) == 0
    for script, words in (("two_runs.py", []), ("flight_log.py", ["flights"])):
        subprocess.run([sys.executable, str(ROOT / "docs" / script), *words], check=True, capture_output=True)
    assert main(["export", "prop_10x5", "--out", "scan", "--format", "stl"]) == 0
    return tmp_path


@pytest.mark.slow
def test_every_row_of_the_readme_runs(desk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("cadquery")
    rows = re.findall(r"^\| ([^|`]+) \| (.*) \|$", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.M)
    scan = next((desk / "scan").rglob("*.stl")).as_posix()
    typed = 0
    for have, row in rows:
        flight = "flight" in have
        for k, line in enumerate(re.findall(r"`bemt ([^`]+)`", row)):
            if line.startswith("stand "):
                continue  # asks before each run
            words = {
                "NAME": f"mine{k}", "FILE": "stations.csv", "FILE.stl": scan, "CASE": "prop_10x5", "CASES": "prop_10x5",
                "DIR": f"out{typed}", "A": "before.csv", "B": "after.csv", "points.csv": "before.csv",
                "LOG": "flights/after.usdlog" if flight else "after.csv", "HEALTHY_LOG": "flights/before_1.usdlog",
                "EXPORTS": "run", "TARGET": "gazebo", "10x5": f"10x5{'' if line.startswith('estimate') else 'x3'}",
            }  # fmt: skip
            argv = [words.get(word, word) for word in shlex.split(line)]
            capsys.readouterr()
            code = main(argv)
            said = capsys.readouterr()
            assert code in (0, 1), f"{argv}: {said.err}"
            assert said.out or said.err
            typed += 1
    assert typed > 20


SPEEDS = np.linspace(3000.0, 9000.0, 7)
FLIGHT = np.array([2.02, 2.03, 4.17, 5.17, 6.35, 7.41, 8.43, 9.61, 10.7, 11.8, 12.9, 14.1, 15.0, 16.0])


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A case and tables of it: sound, grams that are newtons, km/h that are m/s, a stuck pitot, no speed."""
    folder = tmp_path_factory.mktemp("bench")
    rotor = bemt.propeller("10x5")
    rotor.write(folder / "my case")
    still = rotor.solve(SPEEDS, bands=False)
    flown = rotor.solve(np.full(FLIGHT.size, 6000.0), airspeed_m_s=FLIGHT, bands=False)
    held = np.where((FLIGHT > 8.0) & (FLIGHT < 15.5), 8.43, FLIGHT)
    for name, head, columns in (
        ("still", "rpm,thrust_N,torque_Nm", (SPEEDS, still.thrust_N, still.torque_Nm)),
        ("again", "rpm,thrust_N,torque_Nm", (SPEEDS, 0.9 * still.thrust_N, still.torque_Nm)),
        ("newton", "rpm,thrust (g),torque_Nm", (SPEEDS, still.thrust_N, still.torque_Nm)),
        ("kmh", "rpm,airspeed [km/h],thrust_N,torque_Nm", (flown.rpm, FLIGHT, flown.thrust_N, flown.torque_Nm)),
        ("stuck", "rpm,airspeed_m_s,thrust_N,torque_Nm", (flown.rpm, held, flown.thrust_N, flown.torque_Nm)),
        ("bare", "thrust (N),torque (Nm)", (still.thrust_N[3:4].repeat(3), still.torque_Nm[3:4].repeat(3))),
    ):
        rows = "\n".join(",".join(f"{x:.5g}" for x in row) for row in zip(*columns, strict=True))
        (folder / f"{name}.csv").write_text(f"{head}\n{rows}\n")
    return folder


TYPED = (
    "import still.csv --case 'my case'", "import still.csv --case 'my case' --density-kg-m3 1.1",
    "import newton.csv --unit thrust=N --case 'my case'", "import still.csv again.csv --unit thrust=N",
    "import bare.csv --case 'my case' --rpm 6000", "diagnose still.csv --case 'my case' --density-kg-m3 1.1",
    "diagnose newton.csv --case 'my case'", "diagnose kmh.csv --case 'my case'",
    "diagnose newton.csv --case 'my case' --unit thrust=gf torque=Nm", "compare newton.csv again.csv --unit thrust=N",
    "compare still.csv newton.csv --case 'my case' --sign torque=1", "compare still.csv again.csv --diameter-m 0.254",
)  # fmt: skip
"""Lines that end in what to type next."""


@pytest.mark.parametrize("line", TYPED)
def test_what_is_printed_next_runs_as_typed(
    line: str, bench: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the case and the options that were given; files that are still to be recorded have names of their own."""
    monkeypatch.chdir(bench)
    (bench / "recording.toml").unlink(missing_ok=True)
    assert main(shlex.split(line)) == 0
    steps = re.findall(r"^(?:Next:|  ) +(bemt .*?)(?:   \(.*)?$", capsys.readouterr().out, flags=re.M)
    assert steps or line.startswith("diagnose still"), "nothing to type"
    options = {word for word in shlex.split(line) if word.startswith("--")}
    for step in steps:
        command, *argv = shlex.split(step)[1:]
        assert shlex.split(step)[1:] != shlex.split(line), "the same again"
        if command == "import":
            assert main([command, *argv]) == 0
            options -= {"--unit", "--sign"}  # kept in the file
        else:
            face.parsed(registry.find(command), argv)
            assert options <= {*argv} | ({"--case", "--density-kg-m3"} if command == "compare" else set()), step


def test_every_door_uses_the_rows_that_import_keeps(bench: Path) -> None:
    from bemt.data.recordings.load import import_file
    from bemt.data.recordings.reduce import reduce
    from bemt.judge.diagnose.load import load

    kept = reduce(import_file(bench / "stuck.csv"))
    assert 0 < len(kept) < FLIGHT.size
    assert np.array_equal(load(str(bench / "stuck.csv"), bemt.propeller("10x5").case).V, kept["airspeed_m_s"])


def test_a_stated_density_counts_as_a_recorded_one(bench: Path) -> None:
    (told,) = bemt.import_(bench / "still.csv", density_kg_m3=1.1).to_dict()["files"]
    assert {p["density_kg_m3"] for p in told["reduction"]["points"]} == {1.1}
    found = bemt.diagnose(bench / "still.csv", bench / "my case", density_kg_m3=1.1)
    assert all(np.allclose(p.record.air.rho, 1.1) and p.record.air_recorded for p in found.diagnosis.problem.parts)


def test_a_picture_is_refused_before_the_work_unless_its_name_is_that_of_a_png(bench: Path) -> None:
    with pytest.raises(InputError, match=r"picture: got out\.gif"):
        bemt.import_(bench / "still.csv", case=bench / "my case", picture="out.gif")


def test_the_ratios_of_two_recordings_are_a_frame(bench: Path) -> None:
    frame = bemt.compare(bench / "still.csv", bench / "again.csv").to_pandas().set_index("channel")
    assert frame.loc["thrust_N", "ratio"] == pytest.approx(0.9, abs=2e-3)
