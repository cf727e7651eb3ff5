"""A rotor for the page: grids of points that a viewer turns, and a still picture of the same for paper and cards."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Sequence

import numpy as np

from bemt.base.arrays import Array
from geometry.mesh import Surface

COLOURS = {"blade": "#4f93c4", "hub": "#8d99a6", "duct": "#c9973f", "cut": "#e3c58c", "stator": "#b58a4a"}
OPEN, CUT_OPEN = (-0.25, 0.95, 1.25), (0.45, 1.05, 0.95)
"""How the rotor first stands: turned about its shaft, then tipped towards the eye [rad]; its size in the viewer. [-]"""
LIGHT = np.array([0.35, 0.45, 0.82])


def _view(surfaces: Sequence[Surface]) -> tuple[float, float, float]:
    return CUT_OPEN if any(s.name == "duct" for s in surfaces) else OPEN


def viewer(surfaces: Sequence[Surface]) -> dict[str, str]:
    """Pack the grids for the viewer: 16-bit integers round their middle, which keeps 1/32767 of the farthest point."""
    everything = np.concatenate([s.points.reshape(-1, 3) for s in surfaces])
    middle = np.array([0.0, 0.0, 0.5 * (everything[:, 2].max() + everything[:, 2].min())])
    size = float(np.linalg.norm(everything - middle, axis=1).max())
    mesh = []
    for s in surfaces:
        data = np.round((s.points - middle) / size * 32767).astype("<i2").tobytes()
        mesh.append({"rows": s.points.shape[0], "columns": s.points.shape[1], "copies": s.copies,
                     "colour": COLOURS[s.name], "data": base64.b64encode(data).decode()})  # fmt: skip
    return {"mesh": json.dumps(mesh), "view": json.dumps(_view(surfaces))}


def _turned(points: Array, angle: float, axis: int) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    out = points.copy()
    out[..., i], out[..., j] = c * points[..., i] - s * points[..., j], s * points[..., i] + c * points[..., j]
    return out


def still(surfaces: Sequence[Surface], width: int = 560) -> bytes:
    """Draw the surfaces as PNG, facets from back to front, in parallel projection on nothing."""
    from PIL import Image, ImageDraw

    yaw, pitch, _ = _view(surfaces)
    facets, colours = [], []
    for s in surfaces:
        colour = np.array([int(COLOURS[s.name][i : i + 2], 16) for i in (1, 3, 5)], float)
        for k in range(s.copies):
            p = _turned(_turned(s.points, yaw + 2 * np.pi * k / s.copies, 2), -pitch, 0)
            quads = np.stack([p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]], axis=2).reshape(-1, 4, 3)
            normal = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
            normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
            facets.append(quads)
            colours.append(colour * (0.38 + 0.62 * np.abs(normal @ LIGHT)[:, None]))
    quads, tones = np.concatenate(facets), np.concatenate(colours).clip(0, 255).astype(int)
    low, high = quads[..., :2].min(axis=(0, 1)), quads[..., :2].max(axis=(0, 1))
    scale = (2 * width - 8) / (high[0] - low[0])
    page = Image.new("RGBA", (2 * width, int(scale * (high[1] - low[1])) + 8))
    draw = ImageDraw.Draw(page)
    at = 4 + scale * (quads[..., :2] - low)
    at[..., 1] = page.height - at[..., 1]
    for i in np.argsort(quads[..., 2].mean(axis=1), kind="stable"):
        tone = (*tones[i].tolist(), 255)
        draw.polygon([tuple(corner) for corner in at[i].tolist()], fill=tone, outline=tone)
    out = io.BytesIO()
    page.resize((width, page.height // 2), Image.Resampling.BOX).save(out, "png", optimize=True)
    return out.getvalue()
