"""The promise of the base install: it works without the extras, and what needs one says which."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ABSENT = ("cadquery", "OCP", "trimesh", "manifold3d", "pyvista", "vtk", "vtkmodules", "dask", "distributed",
          "xarray", "psutil", "sklearn")  # fmt: skip


@pytest.fixture
def bare(tmp_path: Path, project: Path) -> dict[str, str]:
    """Environment of a process in which no library of an extra can be found."""
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text(
        "from importlib.machinery import PathFinder\n"
        "real = PathFinder.find_spec\n"
        f"absent = {ABSENT!r}\n"
        "def find(name, path=None, target=None):\n"
        "    return None if name.partition('.')[0] in absent else real(name, path, target)\n"
        "PathFinder.find_spec = staticmethod(find)\n"
    )
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path / "site"), str(project)])}


def bemt(env: dict[str, str], cwd: Path, *words: str) -> subprocess.CompletedProcess[str]:
    run = [sys.executable, "-m", "bemt", *words]
    return subprocess.run(run, cwd=cwd, env=env, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize(
    ("words", "extra"),
    [
        (("export", "cases/prop_8x5", "--out", "o", "--format", "step"), "cad"),
        (("export", "cases/prop_8x5", "--out", "o", "--format", "stl", "--printable"), "cad"),
        (("stations", "lump.stl", "--unit", "mm"), "cad"),
        (("sweep", "cases/prop_8x5", "--engine", "dask"), "dask"),
    ],
)
def test_a_missing_extra_is_named_with_the_line_that_installs_it(
    words: tuple[str, ...], extra: str, bare: dict[str, str], tmp_path: Path, project: Path
) -> None:
    shutil.copytree(project / "cases" / "prop_8x5", tmp_path / "cases" / "prop_8x5")
    (tmp_path / "lump.stl").write_bytes(bytes(84))
    done = bemt(bare, tmp_path, *words)
    assert done.returncode == 2, done.stderr
    assert f"bemt[{extra}]" in done.stderr and "pip install" in done.stderr
    assert "case.toml: " not in done.stderr and "--manifold3d" not in done.stderr, "no fault of the case"
    assert not (tmp_path / "o" / "manifest.json").exists()


def test_the_base_install_answers(bare: dict[str, str], tmp_path: Path, project: Path) -> None:
    shutil.copytree(project / "cases" / "prop_8x5", tmp_path / "cases" / "prop_8x5")
    (tmp_path / "log.csv").write_text("rpm,thrust_N\n8000,3.2\n10000,5.0\n12000,7.2\n")
    for words in (("import", "log.csv"), ("report", "cases", "--out", "r")):
        done = bemt(bare, tmp_path, *words)
        assert done.returncode == 0, done.stderr
    page = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    assert "data-mesh=" in page and "data:image/png" in page, "the rotor is shown without the extras"
