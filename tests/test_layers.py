"""The promise of the rooms: imports go up the flow of data, the core is pure.

The rules are the tables below; `violations` reads source text and knows nothing of the tree, so that planted faults
can prove that every rule bites.
"""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from fnmatch import fnmatchcase
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

COMPILED = "physics.bem.kernel|physics.bem.residual|physics.bem.vecmath"  # the only files with numba at the top

# Rooms from the ground up. A module may import rooms further up this list and its own; nothing below it.
# A room is patterns of module names below `bemt.` (`|` joins two); the first that matches holds.
ROOMS: tuple[str, ...] = (
    # base: knows no rotor
    "base|base.*",
    # physics
    "physics.air",
    "physics.cavitation",
    "physics.coefficients",
    "physics.vortex_cylinder",
    "physics.wake",
    "physics.dataset|physics.dataset.*",
    "physics.sections|physics.sections.*",
    "physics.effects|physics.effects.*",
    "physics.bem|physics.bem.*",
    "physics.k1k2",
    "physics",
    # data
    "data.readers|data.readers.*",
    "data.recordings|data.recordings.*",
    "data|data.actions",
    "rotors|rotors.*",
    # judge
    "judge.explanation|judge.loss",
    "judge.compare|judge.compare.*",
    "judge.diagnose|judge.diagnose.*",
    "judge.proof|judge.proof.*",
    "judge|judge.actions|judge.import_files",
    # results
    "results.sweep|results.sweep.*",
    "results.report|results.report.*",
    "results|results.actions",
    "tools|tools.*",
    # app
    "app|app.*",
    "__main__",
)
# A tool imports no other tool, and nothing else imports a tool: they are found by scanning. An export target that
# belongs to a tool follows the contract of exports, which alone asks for it.
TOOL = re.compile(r"bemt\.tools\.(\w+)")
CONTRACTS = {("bemt.tools.cfd.openfoam.target", "bemt.tools.exports.base")}
# What may touch the world outside, and how. What is not named touches nothing.
MAY: dict[str, set[str]] = {
    "bemt.app.*": {"print", "files", "environment", "clock"},  # and nothing else prints
    "bemt.base.cache": {"files", "environment"},
    "bemt.base.packed": {"files"},
    "bemt.base.checkout": {"files"},
    "bemt.base.given": {"environment"},
    "bemt.base.tables|bemt.base.toml_text": {"files"},
    "bemt.rotors.case|bemt.rotors.case.*": {"files"},
    "bemt.rotors.population|bemt.rotors.propeller|bemt.rotors.actions": {"files"},
    "bemt.judge.diagnose.contrast|bemt.judge.diagnose.ask|bemt.judge.import_files": {"files"},
    "bemt.results.actions": {"clock"},
    "bemt.data.readers|bemt.data.readers.*": {"files"},
    "bemt.data.recordings.adapt": {"files"},
    "bemt.data.recordings.database": {"files"},
    "bemt.data.recordings.load": {"files"},
    "bemt.rotors.k1k2_points|bemt.rotors.k1k2_calibration": {"files"},
    "bemt.data.recordings.cfd_files|bemt.data.recordings.cfd_options|bemt.data.recordings.cfd_run": {"files"},
    "bemt.data.recordings.stated": {"files"},
    "bemt.results.sweep.grid|bemt.results.sweep.dask_engine|bemt.results.sweep.store|bemt.rotors.validate.points": {
        "files"
    },
    "bemt.results.sweep.batch": {"files", "environment"},
    "bemt.judge.diagnose.figures|bemt.judge.diagnose.folder|bemt.judge.diagnose.rotor_calibration": {"files"},
    "bemt.judge.diagnose.fit": {"files"},
    "bemt.judge.proof.prove": {"files", "clock", "environment"},
    "bemt.judge.proof.loop": {"files"},
    "bemt.judge.proof.real": {"files"},
    "bemt.judge.proof.rows": {"files"},
    "bemt.tools.exports.*": {"files"},
    "bemt.tools.flight.actions|bemt.tools.flight.read": {"files"},
    "bemt.tools.flight.ardupilot": {"files"},
    "bemt.tools.flight.crazyflie": {"files"},
    "bemt.tools.flight.px4": {"files"},
    "bemt.tools.flight.table": {"files"},
    "bemt.tools.cfd.*": {"files", "clock", "environment"},
    "bemt.tools.stand.*": {"files", "clock", "environment"},
    # two processes that talk through pipes, and the questions of a sitting
    "bemt.tools.stand.guard|bemt.tools.stand.simulated|bemt.tools.stand.session": {"print"},
    "bemt.judge.proof.live": {"clock"},
    "bemt.tools.design.motors_file": {"files"},
    "bemt.tools.drive.*_file|bemt.tools.drive.*_folder|bemt.tools.drive.*_result": {"files"},
    "bemt.results.report|bemt.results.report.*": {"files"},
    "geometry.export": {"files"},
}

# What makes the data of the proof must know nothing of what is proved, not even through others.
BLIND = "bemt.judge.proof.truth*|bemt.judge.proof.stand*|" + "|".join(
    f"bemt.judge.proof.{x}" for x in ("rigs", "causes", "separation")
)
UNSEEN = "|".join(
    f"bemt.{x}|bemt.{x}.*" for x in ("physics.bem", "physics.effects", "physics.sections", "judge.diagnose")
)

HEAVY = {
    "OCP", "aerosandbox", "cadquery", "casadi", "dask", "distributed", "jinja2", "manifold3d", "matplotlib",
    "neuralfoil", "pandas", "pyarrow", "pyvista", "scipy", "sklearn", "trimesh", "vtk", "vtkmodules", "wisdem",
}  # fmt: skip
LIGHT = "|".join((
    "bemt|bemt.__main__|bemt.app|bemt.app.cli|bemt.app.face|bemt.app.registry|bemt.app.registry",
    "bemt.base|bemt.base.action|bemt.base.errors|bemt.base.plugins", "bemt.*.actions|bemt.*.import_files",
    *(f"bemt.tools.{tool}" for tool in ("cfd", "design", "drive", "exports", "flight", "stand")),  # what they offer
))  # fmt: skip  # --help: standard library only

FILE_CALLS = {
    "open", "read_text", "write_text", "read_bytes", "write_bytes", "mkdir", "unlink", "rename", "touch", "iterdir",
    "glob", "rglob", "savez", "savetxt", "loadtxt", "genfromtxt", "fromfile", "tofile", "read_csv", "to_csv",
}  # fmt: skip
OS_ENVIRONMENT = {"environ", "environb", "getenv", "putenv"}
OS_PURE = {"PathLike", "fspath", "path", "sep", "cpu_count", "sched_getaffinity", "getpid"}
FILE_MODULES = {"tempfile", "shutil", "glob", "subprocess", "socket", "urllib", "sqlite3"}


@cache
def match(name: str, room: str) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in room.split("|"))


@cache
def place(module: str) -> tuple[int, str] | None:
    """Floor and room of a module of bemt."""
    name = module.removeprefix("bemt.")
    room = next((room for room in ROOMS if match(name, room)), None)
    return None if room is None else (ROOMS.index(room), room)


Import = tuple[str, tuple[str, ...], int, str]
Touch = tuple[str, int, str]


@cache
def facts(text: str) -> tuple[tuple[Import, ...], tuple[Touch, ...]]:
    """Imports and touches of a module's source."""
    tree = ast.parse(text)
    return tuple(imports(tree)), tuple(touches(tree))


def imports(tree: ast.Module) -> Iterator[Import]:
    """Module, names taken from it, line, and when.

    When is ``top``, ``call`` (inside a function) or ``type`` (for the type checker only).
    """

    def walk(node: ast.AST, when: str) -> Iterator[Import]:
        if isinstance(node, ast.Import):
            yield from ((alias.name, (), node.lineno, when) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = "." * node.level + (node.module or "")
            yield base, tuple(alias.name for alias in node.names), node.lineno, when
        else:
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and when == "top":
                when = "call"
            guarded = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
            for child in ast.iter_child_nodes(node):
                if not isinstance(child, ast.expr):
                    yield from walk(child, "type" if guarded else when)

    yield from walk(tree, "top")


def targets(found: Iterable[Import], modules: Mapping[str, str]) -> Iterator[tuple[str, int, str]]:
    """Modules that imports mean: ``from bemt.physics import air`` is bemt.physics.air, ``import Air`` from it too."""
    for base, names, line, when in found:
        inner = [f"{base}.{name}" for name in names if f"{base}.{name}" in modules]
        yield from ((name, line, when) for name in inner)
        if len(inner) < len(names) or not names:
            yield base, line, when


def touches(tree: ast.Module) -> Iterator[Touch]:
    """What of the world outside a module uses: kind, line, words."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            for name in names:
                if name.split(".")[0] in FILE_MODULES:
                    yield "files", node.lineno, f"import {name}"
                if name == "time":
                    yield "clock", node.lineno, "import time"
                if name == "os" and isinstance(node, ast.ImportFrom):
                    yield "environment", node.lineno, "from os import; write os.name"
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            if node.func.id in ("print", "input"):
                yield "print", node.lineno, f"{node.func.id}()"
            if node.func.id == "open":
                yield "files", node.lineno, "open()"
        elif isinstance(node, ast.Attribute):
            words = ast.unparse(node)
            if words in ("sys.stdout", "sys.stderr", "sys.stdin"):
                yield "print", node.lineno, words
            elif words.startswith("os.") and words.count(".") == 1:
                if node.attr in OS_ENVIRONMENT:
                    yield "environment", node.lineno, words
                elif node.attr not in OS_PURE:
                    yield "files", node.lineno, words
            elif node.attr in ("now", "utcnow", "today") and words.split(".")[0] in ("datetime", "date"):
                yield "clock", node.lineno, words
            elif node.attr in FILE_CALLS or words in ("np.load", "np.save", "numpy.load", "numpy.save"):
                yield "files", node.lineno, words


def violations(modules: Mapping[str, str]) -> list[str]:
    """All broken rules, as ``module:line: what``.

    ``modules`` is dotted name -> source text of everything below ``bemt`` and ``geometry``.
    """
    found: list[str] = []
    graph: dict[str, set[str]] = {}
    for name, text in modules.items():
        imported, touched = facts(text)
        home = place(name) if name.startswith("bemt.") else None
        if name.startswith("bemt.") and home is None:
            found.append(f"{name}:1: has no place in the flow; give it one in ROOMS")
        allowed = set().union(*(kinds for room, kinds in MAY.items() if match(name, room)))
        found += [f"{name}:{line}: {kind} in the pure core: {words}" for kind, line, words in touched
                  if kind not in allowed]  # fmt: skip
        for base, names, line, _ in imported:
            found += [f"{name}:{line}: {word} is private to its room" for word in _private(name, base, names)]
        for target, line, when in (*targets(imported, modules), *_before(name, modules)):
            top = target.split(".")[0]
            if when == "top" and (top in HEAVY or (top == "numba" and not match(name.removeprefix("bemt."), COMPILED))):
                found.append(f"{name}:{line}: {target} at the top; import it in the function")
            if match(name, LIGHT) and when == "top" and top not in sys.stdlib_module_names and not match(target, LIGHT):
                found.append(f"{name}:{line}: {target}; --help imports the standard library")
            if not top:
                found.append(f"{name}:{line}: relative import; write the whole name")
            if top == "bemt" and name.split(".")[0] == "geometry":
                found.append(f"{name}:{line}: geometry knows nothing of bemt, got {target}")
            if top not in ("bemt", "geometry") or when == "type":
                continue
            if target not in modules:
                found.append(f"{name}:{line}: {target} does not exist")
                continue
            if top == "bemt" and target != "bemt" and home is not None:
                there = place(target)
                own = there is not None and there[1] == home[1]
                tool, other = TOOL.match(name), TOOL.match(target)
                if other and (tool is None or tool[1] != other[1]) and (name, target) not in CONTRACTS:
                    found.append(f"{name}:{line}: {target} is a tool; it is found by scanning")
                if there is not None and not own and there[0] >= home[0]:
                    found.append(f"{name}:{line}: {target} is not below it")
                effect = "bemt.physics.effects.*"
                if match(name, effect) and match(target, effect) and target != "bemt.physics.effects.base":
                    found.append(f"{name}:{line}: an effect is one file, got {target}")
            if when == "top" and target != name:
                graph.setdefault(name, set()).add(target)
    found += _seen(modules)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        found.append(f"{error.args[1][0]}:1: imports go round: {' <- '.join(error.args[1])}")
    return found


def _private(module: str, base: str, names: Iterable[str]) -> Iterator[str]:
    """Modules and names with a leading ``_`` that a module takes from another room."""
    room, other = (match[0] if (match := TOOL.match(name)) else place(name) for name in (module, f"{base}."))
    if base.split(".")[0] in ("bemt", "geometry") and room != other:
        for word in [f"{base}.{name}" for name in names] or [base]:
            if any(re.match(r"_(?!_)", part) for part in word.split(".")):
                yield word


def _before(name: str, modules: Mapping[str, str]) -> Iterator[tuple[str, int, str]]:
    """What the packages around a module import at their top: it runs before the module."""
    parts = name.split(".")
    for package in (".".join(parts[:k]) for k in range(2, len(parts))):
        for target, line, when in targets(facts(modules.get(package, ""))[0], modules):
            if when == "top":
                yield target, line, "before"


def _seen(modules: Mapping[str, str]) -> Iterator[str]:
    """Blind modules that reach what they must not see, at whatever depth and whenever they import it."""
    links = {
        name: {t for t, _, when in (*targets(facts(text)[0], modules), *_before(name, modules))
               if when != "type" and t in modules and t != "bemt"}
        for name, text in modules.items()
    }  # fmt: skip
    for name in modules:
        if not match(name, BLIND):
            continue
        way: dict[str, str] = {name: ""}
        queue = [name]
        while queue:
            here = queue.pop()
            for there in sorted(links[here] - way.keys()):
                way[there] = here
                queue.append(there)
                if match(there, UNSEEN):
                    path = there
                    while way[path] != name:
                        path = way[path]
                    through = "" if path == there else f" through {path}"
                    yield f"{name}:1: must not see {there}{through}"


@pytest.fixture(scope="module")
def tree(project: Path) -> dict[str, str]:
    """Source of every module."""
    files = [path for top in ("bemt", "geometry") for path in (project / top).rglob("*.py")]
    names = (".".join(path.relative_to(project).with_suffix("").parts).removesuffix(".__init__") for path in files)
    return {name: path.read_text(encoding="utf-8") for name, path in zip(names, files, strict=True)}


@pytest.fixture(scope="module")
def known(tree: dict[str, str]) -> set[str]:
    """What is found without a planted fault, whatever the line."""
    return {re.sub(r":\d+: ", ": ", text) for text in violations(tree)}


def test_the_tree_keeps_the_rules(tree: dict[str, str]) -> None:
    assert {"bemt.app.cli", "bemt.physics.bem.solver", "bemt.physics.effects.tip_loss", "geometry.rotor"} <= set(tree)
    assert not violations(tree), "\n".join(violations(tree))


PLANTED = [
    ("geometry.rotor", "from bemt.base.units import INCH", "geometry knows nothing of bemt, got bemt.base.units"),
    ("geometry.rotor", "def f():\n    import bemt.physics.air", "geometry knows nothing of bemt, got bemt.physics.air"),
    ("geometry.rotor", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from bemt.physics.air import Air",
     "geometry knows nothing of bemt, got bemt.physics.air"),
    ("bemt.base.units", "from bemt.physics.air import Air", "bemt.physics.air is not below it"),
    ("bemt.base.units", "from bemt.physics.bem import solver", "bemt.physics.bem.solver is not below it"),
    ("bemt.physics.sections.polars", "def f():\n    from bemt.physics.bem.solver import solve",
     "bemt.physics.bem.solver is not below it"),
    ("bemt.physics.bem.model", "import bemt.rotors.case.prepare", "bemt.rotors.case.prepare is not below it"),
    ("bemt.physics.effects.swirl", "import bemt.physics.effects.tip_loss",
     "an effect is one file, got bemt.physics.effects.tip_loss"),
    ("bemt.physics.effects.swirl", "from bemt.data.readers import read", "bemt.data.readers is not below it"),
    ("bemt.results.sweep.batch", "from bemt.tools.cfd import worker",
     "bemt.tools.cfd.worker is a tool; it is found by scanning"),
    ("bemt.results.sweep.batch", "from bemt.app.cli import main", "bemt.app.cli is not below it"),
    ("bemt.novelty", "", "has no place in the flow; give it one in ROOMS"),
    ("bemt.physics.air", "from .units import INCH", "relative import; write the whole name"),
    ("bemt.physics.air", "import bemt.nowhere", "bemt.nowhere does not exist"),
    ("bemt.data.recordings.load", "from bemt.data.readers import _words",
     "bemt.data.readers._words is private to its room"),
    ("bemt.data.recordings.load", "def f():\n    from bemt.base.units import _words",
     "bemt.base.units._words is private to its room"),
    ("bemt.physics.bem.solver", "def f():\n    print(1)", "print in the pure core: print()"),
    ("bemt.physics.bem.solver", "import sys\nsys.stderr.write('x')", "print in the pure core: sys.stderr"),
    ("bemt.physics.bem.solver", "def f(p):\n    return open(p)", "files in the pure core: open()"),
    ("bemt.physics.air", "from pathlib import Path\nPath('x').read_text()",
     "files in the pure core: Path('x').read_text"),
    ("bemt.physics.air", "import os\nos.replace('a', 'b')", "files in the pure core: os.replace"),
    ("bemt.physics.effects.swirl", "import numpy as np\nnp.load('x.npy')", "files in the pure core: np.load"),
    ("bemt.physics.bem.solver", "import os\nos.environ['X']", "environment in the pure core: os.environ"),
    ("bemt.rotors.case", "import os\nos.getenv('X')", "environment in the pure core: os.getenv"),
    ("bemt.physics.bem.solver", "def f():\n    import time", "clock in the pure core: import time"),
    ("bemt.physics.dataset", "import datetime\ndatetime.datetime.now()",
     "clock in the pure core: datetime.datetime.now"),
    ("geometry.duct", "print('x')", "print in the pure core: print()"),
    ("bemt.physics.sections.polars", "import neuralfoil", "neuralfoil at the top; import it in the function"),
    ("geometry.rotor", "import cadquery as cq", "cadquery at the top; import it in the function"),
    ("bemt.physics.dataset", "class A:\n  import pandas", "pandas at the top; import it in the function"),
    ("bemt.physics.dataset", "try:\n    import scipy.optimize\nexcept ImportError:\n    pass",
     "scipy.optimize at the top; import it in the function"),
    ("bemt.physics.bem.duct", "from numba import njit", "numba at the top; import it in the function"),
    ("bemt.app.cli", "import numpy as np", "numpy; --help imports the standard library"),
    ("bemt.app.cli", "import bemt.results.sweep", "bemt.results.sweep; --help imports the standard library"),
    ("bemt.results.actions", "import bemt.results.sweep", "bemt.results.sweep; --help imports the standard library"),
    ("bemt.data.recordings.load", "def f():\n    print(1)", "print in the pure core: print()"),
    ("bemt.base.errors", "import numpy", "numpy; --help imports the standard library"),
    ("bemt.judge.proof.truth", "import bemt.physics.bem.solver", "must not see bemt.physics.bem.solver"),
    ("bemt.judge.proof.truth_world", "def f():\n    from bemt.physics.effects import standard",
     "must not see bemt.physics.effects"),
    ("bemt.judge.proof.truth_world", "from bemt.physics.bem import duct", "must not see bemt.physics.bem.duct"),
    ("bemt.judge.proof.stand", "from bemt.results import sweep",
     "must not see bemt.physics.bem.model through bemt.results.sweep"),
    ("bemt.judge.proof.truth_section", "from bemt.rotors import case",
     "must not see bemt.physics.sections.rule through bemt.rotors.case"),
    ("bemt.base.tables", "def f():\n    import bemt.physics.sections.polars",
     "bemt.physics.sections.polars is not below it"),
]  # fmt: skip


@pytest.mark.parametrize(("module", "line", "complaint"), PLANTED)
def test_a_planted_fault_is_found(
    tree: dict[str, str], known: set[str], module: str, line: str, complaint: str
) -> None:
    head, _, body = tree.get(module, "").partition("from __future__ import annotations")
    after = violations({**tree, module: f"{head}from __future__ import annotations\n{line}\n{body}"})
    assert f"{module}: {complaint}" in {re.sub(r":\d+: ", ": ", text) for text in after} - known


BROUGHT = [
    ("bemt.base", "from bemt.app import cli", "bemt.base.given:1: bemt.app.cli is not below it"),
    ("bemt.judge.proof", "from bemt.physics.bem import solver",
     "bemt.judge.proof.truth:1: must not see bemt.physics.bem.solver"),
]  # fmt: skip


@pytest.mark.parametrize(("package", "line", "complaint"), BROUGHT)
def test_what_a_package_brings_along_counts(tree: dict[str, str], package: str, line: str, complaint: str) -> None:
    assert complaint in set(violations({**tree, package: line})) - set(violations(tree))


def test_imports_that_go_round_are_found() -> None:
    modules = {"geometry": "", "geometry.a": "import geometry.b", "geometry.b": "def f(): import geometry.a"}
    assert not violations(modules)
    modules["geometry.b"] = "from geometry import a"
    assert any("imports go round" in text for text in violations(modules))


def test_what_needs_it_may_import_and_touch() -> None:
    assert not violations(
        {
            "bemt": "",
            "bemt.physics.sections.polars": "def f():\n    import neuralfoil",
            "bemt.physics.bem.kernel": "import numba",
            "bemt.data.readers": "import os\ndef f(p: 'os.PathLike[str]'):\n    return open(p)",
            "bemt.physics.bem.duct": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import bemt.judge",
            "bemt.physics.bem.model": "from bemt.physics.bem import duct",
        }
    )


def loaded(code: str, project: Path, **environment: str) -> set[str]:
    """Modules that some code brings into a fresh interpreter, by their top names."""
    program = f"""
import contextlib, io, json, sys
before = set(sys.modules)
with contextlib.redirect_stdout(io.StringIO()):
    try:
{chr(10).join("        " + row for row in code.splitlines())}
    except SystemExit as stop:
        assert not stop.code, stop.code
print(json.dumps(sorted({{name.split('.')[0] for name in set(sys.modules) - before}})))
"""
    run = subprocess.run([sys.executable, "-c", program], cwd=project, env={**os.environ, **environment},
                         capture_output=True, text=True, timeout=300)  # fmt: skip
    assert run.returncode == 0, run.stderr
    return set(json.loads(run.stdout.splitlines()[-1]))


def test_help_imports_the_standard_library_only(project: Path) -> None:
    command = "import runpy\nsys.argv = ['bemt', '--help']\nrunpy.run_module('bemt', run_name='__main__')"
    assert loaded(command, project) - sys.stdlib_module_names == {"bemt"}


def test_a_sweep_needs_no_solids_and_no_pictures(project: Path) -> None:
    command = "from bemt.app.cli import main\nassert main(['sweep', 'cases/prop_8x5', '--json']) == 0"
    found = loaded(command, project, BEMT_CACHE="off")
    assert {"bemt", "geometry", "numpy"} <= found
    assert not found & {"neuralfoil", "aerosandbox", "casadi"}  # the rule's sections are tabulated
    assert not found & {"OCP", "cadquery", "manifold3d", "pyvista", "trimesh", "vtk", "vtkmodules"}


SWEEP_LINES = 22_000
"""Most lines of the project that a sweep of a case without drive, duct, grid and CFD runs loads."""


def test_a_sweep_loads_what_it_needs(project: Path) -> None:
    """Lines of the modules in a fresh interpreter; with ``-n 0 -s`` they are printed."""
    program = f"""
import contextlib, io, runpy, sys
sys.argv = ['bemt', 'sweep', 'cases/prop_8x5']
with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
    runpy.run_module('bemt', run_name='__main__')
root, total = {str(project)!r}, 0
for module in list(sys.modules.values()):
    file = getattr(module, '__file__', None) or ''
    if file.endswith('.py') and file.startswith((root + '/bemt/', root + '/geometry/')):
        total += sum(1 for _ in open(file, encoding='utf-8'))
print(total, *sorted(name for name in sys.modules if name.startswith('bemt.')))
"""
    run = subprocess.run([sys.executable, "-c", program], cwd=project, capture_output=True, text=True, timeout=300,
                         env={**os.environ, "PYTHONPATH": str(project)})  # fmt: skip
    assert run.returncode == 0, run.stderr
    total, *modules = run.stdout.split()
    print(total)
    assert "bemt.physics.bem.solver" in modules and int(total) <= SWEEP_LINES
    unused = ("bemt.data.recordings.load", "bemt.judge", "bemt.results.report", "bemt.tools.drive.drive_model")
    assert not [name for name in modules if name.startswith(unused)]
