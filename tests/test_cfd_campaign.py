"""The promise of CFD campaigns: strict files, whole records, a run that resumes."""

from __future__ import annotations

import csv
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filelock import FileLock
from own_cfd import Bemt, summary, summary_text

from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.data.recordings.cfd_setup import GRID_FLOOR
from bemt.tools.cfd.balance import BALANCE_LIMIT, balance_of
from bemt.tools.cfd.campaign import run_campaign
from bemt.tools.cfd.openfoam.write import settings_of
from bemt.tools.cfd.record import CampaignRecord, grid_studies, grid_uncertainty
from bemt.tools.cfd.schema import COLUMNS, RunRow, load_campaign, run_of
from bemt.tools.cfd.worker import StartField, point_key, radial_of, splice

pytestmark = pytest.mark.usefixtures("equal_solids_once")

HEAD = 'schema = "bemt.cfd/1"\nname = "t"\ncase = "{case}"\n'
TWO = "[defaults]\nlevel = 4\niterations = 30\naverage = 10\n[axes]\nrpm = [6000, 9000]\n"

# Programs that do as OpenFOAM does, as far as a campaign sees it: a log of calls, a grid, forces, fields.
PROGRAMS = {
    "blockMesh": "mkdir -p constant/polyMesh; echo grid > constant/polyMesh/points",
    "snappyHexMesh": ":", "topoSet": ":", "createPatch": ":", "setFields": ":",
    "checkMesh": "echo '    cells:            1234'",
    "simpleFoam": """
w=$(grep -o 'omega [-0-9.]*' constant/MRFProperties | cut -d' ' -f2)
if [ -n "$SLEEP_ABOVE" ] && awk "BEGIN {exit !($w > $SLEEP_ABOVE)}"; then
    echo $$ > pid; mv pid asleep; exec sleep 600
fi
mkdir -p postProcessing/forces/0
awk -v w=$w 'BEGIN {
    f = "postProcessing/forces/0/force.dat"; m = "postProcessing/forces/0/moment.dat"
    h = "(total_x total_y total_z) (pressure_x pressure_y pressure_z) (viscous_x viscous_y viscous_z)"
    print "# Force\\n# Time " h > f; print "# Moment\\n# Time " h > m
    for (i = 1; i <= 30; i++) {
        t = 1e-5 * w * w * (1 + DRIFT * (i - 25) / 10)
        printf "%d (0 0 %.9g) (0 0 %.9g) (0 0 0)\\n", i, t, t > f
        printf "%d (0 0 %.9g) (0 0 %.9g) (0 0 0)\\n", i, -0.02 * t, -0.02 * t > m
    }
}'
w=$(awk "BEGIN {print 1e-5 * $w * $w}")
""" + """
surface() {  # function object, field, patch, columns of one face, at every iteration that is balanced
    s=postProcessing/$1_$3/surface
    mkdir -p $s/21 $s/22 $s/23 $s/24 $s/25 $s/26 $s/27 $s/28 $s/29 $s/30 postProcessing/$1_$3/0
    for t in 21 22 23 24 25 26 27 28 29 30; do
        printf '# %s  FACE_DATA 1\\n# x y z\\n%s\\n' "$2" "$4" > postProcessing/$1_$3/surface/$t/$2_patch_$3.raw
        echo "$t 0" >> postProcessing/$1_$3/0/surfaceFieldValue.dat
    done
}
load() {  # function object: nothing on it
    mkdir -p postProcessing/$1/0
    for t in 21 22 23 24 25 26 27 28 29 30; do
        echo "$t (0 0 0) (0 0 0) (0 0 0)" >> postProcessing/$1/0/force.dat
        echo "$t (0 0 0) (0 0 0) (0 0 0)" >> postProcessing/$1/0/moment.dat
    done
}
# a flow of 1 m3/s comes in at rest and leaves with the momentum of the thrust, LEAK of it made at the sides
jet=$(awk "BEGIN {print -$w / 1.225 / (1 + LEAK)}")
surface mass phi inlet "0 0 1 -1"; surface momentum U inlet "0 0 1 0 0 0"
surface mass phi outlet "0 0 -1 $(awk 'BEGIN {print 1 + LEAK}')"; surface momentum U outlet "0 0 -1 0 0 $jet"
surface mass phi side "1 0 0 0"; surface momentum U side "1 0 0 0 0 0"
surface mass phi side1 "0 -1 0 -0.5"; surface momentum U side1 "0 -1 0 0 0 0"
surface mass phi side2 "0 1 0 $(awk 'BEGIN {print 0.5 - LEAK}')"; surface momentum U side2 "0 1 0 0 0 0"
load open; load sides
""",
}  # fmt: skip


@pytest.fixture
def programs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Log of the calls of the programs that stand in for OpenFOAM."""
    folder, log = tmp_path / "bin", tmp_path / "calls"
    folder.mkdir()
    for name, text in PROGRAMS.items():
        body = text.replace("DRIFT", "0").replace("LEAK", "0")
        (folder / name).write_text(f"#!/bin/sh\necho {name} >> {log}\n{body}\n")
        (folder / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")
    return log


def calls(log: Path, name: str) -> int:
    return log.read_text().split().count(name) if log.is_file() else 0


def write(folder: Path, project: Path, text: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "campaign.toml"
    path.write_text(HEAD.format(case=(project / "cases" / "prop_8x5").as_posix()) + text)
    return path


def tree(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "recording.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["no points"]),
        ("[axes]\nrpm = []\n", ["axes.rpm: got a list of 0"]),
        ("[axes]\nrpms = [9000]\n", ["rpms: got an unknown key", "Did you mean rpm"]),
        ("[axes]\nJ = [0.2]\n", ["J without rpm"]),
        ("[[points]]\nrpm = 9000\nJ = 0.1\nairspeed_m_s = 3\n", ["J and airspeed_m_s"]),
        ("[[points]]\nrpm = '9000'\nlevel = 40\nsolver = 'compresible'\n",
         ["rpm: got '9000'", "level: got 40", "Did you mean compressible?"]),
        ("[[points]]\nrpm = 9000\ntip_gap_pct_R = 1\n", ["a table [duct] or a case with a duct"]),
        ("[[points]]\nrpm = 9000\n[duct]\nlength_mm = 80\n", ["duct.exit_area_ratio: got nothing"]),
        ("[[points]]\nrpm = 9000\niterations = 30\naverage = 40\n", ["average = 40 of 30 iterations"]),
        ("nmae = 'x'\n[[points]]\nrpm = 9000\n", ["nmae: got an unknown key"]),
        ("[[points]]\nrpm = 9000,5\n", ["Use a decimal point"]),
    ],
)  # fmt: skip
def test_all_faults_of_a_file_are_reported(
    project: Path, tmp_path: Path, text: str, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "c", project, text)
    assert main(["cfd", str(path)]) == 2
    told = capsys.readouterr().err
    for word in words:
        assert word in told
    assert sorted(p.name for p in path.parent.iterdir()) == ["campaign.toml"]


def test_points_that_cannot_be_stop_the_campaign_before_it_runs(project: Path, tmp_path: Path, programs: Path) -> None:
    path = write(tmp_path / "c", project, "[[points]]\nrpm = 9000\n[[points]]\nrpm = 9000\nsector = 'blade'\n")
    with pytest.raises(InputError, match="point 2: sector: got one of 2 blades"):
        run_campaign(load_campaign(path), tmp_path / "w", ranks=1)
    path = write(tmp_path / "c", project, "[[points]]\nrpm = 9000\n[[points]]\nrpm = 9000\n")
    with pytest.raises(InputError, match="the same run twice"):
        run_campaign(load_campaign(path), tmp_path / "w", ranks=1)
    assert calls(programs, "blockMesh") == 0


def test_axes_points_and_changes_reach_the_run(project: Path, tmp_path: Path) -> None:
    text = ("[defaults]\npitch_offset_deg = 1.5\n[[points]]\nrpm = 7000\nwall_distance_over_R = 1.0\n"
            "[axes]\nrpm = [6000, 9000]\nJ = [0.0, 0.5]\n")  # fmt: skip
    campaign = load_campaign(write(tmp_path / "c", project, text))
    assert [(p.run.rpm, round(float(p.run.airspeed_m_s or 0.0), 3)) for p in campaign.points] == [
        (7000, 0.0), (6000, 0.0), (6000, 10.16), (9000, 0.0), (9000, 15.24)]  # fmt: skip
    assert campaign.points[0].run.wall_distance_over_R == 1.0
    turned = campaign.points[0].case.rotor().blade.at(0.05)[1] - campaign.case.rotor().blade.at(0.05)[1]
    assert math.degrees(float(turned)) == pytest.approx(1.5)
    duct = "[duct]\nlength_mm = 80\nexit_area_ratio = 1\n[[points]]\nrpm = 7000\ntip_gap_pct_R = 2\n"
    point = load_campaign(write(tmp_path / "d", project, duct)).points[0]
    assert settings_of(point.case, point.run)[0].gap == pytest.approx(0.02 * 0.1016)


def test_the_key_of_a_run_stands_for_what_decides_it(project: Path, tmp_path: Path) -> None:
    text = (
        "[defaults]\nrpm = 9000\n[[points]]\n[[points]]\nJ = 0.2\n[[points]]\nlevel = 5\n[[points]]\niterations = 500\n"
    )
    points = load_campaign(write(tmp_path / "c", project, text)).points
    keys = [point_key(point)[:2] for point in points]
    assert len({run for run, _ in keys}) == 4
    assert keys[0][1] == keys[1][1] == keys[3][1] != keys[2][1], "speed and iterations share a grid, levels do not"
    assert [point_key(p)[:2] for p in load_campaign(write(tmp_path / "other", project, text)).points] == keys


@pytest.mark.parametrize(
    ("line", "new", "same"),
    [("drag_level = 1.1", "drag_level = 1.15", True), ("camber = 0.035", "camber = 0.036", False),
     ("beta_offset_deg = 0.7", "beta_offset_deg = 0.8", False),
     ("density_kg_m3 = 1.225", "density_kg_m3 = 1.2", False)],
)  # fmt: skip
def test_a_recording_outlives_changes_of_the_case_that_no_run_saw(
    project: Path, tmp_path: Path, line: str, new: str, same: bool
) -> None:
    """Options of the BEMT are no reason to run a CFD again; anything that the grid, the gas or the flow knows is."""
    keys = []
    for folder, old in (("a", line), ("b", new)):
        case = tmp_path / folder / "cases" / "prop_8x5"
        case.mkdir(parents=True)
        given = project / "cases" / "prop_8x5"
        (case / "references.csv").write_bytes((given / "references.csv").read_bytes())
        text = (given / "case.toml").read_text()
        assert text.count(line) == 1
        (case / "case.toml").write_text(text.replace(line, old))
        path = tmp_path / folder / "campaign.toml"
        path.write_text(HEAD.format(case="cases/prop_8x5") + "[[points]]\nrpm = 9000\n")
        keys.append(point_key(load_campaign(path).points[0])[0])
    assert (keys[0] == keys[1]) is same


def test_a_campaign_is_recorded(
    project: Path, tmp_path: Path, programs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "c", project, TWO)
    work = str(tmp_path / "w")
    assert main(["cfd", str(path.parent), "--ranks", "1", "--work", work, "--keep", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "bemt.cfd-run/1" and len(document["rows"]) == 2
    rows = rows_of(path.parent)
    assert tuple(rows[0]) == COLUMNS
    for row, rpm in zip(rows, (6000, 9000), strict=True):
        omega = rpm * math.pi / 30
        assert float(row["thrust_N"]) == pytest.approx(2 * 1e-5 * omega**2, rel=1e-5)  # half domain
        assert float(row["torque_Nm"]) == pytest.approx(0.02 * float(row["thrust_N"]), rel=1e-5)
        assert (row["converged"], row["cells"], row["iterations"]) == ("1", "1234", "30")
        assert float(row["density_kg_m3"]) == 1.225 and row["wall_distance_m"] == ""
    assert calls(programs, "blockMesh") == 1, "one grid serves both speeds"
    manifest = json.loads((path.parent / "manifest.json").read_text())
    assert (manifest["points"], manifest["recorded"], manifest["converged"], manifest["missing"]) == (2, 2, 2, [])
    assert set(manifest["balance"]) == {row["run"] for row in rows}
    for found in manifest["balance"].values():
        assert all(abs(found[key]) < 1e-5 for key in ("mass", "momentum", "angular_momentum"))
    assert rows[0]["run"][:6] in summary_text(summary(tmp_path)), "a folder of campaigns is summed up"
    assert main(["cfd", str(path), "--ranks", "1", "--work", work, "--quiet"]) == 0
    assert calls(programs, "simpleFoam") == 2, "finished points are not run again"
    write(path.parent, project, TWO.replace("[6000, 9000]", "[6000, 9000, 12000]"))
    kept = tree(Path(work))
    assert len([name for name in kept if name.count("/") == 0]) == 3, "a grid and two runs"
    assert main(["cfd", str(path), "--ranks", "1", "--work", work, "--quiet"]) == 0
    assert calls(programs, "simpleFoam") == 3 and len(rows_of(path.parent)) == 3
    assert tree(Path(work)) == kept, "what was kept stays, the new run's folder goes"


def _alive(pid: int) -> bool:
    """Whether a process runs; one that only waits to be collected does not."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):  # it may end between opening and reading
        return False
    return stat.rsplit(")", 1)[1].split()[0] != "Z"


def test_a_killed_campaign_goes_on(project: Path, tmp_path: Path, programs: Path) -> None:
    path = write(tmp_path / "c", project, TWO)
    command = [sys.executable, "-m", "bemt", "cfd", str(path), "--ranks", "1", "--work", str(tmp_path / "w"), "--quiet"]
    process = subprocess.Popen(command, env={**os.environ, "SLEEP_ABOVE": "900"}, cwd=project, start_new_session=True)
    end = time.monotonic() + 600
    while not list((tmp_path / "w").glob("run-*/asleep")) and time.monotonic() < end and process.poll() is None:
        time.sleep(0.1)
    asleep = list((tmp_path / "w").glob("run-*/asleep"))
    assert asleep, "the second run never began"
    solver = int(asleep[0].read_text())
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    end = time.monotonic() + 600
    while _alive(solver) and time.monotonic() < end:
        time.sleep(0.1)
    assert not _alive(solver), "kill -9 leaves no solver behind"
    before = rows_of(path.parent)
    assert [row["rpm"] for row in before] == ["6000"]
    json.loads((path.parent / "manifest.json").read_text())
    assert main(command[3:]) == 0
    after = rows_of(path.parent)
    assert [row["rpm"] for row in after] == ["6000", "9000"] and after[0] == before[0]
    assert calls(programs, "simpleFoam") == 3, "the first once, the second twice"
    assert calls(programs, "blockMesh") == 1, "its grid was finished"
    assert not [p for p in path.parent.iterdir() if p.name.startswith(".")]
    assert not tree(tmp_path / "w"), "neither from now nor from before it was killed"


def test_the_work_folder_loses_nothing_that_the_campaign_did_not_make(
    project: Path, tmp_path: Path, programs: Path
) -> None:
    path, work = write(tmp_path / "c", project, TWO), tmp_path / "w"
    names = [point_key(point)[:2] for point in load_campaign(path).points]
    mine = ["thesis.tex", "run-1/data.csv", "grid-old/points", f"run-{names[0][0]}-mine/a", "run-0123456789ab/U",
            f"grid-{names[0][1]}-8/done"]  # fmt: skip
    for name in mine:
        (work / name).parent.mkdir(parents=True, exist_ok=True)
        (work / name).write_text("mine")
    before = tree(work)
    command = ["cfd", str(path), "--ranks", "1", "--work", str(work), "--quiet"]
    for runs in (2, 2):  # the second time all is recorded and nothing runs
        assert main(command) == 0
        assert calls(programs, "simpleFoam") == runs and tree(work) == before
    assert {(work / name).read_text() for name in mine} == {"mine"}
    assert main([*command, "--only", "1"]) == 0
    made = tree(work) - before
    assert {name for name in made if "/" not in name} == {f"run-{names[0][0]}", f"grid-{names[0][1]}-1"}
    assert main(command) == 0
    assert tree(work) == before, "what --only left goes with the whole campaign"
    (tmp_path / "empty").mkdir()
    (path.parent / "recording.csv").unlink()
    assert main([*command[:-2], str(tmp_path / "empty"), "--quiet"]) == 0
    assert not tree(tmp_path / "empty")
    (path.parent / "recording.csv").unlink()
    assert main([*command[:-2], str(tmp_path / "new"), "--quiet"]) == 0
    assert not (tmp_path / "new").exists(), "a folder that was not there is not left behind"


def test_the_default_work_folder_is_private_and_held_by_one_campaign(
    project: Path, tmp_path: Path, programs: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("BEMT_CFD_WORK", raising=False)
    monkeypatch.setenv("BEMT_CACHE", str(tmp_path / "cache"))
    path = write(tmp_path / "c", project, TWO)
    command = ["cfd", str(path), "--ranks", "1", "--quiet"]
    home = tmp_path / "cache" / "cfd"
    assert main([*command, "--only", "1"]) == 0
    (folder,) = home.iterdir()
    assert folder.name.startswith("t-") and home.stat().st_mode & 0o077 == 0
    with FileLock(home / f".{folder.name}.lock"):
        assert main(command) == 2
        assert "in use by another campaign" in capsys.readouterr().err
    assert main(command) == 0 and calls(programs, "blockMesh") == 1
    assert not [p for p in home.iterdir() if p.is_dir()]
    (path.parent / "recording.csv").unlink()
    folder.mkdir()
    (folder / "notes").write_text("mine")
    assert main(command) == 0
    assert {p.name for p in folder.iterdir()} == {"notes"}


def test_a_row_whose_settings_changed_is_replaced_and_u_has_a_floor(
    project: Path, tmp_path: Path, programs: Path
) -> None:
    path = write(tmp_path / "c", project, TWO)
    command = ["cfd", str(path), "--ranks", "1", "--work", str(tmp_path / "w"), "--quiet"]
    assert main(command) == 0
    before = rows_of(path.parent)
    for row in before:  # one grid, loads that do not move: nothing smaller than the floor can be claimed
        assert float(row["u_thrust_N"]) == pytest.approx(
            GRID_FLOOR["rest"]["thrust_N"] * float(row["thrust_N"]), rel=1e-3
        )
    write(path.parent, project, TWO.replace("average = 10", "average = 12"))
    assert main(command) == 0
    after = rows_of(path.parent)
    assert [row["rpm"] for row in after] == ["6000", "9000"] and {r["run"] for r in after}.isdisjoint(
        r["run"] for r in before
    )


@pytest.mark.parametrize("name", ["a/../h/deadly", "..", "/h", ".hidden", "a b", "x\\n", "-x"])
def test_a_name_leads_nowhere(
    project: Path, tmp_path: Path, programs: Path, name: str, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """A campaign's name obeys the rule of a case's: the default work folder bears it."""
    monkeypatch.delenv("BEMT_CFD_WORK", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp" / "h" / "deadly").mkdir(parents=True)
    path = write(tmp_path / "c", project, TWO)
    path.write_text(path.read_text().replace('name = "t"', f'name = "{name}"'))
    assert main(["cfd", str(path), "--ranks", "1"]) == 2
    told = capsys.readouterr().err
    assert "campaign.toml: name: got " in told and "letters, digits, dot, dash and underscore" in told
    assert tree(tmp_path / "tmp") == {"h", "h/deadly"} and tree(path.parent) == {"campaign.toml"}
    assert calls(programs, "blockMesh") == 0


LOG = ["Creating block mesh", "--> FOAM FATAL ERROR:", "Unknown patch, \"walls\"", "", "    From function x",
       "    in file blockMesh.C at line 99.", "FOAM exiting"]  # fmt: skip


@pytest.mark.parametrize(("program", "again"), [("blockMesh", []), ("simpleFoam", ["--only", "1"])])
def test_a_run_that_never_began_says_why_and_is_tried_again(
    project: Path, tmp_path: Path, programs: Path, program: str, again: list[str]
) -> None:
    path, work = write(tmp_path / "c", project, TWO.replace("[6000, 9000]", "[6000]")), tmp_path / "w"
    file = tmp_path / "bin" / program
    sound = file.read_text()
    lines = "\n".join(LOG)
    file.write_text(f"#!/bin/sh\nprintf '%s\\n' '{lines}'\nexit 1\n")
    command = ["cfd", str(path), "--ranks", "1", "--work", str(work), "--quiet"]
    assert main(command) == 1
    (row,) = rows_of(path.parent)
    assert (row["converged"], row["iterations"], row["thrust_N"]) == ("0", "0", "")
    for words in (f"{program} failed", *(" ".join(line.split()) for line in LOG)):
        assert words in row["note"]
    (manifest,) = json.loads((path.parent / "manifest.json").read_text())["not_converged"]
    assert manifest["note"] == row["note"]
    assert [p.read_text().split("\n")[:7] for p in work.glob(f"*/log.{program}")] == [LOG], "the log can be read"
    beside = write(tmp_path / "d", project, TWO)  # a campaign beside it borrows no failure
    assert main(["cfd", str(beside), "--ranks", "1", "--work", str(tmp_path / "w2"), "--quiet"]) == 1
    assert [r["iterations"] for r in rows_of(beside.parent)] == ["0", "0"]
    file.write_text(sound)
    assert main(["cfd", str(beside), "--ranks", "1", "--work", str(tmp_path / "w2"), "--quiet"]) == 0
    assert [(r["rpm"], r["converged"]) for r in rows_of(beside.parent)] == [("6000", "1"), ("9000", "1")]
    for other in beside.parent.iterdir():  # else its result would be taken over
        other.unlink()
    assert main([*command, *again]) == 0
    (row,) = rows_of(path.parent)
    assert (row["converged"], row["iterations"], row["note"]) == ("1", "30", "ok")
    assert json.loads((path.parent / "manifest.json").read_text())["not_converged"] == []
    assert main(command) == 0 and not tree(work), "the logs of the failure go once it has run"


def test_a_run_that_drifts_is_nan_flagged_and_its_history_kept(project: Path, tmp_path: Path, programs: Path) -> None:
    solver = tmp_path / "bin" / "simpleFoam"
    solver.write_text(f"#!/bin/sh\n{PROGRAMS['simpleFoam'].replace('DRIFT', '0.2').replace('LEAK', '0')}\n")
    path = write(tmp_path / "c", project, TWO)
    record = run_campaign(load_campaign(path), tmp_path / "w", only=1, ranks=1)
    (row,) = record.rows
    assert row.converged == 0 and math.isnan(row.thrust_N) and math.isnan(row.u_thrust_N)
    assert row.drift_thrust == pytest.approx(0.18, abs=0.02)
    (history,) = (path.parent / "histories").iterdir()
    assert len(history.read_text().splitlines()) == 31
    manifest = json.loads((path.parent / "manifest.json").read_text())
    assert [item["run"] for item in manifest["not_converged"]] == [row.run]
    solver.write_text("#!/bin/sh\necho 'FOAM FATAL ERROR: negative' ; exit 1\n")
    record = run_campaign(load_campaign(path), tmp_path / "w2", only=2, ranks=1)
    assert [r.converged for r in record.rows] == [0, 0] and len(record.rows) == 2


def test_a_run_that_leaks_is_nan_flagged_and_says_where(project: Path, tmp_path: Path, programs: Path) -> None:
    """The planted leak: mass made where the periodic sides are cut differently."""
    solver = tmp_path / "bin" / "simpleFoam"
    sound = solver.read_text()
    solver.write_text(f"#!/bin/sh\n{PROGRAMS['simpleFoam'].replace('DRIFT', '0').replace('LEAK', '0.11')}\n")
    path, work = write(tmp_path / "c", project, TWO.replace("[6000, 9000]", "[6000]")), tmp_path / "w"
    command = ["cfd", str(path), "--ranks", "1", "--work", str(work), "--quiet"]
    assert main(command) == 1
    (row,) = rows_of(path.parent)
    assert (row["converged"], row["thrust_N"], row["u_thrust_N"]) == ("0", "", "")
    assert float(row["balance_mass"]) > 0.1 and "side1 and side2" in row["note"]
    manifest = json.loads((path.parent / "manifest.json").read_text())
    assert manifest["balance"][row["run"]]["mass"] == pytest.approx(float(row["balance_mass"]))
    assert [item["run"] for item in manifest["not_converged"]] == [row["run"]]
    assert main(command) == 1 and calls(programs, "simpleFoam") == 0, "it has been run: it will leak again"
    (path.parent / "recording.csv").unlink()
    solver.write_text(sound.replace("surface momentum U side2", ": # "))  # a function object that wrote nothing
    assert main(command) == 1
    (row,) = rows_of(path.parent)
    assert (row["converged"], row["thrust_N"], row["balance_mass"]) == ("0", "", "")
    assert "U_patch_side2.raw" in row["note"]
    manifest = json.loads((path.parent / "manifest.json").read_text())
    assert manifest["balanced"] == 0 and manifest["balance"][row["run"]].startswith("not recorded")


def test_a_recording_that_is_not_ours_is_left_alone(project: Path, tmp_path: Path) -> None:
    path = write(tmp_path / "c", project, TWO)
    (path.parent / "recording.csv").write_text("rpm,thrust_N\n1,2\n")
    with pytest.raises(InputError, match="another header"):
        CampaignRecord(load_campaign(path))
    (path.parent / "recording.csv").write_text(",".join(COLUMNS) + "\nabc,1\n")
    with pytest.raises(InputError, match="a line cut short"):
        CampaignRecord(load_campaign(path))


def test_a_run_that_a_campaign_beside_has_is_taken_over(project: Path, tmp_path: Path, programs: Path) -> None:
    first = load_campaign(write(tmp_path / "all" / "a", project, TWO))
    second = load_campaign(write(tmp_path / "all" / "b", project, TWO.replace("[6000, 9000]", "[9000]")))
    run_campaign(first, tmp_path / "w", ranks=1)
    record = run_campaign(second, tmp_path / "w", ranks=1)
    assert calls(programs, "simpleFoam") == 2 and [row.rpm for row in record.rows] == [9000]
    found = record.rows[0].balance_mass
    path = first.path.parent / "recording.csv"  # as if it had been made before the balance was checked
    path.write_text(path.read_text().replace(f",{float(found):.7g},", ",,"))
    (second.path.parent / "recording.csv").unlink()
    assert any(math.isnan(old.balance_mass) for old in CampaignRecord(first).rows)
    run_campaign(second, tmp_path / "w", ranks=1)
    assert calls(programs, "simpleFoam") == 3, "it does not count as evidence: it is run"


def row(level: float, thrust: float, **more: Any) -> RunRow:
    base = {"rpm": 9000.0, "airspeed_m_s": 0.0, "solver": "incompressible", "gas": "", "converged": 1.0}
    cells = 1e4 * 8 ** (level - 5)
    return RunRow(**{**base, "level": level, "cells": cells, "thrust_N": thrust, "torque_Nm": 0.02 * thrust, **more})


def test_three_levels_make_a_grid_study() -> None:
    """Values of a scheme of second order: the order, the limit and the uncertainty of every level come out."""
    sizes = {level: 2.0 ** (-(level - 5)) for level in (4.5, 5.0, 5.5, 6.0)}
    rows = [row(level, 20.0 + 2.0 * h**2) for level, h in sizes.items()] + [row(5.0, 30.0, airspeed_m_s=9.0)]
    (study,) = grid_studies(rows)
    found = study.thrust_N
    assert study.levels == (6.0, 5.5, 5.0) and study.ratios == pytest.approx([math.sqrt(2)] * 2)
    assert found.order == pytest.approx(2.0) and found.extrapolated == pytest.approx(20.0) and not found.flags
    assert len(found.values) == 3
    for level, h in sizes.items():
        assert found.u_relative[f"{level:g}"] >= 2.0 * h**2 / (20.0 + 2.0 * h**2), "covers the distance to the limit"
    assert grid_uncertainty([study], row(5.0, 7.0))["thrust_N"] == found.u_relative["5"]
    assert grid_uncertainty([study], row(4.0, 7.0)) == {}


def test_a_flow_is_scaled_to_another_speed() -> None:
    """Velocities with the speed, pressures with its square, the wind of the new run far away."""
    U = np.array([[1.0, 2.0, -3.0], [0.0, 0.0, -5.0]])
    head = b"FoamFile\n{\n    format binary;\n}\ninternalField   nonuniform List<"
    source = head + b"vector> \n2\n(" + U.tobytes() + b")\n;\nboundaryField {}"
    target = b"FoamFile\n{\n    format ascii;\n}\ninternalField uniform (0 0 -8);\nboundaryField {a}"
    old, new = StartField(1000.0, (0.0, 0.0, -5.0), 0.0, False), StartField(2000.0, (0.0, 0.0, -8.0), 0.0, False)
    made = splice("U", source, target, old, new)
    assert made is not None and made.endswith(b"boundaryField {a}") and b"format binary;" in made
    values = np.frombuffer(made.split(b"2\n(", 1)[1][: U.nbytes]).reshape(2, 3)
    assert values == pytest.approx(2 * U + np.array([0.0, 0.0, 2.0]))  # far away: 2 (-5) + 2 = -8
    p = np.array([10.0, -4.0])
    source = head + b"scalar> \n2\n(" + p.tobytes() + b")\n;\n"
    made = splice("p", source, b"internalField uniform 0;\n", old, new)
    assert made is not None and np.frombuffer(made.split(b"2\n(", 1)[1][:16]) == pytest.approx(4 * p)
    assert splice("p", source, target, old, StartField(2000.0, (0.0, 0.0, 0.0), 1e5, True)) is None
    assert splice("U", source[:-10], target, old, new) is None and splice("T", source, target, old, new) is None


def test_loads_along_the_radius_add_up(project: Path, tmp_path: Path) -> None:
    campaign = load_campaign(write(tmp_path / "c", project, TWO))
    settings = point_key(campaign.points[0])[2]
    folder = tmp_path / "postProcessing" / "radial" / "0"
    folder.mkdir(parents=True)
    bins = np.linspace(1.0, 2.0, 24)
    for file, values in (("forceBin.dat", bins), ("momentBin.dat", -0.01 * bins)):
        cells = " ".join(f"(0 0 {v:.9g}) (0 0 {v:.9g}) (0 0 0)" for v in values)
        (folder / file).write_text(
            f"# bins  : 24\n# start         : 0.02\n# delta         : 0.003\n# Time\n30 {cells}\n"
        )
    table = radial_of(tmp_path, settings, 10)
    assert table is not None
    assert table[:, 0] == pytest.approx(0.02 + 0.003 * (np.arange(24) + 0.5))
    assert (table[:, 1] * 0.003).sum() == pytest.approx(2 * bins.sum())
    assert (table[:, 2] * 0.003).sum() == pytest.approx(2 * 0.01 * bins.sum())


def test_the_committed_campaigns_are_whole(project: Path) -> None:
    """Every run is the one that campaign and case ask for now (its key), and what is missing is said."""
    found = sorted((project / "reports" / "cfd").glob("*/campaign.toml"))
    assert found
    for path in found:
        campaign = load_campaign(path)
        manifest = json.loads((path.parent / "manifest.json").read_text())
        order = [point_key(point)[0] for point in campaign.points]
        rows = {row["run"]: row for row in rows_of(path.parent)}
        assert set(rows) <= set(order), f"{path.parent.name}: runs of other settings"
        assert set(manifest["missing"]) == set(order) - set(rows)
        assert set(manifest["balance"]) == set(rows), f"{path.parent.name}: neither a balance nor why there is none"
        shown = 0
        for run, found in manifest["balance"].items():
            if rows[run]["converged"] == "1" and not isinstance(found, str):
                residuals = [found[key] for key in ("mass", "momentum", "angular_momentum")]
                assert all(value is None or abs(value) <= BALANCE_LIMIT for value in residuals), run
                shown += 1
        assert manifest["balanced"] == shown
        for run, values in rows.items():
            assert (values["converged"] == "1") == bool(re.match(r"\d", values["thrust_N"])), run
            if values["converged"] != "1":
                assert (path.parent / "histories" / f"{run}.csv").is_file() or values["iterations"] == "0"
    total = sum(p.stat().st_size for p in (project / "reports" / "cfd").rglob("*") if p.is_file())
    assert total < 2e6


RHO, OMEGA = 1.225, 600.0


def planted(folder: Path, leak: float = 0.0, twist: float = 0.0, push: float = 0.0) -> dict[str, float]:
    """Function objects of half a rotor in a flow that balances, but for what is planted (shares of flow and loads).

    `leak` is made at side2 near z = -0.05 m, `twist` is swirl that side2 gives and side1 does not take, `push` is force
    that no momentum answers.
    """
    post = folder / "postProcessing"
    thrust, torque, flow, radius = 5.0, 0.1, 0.3, 0.05  # of half the rotor
    jet, swirl = thrust / (RHO * flow), torque / (RHO * flow * radius)
    out, near = flow * (1 + leak), -0.05
    faces = {
        "inlet": [((radius, 0, 1), -flow, (0, 0, 0))],
        "outlet": [((radius, 0, -1), 0.25 * out, (0, swirl, -jet / (1 + leak))),
                   ((0, radius, -1), 0.75 * out, (-swirl, 0, -jet / (1 + leak)))],
        "side": [((1, 0, 0), 0.0, (3, 2, 1))],
        "side1": [((0, -radius, near), -0.5, (swirl, 0, -jet)), ((0, -1, 0.9), -0.2, (0, 0, 0))],
        "side2": [((0, radius, near), 0.5 - leak * flow, (-swirl * (1 + twist), 0, -jet)),
                  ((0, 1, 0.9), 0.2, (0, 0, 0))],
    }  # fmt: skip
    times = range(310, 401, 10)

    def put(name: str, file: str, lines: list[str]) -> None:
        (post / name / file).parent.mkdir(parents=True, exist_ok=True)
        (post / name / file).write_text("\n".join(["# head", *lines]) + "\n")

    for patch, rows in faces.items():
        for kind, field in (("mass", "phi"), ("momentum", "U")):
            put(f"{kind}_{patch}", "0/surfaceFieldValue.dat", [f"{t} 0" for t in times])
            lines = [" ".join(map(str, (*x, *((flux,) if field == "phi" else U)))) for x, flux, U in rows]
            for t in times:
                put(f"{kind}_{patch}", f"surface/{t}/{field}_patch_{patch}.raw", lines)
    for name, force, moment, at in (("forces", thrust * (1 + push), -torque, range(1, 401)), ("open", 0.0, 0.0, times),
                                    ("sides", 0.0, 0.0, times)):  # fmt: skip
        for file, value in (("force.dat", force), ("moment.dat", moment)):
            put(name, f"0/{file}", [f"{t} (0 0 {value}) (0 0 {value}) (0 0 0)" for t in at])
    disk = RHO * math.pi * 0.1016**2 * math.sqrt(2 * thrust / (2 * RHO * math.pi * 0.1016**2))
    return {"mass": 2 * RHO * leak * flow / disk, "angular_momentum": -0.5 / flow * twist, "momentum": push}


def half_rotor(project: Path, tmp_path: Path) -> Any:
    text = "[[points]]\nrpm = 20000\nsolver = 'incompressible'\n"
    return point_key(load_campaign(write(tmp_path / "c", project, text)).points[0])[2]


@pytest.mark.parametrize("size", [0.0, 0.004, -0.05, 0.11])
@pytest.mark.parametrize("kind", ["leak", "twist", "push"])
def test_a_planted_leak_is_found_with_its_size_and_place(project: Path, tmp_path: Path, kind: str, size: float) -> None:
    s = half_rotor(project, tmp_path)
    expected = planted(tmp_path, **{kind: size})
    found = balance_of(tmp_path, s)
    assert found.mass == pytest.approx(expected["mass"], abs=1e-9)
    if kind == "push":
        assert found.momentum == pytest.approx(size / (1 + size), abs=1e-9)
    if kind == "twist":
        assert found.angular_momentum == pytest.approx(s.rotation * expected["angular_momentum"], abs=1e-9)
    assert (not found.leaks) is (abs(size) < 0.005)
    if found.leaks:
        where = "inside" if kind == "push" else "side1 and side2, most at z = -0.5 to -0.4 R"
        assert any(where in leak for leak in found.leaks), found.leaks


def test_files_of_a_balance_that_are_absent_or_cut_short_are_all_named(project: Path, tmp_path: Path) -> None:
    s = half_rotor(project, tmp_path)
    planted(tmp_path)
    post = tmp_path / "postProcessing"
    (post / "mass_side1" / "surface" / "350" / "phi_patch_side1.raw").unlink()
    (post / "momentum_outlet" / "surface" / "400" / "U_patch_outlet.raw").write_text("# U\n0.05 0 -1 0 nan 2\n")
    (post / "sides" / "0" / "moment.dat").unlink()
    lines = (post / "open" / "0" / "force.dat").read_text().splitlines()
    (post / "open" / "0" / "force.dat").write_text("\n".join(lines[:4]) + "\n")
    with pytest.raises(InputError) as error:
        balance_of(tmp_path, s)
    told = str(error.value)
    for words in ("phi_patch_side1.raw", "U_patch_outlet.raw", "sides/0/moment.dat", "3 of 10 iterations"):
        assert words in told
    with pytest.raises(InputError, match="mass_inlet"):
        balance_of(tmp_path / "nothing", s)


def test_beside_a_run_stands_the_rotor_of_that_run(project: Path, tmp_path: Path) -> None:
    """Gap as in the grid; vanes only where the sector holds them."""
    for name in ("ds30_spinner", "ds30_vanes"):
        shutil.copytree(project / "reports" / "cfd" / name, tmp_path / name)
    bare, vaned = (c.rows for c in summary(tmp_path).campaigns)
    thrust = {
        (name, row.run.tip_gap_mm > 0.1): row.bemt_thrust_N
        for name, rows in (("bare", bare), ("vaned", vaned))
        for row in rows
    }
    for name in ("bare", "vaned"):
        assert thrust[name, False] > thrust[name, True] + 0.5
    for gap in (False, True):
        assert thrust["vaned", gap] > thrust["bare", gap] + 2.0


def test_beside_a_run_in_oblique_wind_stands_the_rotor_in_that_wind(project: Path) -> None:
    """Wind from the side adds thrust to that at the same speed along the shaft."""
    campaign = load_campaign(project / "reports" / "cfd" / "prop_8x5_skew")
    with (campaign.path.parent / "recording.csv").open(encoding="utf-8") as file:
        row = next(r for r in csv.DictReader(file) if r["sideslip_deg"] == "60")
    oblique = run_of(row)
    along = replace(oblique, sideslip_deg=0.0, airspeed_m_s=0.5 * oblique.airspeed_m_s)
    bemt = Bemt()
    assert bemt.solve(campaign, oblique).T[0] > 1.02 * bemt.solve(campaign, along).T[0]
