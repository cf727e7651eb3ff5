"""``python -m bemt map``: a bench recording becomes a map of pulse width to thrust, and back."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from bemt import readers as importers
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED, Fault, InputError
from bemt.base.tables import json_text, number_text, text_table, write_atomic
from bemt.drive import bench_map, map_export, map_points, map_scatter, outputs, picture
from bemt.readers._imported import Imported

__all__ = ["run"]

SCHEMA = "bemt.map/1"
UNFIT = 0.05
"""Misfit from which a recording holds no map. [1]"""
RESULTS = ("{}.map.json", "{}.map.csv", "{}.inverse.csv", "{}_map.h", "{}.map.png")
"""Names of the results, for the name of the map."""


def run(args: argparse.Namespace) -> int:
    """Run the command.

    Parameters
    ----------
    args : argparse.Namespace
        Of the command line: files, sign, name, nodes, thrust, voltage, out, json.

    Returns
    -------
    int
        Exit code: 1 when the wanted thrust is more than the drive gives.

    Raises
    ------
    InputError
        With the faults of the options and of all files.
    """
    parts: list[map_points.MapPoints] = []
    faults = _option_faults(args)
    name = args.name or Path(args.files[0]).stem
    read: dict[Path, str] = {}
    for i, file in enumerate(args.files):
        try:
            got = importers.read(file)
            own = _sources(Path(file), got)
            if twice := next((read[path] for path in own if path in read), None):
                hint = "A recording that counts twice makes the map look surer than it is"
                raise InputError(Fault(file, "", f"the recording of {twice} again", "each recording once", hint))
            read |= dict.fromkeys(own, file)
            if not isinstance(got, Imported):
                raise InputError(Fault(file, "", "no recording", "a log or a table of a thrust stand"))
            parts.append(map_points.points(got, file, args.sign, i))
        except InputError as error:
            faults += error.faults
    if args.out:
        faults += outputs.faults("--out", Path(args.out), [form.format(name) for form in RESULTS], read)
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
    document = {
        "schema": SCHEMA, "name": name, "files": list(args.files), **map_export.document(chart, args.nodes),
        "steady_points": len(points),
        "held_out": {"points": len(trip.error), "worst_of_full_thrust": trip.worst, "rms_of_full_thrust": trip.rms,
                     "share_within_1_pct": float(np.mean(np.abs(trip.error) <= 0.01))},
        "repeat_spread_of_full_thrust": spread, "speed_known": speed,
        "misfit_of_full_thrust": off,
    }  # fmt: skip
    answer, code = None, EXIT_OK
    if args.thrust is not None:
        pulse = float(chart.pulse_for(args.thrust, args.voltage))
        answer = {"thrust_N": args.thrust, "voltage_V": args.voltage, "pulse_us": pulse}
        document["answer"] = answer
        code = EXIT_OK if math.isfinite(pulse) else EXIT_UNCONVERGED
    if args.out:
        _write(Path(args.out), name, chart, args.nodes, json_text(document))
    if args.json:
        print(json_text(document), end="")
        return code
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
    return code


def _option_faults(args: argparse.Namespace) -> list[Fault]:
    """What is wrong with the options."""
    faults = []
    if args.thrust is not None and not 0.0 <= args.thrust < math.inf:
        hint = "--sign -1 turns the recorded thrust round" if args.thrust < 0.0 else ""
        faults.append(Fault("", "--thrust", f"{args.thrust:g}", "a finite number of 0 or more [N]", hint))
    if args.voltage is not None and not 0.0 < args.voltage < math.inf:
        faults.append(Fault("", "--voltage", f"{args.voltage:g}", "a finite number above 0 [V]"))
    if args.voltage is not None and args.thrust is None:
        faults.append(Fault("", "--voltage", f"{args.voltage:g}", "none without --thrust, which it belongs to"))
    if args.nodes < 2:
        faults.append(Fault("", "--nodes", str(args.nodes), "2 or more: between them the tables are read"))
    if args.name is not None and (not args.name.strip(" .") or any(c in "/\\:" or c < " " for c in args.name)):
        hint = "It names files in --out DIR"
        faults.append(Fault("", "--name", repr(args.name), "a name without /, \\ and :, and not of dots alone", hint))
    return faults


def _sources(path: Path, got: object) -> set[Path]:
    """The file itself and the tables beside it that it names."""
    names = got.provenance.get("file", "").split("+") if isinstance(got, Imported) else []
    beside = [path.parent / Path(name).name for name in names if name]
    return {path.resolve(), *(p.resolve() for p in beside if p.is_file())}


def _write(folder: Path, name: str, chart: bench_map.BenchMap, nodes: int, text: str) -> None:
    forward, inverse = map_export.tables(chart, nodes)
    contents: Iterable[bytes | str] = (
        text, map_export.table_csv(forward), map_export.table_csv(inverse), map_export.c_header(chart, name, nodes),
        picture.bench_map(chart, name),
    )  # fmt: skip
    for form, content in zip(RESULTS, contents, strict=True):
        write_atomic(folder / form.format(name), content)
