"""Two CFD runs: what differs between their grids, or their loads at one point with both errors.

Another grid alone changes the loads, and one point names no physics: either is said before any cause.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt import __version__
from bemt.base.document import Documented
from bemt.base.errors import InputError
from bemt.base.tables import number_of, number_text, speed_text, text_table
from bemt.data.recordings import cfd_setup
from bemt.data.recordings.cfd_run import is_run
from bemt.data.recordings.channels import named
from bemt.judge.compare.one_run import cfd_points, plus_minus
from bemt.judge.compare.selection import selected
from bemt.physics.dataset import Dataset

_LIKE = 0.01  # speeds, airspeeds and densities that are equal, share
_LOADS = {"thrust_N": "thrust [N]", "torque_Nm": "torque [N m]", "CT": "CT", "CP": "CP", "CQ": "CQ"}


class PairedLoad(Documented):
    """One load of both runs, with standard uncertainties."""

    A: float
    u_A: float
    B: float
    u_B: float
    difference: float
    u_both: float

    @property
    def percent(self) -> str:
        """Difference as a share of A."""
        return f"{self.difference / abs(self.A):+.1%}" if self.A else "-"


class PairedPoint(Documented):
    """Loads at equal speed and airspeed."""

    rpm: float
    airspeed_m_s: float
    density_kg_m3: tuple[float, float]
    loads: Mapping[str, PairedLoad]


class GridRatio(Documented):
    """B over A at equal speed and airspeed."""

    ratio: float
    low: float
    high: float
    pairs: int


class TwoRuns(Documented):
    """``bemt.comparison/1`` with the verdict ``insufficient``: points of two runs, or ratios on two grids."""

    recordings: tuple[str, ...]
    rows: Mapping[str, tuple[str, ...]]
    rule: str
    conditions: Mapping[str, tuple[str, ...]]
    told: tuple[str, ...]
    next: str
    points: tuple[PairedPoint, ...] | None = None
    ratios: Mapping[str, GridRatio] | None = None
    notes: tuple[str, ...] | None = None

    def document(self) -> dict[str, object]:
        """Plain values."""
        own = super().document()
        step = {"next_measurement": {"text": own.pop("next"), "command": ""}}
        return {"schema": "bemt.comparison/1", "version": __version__, "verdict": "insufficient", "effects": [],
                **own, **step}  # fmt: skip

    @property
    def text(self) -> str:
        """The answer in a few lines."""
        lines = _grid_lines(self.ratios) if self.ratios is not None else [f"({self.rule})", "", *self._point_lines()]
        lines[0] = f"verdict: insufficient {lines[0]}".rstrip()
        return "\n".join([*self.told, *lines, f"Next: {self.next}."])

    def _point_lines(self) -> list[str]:
        rows, lines = [], []
        for p in self.points or ():
            head = [speed_text(p.rpm), number_text(p.airspeed_m_s, 4)]
            for name, load in p.loads.items():
                size = abs(load.difference) / load.u_both if load.u_both else math.nan
                both = plus_minus(load.A, load.u_A), plus_minus(load.B, load.u_B)
                rows.append([*head, _LOADS[name], *both, f"{number_text(load.difference, 3)} ({load.percent})",
                             number_text(size, 2)])  # fmt: skip
                head = ["", ""]
        if rows:
            lines.append(text_table(["rev/min", "V [m/s]", "", "A", "B", "B - A", "in u"], rows, (2,), "  "))
            lines += ["  ±: one standard uncertainty of each run; in u: over both together", ""]
        for x, y in (p.density_kg_m3 for p in self.points or ()):
            if abs(y - x) > _LIKE * x:
                lines.append(f"! air: {x:.4g} and {y:.4g} kg/m3, which alone changes the loads by {y / x - 1:+.1%}")
        lines += [f"! {k}: {x} and {y}" for k, (x, y) in self.conditions.items()]
        return lines + [f"! {note}" for note in self.notes or ()]


def _grid_lines(ratios: Mapping[str, GridRatio]) -> list[str]:
    lines = [""]
    for name, r in ratios.items():
        wide = f" ({r.low - 1:+.1%} to {r.high - 1:+.1%})" if r.pairs > 1 else ""
        pairs = f"{number_of(r.pairs, 'pair')} of equal speed and airspeed"
        lines.append(f"  {name.split('_')[0]}: B is {r.ratio - 1:+.1%} of A{wide}, {pairs}")
    return lines if ratios else [*lines, "  no point at equal speed and airspeed"]


def compare_runs(
    a: str, b: str, rows_a: Sequence[str] = (), rows_b: Sequence[str] = (), run: Mapping[str, Any] | None = None
) -> TwoRuns | None:
    """Answer for two CFD recordings on two grids, or of which one has a single speed; None for all others.

    Rows to use are named as ``level=5``; ``run`` is what the user states of the files.
    """
    from bemt.data.recordings.load import one_as_stated

    try:
        first, second = (selected(one_as_stated(p, run or {}), list(rows), p) for p, rows in ((a, rows_a), (b, rows_b)))
        rows = {"A": tuple(rows_a), "B": tuple(rows_b)}
        differ = cfd_setup.conditions_that_differ(first, second)
        if words := cfd_setup.grid_that_differs(first, second):
            told = _told_of_grids(words, differ)
            step = "Compare runs on one grid, or state the u of a grid study"
            return TwoRuns((a, b), rows, words, differ, told, step, ratios=_ratios(named(first), named(second)))
        if Path(a).resolve() == Path(b).resolve() and sorted(rows_a) == sorted(rows_b):
            return None  # refused by the comparison
        if not all(is_run(d) or cfd_setup.conditions_of(d) for d in (first, second)):
            return None
        x, y = (cfd_points(p, d)[0] for p, d in ((a, first), (b, second)))
    except InputError:  # the comparison says it
        return None
    if "rpm" not in x or "rpm" not in y or min(_speeds(x), _speeds(y)) > 1:
        return None
    points = tuple(_point(x, y, i, int(j)) for i in range(len(x)) for j in np.flatnonzero(_like(x, y, i)))
    notes = dict.fromkeys(f"{name}: {note}" for name, d in (("A", x), ("B", y)) for note in d.notes)
    return TwoRuns(
        (a, b), rows, "one speed of rotation cannot tell causes apart",
        {k.replace("_", " "): pair for k, pair in differ.items()}, (_sentence(points, x, y),),
        "Run both at two more speeds or airspeeds: one point fits any cause", points, notes=tuple(notes),
    )  # fmt: skip


def _told_of_grids(words: str, differ: Mapping[str, tuple[str, str]]) -> tuple[str, ...]:
    thrust, torque = (f"{cfd_setup.grid_floor(load, False):.0%}" for load in ("thrust_N", "torque_Nm"))
    also = {k: v for k, v in differ.items() if k not in ("grid_level", "cells")}
    more = "; ".join(f"{k.replace('_', ' ')} {x} and {y}" for k, (x, y) in also.items())
    return (
        f"{words[0].upper()}{words[1:]}. No physics is named before the grid is the same.",
        f"The next grid alone changes thrust by {thrust} and torque by {torque} ({cfd_setup.GRID_FLOOR_SOURCE}).",
        *([f"Also: {more}."] if also else []),
    )


def _speeds(d: Dataset) -> int:
    """Speeds of rotation that differ by more than a per cent."""
    known = np.sort(d.rpm[np.isfinite(d.rpm) & (d.rpm > 0.0)])
    return 0 if not known.size else 1 + int(np.sum(np.diff(np.log(known)) > _LIKE))


def _airspeed(d: Dataset) -> NDArray[np.float64]:
    return np.asarray(np.nan_to_num(d.values.get("airspeed_m_s", np.zeros(len(d)))), dtype=np.float64)


def _like(a: Dataset, b: Dataset, i: int) -> NDArray[np.bool_]:
    """Points of B at speed and airspeed of point i of A."""
    V = float(_airspeed(a)[i])
    near = np.abs(b.rpm - a.rpm[i]) <= _LIKE * a.rpm[i]
    return np.asarray(near & (np.abs(_airspeed(b) - V) <= _LIKE * max(V, 1.0)))


def _ratios(a: Dataset, b: Dataset) -> dict[str, GridRatio]:
    out: dict[str, GridRatio] = {}
    if "rpm" not in a or "rpm" not in b:
        return out
    for name in ("thrust_N", "torque_Nm"):
        if name in a and name in b:
            at = [i for i in range(len(a)) if a[name][i]]
            found = np.array([float(y / a[name][i]) for i in at for y in b[name][_like(a, b, i)]])
            found = found[np.isfinite(found)]
            if found.size:
                out[name] = GridRatio(float(found.mean()), float(found.min()), float(found.max()), found.size)
    return out


def _point(a: Dataset, b: Dataset, i: int, j: int) -> PairedPoint:
    loads = {}
    for name in _LOADS:
        if name not in a or name not in b:
            continue
        x, y, u, w = (float(v) for v in (a[name][i], b[name][j], a.u[name][i], b.u[name][j]))
        if math.isfinite(x) and math.isfinite(y):
            both = math.hypot(u, w) if math.isfinite(u) and math.isfinite(w) else math.nan
            loads[name] = PairedLoad(x, u, y, w, y - x, both)
    rho = [float(d.density_kg_m3[k]) if "density_kg_m3" in d else math.nan for d, k in ((a, i), (b, j))]
    return PairedPoint(float(a.rpm[i]), float(_airspeed(a)[i]), (rho[0], rho[1]), loads)


def _sentence(points: Sequence[PairedPoint], a: Dataset, b: Dataset) -> str:
    loads = next((p.loads for p in points if p.loads), None)
    if loads is None:
        where = [f"{number_text(d.rpm[0], 5)} rev/min at {_airspeed(d)[0]:g} m/s" for d in (a, b)]
        return f"The two runs have no load at equal speed and airspeed: A {where[0]}, B {where[1]}."
    parts = ", ".join(f"{name.split('_')[0]} {load.percent}" for name, load in loads.items())
    sizes = [abs(load.difference) / load.u_both for load in loads.values() if load.u_both > 0.0]
    if not sizes:
        judged = "no run states its error, so nothing says whether that is much"
    elif max(sizes) <= 2.0:
        judged = f"within {'' if max(sizes) <= 1.0 else 'twice '}the errors of both"
    else:
        judged = f"up to {max(sizes):.1f} times the errors of both: the runs differ"
    return f"B against A at one point: {parts}; {judged}."
