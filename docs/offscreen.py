"""Pictures of rotors, ducts and CFD results, drawn off-screen by pyvista.

Without a usable OpenGL library VTK may end the whole process instead of raising, so that everything is drawn in a child
process: :func:`render` returns with pictures or raises :class:`PictureError` that says what is missing. Backgrounds are
transparent (solids) or white (CFD, which carries text), colours middle tones that show on light and on dark pages.
"""

from __future__ import annotations

import importlib.util
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from offscreen_child import PictureError, times

from geometry.common import Array, needs
from geometry.duct import Duct
from geometry.mesh import Options, build, rotor_mesh
from geometry.rotor import Rotor
from geometry.solid import Faces, Mesh

__all__ = [
    "Layer",
    "PictureError",
    "Scene",
    "blade_scene",
    "cutaway_scene",
    "mesh_picture",
    "pressure_picture",
    "render",
    "rotor_scene",
]

BLADE, HUB, DUCT = "#4f93c4", "#8d99a6", "#c9973f"
NEEDS = "off-screen drawing needs Debian's libegl1 libegl-mesa0 libgl1-mesa-dri, or libosmesa6"
SECONDS = 180.0
COARSE = Options(n=61, tolerance=2e-3, segments=96)
"""Fine enough for a picture."""


@dataclass(frozen=True, eq=False)
class Layer:
    """One surface of a picture."""

    vertices: Array  # (N, 3) corners [m]
    faces: Faces  # (M, 3) triangles
    colour: str  # ``#rrggbb``
    # The half-space on this side of the origin is cut away and the cut is closed; a normal [-]
    cut: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class Scene:
    """Surfaces and how they are looked at, in parallel projection."""

    layers: tuple[Layer, ...]  # Surfaces
    eye: tuple[float, float, float]  # Direction from the middle of the scene to the eye [-]
    up: tuple[float, float, float]  # Direction that points up in the picture [-]
    size: tuple[int, int] = (640, 480)  # Width and height in pixels


def _fineness(options: Options | None) -> Options:
    """Options of the mesh; refused where nothing could be drawn, which is found without loading VTK."""
    if importlib.util.find_spec("pyvista") is None:
        needs("pyvista", "pictures")
    return options or COARSE


def _layers(mesh: Mesh, colours: Mapping[str, str], cut: tuple[float, float, float] | None = None) -> list[Layer]:
    return [Layer(mesh.vertices, mesh.part(name), colours[name], cut) for name in mesh.names]


def rotor_scene(rotor: Rotor, options: Options | None = None) -> Scene:
    """Show a rotor from the front and a little from the side.

    >>> from geometry.airfoil import naca
    >>> from geometry.laws import helix
    >>> len(rotor_scene(Rotor(helix(0.2032, 0.127, anchors=naca("4412")), 2)).layers)
    2
    """
    mesh = rotor_mesh(rotor, _fineness(options))
    size = (720, 300) if rotor.B == 2 else (600, 460)
    return Scene(tuple(_layers(mesh, {"blade": BLADE, "hub": HUB})), (-0.12, -0.6, 0.8), (0.0, 0.0, 1.0), size)


def cutaway_scene(rotor: Rotor, duct: Duct, options: Options | None = None) -> Scene:
    """Show a ducted rotor, the duct cut open along the shaft."""
    model = build(rotor, duct, _fineness(options))
    assert model.duct is not None
    # the whole standing part is one closed solid: cut as one, or the cut of the walls could not be closed
    standing = Layer(model.duct.vertices, model.duct.faces, DUCT, (0.0, -1.0, 0.0))
    turning = _layers(model.rotor, {"blade": BLADE, "hub": HUB})
    return Scene((standing, *turning), (-0.45, -0.85, 0.42), (0.0, 0.0, 1.0))


def blade_scene(rotor: Rotor, options: Options | None = None) -> Scene:
    """Show one blade, root to the left, seen along the shaft from the front."""
    mesh = rotor_mesh(replace(rotor, B=1), _fineness(options))
    blade = Layer(mesh.vertices, mesh.part("blade"), BLADE)
    return Scene((blade,), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (720, 260))


def render(pictures: Sequence[tuple[Scene, str | os.PathLike[str]]]) -> None:
    """Draw scenes into PNG files, all in one child process."""
    with tempfile.TemporaryDirectory() as folder:
        arrays: dict[str, Any] = {}
        jobs = []
        for i, (scene, _) in enumerate(pictures):
            layers = []
            for j, layer in enumerate(scene.layers):
                arrays[f"v{i}_{j}"], arrays[f"f{i}_{j}"] = layer.vertices, layer.faces
                layers.append({"vertices": f"v{i}_{j}", "faces": f"f{i}_{j}", "colour": layer.colour, "cut": layer.cut})
            jobs.append({"layers": layers, "eye": scene.eye, "up": scene.up, "size": scene.size})
        np.savez(Path(folder) / "arrays.npz", **arrays)
        _child(folder, {"task": "scenes", "jobs": jobs}, [Path(path) for _, path in pictures])


def pressure_picture(
    case_dir: str | os.PathLike[str],
    path: str | os.PathLike[str],
    density: float = 1.225,
    patches: Sequence[str] = ("blade", "hub"),
) -> None:
    """Draw the pressure on the blades of an OpenFOAM result, from the front and from behind.

    Colours show pressure less that of the largest cell, which lies in the far field; 2 % of the area at either end of
    the scale are clipped. Whether `p` is kinematic is read from its dimensions in the file.
    """
    factor = 1.0 if _absolute(_field_head(Path(case_dir), "p")) else density
    job = {"task": "pressure", "case": os.fspath(case_dir), "factor": factor, "patches": list(patches)}
    with tempfile.TemporaryDirectory() as folder:
        _child(folder, job, [Path(path)])


def mesh_picture(
    case_dir: str | os.PathLike[str],
    path: str | os.PathLike[str],
    radius: float,
    patches: Sequence[str] = ("blade", "hub"),
) -> None:
    """Draw the cells of an OpenFOAM case in a plane through the shaft, and the mesh on the blades."""
    job = {"task": "mesh", "case": os.fspath(case_dir), "radius": radius, "patches": list(patches)}
    with tempfile.TemporaryDirectory() as folder:
        _child(folder, job, [Path(path)])


def _field_head(case: Path, name: str) -> str:
    """Head of a field file at the last time."""
    import gzip

    for root in (case, case / "processor0"):
        for _, folder in reversed(times(root)):
            for file in (folder / name, folder / f"{name}.gz"):
                if file.is_file():
                    data = file.read_bytes()
                    return (gzip.decompress(data) if file.suffix == ".gz" else data)[:4000].decode("latin-1")
    raise PictureError(f"{case.as_posix()}: no field {name} in any time folder")


def _absolute(head: str) -> bool:
    """Whether the dimensions of a pressure are those of Pa; otherwise it is pressure over density."""
    found = re.search(r"dimensions\s*\[([^\]]*)\]", head)
    if not found:
        raise PictureError("p: no dimensions in the head of the file")
    powers = [float(word) for word in found[1].split()[:3]]
    if powers == [1, -1, -2]:
        return True
    if powers == [0, 2, -2]:
        return False
    raise PictureError(f"p: dimensions [{found[1]}], neither of a pressure nor of pressure over density")


def _child(folder: str, job: dict[str, Any], targets: Sequence[Path]) -> None:
    """Draw in another process; move the pictures to their places only when all are there."""
    here = Path(folder)
    (here / "job.json").write_text(json.dumps(job), encoding="utf-8")
    docs = Path(__file__).resolve().parent
    call = [
        sys.executable,
        "-c",
        f"import sys; sys.path[:0] = [{str(docs)!r}, {str(docs.parent)!r}]; from offscreen_child import draw; "
        f"draw({folder!r})",
    ]
    try:
        run = subprocess.run(call, capture_output=True, text=True, errors="replace", timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired as error:
        raise PictureError(f"drawing took more than {SECONDS:g} s and was ended") from error
    made = [here / f"{i}.png" for i in range(len(targets))]
    if run.returncode < 0:
        raise PictureError(f"drawing died of signal {-run.returncode}; {NEEDS}")
    if run.returncode > 0:
        words = [line for line in run.stderr.splitlines() if line.strip()]
        last = words[-1].removeprefix("offscreen_child.PictureError: ") if words else "no reason given"
        raise PictureError(last if "PictureError" in (words[-1] if words else "") else f"{last}; {NEEDS}")
    for file in made:
        if not file.is_file() or not file.read_bytes().startswith(b"\x89PNG"):
            raise PictureError(f"the drawing process left no picture; {NEEDS}")
    for file, target in zip(made, targets, strict=True):
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
        temporary.write_bytes(file.read_bytes())
        os.replace(temporary, target)
