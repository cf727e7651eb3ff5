"""Parameter sweeps: every combination of the axes of a case, in batches, as one file that survives a kill.

Rows run over the axes in the order geometry (pitch, diameter, gap), air, rpm, airspeed, angle, the last one fastest.
The grid is cut into chunks whose edges depend on the axes alone, and a chunk depends on nothing but its number; each
finished chunk is a file, so an interrupted run goes on where it stopped and gives the same bytes, whoever solves them.
"""

from __future__ import annotations

import hashlib
import json
import math
import shutil
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.tables import csv_block, file_hash, plain, write_atomic
from bemt.physics.air import air_arrays
from bemt.physics.bem.coaxial import LOADS, RATIOS
from bemt.results.sweep.rows import Axis, GridResult, Statistics
from bemt.rotors.case import Case
from bemt.rotors.case.propagate import channels_at, prepared

if TYPE_CHECKING:
    from bemt.physics.air import Air
    from bemt.physics.dataset import Dataset


# Blocks of a grid as CSV of 7 significant digits, and finished blocks joined into one file.
#
# The bytes of a block depend on its numbers alone, and joining reads one block at a time.


@dataclass(frozen=True)
class Block:
    """N rows of a grid."""

    # (A,) values of each axis, in the unit of its name, and which one holds in each row
    axes: dict[str, tuple[NDArray[np.float64], NDArray[np.intp]]]
    columns: dict[str, NDArray[np.float64]]  # (N,) results, in the unit of the name; NaN where not converged
    converged: NDArray[np.bool_]  # (N,) whether the point has a solution


def encode(block: Block) -> bytes:
    """Bytes of a block.

    >>> axis = {"rpm": (np.array([5000.0, 6000.0]), np.array([0, 1]))}
    >>> print(encode(Block(axis, {"CT": np.array([0.1, np.nan])}, np.array([True, False]))).decode(), end="")
    5000,1.000000e-01,1
    6000,nan,0
    """
    return csv_block([*(_near(*axis) for axis in block.axes.values()), *block.columns.values(), block.converged])


def _near(values: NDArray[np.float64], index: NDArray[np.intp]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Only the stretch of an axis that occurs: formatting a long axis in every block would cost the square."""
    low = int(index.min())
    return values[low : int(index.max()) + 1], index - low


def join(target: Path, names: Sequence[str], parts: Sequence[Path]) -> str:
    """Put blocks together under a temporary name, in order, and rename."""
    temporary = target.with_name(f".{target.name}.tmp")
    try:
        with temporary.open("wb") as out:
            out.write(",".join(names).encode() + b"\n")
            for path in parts:
                with path.open("rb") as part:
                    shutil.copyfileobj(part, out, 1 << 20)
        digest = file_hash(temporary)
        temporary.replace(target)
        return digest
    except OSError as error:  # a full disk names no file; the temporary one nobody knows
        error.filename = str(target)
        raise
    finally:
        temporary.unlink(missing_ok=True)


CHUNK = 50_000
"""Points per chunk, at most."""
MAX_AIRS = 100_000
"""States of the air that a solver remembers."""
MAX_GEOMETRIES = 16
"""Geometries per chunk, about, at most: each takes longer than many points."""
GEOMETRY = ("diameter_in", "pitch_in", "tip_gap_mm", "z_over_D")
AIR = ("altitude_m", "density_kg_m3", "temperature_C")
FLOW = ("rpm", "airspeed_m_s", "angle_deg")

VALUES = ("thrust_N", "torque_Nm", "power_W", "CT", "CP", "J", "eta", "M_tip", "Re75")
OBLIQUE_VALUES = ("H_force_N",)
PAIR_VALUES = ("lower_rpm", *LOADS, *RATIOS)
DUCT_VALUES = ("rotor_thrust_N", "duct_thrust_N", "exhaust_speed_m_s")
STATISTICS = ("thrust_N", "torque_Nm", "M_tip")


def _turned(case: Case) -> bool:
    """Whether any point of a case's grid has an angle between wind and shaft."""
    return bool(np.any(case.axes().get("angle_deg", case.angle_deg)))


def _columns(case: Case) -> tuple[str, ...]:
    """What is written of each point."""
    more = (DUCT_VALUES, case.ducted), (OBLIQUE_VALUES, _turned(case)), (PAIR_VALUES, case.paired)
    return (*VALUES, *(name for names, there in more if there for name in names))


@dataclass(frozen=True)
class Grid:
    """Axes of a sweep in row order."""

    names: tuple[str, ...]  # Axis names with their units
    values: tuple[NDArray[np.float64], ...]  # (N,) axis values, in the unit of the axis's name
    geometries: int  # Combinations of the geometric axes
    chunk: int  # Points per chunk

    @classmethod
    def of(cls, case: Case) -> Grid | None:
        """Grid of a case."""
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


Solved = tuple[int, bytes, Statistics]
Engine = Callable[[Case, Grid, Sequence[int], bool], Generator[Solved]]
"""Solves chunks: (case, grid, numbers, whether rows are wanted) to (number, bytes, statistics) in whatever order."""


class GridSolver:
    """Evaluates stretches of a grid, rows or statistics only; remembers the last geometry and states of the air."""

    def __init__(self, case: Case, grid: Grid, threads: int = 1, rows: bool = True) -> None:
        self.case, self.grid, self.threads, self.rows = case, grid, threads, rows
        self.columns = _columns(case)
        self._axes = dict(zip(grid.names, grid.values, strict=True))
        self._last: tuple[int, Any] = (-1, None)
        self._air_names = [name for name in grid.names if name in AIR]
        self._airs: dict[int, Air] = {}

    def _state(self, flat: int) -> Air:
        """State of the air at a position on the axes of the air."""
        if flat not in self._airs:
            if len(self._airs) >= MAX_AIRS:
                self._airs.clear()
            shape = tuple(self._axes[name].size for name in self._air_names)
            at = np.unravel_index(flat, shape) if shape else ()
            values = {name: float(self._axes[name][i]) for name, i in zip(self._air_names, at, strict=True)}
            self._airs[flat] = self.case.air({self.case.axis_key(name): value for name, value in values.items()})
        return self._airs[flat]

    def _stretch(self, index: Mapping[str, NDArray[np.intp]], geometry: int) -> Dataset:
        """Points of one geometry; `index` holds the position on each axis."""
        axes = self._axes
        overrides = {self.case.axis_key(n): float(axes[n][index[n][0]]) for n in axes if n in GEOMETRY}
        size = next(iter(index.values())).size
        which = np.zeros(size, dtype=np.intp)
        for name in self._air_names:
            which = which * axes[name].size + index[name]
        flow = [
            axes[n][index[n]] if n in axes else np.full(size, default)
            for n, default in zip(FLOW, (self.case.rpm, self.case.airspeed_m_s, self.case.angle_deg), strict=True)
        ]
        distinct, here = np.unique(which, return_inverse=True)
        states = [self._state(flat) for flat in distinct.tolist()]
        air = states[0] if not self._air_names else air_arrays(states, here)
        if self._last[0] != geometry:
            self._last = (geometry, prepared(self.case.replaced(overrides)))
        model = self._last[1]
        found: Dataset = model.dataset(*channels_at(model, flow[0], flow[1], flow[2], air, self.threads))
        if _turned(self.case) and not np.any(flow[2]):  # axial points of an oblique grid
            return replace(found, values={**found.values, "H_force_N": np.where(found.converged, 0.0, np.nan)})
        return found

    def block(self, flat: NDArray[np.intp]) -> Block:
        """Solve some points."""
        grid = self.grid
        index = dict(zip(grid.names, np.unravel_index(flat, grid.shape), strict=True))
        owner = flat // (grid.size // grid.geometries)
        edges = [0, *(np.flatnonzero(np.diff(owner)) + 1).tolist(), flat.size]
        found = []
        for start, stop in zip(edges[:-1], edges[1:], strict=True):
            here = {name: i[start:stop] for name, i in index.items()}
            found.append(self._stretch(here, int(owner[start])))
        columns = {name: np.concatenate([points[name] for points in found]) for name in self.columns}
        axes = {name: (self._axes[name], index[name]) for name in grid.names}
        return Block(axes, columns, np.concatenate([points.converged for points in found]))


def solve_chunk(solver: GridSolver, number: int) -> tuple[bytes, Statistics]:
    """Bytes and statistics of one chunk."""
    grid = solver.grid
    block = solver.block(np.arange(number * grid.chunk, min((number + 1) * grid.chunk, grid.size)))
    fine = block.converged
    ends = []
    for name in STATISTICS:
        good = block.columns[name][np.isfinite(block.columns[name])]
        ends.append((float(good.min()), float(good.max())) if good.size else (math.nan, math.nan))
    statistics = Statistics(int(fine.size), int((~fine).sum()), *ends)
    told = Statistics.from_document(plain(statistics.document()))
    return encode(block) if solver.rows else b"", told


def _here(threads: int) -> Engine:
    """Engine in this process."""

    def solve(case: Case, grid: Grid, numbers: Sequence[int], rows: bool) -> Generator[Solved]:
        solver = GridSolver(case, grid, threads, rows) if numbers else None
        for number in numbers:
            assert solver is not None
            yield number, *solve_chunk(solver, number)

    return solve


def _merge(statistics: list[Statistics]) -> Statistics:
    ends = []
    for name in STATISTICS:
        lows, highs = zip(*(getattr(s, name) for s in statistics), strict=True)
        ends.append((float(np.fmin.reduce(lows)), float(np.fmax.reduce(highs))))
    return Statistics(sum(s.points for s in statistics), sum(s.unconverged for s in statistics), *ends)


def _parts(folder: Path, fingerprint: str, resume: bool) -> Path:
    """Folder of the chunks, with those that are solved to `resume`; those of another grid are removed."""
    parts = folder / f"grid.parts-{fingerprint[:16]}-csv"
    for old in folder.glob("grid.parts-*"):
        if old != parts or not resume:
            shutil.rmtree(old)
    parts.mkdir(parents=True, exist_ok=True)
    return parts


def run_grid(
    case: Case, folder: Path | None, fingerprint: str, threads: int = 1,
    progress: Callable[[int, int], None] | None = None, resume: bool = True, engine: Engine | None = None,
) -> GridResult | None:  # fmt: skip
    """Solve the grid of a case."""
    grid = Grid.of(case)
    if grid is None:
        return None
    parts = None if folder is None else _parts(folder, fingerprint, resume)
    statistics: dict[int, Statistics] = {}
    done = 0

    def count(number: int, found: Statistics) -> None:
        nonlocal done
        statistics[number] = found
        done += found.points
        if progress is not None:
            progress(done, grid.size)

    if parts is not None:
        for number in range(grid.chunks):
            found = _finished(_part(parts, number))
            if found is not None:
                count(number, found)
    todo = [number for number in range(grid.chunks) if number not in statistics]
    with closing((engine or _here(threads))(case, grid, todo, parts is not None)) as solved:
        for number, data, made in solved:
            if parts is not None:
                path = _part(parts, number)
                write_atomic(path, data)
                told = plain(made.document())
                record = {"statistics": told, "sha256": _seal(data, told)}
                write_atomic(path.with_suffix(".json"), json.dumps(record))
            count(number, made)
    digest = None
    names = (*grid.names, *_columns(case), "converged")
    if folder is not None and parts is not None:
        files = [_part(parts, number) for number in range(grid.chunks)]
        digest = join(folder / "grid.csv", names, files)
        shutil.rmtree(parts, ignore_errors=True)
    axes = {n: Axis(v.size, v.min(), v.max()) for n, v in zip(grid.names, grid.values, strict=True)}
    file = None if folder is None else f"{case.name}/grid.csv"
    merged = _merge([statistics[number] for number in range(grid.chunks)])
    return GridResult(**vars(merged), axes=axes, columns=names, file=file, sha256=digest)


def _part(parts: Path, number: int) -> Path:
    return parts / f"{number:06d}.csv"


def _seal(data: bytes, statistics: Mapping[str, Any]) -> str:
    """Hash of a chunk and of what is said about it."""
    return hashlib.sha256(data + json.dumps(statistics).encode()).hexdigest()


def _finished(path: Path) -> Statistics | None:
    """Statistics of a chunk that an earlier run finished, or None when it is not as it was written."""
    try:
        record = json.loads(path.with_suffix(".json").read_text())
        if _seal(path.read_bytes(), record["statistics"]) == record["sha256"]:
            return Statistics.from_document(record["statistics"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        pass
    return None
