"""What the tools offer: found by scanning ``bemt/tools``, loaded on first use, missing without harm.

Each folder of ``bemt/tools`` may be taken away: the rest runs on, and says what is missing where it is asked for.

A tool is a package of ``bemt.tools`` with a module ``offers``. Its tables map a name to ``module:attribute``:

* ``CASE_PARTS``: table of a case; the attribute takes a :class:`bemt.rotors.case.Case` that has it, and gives a
  document for the results;
* ``REPORT_PARTS``: part of a report; the attribute takes its book (the cases, to which it may add) and the folder of
  results, and gives pages with id, name, title, top and sections (:mod:`bemt.results.report.values`);
* ``EXPORTS``: target of ``export``; the attribute is its class;
* ``ACTIONS``: name at both doors; the attribute is the public function.

>>> offered("CASE_PARTS"), offered("NOTHING")
({'drive': 'bemt.tools.drive.drive_result:full_document'}, {})
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from functools import cache
from types import ModuleType
from typing import Any

from bemt import __version__

TOOLS: dict[str, tuple[str, ...]] = {
    "cfd": ("cfd", "openfoam"),
    "design": ("choose", "design"),
    "drive": ("drive", "map", "motor", "thrusters"),
    "exports": ("export",),
    "flight": ("fly",),
}
"""Tools of this version, with the actions and targets that are missing without them."""
CASE_TABLES = ("drive",)
"""Tables of a case that a tool reads."""


@cache
def _tools() -> tuple[ModuleType, ...]:
    """Module ``offers`` of every tool that is here."""
    path = importlib.import_module("bemt.tools").__path__
    names = sorted(info.name for info in pkgutil.iter_modules(path) if info.ispkg)
    return tuple(importlib.import_module(f"bemt.tools.{name}.offers") for name in names)


def offered(table: str) -> dict[str, str]:
    """Names of one table of all tools, each with its ``module:attribute``."""
    return {name: where for tool in _tools() for name, where in getattr(tool, table, {}).items()}


def load(where: str) -> Any:
    """Attribute that ``module:attribute`` names.

    >>> load("bemt.base.units:INCH")
    0.0254
    """
    module, _, attribute = where.partition(":")
    return getattr(importlib.import_module(module), attribute)


def loaded(table: str) -> list[Any]:
    """Attributes that one table of all tools names."""
    return [load(where) for where in offered(table).values()]


def part(table: str, case: Any) -> Any:
    """What a tool makes of a table of a case; None where the case has none or the tool is not here."""
    where = offered("CASE_PARTS").get(table)
    return None if where is None or getattr(case.file, table) is None else load(where)(case)


def missing(word: str) -> str:
    """Sentence on the tool that an action, a target or a table of a case needs; empty if it is here or none is needed.

    >>> missing("drive"), missing("nothing of ours")
    ('', '')
    """
    name = next((name for name, words in TOOLS.items() if word in (name, *words)), None)
    if name is None or any(tool.__name__.split(".")[2] == name for tool in _tools()):
        return ""
    how = f"put the folder bemt/tools/{name} back, or install bemt {__version__} anew"
    return f"The {name} tool is not installed: {how}."


def missing_for(case: Any) -> list[str]:
    """Sentences on the tools that the tables of a case need and that are not here."""
    found = {table: missing(table) for table in CASE_TABLES if getattr(case.file, table) is not None}
    return [f"[{table}] is left out. {sentence}" for table, sentence in found.items() if sentence]


def missing_module(error: ImportError) -> str:
    """Sentence on the tool whose module could not be imported; empty if it was none of a tool."""
    found = re.match(r"bemt\.tools\.(\w+)", error.name or "")
    return missing(found[1]) if found else ""
