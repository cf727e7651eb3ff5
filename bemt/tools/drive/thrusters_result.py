"""Share force and roll moment among the thrusters of a body.

Axes: x forward, y to the left, z up, origin in the centre of mass. A thruster at (y, z), canted by gamma from the
vertical to the left, gives

    F_z = T cos(gamma),   M_x = T (y cos(gamma) - z sin(gamma)),   T_min <= T <= T_max.

Within the limits the thrusts of least sum of squares are taken. Beyond them, what has priority is met first, as
nearly as the limits allow, and then the other one.

References
----------
T. A. Johansen, T. I. Fossen, "Control allocation - a survey", Automatica 49 (2013) 1087-1103,
doi:10.1016/j.automatica.2013.01.035 (constrained allocation with priorities; not checked against the paper).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, refuse
from bemt.base.tables import csv_text, json_text, number_text, text_table, write_atomic
from bemt.base.toml import Axis, Span, Table, axis_values, entry, read_model
from bemt.base.units import G0, KGF
from bemt.tools.drive import outputs


@dataclass(frozen=True)
class Thruster:
    """One thruster."""

    y_m: float  # Position, to the left [m]
    # Limits [N]
    thrust_max_N: float
    thrust_min_N: float = 0.0
    z_m: float = 0.0  # Position, up [m]
    cant_rad: float = 0.0  # Tilt of the thrust from the vertical to the left [rad]
    name: str = ""  # Of the thruster


@dataclass(frozen=True)
class Allocation:
    """Thrusts for a command."""

    thrust_N: Array  # (N,) of each thruster. [N]
    # what they give together. [N], [N m]
    force_N: float
    moment_Nm: float
    # the command. [N], [N m]
    wanted_force_N: float
    wanted_moment_Nm: float
    saturated: NDArray[np.bool_]  # (N,) at a limit
    met: bool  # whether the command is met within 1e-6 of the greatest force and moment


def effectiveness(thrusters: Sequence[Thruster]) -> Array:
    """Force and moment per thrust."""
    c = np.cos([t.cant_rad for t in thrusters])
    s = np.sin([t.cant_rad for t in thrusters])
    y, z = np.array([t.y_m for t in thrusters]), np.array([t.z_m for t in thrusters])
    return np.vstack([c, y * c - z * s])


def allocate(thrusters: Sequence[Thruster], force_N: float, moment_Nm: float, priority: str = "moment") -> Allocation:
    """Share a command among thrusters.

    >>> pair = [Thruster(0.2, 27.0), Thruster(-0.2, 27.0)]
    >>> got = allocate(pair, 27.0, 5.4)
    >>> got.thrust_N.round(6), got.met
    (array([27.,  0.]), True)
    """
    from scipy.optimize import linprog, lsq_linear

    faults = [] if thrusters else [Fault("", "thrusters", "none", "one or more")]
    faults += [
        Fault("", t.name or f"thruster {i + 1}", f"{t.thrust_min_N:g} to {t.thrust_max_N:g} N", "min below max")
        for i, t in enumerate(thrusters)
        if not t.thrust_min_N < t.thrust_max_N
    ]
    wishes = {"force_N": force_N, "moment_Nm": moment_Nm}
    faults += [Fault("", name, f"{v}", "a finite number") for name, v in wishes.items() if not math.isfinite(v)]
    if priority not in ("moment", "force"):
        faults.append(Fault("", "priority", repr(priority), "moment or force"))
    refuse(faults)
    b = effectiveness(thrusters)
    low, high = np.array([t.thrust_min_N for t in thrusters]), np.array([t.thrust_max_N for t in thrusters])
    most = np.maximum(np.abs(low), np.abs(high))
    low = np.where(np.abs(low) < 1e-12 * most, 0.0, low)
    limit = np.abs(b) @ most  # greatest force and moment
    none = limit < 1e-9 * most.sum()  # arms that are rounding: the solver must not see them
    b[none], limit[none] = 0.0, 1e-2 * most.sum()
    b, wanted = b / limit[:, None], np.array([force_N, moment_Nm]) / limit
    bounds = list(zip(low, high, strict=True))

    def nearest(row: int, fixed: list[tuple[int, float]]) -> float:
        """Attainable value of one row that is nearest to the wanted one."""
        a_eq, b_eq = np.array([b[i] for i, _ in fixed]), np.array([v for _, v in fixed])
        ends = []
        for sign in (1.0, -1.0):
            extra = {"A_eq": a_eq, "b_eq": b_eq} if fixed else {}
            end = linprog(sign * b[row], bounds=bounds, **extra)
            if not end.success:  # the row before lies on the edge of what is attainable: its own rounding
                extra = {"A_ub": np.vstack([a_eq, -a_eq]), "b_ub": np.concatenate([b_eq, -b_eq]) + 1e-7}
                end = linprog(sign * b[row], bounds=bounds, **extra)
            ends.append(float(b[row] @ end.x))
        return float(np.clip(wanted[row], min(ends), max(ends)))

    first, second = (1, 0) if priority == "moment" else (0, 1)
    given = {first: nearest(first, [])}
    given[second] = nearest(second, [(first, given[first])])
    goal = np.array([given[0], given[1]])
    size = float(np.max(high - low))
    matrix = np.vstack([1e5 * b, np.eye(len(low)) / size])
    found = lsq_linear(matrix, np.concatenate([1e5 * goal, np.zeros(len(low))]), bounds=(low, high), method="bvls")
    thrust = np.clip(found.x, low, high)
    force, moment = effectiveness(thrusters) @ thrust
    near = 1e-6 * (high - low)
    met = bool(np.all(np.abs(b @ thrust - wanted) <= 1e-6))
    return Allocation(thrust, float(force), float(moment), force_N, moment_Nm,
                      (thrust <= low + near) & (low != 0.0) | (thrust >= high - near), met)  # fmt: skip


def attainable(thrusters: Sequence[Thruster]) -> Array:
    """Corner points of what force and moment can be together, (M, 2)."""
    b = effectiveness(thrusters)
    at = b @ np.array([t.thrust_min_N for t in thrusters])
    # a zonogon: its edges are the thrusters' vectors, sorted by angle, once forward and once back
    edges = (b * np.array([t.thrust_max_N - t.thrust_min_N for t in thrusters])).T
    down = (edges[:, 1] < 0.0) | ((edges[:, 1] == 0.0) & (edges[:, 0] < 0.0))
    start = at + edges[down].sum(axis=0)
    up = np.where(down[:, None], -edges, edges)
    up = up[np.argsort(np.arctan2(up[:, 1], up[:, 0]), kind="stable")]
    return np.vstack([start, start + np.cumsum(np.vstack([up, -up]), axis=0)])


def moment_at(distance_m: ArrayLike, thrust_N: float, total_force_N: float | None = None) -> Array:
    """Roll moment of a pair of thrusters over the distance at which they are mounted, (N,) [N m].

    >>> round(float(moment_at(0.2, 27.0)), 6), round(float(moment_at(0.2, 27.0, 40.0)), 6)
    (5.4, 2.8)
    """
    difference = thrust_N if total_force_N is None else min(total_force_N, 2.0 * thrust_N - total_force_N)
    return np.asarray(distance_m, dtype=float) * (difference if difference >= 0.0 else math.nan)


RESULTS = ("thrusters.json", "mounting.csv", "thrusters.png")
MOST = 1e6
"""Largest wanted force [N] and moment [N m]."""


class BodyTable(Table):
    """[body]: the vehicle that carries the thrusters."""

    name: str = entry("name of the body", required=True)
    mass_kg: float | None = entry("mass of the body", "kg", 0.001, 1e6)


class ThrusterTable(Table):
    """[[thruster]]: position and limits of one thruster; x forward, y left, z up from the centre of mass."""

    name: str = entry("name of the thruster", default="")
    y_m: float = entry("position, positive to the left", "m", -50.0, 50.0, required=True)
    z_m: float = entry("up", "m", -50.0, 50.0, default=0.0)
    thrust_max_N: float = entry("upper limit", "N", 1e-3, 1e6, required=True)
    thrust_min_N: float = entry("lower limit", "N", -1e6, 1e6, default=0.0)
    cant_deg: float = entry("tilt from the vertical to the left", "deg", -180.0, 180.0, default=0.0)

    def rules(self) -> Iterable[tuple[str, ...]]:
        """Limits in order."""
        if self.thrust_min_N >= self.thrust_max_N:
            yield "thrust_min_N", f"{self.thrust_min_N:g}", "less than thrust_max_N"


class CommandTable(Table):
    """[command]: requested force and moment."""

    force_N: float = entry("force upwards", "N", -MOST, MOST, required=True)
    moment_Nm: float = entry("roll moment", "N m", -MOST, MOST, required=True)
    priority: Literal["moment", "force"] = entry("what has priority beyond the limits", default="moment")


class MountingTable(Table):
    """[mounting]: mounting distances of a pair to compare."""

    distance_m: Axis = entry("distance from the centre", "m", 0.0, 50.0, required=True)


class ThrustersFile(Table):
    """thrusters.toml: a body, its thrusters, what is wanted of them."""

    schema_: Literal["bemt.thrusters/1"] = entry("version of the format", required=True, alias="schema")
    body: BodyTable
    thruster: tuple[ThrusterTable, ...]
    command: CommandTable = CommandTable(force_N=0.0, moment_Nm=0.0)
    mounting: MountingTable = MountingTable(distance_m=Span(start=0.05, stop=0.4, num=8))

    def rules(self) -> Iterable[tuple[str, ...]]:
        """One thruster or more."""
        if not self.thruster:
            yield "thruster", "a list of 0", "one or more tables [[thruster]]"


def share(
    path: str, wanted_N: float | None = None, wanted_Nm: float | None = None, out: str | None = None
) -> tuple[dict[str, Any], str, bool]:
    """Allocate what is wanted (by the file, unless said): ``bemt.thrusters.result/1``, its text, whether it is met."""
    wrong = [
        Fault("", option, f"{value:g}", f"a number from {-MOST:g} to {MOST:g} {unit}")
        for option, value, unit in (("--force-N", wanted_N, "N"), ("--moment-Nm", wanted_Nm, "N m"))
        if value is not None and not -MOST <= value <= MOST
    ]
    try:
        file = read_model(ThrustersFile, _toml(Path(path)))
    except InputError as error:
        raise InputError([*wrong, *error.faults]) from None
    refuse(wrong)
    thrusters = [
        Thruster(t.y_m, t.thrust_max_N, t.thrust_min_N, t.z_m, math.radians(t.cant_deg), t.name or f"thruster {i + 1}")
        for i, t in enumerate(file.thruster)
    ]
    force = file.command.force_N if wanted_N is None else wanted_N
    moment = file.command.moment_Nm if wanted_Nm is None else wanted_Nm
    priority = file.command.priority
    got = allocate(thrusters, force, moment, priority)
    corners = attainable(thrusters)
    most = max(t.thrust_max_N for t in thrusters)
    assert file.mounting.distance_m is not None
    distance = axis_values(file.mounting.distance_m)
    rows = [
        {
            "distance_m": float(d),
            "moment_one_Nm": float(moment_at(d, most)),
            "moment_one_kgf_m": float(moment_at(d, most)) / KGF,
            "moment_at_force_Nm": float(moment_at(d, most, force)) if force > 0.0 else math.nan,
        }
        for d in distance
    ]
    document = {
        "schema": "bemt.thrusters.result/1", "body": file.body.name, "thrusters": [vars(t) for t in thrusters],
        "command": {"force_N": force, "moment_Nm": moment, "priority": priority},
        "allocation": {f.name: getattr(got, f.name) for f in dataclasses.fields(Allocation)},
        "attainable": corners, "mounting": rows,
    }  # fmt: skip
    if out:
        folder = Path(out)
        outputs.check("--out", folder, RESULTS, [_toml(Path(path))])
        write_atomic(folder / RESULTS[0], json_text(document))
        write_atomic(folder / RESULTS[1], csv_text(list(rows[0]), rows))
        write_atomic(folder / RESULTS[2], _picture(file.body.name, most, force, distance, corners, got))
    return document, _text(file.body, thrusters, got, rows) + "\n", got.met


def _toml(path: Path) -> Path:
    """The file itself, also where its folder is named."""
    return path / "thrusters.toml" if path.is_dir() else path


def _text(body: BodyTable, thrusters: list[Thruster], got: Allocation, rows: list[dict[str, float]]) -> str:
    table = [
        [t.name, number_text(t.y_m), number_text(t.thrust_max_N), number_text(float(v)), "at limit" if s else ""]
        for t, v, s in zip(thrusters, got.thrust_N, got.saturated, strict=True)
    ]
    lines = [body.name, text_table(["thruster", "y [m]", "limit [N]", "thrust [N]", ""], table, left=(0, 4))]
    words = "met" if got.met else "beyond the thrusters"
    lines.append(
        f"requested {got.wanted_force_N:g} N and {got.wanted_moment_Nm:g} N m: {words}; "
        f"given {number_text(got.force_N)} N and {number_text(got.moment_Nm)} N m"
    )
    if body.mass_kg is not None:
        total, weight = sum(t.thrust_max_N * math.cos(t.cant_rad) for t in thrusters), body.mass_kg * G0
        lines.append(f"total {total:.1f} N for a weight of {weight:.1f} N: {total / weight:.2f}")
    cells = [[number_text(v) for v in r.values()] for r in rows]
    lines.append(text_table(["distance [m]", "one thruster [N m]", "[kgf m]", "at the force [N m]"], cells, left=()))
    return "\n".join(lines)


def _picture(name: str, most: float, force: float, distance: Any, corners: Any, got: Allocation) -> bytes:
    series = [(f"one thruster alone, {most:g} N", distance, moment_at(distance, most), "-")]
    if force > 0.0:
        series.append((f"pair that gives {force:g} N", distance, moment_at(distance, most, force), "--"))
    return outputs.curves([
        outputs.Panel("mounting distance [m]", "roll moment [N m]", series),
        outputs.Panel("force [N]", "roll moment [N m]", [
            ("attainable", corners[:, 0], corners[:, 1], "-"),
            ("wanted", [got.wanted_force_N], [got.wanted_moment_Nm], "x"),
            ("given", [got.force_N], [got.moment_Nm], "o")]),
    ], name)  # fmt: skip
