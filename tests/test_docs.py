"""The promise of the documents: commands run as printed, docstrings agree with the code."""

from __future__ import annotations

import ast
import dataclasses
import doctest
import html
import importlib
import inspect
import json
import os
import pkgutil
import re
import shlex
import shutil
import struct
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from fnmatch import fnmatch
from pathlib import Path
from types import ModuleType

import pytest

import bemt
from bemt.rotors.case.load import case_of

PACKAGES = ("bemt", "geometry")
# What users call and plug-ins implement: here every parameter is documented. Elsewhere one line will do, and what a
# docstring does say must be right.
FACE = "|".join(
    (
        "bemt bemt.judge.actions bemt.judge.import_files bemt.rotors.actions "
        "bemt.rotors.propeller bemt.data.actions bemt.results.actions bemt.tools.drive.actions "
        "bemt.physics.dataset.make bemt.physics.dataset.points bemt.physics.effects.base bemt.data.readers "
        "bemt.tools.exports bemt.base.errors "
    ).split()
)
# Types of numbers that have a dimension: float, array_like, (N,) float, tuple of float; not counts, masks or records.
NUMERIC = re.compile(r"^(tuple of )?(\([^()]*\) )*(float|array_like|ndarray)\b(?! of (int|bool|str))")
UNIT = re.compile(r"\[[^\[\]]+\]|\bunits?\b")  # "[m]", or words such as "in the unit of x"


def public_modules() -> list[str]:
    """Every module whose dotted name holds no private part."""
    names = []
    for package in PACKAGES:
        found = pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}.")
        names += [package, *(info.name for info in found)]
    return sorted(name for name in names if not any(part.startswith("_") for part in name.split(".")))


def public_objects(module: ModuleType) -> Iterator[tuple[str, object]]:
    """Functions and classes that a module defines and offers, and the methods of the classes."""
    for name in getattr(module, "__all__", [n for n in vars(module) if not n.startswith("_")]):
        item = getattr(module, name)
        if not (inspect.isfunction(item) or inspect.isclass(item)) or item.__module__ != module.__name__:
            continue
        yield f"{module.__name__}.{name}", item
        if inspect.isclass(item):
            for key, member in vars(item).items():
                wrapped = [getattr(member, kind, None) for kind in ("fget", "func", "__func__")]
                inner = next((f for f in wrapped if f is not None), member)
                if not key.startswith("_") and inspect.isfunction(inner) and inner.__qualname__.startswith(name + "."):
                    yield f"{module.__name__}.{name}.{key}", inner


def sections(doc: str) -> dict[str, str]:
    """Sections of a numpydoc text by heading; the text before the first is ``""``."""
    parts = re.split(r"^(\w[\w ]*)\n-{3,}$", inspect.cleandoc(doc), flags=re.MULTILINE)
    return {"": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}


def entries(text: str) -> Iterator[tuple[list[str], str, str]]:
    """Names, type and description of each entry of a Parameters-like section."""
    for head, body in re.findall(r"^(\S[^\n]*)\n?((?:[ \t]+[^\n]*\n?|\n)*)", text.strip("\n") + "\n", flags=re.M):
        names, _, kind = head.partition(" : ")
        many = re.fullmatch(r"\**\w+(, \**\w+)*", names)
        yield [n.strip().lstrip("*") for n in names.split(",")] if many else [names], kind, body


def documented_names(item: object, doc: dict[str, str]) -> list[str]:
    wanted = "Parameters" if "Parameters" in doc or not inspect.isclass(item) else "Attributes"
    return [name for names, _, _ in entries(doc.get(wanted, "")) for name in names]


def signature_names(item: object) -> list[str]:
    """What a caller passes: parameters of a function, fields of a dataclass, arguments of another class."""
    if inspect.isclass(item):
        if dataclasses.is_dataclass(item):
            return [f.name for f in dataclasses.fields(item) if not f.name.startswith("_")]
        if "__init__" not in vars(item):
            return []
    assert callable(item)
    names = inspect.signature(item).parameters
    return [name for name in names if name not in ("self", "cls")]


def overrides(method: object) -> bool:
    """Whether a method stands for one of a base class of ours, whose docstring says what it takes."""
    assert inspect.isfunction(method)
    owner = vars(sys.modules[method.__module__])[method.__qualname__.partition(".")[0]]
    return any(method.__name__ in vars(base) for base in owner.__mro__[1:] if base.__module__.startswith(PACKAGES))


def docstring_faults(name: str, item: object, face: bool = True) -> list[str]:
    """What is wrong with one docstring."""
    text = vars(item).get("__doc__") if inspect.isclass(item) else getattr(item, "__doc__", None)
    if not text or text.startswith(f"{getattr(item, '__name__', '')}("):  # the latter is made by dataclass
        return [f"{name}: no docstring"]
    doc = sections(text)
    faults = []
    if not re.search(r"[.!?:](\s|$)", doc[""]):
        faults.append(f"{name}: the summary is no sentence")
    said, given = documented_names(item, doc), signature_names(item)
    method = name.count(".") > item.__module__.count(".") + 1
    optional = not face or inspect.isclass(item) or (method and not said and (len(given) <= 1 or overrides(item)))
    # fields may be grouped by unit, arguments keep their order
    agree = sorted(said) == sorted(given) if inspect.isclass(item) else said == given
    agree = agree or (not face and inspect.isclass(item) and set(said) <= set(given))  # the base class says the rest
    if not agree and not (optional and not said):
        faults.append(f"{name}: documents {said}, takes {given}")
    for heading in ("Parameters", "Returns", "Attributes", "Yields"):
        for names, kind, body in entries(doc.get(heading, "")):
            what = kind or ", ".join(names)  # Returns may give the type alone
            if face and NUMERIC.search(what) and not UNIT.search(kind + body):
                faults.append(f"{name}: {heading}: {', '.join(names)} without a unit in brackets")
    return faults


@pytest.mark.parametrize("module", public_modules())
def test_docstrings_agree_with_the_code_and_name_units(module: str) -> None:
    loaded = importlib.import_module(module)
    assert loaded.__doc__, "a module says what it is for"
    face = module in FACE.split("|")
    faults = [fault for name, item in public_objects(loaded) for fault in docstring_faults(name, item, face)]
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize(
    "module", ["bemt.judge.actions", "bemt.rotors.actions", "bemt.rotors.propeller", "bemt.physics.dataset"]
)
def test_everything_of_the_face_has_an_example_that_runs(module: str) -> None:
    """Its own, or a line of its class's; pytest runs them."""
    without = []
    found = dict(public_objects(importlib.import_module(module)))
    for name, item in found.items():
        home, _, last = name.rpartition(".")
        shown = [row for row in (getattr(found.get(home), "__doc__", "") or "").splitlines() if ">>>" in row]
        if ">>>" not in (item.__doc__ or "") and not any(f".{last}" in row for row in shown):
            without.append(name)
    assert without == []


HEAD = "Parameters\n----------\n"
BLADES = "B : int\n    Blades.\n"


@pytest.mark.parametrize(
    ("doc", "complaint"),
    [
        (None, "no docstring"),
        (f"Do it\n\n{HEAD}V, *more : float\n    Speed. [m/s]\n{BLADES}", "the summary is no sentence"),
        ("Do it.", "documents [], takes ['V', 'more', 'B']"),
        (f"Do it.\n\n{HEAD}V, more : float\n    Speed. [m/s]\n", "documents ['V', 'more'], takes"),
        (f"Do it.\n\n{HEAD}{BLADES}V, *more : float\n    Speed. [m/s]\n", "documents ['B', 'V', 'more'], takes"),
        (f"Do it.\n\n{HEAD}V, *more : float\n    Speed.\n{BLADES}", "V, more without a unit"),
        (f"Do it.\n\n{HEAD}V, *more : float\n    Speed. [m/s]\n{BLADES}\nReturns\n-------\n(N,) float\n    Speed.\n",
         "Returns: (N,) float without a unit"),
    ],
)  # fmt: skip
def test_a_bad_docstring_is_found(doc: str | None, complaint: str) -> None:
    def planted(V: float, *more: float, B: int = 2) -> float:
        return V

    planted.__doc__ = doc
    faults = docstring_faults(f"{__name__}.planted", planted)
    assert len(faults) == 1 and complaint in faults[0]


def test_a_good_docstring_passes() -> None:
    def planted(V: float, *more: float, B: int = 2) -> float:
        """Do nothing.

        Parameters
        ----------
        V, *more : float
            Speeds. [m/s]
        B : int, optional
            Blades.

        Returns
        -------
        float
            The first speed [m/s].
        """
        return V

    assert docstring_faults(f"{__name__}.planted", planted) == []


def shell_commands(markdown: str) -> list[str]:
    """Lines of the fenced blocks of shell commands."""
    blocks: list[str] = re.findall(r"^```sh\n(.*?)^```", markdown, flags=re.M | re.S)
    return [line for block in blocks for line in block.splitlines()]


def test_the_two_commands_are_those_that_ci_runs(project: Path) -> None:
    commands = shell_commands((project / "README.md").read_text(encoding="utf-8"))
    assert len(commands) == 2, "one command for the sweep, one for the tests"
    assert commands[0].endswith("bemt sweep cases/")
    assert commands[1].endswith("python -m pytest")
    ci = (project / ".ci" / "run").read_text(encoding="utf-8")
    steps = re.findall(r"^step \"[^\"]+\" (?:\\\n\s*)?'([^']+)'$", ci, flags=re.MULTILINE)
    steps = [step.replace("PYTEST_ADDOPTS=--junitxml=fast.xml ", "") for step in steps]
    assert set(commands) <= set(steps) and steps.index(commands[0]) == 0
    assert os.access(project / ".ci" / "run", os.X_OK)


def test_the_commands_of_the_page_exist(project: Path, maker: ModuleType) -> None:
    page = (project / "docs" / "command_line.md").read_text(encoding="utf-8")
    assert maker.commands(page) == page, "run python docs/make.py"


def test_the_picture_of_the_wings_is_today_s(project: Path, script: Callable[[str], ModuleType]) -> None:
    """Every wing with its purpose, every line between two; the numbers may wait for the next edition."""
    wings = script("wings")
    folders = {path.parent.name for path in (project / "bemt").glob("*/__init__.py")} | {"geometry"}
    assert folders == set(wings.ORDER)
    picture = (project / "docs" / "img" / "wings.svg").read_text(encoding="utf-8")
    kept = re.search(r"<dc:description>(.*?)</dc:description>", picture)
    found = wings.arrows()
    assert kept is not None, "run docs/wings.py"
    assert json.loads(html.unescape(kept[1])) == sorted(f"{a} > {b}" for a, b in found)
    assert all(wings.ORDER.index(a) < wings.ORDER.index(b) for a, b in found), "imports go down"
    assert wings.table() in (project / "docs" / "structure.md").read_text(encoding="utf-8")


def test_the_readme_is_short_and_its_commands_exist(project: Path) -> None:
    from bemt.app.cli import parsed

    readme = (project / "README.md").read_text(encoding="utf-8")
    assert len(readme.split()) <= 900
    rows = re.findall(r"^\| [^|`]+ \| (.*) \|$", readme, flags=re.MULTILINE)
    commands = [words for row in rows for words in re.findall(r"`bemt ([^`]+)`", row)]
    assert len(commands) > 10
    for words in commands:
        words = words.replace("TARGET", "dfdc")
        assert parsed(shlex.split(words))[0] == words.removeprefix("lab ").split()[0]


def test_the_output_in_the_readme_is_today_s(project: Path) -> None:
    """Rows of the table: thrust and its uncertainty."""
    readme = (project / "README.md").read_text(encoding="utf-8")
    shown = re.findall(r"^(\w+) +\d+ +([\d.]+) ± ([\d.]+) .* (?:agrees|u > |flagged)", readme, flags=re.MULTILINE)
    assert len(shown) >= 3
    for name, thrust, u in shown:
        own = bemt.load(project / "cases" / name).solve()
        assert float(thrust) == pytest.approx(own.thrust_N[0], rel=0.01)
        assert float(u) == pytest.approx(own.u["thrust_N"][0], rel=0.05)


def test_the_python_of_the_readme_runs(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    readme = (project / "README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", readme, flags=re.M | re.S)
    assert len(blocks) == 1
    space: dict[str, object] = {}
    exec(compile(blocks[0], "README.md", "exec"), space)
    answer = space["answer"]
    assert answer.converged.all() and (answer.thrust_N > 0).all() and (answer.torque_Nm > 0).all()  # type: ignore[attr-defined]
    assert capsys.readouterr().out


DOCUMENTS = sorted(path.name for path in (Path(__file__).parents[1] / "docs").glob("*.md"))


@pytest.mark.parametrize("document", DOCUMENTS)
def test_the_commands_of_the_documents_exist(project: Path, document: str) -> None:
    from bemt.app.cli import parsed

    for line in shell_commands((project / "docs" / document).read_text(encoding="utf-8")):
        if found := re.match(r"(?:.* -m )?bemt (.*)", line.rpartition("&& ")[2]):
            words = shlex.split(found[1].partition(" > ")[0], comments=True)
            assert parsed(words)[0] == words[words[0] == "lab"]


@pytest.fixture
def pages(project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with the cases, whose plug-ins are scanned like the project's own."""
    from bemt import tools
    from bemt.base import plugins
    from bemt.data import readers as importers
    from bemt.physics import effects
    from bemt.tools import exports

    shutil.copytree(project / "cases", tmp_path / "cases")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tools, "__path__", [*tools.__path__, str(tmp_path / "bemt" / "tools")])
    contracts = ((effects, effects.catalogue), (importers, importers.importers), (exports, exports.exports))
    scanned = ((tools, plugins._tools), *contracts)
    for package, known in contracts:
        folder = tmp_path.joinpath(*package.__name__.split("."))
        monkeypatch.setattr(package, "__path__", [*package.__path__, str(folder)])
        known.cache_clear()
    plugins._tools.cache_clear()
    yield tmp_path
    monkeypatch.undo()
    for path in tmp_path.glob("bemt/**/*.py"):
        sys.modules.pop(".".join(path.relative_to(tmp_path).with_suffix("").parts).removesuffix(".__init__"), None)
    for _, known in scanned:
        known.cache_clear()


@pytest.mark.parametrize("document", DOCUMENTS)
def test_the_python_of_the_documents_runs(project: Path, pages: Path, document: str) -> None:
    """Blocks below a line that is a path in backticks are files; lines marked >>> run in order, with these files."""
    text = (project / "docs" / document).read_text(encoding="utf-8")
    for name, body in re.findall(r"^`([\w./]+)`:\n\n```\w+\n(.*?)^```", text, flags=re.M | re.S):
        pages.joinpath(name).parent.mkdir(parents=True, exist_ok=True)
        pages.joinpath(name).write_text(body, encoding="utf-8")
    told: list[str] = []
    test = doctest.DocTestParser().get_doctest(text, {}, document, document, 0)
    doctest.DocTestRunner().run(test, out=told.append)
    assert not told, "".join(told)


@pytest.fixture
def maker(script: Callable[[str], ModuleType]) -> ModuleType:
    """The script docs/make.py."""
    return script("make")


def test_the_diagnosis_page_says_what_the_code_does(project: Path, maker: ModuleType) -> None:
    from bemt.judge.diagnose import document, form, knowledge, plan, posterior
    from bemt.judge.explanation import Explanation

    text = (project / "docs" / "diagnosis.md").read_text(encoding="utf-8")
    assert maker.numbers(text) == text, "run python docs/make.py"
    for module in (form, knowledge, posterior):
        other = (str, bool, Explanation)
        steers = {k for k, v in vars(module).items() if k.isupper() and not isinstance(v, other) and k[0] != "_"}
        name = module.__name__.rpartition(".")[2]
        assert steers == set(re.findall(rf"^\| `{name}\.([A-Z]\w*)`", text, flags=re.M)), f"constants of {name}"
    for module, more in ((document, {"recordings", "cases"}), (plan, set())):
        part = text.partition(f"## The document `{module.SCHEMA}`")[2].partition("\n## ")[0]
        told = {
            name for cell in re.findall(r"^\| (`.*?) \|", part, flags=re.M) for name in re.findall(r"`(\w+)`", cell)
        }
        returned = ast.parse(inspect.getsource(module.document)).body[0].body[-1].value  # type: ignore[attr-defined]
        assert told == {ast.literal_eval(key) for key in returned.keys} | more


def test_the_page_of_files_holds_every_key(project: Path, maker: ModuleType) -> None:
    """By heading: key, kind, default and range; wording may differ."""

    def keys(text: str) -> dict[str, set[tuple[str, ...]]]:
        found: dict[str, set[tuple[str, ...]]] = {}
        file = ""
        for line in text.splitlines():
            if line.startswith("#"):
                file, head = (line[3:], "") if line.startswith("## ") else (file, line)
            elif item := re.fullmatch(r"\* ((?:`\w+`, )*`\w+`) (?:.* )?\[(.*)\]", line):
                found.setdefault(f"{file} {head}", set()).update((key, item[2]) for key in item[1].split(", "))
        return found

    written = keys((project / "docs" / "reference_files.md").read_text(encoding="utf-8"))
    assert written == keys(maker.files()), "run python docs/make.py"
    assert sum(map(len, written.values())) > 150


def test_the_shortest_case_has_six_lines(project: Path) -> None:
    text = (project / "docs" / "files" / "case.toml").read_text(encoding="utf-8")
    assert len(text.splitlines()) == 6 and case_of(text).assumptions


def test_the_gallery_shows_the_shipped_cases(project: Path, maker: ModuleType) -> None:
    text = (project / "docs" / "gallery.md").read_text(encoding="utf-8")
    made = maker.gallery(maker.shipped())
    number = re.compile(r"\d+\.\d+")
    assert number.sub("", made) == number.sub("", text), "run python docs/make.py"
    assert [float(x) for x in number.findall(text)] == pytest.approx([float(x) for x in number.findall(made)], rel=0.01)


@pytest.mark.parametrize("document", ["README.md", "CHANGELOG.md", *(f"docs/{name}" for name in DOCUMENTS)])
def test_links_lead_somewhere(project: Path, document: str) -> None:
    path = project / document
    text = path.read_text(encoding="utf-8")
    targets = [t for t in re.findall(r"\]\(([^)#\s]+)", text) if not t.startswith("http")]
    assert all((path.parent / target).exists() for target in targets)
    named = re.findall(r"`((?:bemt|geometry|cases|tests|docs|\.ci)/[\w./]+)`", text)
    made_up = set(re.findall(r"^`([^`]+)`:$", text, flags=re.M))
    made_up |= {"tests/test_readers_example_stand.py", "cases/example", "cases/mine"}
    assert [name for name in named if not (project / name).exists() and name not in made_up] == []


def test_the_changelog_speaks_of_this_version(project: Path) -> None:
    named = re.findall(r"^## (\S+)", (project / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert bemt.__version__ in named[:2]  # what comes next may stand above
    assert f"\nversion: {bemt.__version__}\n" in (project / "CITATION.cff").read_text(encoding="utf-8")


def test_the_picture_shows_today_s_numbers(project: Path, maker: ModuleType) -> None:
    from bemt.rotors.case import load_case
    from bemt.rotors.case.prepare import prepare_case

    text = png_text((project / "docs" / "img" / "overview.png").read_bytes())
    drawn = json.loads(text["bemt"])["thrust_N"]
    assert set(drawn) == set(maker.CASES)
    for name, thrust in drawn.items():
        case = load_case(project / "cases" / name / "case.toml")
        ours = prepare_case(case).solve(case.rpm, case.airspeed_m_s, case.air()).thrust_N[0]
        assert thrust == pytest.approx(ours, rel=0.01), f"{name}: picture out of date; run python docs/overview.py"


def png_text(raw: bytes) -> dict[str, str]:
    """Text chunks of a PNG file."""
    assert raw.startswith(b"\x89PNG\r\n\x1a\n")
    found, at = {}, 8
    while at < len(raw):
        size, kind = struct.unpack(">I4s", raw[at : at + 8])
        if kind == b"tEXt":
            key, _, value = raw[at + 8 : at + 8 + size].partition(b"\0")
            found[key.decode("latin-1")] = value.decode("latin-1")
        at += size + 12
    return found


def test_the_packaging_lists_every_package_and_data_file(project: Path) -> None:
    config = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))
    setuptools = config["tool"]["setuptools"]
    patterns = setuptools["packages"]["find"]["include"]
    packages = {".".join(p.parent.relative_to(project).parts) for top in PACKAGES
                for p in (project / top).rglob("__init__.py")}  # fmt: skip
    listed = {name for name in packages if any(fnmatch(name, pattern) for pattern in patterns)}
    for package in PACKAGES:
        for path in (project / package).rglob("*"):
            home = ".".join(path.parent.relative_to(project).parts)
            if not path.is_file() or "__pycache__" in path.parts:
                continue
            data = next((p for p in (home, home.rpartition(".")[0]) if p in listed), None)
            assert data is not None and (path.suffix != ".py" or data == home), f"{path} belongs to no listed package"
            if path.suffix != ".py":
                rules = setuptools["package-data"].get(data, [])
                below = path.relative_to(project / data.replace(".", "/")).as_posix()
                assert any(fnmatch(below, rule) for rule in rules), f"{path} is not shipped"


def statements(tree: ast.AST) -> Iterator[ast.AST]:
    """Statements of a module at any depth: imports are statements, and no expression holds one."""
    for key in ("body", "orelse", "finalbody", "handlers", "cases"):
        below = getattr(tree, key, None)
        for node in below if isinstance(below, list) else ():  # of a lambda and a choice, an expression
            yield node
            yield from statements(node)


def test_every_imported_library_is_declared(project: Path) -> None:
    config = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = config["optional-dependencies"]
    lines = [*config["dependencies"], *(line for group in extras.values() for line in group)]
    declared = {re.match(r"[\w-]+", line)[0].lower() for line in lines}  # type: ignore[index]
    assert all(re.search(r">=\d", line) for line in lines), "every dependency has a lower bound"
    found = set()
    for path in [p for top in ("bemt", "geometry", "tests") for p in (project / top).rglob("*.py")]:
        for node in statements(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            found |= {name.split(".")[0].lower() for name in names}
    # what comes with a declared library, and has no version of its own to ask for
    comes_with = {
        "ocp": "cadquery",
        "distributed": "dask",
        "pil": "matplotlib",
        "pydantic_core": "pydantic",
        "python_calamine": "python-calamine",  # its name when it is imported
        "pythrust": "setuav-pythrust",
    }
    assert set(comes_with.values()) <= declared
    scripts = (p.stem for place in ("tests", "docs", "reports/studies") for p in (project / place).glob("*.py"))
    ours = {"bemt", "geometry", "conftest", "tests", "__future__", *scripts}
    assert found - {n.lower() for n in sys.stdlib_module_names} - ours - set(comes_with) <= declared


def test_the_python_files_of_the_documents_keep_the_rules_of_the_tree(project: Path) -> None:
    """Pasted where their headings say they are clean: rooms, lint and types."""
    from test_layers import violations

    tree = {
        ".".join(path.relative_to(project).with_suffix("").parts).removesuffix(".__init__"): path.read_text("utf-8")
        for top in PACKAGES for path in (project / top).rglob("*.py")
    }  # fmt: skip
    before, pasted = set(violations(tree)), {}
    for page in (project / "docs").glob("*.md"):
        text = page.read_text(encoding="utf-8")
        pasted |= dict(re.findall(r"^`([\w/]+\.py)`:\n\n```python\n(.*?)^```", text, flags=re.M | re.S))
    assert len(pasted) >= 2
    added = {name.removesuffix(".py").replace("/", "."): body for name, body in pasted.items()}
    assert set(violations(tree | added)) <= before
    for name, body in pasted.items():
        lint = [sys.executable, "-m", "ruff", "check", "--stdin-filename", name, "-"]
        done = subprocess.run(lint, cwd=project, input=body, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout
