"""The promise of a printable rotor: thick enough, one closed body, the case's blade."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bemt.app.cli import main
from bemt.base.errors import InputError
from bemt.rotors.case import load_case
from bemt.rotors.case.propagate import propagate
from bemt.tools.design.rotor_loads import case_of_label
from bemt.tools.exports.base import Job
from bemt.tools.exports.folder import export_case
from bemt.tools.exports.printing import Print
from geometry.airfoil import naca4
from geometry.common import GeometryError
from geometry.export import read_solid
from geometry.laws import helix
from geometry.mesh import Options, build, wrapped_outline
from geometry.printed import ADAPTERS, Printed
from geometry.rotor import Rotor, from_stations
from geometry.slicing import find_rotor
from geometry.solid import Mesh, check_closed

LEAST = 8e-4
SWEPT = """schema = "bemt.case/1"
name = "swept"
[rotor]
blades = 2
diameter_in = 10
[blade]
pitch_in = 5
tip_sweep_mm = {sweep}
tip_rake_mm = {rake}
[operating]
rpm = 6000
"""


def rotor_of(sweep: float = 0.0, rake: float = 0.0, blades: int = 2, rotation: int = 1) -> Rotor:
    blade = helix(0.2, 0.12, anchors=naca4(0.04, 0.4, 0.09))
    grown = (np.clip(blade.r / blade.R - 0.3, 0.0, None) / 0.7) ** 2
    bent = from_stations(blade.r, blade.chord, blade.beta, blade.R, blade.Rhub, list(blade.anchors),
                         sweep=sweep * grown, rake=rake * grown)  # fmt: skip
    return Rotor(bent, blades, rotation)


def printed(rotor: Rotor, n: int = 41, **more: object):
    made = Printed(LEAST, **{**ADAPTERS["ring"], **more})  # type: ignore[arg-type]
    return build(rotor, options=Options(n=n, tolerance=2e-3, printed=made))


@pytest.fixture(scope="module", params=[(0.0, 0.0), (0.025, 0.01)], ids=["straight", "swept"])
def model(request: pytest.FixtureRequest):
    rotor = rotor_of(*request.param)
    return rotor, printed(rotor, 101)


def way_through(mesh: Mesh, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Length of rays straight in from random places of the blades, and r (Moeller and Trumbore)."""
    rng = np.random.default_rng(3)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    weight = area * (mesh.group == mesh.names.index("blade"))
    picked = rng.choice(len(area), count, p=weight / weight.sum())
    u = rng.random((count, 2))
    u = np.where(u.sum(axis=1, keepdims=True) > 1, 1 - u, u)
    origin = a[picked] + u[:, :1] * (b - a)[picked] + u[:, 1:] * (c - a)[picked]
    out = np.empty(count)
    for i, (start, k) in enumerate(zip(origin, picked, strict=True)):
        d = -normal[k] / area[k]
        p = np.cross(d, c - a)
        det = np.einsum("ij,ij->i", b - a, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = start - a
            v = np.einsum("ij,ij->i", s, p) / det
            q = np.cross(s, b - a)
            w = q @ d / det
            t = np.einsum("ij,ij->i", c - a, q) / det
        hit = (v >= 0) & (w >= 0) & (v + w <= 1) & (t > 1e-6)
        out[i] = t[hit].min()
    return out, np.hypot(origin[:, 0], origin[:, 1])


def test_no_place_of_the_blade_is_thinner_than_asked(model) -> None:
    rotor, made = model
    thick, r = way_through(made.rotor, 400)
    clear = r > rotor.Rhub * 1.002  # slivers where the flare meets the facets of the hub
    assert thick[clear].min() > 0.99 * LEAST
    assert made.checks["min_thickness"] >= LEAST
    assert LEAST <= made.checks["trailing_edge"] < 1.15 * LEAST
    thin = build(rotor, options=Options(n=61, tolerance=2e-3))
    assert way_through(thin.rotor, 200)[0].min() < 0.3 * LEAST, "the rotor of the sections is a knife"


def test_it_is_one_closed_body_of_the_volume_of_its_sections(model) -> None:
    rotor, made = model
    check_closed(made.rotor, "printed", bodies=1)
    assert made.checks["volume_rotor_mesh"] == pytest.approx(made.checks["volume_rotor_sections"], rel=2e-3)
    assert made.checks["tip_radius"] == pytest.approx(rotor.R, rel=1e-6)


def test_the_blade_is_read_back_outside_of_flare_and_round_tip(model) -> None:
    rotor, made = model
    found = find_rotor(made.rotor.vertices, made.rotor.faces)
    chord, beta = rotor.blade.at(found.r)
    tip = rotor.R - 0.5 * float(rotor.blade.at(rotor.R)[0])
    free = (found.r > rotor.Rhub + made.checks["flare"]) & (found.r < tip)
    assert free.sum() > 15 and (found.B, found.rotation) == (rotor.B, rotor.rotation)
    assert np.abs(found.chord / chord - 1)[free].max() < 0.01
    assert np.degrees(np.abs(found.beta - beta))[free].max() < 0.3


def test_the_tip_is_round_and_the_root_is_wider(model) -> None:
    rotor, made = model

    def span(r: float) -> float:
        curve = wrapped_outline(rotor.blade, r, made.options)
        return float(np.linalg.norm(curve[:, None] - curve[None], axis=-1).max())

    chord = float(rotor.blade.at(rotor.R)[0])
    rim = [span(rotor.R - x * chord) for x in (0.5, 0.3, 0.15, 0.02)]
    assert all(a > b for a, b in zip(rim, rim[1:], strict=False)) and rim[-1] < 0.8 * rim[0]
    assert span(rotor.Rhub) == pytest.approx(float(rotor.blade.at(rotor.Rhub)[0]) + made.checks["flare"], rel=0.02)


def test_holes_have_their_sizes() -> None:
    made = printed(rotor_of(), bore=6e-3, recess=(0.0, 0.0), hexagon=(10e-3, 5e-3))
    corners = made.rotor.vertices[np.unique(made.rotor.part("bore"))]
    rho, z = np.hypot(corners[:, 0], corners[:, 1]), corners[:, 2]
    back, front = made.rotor.vertices[:, 2].min(), z.max()
    inside = rho < 3.1e-3
    assert rho[inside] == pytest.approx(np.full(inside.sum(), 3e-3), rel=1e-3)
    assert rho.max() == pytest.approx(10e-3 / math.sqrt(3), rel=1e-3), "corners of the hexagon"
    assert z[~inside].max() - back == pytest.approx(5e-3, rel=1e-3) and front - back > 5e-3


def test_both_hands_are_mirror_images() -> None:
    right, left = (printed(rotor_of(0.01, 0.0, 3, sign)).rotor for sign in (1, -1))
    assert left.volume == pytest.approx(right.volume, rel=1e-6)
    mirrored = right.vertices * [1.0, -1.0, 1.0]
    for axis in range(3):
        ends = [(v[:, axis].min(), v[:, axis].max()) for v in (mirrored, left.vertices)]
        assert ends[0] == pytest.approx(ends[1], abs=2e-5)
    assert find_rotor(left.vertices, left.faces, stations=8).rotation == -1


@pytest.mark.parametrize(
    ("make", "where"),
    [
        (lambda: Printed(0.8), "min_thickness"), (lambda: Printed(8e-4, trailing_edge=5e-4), "trailing_edge"),
        (lambda: Printed(8e-4, bore=6e-3, recess=(5e-3, 3e-3)), "recess"),
        (lambda: Printed(8e-4, recess=(9e-3, 3e-3), hexagon=(8e-3, 3e-3)), "hexagon"),
        (lambda: printed(rotor_of(), bore=0.03, recess=(0.0, 0.0)), "bore"),
        (lambda: printed(rotor_of(), recess=(9e-3, 0.05)), "recess"),
        (lambda: printed(rotor_of(), min_thickness=5e-3), "chord|rotor|thickness"),
        (lambda: build(replace(rotor_of(), hub_length=4e-3), options=Options(printed=Printed())), "hub_length"),
    ],
)  # fmt: skip
def test_what_cannot_be_printed_is_refused_with_the_reason(make, where: str) -> None:
    with pytest.raises((GeometryError, TypeError)) as error:
        make()
    if isinstance(error.value, GeometryError):
        assert all(re.search(where, fault[0]) for fault in error.value.faults)


@pytest.mark.parametrize(("nozzle_mm", "least_mm", "wider"), [(None, 0.8, True), (0.25, 0.5, False)])
def test_the_propeller_that_most_people_print_is_one_body(nozzle_mm, least_mm, wider, tmp_path: Path) -> None:
    """A 5.1x4.3x3: with the usual nozzle its tip is widened and the cost said, with a fine one it stays."""
    case = case_of_label("5.1x4.3x3")
    request = Print(nozzle_mm=nozzle_mm, adapter="m5")
    made = export_case(Job(case, printed=request), tmp_path, ["stl"])
    assert made["checks_m"]["min_thickness"] >= 1e-3 * least_mm
    vertices, triangles, unit = read_solid(tmp_path / f"{case.name}.stl")
    assert made["files"][0]["surfaces"][0]["triangles"] == len(triangles)
    assert made["printed"]["hub_by_ratio_mm"] == pytest.approx(1e3 * 0.15 * case.diameter_m)
    body = Mesh(vertices, triangles, np.zeros(len(triangles), np.int64), ("x",))
    check_closed(body, "stl", bodies=1)
    blade = case.rotor().blade
    found = find_rotor(vertices * 1e-3, triangles)
    inside = (found.r > 0.4 * blade.R) & (found.r < 0.88 * blade.R)
    assert np.abs(found.chord / blade.at(found.r)[0] - 1.0)[inside].max() < 0.03
    assert ("tip_chord_mm" in made["printed"]) == wider
    if wider:
        assert made["printed"]["tip_chord_mm"][1] == pytest.approx(6.0 * least_mm, rel=0.01)
        assert 0.0 < made["printed"]["thrust_pct"] < made["printed"]["torque_pct"] < 5.0  # at the tip, drag costs most


def test_a_refusal_names_the_nozzle_that_would_do(tmp_path: Path) -> None:
    case = case_of_label("2x1x3")
    with pytest.raises(InputError) as error:
        export_case(Job(case, printed=Print(min_thickness_mm=1.6)), tmp_path, ["stl"])
    assert any("--nozzle-mm 0.25" in fault.hint for fault in error.value.faults)


def test_the_command_writes_both_hands_and_a_3mf_of_the_same_body(tmp_path: Path, project: Path) -> None:
    out = tmp_path / "made"
    words = ["export", str(project / "cases" / "prop_8x5"), "--out", str(out), "--printable", "--adapter", "m5",
             "--hand", "both", "--format", "stl", "3mf"]  # fmt: skip
    assert main(words) == 0
    names = {f.name for f in out.iterdir()}
    assert names == {"manifest.json", *(f"prop_8x5_{h}.{k}" for h in ("left", "right") for k in ("stl", "3mf"))}
    listed = {item["path"] for item in json.loads((out / "manifest.json").read_text())["files"]}
    assert listed == names - {"manifest.json"}
    text = zipfile.ZipFile(out / "prop_8x5_left.3mf").read("3D/3dmodel.model").decode()
    assert 'unit="millimeter"' in text
    points = np.array(re.findall(r'vertex x="(.*?)" y="(.*?)" z="(.*?)"', text), dtype=float)
    faces = np.array(re.findall(r'triangle v1="(\d+)" v2="(\d+)" v3="(\d+)"', text), dtype=int)
    packed = Mesh(points, faces, np.zeros(len(faces), np.int64), ("x",))
    check_closed(packed, "3mf", bodies=1)
    assert (out / "prop_8x5_left.stl").read_text().count("endsolid") == 1  # slicers take each for a part
    vertices, triangles, unit = read_solid(out / "prop_8x5_left.stl")
    other = Mesh(vertices, triangles, np.zeros(len(triangles), np.int64), ("x",))
    assert unit == "mm" and packed.volume == pytest.approx(other.volume, rel=1e-5)


@pytest.mark.parametrize(
    ("words", "hole", "turns", "hand"),
    [
        ([], "the hub is solid, without a hole for the shaft: --bore-mm 5, or --adapter ring, m3", "CCW", "right"),
        (["--bore-mm", "4", "--hand", "left"], "hole for the shaft: 4 mm\n", "hand: clockwise (CW) seen from", "left"),
        (["--adapter", "m5", "--hand", "both"], "5.2 mm; a hexagon for a nut in the back, 8.2 mm wide and 4.9 mm deep",
         "_right turns counterclockwise (CCW)", "both"),
    ],
)  # fmt: skip
def test_the_terminal_says_the_hole_for_the_shaft_and_the_hand(
    words: list[str], hole: str, turns: str, hand: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A hub without a hole fits no motor, and the wrong hand blows the wrong way."""
    out = tmp_path / "made"
    assert main(["export", "8x5", "--out", str(out), "--printable", "--format", "stl", *words]) == 0
    said = capsys.readouterr().out
    assert hole in said and turns in said
    told = json.loads((out / "manifest.json").read_text())["printed"]
    assert told["hand"] == hand
    for file in out.glob("*.stl"):
        vertices, _, _ = read_solid(file)  # mm
        least = np.hypot(vertices[:, 0], vertices[:, 1]).min()
        if "bore_mm" not in told:
            assert hole.startswith("the hub is solid")
        else:
            assert least == pytest.approx(0.5 * told["bore_mm"], rel=0.01)


@pytest.mark.parametrize("words", [["--bore-mm", "5"], ["--printable", "--format", "openfoam"],
                                   ["--printable", "--min-thickness-mm", "0.01"]])  # fmt: skip
def test_options_that_say_nothing_are_refused(words: list[str], tmp_path: Path, project: Path) -> None:
    case = str(project / "cases" / "prop_8x5")
    assert main(["export", case, "--out", str(tmp_path / "made"), *words]) == 2
    assert not (tmp_path / "made").exists()


def test_sweep_changes_the_shape_and_is_flagged_but_not_the_loads(tmp_path: Path) -> None:
    found = []
    for sweep in (0.0, 2.0, 25.0):
        file = tmp_path / f"s{sweep:g}" / "case.toml"
        file.parent.mkdir()
        file.write_text(SWEPT.format(sweep=sweep, rake=0.0))
        case = load_case(file)
        found.append((case, propagate(case, 6000.0, 0.0).points))
    (_, straight), (_, little), (swept, far) = found
    assert straight.thrust_N[0] == little.thrust_N[0] == far.thrust_N[0]
    assert [any("swept" in flag for flag in p.flags[0]) for p in (straight, little, far)] == [False, False, True]
    blade = swept.rotor().blade
    tip = blade.section_curve(blade.R)[:, 0].mean() - found[0][0].rotor().blade.section_curve(blade.R)[:, 0].mean()
    assert tip == pytest.approx(-0.025, rel=1e-6)


# The judges: programs that mesh and slice.

JUDGED = {"prop_8x5": "", "prop_14x8": "", "ds30": "", "10x4.5x3": "blades = 3", "swept": ""}


def case_file(name: str, project: Path, folder: Path) -> Path:
    if name in ("prop_8x5", "prop_14x8", "ds30"):
        return project / "cases" / name / "case.toml"
    text = SWEPT.format(sweep=20.0 if name == "swept" else 0.0, rake=8.0 if name == "swept" else 0.0)
    if name != "swept":
        text = text.replace("blades = 2", "blades = 3").replace("pitch_in = 5", "pitch_in = 4.5")
    (folder / "case.toml").write_text(text.replace('name = "swept"', f'name = "{name.replace(".", "_")}"'))
    return folder / "case.toml"


@pytest.mark.slow
@pytest.mark.parametrize("name", JUDGED)
def test_gmsh_meshes_the_slicer_slices_and_stations_reads_both_hands(name: str, project: Path, tmp_path: Path) -> None:
    gmsh, slicer = shutil.which("gmsh"), shutil.which("prusa-slicer")
    if not (gmsh and slicer):
        pytest.skip("gmsh and prusa-slicer are not installed")
    file = case_file(name, project, tmp_path)
    case, out = load_case(file), tmp_path / "out"
    words = ["export", str(file), "--out", str(out), "--printable", "--adapter", "ring", "--hand", "both",
             "--format", "stl", "step", "3mf"]  # fmt: skip
    assert main(words) == 0
    manifest = json.loads((out / "manifest.json").read_text())
    volume = manifest["volumes_m3"]["volume_rotor_mesh"] * 1e9
    for hand in ("right", "left"):
        stem = f"{case.name}_{hand}"
        mesh = tmp_path / f"{stem}.msh"
        done = subprocess.run([gmsh, "-3", "-v", "2", "-clmax", "3", "-format", "msh2", str(out / f"{stem}.step"),
                               "-o", str(mesh)], capture_output=True, text=True, timeout=600)  # fmt: skip
        assert done.returncode == 0 and "Error" not in done.stdout + done.stderr, done.stdout[-500:]
        assert tetrahedra(mesh) == pytest.approx(volume, rel=0.03)  # its facets of 3 mm cut round edges short
        for kind in ("stl", "3mf"):
            about = subprocess.run([slicer, "--info", str(out / f"{stem}.{kind}")], capture_output=True, text=True,
                                   timeout=300).stdout  # fmt: skip
            assert "manifold = yes" in about and "number_of_parts =  1" in about and "repaired" not in about, about
            assert float(re.search(r"volume = (\S+)", about)[1]) == pytest.approx(volume, rel=1e-3)  # type: ignore[index]
        gcode = tmp_path / f"{stem}.gcode"
        sliced = subprocess.run(
            [slicer, "--export-gcode", "--bed-shape", "0x0,400x0,400x400,0x400", "--layer-height", "0.25", "-o",
             str(gcode), str(out / f"{stem}.stl")], capture_output=True, text=True, timeout=900,
        )  # fmt: skip
        assert sliced.returncode == 0 and gcode.stat().st_size > 1e5, sliced.stderr[-500:]
        vertices, faces, _ = read_solid(out / f"{stem}.stl")
        found, blade = find_rotor(vertices * 1e-3, faces), case.rotor().blade
        tip = (0.1 if case.ducted else 0.5) * float(blade.at(blade.R)[0])
        free = (found.r > blade.Rhub + manifest["checks_m"]["flare"]) & (found.r < blade.R - tip)
        chord, beta = blade.at(found.r)
        assert found.rotation == (1 if hand == "right" else -1) and free.sum() > 15
        assert np.abs(found.chord / chord - 1)[free].max() < 0.01
        assert np.degrees(np.abs(found.beta - beta))[free].max() < 0.3


def tetrahedra(path: Path) -> float:
    """Volume of the tetrahedra of a Gmsh 2 file, each of which must be one. [unit of the file cubed]"""
    text = path.read_text()
    rows = text.split("$Nodes\n")[1].split("$EndNodes")[0].splitlines()[1:]
    nodes = {int(r[0]): tuple(map(float, r[1:4])) for r in (line.split() for line in rows)}
    rows = [line.split() for line in text.split("$Elements\n")[1].split("$EndElements")[0].splitlines()[1:]]
    corners = np.array([[nodes[int(i)] for i in r[-4:]] for r in rows if r[1] == "4"])
    assert len(corners) > 100
    a, b, c, d = np.moveaxis(corners, 1, 0)
    volume = np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 6
    assert (np.abs(volume) > 0).all()
    return float(np.abs(volume).sum())
