"""Share force and roll moment among the thrusters of a body.

::

    schema = "bemt.thrusters/1"

    [body]
    name = "Harpy"
    mass_kg = 6.5

    [[thruster]]
    name = "left"
    y_m = 0.2
    thrust_max_N = 27.0
    # thrust_min_N, z_m, cant_deg

    [command]
    force_N = 40.0
    moment_Nm = 2.0
    priority = "moment"

    [mounting]
    distance_m = { start = 0.05, stop = 0.4, num = 8 }
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.base.tables import csv_text, json_text, number_text, text_table, write_atomic
from bemt.base.toml import Collector, Key, check_table, load_toml
from bemt.drive import outputs, picture
from bemt.drive.thrusters import Allocation, Thruster, allocate, attainable, moment_at

__all__ = ["share"]

KGF = 9.80665
RESULTS = ("thrusters.json", "mounting.csv", "thrusters.png")
MOST = 1e6
"""Largest wanted force [N] and moment [N m]."""
_LENGTH = Key(unit="m", low=-50.0, high=50.0)
TABLES: dict[str, dict[str, Key]] = {
    "": {"schema": Key("choice", choices=("bemt.thrusters/1",), required=True)},
    "body": {"name": Key("text", required=True), "mass_kg": Key(unit="kg", low=0.001, high=1e6)},
    "thruster": {
        "name": Key("text"), "y_m": dataclasses.replace(_LENGTH, required=True), "z_m": _LENGTH,
        "thrust_max_N": Key(unit="N", low=1e-3, high=1e6, required=True),
        "thrust_min_N": Key(unit="N", low=-1e6, high=1e6),
        "cant_deg": Key(unit="deg", low=-180.0, high=180.0),
    },
    "command": {
        "force_N": Key(unit="N", low=-MOST, high=MOST, required=True),
        "moment_Nm": Key(unit="N m", low=-MOST, high=MOST, required=True),
        "priority": Key("choice", choices=("moment", "force")),
    },
    "mounting": {"distance_m": Key("axis", unit="m", low=0.0, high=50.0, required=True)},
}  # fmt: skip




def share(
    path: str, wanted_N: float | None = None, wanted_Nm: float | None = None, out: str | None = None
) -> tuple[dict[str, Any], str, bool]:
    """Allocate what is wanted (by the file, unless said): ``bemt.thrusters.result/1``, its text, whether it is met."""
    wrong = [Fault("", option, f"{value:g}", f"a number from {-MOST:g} to {MOST:g} {unit}")
             for option, value, unit in (("--force", wanted_N, "N"), ("--moment", wanted_Nm, "N m"))
             if value is not None and not -MOST <= value <= MOST]  # fmt: skip
    try:
        doc = _read(Path(path))
    except InputError as error:
        raise InputError([*wrong, *error.faults]) from None
    if wrong:
        raise InputError(wrong)
    thrusters = [
        Thruster(float(t["y_m"]), float(t["thrust_max_N"]), float(t.get("thrust_min_N", 0.0)), float(t.get("z_m", 0.0)),
                 math.radians(t.get("cant_deg", 0.0)), t.get("name", f"thruster {i + 1}"))
        for i, t in enumerate(doc["thruster"])
    ]  # fmt: skip
    command = doc.get("command", {"force_N": 0.0, "moment_Nm": 0.0})
    force = float(command["force_N"] if wanted_N is None else wanted_N)
    moment = float(command["moment_Nm"] if wanted_Nm is None else wanted_Nm)
    got = allocate(thrusters, force, moment, command.get("priority", "moment"))
    corners = attainable(thrusters)
    most = max(t.thrust_max_N for t in thrusters)
    distance = _axis(doc["mounting"]["distance_m"]) if "mounting" in doc else np.linspace(0.05, 0.4, 8)
    rows = [{"distance_m": float(d), "moment_one_Nm": float(moment_at(d, most)),
             "moment_one_kgf_m": float(moment_at(d, most)) / KGF,
             "moment_at_force_Nm": float(moment_at(d, most, force)) if force > 0.0 else math.nan}
            for d in distance]  # fmt: skip
    document = {
        "schema": "bemt.thrusters.result/1", "body": doc["body"]["name"], "thrusters": [vars(t) for t in thrusters],
        "command": {"force_N": force, "moment_Nm": moment, "priority": command.get("priority", "moment")},
        "allocation": {f.name: getattr(got, f.name) for f in dataclasses.fields(Allocation)},
        "attainable": corners, "mounting": rows,
    }  # fmt: skip
    if out:
        folder = Path(out)
        outputs.check("--out", folder, RESULTS, [_toml(Path(path))])
        write_atomic(folder / RESULTS[0], json_text(document))
        write_atomic(folder / RESULTS[1], csv_text(list(rows[0]), rows))
        write_atomic(folder / RESULTS[2], _picture(doc["body"]["name"], most, force, distance, corners, got))
    return document, _text(doc["body"], thrusters, got, rows) + "\n", got.met


def _toml(path: Path) -> Path:
    """The file itself, also where its folder is named."""
    return path / "thrusters.toml" if path.is_dir() else path


def _read(path: Path) -> dict[str, Any]:
    file = _toml(path)
    out = Collector(file.as_posix())
    doc = load_toml(file, out)
    if doc is None:
        raise InputError(out.faults)
    tops = [name for name in TABLES if name]
    check_table(out, "", {k: v for k, v in doc.items() if k not in tops}, TABLES, subtables=tops)
    for name in ("body", "command", "mounting"):
        if name in doc:
            check_table(out, name, doc[name], TABLES)
    if "body" not in doc:
        out.add("body", "nothing", "a table [body]")
    items = doc.get("thruster")
    if not isinstance(items, list) or not items:
        out.add("thruster", "nothing" if items is None else "no list", "one or more tables [[thruster]]")
    else:
        before = len(out.faults)
        for i, item in enumerate(items):
            check_table(out, "thruster", item, TABLES, where=f"thruster[{i}]")
            if len(out.faults) == before and item.get("thrust_min_N", 0.0) >= item["thrust_max_N"]:
                out.add(f"thruster[{i}].thrust_min_N", f"{item['thrust_min_N']:g}", "less than thrust_max_N")
    if out.faults:
        raise InputError(out.faults)
    return doc


def _axis(value: Any) -> Any:
    return np.linspace(value["start"], value["stop"], int(value["num"])) if isinstance(value, dict) else np.array(value)


def _text(body: dict[str, Any], thrusters: list[Thruster], got: Allocation, rows: list[dict[str, float]]) -> str:
    table = [[t.name, number_text(t.y_m), number_text(t.thrust_max_N), number_text(float(v)), "at limit" if s else ""]
             for t, v, s in zip(thrusters, got.thrust_N, got.saturated, strict=True)]  # fmt: skip
    lines = [body["name"], text_table(["thruster", "y [m]", "limit [N]", "thrust [N]", ""], table, left=(0, 4))]
    words = "met" if got.met else "beyond the thrusters"
    lines.append(f"wanted {got.wanted_force_N:g} N and {got.wanted_moment_Nm:g} N m: {words}; "
                 f"given {number_text(got.force_N)} N and {number_text(got.moment_Nm)} N m")  # fmt: skip
    if "mass_kg" in body:
        total, weight = sum(t.thrust_max_N * math.cos(t.cant_rad) for t in thrusters), body["mass_kg"] * KGF
        lines.append(f"all together {total:.1f} N on a weight of {weight:.1f} N: {total / weight:.2f}")
    cells = [[number_text(v) for v in r.values()] for r in rows]
    lines.append(text_table(["distance [m]", "one alone [N m]", "[kgf m]", "at the force [N m]"], cells, left=()))
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
