"""Parameter sweeps: every combination of the axes of a case, in batches, as CSV that survives a kill.

Rows run over the axes in the order geometry (pitch, diameter, gap), air, then rpm and airspeed, the last one fastest.
The grid is cut into chunks whose edges depend on the axes alone; each finished chunk is a file, so an interrupted run
goes on where it stopped and gives the same bytes.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.case import Case
from bemt.evaluate import Points, air_arrays, evaluate, prepare
from bemt.tables import csv_block, plain, write_atomic

__all__ = ["CHUNK", "Grid", "run_grid"]

CHUNK = 50_000
"""Points per chunk, at most."""
MAX_GEOMETRIES = 16
"""Geometries per chunk, about, at most: each takes longer than many points."""
GEOMETRY = ("diameter_in", "pitch_in", "tip_gap_mm")
AIR = ("altitude_m", "density_kg_m3", "temperature_C")
FLOW = ("rpm", "airspeed_m_s")

VALUES = ("thrust_N", "torque_Nm", "power_W", "CT", "CP", "J", "eta", "M_tip", "Re75")
DUCT_VALUES = ("rotor_thrust_N", "duct_thrust_N", "exhaust_speed_m_s")
STATISTICS = ("thrust_N", "torque_Nm", "M_tip")


@dataclass(frozen=True)
class Grid:
    """Axes of a sweep in row order.

    Parameters
    ----------
    names : tuple of str
        Axis names with their units.
    values : tuple of (N,) float
        Axis values, in the unit of the axis's name.
    geometries : int
        Combinations of the geometric axes.
    chunk : int
        Points per chunk.
    """

    names: tuple[str, ...]
    values: tuple[NDArray[np.float64], ...]
    geometries: int
    chunk: int

    @classmethod
    def of(cls, case: Case) -> Grid | None:
        """Grid of a case.

        Parameters
        ----------
        case : Case
            The case.

        Returns
        -------
        Grid or None
            None when the case sweeps nothing.
        """
        axes = case.axes()
        if not axes:
            return None
        names = tuple(name for group in (GEOMETRY, AIR, FLOW) for name in group if name in axes)
        geometries = math.prod(axes[name].size for name in names if name in GEOMETRY)
        per_geometry = math.prod(axes[name].size for name in names if name not in GEOMETRY)
        chunk = min(CHUNK, max(1, MAX_GEOMETRIES * per_geometry)) if geometries > 1 else CHUNK
        return cls(names, tuple(axes[name] for name in names), geometries, chunk)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values per axis."""
        return tuple(v.size for v in self.values)

    @property
    def size(self) -> int:
        """Number of points."""
        return math.prod(self.shape)

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.size // self.chunk)


class _Solver:
    """Evaluates stretches of a grid; remembers the last geometry and all states of the air."""

    def __init__(self, case: Case, grid: Grid, threads: int) -> None:
        self.case, self.grid, self.threads = case, grid, threads
        self._last: tuple[int, Any] = (-1, None)
        air_axes = [(n, v) for n, v in zip(grid.names, grid.values, strict=True) if n in AIR]
        self._air_names = [n for n, _ in air_axes]
        shape = tuple(v.size for _, v in air_axes)
        self._airs = []
        for flat in range(math.prod(shape)):
            at = np.unravel_index(flat, shape) if shape else ()
            overrides = {case.axis_key(n): float(v[i]) for (n, v), i in zip(air_axes, at, strict=True)}
            self._airs.append(case.air(overrides))

    def _ready(self, geometry: int, overrides: Mapping[str, float]) -> Any:
        if self._last[0] != geometry:
            self._last = (geometry, prepare(self.case, overrides))
        return self._last[1]

    def stretch(self, index: Mapping[str, NDArray[np.intp]], geometry: int) -> Points:
        """Points of one geometry; `index` holds the position on each axis."""
        axes = dict(zip(self.grid.names, self.grid.values, strict=True))
        overrides = {self.case.axis_key(n): float(axes[n][index[n][0]]) for n in axes if n in GEOMETRY}
        size = next(iter(index.values())).size
        which = np.zeros(size, dtype=np.intp)
        for name in self._air_names:
            which = which * axes[name].size + index[name]
        flow = [axes[n][index[n]] if n in axes else np.full(size, default)
                for n, default in zip(FLOW, (self.case.rpm, self.case.airspeed_m_s), strict=True)]  # fmt: skip
        air = self._airs[0] if not self._air_names else air_arrays(self._airs, which)
        return evaluate(self._ready(geometry, overrides), flow[0], flow[1], air, self.threads)


def _chunk(solver: _Solver, number: int) -> tuple[bytes, dict[str, Any]]:
    """CSV lines and statistics of one chunk."""
    grid = solver.grid
    start, stop = number * grid.chunk, min((number + 1) * grid.chunk, grid.size)
    flat = np.arange(start, stop)
    index = dict(zip(grid.names, np.unravel_index(flat, grid.shape), strict=True))
    per_geometry = grid.size // grid.geometries
    names = (*VALUES, *(DUCT_VALUES if solver.case.ducted else ()))
    parts: dict[str, list[NDArray[np.float64]]] = {name: [] for name in names}
    converged: list[NDArray[np.bool_]] = []
    for geometry in range(start // per_geometry, (stop - 1) // per_geometry + 1):
        here = slice(max(start, geometry * per_geometry) - start, min(stop, (geometry + 1) * per_geometry) - start)
        points = solver.stretch({name: i[here] for name, i in index.items()}, geometry)
        for name in names:
            parts[name].append(getattr(points, name))
        converged.append(points.converged)
    columns = {name: np.concatenate(arrays) for name, arrays in parts.items()}
    fine = np.concatenate(converged)
    cells: list[Any] = [(v, index[n]) for n, v in zip(grid.names, grid.values, strict=True)]
    statistics: dict[str, Any] = {"points": int(fine.size), "unconverged": int((~fine).sum())}
    for name in STATISTICS:
        good = columns[name][np.isfinite(columns[name])]
        statistics[name] = [float(good.min()), float(good.max())] if good.size else [None, None]
    return csv_block([*cells, *columns.values(), fine]), plain(statistics)


def _merge(statistics: list[dict[str, Any]]) -> dict[str, Any]:
    merged: dict[str, Any] = {key: sum(s[key] for s in statistics) for key in ("points", "unconverged")}
    for name in STATISTICS:
        pairs = [s[name] for s in statistics if s[name][0] is not None]
        merged[name] = [min(p[0] for p in pairs), max(p[1] for p in pairs)] if pairs else [None, None]
    return merged


def run_grid(
    case: Case,
    folder: Path | None,
    fingerprint: str,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
    resume: bool = True,
) -> dict[str, Any] | None:
    """Solve the grid of a case.

    Parameters
    ----------
    case : Case
        The case.
    folder : Path or None
        Where ``grid.csv`` is written; None keeps only the statistics.
    fingerprint : str
        Identity of everything that decides the result; chunks of another one are thrown away.
    threads : int
        Threads of the solver.
    progress : callable, optional
        Called with (points done, points).
    resume : bool
        Whether finished chunks are reused.

    Returns
    -------
    dict or None
        Axes, points, unconverged points, ranges, file name; None when the case sweeps nothing.
    """
    grid = Grid.of(case)
    if grid is None:
        return None
    parts = None if folder is None else folder / f"grid.parts-{fingerprint[:16]}"
    if folder is not None and parts is not None:
        for old in folder.glob("grid.parts-*"):
            if old != parts or not resume:
                shutil.rmtree(old)
        parts.mkdir(parents=True, exist_ok=True)
    solver: _Solver | None = None
    statistics = []
    for number in range(grid.chunks):
        found = None if parts is None else _finished(parts, number)
        if found is None:
            solver = solver or _Solver(case, grid, threads)
            lines, found = _chunk(solver, number)
            if parts is not None:
                write_atomic(parts / f"{number:06d}.csv", lines)
                write_atomic(parts / f"{number:06d}.json", json.dumps(found | {"bytes": len(lines)}))
        statistics.append(found)
        if progress is not None:
            progress(min((number + 1) * grid.chunk, grid.size), grid.size)
    names = (*grid.names, *VALUES, *(DUCT_VALUES if case.ducted else ()), "converged")
    if folder is not None and parts is not None:
        _join(folder / "grid.csv", names, parts, grid.chunks)
    axes = {n: {"num": v.size, "min": v.min(), "max": v.max()} for n, v in zip(grid.names, grid.values, strict=True)}
    file = None if folder is None else f"{case.name}/grid.csv"
    return {"axes": axes, **_merge(statistics), "columns": list(names), "file": file}


def _finished(parts: Path, number: int) -> dict[str, Any] | None:
    """Statistics of a chunk that an earlier run finished, or None."""
    try:
        found = json.loads((parts / f"{number:06d}.json").read_text())
        if (parts / f"{number:06d}.csv").stat().st_size == found.pop("bytes"):
            return dict(found)
    except (OSError, ValueError, KeyError):
        pass
    return None


def _join(target: Path, names: tuple[str, ...], parts: Path, count: int) -> None:
    """Put header and chunks together under a temporary name, rename, and remove the chunks."""
    temporary = target.with_name(f".{target.name}.tmp")
    try:
        with temporary.open("wb") as out:
            out.write(",".join(names).encode() + b"\n")
            for number in range(count):
                with (parts / f"{number:06d}.csv").open("rb") as part:
                    shutil.copyfileobj(part, out, 1 << 20)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)
    shutil.rmtree(parts, ignore_errors=True)
