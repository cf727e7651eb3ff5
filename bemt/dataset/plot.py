"""Channels of a dataset over another one, drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.errors import Fault, InputError

if TYPE_CHECKING:
    from bemt.dataset.points import Dataset

__all__ = ["plot"]

OKABE_ITO = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#000000")
"""Colours that colour-blind readers tell apart (Okabe and Ito 2008)."""


def plot(d: Dataset, x: str | None = None, y: Sequence[str] = (), ax: Any = None) -> Any:
    """Draw channels over another one, with bands where uncertainties are known: :meth:`Dataset.plot`."""
    import matplotlib.pyplot as plt

    ways = [k for k in ("J", "airspeed_m_s", "rpm") if k in d and np.unique(d[k].round(9)).size > 1]
    x = x or (ways[0] if ways else "rpm")
    wanted = list(y) or [k for k in ("CT", "CP") if k in d and x == "J"] or ["thrust_N"]
    wanted = [y] if isinstance(y, str) else wanted
    unknown = [key for key in (x, *wanted) if key not in d]
    if unknown:
        known = ", ".join(d.values)
        raise InputError(Fault(d.name, ", ".join(unknown), "no such channel", f"one of {known}"))
    beside, points = ax is not None, d.kind in ("bench", "cfd", "vendor")
    if ax is None:
        ax = plt.subplots(layout="constrained")[1]
        ax.set_prop_cycle(color=OKABE_ITO)
    drawn = [line.get_gid() for line in ax.lines]
    colours = {line.get_gid(): line.get_color() for line in ax.lines if drawn.count(line.get_gid()) == 1}
    speeds = np.unique(d["rpm"]) if "rpm" in d and x != "rpm" else np.array([np.nan])
    for channel in wanted:
        for speed in speeds:
            rows = np.flatnonzero(d["rpm"] == speed) if np.isfinite(speed) else np.arange(len(d))
            rows = rows[np.argsort(d[x][rows], kind="stable")]
            name = f"{channel}, {speed:.0f} rev/min" if len(speeds) > 1 else channel
            name = f"{name}, {d.name}" if beside else name
            style = {"marker": "o", "ls": ""} if points else {}
            style |= {"color": colours[channel]} if channel in colours and len(speeds) == 1 else {}
            at, value, u = d[x][rows], d[channel][rows], d.u[channel][rows]
            (line,) = ax.plot(at, value, label=name, gid=channel, **style)
            if np.any(u > 0.0) and points:
                ax.errorbar(at, value, np.nan_to_num(u), fmt="none", ecolor=line.get_color(), lw=1)
            elif np.any(u > 0.0):
                ax.fill_between(at, value - u, value + u, alpha=0.2, color=line.get_color(), lw=0)
    ax.set_xlabel(x)
    ax.set_ylabel(", ".join(wanted))
    if not beside:
        ax.set_title(d.name, fontsize=10)
    ax.legend(fontsize=8, frameon=False)
    return ax
