"""Readers of recorded data: one file per format, found by scanning this folder.

A reader is a module of this package that defines

* ``KIND`` : str, the name used in ``format = "..."``;
* ``sniff(head) -> bool`` : True if the head of a file (:data:`HEAD_BYTES` bytes, or text) has this format;
* ``read(path) -> Dataset`` : the rows of the file, samples or points, in SI, or :class:`bemt.base.errors.InputError`
  with all its faults. Use :class:`bemt.data.readers.recording.Builder` or :func:`bemt.data.readers.samples.dataset`.
  Readers of blades and polars return the object of their own package instead;
* optionally ``FALLBACK = True`` : used only if no other reader claims the file.

or ``READERS``, a tuple of :class:`Reader` or of objects like it, where several formats share a file.

The file extension is ignored. If two readers claim a file, that is an error that asks for ``format =``.
"""

from __future__ import annotations

import hashlib
import importlib
import math
import os
import pkgutil
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from bemt.base import plugins
from bemt.base.errors import Fault, InputError, system_fault
from bemt.base.packed import MAX_BYTES, packed, part_of, unpacked
from bemt.base.toml_text import Collector
from bemt.data.readers.marks import instead

__all__ = [
    "HEAD_BYTES", "Reader", "SourceText", "decode", "detect", "head_text", "importers", "load_text", "number", "read",
]  # fmt: skip

HEAD_BYTES = 16384
"""Number of bytes passed to ``sniff``."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?")


class Importer(Protocol):
    """What every reader has, a module or an object."""

    KIND: str

    def sniff(self, head: bytes | str, /) -> bool:
        """Tell whether the head of a file has this format."""

    def read(self, path: str | os.PathLike[str], /) -> Any:
        """Read a file."""


@dataclass(frozen=True)
class Reader:
    """A reader among several of one file."""

    KIND: str
    sniff: Callable[[bytes | str], bool]
    read: Callable[[str | os.PathLike[str]], Any]
    BLADE: bool = False


@dataclass(eq=False)
class SourceText(Collector):
    """Text of one input file, with its provenance and the faults found in it.

    Parameters
    ----------
    name : str
        Path as given by the user; appears in faults.
    text : str
        Decoded content (see `decode`), without a byte order mark.
    sha256 : str
        Hash of the bytes of the file, hexadecimal.
    """

    name: str
    text: str
    sha256: str

    def __post_init__(self) -> None:
        Collector.__init__(self, self.name)

    @cached_property
    def lines(self) -> list[str]:
        """Lines without line ends; line numbers in faults count from 1."""
        return self.text.splitlines()

    def may_be_cut(self, line: int) -> bool:
        """Whether a line is the last and has no end."""
        return line == len(self.lines) and not self.text.endswith(("\n", "\r"))

    @property
    def about(self) -> dict[str, str]:
        """Provenance of what is read from it."""
        return {"file": self.name, "sha256": self.sha256}


WIDE = {b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}


def _binary(raw: bytes) -> bool:
    """Whether bytes are no text: NUL outside UTF-16 with its mark."""
    return b"\0" in raw and raw[:2] not in WIDE


def decode(raw: bytes) -> str:
    r"""Text of bytes, or of the head of a file.

    Parameters
    ----------
    raw : bytes
        UTF-8, UTF-16 with its mark, Windows-1252, or another code in which a known heading shows; the last character
        of UTF-8 that has others beyond ASCII may be cut.

    Returns
    -------
    str
        Text without a byte order mark.

    Examples
    --------
    >>> decode("\ufeff°".encode("utf-16-le")), decode(b"\xb0")
    ('°', '°')
    """
    if raw[:2] in WIDE:
        return raw[2:].decode(WIDE[raw[:2]], errors="replace")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        cut = error.start > len(raw) - 4 and "unexpected end" in error.reason
        if cut and not raw[: error.start].isascii():
            return raw[: error.start].decode("utf-8-sig")
        return _other_code(raw)


_CODES = ("gb18030", "shift_jis", "big5", "cp1251")
"""Codes of spreadsheets in China, Japan, Taiwan and Russia: taken where they show a word of a heading."""


def _other_code(raw: bytes) -> str:
    """Text of bytes that are no UTF-8, in the code in which a heading shows words that are known."""
    code = _shown_code(raw[:HEAD_BYTES])
    if code is not None:
        return raw.decode(code, errors="replace")
    try:
        return raw.decode("cp1252")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


@lru_cache(maxsize=4)  # every reader asks about the head of one file
def _shown_code(head: bytes) -> str | None:
    """Code in which the head of a file shows a known word."""
    from bemt.data.readers._words import FOREIGN

    for code in _CODES:
        text = head.decode(code, errors="ignore").lower()
        if any(word in text for word in FOREIGN):
            return code
    return None


def load_bytes(path: str | os.PathLike[str]) -> bytes:
    """Bytes of a file, or `InputError` with what the system says, or with its size if it is too large."""
    try:
        with Path(part_of(path)[0]).open("rb") as stream:
            raw = stream.read(MAX_BYTES + 1)  # a device has no size
    except OSError as error:
        raise InputError(system_fault(error, os.fspath(path), "a readable file")) from error
    if len(raw) > MAX_BYTES:
        raise InputError(Fault(os.fspath(path), "", f"more than {MAX_BYTES} bytes", "less", "Part the file"))
    return raw


def load_text(path: str | os.PathLike[str]) -> SourceText:
    """Read a whole file, unpacking gzip and workbooks; the hash is that of the file as stored.

    Parameters
    ----------
    path : str or path
        File to read.

    Returns
    -------
    SourceText
        Its text, name and hash.

    Raises
    ------
    InputError
        If the file cannot be read, is damaged, larger than :data:`MAX_BYTES`, or binary (contains NUL bytes).
    """
    name = os.fspath(path)
    raw = load_bytes(path)
    digest = hashlib.sha256(raw).hexdigest()
    raw = unpacked(raw, name)
    if _binary(raw):
        raise InputError(Fault(name, "", "binary data (NUL bytes)", "a text file", "Export the data as plain text"))
    return SourceText(name, decode(raw), digest)


def head_text(head: bytes | str) -> str:
    r"""Text of the head of a file, for sniffers.

    Parameters
    ----------
    head : bytes or str
        First bytes of a file, or text.

    Returns
    -------
    str
        Text; the empty string for binary data.

    Examples
    --------
    >>> head_text(b"\xef\xbb\xbfRPM CT CP")
    'RPM CT CP'
    """
    if isinstance(head, str):
        return head.removeprefix("\ufeff")
    return "" if _binary(head) else decode(head)


def begins(pattern: str) -> Callable[[bytes | str], bool]:
    r"""Sniffer of files whose text begins so, in capitals or not.

    >>> sniff = begins(r"\s*DFDC\s+Version")
    >>> sniff("DFDC Version 0.55"), sniff(b"XROTOR VERSION: 7.55")
    (True, False)
    """
    mark = re.compile(pattern, re.IGNORECASE)
    return lambda head: mark.match(head_text(head)) is not None


def first_cells(head: bytes | str) -> set[str]:
    r"""Cells of the first line of a comma-separated file, for sniffers.

    >>> sorted(first_cells("rpm, thrust\n1,2"))
    ['rpm', 'thrust']
    """
    return {cell.strip() for cell in head_text(head).partition("\n")[0].split(",")}


def number(token: str) -> float | None:
    """Read one finite decimal number, strictly.

    Parameters
    ----------
    token : str
        Text such as ``-1.5e-3``; Fortran's ``1.0D+00`` is accepted.

    Returns
    -------
    float or None
        The value, in the unit of the column; None if the text is not a finite number (``nan``, ``1,5``, ``0.34-NaN``,
        ``1_000``).

    Examples
    --------
    >>> number("1.0D-02"), number("0,5"), number("nan"), number("1e999")
    (0.01, None, None, None)
    """
    text = token.strip()
    if not _NUMBER.fullmatch(text):
        return None
    value = float(text.replace("D", "e").replace("d", "e"))
    return value if math.isfinite(value) else None


@cache
def importers() -> Mapping[str, Importer]:
    """Find the readers in this folder.

    Returns
    -------
    mapping of str to module (or an object like one)
        By kind, sorted; read-only.

    Raises
    ------
    TypeError
        If a module with a KIND lacks sniff or read, or repeats a kind (a bug, not an input error).
    """
    found: dict[str, Importer] = {}
    for info in pkgutil.iter_modules(__path__):
        module = importlib.import_module(f"{__name__}.{info.name}")
        for reader in getattr(module, "READERS", (module,)):
            kind = getattr(reader, "KIND", None)
            if kind is None:  # what readers share
                continue
            if not isinstance(kind, str) or not callable(getattr(reader, "sniff", None)) or not hasattr(reader, "read"):
                raise TypeError(f"{module.__name__} is no importer: it needs KIND, sniff(head) and read(path)")
            if kind in found:
                raise TypeError(f"{module.__name__} repeats the kind {kind!r}")
            found[kind] = reader
    return MappingProxyType(dict(sorted(found.items())))


def detect(path: str | os.PathLike[str]) -> str:
    """Detect the format of a file from its content.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    str
        Kind of the only reader that claims it.

    Raises
    ------
    InputError
        If it cannot be read, if no reader claims it, or if two or more do (then give ``format =``).
    """
    place, target, known = Collector(os.fspath(path)), Path(path), importers()
    if target.is_dir():
        inside = target / "recording.toml"
        hint = f"Give {inside.as_posix()}" if inside.is_file() else "Name the files in it"
        place.refuse("", "a folder", "a file", hint)
    head = _head(target, place)
    if not head.strip():
        place.refuse("", "an empty file", "results as a table of text", "Did the export finish?")
    claimed = [k for k, m in known.items() if m.sniff(head)]
    if not (kinds := [k for k in claimed if not getattr(known[k], "FALLBACK", False)]):
        _refuse_known(target, head, place, bool(claimed))
        kinds = claimed
    if len(kinds) > 1:
        hint = " or ".join(f'format = "{kind}"' for kind in kinds)
        place.refuse("", f"content claimed by {', '.join(kinds)}", "one format", f"Give {hint}")
    return kinds[0]


def kind_of(path: str | os.PathLike[str]) -> str:
    """Detect the format of a file; "" where `detect` refuses it, which is said where the file is read."""
    try:
        return detect(path)
    except InputError:
        return ""


def _refuse_known(target: Path, head: bytes, place: Collector, a_table: bool) -> None:
    """Refuse a file that only the reader of tables claims where it is something else, and any that none claims."""
    for command, where in plugins.offered("FILE_KINDS").items():
        if kind := plugins.load(where)(target):
            place.refuse("", kind, "a recording of a stand", f"It is read by {command} {target}")
    if told := instead(head, a_table):
        place.refuse("", *told)
    if a_table:
        return
    if _binary(head):
        place.refuse("", "binary data (NUL bytes)", "a text file", "Export the data as plain text (CSV)")
    hint = "Give --format (format = in a case) if its head is unusual"
    expected = f"a table under a line of headings, or a file of one of the {len(importers())} formats that are read"
    place.refuse("", "content of no known format", expected, hint)


def _head(target: Path, place: Collector) -> bytes:
    """First bytes of a file, unpacked."""
    try:
        file, part = part_of(target)
        with Path(file).open("rb") as stream:
            head = stream.read(HEAD_BYTES)
        return unpacked(load_bytes(target), place.file, HEAD_BYTES) if part or packed(head) else head
    except OSError as error:
        raise InputError(system_fault(error, place.file, "a readable file")) from error


def read(path: str | os.PathLike[str], format: str | None = None) -> Any:  # noqa: A002 - the key of the case file
    """Read a file with the reader of its format.

    Parameters
    ----------
    path : str or path
        The file.
    format : str or None
        Kind of the reader; None detects it from the content.

    Returns
    -------
    Dataset or object
        The return value of that reader's ``read``.

    Raises
    ------
    InputError
        On an unknown format, or on faults in the data.
    """
    known = importers()
    kind = detect(path) if format is None else format
    if kind not in known:
        raise InputError(Fault(os.fspath(path), "format", repr(kind), f"one of {', '.join(known)}"))
    with np.errstate(all="ignore"):  # a damaged file may hold any number; what is not finite is flagged or refused
        return known[kind].read(path)
