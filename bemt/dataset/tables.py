"""A dataset as a table of pandas or xarray, and a table as a dataset."""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base import units
from bemt.base.errors import Fault, InputError, needs
from bemt.dataset.points import DIMENSIONLESS, ORIGINS, Array, Dataset, channel_fault

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["from_pandas", "to_html", "to_pandas", "to_xarray"]


def to_pandas(d: Dataset) -> pd.DataFrame:
    """Give the points as a table: :meth:`Dataset.to_pandas`."""
    import pandas as pd

    columns: dict[str, Any] = dict(d.values)
    columns |= {f"u_{key}": v for key, v in d.u.items() if not np.all(np.isnan(v))}
    columns |= {f"u_{origin}_{key}": v for origin, parts in d.u_by.items() for key, v in parts.items()}
    if any(d.flags):
        columns["flags"] = ["; ".join(words) for words in d.flags]
    frame = pd.DataFrame(columns, index=pd.Index(d.labels) if d.labels else None)
    about = {"kind": d.kind, "name": d.name, "provenance": dict(d.provenance), "notes": list(d.notes)}
    frame.attrs.update(about)
    return frame


def to_xarray(d: Dataset) -> xr.Dataset:
    """Give the points as an xarray dataset: :meth:`Dataset.to_xarray`."""
    xarray = needs("xarray", "xarray")
    frame = to_pandas(d)
    out = xarray.Dataset({key: ("point", frame[key].to_numpy()) for key in frame.columns}, attrs=dict(frame.attrs))
    for key in out.data_vars:
        _, unit = units.split_suffix(str(key))
        out[key].attrs["units"] = "1" if unit is None else unit.suffix
    return out


def from_pandas(frame: pd.DataFrame, kind: str = "bench", name: str = "table", **more: Any) -> Dataset:
    """Make a dataset from a table whose headings carry their units.

    Parameters
    ----------
    frame : pandas.DataFrame
        Columns ``rpm``, coefficients, or names that end in a unit (``thrust_N``, ``thrust_gf``, ``airspeed_km_h``);
        they are converted to SI by it. ``u_<column>`` is a standard uncertainty, ``flags`` words joined by "; ".
    kind, name : str
        As for :class:`Dataset`.
    **more
        ``provenance``, ``notes``.

    Returns
    -------
    Dataset
        With the index as labels, unless it only counts.

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

    faults: list[Fault] = []
    values: dict[str, Array] = {}
    u: dict[str, Array] = {}
    u_by: dict[str, dict[str, Array]] = {}
    for heading in map(str, frame.columns):
        if heading == "flags":
            continue
        column = heading.removeprefix("u_") if heading.startswith("u_") else heading
        origin = next((o for o in ORIGINS if column.startswith(f"{o}_") and heading.startswith("u_")), "")
        column = column.removeprefix(f"{origin}_") if origin else column
        base, unit = units.split_suffix(column)
        scale, offset, channel = 1.0, 0.0, column
        named = column == "rpm" or column in DIMENSIONLESS
        if not named and unit is not None and (unit.factor, unit.offset) != (1.0, 0.0):
            base_unit = (unit.dimension, 1.0, 0.0)
            si = next(s for s, o in units.UNITS.items() if (o.dimension, o.factor, o.offset) == base_unit)
            scale, offset, channel = unit.factor, unit.offset, f"{base}_{si}"
        elif fault := channel_fault(column):
            faults.append(Fault(name, heading, *fault))
            continue
        try:
            numbers = pd.to_numeric(frame[heading]).to_numpy(dtype=float)
        except (ValueError, TypeError) as error:
            faults.append(Fault(name, heading, str(error), "a column of numbers"))
            continue
        if heading == column:
            values[channel] = numbers * scale + offset
        elif origin:
            u_by.setdefault(origin, {})[channel] = numbers * scale
        else:
            u[channel] = numbers * scale
    if faults:
        raise InputError(faults)
    flags = tuple(tuple(w for w in str(words).split("; ") if w) for words in frame["flags"]) if "flags" in frame else ()
    counted = isinstance(frame.index, pd.RangeIndex)
    labels = () if counted else tuple(map(str, frame.index))
    return Dataset(kind, name, values, u, flags, more.pop("provenance", {}), labels, u_by, more.pop("notes", ()))


def to_html(d: Dataset) -> str:
    """Give the points as a table of a notebook: each value with its standard uncertainty, where one is known."""
    columns = [*d.values, *(["flags"] if any(d.flags) else [])]
    shown = list(range(len(d))) if len(d) <= 12 else [*range(8), None, *range(len(d) - 3, len(d))]

    def cell(name: str, i: int) -> str:
        if name == "flags":
            return ", ".join(d.flags[i])
        value, u = d.values[name][i], d.u[name][i]
        if not np.isfinite(value):
            return "-"
        if not u > 0.0:
            return f"{value:.6g}"
        digits = max(0, 1 - math.floor(math.log10(u)))  # two digits of the uncertainty
        return f"{value:.{digits}f} &plusmn; {u:.{digits}f}"

    head = "".join(f"<th>{html.escape(name)}</th>" for name in columns)
    rows = "".join(
        "<tr>" + "".join(f"<td>{'&#8942;' if i is None else cell(name, i)}</td>" for name in columns) + "</tr>"
        for i in shown
    )
    notes = "".join(f"<br><small>{html.escape(note)}</small>" for note in d.notes)
    what = f"<strong>{html.escape(f'{d.kind}: {d.name}, {len(d)} points')}</strong>"
    return f'{what}<div style="overflow-x:auto"><table class="bemt"><tr>{head}</tr>{rows}</table></div>{notes}'
