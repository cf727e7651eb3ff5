"""A TOML file read: what is no TOML is told with line and column, in words that no version of Python changes."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from bemt.base.errors import Fault


class Collector:
    """Gathers the faults of one file."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.faults: list[Fault] = []

    def add(self, where: str, got: str, expected: str, hint: str = "") -> None:
        """Add one fault."""
        self.faults.append(Fault(self.file, where, got, expected, hint))


def load_toml(path: str | Path, out: Collector) -> dict[str, Any] | None:
    """Read a TOML file; faults carry line and column."""
    try:
        raw = Path(path).read_bytes()
    except FileNotFoundError:
        out.add("", "no such file", "a TOML file", "Check the path")
        return None
    except OSError as error:
        out.add("", f"an unreadable file ({error.strerror})", "a TOML file")
        return None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        column = error.start - raw.rfind(b"\n", 0, error.start)
        out.add(f"{line}:{column}", f"byte 0x{raw[error.start]:02x}", "UTF-8 text", "Save the file as UTF-8")
        return None
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        out.add(*_syntax_fault(str(error), text))
        return None


_SYNTAX = {
    "Cannot overwrite": "a repeated key or table",
    "Cannot declare": "a repeated key or table",
    "Cannot mutate": "a repeated key or table",
    "Invalid value": "no value that TOML knows",
    "Illegal character": "an open quote or an illegal character",
    "Unterminated string": "an open quote or an illegal character",
    "Expected newline": "more text after a value",
    "Unescaped": "a backslash that starts no escape",
    "Expected '='": "a key without =",
}
"""Start of tomllib's message to words that do not change with the version of Python."""


def _syntax_fault(message: str, text: str) -> tuple[str, str, str, str]:
    found = re.match(r"(.*?)\s*\(at (?:line (\d+), column (\d+)|end of document)\)$", message, re.S)
    lines = text.splitlines() or [""]
    if found is None:
        return "", f"invalid TOML ({message})", "valid TOML 1.0", ""
    what = next((words for start, words in _SYNTAX.items() if found[1].startswith(start)), "invalid TOML")
    line, column = (int(found[2]), int(found[3])) if found[2] else (len(lines), len(lines[-1]) + 1)
    source = lines[line - 1].strip() if line <= len(lines) else ""
    hint = ""
    if what == "a repeated key or table":
        hint = "Write each key and each table once"
    elif re.search(r"\d,\d", source) and "[" not in source:
        hint = "Use a decimal point"
    elif re.search(r"=\s*[A-Za-z]", source) and not re.search(r"=\s*(true|false|inf|nan)\b", source):
        hint = "Put text in quotes"
    elif re.search(r"=\s*(#.*)?$", source):
        hint = "Give the key a value"
    return f"{line}:{column}", what + (f" in `{source[:60]}`" if source else ""), "valid TOML 1.0", hint
