"""Answer of ``export``: what was written, where, and what was refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bemt.base.errors import EXIT_INPUT, EXIT_OK, InputError
from bemt.base.face import as_html
from bemt.tools.exports import folder

SCHEMA = "bemt.export/1"


@dataclass(frozen=True, eq=False)
class Exported:
    """Cases that were written for other programs.

    Parameters
    ----------
    manifests : tuple of mapping
        What ``manifest.json`` says of each case, with the formats that were kept and that are stale.
    folders : tuple of Path
        Folder of each.
    refused : tuple of InputError
        Why cases or targets were refused.
    """

    manifests: tuple[Mapping[str, Any], ...]
    folders: tuple[Path, ...]
    refused: tuple[InputError, ...] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that the manifests list."""
        return tuple(
            home / name for one, home in zip(self.manifests, self.folders, strict=True) for name in folder.listed(one)
        )

    @property
    def text(self) -> str:
        """What was written, for a terminal."""
        return "\n".join(folder.text(dict(one), home) for one, home in zip(self.manifests, self.folders, strict=True))

    @property
    def exit_code(self) -> int:
        """2 where something was refused."""
        return EXIT_INPUT if self.refused else EXIT_OK

    @property
    def complaints(self) -> tuple[str, ...]:
        """Why, a line each."""
        return tuple(str(error) for error in self.refused)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, ``bemt.export/1``."""
        return {"schema": SCHEMA, "cases": [dict(one) for one in self.manifests]}

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return f"<export of {', '.join(str(one['name']) for one in self.manifests)}: {len(self.files)} files>"

    def _repr_html_(self) -> str:
        return as_html(repr(self)[1:-1], self.text)
