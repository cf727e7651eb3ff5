"""Text in the dictionary format of OpenFOAM."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Entries = Mapping[str, Any]


def vector(*components: float) -> str:
    """Give a vector or a list of numbers in parentheses.

    >>> vector(0, 0, -1.5)
    '(0 0 -1.5)'
    """
    return f"({' '.join(f'{c + 0.0:.9g}' for c in components)})"


def value_text(value: Any) -> str:
    """Give one value: numbers with nine digits, booleans as words, sequences in parentheses, texts as they are.

    >>> value_text(True), value_text(0.1 + 0.2), value_text(["a", (0, 1)])
    ('true', '0.3', '(a (0 1))')
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, str)):
        return str(value)
    if isinstance(value, Sequence):
        return f"({' '.join(value_text(item) for item in value)})"
    return f"{float(value) + 0.0:.9g}"


def block(entries: Entries, depth: int = 0) -> str:
    """Give the entries of a dictionary, nested ones in braces.

    >>> print(block({"a": 1, "b": {"c": "uniform 0"}}), end="")
    a 1;
    b
    {
        c uniform 0;
    }
    """
    pad = "    " * depth
    lines = []
    for key, value in entries.items():
        if isinstance(value, Mapping):
            lines.append(f"{pad}{key}\n{pad}{{\n{block(value, depth + 1)}{pad}}}\n")
        elif key.startswith("#"):
            lines.append(f"{pad}{key} {value}\n")
        else:
            lines.append(f"{pad}{key} {value_text(value)};\n".replace(" ;", ";"))
    return "".join(lines)


def dictionary(name: str, entries: Entries, kind: str = "dictionary", note: str = "") -> str:
    """Give a whole file with its header."""
    head = block({"FoamFile": {"version": "2.0", "format": "ascii", "class": kind, "object": name}})
    return head + (f"// {note}\n" if note else "") + "\n" + block(entries)
