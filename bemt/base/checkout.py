"""The commit of a checkout, read from its files: git runs what a configuration names, and that may be anybody's."""

from __future__ import annotations

import re
import stat
from pathlib import Path

_HASH = re.compile(r"[0-9a-f]{40}|[0-9a-f]{64}")
_REF = re.compile(r"refs/[\w./+@-]+")
_MOST = 1 << 24  # Bytes of a file of references
_SHORT = 12


def commit(folder: Path) -> str:
    """Hash of the commit that is checked out where a folder lies, 12 digits; empty outside of a checkout.

    No program is started, and nothing but a hash is taken from the files. Changes since the commit are not seen.

    >>> commit(Path("/"))
    ''
    """
    for place in (folder.resolve(), *folder.resolve().parents):
        found = place / ".git"
        if found.exists():
            link = re.fullmatch(r"gitdir: (.+)", _text(found).strip()) if not found.is_dir() else None
            return _head(place / link[1] if link else found)[:_SHORT]
    return ""


def _head(git: Path) -> str:
    """Hash of HEAD, directly or by one reference; empty where there is none."""
    word = _text(git / "HEAD").strip()
    if _HASH.fullmatch(word):
        return word
    name = word.removeprefix("ref: ")
    if not _REF.fullmatch(name) or ".." in name:
        return ""
    common = _text(git / "commondir").strip()  # of a linked worktree
    for home in (git, git / common) if common else (git,):
        loose = _text(home / name).strip()
        if _HASH.fullmatch(loose):
            return loose
        packed = re.search(rf"^({_HASH.pattern}) {re.escape(name)}$", _text(home / "packed-refs"), re.MULTILINE)
        if packed:
            return packed[1]
    return ""


def _text(file: Path) -> str:
    """Start of a regular file; empty where there is none: a pipe would wait for ever."""
    try:
        if not stat.S_ISREG(file.stat().st_mode):
            return ""
        with file.open("rb") as stream:
            return stream.read(_MOST).decode("utf-8", "replace")
    except (OSError, ValueError):
        return ""
