"""Datasets made of others, joined, or of a table of pandas."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base import units
from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, refuse
from bemt.physics.dataset.channels import DIMENSIONLESS, ORIGINS, channel_fault
from bemt.physics.dataset.points import Dataset

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["concat", "from_pandas"]


def concat(series: Iterable[Dataset], name: str | None = None) -> Dataset:
    """Join series of one kind, point after point.

    Parameters
    ----------
    series : iterable of Dataset
        At least one; all of the same kind.
    name : str or None
        Name of the result; None takes the first.

    Returns
    -------
    Dataset
        All channels of all; NaN where a part lacks one, unit "" where two differ; notes, lines and texts of all.
        ``provenance["parts"]`` lists (name, points, provenance).

    Raises
    ------
    InputError
        When there is none, or kinds differ.

    Examples
    --------
    >>> a, b = Dataset("bench", "a", {"J": [0.1]}), Dataset("bench", "b", {"J": [0.2], "CT": [0.1]})
    >>> concat([a, b])["CT"]
    array([nan, 0.1])
    """
    parts = list(series)
    kinds = sorted({part.kind for part in parts})
    if len(kinds) != 1:
        got = f"kinds {', '.join(kinds)}" if kinds else "no series"
        raise InputError(Fault(name or "concat", "", got, "one or more series of one kind", ""))
    if len(parts) == 1:
        return parts[0] if name is None else replace(parts[0], name=name)
    channels = list(dict.fromkeys(key for part in parts for key in part.values))

    def joined(attribute: str, key: str) -> Array:
        return np.concatenate([getattr(p, attribute).get(key, np.full(len(p), np.nan)) for p in parts])

    return Dataset(
        kinds[0],
        parts[0].name if name is None else name,
        {key: joined("values", key) for key in channels},
        {key: joined("u", key) for key in channels},
        sum((part.flags for part in parts), ()),
        {"parts": tuple((part.name, len(part), dict(part.provenance)) for part in parts)},
        sum((part.labels or ("",) * len(part) for part in parts), ()) if any(part.labels for part in parts) else (),
        notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        units={key: unit for part in parts for key, unit in part.units.items()}
        | {key: "" for key in channels if len({part.unit(key) for part in parts if key in part}) > 1},
        lines=sum((tuple(part.lines) for part in parts), ()) if all(part.lines for part in parts) else (),
        texts={key: sum((part.texts.get(key, ("",) * len(part)) for part in parts), ())
               for key in dict.fromkeys(key for part in parts for key in part.texts)},
    )  # fmt: skip


def from_pandas(frame: pd.DataFrame, kind: str = "bench", name: str = "table", **more: Any) -> Dataset:
    """Make a dataset from a table whose headings carry their units.

    Parameters
    ----------
    frame : pandas.DataFrame
        Columns ``rpm``, coefficients, or names that end in a unit (``thrust_N``, ``thrust_gf``, ``airspeed_km_h``);
        they are converted to SI by it. ``u_<column>`` is a standard uncertainty, ``flags`` words joined by "; ";
        columns of text stay text.
    kind, name : str
        As for :class:`Dataset`.
    **more
        ``provenance``, ``notes``.

    Returns
    -------
    Dataset
        With the index as labels, unless it only counts or its name is that of a channel, as after ``set_index("rpm")``.

    Raises
    ------
    InputError
        With all faults: headings without a known unit, cells that are no numbers.

    Examples
    --------
    >>> import pandas as pd
    >>> d = from_pandas(pd.DataFrame({"rpm": [6000], "thrust_gf": [1000.0]}))
    >>> d["thrust_N"].round(5), d.kind
    (array([9.80665]), 'bench')
    """
    import pandas as pd

    own = {k for k in frame.index.names if isinstance(k, str) and not channel_fault(k)} - {*frame.columns}
    frame = frame.reset_index([*own]) if own else frame
    faults: list[Fault] = []
    values: dict[str, Array] = {}
    u: dict[str, Array] = {}
    u_by: dict[str, dict[str, Array]] = {}
    texts: dict[str, tuple[str, ...]] = {}
    for heading in map(str, frame.columns):
        if heading == "flags":
            continue
        prefix = next((f"{o}_" for o in ORIGINS if heading.startswith(f"u_{o}_")), "")
        column = heading.removeprefix("u_").removeprefix(prefix)
        base, unit = units.split_suffix(column)
        scale, offset, channel = 1.0, 0.0, column
        named = column == "rpm" or column in DIMENSIONLESS
        if not named and unit is not None and (unit.factor, unit.offset) != (1.0, 0.0):
            base_unit = (unit.dimension, 1.0, 0.0)
            si = next(s for s, o in units.UNITS.items() if (o.dimension, o.factor, o.offset) == base_unit)
            scale, offset, channel = unit.factor, unit.offset, f"{base}_{si}"
        elif (fault := channel_fault(column)) and all(isinstance(cell, str) for cell in frame[heading]):
            texts[heading] = tuple(frame[heading])
            continue
        elif fault:
            faults.append(Fault(name, heading, *fault))
            continue
        try:
            numbers = pd.to_numeric(frame[heading]).to_numpy(dtype=float)
        except (ValueError, TypeError) as error:
            faults.append(Fault(name, heading, str(error), "a column of numbers"))
            continue
        if heading == column:
            values[channel] = numbers * scale + offset
        elif prefix:
            u_by.setdefault(prefix[:-1], {})[channel] = numbers * scale
        else:
            u[channel] = numbers * scale
    refuse(faults)
    flags = tuple(tuple(w for w in str(words).split("; ") if w) for words in frame["flags"]) if "flags" in frame else ()
    counted = isinstance(frame.index, pd.RangeIndex)
    labels = () if counted else tuple(map(str, frame.index))
    about, notes = more.pop("provenance", {}), more.pop("notes", ())
    return Dataset(kind, name, values, u, flags, about, labels, u_by, notes, texts=texts)
