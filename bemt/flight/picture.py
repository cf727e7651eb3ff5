"""A flight in one picture: thrust over speed beside the model, and the change of each rotor's drive."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from bemt.base.units import G0
from bemt.flight.answer import FlightAnswer

__all__ = ["flight_picture"]

_BLUE, _ORANGE, _GREEN = "#0072B2", "#E69F00", "#009E73"


def flight_picture(answer: FlightAnswer, mass_kg: float | None = None) -> bytes:
    """Draw a flight.

    Parameters
    ----------
    answer : FlightAnswer
        The answer.
    mass_kg : float or None
        Mass [kg]; None: loads are per kilogram.

    Returns
    -------
    bytes
        PNG.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2)
    for ax in (left, right):
        ax.grid(True, alpha=0.3)
        ax.spines[["top", "right"]].set_visible(False)
    _thrust(left, answer, mass_kg)
    _balance(right, answer)
    figure.suptitle(f"{answer.log.format}, {answer.log.rotors} rotors: {answer.judged.verdict}"
                    + (f" ({', '.join(answer.judged.effects)})" if answer.judged.effects else ""))  # fmt: skip
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=110, metadata={"Software": None})
    return out.getvalue()


def _thrust(ax: Any, answer: FlightAnswer, mass_kg: float | None) -> None:
    log, on = answer.log, answer.log.flying
    m, unit = (mass_kg, "N") if mass_kg is not None else (1.0, "N/kg")
    drive = log.rpm if log.rpm is not None else log.command
    if drive is None or not on.any():
        ax.set_title("no flight with motors running")
        return
    speeds = log.rpm is not None
    x = np.sqrt(np.mean(drive[on] ** 2, axis=1)) if speeds else drive[on].mean(axis=1)
    B = drive.shape[1]
    if log.acceleration is not None:
        step = max(x.size // 1500, 1)
        ax.plot(x[::step], m * log.acceleration[on, 2][::step] / B, ".", ms=2, color="0.7", zorder=1,
                label="accelerometer times mass" if mass_kg is not None else "accelerometer")  # fmt: skip
    name = "thrust constant" if speeds else "thrust per command"
    grid = np.linspace(0.97 * x.min(), 1.03 * x.max(), 50)
    power = 2 if speeds else 1
    c = answer.found.constants.get(name)
    if c is not None:
        ax.plot(grid, c.value * grid**power, color=_BLUE, label="flight (momentum balance)")
        ax.fill_between(grid, (c.value - c.half) * grid**power, (c.value + c.half) * grid**power,
                        color=_BLUE, alpha=0.25, lw=0)  # fmt: skip
    if answer.predicted is not None and speeds and mass_kg is not None:
        k, u = answer.predicted
        ax.plot(grid, k * grid**2, color=_ORANGE, label="model of the case")
        ax.fill_between(grid, (k - 2 * u) * grid**2, (k + 2 * u) * grid**2, color=_ORANGE, alpha=0.2, lw=0)
    ax.plot([x.mean()], [m * G0 / B], "D", color=_GREEN, label="weight over rotors")
    ax.set_xlabel("speed [rev/min]" if speeds else f"command [{log.command_unit}]")
    ax.set_ylabel(f"thrust per rotor [{unit}]")
    ax.legend(fontsize=8, frameon=False)


def _balance(ax: Any, answer: FlightAnswer) -> None:
    j = answer.judged
    if not j.readings.size:
        ax.set_title("no balance")
        return
    accused = {int(e.rsplit(" ", 1)[1]) - 1 for e in j.effects}
    colours = [_ORANGE if i in accused else _BLUE for i in range(j.readings.size)]
    ax.bar(np.arange(1, j.readings.size + 1), 100 * j.readings, color=colours)
    if np.isfinite(j.scatter):
        ax.axhspan(-200 * j.scatter, 200 * j.scatter, color="0.5", alpha=0.2, lw=0,
                   label="healthy flights differ by (2 sd)")  # fmt: skip
        ax.legend(fontsize=8, frameon=False)
    ax.axhline(0.0, color="0.3", lw=0.8)
    ax.set_xticks(np.arange(1, j.readings.size + 1))
    ax.set_xlabel("motor")
    against = "healthy flights" if np.isfinite(j.total) else "the other rotors"
    ax.set_ylabel(f"share of the drive, against {against} [%]")
