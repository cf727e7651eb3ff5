"""What tests of several promises share: the reference data, a small rotor, and where caches go."""

from __future__ import annotations

import gc
import importlib.util
import os
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from bemt.physics.sections.polars import Polar
    from geometry.duct import Duct
    from geometry.mesh import MeshModel, Options
    from geometry.rotor import Rotor

ROOT = Path(__file__).resolve().parents[1]
KEPT_ROTORS = 800e6
"""Bytes of prepared rotors in each worker: tests ask for the same few cases again and again [B]."""


def pytest_configure(config: pytest.Config) -> None:
    """Give section tables a cache that outlives the run, is no part of the user's own and is ignored by git.

    A table is found by the hash of all that decides it, so an old one cannot be taken for a new one; a fresh folder
    each time would only cost NeuralFoil's time again. Set before any test, so that child processes inherit it.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # more threads only wait for each other: small matrices, a worker a core
    threadpool_limits(1, "blas")  # of numpy here, which is loaded already
    os.environ.setdefault("BEMT_COMPILE", "always")  # equal to the last bit, whichever call is the first
    cache = getattr(config, "cache", None)  # absent under -p no:cacheprovider: the user's cache serves then
    if cache is not None:
        os.environ.setdefault("BEMT_CACHE", str(cache.mkdir("bemt")))
    gc.disable()  # until everything is collected, which stays


def pytest_collection_finish() -> None:
    """Look for garbage among what tests make, not among the modules and tests, which stay; prepare a rotor once."""
    from bemt.physics.bem.model import PREPARED

    PREPARED.most = KEPT_ROTORS
    gc.freeze()
    gc.set_threshold(20_000, 50, 100)
    gc.enable()


@pytest.fixture(scope="session")
def project() -> Path:
    """Folder of the repository."""
    return ROOT


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Published reference data, which are no part of the project: ``$BEMT_DATA``, else ``../shared/data``."""
    named = os.environ.get("BEMT_DATA")
    folder = Path(named).expanduser() if named else ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"reference data not found at {folder}; name their folder in BEMT_DATA")
    return folder


@pytest.fixture(scope="session")
def script(project: Path) -> Callable[[str], Any]:
    """A script of docs/ by its name, as a module."""

    def load(name: str) -> Any:
        spec = importlib.util.spec_from_file_location(f"docs_{name}", project / "docs" / f"{name}.py")
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module  # dataclasses look their module up
        spec.loader.exec_module(module)
        return module

    return load


@pytest.fixture
def put(tmp_path: Path) -> Callable[[str, str], Path]:
    """Write a text to a file below the folder of the test."""

    def write(name: str, text: str) -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    return write


@pytest.fixture(scope="module")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Cache folder of one test file, empty at first, on the disk and in memory."""
    from bemt.base import cache

    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BEMT_CACHE", str(folder))
        cache.clear_memory()
        yield folder
    cache.clear_memory()


def _content(item: Any) -> object:
    """All that an object holds, every bit: equal content, equal solids."""
    if is_dataclass(item):
        return type(item), tuple(_content(getattr(item, field.name)) for field in fields(item))
    if isinstance(item, np.ndarray):
        return item.shape, item.dtype.str, item.tobytes()
    if isinstance(item, tuple | list):
        return tuple(map(_content, item))
    assert item is None or isinstance(item, str | int | float), f"content of {item!r} is not known"
    return repr(item)


_SOLIDS: dict[object, MeshModel] = {}


@pytest.fixture
def equal_solids_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Mesh a rotor that is bit for bit one that was meshed before no second time; a command reads its case anew."""
    from bemt.tools.cfd.openfoam import write
    from bemt.tools.exports import printing
    from geometry import export
    from geometry.mesh import build

    def once(rotor: Rotor, duct: Duct | None = None, options: Options | None = None) -> MeshModel:
        key = _content((rotor, duct, options))
        if key not in _SOLIDS:
            _SOLIDS[key] = build(rotor, duct, options)
        return _SOLIDS[key]

    for module in (write, printing, export):
        monkeypatch.setattr(module, "build", once)


@pytest.fixture(scope="session")
def rotor() -> Rotor:
    """Two-bladed 8x5 propeller by name only: helix, generic chord law."""
    from geometry.airfoil import naca4
    from geometry.laws import helix
    from geometry.rotor import Rotor

    inch = 0.0254
    return Rotor(helix(8 * inch, 5 * inch, anchors=naca4(0.04, 0.4, 0.12)), 2, name="8x5")


@pytest.fixture(scope="session")
def polar() -> Polar:
    """Cambered section with a stall, from closed forms: no network, no Reynolds dependence."""
    import numpy as np

    from bemt.physics.sections.polars import ExtrapolatedTable, from_tables

    alpha = np.radians(np.arange(-20.0, 25.5, 0.5))
    linear = 5.9 * (alpha + np.radians(4.0))
    cl = np.clip(linear, -0.9, 1.3) - 0.8 * np.clip(np.abs(alpha) - np.radians(13.0), 0.0, None)
    return from_tables(
        [ExtrapolatedTable(alpha, cl, 0.012 + 0.008 * cl**2)], name="closed form", source="made for tests"
    )
