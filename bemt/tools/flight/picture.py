"""A flight in one picture: thrust over speed and in moving air beside the model, and each motor's drive."""

from __future__ import annotations

import re
import textwrap
from typing import Any

import numpy as np

from bemt.base import canvas
from bemt.base.arrays import Array
from bemt.base.canvas import BLUE, GREEN, ORANGE
from bemt.base.units import G0
from bemt.tools.flight.answer import FlightAnswer
from bemt.tools.flight.judge import FlightVerdict
from bemt.tools.flight.text import headline, stated_size

_LINES = canvas.CYCLE[:6]
_CELL_S = 0.5  # length of a mean over time [s]


def flight_picture(answer: FlightAnswer, mass_kg: float | None = None, kind: str = "png") -> bytes:
    """Draw a flight as png, pdf or svg; without a mass [kg] loads are per kilogram."""
    import matplotlib as mpl

    with mpl.rc_context({"font.size": 10.5, "axes.labelsize": 10.0, "legend.fontsize": 9.0, "axes.titlesize": 10.5}):
        figure = canvas.figure(7.6, 6.6)
        axes = figure.subplots(2, 2)
        for ax in axes.flat:
            ax.locator_params(axis="x", nbins=5)
            canvas.frame(ax)
        _thrust(axes[0, 0], answer, mass_kg)
        _flow(axes[0, 1], answer)
        _drives(axes[1, 0], answer)
        _balance(axes[1, 1], answer)
        rotors = f"{answer.log.rotors} rotors" if answer.log.rotors else "no output of a motor"
        title = f"{answer.log.format}, {rotors}\n{textwrap.fill(headline(answer.judged), 88)}"
        figure.suptitle(title, fontsize=11.0)
        return canvas.drawn(figure, kind, dpi=130)


def _empty(ax: Any, text: str) -> None:
    ax.set_axis_off()
    ax.text(0.5, 0.5, text, ha="center", va="center", transform=ax.transAxes, color="0.4", wrap=True)


def _flow(ax: Any, answer: FlightAnswer) -> None:
    flow, said = answer.inflow, answer.predicted
    if flow is None or (flow.axial is None and flow.inplane is None):
        return _empty(ax, "Thrust in moving air: this flight does not show it.\nFly climbs, descents and fast passes; "
                      "log speeds,\naccelerometer, velocity and attitude")  # fmt: skip
    parts = ((flow.axial, flow.bins[0], said.axial if said else None, BLUE, "along the axis"),
             (flow.inplane, flow.bins[1], said.inplane if said else None, GREEN, "in the plane"))  # fmt: skip
    for got, bins, model, colour, name in parts:
        if got is None or not bins.size:
            continue
        zero = float(np.interp(0.0, bins[0], bins[1]))
        ax.errorbar(bins[0], 100 * (bins[1] - zero), 200 * bins[2], fmt="o", ms=4, color=colour, capsize=2, label=name)
        if model is not None:
            ax.plot(model[0], 100 * model[1], color=colour, lw=1.5, label=f"model, {name}")
    ax.axhline(0.0, color="0.3", lw=0.8)
    ax.set_xlabel("velocity [m/s], climb above zero")
    ax.set_ylabel("thrust at equal speed [%]")
    ax.legend(frameon=False)


def over_time(t: Array, x: Array) -> tuple[Array, Array]:
    """Middles of cells of equal time, (M,), and means of columns, (N, B), in them, (M, B); NaN in a gap."""
    cells = max(min(max(int((t[-1] - t[0]) / _CELL_S), 10), 300, t.size // 5), 1)
    edges = np.linspace(t[0], t[-1], cells + 1)
    cell = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, cells - 1)
    count = np.bincount(cell, minlength=cells)
    sums = np.array([np.bincount(cell, column, minlength=cells) for column in x.T])
    mean = np.divide(sums, count, out=np.full(sums.shape, np.nan), where=count > 0)
    return 0.5 * (edges[1:] + edges[:-1]), mean.T


def _drives(ax: Any, answer: FlightAnswer) -> None:
    log, on = answer.log, answer.log.flying
    drive = log.command if log.command is not None else log.rpm
    if drive is None or on.sum() < 50:
        _empty(ax, "no flight with motors running")
        return
    t, x = log.t[on], drive[on]
    when, mean = over_time(t, x)
    share = 100 * (mean / mean.mean(axis=1, keepdims=True) - 1.0)
    for i in range(share.shape[1]):
        name = f"{i + 1}" if i else "motor 1"
        style = "-" if i < len(_LINES) else "--"
        ax.plot(when, share[:, i], style, lw=1.2, label=name, color=_LINES[i % len(_LINES)])
    if answer.change is not None and np.isfinite(answer.change.at_s):
        ax.axvline(answer.change.at_s, color="0.2", ls=":", lw=1.5)
    ax.margins(y=0.2)
    ax.set_xlabel("time [s]")
    ax.set_ylabel("drive, against the mean [%]")
    ax.legend(frameon=False, ncols=min(share.shape[1], 8), loc="lower center", bbox_to_anchor=(0.5, 1.0),
              handlelength=0.9, handletextpad=0.4, columnspacing=0.8)  # fmt: skip


def _thrust(ax: Any, answer: FlightAnswer, mass_kg: float | None) -> None:
    log, on = answer.log, answer.log.flying
    m, unit = (mass_kg, "N") if mass_kg is not None else (1.0, "N/kg")
    drive = log.rpm if log.rpm is not None else log.command
    if drive is None or not on.any():
        _empty(ax, "no flight with motors running")
        return
    speeds = log.rpm is not None
    x = np.sqrt(np.mean(drive[on] ** 2, axis=1)) if speeds else drive[on].mean(axis=1)
    B = drive.shape[1]
    if log.acceleration is not None:
        step = max(x.size // 1500, 1)
        ax.plot(x[::step], m * log.acceleration[on, 2][::step] / B, ".", ms=2, color="0.7", zorder=1,
                label="accelerometer")  # fmt: skip
    name = "thrust constant" if speeds else "thrust per command"
    grid = np.linspace(0.97 * x.min(), 1.03 * x.max(), 50)
    power = 2 if speeds else 1
    c = answer.found.constants.get(name)
    if c is not None:
        ax.plot(grid, c.value * grid**power, color=BLUE, label="flight")
        ax.fill_between(grid, (c.value - c.half) * grid**power, (c.value + c.half) * grid**power,
                        color=BLUE, alpha=0.25, lw=0)  # fmt: skip
    if answer.predicted is not None and speeds and mass_kg is not None:
        k, u = answer.predicted.constant, answer.predicted.u
        ax.plot(grid, k * grid**2, color=ORANGE, label="model")
        ax.fill_between(grid, (k - 2 * u) * grid**2, (k + 2 * u) * grid**2, color=ORANGE, alpha=0.2, lw=0)
    ax.plot([x.mean()], [m * G0 / B], "D", color=GREEN, label="weight over rotors")
    command = "command, share of full" if log.command_unit == "1" else f"command [{log.command_unit}]"
    ax.set_xlabel("speed [rev/min]" if speeds else command)
    ax.set_ylabel(f"thrust per rotor [{unit}]")
    ax.legend(frameon=False)


def _beside_others(rotors: int) -> float:
    """Change of a drive against those of the other motors, over that of its share, which holds the motor itself."""
    return rotors / max(rotors - 1, 1)


def bars_of(judged: FlightVerdict) -> Array:
    """Change of each motor's drive against those of the others, (B,) [1]."""
    return _beside_others(judged.readings.size) * judged.readings


def _balance(ax: Any, answer: FlightAnswer) -> None:
    j = answer.judged
    if not j.readings.size:
        _empty(ax, "no balance")
        return
    accused = {int(n) - 1 for e in j.said.effects for n in re.findall(r"\d+", e)}
    colours = [_LINES[i % len(_LINES)] for i in range(j.readings.size)]
    edges = [1.8 if i in accused else 0.0 for i in range(j.readings.size)]
    bars = 100 * bars_of(j)
    ax.bar(np.arange(1, bars.size + 1), bars, color=colours, edgecolor="k", linewidth=edges)
    if np.isfinite(j.scatter):
        two = 200 * _beside_others(bars.size) * j.scatter
        ax.axhspan(-two, two, color="0.5", alpha=0.2, lw=0,
                   label="healthy flights (2 sd)" if j.given else "healthy vehicles (2 sd)")  # fmt: skip
    if (stated := stated_size(j)) is not None and len(accused) == 1:
        ax.errorbar([min(accused) + 1], [100 * stated.size], [100 * stated.half], fmt="D", ms=5, color="k", capsize=4,
                    label="stated above, with its 95 % band")  # fmt: skip
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    ax.margins(y=0.2)
    ax.axhline(0.0, color="0.3", lw=0.8)
    ax.set_xticks(np.arange(1, j.readings.size + 1))
    ax.set_xlabel("motor")
    change = ",\nchange from healthy flights" if np.isfinite(j.total) else ""
    ax.set_ylabel(f"drive, against the other motors{change} [%]")
