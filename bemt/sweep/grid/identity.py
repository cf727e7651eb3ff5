"""Identity of the program that makes numbers: its own text, and the libraries that decide digits."""

from __future__ import annotations

import hashlib
import importlib.metadata
from functools import lru_cache
from pathlib import Path

import bemt


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
