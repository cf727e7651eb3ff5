"""Columns as a reader gathers them, and the `Dataset` of samples or points that it returns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PureWindowsPath
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.averaging import Mean
from bemt.physics.dataset import Dataset
from bemt.physics.dataset.channels import channel_fault, unit_in


@dataclass(frozen=True, eq=False)
class Channel:
    """One column of a file, while it is read."""

    values: Array  # (N,) values in ``unit``, NaN where the file has none
    unit: str = ""  # Unit of the values, "" when the file states none and none may be assumed
    mean: Mean | None = None  # What stands for the channel, in its unit; None when nothing does


def dataset(
    form: str, kind: str, channels: Mapping[str, Channel], notes: Sequence[str] = (),
    provenance: Mapping[str, Any] | None = None, *, flags: Sequence[tuple[str, ...]] = (), lines: Sequence[int] = (),
    texts: Mapping[str, Sequence[str]] | None = None, headings: Mapping[str, str] | None = None,
    constants: Mapping[str, float] | None = None, instrument: Mapping[str, Mapping[str, float]] | None = None,
) -> Dataset:  # fmt: skip
    """Make the dataset of a file: columns of another length than the longest end in NaN.

    `headings` are those of the file by channel, `constants` numbers that hold for all of it (``density_kg_m3``),
    `instrument` the standard uncertainty by channel: ``gain`` [1], ``zero`` and ``sample`` in the channel's unit.

    >>> d = dataset("table", "bench", {"rpm": Channel(np.array([4e3, 5e3]), "rpm"), "x": Channel(np.array([1.0]))})
    >>> d.unit("rpm"), d.unit("x"), d["x"]
    ('rpm', '', array([ 1., nan]))
    """
    rows = max((len(c.values) for c in channels.values()), default=0)
    values, own = {}, {}
    for name, channel in channels.items():
        values[name] = _column(channel.values, rows)
        if channel_fault(name) or unit_in(name) != channel.unit:
            own[name] = channel.unit
    about = {**(provenance or {}), "format": form}
    means = {name: channel.mean for name, channel in channels.items() if channel.mean is not None}
    more = {"headings": headings, "constants": constants, "instrument": instrument, "means": means}
    about |= {key: dict(given) for key, given in more.items() if given}
    name = PureWindowsPath(str(about.get("file", ""))).name or form
    return Dataset(kind, name, values, flags=tuple(flags), provenance=about, notes=tuple(notes), units=own,
                   lines=lines, texts={k: tuple(v) for k, v in (texts or {}).items()})  # fmt: skip


def _column(values: Array, rows: int) -> Array:
    """Read-only column of full length; what is not finite is no number."""
    v = np.asarray(values, dtype=float)
    if v.size < rows:
        v = np.concatenate([v, np.full(rows - v.size, np.nan)])
    if np.isinf(v).any():
        v = np.where(np.isinf(v), np.nan, v)
    v.setflags(write=False)
    return v


def channels_of(d: Dataset) -> dict[str, Channel]:
    """Columns of a part of a file, to be named anew in the whole."""
    means = d.provenance.get("means", {})
    return {name: Channel(v, d.unit(name), means.get(name)) for name, v in d.values.items()}
