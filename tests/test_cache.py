"""Cached section tables are those that were made, whatever happened meanwhile."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bemt.base import cache
from bemt.physics.sections import neuralfoil as polars_neuralfoil
from bemt.physics.sections.neuralfoil import tunnel_polar
from bemt.physics.sections.polars import ALPHA_GRID, Polar
from geometry.airfoil import naca

SECTIONS = {"0012": naca("0012"), "4412": naca("4412")}
pytestmark = pytest.mark.usefixtures("own_cache")


def entry(folder: Path) -> Path:
    """Return the only entry of a cache folder."""
    (path,) = (folder / "polar").glob("*.npz")
    return path


@pytest.fixture
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Empty cache folder, empty memory."""
    monkeypatch.setenv("BEMT_CACHE", str(tmp_path / "c"))
    cache.clear_memory()
    return tmp_path / "c"


def bits(p: Polar) -> tuple[bytes, bytes, bytes]:
    """Bytes of the tables."""
    assert p.confidence is not None
    return p.cl.tobytes(), p.cd.tobytes(), p.confidence.tobytes()


def test_cache_hit_equals_cold_bit_for_bit(fresh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cold = tunnel_polar(SECTIONS["4412"])
    assert not [f for f in (fresh / "polar").iterdir() if f.suffix != ".npz" or f.name.startswith(".")]
    cache.clear_memory()
    monkeypatch.setattr(polars_neuralfoil, "_make", lambda *a: pytest.fail("the disk entry was not used"))
    warm = tunnel_polar(SECTIONS["4412"])
    assert bits(warm) == bits(cold) and warm.key == cold.key
    assert bits(tunnel_polar(SECTIONS["4412"])) == bits(cold)


def test_every_setting_and_the_shape_make_another_entry(fresh: Path) -> None:
    re = np.array([1e5])
    settings = ({}, {"n_crit": 7.0}, {"xtr_upper": 0.5}, {"xtr_lower": 0.5}, {"ar": 5.0}, {"method": "normal"},
                {"past_stall": 0.05}, {"lift_floor": 0.0}, {"model": "medium"})  # fmt: skip
    for kw in settings:
        tunnel_polar(SECTIONS["4412"], re=re, **kw)
    tunnel_polar(SECTIONS["0012"], re=re)
    tunnel_polar(SECTIONS["4412"], re=np.array([1.1e5]))
    assert len(list((fresh / "polar").glob("*.npz"))) == len(settings) + 2


@pytest.mark.parametrize("damage", ["empty", "cut", "noise", "swapped"])
def test_damaged_entry_is_made_again(damage: str, fresh: Path) -> None:
    re = np.array([1e5])
    cold = tunnel_polar(SECTIONS["4412"], re=re)
    path = entry(fresh)
    raw = path.read_bytes()
    if damage == "swapped":  # a valid archive whose content does not fit its checksum
        with np.load(path) as archive:
            arrays = dict(archive)
        arrays["cl"] = arrays["cl"] + 1.0
        np.savez(path, **arrays)
    else:
        middle = raw[: len(raw) // 2]
        path.write_bytes({"empty": b"", "cut": middle, "noise": middle + bytes(64) + raw[len(middle) + 64 :]}[damage])
    cache.clear_memory()
    assert bits(tunnel_polar(SECTIONS["4412"], re=re)) == bits(cold)
    cache.clear_memory()
    with np.load(entry(fresh)) as archive:
        assert np.array_equal(archive["cl"][:, 0], cold.cl[:, 0, 0])


@pytest.mark.parametrize("place", ["off", "", "/dev/null/none"])
def test_works_without_a_cache_folder(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BEMT_CACHE", place)
    cache.clear_memory()
    assert tunnel_polar(SECTIONS["0012"], re=np.array([1e5])).cl.shape == (ALPHA_GRID.size, 1, 1)


def test_cache_folder_rule(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("BEMT_CACHE", str(tmp_path / "own"))
    assert cache.cache_dir() == tmp_path / "own"
    monkeypatch.delenv("BEMT_CACHE")
    assert cache.cache_dir() == tmp_path / "bemt"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache.cache_dir() == Path.home() / ".cache" / "bemt"


def test_installed_version_is_that_of_the_metadata() -> None:
    from importlib.metadata import PackageNotFoundError, version

    for package in ("neuralfoil", "numpy", "pytest"):
        assert cache.installed_version(package) == version(package)
    with pytest.raises(PackageNotFoundError):
        cache.installed_version("no_such_package_here")


def test_a_cache_hit_needs_no_neuralfoil(own_cache: Path) -> None:
    tunnel_polar(SECTIONS["4412"])
    code = (
        "import sys; from bemt.physics.sections.neuralfoil import tunnel_polar as f; from geometry.airfoil import naca;"
        "f(naca('4412')); print(sorted({'neuralfoil', 'aerosandbox', 'scipy', 'numba'} & set(sys.modules)))"
    )
    root = Path(cache.__file__).parents[2]
    env = os.environ | {"BEMT_CACHE": str(own_cache), "PYTHONPATH": str(root)}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True, cwd=root)
    assert done.stdout.strip() == "[]"


def test_without_a_folder_that_can_be_written_the_kernel_still_compiles_and_says_so_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    from numba.core import caching

    from bemt.physics.bem import vecmath

    def read_only(_: object) -> None:
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(caching._CacheLocator, "ensure_cache_path", read_only)
    vecmath._say_unkept.cache_clear()
    entries = [vecmath.njit(lambda x, n=n: x + n) for n in (1.0, 2.0)]
    assert [vecmath.ready(entry)(1.0) for entry in entries] == [2.0, 3.0]
    assert [r.getMessage() for r in caplog.records if "NUMBA_CACHE_DIR" in r.getMessage()] == [caplog.messages[0]]
