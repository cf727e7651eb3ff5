"""Meshes and CAD solids: closed, right volumes, shapes that come back."""

from __future__ import annotations

import importlib
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from bemt.rotors.case import load_case
from geometry.airfoil import naca4
from geometry.cad import planar_sections, solids, tessellate
from geometry.common import GeometryError
from geometry.duct import Duct, Stator, around
from geometry.export import export
from geometry.laws import from_laws, helix
from geometry.mesh import MeshModel, Options, build, rotor_mesh, surfaces
from geometry.rotor import Rotor, from_stations
from geometry.rotor_axis import blades
from geometry.slicing import FoundRotor, find_rotor
from geometry.solid import check_closed

CASES = ("ds30", "prop_8x5", "prop_10x5", "prop_12x6", "prop_14x8")


def random_rotor(rng: np.random.Generator) -> tuple[Rotor, Duct | None]:
    """A rotor of 2 to 12 blades and 50 to 600 mm, in a duct or not."""
    blades_, diameter, ducted = int(rng.integers(2, 13)), float(rng.uniform(0.05, 0.6)), bool(rng.random() < 0.4)
    hub = float(rng.uniform(0.25, 0.5) if ducted else rng.uniform(0.12, 0.3))
    law = str(rng.choice(["apc_like", "elliptic", "constant", "linear_taper", "fan"]))
    sections = [
        (x, naca4(float(rng.uniform(0, 0.07)), float(rng.uniform(0.3, 0.5)), float(rng.uniform(t, t + 0.08))))
        for x, t in ((0.0, 0.09), (1.0, 0.05))
    ]
    blade = from_laws(diameter, law, "helix", max(hub, 0.22) if blades_ > 6 else hub, anchors=sections,
                      chord={"max_chord": float(rng.uniform(0.08, 0.45))},
                      pitch={"pitch": float(rng.uniform(0.3, 1.5)) * diameter})  # fmt: skip
    rotor = Rotor(blade, blades_, int(rng.choice([1, -1])), spinner_length=float(rng.choice([0.0, 0.1])) * diameter)
    if not ducted:
        return rotor, None
    stator = Stator(int(rng.integers(3, 8)), 0.12 * diameter) if rng.random() < 0.5 else None
    duct = around(
        rotor, float(rng.uniform(0.4, 1.0)) * diameter, float(rng.uniform(0.003, 0.03)) * rotor.R,
        float(rng.uniform(0.01, 0.08)) * rotor.R, exit_area_ratio=float(rng.uniform(0.8, 1.2)), stator=stator,
    )  # fmt: skip
    return rotor, duct


def turned(model: MeshModel, rng: np.random.Generator, scale: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All triangles somewhere else, somehow turned, in another unit; and where thrust points then."""
    start = np.cumsum([0, *(len(part.vertices) for part in model.parts)])
    faces = np.concatenate([part.faces + n for part, n in zip(model.parts, start, strict=False)])
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= math.copysign(1.0, float(np.linalg.det(q)))
    points = np.concatenate([part.vertices for part in model.parts])
    return (points @ q.T + rng.normal(size=3)) * scale, faces, q[:, 2]


def errors(found: FoundRotor, rotor: Rotor, scale: float) -> tuple[float, float]:
    """Greatest error of chord (relative) and of beta (degrees) between 0.25 and 0.95 R."""
    x = found.r / found.R
    inside = (x > 0.25) & (x < 0.95)
    assert inside.sum() >= 10
    chord, beta = rotor.blade.at(found.r / scale)
    return (
        float(np.abs(found.chord / scale / chord - 1)[inside].max()),
        float(np.degrees(np.abs(found.beta - beta))[inside].max()),
    )


@pytest.mark.parametrize("name", CASES)
def test_cases_are_closed_and_come_back_from_any_orientation_and_unit(name: str, project: Path) -> None:
    case = load_case(project / "cases" / name)
    rotor = case.rotor()
    model = build(rotor, case.duct())
    for part in model.parts:
        check_closed(part, name, bodies=1)
    checks = model.checks
    assert checks["volume_rotor_mesh"] == pytest.approx(checks["volume_rotor_sections"], rel=2e-3)
    points, faces, thrust = turned(model, np.random.default_rng(len(name)), 1000 / 25.4)
    found = find_rotor(points, faces)
    chord, beta = errors(found, rotor, 1000 / 25.4)
    assert (found.B, found.rotation) == (rotor.B, rotor.rotation)
    assert found.axis @ thrust > 1 - 1e-9
    assert found.R * 0.0254 == pytest.approx(rotor.R, rel=1e-6)
    assert found.Rhub * 0.0254 == pytest.approx(rotor.Rhub, rel=1e-3)
    assert chord < 2e-3
    relative = np.abs(found.beta / rotor.blade.at(found.r * 0.0254)[1] - 1)
    assert relative[(found.r > 0.25 * found.R) & (found.r < 0.95 * found.R)].max() < 2e-3
    assert beta < 0.1
    at = found.r / found.R
    true = [rotor.blade.section(float(x) * rotor.R) for x in at]
    assert np.abs(found.thickness - [s.thickness for s in true]).max() < 1e-3
    assert np.abs(found.camber - [s.camber for s in true]).max() < 1e-3


def tried(count: int, seed: int) -> tuple[int, list[str]]:
    """How many random rotors are sound, and why the others were refused."""
    rng = np.random.default_rng(seed)
    sound, refused = 0, []
    for _ in range(count):
        rotor, duct = random_rotor(rng)
        try:
            model = build(rotor, duct, Options(n=61))
        except GeometryError as error:
            refused.append(str(error))
            continue
        for part in model.parts:
            check_closed(part, "solid", bodies=1)
        assert model.checks["tip_radius"] == pytest.approx(rotor.R, rel=1e-6)
        assert model.checks["volume_rotor_mesh"] == pytest.approx(model.checks["volume_rotor_sections"], rel=5e-3)
        if duct is not None:
            assert 0 < model.checks["gap"] <= duct.gap * (1 + 1e-6)
        sound += 1
    return sound, refused


def test_random_rotors_are_closed() -> None:
    sound, refused = tried(5, 1)
    assert sound == 5, refused


@pytest.mark.slow
def test_of_200_random_rotors_99_percent_are_closed_and_the_rest_refused() -> None:
    sound, refused = tried(200, 2)
    assert sound >= 198, refused
    assert all("expected" in reason for reason in refused)


@pytest.mark.slow
def test_40_random_rotors_come_back() -> None:
    rng = np.random.default_rng(5)
    for _ in range(40):
        rotor, duct = random_rotor(rng)
        points, faces, thrust = turned(build(rotor, duct, Options(n=61)), rng, 1000.0)
        found = find_rotor(points, faces)
        chord, beta = errors(found, rotor, 1000.0)
        assert (found.B, found.rotation) == (rotor.B, rotor.rotation)
        assert found.axis @ thrust > 1 - 1e-6
        assert chord < 0.01 and beta < 0.3


def test_left_hand_is_the_mirror_image() -> None:
    blade = helix(0.2, 0.12, anchors=naca4(0.04, 0.4, 0.12))
    right, left = (rotor_mesh(Rotor(blade, 3, sign), Options(n=41)) for sign in (1, -1))
    assert left.volume == pytest.approx(right.volume, rel=1e-9)
    found = find_rotor(left.vertices, left.faces, stations=8)
    assert (found.B, found.rotation) == (3, -1)
    assert found.axis[2] > 1 - 1e-9


def test_a_hub_that_is_not_alike_on_all_sides_does_not_turn_the_axis() -> None:
    import trimesh

    rotor = Rotor(helix(0.2, 0.12, anchors=naca4(0.04, 0.4, 0.12)), 3)
    mesh = rotor_mesh(rotor, Options(n=61))
    lump = trimesh.creation.box((0.008, 0.004, 0.03))
    lump.apply_translation((0.004, 0.002, -0.012))
    points = np.concatenate([mesh.vertices, lump.vertices])
    found = find_rotor(points, np.concatenate([mesh.faces, lump.faces + len(mesh.vertices)]))
    chord, beta = errors(found, rotor, 1.0)
    assert found.axis[2] > 1 - 1e-5
    assert chord < 0.01 and beta < 0.3


def test_a_fillet_adds_its_own_volume_at_the_root_only() -> None:
    blade = helix(0.2, 0.12, anchors=naca4(0.04, 0.4, 0.12))
    bare, round_ = (build(Rotor(blade, 2), options=Options(n=61, fillet=f)) for f in (0.0, 0.003))
    more = round_.checks["volume_blade_sections"] - bare.checks["volume_blade_sections"]
    # Perimeter times the cross-section of the fillet, and a turn of 2 pi times the integral of its depth squared / 2.
    around_root = np.linalg.norm(np.diff(blade.section_curve(blade.Rhub), axis=0), axis=1).sum()
    exact = around_root * (1 - np.pi / 4) * 0.003**2 + np.pi * (5 / 3 - np.pi / 2) * 0.003**3
    assert more == pytest.approx(exact, rel=0.04)
    for share in (0.4, 0.8):
        cuts = [blades(m.rotor.vertices, m.rotor.faces, share * 0.1) for m in (bare, round_)]
        spans = [np.ptp(np.concatenate(c)[:, 1]) for c in cuts if c]
        assert spans[0] == pytest.approx(spans[1], rel=2e-3)


def fan(chord: float = 0.3, blades_: int = 8, hub: float = 0.37) -> Rotor:
    blade = from_laws(
        0.069, "fan", "helix", hub, chord={"max_chord": chord}, pitch={"pitch": 0.1}, anchors=naca4(0.05, 0.45, 0.09)
    )
    return Rotor(blade, blades_)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: build(Rotor(helix(0.2, 0.1), 2)), "anchors: got none"),
        (lambda: build(Rotor(fan().blade, 8, hub_length=0.001)), "hub_length"),
        (lambda: build(fan(1.2, 30)), "run into each other"),
        (lambda: build(fan(), options=Options(min_thickness=0.005)), "thickness: got 0.8"),
        (lambda: build(fan(), around(fan(), 0.06, 0.0)), "duct.gap"),
        (
            lambda: build(fan(), Duct(0.0349, 0.06, 0.004, 0.0004, exit_radius=0.03, rotor_x=0.02, diffuser_x=0.018)),
            "duct.gap",
        ),
        (lambda: build(fan(), around(fan(), 0.06, 0.0004, stator=Stator(5, 0.055))), "stator"),
        (lambda: build(fan(), around(fan(), 0.06, 0.0004, rotor_x=0.0)), "blade tips outside the duct"),
    ],
)
def test_what_makes_no_solid_is_refused_with_the_reason(make: object, reason: str) -> None:
    with pytest.raises(GeometryError, match=reason):
        make()  # type: ignore[operator]


def test_a_lump_and_a_single_blade_are_no_rotor() -> None:
    import trimesh

    for mesh in (trimesh.creation.icosphere(3), trimesh.creation.cylinder(1.0, 3.0), trimesh.creation.box((1, 2, 3))):
        with pytest.raises(GeometryError, match="mesh: got"):
            find_rotor(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    one = rotor_mesh(Rotor(helix(0.2, 0.12, anchors=naca4(0.04, 0.4, 0.12)), 1), Options(n=41))
    with pytest.raises(GeometryError, match="mesh: got"):
        find_rotor(one.vertices, one.faces)


def test_all_shipped_cases_were_tried(project: Path) -> None:
    swept = json.loads((project / "reports" / "sweep.json").read_text(encoding="utf-8"))["cases"]
    assert {case["name"] for case in swept} == set(CASES)


@pytest.mark.parametrize("name", ["prop_8x5", "ds30"])
def test_surfaces_to_look_at_are_those_of_the_solid(name: str, project: Path) -> None:
    case = load_case(project / "cases" / name / "case.toml")
    rotor, duct = case.rotor(), case.duct()
    found = {s.name: s for s in reversed(surfaces(rotor, duct))}
    assert found["blade"].copies == rotor.B
    solid = rotor_mesh(rotor).vertices
    for s in (found["blade"], found["hub"]):
        assert np.all(s.points.reshape(-1, 3).max(axis=0) <= solid.max(axis=0) + 1e-3 * rotor.R)
    blade = found["blade"].points
    assert np.hypot(blade[..., 0], blade[..., 1]).max() == pytest.approx(rotor.R, rel=1e-6)
    for r in (0.4, 0.7, 0.95):  # chord and blade angle are those of the law
        row = blade[np.argmin(np.abs(np.hypot(blade[:, 0, 0], blade[:, 0, 1]) - r * rotor.R))]
        at = float(np.hypot(row[0, 0], row[0, 1]))
        chord, beta = (float(v) for v in rotor.blade.at(at))
        flat = np.stack([at * np.unwrap(np.arctan2(row[:, 1], row[:, 0])), row[:, 2]], axis=1)
        far = flat[np.argmax(np.linalg.norm(flat - flat[0], axis=1))] - flat[0]
        assert np.linalg.norm(far) == pytest.approx(chord, rel=0.02)
        assert abs(math.atan2(abs(far[1]), abs(far[0])) - beta) < math.radians(1.0)
    if duct is not None:
        assert found["duct"].points[..., 1].min() > -1e-9, "cut open"
        assert np.hypot(*found["stator"].points[..., :2].reshape(-1, 2).T).max() < duct.outer(0.5 * duct.length) * 1.2


@pytest.mark.parametrize(("hub", "blades"), [(0.0, 2), (0.05, 1), (0.6, 40)])
def test_what_cannot_be_made_can_be_looked_at(hub: float, blades: int) -> None:
    blade = replace(helix(0.2, 0.15, anchors=naca4(0.04, 0.4, 0.12)), Rhub=hub * 0.1)
    for s in surfaces(Rotor(blade, blades)):
        assert np.isfinite(s.points).all() and np.hypot(s.points[..., 0], s.points[..., 1]).max() <= 0.1 * (1 + 1e-9)


# The promise of the CAD solids: the same volume as mesh and sections, STEP that comes back, a reason for refusals.


@pytest.fixture(scope="module")
def cq() -> ModuleType:
    """The CAD kernel, which takes seconds to load."""
    try:
        return importlib.import_module("cadquery")
    except ImportError as error:  # pragma: no cover - where the system's graphics libraries are missing
        pytest.skip(f"cadquery cannot be loaded (it needs libGL, libX11 and libexpat): {error}")


CAD = pytest.mark.usefixtures("cq")


@CAD
@pytest.mark.parametrize("name", ["prop_8x5", pytest.param("prop_10x5", marks=pytest.mark.slow),
                                  pytest.param("prop_12x6", marks=pytest.mark.slow),
                                  pytest.param("prop_14x8", marks=pytest.mark.slow), "ds30"])  # fmt: skip
def test_cad_mesh_and_sections_have_one_volume(name: str, project: Path) -> None:
    case = load_case(project / "cases" / name)
    rotor, duct = case.rotor(), case.duct()
    model, parts = build(rotor, duct), solids(rotor, duct)
    assert parts.rotor_volume == pytest.approx(model.rotor.volume, rel=2e-3)
    assert parts.rotor_volume == pytest.approx(model.checks["volume_rotor_sections"], rel=2e-3)
    assert parts.volumes["blade"] == pytest.approx(rotor.B * model.checks["volume_blade_sections"], rel=2e-3)
    assert sum(surface == "blade" for surface, _, _ in parts.solids) == rotor.B
    assert all(solid.isValid() and solid.Volume() > 0 for _, _, solid in parts.solids)
    if model.duct is not None:
        assert parts.volumes["duct"] + parts.volumes["stator"] == pytest.approx(model.duct.volume, rel=3e-3)
    tip = max(vertex.Center().toTuple()[0] ** 2 + vertex.Center().toTuple()[1] ** 2
              for surface, _, solid in parts.solids if surface == "blade" for vertex in solid.Vertices()) ** 0.5  # fmt: skip  # noqa: E501
    assert tip / 1000 == pytest.approx(rotor.R, rel=1e-6)


@CAD
def test_planar_sections_lie_on_the_wrapped_blade() -> None:
    section = naca4(0.03, 0.4, 0.1)
    rotor = Rotor(from_stations([0.03, 0.1], [0.015] * 2, [0.5] * 2, 0.1, 0.03, section), 4)
    curve = rotor.blade.section_curve(0.08, 45)
    for plane, points in planar_sections(rotor):
        if 0.03 < plane < 0.095:  # the section is the same everywhere: t = rho asin(y/rho), z as it is
            rho = np.hypot(plane, points[:, 0])
            assert rho * np.arcsin(points[:, 0] / rho) == pytest.approx(curve[:, 0], abs=2e-6)
            assert points[:, 1] == pytest.approx(curve[:, 1], abs=2e-6)


def test_tessellation_follows_its_tolerance_and_old_triangles(cq: ModuleType) -> None:
    shape = cq.Workplane().sphere(10.0).val()
    volumes = [tessellate(shape, tolerance, 1.0).volume for tolerance in (1e-3, 1e-5, 1e-3)]
    exact = 4 / 3 * np.pi * 0.01**3
    assert volumes[1] == pytest.approx(exact, rel=2e-2)
    assert volumes[0] < volumes[1] and volumes[2] == pytest.approx(volumes[0], rel=1e-9)


@CAD
def test_what_makes_no_cad_solid_is_refused_with_the_reason() -> None:
    with pytest.raises(GeometryError, match="anchors: got none"):
        solids(Rotor(helix(0.2, 0.1), 2))
    wide = from_stations([0.01, 0.1], [0.05] * 2, [0.1] * 2, 0.1, 0.01, naca4(0.0, 0.4, 0.1))
    with pytest.raises(GeometryError, match="round the shaft"):
        solids(Rotor(wide, 2), options=Options())


@pytest.fixture(scope="module")
def small_fan(cq: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, set[str]]]:
    """STEP of the parts and of the air around a fan of two blades and two vanes, with the names of their faces."""
    rotor = Rotor(helix(0.1, 0.1, "fan", hub=0.35, anchors=naca4(0.04, 0.4, 0.1)), 2)
    duct = around(rotor, 0.07, 0.0008, 0.005, exit_area_ratio=0.95, exit_hub_radius=0.01, stator=Stator(2, 0.02))
    folder = tmp_path_factory.mktemp("flow")
    made = export(rotor, duct, folder, ["step", "flow"], name="fan")
    return folder, {item["format"]: set(item["faces"]) for item in made["files"]}


WALLS = {"blade_1", "blade_2", "blade_1_tip", "blade_2_tip", "hub", "duct_lip", "duct_inner", "duct_outer", "duct_exit",
         "centre_body", "vane_1", "vane_2"}  # fmt: skip


def test_every_face_of_a_step_has_the_name_of_its_boundary(small_fan: tuple[Path, dict[str, set[str]]]) -> None:
    folder, names = small_fan
    assert names["step"] == WALLS | {"blade_1_root", "blade_2_root"}
    assert names["flow"] == WALLS | {"far_field_inlet", "far_field_outlet", "far_field_side"}
    for file, expected in (("fan.step", names["step"]), ("fan_flow.step", names["flow"])):
        written = re.findall(r"ADVANCED_FACE\('([^']*)'", (folder / file).read_text())
        assert set(written) == expected
    assert written.count("far_field_side") == 4 and written.count("far_field_inlet") == 1


@CAD
def test_the_zone_that_turns_holds_the_rotor_and_no_vane(tmp_path: Path) -> None:
    from geometry.cad import rotating_zone

    rotor = Rotor(helix(0.1, 0.1, "fan", hub=0.35, anchors=naca4(0.04, 0.4, 0.1)), 2)
    duct = around(rotor, 0.07, 0.0008, 0.005, exit_area_ratio=0.95, exit_hub_radius=0.01, stator=Stator(2, 0.02))
    made = export(rotor, duct, tmp_path, ["zone"], name="fan")
    (body, mesh) = made["files"]
    assert set(body["faces"]) == {"zone_upstream", "zone_downstream", "zone_side"}
    assert [s["name"] for s in mesh["surfaces"]] != [] and "radius 0.0504 m" in body["surfaces"][0]["extent"]
    solid, _, (radius, low, high) = rotating_zone(parts := solids(rotor, duct), rotor, duct)
    for surface, _, one in parts.solids:
        box = one.BoundingBox()
        if surface in ("blade", "hub"):
            assert low - 1e-9 <= box.zmin / 1e3 and box.zmax / 1e3 <= high
        elif surface == "stator":
            assert box.zmax / 1e3 <= low + 1e-9
    from geometry.export import read_solid

    text = (tmp_path / "fan_zone.stl").read_text()
    vertices, faces, unit = read_solid(tmp_path / "fan_zone.stl")
    trimesh = pytest.importorskip("trimesh")
    closed = trimesh.Trimesh(vertices, faces, process=False)
    assert unit == "mm" and text.count("endsolid") == 3 and closed.is_watertight
    assert closed.volume == pytest.approx(solid.Volume(), rel=2e-3)


@CAD
def test_the_far_field_is_as_wide_as_stated(tmp_path: Path) -> None:
    rotor = Rotor(helix(0.1, 0.1, "fan", hub=0.35, anchors=naca4(0.04, 0.4, 0.1)), 2)
    (made,) = export(rotor, None, tmp_path, ["flow"], name="fan", box=20.0)["files"]
    box = 20.0 * 20.0 * 30.0 * rotor.D**3  # half of the width ahead of the rotor, all of it behind
    assert made["surfaces"][0]["volume_m3"] == pytest.approx(box, rel=1e-3)


@CAD
def test_no_vane_stands_on_a_seam() -> None:
    """A vane whose edges lie on the seams of duct and body left no air at all: fans of 70 and 254 mm."""
    rotor = Rotor(helix(0.07, 0.1, "fan", hub=0.35, anchors=naca4(0.04, 0.4, 0.1)), 2)
    duct = around(rotor, 0.06, 0.0005, 0.004, exit_area_ratio=0.95, exit_hub_radius=0.0, stator=Stator(5, 0.02))
    turned = {part: solid for _, part, solid in solids(rotor, duct).solids}
    for part, copies in (("duct", 5), ("centre_body", 5), ("hub", 2)):
        at = np.array([v.toTuple() for v in turned[part].Vertices()])
        off_axis = at[np.hypot(at[:, 0], at[:, 1]) > 1e-3]
        assert len(off_axis) and (np.cos(copies * np.arctan2(off_axis[:, 1], off_axis[:, 0])) < -0.99).all()


@CAD
def test_a_failure_of_the_kernel_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(*_: object) -> None:
        raise ValueError("Null TopoDS_Shape object")

    monkeypatch.setattr("geometry.cad.flow_domain", nothing)
    rotor = Rotor(helix(0.1, 0.1, "fan", hub=0.35, anchors=naca4(0.04, 0.4, 0.1)), 2)
    with pytest.raises(GeometryError, match=r"^flow: got a failure of the CAD kernel .*Null TopoDS"):
        export(rotor, None, tmp_path, ["flow"], name="fan")
    assert not list(tmp_path.iterdir())


def test_a_mesher_picks_the_boundaries_by_name(small_fan: tuple[Path, dict[str, set[str]]]) -> None:
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Geometry.OCCImportLabels", 1)
        gmsh.open(str(small_fan[0] / "fan_flow.step"))
        found: dict[str, list[int]] = {}
        for dim, tag in gmsh.model.getEntities(2):
            found.setdefault(gmsh.model.getEntityName(dim, tag).split(" & & ")[-1], []).append(tag)
        assert set(found) == small_fan[1]["flow"]
        area = {name: sum(gmsh.model.occ.getMass(2, tag) for tag in tags) for name, tags in found.items()}
        assert area["blade_1"] == pytest.approx(area["blade_2"], rel=1e-3)
        assert area["far_field_inlet"] == pytest.approx(1000.0**2, rel=1e-6)  # ten diameters wide [mm2]
        for name, tags in found.items():
            gmsh.model.addPhysicalGroup(2, tags, name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 100.0)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
        gmsh.model.mesh.generate(2)
        for tags in found.values():
            assert all(gmsh.model.mesh.getElements(2, tag)[1][0].size for tag in tags)
    finally:
        gmsh.finalize()
