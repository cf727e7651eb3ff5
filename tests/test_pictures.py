"""Promise: pictures are drawn whole or not at all, and small."""

from __future__ import annotations

import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import offscreen as picture
import pytest
from offscreen import (
    PictureError,
    blade_scene,
    cutaway_scene,
    mesh_picture,
    pressure_picture,
    render,
    rotor_scene,
)

from geometry.airfoil import naca
from geometry.duct import around
from geometry.laws import helix
from geometry.rotor import Rotor

OUTLINE = Rotor(helix(0.2032, 0.127, anchors=naca("4412")), 2)


@pytest.fixture(scope="module")
def drawing() -> None:
    """Skip where nothing can be drawn off-screen at all."""
    code = "import pyvista as pv; p = pv.Plotter(off_screen=True); p.add_mesh(pv.Cube()); p.screenshot(return_img=True)"
    if subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=600, check=False).returncode:
        pytest.skip(picture.NEEDS)


def pixels(path: Path) -> np.ndarray:
    """Pixels of a PNG of 8 bits, (height, width, channels)."""
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    at, packed, head = 8, b"", b""
    while at < len(data):
        (size,), kind = struct.unpack(">I", data[at : at + 4]), data[at + 4 : at + 8]
        head = data[at + 8 : at + 8 + size] if kind == b"IHDR" else head
        packed += data[at + 8 : at + 8 + size] if kind == b"IDAT" else b""
        at += 12 + size
    width, height, depth, colour = struct.unpack(">IIBB", head[:10])
    assert depth == 8
    n = {2: 3, 6: 4}[colour]
    raw = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + width * n)
    out = np.zeros((height, width * n), np.int64)
    for i, row in enumerate(raw):
        above = out[i - 1] if i else np.zeros(width * n, np.int64)
        line = row[1:].astype(np.int64)
        if row[0] == 2:
            line = (line + above) % 256
        elif row[0] == 1:
            line = np.cumsum(line.reshape(-1, n), axis=0).ravel() % 256
        elif row[0] in (3, 4):
            for k in range(width * n):
                a, b = (line[k - n] if k >= n else 0), above[k]
                c = above[k - n] if k >= n else 0
                p = a + b - c
                best = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
                line[k] = (line[k] + ((a + b) // 2 if row[0] == 3 else best)) % 256
        out[i] = line
    return out.reshape(height, width, n)


def foam_case(folder: Path, dimensions: str = "[0 2 -2 0 0 0 0]", pressure: bool = True) -> Path:
    """Write an OpenFOAM case: a block of 6x6x4 cells whose bottom is the patch ``blade``, p growing with x there."""
    nx, ny, nz = 6, 6, 4

    def node(i: int, j: int, k: int) -> int:
        return i + (nx + 1) * (j + (ny + 1) * k)

    def cell(i: int, j: int, k: int) -> int:
        return i + nx * (j + ny * k)

    points = [(0.1 * i, 0.1 * j - 0.3, 0.1 * k) for k in range(nz + 1) for j in range(ny + 1) for i in range(nx + 1)]
    inner, sides, bottom = [], [], []
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                own = cell(i, j, k)
                east = [node(i + 1, j, k), node(i + 1, j + 1, k), node(i + 1, j + 1, k + 1), node(i + 1, j, k + 1)]
                north = [node(i, j + 1, k), node(i, j + 1, k + 1), node(i + 1, j + 1, k + 1), node(i + 1, j + 1, k)]
                top = [node(i, j, k + 1), node(i + 1, j, k + 1), node(i + 1, j + 1, k + 1), node(i, j + 1, k + 1)]
                for face, last, other in (
                    (east, i == nx - 1, (i + 1, j, k)),
                    (north, j == ny - 1, (i, j + 1, k)),
                    (top, k == nz - 1, (i, j, k + 1)),
                ):
                    (sides if last else inner).append((own, -1 if last else cell(*other), face))
                if i == 0:
                    west = [node(0, j, k), node(0, j, k + 1), node(0, j + 1, k + 1), node(0, j + 1, k)]
                    sides.append((own, -1, west))
                if j == 0:
                    sides.append(
                        (own, -1, [node(i, 0, k), node(i + 1, 0, k), node(i + 1, 0, k + 1), node(i, 0, k + 1)])
                    )
                if k == 0:
                    bottom.append(
                        (own, -1, [node(i, j, 0), node(i, j + 1, 0), node(i + 1, j + 1, 0), node(i + 1, j, 0)])
                    )
    inner.sort()
    faces = [*inner, *bottom, *sides]

    def write(name: str, kind: str, text: str) -> None:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"FoamFile {{ version 2.0; format ascii; class {kind}; object {path.name}; }}\n{text}\n")

    def listed(rows: list[str]) -> str:
        return f"{len(rows)}\n(\n" + "\n".join(rows) + "\n)"

    write("system/controlDict", "dictionary", "application simpleFoam;")
    write("constant/polyMesh/points", "vectorField", listed([f"({x:g} {y:g} {z:g})" for x, y, z in points]))
    write("constant/polyMesh/faces", "faceList", listed([f"4({' '.join(map(str, f))})" for _, _, f in faces]))
    write("constant/polyMesh/owner", "labelList", listed([str(own) for own, _, _ in faces]))
    write("constant/polyMesh/neighbour", "labelList", listed([str(other) for _, other, _ in inner]))
    patches = (
        f"2\n(\nblade {{ type wall; nFaces {len(bottom)}; startFace {len(inner)}; }}\nfarfield {{ type patch; nFaces "
        f"{len(sides)}; startFace {len(inner) + len(bottom)}; }}\n)"
    )
    write("constant/polyMesh/boundary", "polyBoundaryMesh", patches)
    if pressure:
        values = " ".join(f"{own % nx:d}" for own, _, _ in bottom)
        for time, shift in (("10", 0), ("200", 1000)):
            write(
                f"{time}/p",
                "volScalarField",
                f"dimensions {dimensions};\ninternalField uniform {shift};\nboundaryField {{ "
                f"blade {{ type fixedValue; value nonuniform List<scalar> {len(bottom)} ({values}); }} "
                f"farfield {{ type zeroGradient; }} }}",
            )
    return folder


def test_solids_are_drawn_on_transparent_ground(drawing: None, tmp_path: Path) -> None:
    fan = Rotor(helix(0.069, 0.1, "fan", hub=0.368, anchors=naca("4409")), 7)
    duct = around(fan, 0.06, 0.0004, 0.004, exit_area_ratio=0.9)
    scenes = {"rotor": rotor_scene(OUTLINE), "blade": blade_scene(OUTLINE), "duct": cutaway_scene(fan, duct)}
    render([(scene, tmp_path / f"{name}.png") for name, scene in scenes.items()])
    for name, scene in scenes.items():
        path = tmp_path / f"{name}.png"
        image = pixels(path)
        assert image.shape == (scene.size[1], scene.size[0], 4)
        assert path.stat().st_size < 150_000
        seen = image[..., 3] > 200
        assert 0.03 < seen.mean() < 0.9, name
        rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
        margin = 2  # nothing is cut off at the edges
        assert rows[0] >= margin and rows[-1] < image.shape[0] - margin, name
        assert columns[0] >= margin and columns[-1] < image.shape[1] - margin, name
    assert not list(tmp_path.glob(".*"))


def test_pressure_of_a_result_is_drawn_at_its_last_time(drawing: None, tmp_path: Path) -> None:
    case = foam_case(tmp_path / "case")
    before = sorted(p.relative_to(case) for p in case.rglob("*"))
    pressure_picture(case, tmp_path / "p.png")
    image = pixels(tmp_path / "p.png")
    assert (tmp_path / "p.png").stat().st_size < 150_000
    left = image[:, : image.shape[1] // 2, :3].reshape(-1, 3)
    shades = {tuple(rgb) for rgb in left if np.ptp(rgb) > 30}
    assert len(shades) >= 5, "six bands of pressure show as several colours"
    assert sorted(p.relative_to(case) for p in case.rglob("*")) == before, "the case is only read"


def test_mesh_of_a_case_is_drawn(drawing: None, tmp_path: Path) -> None:
    case = foam_case(tmp_path / "case", pressure=False)
    mesh_picture(case, tmp_path / "m.png", radius=0.5)
    dark = pixels(tmp_path / "m.png")[..., :3].sum(axis=2) < 400
    assert dark.mean() > 0.005, "edges of cells"


def test_what_cannot_be_drawn_is_said(drawing: None, tmp_path: Path) -> None:
    target = tmp_path / "p.png"
    with pytest.raises(PictureError, match="no field p"):
        pressure_picture(tmp_path, target)
    with pytest.raises(PictureError, match="neither of a pressure"):
        pressure_picture(foam_case(tmp_path / "a", "[0 1 0 0 0 0 0]"), target)
    with pytest.raises(PictureError, match="no patch whose name begins with wing; there are blade, farfield"):
        pressure_picture(foam_case(tmp_path / "b"), target, patches=["wing"])
    with pytest.raises(PictureError, match="not an OpenFOAM case"):
        mesh_picture(tmp_path, target, radius=1.0)
    assert not target.exists()


def test_a_drawing_process_that_dies_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    killed = subprocess.CompletedProcess([], -11, "", "")
    monkeypatch.setattr(subprocess, "run", lambda *a, **k: killed)
    with pytest.raises(PictureError, match="signal 11.*libegl1"):
        render([(rotor_scene(OUTLINE), tmp_path / "x.png")])
    assert not list(tmp_path.iterdir())


def test_absolute_and_kinematic_pressure_are_told_apart() -> None:
    assert picture._absolute("dimensions [1 -1 -2 0 0 0 0];")
    assert not picture._absolute("dimensions      [0 2 -2 0 0 0 0];")
