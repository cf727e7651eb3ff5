"""The promise of the OpenFOAM writer: dictionaries parse and agree, right factors, a run."""

from __future__ import annotations

import csv
import hashlib
import math
import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.rotors.case import load_case
from bemt.tools.cfd.openfoam import Body, RunSweep, Settings, case_files
from bemt.tools.cfd.openfoam.grid import MEAN_Y_PLUS, extent, first_cell, mrf_zone, y_plus
from bemt.tools.cfd.openfoam.grid import cells as cells_of
from bemt.tools.cfd.openfoam.write import Run, settings_of, write_openfoam
from bemt.tools.cfd.worker import history_of
from geometry.mesh import Options
from geometry.solid import plan_stator

COARSE = Options(n=41, segments=48)
TOKEN = re.compile(r'"[^"]*"|[{}();]|[^\s{}();"]+(?:\([^\s;]*\))?')


def settings(**changes: Any) -> Settings:
    """Two-bladed propeller of 0.2 m at 12,000 rev/min."""
    base: dict[str, Any] = {
        "R": 0.1, "Rhub": 0.015, "B": 2, "rotation": 1, "rotor": Body(-0.008, 0.008, 0.1),
        "blades": RunSweep(-0.007, 0.007, -0.001, 0.002, 0.05), "rpm": 12000.0, "rho": 1.225, "mu": 1.79e-5,
        "a_sound": 340.3, "temperature": 288.15,
    }  # fmt: skip
    return Settings(**{**base, **changes})


DUCT = {"duct": Body(-0.05, 0.03, 0.115), "gap": 0.001, "surfaces": ("blade", "hub", "duct")}
KINDS: dict[str, dict[str, Any]] = {
    "half": {}, "half of four": {"B": 4}, "full": {"sector": "full"}, "one of three": {"B": 3, "sector": "blade"},
    "one of five": {"B": 5, "sector": "blade"}, "one of eleven in a duct": {"B": 11, "sector": "blade", **DUCT},
    "pipe": {"domain": "pipe"}, "plate": {"plate_z": -0.1, "plate_radius": 0.2}, "flight": {"V": 15.0},
    "duct": DUCT, "oblique": {"V": 15.0, "sideslip": 0.5, "sector": "full"}, "compressible": {"compressible": True},
    "compressible flight": {"compressible": True, "V": 15.0, "gas": "perfect"},
    "k-epsilon": {"turbulence": "realizableKE"}, "pipe in flight": {"domain": "pipe", "V": 5.0},
}  # fmt: skip


def without_comments(text: str) -> str:
    return re.sub(r"//[^\n]*", "", text)


def parse(text: str) -> dict[str, Any]:
    """Read a dictionary: mappings, lists, texts. Refuses what does not balance."""
    tokens = TOKEN.findall(re.sub(r"^#.*$", "", without_comments(text), flags=re.M))
    assert tokens, "an empty file"
    at = 0

    def items(end: str) -> list[Any]:
        nonlocal at
        out: list[Any] = []
        while at < len(tokens) and tokens[at] != end:
            token = tokens[at]
            at += 1
            assert token not in "})", f"{token} without its opening"
            if token == "(":
                out.append(items(")"))
            elif token == "{":
                out.append(mapping(items("}")))
            else:
                out.append(token)
        assert at < len(tokens) or not end, f"{end} is missing"
        at += 1
        return out

    def mapping(parts: list[Any]) -> dict[str, Any]:
        out: dict[str, Any] = {}
        words: list[Any] = []
        for part in parts:
            if part == ";" or isinstance(part, dict):
                words += [part] if isinstance(part, dict) else []
                if words:
                    value = words[1:] if len(words) > 2 else words[-1]
                    assert words[0] not in out, f"{words[0]} twice"
                    out[words[0]] = value
                words = []
            else:
                words.append(part)
        assert not words or isinstance(words[-1], list), f"no semicolon after {words}"
        return out

    return mapping([*items(""), ";"])


def mesh_patches(files: dict[str, str], s: Settings) -> set[str]:
    """Patches that the finished grid has."""
    boundary = parse_list(files["system/blockMeshDict"], "boundary")
    names = {name for name in boundary if isinstance(name, str)}
    snappy = parse(files["system/snappyHexMeshDict"])
    names |= set(snappy["castellatedMeshControls"]["refinementSurfaces"])
    created = re.findall(r"^\s*name (\w+);", files["system/createPatchDict"], re.M)
    used = re.findall(r"patches \((\w+)\);", files["system/createPatchDict"])
    assert set(used) <= names
    return names - set(used) | set(created)


def parse_list(text: str, key: str) -> list[Any]:
    """Top-level list that follows a word."""
    body = without_comments(text).split(f"\n{key}\n", 1)[1]
    depth, end = 0, 0
    for k, letter in enumerate(body):
        depth += {"(": 1, ")": -1}.get(letter, 0)
        if letter == ")" and depth == 0:
            end = k
            break
    inner = body[body.index("(") + 1 : end]
    if key == "boundary":
        return re.findall(r"^    (\w+)$", inner, re.M)
    return [list(map(float, row.split())) for row in re.findall(r"^\s*\(([^()]*)\)$", inner, re.M)]


@pytest.mark.parametrize("kind", KINDS)
def test_every_dictionary_parses_and_names_patches_that_exist(kind: str) -> None:
    s = settings(**KINDS[kind])
    files = case_files(s)
    patches = mesh_patches(files, s)
    for name, text in files.items():
        if name not in ("Allrun", "constant/triSurface/lines.obj", "system/blockMeshDict"):
            assert parse(text)["FoamFile"]["object"] == Path(name).name
    fields = [name for name in files if name.startswith("0.orig/")]
    assert {"0.orig/U", "0.orig/p", "0.orig/k", "0.orig/nut"} < set(fields)
    for name in fields:
        assert set(parse(files[name])["boundaryField"]) - {'"proc.*"'} == patches, name
    functions = parse(files["system/controlDict"])["functions"]
    for entry in functions.values():
        assert set(entry.get("patches", [])) <= patches
    turning = parse(files["constant/MRFProperties"])["rotor"]
    standing = turning["nonRotatingPatches"]
    assert set(standing) <= patches and not {"blade", "hub"} & set(standing)
    assert {"side1", "side2"} & patches <= set(standing)  # else nothing flows through them where the grid turns
    assert float(turning["omega"]) == pytest.approx(12000 * math.pi / 30, rel=1e-6)
    needed = {"p", "U", "k", "nut", "epsilon" if s.turbulence == "realizableKE" else "omega"}
    needed |= {"T", "alphat"} if s.compressible else set()
    assert {Path(name).name for name in fields} == needed
    for field in needed - {"nut", "alphat", "p", "T"}:
        assert f"div(phi,{field})" in parse(files["system/fvSchemes"])["divSchemes"]


@pytest.mark.parametrize("kind", KINDS)
def test_no_path_of_a_machine_and_no_unfilled_word(kind: str) -> None:
    for name, text in case_files(settings(**KINDS[kind])).items():
        found = set(re.findall(r"(?<![\w.*}$)])/[a-zA-Z][\w/.]*", without_comments(text)))
        script = {"/bin/bash", "/usr/share/openfoam", "/dev/null", "/bin/sh", "/nan"}
        assert found <= (script if name == "Allrun" else set())
        assert not re.search(r"@[A-Z]+@", text)
        assert name == "Allrun" or not re.search(r"\b(nan|inf|None)\b", text)


@pytest.mark.parametrize("kind", KINDS)
def test_base_grid_closes(kind: str) -> None:
    """Every face of a block is shared by two blocks or lies in exactly one patch; blocks fill the sector."""
    s = settings(**KINDS[kind])
    text = case_files(s)["system/blockMeshDict"]
    vertices = np.array(parse_list(text, "vertices"))
    hexes = [list(map(int, row.split())) for row in re.findall(r"hex \(([\d ]+)\)", text)]
    corners = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (2, 3, 7, 6), (0, 4, 7, 3), (1, 2, 6, 5)]
    count: dict[frozenset[int], int] = {}
    volume = 0.0
    for h in hexes:
        for c in corners:
            face = frozenset(h[i] for i in c)
            count[face] = count.get(face, 0) + 1
            for tri in ((c[0], c[1], c[2]), (c[0], c[2], c[3])):
                volume += float(np.linalg.det(vertices[[h[i] for i in tri]])) / 6
    patches = [frozenset(map(int, row.split())) for row in re.findall(r"^ {12}\(([\d ]+)\)$", text, re.M)]
    assert len(patches) == len(set(patches))
    assert {face for face, n in count.items() if n == 1} == set(patches) and max(count.values()) == 2
    low, high = vertices[:, 2].min(), vertices[:, 2].max()
    radius = np.hypot(vertices[:, 0], vertices[:, 1]).max()
    chords = len(re.findall(r"^    arc ", text, re.M)) / 2
    half = math.pi / s.sectors / chords  # the blocks' chords instead of their arcs
    assert volume == pytest.approx(chords * radius**2 * math.sin(half) * math.cos(half) * (high - low), rel=1e-6)
    if s.sectors > 1:  # one side turned by the angle of a sector is the other
        turn = 2 * math.pi / s.sectors
        parts = re.findall(r"    periodic\d\n(.*?\n    \})", text, re.S)
        rows = [re.findall(r"^ {12}\(([\d ]+)\)$", part, re.M) for part in parts]
        sides = [{int(i) for row in part for i in row.split()} for part in rows]
        a, b = (vertices[sorted(side)] for side in sides)
        c, d = math.cos(turn), math.sin(turn)
        moved = np.column_stack([c * a[:, 0] - d * a[:, 1], d * a[:, 0] + c * a[:, 1], a[:, 2]])
        away = np.linalg.norm(moved[:, None] - b[None], axis=2)
        assert away.min(axis=1).max() < 1e-6 * radius and away.min(axis=0).max() < 1e-6 * radius
    assert re.search(r"rotationAngle ([\d.]+);", case_files(s)["system/createPatchDict"]) or s.sectors == 1


def test_cells_scale_with_the_level_alone() -> None:
    """Half a level more is a grid whose cells are all smaller by sqrt(2): what a grid study asks for."""
    coarse, fine = settings(level=5.0), settings(level=5.5)
    assert coarse.base_cell / fine.base_cell == pytest.approx(math.sqrt(2))
    a, b = (parse(case_files(s)["system/snappyHexMeshDict"])["castellatedMeshControls"] for s in (coarse, fine))
    assert a == b
    assert settings(level=6.0).base_cell / 2**6 == pytest.approx(0.1 / 2**8)


@pytest.mark.parametrize("name", ["prop_8x5_grid", "prop_8x5_rest", "prop_10x5", "prop_12x6", "prop_14x8"])
def test_cells_and_y_plus_are_told_before_the_grid_is_made(name: str, project: Path) -> None:
    """Within what the committed runs of open rotors at rest had."""
    case = load_case(project / "cases" / ("prop_8x5" if "8x5" in name else name))
    chord = float(case.rotor().blade.at(0.75 * case.diameter_m / 2)[0])
    with (project / "reports" / "cfd" / name / "recording.csv").open() as stream:
        rows = [row for row in csv.DictReader(stream) if row["yplus_avg"] and row["sector"] == "half"]
    assert rows
    for row in rows:
        run = Run(rpm=float(row["rpm"]), airspeed_m_s=0.0, level=float(row["level"]))
        s, shapes = settings_of(case, run)
        assert cells_of(s) == pytest.approx(float(row["cells"]), rel=0.25)
        assert MEAN_Y_PLUS[0] <= float(row["yplus_avg"]) / y_plus(s, chord) <= MEAN_Y_PLUS[1]
        assert any("expected grid: about" in note and "y+ near" in note for note in shapes.notes)


def test_the_first_cell_halves_with_a_level_and_a_duct_has_no_count() -> None:
    plain, fine = settings(), settings(level=settings().level + 1.0)
    assert first_cell(plain) == pytest.approx(2.0 * first_cell(fine)) == pytest.approx(plain.R / 2 ** (plain.level + 2))
    assert y_plus(plain, 0.02) == pytest.approx(2.0 * y_plus(fine, 0.02))
    assert math.isnan(cells_of(settings(domain="pipe"))) and cells_of(plain) > 0.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sector": "blade"}, "three blades or more"), ({"B": 3}, "an even number"), ({"V": -1.0}, "0 or more"),
        ({"sideslip": 0.3, "V": 5.0}, "full"), ({"sideslip": 0.3, "sector": "full"}, "a positive speed"),
        ({"level": 20.0}, "4 to 9"), ({"plate_z": 0.1}, "behind all else"), ({"average": 900}, "1 to 400"),
        ({"domain": "pipe", "plate_z": -0.1}, "a rotor alone"), ({"turbulence": "laminar"}, "one of kOmegaSST"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        settings(**changes)


def fake_programs(folder: Path) -> dict[str, str]:
    folder.mkdir()
    for name in ("blockMesh", "snappyHexMesh", "simpleFoam", "rhoSimpleFoam"):
        path = folder / name
        path.write_text("#!/bin/sh\nexit 0\n")
        path.chmod(0o755)
    return {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}", "NP": "1"}


def write_forces(folder: Path, Fz: np.ndarray, Mz: np.ndarray, word: str = "") -> None:
    target = folder / "postProcessing" / "forces" / "0"
    target.mkdir(parents=True, exist_ok=True)
    for file, title, values in (("force.dat", "Force", Fz), ("moment.dat", "Moment", Mz)):
        rows = [
            f"{k}\t(1.0 2.0 {v:.9e})\t(0.5 1.0 {0.5 * v:.9e})\t(0.5 1.0 {0.5 * v:.9e})" for k, v in enumerate(values, 1)
        ]
        head = "(total_x total_y total_z)\t(pressure_x pressure_y pressure_z)\t(viscous_x viscous_y viscous_z)"
        text = f"# {title}\n# CofR : (0 0 0)\n#\n# Time\t{head}\n" + "\n".join(rows) + "\n" + word
        (target / file).write_text(text)


@pytest.mark.skipif(shutil.which("awk") is None or shutil.which("bash") is None, reason="needs bash and awk")
@pytest.mark.parametrize(
    ("B", "sector", "rotation"), [(2, "half", 1), (2, "half", -1), (5, "blade", 1), (3, "full", -1)]
)
def test_thrust_and_torque_have_the_right_factor_and_sign(tmp_path: Path, B: int, sector: str, rotation: int) -> None:
    s = settings(B=B, sector=sector, rotation=rotation, iterations=40, average=10)
    (tmp_path / "case").mkdir()
    script = tmp_path / "case" / "Allrun"
    script.write_text(case_files(s)["Allrun"])
    script.chmod(0o755)
    thrust = np.concatenate([np.zeros(30), np.linspace(1.9, 2.1, 10)])
    write_forces(tmp_path / "case", thrust, np.full(40, -0.03 * rotation))  # the air turns the rotor back
    env = fake_programs(tmp_path / "bin")
    run = subprocess.run(["bash", str(script), "report"], capture_output=True, text=True, env=env, timeout=600)
    assert run.returncode == 0, run.stdout + run.stderr
    parts = {"half": 2, "blade": B, "full": 1}[sector]
    found = re.search(r"thrust (\S+) N \(drift (\S+) %\), torque (\S+) N m \(drift (\S+) %\)", run.stdout)
    assert found
    assert [float(x) for x in found.groups()] == pytest.approx([2.0 * parts, 10.0, 0.03 * parts, 0.0], abs=1e-6)
    table = history_of(tmp_path / "case", s)
    assert table[-1] == pytest.approx([40, 2.1 * parts, 0.03 * parts, 0.0])


@pytest.mark.skipif(shutil.which("awk") is None or shutil.which("bash") is None, reason="needs bash and awk")
@pytest.mark.parametrize(
    ("rows", "size", "word"), [(40, 1.0, "41 (nan 0 0) (0 0 0) (0 0 0)\n"), (40, 1e7, ""), (12, 1.0, "")]
)
def test_a_diverged_run_ends_in_an_error(tmp_path: Path, rows: int, size: float, word: str) -> None:
    script = tmp_path / "Allrun"
    script.write_text(case_files(settings(iterations=40, average=10))["Allrun"])
    write_forces(tmp_path, np.full(rows, size), np.full(rows, -0.1), word)
    env = fake_programs(tmp_path / "bin")
    run = subprocess.run(["bash", str(script), "report"], capture_output=True, text=True, env=env, timeout=600)
    assert run.returncode == 3 and "diverged" in run.stdout


def test_allrun_says_when_openfoam_is_absent(tmp_path: Path) -> None:
    script = tmp_path / "Allrun"
    script.write_text(case_files(settings())["Allrun"])
    bash = shutil.which("bash")
    assert bash is not None
    run = subprocess.run([bash, str(script)], capture_output=True, text=True, env={"PATH": ""}, timeout=600)
    assert run.returncode == 1 and "OpenFOAM is not installed" in run.stderr


@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
@pytest.mark.parametrize("step", ["mesh", "solve"])
@pytest.mark.parametrize("ranks", ["1", "2"])
def test_allrun_removes_what_a_run_left_and_nothing_else(tmp_path: Path, step: str, ranks: str) -> None:
    """The folder may be one that its owner keeps other things in, with digits at the start of their names."""
    case = tmp_path / "case"
    for name, text in case_files(settings()).items():
        (case / name).parent.mkdir(parents=True, exist_ok=True)
        (case / name).write_text(text)
    elsewhere = tmp_path / "elsewhere" / "U"
    mine = ["2024_bench/run.csv", "8x5.stl", "9", "2024/run.csv", "1.5 mm/a", "10 x/U", "0.orig/notes", "processor.txt",
            "processor_old/0/U", "processor0.md", "30-mesh/U", "-1/U"]  # fmt: skip
    stale = ["0/U", "400/U", "400/uniform/time", "500/p", "constant/polyMesh/points", "postProcessing/forces/0/x"]
    parts = ["processor0/0/U", "processor0/400/U", "processor1/400/U", "processor17/0/U"]
    for path in [elsewhere, *(case / name for name in [*mine, *stale, *parts])]:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("old")
    (case / "77").symlink_to(elsewhere.parent)
    env = fake_programs(tmp_path / "bin") | {"NP": ranks}
    for name in ("decomposePar", "topoSet", "createPatch", "checkMesh", "setFields", "mpirun"):
        (tmp_path / "bin" / name).write_text("#!/bin/sh\nexit 0\n")
        (tmp_path / "bin" / name).chmod(0o755)
    run = subprocess.run(["bash", str(case / "Allrun"), step], capture_output=True, text=True, env=env, timeout=600)
    assert run.returncode == (0 if step == "mesh" else 3) and "rm:" not in run.stderr, run.stdout + run.stderr
    for name in mine:
        assert (case / name).read_text() == "old", name
    assert (case / "77").is_symlink() and elsewhere.read_text() == "old"
    left = {name for name in [*stale, *parts] if (case / name).exists() and (case / name).read_text() == "old"}
    if step == "mesh":
        assert not left and not list(case.glob("processor[0-9]")), "the grid is new: neither times nor processors stay"
    else:
        times = {name for name in stale if name[0] in "045"} if ranks == "1" else {*parts}
        assert not left & (times | {stale[-1]}), "the old fields of the folders that are solved in"
        fresh = ["0"] if ranks == "1" else ["processor0/0", "processor1/0", "processor17/0"]
        for name in fresh:
            assert (case / name / "U").read_text() == (case / "0.orig" / "U").read_text()


def test_the_solver_follows_the_tip_mach_number(project: Path) -> None:
    case = load_case(project / "cases" / "prop_8x5")
    assert settings_of(case, Run(), COARSE)[0].compressible  # tip Mach number 0.63
    assert not settings_of(case, Run(rpm=12000), COARSE)[0].compressible
    assert not settings_of(case, Run(solver="incompressible"), COARSE)[0].compressible


def test_the_isentropic_gas_is_air_far_away() -> None:
    """Density and speed of sound of the equation of state at the far pressure are those of the settings."""
    s = settings(compressible=True)
    state = parse(case_files(s)["constant/thermophysicalProperties"])["mixture"]["equationOfState"]
    p0, rho0, gamma, B = (float(state[key]) for key in ("p0", "rho0", "gamma", "B"))
    assert rho0 == pytest.approx(1.225) and B == 0
    assert math.sqrt(gamma * p0 / rho0) == pytest.approx(340.3, rel=1e-3)
    far = parse(case_files(s)["0.orig/p"])["internalField"]
    assert float(far[1]) == pytest.approx(p0)


def test_a_sector_leaves_out_vanes_that_do_not_fit(project: Path, tmp_path: Path) -> None:
    case = load_case(project / "cases" / "ds30")
    manifest = write_openfoam(case, tmp_path / "fan", Run(), COARSE)
    assert manifest["openfoam"]["sectors"] == case.rotor().B and "left out" in " ".join(manifest["openfoam"]["notes"])
    stl = {path.stem for path in (tmp_path / "fan" / "constant" / "triSurface").glob("*.stl")}
    assert stl == {"blade", "hub", "duct", "centrebody"}
    listed = {item["path"]: item["sha256"] for item in manifest["files"]}
    for name in stl:
        path = f"constant/triSurface/{name}.stl"
        assert hashlib.sha256((tmp_path / "fan" / path).read_bytes()).hexdigest() == listed[path]
    s, _ = settings_of(case, Run(), COARSE)
    assert set(s.surfaces) == stl
    whole, _ = settings_of(case, Run(sector="full"), COARSE)
    assert "stator" in whole.surfaces


@pytest.mark.parametrize("rotation", ["right", "left"])
def test_vanes_of_a_sector_stand_still_and_turn_their_tails_with_the_swirl(project: Path, rotation: str) -> None:
    vanes = {"duct.stator.blades": 11, "duct.stator.chord_mm": 9.0, "rotor.rotation": rotation}
    case = load_case(project / "cases" / "ds30").replaced(vanes)
    s, parts = settings_of(case, Run(), COARSE)
    turned, _ = settings_of(case.replaced({"duct.stator.angle_deg": 13.0, "rotor.spinner_mm": 19.0}), Run(), COARSE)
    assert "stator" in s.surfaces and parts.tail is None and s.body is not None
    for each in (s, turned):
        assert each.body is not None and mrf_zone(each)[1] > each.body.high
    assert turned.rotor.high == pytest.approx(s.rotor.high + 0.019)
    assert turned.blades.high < mrf_zone(turned)[2] < turned.rotor.high + 0.15 * s.R
    duct = case.replaced({"duct.stator.angle_deg": 13.0}).duct()
    assert duct is not None
    plan = plan_stator(duct, -0.01, s.Rhub)
    assert plan is not None
    tangential, downstream = plan.outline(41).T
    tail, nose = tangential[np.argmax(downstream)], tangential[np.argmin(downstream)]
    assert np.sign(tail - nose) == s.rotation


def test_export_command_writes_a_case_beside_other_formats(project: Path, tmp_path: Path) -> None:
    out = tmp_path / "o"
    code = main(["export", str(project / "cases/prop_8x5"), "--out", str(out), "--format", "stl", "openfoam", "--level",
                 "5", "--rpm", "9000", "--airspeed-m-s", "4", "--domain", "pipe"])  # fmt: skip
    assert code == 0
    assert (out / "Allrun").stat().st_mode & 0o111 and (out / "prop_8x5.stl").is_file()
    assert parse((out / "0.orig" / "U").read_text())["boundaryField"]["inlet"]["type"] == "fixedValue"
    assert main(["export", str(project / "cases/prop_8x5"), "--out", str(tmp_path / "q"), "--format", "stl", "openfoam",
                 "--sector", "blade"]) == 2  # fmt: skip
    # one refused target refuses no other, and leaves nothing of its own
    assert (tmp_path / "q" / "prop_8x5.stl").is_file() and not (tmp_path / "q" / "Allrun").exists()


def test_oblique_wind_blows_from_ahead_and_aside() -> None:
    s = settings(V=10.0, sideslip=math.radians(30), sector="full")
    assert s.wind == pytest.approx((5.0, 0.0, -10.0 * math.cos(math.radians(30))))
    assert replace(s, sideslip=0.0).wind == pytest.approx((0.0, 0.0, -10.0))


def sections(text: str) -> list[tuple[float, int, float]]:
    """Sections of a block's edge: length, cells, last cell over first."""
    return [(float(a), int(b), float(c)) for a, b, c in re.findall(r"\(([^\s()]+) (\d+) ([^\s()]+)\)", text)]


def grid_stops(start: float, end: float, parts: list[tuple[float, int, float]]) -> np.ndarray:
    """Where the cells of an edge meet, as blockMesh has them: lengths count relative to their sum."""
    total, at, stops = sum(length for length, _, _ in parts), start, [start]
    for length, cells, ratio in parts:
        growth = ratio ** (1 / (cells - 1)) if cells > 1 else 1.0
        sizes = growth ** np.arange(cells)
        width = (end - start) * length / total
        stops += list(at + width * np.cumsum(sizes) / sizes.sum())
        at += width
    return np.array(stops)


@given(
    kind=st.sampled_from(sorted(KINDS)), level=st.floats(4.0, 9.0), R=st.floats(0.02, 2.0), deep=st.floats(0.05, 1.5),
    hub=st.floats(0.1, 0.5),
)  # fmt: skip
def test_the_rotating_zone_ends_on_the_base_grid(kind: str, level: float, R: float, deep: float, hub: float) -> None:
    """Else the two periodic sides are cut differently and make mass. Read from the text that OpenFOAM gets."""
    change = dict(KINDS[kind])
    size = R / 0.1
    for key in ("duct", "body"):
        if key in change:
            change[key] = Body(*(size * v for v in (change[key].low, change[key].high, change[key].radius)))
    change |= {key: size * change[key] for key in ("gap", "plate_radius") if key in change}
    rotor = Body(-0.08 * deep * R, 0.08 * R, R)
    if "plate_z" in change:
        change["plate_z"] = rotor.low - 0.3 * deep * R
    blades = RunSweep(rotor.low, rotor.high, -0.01 * R, 0.02 * R, 0.05)
    s = settings(**change, R=R, Rhub=hub * R, rotor=rotor, blades=blades, level=level)
    files = case_files(s)
    zone = re.search(r"p1 \(0 0 (\S+)\); p2 \(0 0 (\S+)\); radius (\S+);", files["system/topoSetDict"])
    assert zone is not None
    low, high, radius = map(float, zone.groups())
    assert low < rotor.low and rotor.high < high and radius > 0.998 * R
    text = files["system/blockMeshDict"]
    vertices = np.array(parse_list(text, "vertices"))
    grading = {row.split("simpleGrading (", 1)[1] for row in text.splitlines() if "simpleGrading" in row}
    ends = vertices[:, 2].min(), vertices[:, 2].max()
    for row in grading:
        stops = grid_stops(*ends, sections(row.split(" 1 (", 1)[1]))
        assert np.all(np.diff(stops) > 0)
        for end in (low, high):
            assert np.abs(stops - end).min() <= 1e-12 * max(1.0, R)
    if s.sectors == 1 or s.domain == "pipe":
        return  # no sides, or a zone wider than the domain
    inner, outer = sorted({float(r) for r in np.hypot(vertices[1:3, 0], vertices[1:3, 1])} | {0.0})[-1], extent(s)[0]
    rings = next((sections(row.split(" 1 (", 1)[0]) for row in grading if row.startswith("((")), [])
    radii = np.append(grid_stops(inner, outer, rings), inner) if rings else np.array([inner])
    assert np.abs(radii - radius).min() <= 1e-12 * max(1.0, R)


@pytest.mark.parametrize("kind", KINDS)
def test_a_grid_from_before_that_rule_can_be_made_again(kind: str) -> None:
    """Recorded runs stand on it: their names hang on this text."""
    s = settings(**KINDS[kind], zone="margin")
    text = case_files(s)["system/blockMeshDict"]
    (z,) = {row.split(" 1 (", 1)[1] for row in text.splitlines() if "simpleGrading" in row}
    assert len(sections(z)) == 3
    assert mrf_zone(s)[1] == pytest.approx(mrf_zone(replace(s, zone="grid"))[1], rel=1e-8)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("snappyHexMesh") is None, reason="OpenFOAM (Debian package openfoam) is not installed")
def test_the_exported_case_runs(project: Path, tmp_path: Path) -> None:
    """Smallest grid, static: a thrust that a propeller of that size can have (K1/K2 says 24 N)."""
    out = tmp_path / "case"
    assert main(["export", str(project / "cases/prop_8x5"), "--out", str(out), "--format", "openfoam", "--level", "4",
                 "--incompressible"]) == 0  # fmt: skip
    run = subprocess.run(["./Allrun"], cwd=out, capture_output=True, text=True, timeout=1800)
    assert run.returncode == 0, run.stdout + run.stderr
    found = re.search(r"thrust (\S+) N .*torque (\S+) N m", run.stdout)
    assert found is not None
    assert 10.0 < float(found[1]) < 40.0 and 0.15 < float(found[2]) < 0.8
