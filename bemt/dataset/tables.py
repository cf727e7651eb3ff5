"""A dataset as a table of pandas or xarray, or of a notebook."""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base import units
from bemt.base.errors import needs

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from bemt.dataset.points import Dataset

__all__ = ["to_html", "to_pandas", "to_xarray"]


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
