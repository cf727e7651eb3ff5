"""Seal of the proof: a key that is fixed before the diagnosis begins, and the check that nothing was changed since."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from bemt.base.errors import Fault, InputError
from bemt.base.tables import json_text, write_atomic
from bemt.judge.proof.rows import Key, Stored

__all__ = ["KEY", "SEAL", "seal", "sha256", "stored", "unseal"]

KEY, SEAL = "key.json", "key.sha256"


def sha256(text: str) -> str:
    """Hash of a text.

    Examples
    --------
    >>> sha256("")[:8]
    'e3b0c442'
    """
    return hashlib.sha256(text.encode()).hexdigest()


def seal(folder: Path, key: Key) -> str:
    """Write a key and its hash."""
    text = json_text(key.document())
    folder.mkdir(parents=True, exist_ok=True)
    write_atomic(folder / KEY, text)
    digest = sha256(text)
    write_atomic(folder / SEAL, digest + "\n")
    return digest


def unseal(folder: Path, digest: str | None = None) -> Key:
    """Read a key after checking it and every file that it vouches for."""
    path = folder / KEY
    try:
        text = path.read_text(encoding="utf-8")
        wanted = digest or (folder / SEAL).read_text(encoding="utf-8").strip()
    except OSError as error:
        raise InputError(Fault(str(error.filename), "", "no such file", "the key and its seal of a proof")) from error
    if sha256(text) != wanted:
        raise InputError(Fault(path.as_posix(), "", f"SHA-256 {sha256(text)}", wanted, "The key was changed"))
    key = Key.from_document(json.loads(text))
    faults = []
    for item in key.items:
        for name, known in item.files.items():
            file = folder / "items" / item.folder / name
            try:
                found = sha256(file.read_text(encoding="utf-8"))
            except (OSError, UnicodeDecodeError):
                found = "nothing readable"
            if found != known:
                faults.append(Fault(file.as_posix(), "", found, f"SHA-256 {known}", "The file was changed"))
    if faults:
        raise InputError(faults)
    return key


def stored(file: Path) -> Stored:
    """What a file of an answer holds; no answer where there is no file."""
    return Stored.from_document(json.loads(file.read_text(encoding="utf-8"))) if file.exists() else Stored()
