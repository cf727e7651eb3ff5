"""The first picture wherever a recording meets a model: the recorded points inside the prediction band of the case.

The band is the 95 % interval of :mod:`bemt.rotors.case.propagate` (declared unknowns, the model's own error on real
rotors, numerics). Every point is judged at its own speed, airspeed and density; the drawn band runs along one line of
them.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bemt.base import canvas
from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.physics.dataset import Dataset
from bemt.rotors.case import Case
from bemt.rotors.case.propagate import propagate

_LABEL = {
    "thrust_N": "thrust [N]", "torque_Nm": "torque [N m]", "CT": "$C_T$ = T/($\\rho n^2 D^4$) [1]",
    "CP": "$C_P$ = P/($\\rho n^3 D^5$) [1]", "rpm": "speed of rotation [rev/min]", "J": "advance ratio J = V/(n D) [1]",
}  # fmt: skip
_WORD = {"thrust_N": "thrust", "torque_Nm": "torque", "CT": "thrust", "CP": "torque"}
_COEFFICIENT = {"thrust_N": "CT", "torque_Nm": "CP"}
_GRID = 41  # points of the drawn band
_MOVES = 0.02  # change of J over a recording from which it is drawn over J
_ONE_SPEED = 0.03  # share by which speeds differ that are drawn as one
_AROUND = 0.1  # share of its speed by which the band reaches beyond a single point
_WIDE = 60  # characters in a line above the picture
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
        middle = " and ".join(f"{100.0 * m:+.0f} %" for *_, m in found if np.isfinite(m)).replace("-", "\N{MINUS SIGN}")
        tail = f"; in the median they are {middle} from the model" if middle else ""
        return f"{counts} readings lie inside the 95 % band of {self.case}{tail}."

    def document(self) -> dict[str, Any]:
        """Give the sentence and the counts as plain values."""
        told = {c: dict(zip(("inside", "readings", "median_change"), self.inside(c), strict=True))
                for c in self.channels}  # fmt: skip
        return {"case": self.case, "over": self.over, "sentence": self.sentence, "channels": told,
                "notes": list(self.notes)}  # fmt: skip

    def png(self) -> bytes:
        """Draw it: one panel a channel, one above the other, legible at the width of a telephone."""
        import matplotlib

        with matplotlib.rc_context(canvas.STYLE):
            figure, axes = canvas.blank(0.8 + 2.1 * len(self.channels), len(self.channels), 1, sharex=True)
            figure.set_figwidth(4.4)
            for axis, channel in zip(axes[:, 0], self.channels, strict=True):
                self._panel(axis, channel)
            axes[-1, 0].set_xlabel(_LABEL[self.over])
            axes[-1, 0].locator_params(axis="x", nbins=6)
            handles, labels = axes[0, 0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside lower center", ncols=2)
            words = (self.sentence.replace(" %", "\N{NO-BREAK SPACE}%"), *self.notes[:2])
            figure.suptitle("\n".join(line for w in words for line in textwrap.wrap(w, _WIDE)), fontsize=9)
            return canvas.png(figure, canvas.DPI)

    def _panel(self, axis: Any, channel: str) -> None:
        x, y, half = self.curve[self.over], self.curve[channel], self.curve.u[channel]
        axis.fill_between(x, y - half, y + half, color=canvas.SKY, alpha=0.35, linewidth=0, label="BEMT, 95 % band")
        axis.plot(x, y, color=canvas.BLUE, label="BEMT")
        for k, part in enumerate(self.recorded):
            if channel not in part:
                continue
            mark, colour = _MARKS[k % len(_MARKS)]
            u = np.nan_to_num(part.u[channel])
            axis.errorbar(part[self.over], part[channel], u if np.any(u > 0.0) else None, fmt=mark, color=colour,
                          markersize=4, elinewidth=0.8, markerfacecolor="none" if k else colour, zorder=3,
                          label=part.name[:28])  # fmt: skip
        axis.set_ylabel(_LABEL[channel])
        axis.margins(x=0.04)
        if self.over == "rpm":
            axis.set_ylim(bottom=min(0.0, axis.get_ylim()[0]))


def against_band(case: Case, recordings: Sequence[Dataset]) -> PredictionView:
    """Put recordings inside the prediction band of a case; refused where no point has a speed and a load.

    Each has ``rpm``, ``airspeed_m_s``, ``density_kg_m3`` and ``thrust_N`` or ``torque_Nm``; their u is drawn as bars.
    """
    parts = [_usable(d) for d in recordings]
    parts = [d for d in parts if len(d)]
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
        name_of = {c: _COEFFICIENT[c] if over == "J" else c for c in values}
        scale = {c: unit[c] if over == "J" else np.ones_like(n) for c in values}
        drawn = {name_of[c]: v / scale[c] for c, v in values.items()}
        band = {name_of[c]: v / scale[c] for c, v in u.items()}
        return Dataset("points", name, {"rpm": at[0], "J": at[1] / (n * D), **drawn}, band)

    def predicted(name: str, rows: slice, at: tuple[Array, ...]) -> Dataset:
        return shown(name, at, {c: solved.points[c][rows] for c in loads}, {c: half[c][rows] for c in loads})

    recorded, model, start = [], [], count
    for d in parts:
        at = (d["rpm"], d["airspeed_m_s"], d["density_kg_m3"])
        own = [c for c in loads if c in d]
        recorded.append(shown(d.name, at, {c: d[c] for c in own}, {c: d.u[c] for c in own}))
        model.append(predicted(case.name, slice(start, start + len(d)), at))
        start += len(d)
    channels = tuple(_COEFFICIENT[c] if over == "J" else c for c in loads)
    curve = predicted(case.name, slice(count), line)
    return PredictionView(case.name, over, channels, tuple(recorded), tuple(model), curve, tuple(notes))


def _usable(d: Dataset) -> Dataset:
    """Points that have a speed, an airspeed, a density and a load."""
    loads = [c for c in _COEFFICIENT if c in d and np.isfinite(d[c]).any()]
    if not loads:
        return Dataset("points", d.name, {"rpm": np.zeros(0)}, {})
    keys = ("rpm", "airspeed_m_s", "density_kg_m3")
    keep = np.all([np.isfinite(d[k]) for k in keys], axis=0) & (d["rpm"] > 0.0)
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
