"""Drawing itself, in the child process of ``offscreen.py``: one job file in, PNG files out."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from geometry.common import Array, GeometryError, needs
from geometry.solid import Faces

CUT = "#f0cf8e"


class PictureError(RuntimeError):
    """A picture could not be drawn; the text says why."""


def times(folder: Path) -> list[tuple[float, Path]]:
    """Find the folders of times of an OpenFOAM case. [s, or iterations]"""
    found = []
    for item in folder.glob("[0-9]*"):
        if re.fullmatch(r"[0-9.]+(e[-+]?[0-9]+)?", item.name) and item.is_dir():
            found.append((float(item.name), item))
    return sorted(found)


def _pyvista() -> Any:
    try:
        return needs("pyvista", "pictures")
    except GeometryError as error:
        raise PictureError(str(error)) from error


def draw(folder: str) -> None:
    """Do one job file."""
    here = Path(folder)
    job = json.loads((here / "job.json").read_text(encoding="utf-8"))
    if job["task"] == "scenes":
        with np.load(here / "arrays.npz") as arrays:
            for i, scene in enumerate(job["jobs"]):
                _draw_scene(scene, arrays, here / f"{i}.png")
    elif job["task"] == "pressure":
        _draw_pressure(job, here / "0.png")
    else:
        _draw_mesh(job, here / "0.png")


def _surface(vertices: Array, faces: Faces) -> Any:
    pv = _pyvista()

    cells = np.hstack([np.full((len(faces), 1), 3), faces]).ravel()
    return pv.PolyData(np.ascontiguousarray(vertices), cells)


def _look(plotter: Any, eye: Sequence[float], up: Sequence[float], zoom: float = 1.0) -> None:
    """Parallel projection that fills the picture with what is there, measured across the line of sight."""
    e = np.array(eye, float) / np.linalg.norm(eye)
    right = np.cross(up, e)
    right /= np.linalg.norm(right)
    above = np.cross(e, right)
    points = np.vstack(
        [
            np.asarray(a.mapper.dataset.points, float)
            for a in plotter.actors.values()
            if hasattr(a, "mapper") and getattr(a.mapper, "dataset", None) is not None
        ]
    )
    x, y, z = points @ right, points @ above, points @ e
    middle = 0.5 * (x.min() + x.max()) * right + 0.5 * (y.min() + y.max()) * above + 0.5 * (z.min() + z.max()) * e
    width, height = plotter.window_size
    left, low, right_end, top = plotter.renderer.viewport
    share = (right_end - left) * width / ((top - low) * height)
    half = 0.5 * max(np.ptp(y), np.ptp(x) / share) * 1.05
    camera = plotter.camera
    camera.parallel_projection = True
    camera.focal_point = middle
    camera.position = middle + e * (np.ptp(z) + 10 * half)
    camera.up = above
    camera.parallel_scale = half / zoom
    plotter.reset_camera_clipping_range()


def _draw_scene(scene: dict[str, Any], arrays: Any, file: Path) -> None:
    pv = _pyvista()

    plotter = pv.Plotter(off_screen=True, window_size=scene["size"], lighting="light kit")
    for layer in scene["layers"]:
        surface = _surface(arrays[layer["vertices"]], arrays[layer["faces"]]).clean()
        if layer["cut"] is not None:
            surface = surface.clip_closed_surface(normal=[-c for c in layer["cut"]], origin=(0.0, 0.0, 0.0))
            off = np.abs(np.asarray(surface.cell_centers().points) @ np.array(layer["cut"]))
            flat = off < 1e-6 * surface.length
            plotter.add_mesh(surface.extract_cells(flat), color=CUT, ambient=0.45, diffuse=0.6)
            surface = surface.extract_cells(~flat).extract_surface(algorithm="dataset_surface")
        plotter.add_mesh(
            surface,
            color=layer["colour"],
            smooth_shading=True,
            split_sharp_edges=True,
            feature_angle=25.0,
            specular=0.25,
            specular_power=12,
            ambient=0.25,
        )
    plotter.enable_anti_aliasing("ssaa")
    _look(plotter, scene["eye"], scene["up"])
    plotter.screenshot(str(file), transparent_background=True)
    plotter.close()


def _read_foam(case: Path) -> Any:
    """Multiblock of an OpenFOAM case at its last time: internalMesh and boundary patches."""
    pv = _pyvista()

    control = case / "system" / "controlDict"
    if not control.is_file():
        raise PictureError(f"{case.as_posix()}: no system/controlDict, not an OpenFOAM case")
    pv.set_error_output_file(os.devnull)
    reader = pv.POpenFOAMReader(str(control))
    whole = (case / "constant" / "polyMesh" / "faces").exists() or (case / "constant/polyMesh/faces.gz").exists()
    split = (case / "processor0").is_dir()
    latest = times(case)[-1][0] if times(case) else 0.0
    behind = times(case / "processor0")[-1][0] if split and times(case / "processor0") else 0.0
    if split and (not whole or behind > latest):
        reader.case_type = "decomposed"
    reader.enable_all_patch_arrays()
    if reader.time_values:
        reader.set_active_time_value(reader.time_values[-1])
    return reader.read()


def _patches(blocks: Any, wanted: Sequence[str], case: Path) -> Any:
    """Surfaces of the wanted patches as one."""
    pv = _pyvista()

    boundary: Any = blocks["boundary"] if "boundary" in blocks.keys() else None  # noqa: SIM118  (a MultiBlock is no dict)
    names = [] if boundary is None else [n for n in boundary.keys() if n and n.startswith(tuple(wanted))]  # noqa: SIM118
    parts = [boundary[n] for n in names if boundary[n] is not None and boundary[n].n_cells]
    if not parts:
        have = "none" if boundary is None else ", ".join(map(str, boundary.keys())) or "none"
        raise PictureError(
            f"{case.as_posix()}: no patch whose name begins with {' or '.join(wanted)}; there are {have}"
        )
    return pv.merge([p.extract_surface(algorithm="dataset_surface") for p in parts])


def _bar() -> dict[str, Any]:
    return {
        "title": "pressure less far field [Pa]\n",
        "color": "black",
        "title_font_size": 15,
        "label_font_size": 15,
        "n_labels": 4,
        "fmt": "%.0f",
        "vertical": False,
        "position_x": 0.28,
        "position_y": 0.02,
        "width": 0.44,
        "height": 0.2,
    }


def _rounded(value: float) -> float:
    """Two significant digits, for the ends of a scale."""
    return float(f"{value:.2g}")


def _draw_pressure(job: dict[str, Any], file: Path) -> None:
    pv = _pyvista()

    case = Path(job["case"])
    blocks = _read_foam(case)
    inside, skin = blocks["internalMesh"], _patches(blocks, job["patches"], case)
    if "p" not in skin.cell_data:
        raise PictureError(f"{case.as_posix()}: the last time holds no pressure on the patches")
    sizes = inside.compute_cell_sizes(length=False, area=False, volume=True).cell_data["Volume"]
    far = float(inside.cell_data["p"][int(np.argmax(np.abs(sizes)))])
    skin.cell_data["gauge"] = (np.asarray(skin.cell_data["p"], float) - far) * job["factor"]
    area = np.abs(skin.compute_cell_sizes(length=False, area=True, volume=False).cell_data["Area"])
    order = np.argsort(skin.cell_data["gauge"])
    share = np.cumsum(area[order]) / area.sum()
    low, high = (float(skin.cell_data["gauge"][order][np.searchsorted(share, s)]) for s in (0.02, 0.98))
    plotter = pv.Plotter(off_screen=True, window_size=[760, 520], shape=(2, 1), border=False)
    for column, (side, name) in enumerate(((1.0, "from the front"), (-1.0, "from behind"))):
        plotter.subplot(column, 0)
        plotter.set_background("white")
        plotter.add_mesh(
            skin.copy(),
            scalars="gauge",
            cmap="cividis",
            clim=(_rounded(low), max(_rounded(high), _rounded(low) + 1e-9)),
            lighting=False,
            show_scalar_bar=column == 1,
            scalar_bar_args=_bar(),
        )
        plotter.add_text(name, font_size=9, color="black", position="upper_left")
        _look(plotter, (0.0, -0.25 * side, side), (0.0, side, 0.0), 0.9)
    plotter.screenshot(str(file))
    plotter.close()


def _draw_mesh(job: dict[str, Any], file: Path) -> None:
    pv = _pyvista()

    case, R = Path(job["case"]), job["radius"]
    blocks = _read_foam(case)
    skin = _patches(blocks, job["patches"], case)
    plane = blocks["internalMesh"].slice(normal=(0.0, 1.0, 0.0), origin=(0.0, 1e-6 * R, 0.0))
    if plane.n_cells == 0:
        raise PictureError(f"{case.as_posix()}: no cells in the plane through the shaft")
    middle = np.abs(np.asarray(plane.cell_centers().points, float))
    near = plane.extract_cells((middle[:, 0] < 1.6 * R) & (middle[:, 2] < 1.3 * R))
    plotter = pv.Plotter(off_screen=True, window_size=[900, 400], shape=(1, 2), border=False)
    for column, (surface, eye, up) in enumerate(
        ((near, (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)), (skin, (0.0, -0.3, 1.0), (0.0, 1.0, 0.0)))
    ):
        plotter.subplot(0, column)
        plotter.set_background("white")
        plotter.add_mesh(
            surface,
            color="#dfe8f1" if column == 0 else "#9cc3e0",
            show_edges=True,
            edge_color="#44546a",
            line_width=0.6,
            lighting=column == 1,
        )
        plotter.add_text(
            "plane through the shaft" if column == 0 else "blades", font_size=9, color="black", position="upper_left"
        )
        _look(plotter, eye, up, 0.95)
    plotter.screenshot(str(file))
    plotter.close()
