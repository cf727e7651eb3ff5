"""Where results may go: into a folder, and never over a file that the command reads."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from bemt.base.errors import Fault, InputError


def faults(option: str, folder: Path, names: Iterable[str], inputs: Iterable[Path]) -> list[Fault]:
    """Say which results must not be written."""
    near = next((path for path in (folder, *folder.parents) if path.exists()), None)
    if near is not None and not near.is_dir():
        return [Fault(option, "", f"{near.as_posix()}, a file", "a folder")]
    # resolved: the same file may be named in two ways, or stand behind a link
    read = {path.resolve() for path in inputs}
    hint = "Name another folder"
    return [
        Fault(option, "", f"{(folder / name).as_posix()}, which this run reads", "no input among the results", hint)
        for name in names
        if (folder / name).resolve() in read
    ]


def check(option: str, folder: Path, names: Iterable[str], inputs: Iterable[Path]) -> None:
    """Refuse to write over what is read; to be called before anything is written."""
    found = faults(option, folder, names, inputs)
    if found:
        raise InputError(found)
