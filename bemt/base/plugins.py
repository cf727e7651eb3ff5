"""What the tools offer: found by scanning ``bemt/tools``, loaded on first use, missing without harm.

A tool is a package of ``bemt.tools`` with a module ``offers``. Its tables map a name to ``module:attribute``:

* ``CASE_PARTS``: entry of a case's results; the attribute takes a :class:`bemt.rotors.case.Case` and gives a document
  or None;
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
from functools import cache
from types import ModuleType
from typing import Any


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


def part(name: str, case: Any) -> Any:
    """Entry of a case's results that a tool makes; None where the tool is not here or has nothing to say."""
    where = offered("CASE_PARTS").get(name)
    return None if where is None else load(where)(case)


KNOWN = {
    "drive": ("drive", "map", "motor", "thrusters"), "design": ("choose", "design"), "flight": ("fly",),
    "exports": ("export",), "cfd": ("cfd",),
}  # fmt: skip
"""Tools of a whole installation, and their commands."""


def absent() -> list[str]:
    """Tools that are not here."""
    here = {tool.__name__.split(".")[2] for tool in _tools()}
    return sorted(set(KNOWN) - here)


def tool_of(command: str) -> str:
    """Absent tool that a command belongs to; empty where there is none."""
    return next((tool for tool in absent() if command in KNOWN[tool]), "")


def how_to_get(tool: str) -> str:
    """How an absent tool comes back."""
    return f"bemt/tools/{tool}; install bemt again to have it"


def missing() -> list[str]:
    """A line for each absent tool."""
    return [f"not here: {', '.join(KNOWN[tool])} ({how_to_get(tool)})" for tool in absent()]
