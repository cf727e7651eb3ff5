"""Plain values that the report's templates show: parts of a section, pictures."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

Part = tuple[str, Any]
"""What it is, and its value: words, command, verdict, table, list, figures, more (see `templates/report.html`)."""
Section = tuple[str, list[Part]]


@dataclass(frozen=True)
class Answer:
    """A case in one sentence, with its badge and picture."""

    id: str
    title: str
    kind: str
    word: str
    words: str
    picture: str


@dataclass(frozen=True)
class Page:
    """A page of the menu."""

    id: str
    name: str  # In the menu
    title: str
    top: Sequence[Part]  # Above the sections
    sections: Sequence[Section]
    answers: Sequence[Answer] = ()


def sections(*found: Section) -> list[Section]:
    """Leave out what is empty: figures and tables of a part, parts of a section, sections."""
    out = []
    for title, parts in found:
        kept = [(kind, [f for f in value if f] if kind == "figures" else value) for kind, value in parts]
        kept = [(kind, value) for kind, value in kept if value]
        if any(kind != "words" for kind, _ in kept):
            out.append((title, kept))
    return out


def uri(data: bytes, kind: str = "png") -> str:
    """Embed a picture."""
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


def picture(name: str, data: bytes) -> dict[str, Any]:
    """Show a file with its name in words."""
    kind = "png" if name.endswith(".png") else "svg+xml"
    return {"kind": "picture", "alt": name.rpartition(".")[0].replace("_", " "), "src": uri(data, kind)}
