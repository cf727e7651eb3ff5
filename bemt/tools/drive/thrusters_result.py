"""Share force and roll moment among the thrusters of a body."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

from bemt.base.errors import Fault, InputError
from bemt.base.tables import csv_text, json_text, number_text, text_table, write_atomic
from bemt.base.toml import Axis, Span, Table, axis_values, entry, read_model
from bemt.tools.drive import outputs, picture
from bemt.tools.drive.thrusters import Allocation, Thruster, allocate, attainable, moment_at

KGF = 9.80665
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
    if wrong:
        raise InputError(wrong)
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
        "schema": "bemt.thrusters.result/1",
        "body": file.body.name,
        "thrusters": [vars(t) for t in thrusters],
        "command": {"force_N": force, "moment_Nm": moment, "priority": priority},
        "allocation": {f.name: getattr(got, f.name) for f in dataclasses.fields(Allocation)},
        "attainable": corners,
        "mounting": rows,
    }
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
        total, weight = sum(t.thrust_max_N * math.cos(t.cant_rad) for t in thrusters), body.mass_kg * KGF
        lines.append(f"total {total:.1f} N for a weight of {weight:.1f} N: {total / weight:.2f}")
    cells = [[number_text(v) for v in r.values()] for r in rows]
    lines.append(text_table(["distance [m]", "one thruster [N m]", "[kgf m]", "at the force [N m]"], cells, left=()))
    return "\n".join(lines)


def _picture(name: str, most: float, force: float, distance: Any, corners: Any, got: Allocation) -> bytes:
    series = [(f"one thruster alone, {most:g} N", distance, moment_at(distance, most), "-")]
    if force > 0.0:
        series.append((f"pair that gives {force:g} N", distance, moment_at(distance, most, force), "--"))
    return picture.curves([
        {"x": "mounting distance [m]", "y": "roll moment [N m]", "series": series},
        {"x": "force [N]", "y": "roll moment [N m]", "series": [
            ("attainable", corners[:, 0], corners[:, 1], "-"),
            ("wanted", [got.wanted_force_N], [got.wanted_moment_Nm], "x"),
            ("given", [got.force_N], [got.moment_Nm], "o")]},
    ], name)  # fmt: skip
