"""HTML pieces: everything that comes from a file goes through :func:`esc`; nothing else may reach a page."""

from __future__ import annotations

import base64
import hashlib
import html
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bemt.base.tables import number_text

__all__ = ["Cell", "badge", "document", "esc", "image", "num", "section", "table"]

LONG = 600
"""Characters above which a text gets a box of its own that scrolls."""


def esc(value: Any) -> str:
    """Escape a text for HTML, in elements and in attributes.

    Examples
    --------
    >>> esc("<script>alert('1')</script>")
    '&lt;script&gt;alert(&#x27;1&#x27;)&lt;/script&gt;'
    """
    text = "" if value is None else str(value)
    clean = "".join(
        c
        for c in text
        if c in "\n\t"
        or (
            ord(c) >= 32
            and not 0x7F <= ord(c) < 0xA0
            and c not in "\u202a\u202b\u202d\u202e\u2066\u2067\u2068"
            and not 0xD800 <= ord(c) < 0xE000
        )
    )
    return html.escape(clean)


@dataclass(frozen=True)
class Cell:
    """A cell of a table.

    Parameters
    ----------
    text : str
        What is shown, not yet escaped.
    value : float or None
        What a sort goes by, in the unit of its column; None sorts last. Given for numbers only.
    number : bool
        Whether the cell is a number.
    markup : str
        Safe HTML instead of the text.
    """

    text: str = ""
    value: float | None = None
    number: bool = False
    markup: str = ""


def num(value: Any, digits: int = 4, signed: bool = False, none: str = "-") -> Cell:
    """Make a cell of a number."""
    good = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if not good:
        return Cell(none, None, True)
    whole = isinstance(value, int) or (abs(value) >= 100 and float(value).is_integer())
    text = f"{value:+.1f}" if signed else f"{value:.0f}" if whole else number_text(float(value), digits)
    return Cell(text, float(value), True)


def badge(kind: str, words: str) -> str:
    """Make a short coloured word; the colour says nothing that the word does not."""
    size = " wrap" if len(words) > 24 else ""
    return f'<span class="badge {esc(kind)}{size}">{esc(words)}</span>'


def _long(text: str) -> str:
    return f'<span class="long">{esc(text)}</span>' if len(text) > LONG else esc(text)


def table(header: Sequence[str], rows: Iterable[Sequence[object]], sortable: bool = True) -> str:
    """Make a table; a heading sorts it."""
    body = [[cell if isinstance(cell, Cell) else Cell(str(cell)) for cell in row] for row in rows]
    if not body:
        return ""
    numeric = [any(row[k].number for row in body) for k in range(len(header))]
    out = [
        '<div class="scroll"><table class="sort"><thead><tr>' if sortable else '<div class="scroll"><table><thead><tr>'
    ]
    for k, words in enumerate(header):
        name = re.sub(r"\[[^]]*\]", lambda unit: unit[0].replace(" ", "\u00a0"), words)  # a unit stays on one line
        kind = ' class="n"' if numeric[k] else ""
        out.append(
            f'<th{kind}><button type="button">{esc(name)}</button></th>' if sortable else f"<th{kind}>{esc(name)}</th>"
        )
    out.append("</tr></thead><tbody>")
    for row in body:
        out.append("<tr>")
        for cell in row:
            inner = cell.markup or _long(cell.text)
            if cell.number:
                value = "" if cell.value is None else f"{cell.value:.10g}"
                out.append(f'<td class="n" data-v="{value}">{inner}</td>')
            else:
                out.append(f'<td class="w">{inner}</td>' if len(cell.text) > 60 else f"<td>{inner}</td>")
        out.append("</tr>")
    out.append("</tbody></table></div>")
    return "".join(out)


def section(title: str, *parts: str) -> str:
    """Join parts under a heading."""
    inside = "".join(parts)
    return f"<h3>{esc(title)}</h3>{inside}" if inside else ""


def image(data: bytes, alt: str, kind: str = "png") -> str:
    """Embed a picture."""
    assert kind in ("png", "svg+xml")
    return f'<img alt="{esc(alt)}" src="data:image/{kind};base64,{base64.b64encode(data).decode()}">'


def document(title: str, lead: str, pages: Sequence[tuple[str, str, str]], foot: str) -> str:
    """Put pages into one self-contained file."""
    here = Path(__file__).parent
    css = (here / "page.css").read_text(encoding="utf-8")
    js = (here / "page.js").read_text(encoding="utf-8")
    mark = base64.b64encode(hashlib.sha256(js.encode()).digest()).decode()
    policy = (
        f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{mark}'; base-uri 'none'"
    )
    menu = "".join(f'<li><a href="#{esc(key)}">{esc(name)}</a></li>' for key, name, _ in pages)
    body = "".join(f'<section class="page" id="{esc(key)}">{inner}</section>\n' for key, _, inner in pages)
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<link rel="icon" href="data:,"><title>{esc(title)}</title>\n<style>{css}</style></head>\n<body>'
        f'<header><h1>{esc(title)}</h1><p>{esc(lead)}</p></header>\n<nav aria-label="Pages"><ul>{menu}</ul></nav>\n'
        f"<main>\n{body}</main>\n<footer>{esc(foot)}</footer>\n<script>{js}</script>\n</body></html>\n"
    )
