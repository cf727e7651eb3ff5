"""What an imported file turned out to be: the same record for every format, shown by ``python -m bemt import``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Channel:
    """One column of a file.

    Parameters
    ----------
    values : (N,) float
        Values in ``unit``, NaN where the file has none.
    unit : str
        Unit of the values, "" when the file states none and none may be assumed.
    mean : float or None
        The value that stands for the channel, in its unit; None when none does.
    averaged_over : str
        What the mean was taken over, in words ("last 4 revolutions", "all rows", "" without a mean).
    drift : float or None
        Change over the averaged part relative to its mean [1]; None when not meaningful.
    """

    values: Array
    unit: str = ""
    mean: float | None = None
    averaged_over: str = ""
    drift: float | None = None


@dataclass(frozen=True, eq=False)
class Imported:
    """One file, read.

    Parameters
    ----------
    format : str
        KIND of the importer.
    kind : str
        What the numbers are: cfd, bench, vendor, geometry, polar, table.
    rows : int
        Rows of data.
    channels : mapping of str to Channel
        By name; SI names with unit suffix where the unit is known, the file's own names otherwise.
    warnings : tuple of str
        What a user has to know: assumptions, dropped rows, restarts, missing units.
    provenance : mapping
        File, SHA-256 and whatever the file says of itself.
    flags : tuple of tuple of str
        Per row; empty: no flags at all.
    lines : tuple of int
        Line of each row in the file, from 1; empty: not known.
    texts : mapping of str to tuple of str
        Columns of text, by name, one entry per row.
    headings : mapping of str to str
        Heading in the file of each channel, where it has one.
    constants : mapping of str to float
        Numbers that hold for the whole file, by name with SI unit suffix (``density_kg_m3``).
    instrument : mapping of str to mapping
        Standard uncertainty of the instrument per channel, correlated parts apart: ``gain`` [1], ``zero`` and
        ``sample`` (in the unit of the channel).
    """

    format: str
    kind: str
    rows: int
    channels: Mapping[str, Channel]
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)
    flags: tuple[tuple[str, ...], ...] = ()
    lines: tuple[int, ...] = ()
    texts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    headings: Mapping[str, str] = field(default_factory=dict)
    constants: Mapping[str, float] = field(default_factory=dict)
    instrument: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
