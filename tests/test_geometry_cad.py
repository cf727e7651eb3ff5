"""The promise of the CAD solids: the same volume as mesh and sections, STEP that comes back, a reason for refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bemt.case import load_case
from geometry.airfoil import naca4
from geometry.common import GeometryError
from geometry.laws import from_laws, helix
from geometry.mesh import Options, build
from geometry.rotor import Rotor

try:
    import cadquery as cq
except ImportError as error:  # pragma: no cover - where the system's graphics libraries are missing
    pytest.skip(f"cadquery cannot be loaded (it needs libGL, libX11 and libexpat): {error}", allow_module_level=True)

from geometry.cad import planar_sections, solids, tessellate  # noqa: E402


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


def test_planar_sections_lie_on_the_wrapped_blade() -> None:
    section = naca4(0.03, 0.4, 0.1)
    rotor = Rotor(from_laws(0.2, "constant", "constant_beta", 0.3, pitch={"beta": 0.5}, anchors=section), 4)
    curve = rotor.blade.section_curve(0.08, 45)
    for plane, points in planar_sections(rotor):
        if 0.03 < plane < 0.095:  # the section is the same everywhere: t = rho asin(y/rho), z as it is
            rho = np.hypot(plane, points[:, 0])
            assert rho * np.arcsin(points[:, 0] / rho) == pytest.approx(curve[:, 0], abs=2e-6)
            assert points[:, 1] == pytest.approx(curve[:, 1], abs=2e-6)


def test_tessellation_follows_its_tolerance_and_old_triangles() -> None:
    shape = cq.Workplane().sphere(10.0).val()
    volumes = [tessellate(shape, tolerance, 1.0).volume for tolerance in (1e-3, 1e-5, 1e-3)]
    exact = 4 / 3 * np.pi * 0.01**3
    assert volumes[1] == pytest.approx(exact, rel=2e-2)
    assert volumes[0] < volumes[1] and volumes[2] == pytest.approx(volumes[0], rel=1e-9)


def test_what_makes_no_solid_is_refused_with_the_reason() -> None:
    with pytest.raises(GeometryError, match="anchors: got none"):
        solids(Rotor(helix(0.2, 0.1), 2))
    wide = from_laws(0.2, "constant", "constant_beta", 0.1, chord={"max_chord": 0.5}, pitch={"beta": 0.1},
                     anchors=naca4(0.0, 0.4, 0.1))  # fmt: skip
    with pytest.raises(GeometryError, match="round the shaft"):
        solids(Rotor(wide, 2), options=Options())
