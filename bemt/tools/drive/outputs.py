"""Where results may go: into a folder, and never over a file that the command reads."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base import canvas
from bemt.base.arrays import Array
from bemt.base.errors import Fault, refuse
from bemt.tools.drive.bench_map import CHANNELS

if TYPE_CHECKING:
    from bemt.tools.drive.bench_map import BenchMap


# Pictures of the drive as PNG bytes.


def _figure(columns: int = 1, width: float = 6.0, height: float = 4.0) -> tuple[Any, list[Any]]:
    figure = canvas.figure(width * columns, height)
    axes = [figure.add_subplot(1, columns, i + 1) for i in range(columns)]
    for ax in axes:
        canvas.frame(ax)
    return figure, axes


def _png(figure: Any, title: str) -> bytes:
    """PNG with a title that is wrapped where it is wider than the figure."""
    figure.suptitle(textwrap.fill(title, int(10 * figure.get_figwidth())))
    return canvas.png(figure)


def bench_map(chart: BenchMap, name: str) -> bytes:
    """Draw a bench map with the points it was fitted to."""
    label = {"thrust": "thrust [N]", "rpm": "speed [rev/min]", "current": "current [A]", "power": "power [W]"}
    figure, axes = _figure(len(chart.curves), 4.0, 3.6)
    pulse = np.linspace(*chart.pulse_range_us, 400)
    for ax, quantity in zip(axes, chart.curves, strict=True):
        if chart.points is not None:
            y = chart.points[CHANNELS[quantity]]
            words = "recorded"
            if chart.with_voltage:
                ratio = chart.points.voltage_V / chart.voltage_ref
                y, words = y / ratio ** chart.curves[quantity].exponent, f"recorded, taken to {chart.voltage_ref:.1f} V"
            ax.plot(chart.points.pulse_us, y, "o", ms=4, mfc="none", color=canvas.CYCLE[6], label=words)
        reference = f"map at {chart.voltage_ref:.1f} V" if chart.with_voltage else "map"
        ax.plot(pulse, chart.at(quantity, pulse), color=canvas.CYCLE[0], label=reference)
        ax.set_xlabel("pulse width [µs]")
        ax.set_ylabel(label[quantity])
    axes[0].legend(frameon=False)
    return _png(figure, name)


def box_plot(values: Mapping[str, Array], marks: Mapping[str, float], ylabel: str, title: str) -> bytes:
    """Draw trials by method as boxes, with single values beside them."""
    figure, (ax,) = _figure(1, 8.5, 4.6)
    names = list(values)
    for i, name in enumerate(names):
        v = values[name]
        if len(v) > 1:
            ax.boxplot([v], positions=[i], widths=0.45, showfliers=False, medianprops={"color": canvas.CYCLE[5]})
            ax.plot(i + np.linspace(-0.15, 0.15, len(v)), v, "o", ms=3, alpha=0.6, color=canvas.CYCLE[0])
        else:
            ax.plot([i], v, "D", color=canvas.CYCLE[0])
    for k, (name, value) in enumerate(marks.items()):
        ax.axhline(value, ls="--", lw=1.2, color=canvas.CYCLE[(2, 3, 1)[k % 3]], label=name)
    ax.set_xticks(range(len(names)), [f"{n}\n(n = {len(values[n])})" for n in names])
    ax.set_xlim(-0.6, len(names) - 0.4)
    ax.set_ylabel(ylabel)
    if marks:
        figure.legend(frameon=False, loc="outside lower center", ncols=len(marks))
    return _png(figure, title)


@dataclass(frozen=True)
class Panel:
    """Lines of one frame: label, x, y and style of each."""

    x: str
    y: str
    series: Sequence[tuple[str, Any, Any, str]]
    title: str = ""


def curves(panels: Sequence[Panel], title: str = "") -> bytes:
    """Draw panels of lines and points."""
    figure, axes = _figure(len(panels), 5.0, 3.9)
    for ax, panel in zip(axes, panels, strict=True):
        for k, (label, x, y, style) in enumerate(panel.series):
            ax.plot(x, y, style, color=canvas.CYCLE[k % len(canvas.CYCLE)], ms=4, mfc="none", label=label)
        ax.set_xlabel(panel.x)
        ax.set_ylabel(panel.y)
        ax.set_title(panel.title, fontsize=10)
        if any(label for label, *_ in panel.series):
            ax.legend(frameon=False, fontsize=8)
    return _png(figure, title)


def faults(option: str, folder: Path, names: Iterable[str], inputs: Iterable[Path]) -> list[Fault]:
    """Say which results must not be written."""
    near = next((path for path in (folder, *folder.parents) if path.exists()), None)
    if near is not None and not near.is_dir():
        return [Fault(option, "", f"{near.as_posix()}, a file", "a folder")]
    # resolved: the same file may be named in two ways, or stand behind a link
    read = {path.resolve() for path in inputs}
    hint = "Name another folder"
    return [
        Fault(option, "", f"{(folder / name).as_posix()}, which this run reads", "no input among the results", hint)
        for name in names
        if (folder / name).resolve() in read
    ]


def check(option: str, folder: Path, names: Iterable[str], inputs: Iterable[Path]) -> None:
    """Refuse to write over what is read; to be called before anything is written."""
    found = faults(option, folder, names, inputs)
    refuse(found)
