"""A dataset as a table of pandas or xarray, of a notebook, or as a plot."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base import units
from bemt.base.errors import Fault, InputError, needs
from bemt.physics import coefficients as co

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

    from bemt.base.arrays import Array
    from bemt.physics.dataset.points import Dataset

ONE_SPEED, MOST_SPEEDS = 0.01, 6  # share by which the speeds of one set point differ; set points of a legend

__all__ = ["plot", "to_html", "to_pandas", "to_xarray"]


def to_pandas(d: Dataset) -> pd.DataFrame:
    """Give the points as a table: :meth:`Dataset.to_pandas`."""
    import pandas as pd

    columns: dict[str, Any] = dict(d.values)
    columns |= {f"u_{key}": v for key, v in d.u.items() if not np.all(np.isnan(v))}
    columns |= {f"u_{origin}_{key}": v for origin, parts in d.u_by.items() for key, v in parts.items()}
    if any(d.flags) or d.kind in ("bemt", "k1k2"):  # of what is solved it is always asked
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


def plot(d: Dataset, x: str | None = None, y: Sequence[str] = (), ax: Any = None) -> Any:
    """Draw channels over another one, with bands where uncertainties are known: :meth:`Dataset.plot`."""
    import matplotlib.pyplot as plt

    x, wanted = _axes(d, x, y)
    beside, points = ax is not None, d.kind in ("bench", "cfd", "vendor")
    if ax is None:
        from bemt.base.canvas import CYCLE

        ax = plt.subplots(layout="constrained")[1]
        ax.set_prop_cycle(color=CYCLE)
    drawn = [line.get_gid() for line in ax.lines]
    colours = {line.get_gid(): line.get_color() for line in ax.lines  # of points beside a line, or a line beside points
               if drawn.count(line.get_gid()) == 1 and (line.get_marker() == "o") != points}  # fmt: skip
    speeds = _speeds(d.rpm) if "rpm" in d and x != "rpm" else {np.nan: np.arange(len(d))}
    for channel in wanted:
        for speed, at_speed in speeds.items():
            rows = at_speed[np.argsort(d[x][at_speed], kind="stable")]
            name = f"{channel}, {speed:.0f} rev/min" if len(speeds) > 1 else channel
            name = f"{name}, {d.name}" if beside else name
            style = {"marker": "o", "ls": ""} if points else {}
            style |= {"color": colours[channel]} if channel in colours and len(speeds) == 1 else {}
            at, value, u = d[x][rows], d[channel][rows], d.u[channel][rows]
            (line,) = ax.plot(at, value, label=name, gid=channel, **style)
            if np.any(u > 0.0) and points:
                ax.errorbar(at, value, np.nan_to_num(u), fmt="none", ecolor=line.get_color(), lw=1)
            elif np.any(u > 0.0):
                ax.fill_between(at, value - u, _top(d, channel, rows), alpha=0.2, color=line.get_color(), lw=0)
    _framed(ax)
    ax.set_xlabel(x)
    ax.set_ylabel(", ".join(wanted))
    if not beside:
        ax.set_title(d.name, fontsize=10)
    ax.legend(fontsize=8, frameon=False)
    return ax


def _framed(ax: Any) -> None:
    """Frame all lines; a band that is wider than all values, as an efficiency's near no thrust, leaves the frame."""
    ax.relim()
    low, high = ax.dataLim.intervaly
    most = 0.5 * (high - low)
    for band in ax.collections:
        for path in band.get_paths():
            at = path.vertices[np.isfinite(path.vertices).all(axis=1)]
            ax.update_datalim(np.column_stack([at[:, 0], np.clip(at[:, 1], low - most, high + most)]))
    ax.autoscale_view()


def _speeds(rpm: Array) -> dict[float, NDArray[np.intp]]:
    """Rows by speed of rotation: one set point where they lie within 1 %; of more than six all rows as one.

    >>> {n: rows.tolist() for n, rows in _speeds(np.array([3006.0, 2998.0, 4000.0, 2999.0])).items()}
    {2999.0: [1, 3, 0], 4000.0: [2]}
    """
    order = np.argsort(rpm, kind="stable")
    v = rpm[order]
    cuts, first = [], 0
    for i in range(1, len(v)):
        if v[i] > v[first] * (1.0 + ONE_SPEED):
            cuts.append(i)
            first = i
    groups = np.split(order, cuts)
    if len(groups) > MOST_SPEEDS:
        return {float("nan"): np.arange(len(rpm))}
    return {float(np.median(rpm[rows])): rows for rows in groups}


def _axes(d: Dataset, x: str | None, y: Sequence[str] | str) -> tuple[str, list[str]]:
    """Channels to draw: those asked for, else what varies, and coefficients over J."""
    ways = [k for k in ("J", "airspeed_m_s", "rpm") if k in d and np.unique(d[k].round(9)).size > 1]
    x = x or (ways[0] if ways else "rpm")
    wanted = [y] if isinstance(y, str) else list(y) or [k for k in ("CT", "CP") if k in d and x == "J"] or ["thrust_N"]
    unknown = [key for key in (x, *wanted) if key not in d]
    if unknown:
        known = ", ".join(d.values)
        made = {*unknown} & {"CT", "CP", "CQ", "eta", "J"}
        hint = "d.derive(diameter_m, density_kg_m3) makes CT, CP, CQ, J and eta of loads" if made else ""
        raise InputError(Fault(d.name, ", ".join(unknown), "no such channel", f"one of {known}", hint))
    return x, wanted


def _top(d: Dataset, channel: str, rows: NDArray[np.int_]) -> Array:
    """Upper edge of a band; no efficiency is above what momentum allows."""
    value: Array = d[channel][rows]
    top: Array = value + d.u[channel][rows]
    if channel != "eta" or not {"J", "CT"} <= d.values.keys():
        return top
    ducted = "duct_share" in d and np.any(d.duct_share != 0.0)
    least = 0.0 if ducted else d.CT[rows] - np.nan_to_num(d.u_CT[rows])
    limited: Array = np.fmax(value, np.minimum(top, co.eta_limit(d.J[rows], least)))
    return limited
