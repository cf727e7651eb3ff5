"""HTML pages from templates: plain values in, one file that loads nothing out; every value is escaped."""

from __future__ import annotations

import base64
import hashlib
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from bemt.base.tables import number_text

FIRST = "recording"
"""Stem of the first picture in the folder of an answer: what was recorded, inside the band of the prediction."""

_UNSEEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters, marks that turn the direction of writing, halves of characters."""


@dataclass(frozen=True)
class Cell:
    """A cell of a table."""

    text: str = ""  # What is shown
    value: float | None = None  # What a sort goes by; None sorts last. Given for numbers only.
    number: bool = False  # Whether the cell is a number
    badge: str = ""  # Kind of a coloured word
    link: str = ""  # Id on the page
    code: bool = False  # Whether it is a name in a file


def num(value: Any, digits: int = 4, signed: bool = False, none: str = "-") -> Cell:
    """Make a cell of a number."""
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        return Cell(none, None, True)
    whole = isinstance(value, int) or (abs(value) >= 100 and float(value).is_integer())
    text = f"{value:+.1f}" if signed else f"{value:.0f}" if whole else number_text(float(value), digits)
    return Cell(text, float(value), True)


@dataclass(frozen=True)
class PageTable:
    """A table."""

    head: list[tuple[str, bool]]  # Words of a column, and whether it is of numbers
    rows: list[list[Cell]]
    sort: bool  # Whether a reader may sort it


def table(head: Sequence[str], rows: Iterable[Sequence[object]], sort: bool = True) -> PageTable | None:
    """Make a table; None without rows. A column that no row fills is left out.

    >>> table(["cause", "target"], [["gap", ""]]).head
    [('cause', False)]
    """
    body = [[cell if isinstance(cell, Cell) else Cell(str(cell)) for cell in row] for row in rows]
    if not body:
        return None
    used = [k for k in range(len(head)) if any(row[k].text for row in body)]
    head, body = [head[k] for k in used], [[row[k] for k in used] for row in body]
    units = [re.sub(r"\[[^]]*\]", lambda unit: unit[0].replace(" ", "\u00a0"), words) for words in head]
    numbers = [any(row[k].number for row in body) for k in range(len(head))]
    return PageTable(list(zip(units, numbers, strict=True)), body, sort)


def _clean(value: Any) -> Any:
    return "" if value is None else _UNSEEN.sub("", value) if type(value) is str else value


def render(package: str, template: str, scripts: Sequence[str] = (), **values: Any) -> str:
    """Fill a template of a package; the pages of this room are there to extend and import.

    >>> "&lt;b&gt;" in render("bemt.base", "page.html", title="<b>")
    True
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    loader = ChoiceLoader([PackageLoader(name) for name in dict.fromkeys((package, "bemt.base"))])
    pages = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=_clean
    )
    script = "".join(loader.get_source(pages, name)[0] for name in scripts)
    mark = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    style = loader.get_source(pages, "page.css")[0]
    return pages.get_template(template).render(style=style, script=script, mark=mark, **values)
