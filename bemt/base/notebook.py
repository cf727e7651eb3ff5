"""Answers as a notebook shows them."""

from __future__ import annotations

import html
from collections.abc import Mapping


def as_html(head: str, text: str) -> str:
    """A heading and a text of fixed width, for notebooks.

    >>> as_html("a < b", "text")
    '<strong>a &lt; b</strong><pre style="line-height:1.35">text</pre>'
    """
    return f'<strong>{html.escape(head)}</strong><pre style="line-height:1.35">{html.escape(text)}</pre>'


def table_html(head: str, rows: Mapping[str, str]) -> str:
    """A heading and names with their values, for notebooks.

    >>> table_html("10x5", {"blades": "2"})
    '<strong>10x5</strong><table class="bemt"><tr><th>blades</th><td>2</td></tr></table>'
    """
    cells = "".join(f"<tr><th>{html.escape(k)}</th><td>{html.escape(v)}</td></tr>" for k, v in rows.items())
    return f'<strong>{html.escape(head)}</strong><table class="bemt">{cells}</table>'
