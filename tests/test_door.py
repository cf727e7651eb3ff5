"""The door: every line that the README tells people to type, typed with files as people have them."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bemt.app.cli import main

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
