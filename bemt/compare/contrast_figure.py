"""One picture of two recordings: the loads over speed, and what lies between them."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from bemt.compare.recordings import RunChange

# Okabe and Ito 2008, Color Universal Design.
_A, _B, _BAND, _GREY = "#0072B2", "#D55E00", "#56B4E9", "#8a8a8a"
_LABEL = {
    "thrust": "thrust / n² [N s²]",
    "torque": "torque / n² [Nm s²]",
    "speed": "speed [rev/min]",
    "electrical": "electrical power / n³ [W s³]",
    "voltage": "voltage [V]",
}
_STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.facecolor": "white",
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.5,
}


def picture(change: RunChange, doc: Mapping[str, Any]) -> bytes:
    """Draw it as PNG."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = [c for c in change.channels.values() if c.name in ("thrust", "torque")]
    shown = shown or list(change.channels.values())[:2]
    shown += [c for c in change.channels.values() if c.name == "speed"][: 3 - len(shown)]
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(8.0, 2.3 * len(shown) + 0.5), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(len(shown), 2, squeeze=False)
        for row, c in zip(axes, shown, strict=True):
            _readings(row[0], change, c)
            _ratio(row[1], change.ratios[c.channel], c.name)
        said = doc["verdict"] + (": " + ", ".join(doc["effects"]) if doc["effects"] else "")
        figure.suptitle(f"A: {_short(change.a.points.name)}    B: {_short(change.b.points.name)}\n{said}", fontsize=9.5)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=150)
    return buffer.getvalue()


def _short(name: str) -> str:
    tail = name.rsplit("/", 1)[-1]
    return tail if len(tail) <= 46 else tail[:22] + "…" + tail[-22:]


def _abscissa(c: Any) -> Any:
    return c.x[:, 0] if c.name in ("speed", "voltage") else np.exp(c.x[:, 0])


def _readings(axis: Any, change: RunChange, c: Any) -> None:
    shift = np.where(c.second, c.log_density, 0.0)
    power = {"thrust_N": 2, "torque_Nm": 2, "power_W": 3, "electrical_power_W": 3}.get(c.channel, 0)
    density = change.a.density if math.isfinite(change.a.density) and c.log_density else 1.0
    y = np.exp(c.y + shift) * 60.0**power
    del density
    x = _abscissa(c)
    for side, colour, mark, name in ((False, _A, "o", "A"), (True, _B, "s", "B")):
        own = c.second == side
        axis.plot(x[own], y[own], mark, color=colour, ms=3.5, mfc="none" if side else colour, label=name)
    axis.set_ylabel(_LABEL[c.name] if c.channel not in ("CT", "CP", "CQ") else c.channel)
    axis.set_xlabel("command" if c.name in ("speed", "voltage") else "speed of rotation [rev/min]")
    axis.legend(loc="best")
    axis.ticklabel_format(axis="y", style="sci", scilimits=(-2, 4))


def _ratio(axis: Any, r: Mapping[str, Any], name: str) -> None:
    curve = np.array(r["curve"]) * np.array([1.0, 1.0, r["density_ratio"], r["density_ratio"], r["density_ratio"]])
    x = curve[:, 0] if name in ("speed", "voltage") else np.exp(curve[:, 0])
    axis.fill_between(x, curve[:, 3], curve[:, 4], color=_BAND, alpha=0.3, lw=0.0, label="95 %")
    axis.plot(x, curve[:, 2], color=_A, label="B over A")
    axis.axhline(1.0, color=_GREY, lw=0.8)
    if r["density_ratio"] != 1.0:
        axis.axhline(r["density_ratio"], color=_B, lw=1.0, ls="--", label="recorded density")
    axis.set_ylabel(f"{name}: B / A")
    axis.set_xlabel("command" if name in ("speed", "voltage") else "speed of rotation [rev/min]")
    axis.legend(loc="best")
