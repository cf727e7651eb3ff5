"""The first picture wherever a recording meets a model: the recorded points inside the prediction band of the case.

The band is the 95 % interval of :mod:`bemt.rotors.case.propagate` (declared unknowns, the model's own error on real
rotors, numerics). Every point is judged at its own speed, airspeed and density; the drawn band runs along one line of
them.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base import canvas
from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.judge.compare.change_document import ComparedRuns, headline
from bemt.judge.compare.matched import OVER_COMMAND, POWER_OF_SPEED, WITHOUT_SPEED, MatchedChannel
from bemt.judge.compare.recordings import RunChange
from bemt.judge.compare.sentences import WORD
from bemt.physics.dataset import Dataset
from bemt.rotors.case import Case
from bemt.rotors.case.propagate import propagate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LABEL = {
    "thrust_N": "thrust [N]", "torque_Nm": "torque [N m]", "CT": "$C_T$ = T/($\\rho n^2 D^4$) [1]",
    "CP": "$C_P$ = P/($\\rho n^3 D^5$) [1]", "rpm": "speed of rotation [rev/min]", "J": "advance ratio J = V/(n D) [1]",
}  # fmt: skip
_WORD = {"thrust_N": "thrust", "torque_Nm": "torque", "CT": "thrust", "CP": "torque"}
_COEFFICIENT = {"thrust_N": "CT", "torque_Nm": "CP"}
_GRID = 41  # points of the drawn band
_MOVES = 0.02  # change of J over a recording from which it is drawn over J
_ONE_SPEED = 0.03  # share by which speeds differ that are drawn as one
_AROUND = 0.1  # share of its speed by which the band reaches beyond a single point
_WIDE, _NOTES_WIDE, _KEY_WIDE = 60, 80, 28  # characters in a line above the picture, below it, and of a key
_MARKS = (("o", canvas.BLACK), ("s", canvas.RED), ("^", canvas.GREEN), ("D", canvas.PURPLE))


@dataclass(frozen=True, eq=False)
class PredictionView:
    """Recordings beside the prediction of a case."""

    case: str
    over: str  # ``rpm``, or ``J`` where the advance ratio moves
    channels: tuple[str, ...]  # What is drawn: thrust_N, torque_Nm; CT, CP over J
    recorded: tuple[Dataset, ...]  # The points, with x, value and u under the names of the axes
    model: tuple[Dataset, ...]  # The prediction at the same points; u is half the 95 % width
    curve: Dataset  # The prediction along the drawn line; u is half the 95 % width
    notes: tuple[str, ...]  # What the picture leaves out or simplifies

    def inside(self, channel: str) -> tuple[int, int, float]:
        """Points inside the band, points judged, and the median of recorded over predicted, less 1 [1]."""
        y, f, half = (
            np.concatenate([part[channel] if key else part.u[channel] for part in parts if channel in part])
            for parts, key in ((self.recorded, True), (self._beside(channel), True), (self._beside(channel), False))
        )
        good = np.isfinite(y + f + half)
        ratio = y[good & (f != 0.0)] / f[good & (f != 0.0)]
        median = float(np.median(ratio)) - 1.0 if ratio.size else float("nan")
        return int(np.sum(np.abs(y - f)[good] <= half[good])), int(good.sum()), median

    def width(self, channel: str) -> float:
        """Half the 95 % band at the points, median, over the prediction there [1]."""
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = np.concatenate([np.abs(m.u[channel] / m[channel]) for m in self._beside(channel)])
        return float(np.median(shares[np.isfinite(shares)])) if np.isfinite(shares).any() else float("nan")

    def _beside(self, channel: str) -> list[Dataset]:
        return [m for r, m in zip(self.recorded, self.model, strict=True) if channel in r]

    @property
    def sentence(self) -> str:
        """What the picture shows, in one sentence."""
        found = [(_WORD[c], *self.inside(c)) for c in self.channels]
        found = [f for f in found if f[2]]
        if not found:
            return f"{self.case}: the model gives no result at these points."
        counts = " and ".join(f"{n} of {total} {word}" for word, n, total, _ in found)
        shares = [round(100.0 * m) for *_, m in found if np.isfinite(m)]
        middle = " and ".join(f"{m:+d} %" if m else "0 %" for m in shares).replace("-", "\N{MINUS SIGN}")
        tail = f"; in the median they are {middle} from the model" if middle else ""
        return f"{counts} readings lie inside the 95 % band of {self.case}{tail}."

    def document(self) -> Mapping[str, object]:
        """Give the sentence and the counts as plain values."""
        told = {c: dict(zip(("inside", "readings", "median_change"), self.inside(c), strict=True))
                for c in self.channels}  # fmt: skip
        return {"case": self.case, "over": self.over, "sentence": self.sentence, "channels": told,
                "notes": list(self.notes)}  # fmt: skip

    def png(self) -> bytes:
        """The picture as PNG."""
        return self.picture("png")

    def picture(self, kind: str) -> bytes:
        """Draw it, png, pdf or svg."""
        import matplotlib

        with matplotlib.rc_context(canvas.STYLE):
            return canvas.drawn(self.figure(), kind, canvas.DPI)

    def figure(self) -> Figure:
        """One panel a channel, one above the other, legible at the width of a telephone."""
        import matplotlib

        with matplotlib.rc_context(canvas.STYLE):
            figure, axes = canvas.blank(0.8 + 2.1 * len(self.channels), len(self.channels), 1, sharex=True)
            figure.set_figwidth(4.4)
            for axis, channel in zip(axes[:, 0], self.channels, strict=True):
                self._panel(axis, channel)
            axes[-1, 0].set_xlabel(LABEL[self.over])
            axes[-1, 0].locator_params(axis="x", nbins=6)
            handles, labels = axes[0, 0].get_legend_handles_labels()
            notes = "\n".join(line for note in self.notes[:2] for line in textwrap.wrap(note, _NOTES_WIDE))
            figure.legend(handles, labels, loc="outside lower center", ncols=2, title=notes, title_fontsize=7)
            figure.suptitle(self._title(), fontsize=9)
            return figure

    def _title(self) -> str:
        """The case, and what of the readings lies in its band, a line each."""
        found = [(_WORD[c], *self.inside(c)[:2]) for c in self.channels]
        counts = ", ".join(f"{n} of {total} {word}" for word, n, total in found if total)
        told = f"readings in the 95 % band: {counts}" if counts else "the model gives no result at these points"
        return "\n".join([*textwrap.wrap(self.case, _WIDE), told])

    def _marked(self) -> Iterator[tuple[Dataset, Array, str]]:
        """Points that share a mark, and their name: of a recording with both, those at rest and those in the stream."""
        for part in self.recorded:
            still = part["J"] == 0.0
            both = bool(still.any() and not still.all())
            for rows, where in ((still, ", static"), (~still, ", V > 0")):
                if rows.any():
                    yield part, rows, part.name + (where if both else "")

    def _panel(self, axis: Any, channel: str) -> None:
        x, y, half = self.curve[self.over], self.curve[channel], self.curve.u[channel]
        axis.fill_between(x, y - half, y + half, color=canvas.SKY, alpha=0.35, linewidth=0, label="BEMT, 95 % band")
        axis.plot(x, y, color=canvas.BLUE, label="BEMT")
        for k, (part, rows, name) in enumerate(self._marked()):
            if channel not in part:
                continue
            mark, colour = _MARKS[k % len(_MARKS)]
            u = np.nan_to_num(part.u[channel][rows])
            axis.errorbar(part[self.over][rows], part[channel][rows], u if np.any(u > 0.0) else None, fmt=mark,
                          color=colour, markersize=4, elinewidth=0.8, markerfacecolor="none" if k else colour,
                          zorder=3, label="\n".join(textwrap.wrap(name, _KEY_WIDE)))  # fmt: skip
        axis.set_ylabel(LABEL[channel])
        axis.margins(x=0.04)
        if self.over == "rpm":
            axis.set_ylim(bottom=min(0.0, axis.get_ylim()[0]))


def against_band(case: Case, recordings: Sequence[Dataset]) -> PredictionView:
    """Put recordings inside the prediction band of a case; refused where no point has a speed and a load.

    Each has ``rpm``, ``airspeed_m_s``, ``density_kg_m3`` and ``thrust_N`` or ``torque_Nm``; their u is drawn as bars.
    """
    parts = list(filter(len, map(_usable, recordings)))
    if not parts:
        raise InputError(Fault(case.name, "recording", "no point with a speed and a load", "one or more"))
    D = case.diameter_m
    rpm, V, rho = (np.concatenate([d[k] for d in parts]) for k in ("rpm", "airspeed_m_s", "density_kg_m3"))
    J = V / (rpm / 60.0 * D)
    over = "J" if np.ptp(J) > _MOVES else "rpm"
    line, notes = _line(over, rpm, V, rho, D)
    count = line[0].size
    solved = propagate(case, *(np.concatenate([a, b]) for a, b in zip(line, (rpm, V, rho), strict=True)))
    loads = [c for c in _COEFFICIENT if any(c in d for d in parts)]
    half = {c: solved.half_width95(c) for c in loads}
    lost = int(np.sum(~np.isfinite(solved.points[loads[0]][count:])))
    if lost:
        notes.append(f"BEMT gives no result at {lost} of {rpm.size} points.")

    def shown(name: str, at: tuple[Array, ...], values: dict[str, Array], u: dict[str, Array]) -> Dataset:
        n = at[0] / 60.0
        unit = {"thrust_N": at[2] * n**2 * D**4, "torque_Nm": at[2] * n**2 * D**5 / (2.0 * np.pi)}
        if over == "J":
            values, u = ({_COEFFICIENT[c]: v / unit[c] for c, v in some.items()} for some in (values, u))
        return Dataset("points", name, {"rpm": at[0], "J": at[1] / (n * D), **values}, u)

    def predicted(rows: slice, at: tuple[Array, ...]) -> Dataset:
        return shown(case.name, at, {c: solved.points[c][rows] for c in loads}, {c: half[c][rows] for c in loads})

    recorded, model, start = [], [], count
    for d in parts:
        at = (d.rpm, d.airspeed_m_s, d.density_kg_m3)
        own = [c for c in loads if c in d]
        recorded.append(shown(d.name, at, {c: d[c] for c in own}, {c: d.u[c] for c in own}))
        model.append(predicted(slice(start, start + len(d)), at))
        start += len(d)
    channels = tuple(_COEFFICIENT[c] if over == "J" else c for c in loads)
    return PredictionView(case.name, over, channels, tuple(recorded), tuple(model), predicted(slice(count), line),
                          tuple(notes))  # fmt: skip


def _usable(d: Dataset) -> Dataset:
    """Points that have a speed, an airspeed, a density and a load."""
    loads = [c for c in _COEFFICIENT if c in d and np.isfinite(d[c]).any()]
    if not loads:
        return Dataset("points", d.name, {"rpm": np.zeros(0)}, {})
    keys = ("rpm", "airspeed_m_s", "density_kg_m3")
    keep = np.all([np.isfinite(d[k]) for k in keys], axis=0) & (d.rpm > 0.0)
    keep &= np.any([np.isfinite(d[c]) for c in loads], axis=0)
    return Dataset("points", d.name, {k: d[k][keep] for k in (*keys, *loads)}, {c: d.u[c][keep] for c in loads})


def _line(over: str, rpm: Array, V: Array, rho: Array, D: float) -> tuple[tuple[Array, ...], list[str]]:
    """Speeds, airspeeds and densities along which the band is drawn, and what that leaves out."""
    J, notes = V / (rpm / 60.0 * D), []
    middle = float(np.median(rho))
    if over == "rpm":
        low, high = float(rpm.min()), float(rpm.max())
        if high - low <= _ONE_SPEED * high:
            low, high = (1.0 - _AROUND) * low, (1.0 + _AROUND) * high
        speed = np.linspace(low, high, _GRID)
        if np.ptp(rho) > 0.02 * middle:
            notes.append(f"Band drawn at {middle:.3f} kg/m³; each point is judged at its own density.")
        return (speed, float(np.median(J)) * speed / 60.0 * D, np.full(_GRID, middle)), notes
    at = np.linspace(float(J.min()), float(J.max()), _GRID)
    order = np.argsort(J, kind="stable")
    step = np.diff(rpm[order])
    if np.ptp(rpm) > _ONE_SPEED * rpm.max() and (np.all(step <= 0.0) or np.all(step >= 0.0)):
        speed = np.interp(at, J[order], rpm[order])
    else:
        speed = np.full(_GRID, float(np.median(rpm)))
        if np.ptp(rpm) > _ONE_SPEED * rpm.max():
            notes.append(f"Band drawn at {speed[0]:.0f} rev/min; each point is judged at its own speed.")
    return (speed, at * speed / 60.0 * D, np.full(_GRID, middle)), notes


# One picture of two recordings: the loads over speed or advance ratio, and what lies between them.
_A, _B, _BAND, _GREY = canvas.BLUE, canvas.RED, canvas.SKY, canvas.GREY
_AXIS = {
    "thrust_N": "thrust / n² [N s²]", "torque_Nm": "torque / n² [N m s²]", "power_W": "shaft power / n³ [W s³]",
    "electrical_power_W": "electrical power / n³ [W s³]", "rpm": "speed of rotation [rev/min]",
    "voltage_V": "voltage [V]",
}  # fmt: skip
_COMMAND = {"pwm_s": ("pulse width [µs]", 1e6), "throttle": ("throttle [%]", 100.0)}
# Speeds that vary by less than this share are one.
_STEADY = 0.05
# Intervals of the abscissa at most: labels of five digits stay apart.
_TICKS = 6
# Characters in a line of the title.
_TITLE_WIDE = 110


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

    >>> from bemt.judge.compare.change_document import Densities
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
    return "\n".join(part for line in (*lines, headline(doc)) for part in textwrap.wrap(line, _TITLE_WIDE))


def _along(c: MatchedChannel) -> int:
    """Coordinate of the abscissa: the advance ratio where it varies."""
    return int(c.name not in OVER_COMMAND and float(np.ptp(c.x[:, 1])) > _MOVES)


def _axis(change: RunChange, c: MatchedChannel) -> tuple[str, Callable[[Array], Array]]:
    """Label of the abscissa, and the coordinate in its unit."""
    if _along(c):
        return _advance(change)[0], lambda x: x
    if c.name in OVER_COMMAND:
        both = change.a.by_throttle and change.b.by_throttle
        label, factor = _COMMAND["throttle" if both else change.a.command]
        return label, lambda x: x * factor
    return "electrical power [W]" if c.name == "at_power" else _AXIS["rpm"], np.exp


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
    bare = c.name in WITHOUT_SPEED
    y = np.exp(c.y + shift) * (1.0 if bare else 60.0 ** POWER_OF_SPEED.get(c.channel, 0.0))
    label, scaled = _axis(change, c)
    x = scaled(c.x[:, _along(c)])
    for side, colour, mark, name in ((False, _A, "o", "A"), (True, _B, "s", "B")):
        own = c.second == side
        name += _range(change, c, side)
        axis.plot(x[own], y[own], mark, color=colour, ms=3.5, mfc="none" if side else colour, label=name)
    own_label = "thrust / P^(2/3) [N W^(-2/3)]" if c.name == "at_power" else "thrust [N]"
    axis.set_ylabel(own_label if bare else _AXIS.get(c.channel, c.channel))
    axis.set_xlabel(label)
    axis.legend(loc="best")
    axis.locator_params(axis="x", nbins=_TICKS)
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
    if c.name not in OVER_COMMAND:
        along = f" and {_advance(change)[0].partition(' [')[0]}" if c.advance_moves() else ""
        both = f"equal {WITHOUT_SPEED.get(c.name, 'speed')}{along}"
        far = low > high + _STEADY
        axis.set_title("no common speed: extrapolated" if far else f"at {both}")
    axis.set_ylabel(f"{word}: B / A")
    axis.set_xlabel(label)
    axis.legend(loc="best")
    axis.locator_params(axis="x", nbins=_TICKS)
