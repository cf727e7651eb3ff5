"""What the tools offer: found by scanning ``bemt/tools``, loaded on first use, missing without harm.

Each folder of ``bemt/tools`` may be taken away: the rest runs on, and says what is missing where it is asked for.

A tool is a package of ``bemt.tools`` with tables that map a name to ``module:attribute``:

* ``CASE_PARTS``: table of a case; the attribute takes a :class:`bemt.rotors.case.Case` that has it, and gives a
  document for the results;
* ``REPORT_PARTS``: part of a report; the attribute takes its :class:`bemt.results.report.book.Book` and the folder of
  results, and gives the book with what it knows put to the cases and its pages to the tools;
* ``EXPORTS``: target of ``export``; the attribute is its class;
* ``FILE_KINDS``: command that takes a file which no reader of recordings knows; the attribute takes a path and gives
  what the file is, empty if another's;
* ``ACTIONS``: name at both doors; the attribute is the public function;
* ``HANDS``: what makes the runs of a proof's loop; the attribute takes the folder of a proof and an entry of its
  key, and gives a context manager of a :class:`bemt.judge.proof.loop.Hand`.

>>> offered("CASE_PARTS")["drive"], offered("NOTHING")
('bemt.tools.drive.drive_result:full_document', {})
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from types import ModuleType
from typing import Any

from bemt import __version__

TOOLS: dict[str, tuple[str, ...]] = {
    "cfd": ("cfd", "openfoam"), "design": ("choose", "design"), "drive": ("drive", "map", "motor", "thrusters"),
    "exports": ("export",), "flight": ("fly",), "stand": ("stand",),
}  # fmt: skip
"""Tools of this version, with the actions and targets that are missing without them."""
CASE_TABLES = ("drive",)
"""Tables of a case that a tool reads."""


@cache
def _tools() -> tuple[ModuleType, ...]:
    """Every tool that is here."""
    path = importlib.import_module("bemt.tools").__path__
    names = sorted(info.name for info in pkgutil.iter_modules(path) if info.ispkg)
    return tuple(importlib.import_module(f"bemt.tools.{name}") for name in names)


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
    return None if where is None or getattr(case.file, table, "") is None else load(where)(case)


def absent() -> list[str]:
    """Tools that are not here."""
    here = {tool.__name__.split(".")[2] for tool in _tools()}
    return sorted(set(TOOLS) - here)


def tool_of(word: str) -> str:
    """Absent tool that a command, a target or a table of a case belongs to; empty where there is none."""
    return next((tool for tool in absent() if word in (tool, *TOOLS[tool])), "")


def missing(tool: str) -> str:
    """Sentence that says how an absent tool comes back.

    >>> missing("drive").partition(",")[0]
    'The drive tool is not installed: put the folder bemt/tools/drive back'
    """
    how = f"put the folder bemt/tools/{tool} back, or install bemt {__version__} anew"
    return f"The {tool} tool is not installed: {how}."


def missing_for(case: Any) -> list[str]:
    """Sentences on the absent tools that the tables of a case need."""
    tables = [table for table in CASE_TABLES if getattr(case.file, table) is not None and tool_of(table)]
    return [f"[{table}] is left out. {missing(tool_of(table))}" for table in tables]
