"""Actions on files: read and check them, fetch public data."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Literal

from bemt.base.action import Told, action, worded

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from bemt.physics.dataset import Dataset

    Path = str | os.PathLike[str]

__all__ = ["fetch", "read"]


@partial(worded, checked=True)
def read(path: Path, format: str | None = None) -> Dataset:  # noqa: A002
    r"""Read a recording: a bench log, a table, a CFD export, a vendor file.

    Parameters
    ----------
    path : str or path
        The file.
    format : str, optional
        Name of the reader; detected from the content by default.

    Returns
    -------
    Dataset
        Steady points of a log, rows of a table of points, or one point with the means of a CFD history. ``notes`` list
        the decisions made and what looks wrong. Suspicious data are not corrected.

    Raises
    ------
    InputError
        If the file cannot be interpreted; the message says what to write.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> file = Path(tempfile.mkdtemp()) / "bench.csv"
    >>> _ = file.write_text("rpm,thrust_gf,torque_Nm\n5000,340,0.05\n6000,490,0.07\n")
    >>> read(file).thrust_N.round(2)
    array([3.33, 4.81])
    """
    from bemt.base.given import path_text
    from bemt.data.recordings.load import as_dataset, import_file

    return as_dataset(import_file(path_text("path", path), format))


@action("Recordings", "fetch uiuc", words=("kind",))
def fetch(
    kind: Literal["uiuc"], *, source: Path | None = None, out: Path | None = None, url: str | None = None,
    progress: Callable[[str], None] | None = None,
) -> Told:  # fmt: skip
    """Download a public database of measured propellers into the cache.

    Parameters
    ----------
    kind : {"uiuc"}
        ``uiuc``: the UIUC Propeller Database.
    source : path, optional
        Use this archive (.zip) instead of downloading it.
    out : path, optional
        Folder for the data; the cache by default. To have them anew, delete it.
    url : str, optional
        Download from this mirror instead of the publisher.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Told
        Schema ``bemt.data/1``.

    Raises
    ------
    InputError
        For an archive that cannot be had or read.

    Examples
    --------
    >>> fetch("uiuc", source="no/such.zip")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no/such.zip: got ...
    """
    import os

    from bemt.data.recordings import database

    def bytes_had(have: int, total: int) -> None:
        if progress is not None:
            progress(f"{have / 1e6:.1f}{f' of {total / 1e6:.1f}' if total else ''} MB")

    where, archive = (None if path is None else os.fspath(path) for path in (out, source))
    found = database.get(kind, database.folder_of(kind, where), archive, url, bytes_had)
    return Told(found.document(), found.text)
