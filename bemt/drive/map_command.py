"""``python -m bemt map``: a bench recording becomes a map of pulse width to thrust, and back."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from bemt import importers
from bemt.drive import bench_map, map_export, map_points, map_scatter, picture
from bemt.errors import EXIT_OK, Fault, InputError
from bemt.imported import Imported
from bemt.tables import json_text, number_text, text_table, write_atomic

__all__ = ["run"]

SCHEMA = "bemt.map/1"
UNFIT = 0.05
"""Misfit from which a recording holds no map. [1]"""


def run(args: argparse.Namespace) -> int:
    """Run the command.

    Parameters
    ----------
    args : argparse.Namespace
        Of the command line: files, sign, name, nodes, thrust, voltage, out, json.

    Returns
    -------
    int
        Exit code.

    Raises
    ------
    InputError
        With the faults of all files.
    """
    parts: list[map_points.MapPoints] = []
    faults: list[Fault] = []
    for i, file in enumerate(args.files):
        try:
            got = importers.read(file)
            if not isinstance(got, Imported):
                raise InputError(Fault(file, "", "no recording", "a log or a table of a thrust stand"))
            parts.append(map_points.points(got, file, args.sign, i))
        except InputError as error:
            faults += error.faults
    if faults:
        raise InputError(faults)
    points = map_points.join(parts)
    chart = bench_map.fit(points)
    off = bench_map.misfit(points, chart)
    if off > UNFIT:
        got = f"thrust that lies {100 * off:.0f} % of its greatest value off any rising curve"
        hint = "Is there a propeller, and did the motor run through? Different drives do not share a map"
        raise InputError(Fault(", ".join(args.files), "thrust_N", got, "thrust that rises with the pulse width", hint))
    trip = bench_map.held_out(points)
    spread, speed = bench_map.repeat_spread(points, chart), map_scatter.document(points)
    name = args.name or Path(args.files[0]).stem
    document = {
        "schema": SCHEMA, "name": name, "files": list(args.files), **map_export.document(chart, args.nodes),
        "steady_points": len(points),
        "held_out": {"points": len(trip.error), "worst_of_full_thrust": trip.worst, "rms_of_full_thrust": trip.rms,
                     "share_within_1_pct": float(np.mean(np.abs(trip.error) <= 0.01))},
        "repeat_spread_of_full_thrust": spread, "speed_known": speed,
        "misfit_of_full_thrust": off,
    }  # fmt: skip
    answer = None
    if args.thrust is not None:
        pulse = float(chart.pulse_for(args.thrust, args.voltage))
        answer = {"thrust_N": args.thrust, "voltage_V": args.voltage, "pulse_us": pulse}
        document["answer"] = answer
    if args.out:
        _write(Path(args.out), name, chart, args.nodes, json_text(document))
    if args.json:
        print(json_text(document), end="")
        return EXIT_OK
    forward, _ = map_export.tables(chart, args.nodes)
    rows = [[number_text(float(v[i])) for v in forward.values()] for i in range(args.nodes)]
    print(text_table(list(forward), rows, left=()))
    print(
        f"held out: {len(trip.error)} points, worst {100 * trip.worst:.2f} %, rms {100 * trip.rms:.2f} % of full thrust"
    )
    if np.isfinite(spread):
        print(f"the recording itself differs by up to {100 * spread:.2f} % of full thrust at equal pulse width")
    if speed["points"]:
        worst, rms = (100 * speed[f"{key}_of_full_thrust"] for key in ("worst", "rms"))
        print(
            f"with its speed known thrust would still miss by {worst:.2f} %, rms {rms:.2f} %: scatter of the readings"
        )
    if chart.with_voltage:
        m = chart.curves["thrust"].exponent
        low, high = chart.voltage_range
        print(f"thrust goes with (V / {chart.voltage_ref:.2f} V)^{m:.2f}, recorded from {low:.2f} to {high:.2f} V")
    for note in chart.notes:
        print(f"! {note}")
    if answer is not None:
        shown = number_text(answer["pulse_us"], 6, none="more than this drive gives")
        print(f"{args.thrust:g} N: pulse width {shown}{' us' if np.isfinite(answer['pulse_us']) else ''}")
    return EXIT_OK


def _write(folder: Path, name: str, chart: bench_map.BenchMap, nodes: int, text: str) -> None:
    forward, inverse = map_export.tables(chart, nodes)
    write_atomic(folder / f"{name}.map.json", text)
    write_atomic(folder / f"{name}.map.csv", map_export.table_csv(forward))
    write_atomic(folder / f"{name}.inverse.csv", map_export.table_csv(inverse))
    write_atomic(folder / f"{name}_map.h", map_export.c_header(chart, name, nodes))
    write_atomic(folder / f"{name}.map.png", picture.bench_map(chart, name))
