"""One picture of two recordings: the loads over speed or advance ratio, and what lies between them."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base import canvas
from bemt.base.arrays import Array
from bemt.judge.compare.change_document import ComparedRuns
from bemt.judge.compare.contrast_text import WORD, headline
from bemt.judge.compare.matched import POWER_OF_SPEED

if TYPE_CHECKING:
    from bemt.judge.compare.matched import MatchedChannel
    from bemt.judge.compare.recordings import RunChange

_A, _B, _BAND, _GREY = canvas.BLUE, canvas.RED, canvas.SKY, canvas.GREY
_LABEL = {
    "thrust_N": "thrust / n² [N s²]", "torque_Nm": "torque / n² [N m s²]", "power_W": "shaft power / n³ [W s³]",
    "electrical_power_W": "electrical power / n³ [W s³]", "rpm": "speed of rotation [rev/min]",
    "voltage_V": "voltage [V]",
}  # fmt: skip
_COMMAND = {"pwm_s": ("pulse width [µs]", 1e6), "throttle": ("throttle [-]", 1.0)}
_OVER_COMMAND = ("speed", "voltage")
# Speeds that vary by less than this share are one.
_STEADY = 0.05
# Characters in a line of the title.
_WIDE = 110


def picture(change: RunChange, doc: ComparedRuns) -> bytes:
    """Draw it as PNG."""
    import matplotlib

    shown = [c for c in change.channels.values() if c.name in ("thrust", "torque")]
    shown = shown or list(change.channels.values())[:2]
    shown += [c for c in change.channels.values() if c.name == "speed"][: 3 - len(shown)]
    with matplotlib.rc_context(canvas.STYLE):
        figure, axes = canvas.blank(2.3 * len(shown) + 0.5, len(shown), 2)
        for row, c in zip(axes, shown, strict=True):
            _readings(row[0], change, c)
            _ratio(row[1], change, c)
        figure.suptitle(title(doc), fontsize=9.5)
        return canvas.png(figure, canvas.DPI)


def title(doc: ComparedRuns) -> str:
    """Both files, with the rows that were chosen, and the answer.

    >>> files, rows = ("mon/a.csv", "tue/a.csv"), {"A": (), "B": ("rotor=left",)}
    >>> print(title(ComparedRuns("unknown", (), None, None, Densities(None, None, None), recordings=files, rows=rows)))
    A: mon/a.csv
    B: tue/a.csv (rotor=left)
    Something changed, and no listed cause explains it.
    """
    paths = [Path(name) for name in doc.recordings]
    names = [path.name for path in paths]
    if names[0] == names[1] and paths[0] != paths[1]:
        names = [str(path.relative_to(path.parent.parent)) for path in paths]
    lines = []
    for letter, name in zip("AB", names, strict=True):
        rows = ", ".join(doc.rows[letter])
        lines.append(f"{letter}: {name}" + (f" ({rows})" if rows else ""))
    return "\n".join(part for line in (*lines, headline(doc)) for part in textwrap.wrap(line, _WIDE))


def _along(c: MatchedChannel) -> int:
    """Coordinate of the abscissa: the advance ratio where it alone varies."""
    steady = c.name not in _OVER_COMMAND and float(np.ptp(c.x[:, 0])) < _STEADY
    return 1 if steady and c.advance_moves() else 0


def _axis(change: RunChange, c: MatchedChannel) -> tuple[str, Callable[[Array], Array]]:
    """Label of the abscissa, and the coordinate in its unit."""
    if _along(c):
        return _advance(change)[0], lambda x: x
    if c.name in _OVER_COMMAND:
        label, factor = _COMMAND[change.a.command]
        return label, lambda x: x * factor
    return _LABEL["rpm"], np.exp


def _advance(change: RunChange) -> tuple[str, str, str]:
    """Label of the second coordinate of the loads, and its symbol and unit in a legend."""
    known = math.isfinite(change.diameter_m) or all("J" in run.points for run in (change.a, change.b))
    return ("advance ratio J [-]", "J", "") if known else ("advance per turn V/n [m]", "V/n", " m")


def _range(change: RunChange, c: MatchedChannel, side: bool) -> str:
    """The coordinate that is not drawn, of one recording, where it varies."""
    if not c.advance_moves():
        return ""
    own = c.x[c.second == side]
    if _along(c):
        ends = [f"{np.exp(end(own[:, 0])):.0f}" for end in (np.min, np.max)]
        return f", {' to '.join(dict.fromkeys(ends))} rev/min"
    _, symbol, unit = _advance(change)
    ends = [f"{end(own[:, 1]):.2f}" for end in (np.min, np.max)]
    return f", {symbol} {' to '.join(dict.fromkeys(ends))}{unit}"


def _readings(axis: Any, change: RunChange, c: MatchedChannel) -> None:
    shift = np.where(c.second, c.log_density, 0.0)
    y = np.exp(c.y + shift) * 60.0 ** POWER_OF_SPEED.get(c.channel, 0.0)
    label, scaled = _axis(change, c)
    x = scaled(c.x[:, _along(c)])
    for side, colour, mark, name in ((False, _A, "o", "A"), (True, _B, "s", "B")):
        own = c.second == side
        name += _range(change, c, side)
        axis.plot(x[own], y[own], mark, color=colour, ms=3.5, mfc="none" if side else colour, label=name)
    axis.set_ylabel(_LABEL.get(c.channel, c.channel))
    axis.set_xlabel(label)
    axis.legend(loc="best")
    axis.ticklabel_format(axis="y", style="sci", scilimits=(-2, 4))


def _ratio(axis: Any, change: RunChange, c: MatchedChannel) -> None:
    r = change.ratios[c.channel]
    word = WORD[c.channel].removesuffix(" at equal command")
    (low, high), (slow, fast) = c.common(), c.common_advance()
    if r.extrapolated and slow > fast:
        axis.set_axis_off()
        told = f"{word}: no ratio B / A, since A and B have\nno {_advance(change)[0].partition(' [')[0]} in common"
        axis.text(0.5, 0.5, told, ha="center", va="center", transform=axis.transAxes)
        return
    curve = np.array(r.curve) * np.array([1.0, 1.0, *[r.density_ratio] * 3])
    label, scaled = _axis(change, c)
    curve = curve[np.argsort(curve[:, _along(c)], kind="stable")]
    shared = (curve[:, 1] >= slow) & (curve[:, 1] <= fast)
    if _along(c) and shared.sum() > 1:
        curve = curve[shared]
    x = scaled(curve[:, _along(c)])
    axis.fill_between(x, curve[:, 3], curve[:, 4], color=_BAND, alpha=0.3, lw=0.0, label="95 %")
    axis.plot(x, curve[:, 2], color=_A, label="B over A")
    axis.axhline(1.0, color=_GREY, lw=0.8)
    if r.density_ratio != 1.0:
        axis.axhline(r.density_ratio, color=_B, lw=1.0, ls="--", label="recorded density")
    if c.name not in _OVER_COMMAND:
        both = f"equal speed and {_advance(change)[0].partition(' [')[0]}" if c.advance_moves() else "equal speed"
        far = low > high + _STEADY
        axis.set_title("no common speed: extrapolated" if far else f"at {both}")
    axis.set_ylabel(f"{word}: B / A")
    axis.set_xlabel(label)
    axis.legend(loc="best")
