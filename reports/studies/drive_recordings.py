"""The drive model against thrust maps and step logs of public stands.

Run ``python reports/studies/drive_recordings.py DIR [--out DIR]``; DIR holds the folders ``jmajew``, ``thrust_map``,
``thrust_step``, ``mit_copter_rcbenchmark`` as their publishers laid them out. What a data sheet gives stays: K_v and
I_0 of the MN2206 come from its run without propeller. No data sheet of the other motors is known; there K_v and I_0 are
fitted too, and said to be.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import Any

import drive_checks as validation
import drive_identify as identify
import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError
from bemt.base.tables import json_text, number_text, text_table, write_atomic
from bemt.data import readers as importers
from bemt.physics.dataset import Dataset
from bemt.tools.drive import bench_map, outputs
from bemt.tools.drive.drive_model import Drive

Array = NDArray[np.float64]
KGF = 9.80665
VOLTS = 15.82
"""Of the battery of ``thrust_step``, stated by its publisher. [V]"""
COMMANDS = {
    "0500_thrust_response": ((100, 1.0), (500, 1.5)),
    "increasing_thrust_response": ((600, 1.0), *((order, 1.0) for order in range(100, 2001, 100))),
}
"""DShot commands of the publisher's firmware and how long each holds [s]; 48, no throttle, before and after."""
ESC = "battery, R, ripple, pulses of no thrust and full duty"
OWN = f"{ESC}; K_v and I0 of its run without propeller"
ALL = f"{ESC}, K_v and I0: no data sheet known"
MIT = f"{ESC} and I0; K_v 775 by its motor's name, 12 V assumed, no voltage recorded"


def _read(path: Path, sign: int = 1) -> tuple[Dataset, Array | None]:
    """Points of a map and their torque, where each row is a point."""
    got = importers.read(path)
    points = bench_map.points(got, path.as_posix(), sign)
    torque = got.values.get("torque_Nm")
    return points, sign * torque if torque is not None and len(torque) == len(points) else None


def _mit(path: Path) -> tuple[Dataset, Array]:
    """Columns without headings: pulse width [us], torque [N m], thrust [N], speed [rev/min], current [A]."""
    c = list(importers.read(path).values.values())
    return bench_map.map_points(c[0], {"thrust_N": c[2], "rpm": c[3], "current_A": c[4]}), c[1]


def maps(folder: Path) -> list[validation.MapCheck]:
    """Fit and predict the thrust maps of a folder."""
    out = []
    bare = folder / "jmajew" / "grp01__mn2206_noprop_3s.csv"
    if bare.is_file():
        log = importers.read(bare)
        kv, i0 = identify.no_load(bench_map.map_points(1000.0 + 1000.0 * log["throttle"], log.values))
        for path in sorted(bare.parent.glob("grp01__mn2206_*_table1.csv")):
            points, torque = _read(path)
            fit = identify.fit_map(points, {"kv_rpm_V": kv, "no_load_A": i0}, torque)
            out.append(validation.check_map(f"jmajew {path.stem[14:]}", OWN, fit.drive, points, fit.fitted))
    for path in sorted((folder / "jmajew").glob("grp01__*_table1.csv")):
        if "mn2206" not in path.name and "noprop" not in path.name:
            points, torque = _read(path)
            fit = identify.fit_map(points, None, torque)
            out.append(validation.check_map(f"jmajew {path.stem[7:]}", ALL, fit.drive, points, fit.fitted))
    steps_file = folder / "thrust_map" / "xNova-SR-steps.csv"
    if steps_file.is_file():
        points, _ = _read(steps_file, -1)
        fit = identify.fit_map(points)
        out.append(validation.check_map("xNova steps (to 1600 us)", ALL, fit.drive, points, fit.fitted))
        points, _ = _read(steps_file.with_name("xNova-SR-ramp.csv"), -1)
        drive = validation.other_battery(fit.drive, points)
        words = "predicted from the steps; its own battery"
        out.append(validation.check_map("xNova ramp (to 1800 us)", words, drive, points, {}))
    for size in ("10", "14"):
        path = folder / "mit_copter_rcbenchmark" / "resources" / "measurement" / f"motor_{size}inch_prop.txt"
        if path.is_file():
            points, torque = _mit(path)
            fit = identify.fit_map(points, {"voltage_V": 12.0, "kv_rpm_V": 775.0}, torque)
            out.append(validation.check_map(f"MIT {size} in", MIT, fit.drive, points, fit.fitted))
    for path in sorted((folder / "rcbenchmark").glob("a*_*.csv")) + sorted((folder / "rcbenchmark").glob("Steps*.csv")):
        try:
            points, torque = _read(path)
            fit = identify.fit_map(points, None, torque)
        except InputError:  # too few steady points, or no speed
            continue
        thrust = points.thrust_N
        if np.corrcoef(points.pulse_us, thrust)[0, 1] > 0.9:  # else no propeller, or the run broke off
            out.append(validation.check_map(f"rcbenchmark {path.stem}", ALL, fit.drive, points, fit.fitted))
    return out


def steps(folder: Path) -> tuple[list[validation.StepCheck], Drive]:
    """Compare the steps of the logs of ``thrust_step``."""
    found, levels = [], (np.array([]), np.array([]))
    for name, orders in COMMANDS.items():
        t, scale = importers.read(folder / "thrust_step" / f"{name}.csv").values.values()
        thrust = (np.median(scale[:50]) - scale) * KGF  # the scale carries the motor, thrust lifts it [kgf]
        hold = np.array([seconds for _, seconds in orders])
        pulse = 1000.0 + (np.array([48, *(order for order, _ in orders), 48]) - 48.0) / 1.999  # DShot has 48 to 2047
        last = float(np.mean(thrust[(t > t[np.argmax(thrust)]) & (t < t[np.argmax(thrust)] + 0.2)]))
        end = float(t[np.flatnonzero(thrust > 0.5 * last)[-1]])
        starts = end - np.concatenate([np.cumsum(hold[::-1])[::-1], [0.0]])
        size = np.array(
            [
                np.median(thrust[(t > a + 0.4 * h) & (t < a + 0.95 * h)])
                for a, h in zip(starts, [*hold, 1.0], strict=True)
            ]
        )
        if len(orders) > 10:
            levels = (pulse[2:-1], size[1:-1])
        for i, change in enumerate(np.diff(np.concatenate([[0.0], size]))):
            if abs(change) >= 0.1 * np.max(size):
                rows = (t >= starts[i] - 0.4) & (t <= starts[i] + 0.8)
                found.append(validation.Step(name, (float(pulse[i]), float(pulse[i + 1])), t[rows], thrust[rows]))
    return validation.check_steps(VOLTS, levels, found)


def _sorted(x: Array, y: Array) -> tuple[Array, Array]:
    order = np.argsort(x)
    return x[order], y[order]


def compare(path: str, out: str | None = None) -> tuple[dict[str, Any], str]:
    """Compare with all recordings of a folder: ``bemt.drive.validation/1``, and its text."""
    folder = Path(path)
    found = maps(folder)
    checks, drive = steps(folder) if (folder / "thrust_step").is_dir() else ([], None)
    if not found and not checks:
        raise InputError(Fault(folder.as_posix(), "", "no recordings", "folders jmajew, thrust_map, thrust_step"))
    document: dict[str, Any] = {
        "schema": "bemt.drive.validation/1",
        "maps": [{k: v for k, v in vars(m).items()} for m in found],
        "steps": [{**dataclasses.asdict(s), "ratio": s.ratio} for s in checks],
        "inertia_kg_m2": drive.motor.inertia_kg_m2 if drive else None,
        "reactance_ohm_s": drive.motor.reactance_ohm_s if drive else None,
        "brake_on_stop": drive.esc.brake_on_stop if drive else None,
    }
    rows = [[m.name, f"{100 * m.worst:.1f}", f"{100 * m.rms:.1f}", m.how] for m in found]
    lines = [text_table(["thrust over pulse width", "worst [%FS]", "rms [%FS]", "fitted"], rows, left=(0, 3))]
    rows = [[f"{s.log} at {s.at_s:.2f} s", f"{s.before_N:.2f} to {s.after_N:.2f}",
             f"{1e3 * s.tau_s:.1f} ± {1e3 * s.u_tau_s:.1f}" if s.resolved else "-",
             number_text(1e3 * s.model_s, 3), number_text(s.ratio, 3)] for s in checks]  # fmt: skip
    head = ["step", "thrust [N]", "tau recorded [ms]", "model [ms]", "ratio"]
    if checks:
        lines += ["", text_table(head, rows, left=(0,)), f"samples every {1e3 * checks[0].sample_s:.0f} ms"]
    text = "\n".join(lines) + "\n"
    if out:
        results = Path(out)
        write_atomic(results / "validation.json", json_text(document))
        write_atomic(results / "validation.txt", text)
        wanted = ("jmajew gemfan", "jmajew hqprop6x4x3", "xNova ramp", "MIT 10", "MIT 14")
        shown = [m for name in wanted for m in found if m.name.startswith(name)]
        panels = [
            outputs.Panel("pulse width [µs]", "thrust [N]", [
                ("model", *_sorted(m.pulse_us, m.model_N), "-"), ("recorded", m.pulse_us, m.thrust_N, "o")], m.name)
            for m in shown
        ]  # fmt: skip
        write_atomic(results / "maps.png", outputs.curves(panels))
    return document, text


def main(words: list[str] | None = None) -> int:
    """Compare, print, and write with ``--out``."""
    parser = argparse.ArgumentParser(description="The drive model against recordings of public stands.")
    parser.add_argument("folder", metavar="DIR", help="holds jmajew, thrust_map, thrust_step, mit_copter_rcbenchmark")
    parser.add_argument("--out", metavar="DIR", help="write tables and a picture to this folder")
    parser.add_argument("--json", action="store_true", help="print the document")
    args = parser.parse_args(words)
    document, text = compare(args.folder, args.out)
    print(json_text(document) if args.json else text, end="")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
