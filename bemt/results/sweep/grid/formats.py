"""Blocks of a grid as CSV of 7 significant digits, and finished blocks joined into one file.

The bytes of a block depend on its numbers alone, and joining reads one block at a time.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import bemt
from bemt.base.errors import Fault, InputError
from bemt.base.tables import csv_block, file_hash


@lru_cache(maxsize=1)
def program_hash() -> str:
    """Hash of the program text and of the libraries that decide numbers."""
    digest = hashlib.sha256(bemt.__version__.encode())
    here = Path(bemt.__file__).parent
    for folder in (here, here.parent / "geometry"):
        for path in sorted(folder.rglob("*.py")):
            digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    for library in ("numpy", "numba", "neuralfoil"):
        try:
            digest.update(f"{library} {importlib.metadata.version(library)}\0".encode())
        except importlib.metadata.PackageNotFoundError:
            digest.update(f"{library} absent\0".encode())
    return digest.hexdigest()


def require_extra(option: str, *modules: str) -> None:
    """Refuse an option whose optional packages are not installed."""
    missing = [name for name in modules if importlib.util.find_spec(name) is None]
    if missing:
        expected = "the optional packages of the extra 'dask'"
        raise InputError(Fault("", option, f"no {' and no '.join(missing)}", expected, "pip install 'bemt[dask]'"))


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
