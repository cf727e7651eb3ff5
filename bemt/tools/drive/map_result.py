"""A bench recording becomes a map of pulse width to thrust, and back."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.base.tables import json_text, number_text, text_table, write_atomic
from bemt.data import readers as importers
from bemt.physics.dataset import Dataset
from bemt.tools.drive import bench_map, map_export, map_points, map_scatter, outputs, picture

SCHEMA = "bemt.map/1"
UNFIT = 0.05
"""Misfit from which a recording holds no map. [1]"""
RESULTS = ("{}.map.json", "{}.map.csv", "{}.inverse.csv", "{}_map.h", "{}.map.png")
"""Names of the results, for the name of the map."""


@dataclass(frozen=True)
class MapResult:
    """A map with its document ``bemt.map/1``; ``reached`` is False when the wanted thrust is more than it gives."""

    chart: bench_map.BenchMap
    document: dict[str, Any]
    nodes: int
    reached: bool


def fit(
    files: Sequence[str],
    sign: int = 1,
    nodes: int = 41,
    name: str | None = None,
    thrust: float | None = None,
    voltage: float | None = None,
    out: str | None = None,
) -> MapResult:
    """Fit a map to recordings of one drive and write it where told; faults of options and files come at once."""
    parts: list[Dataset] = []
    faults = _option_faults(thrust, voltage, nodes, name)
    name = name or Path(files[0]).stem
    read: dict[Path, str] = {}
    for i, file in enumerate(files):
        try:
            got = importers.read(file)
            own = _sources(Path(file), got)
            if twice := next((read[path] for path in own if path in read), None):
                hint = "A recording that counts twice makes the map look more certain than it is"
                raise InputError(Fault(file, "", f"the recording of {twice} again", "each recording once", hint))
            read |= dict.fromkeys(own, file)
            if not isinstance(got, Dataset):
                raise InputError(Fault(file, "", "no recording", "a log or a table of a thrust stand"))
            parts.append(map_points.points(got, file, sign, i))
        except InputError as error:
            faults += error.faults
    if out:
        faults += outputs.faults("--out", Path(out), [form.format(name) for form in RESULTS], read)
    if faults:
        raise InputError(faults)
    points = map_points.join(parts)
    chart = bench_map.fit(points)
    off = bench_map.misfit(points, chart)
    if off > UNFIT:
        got = f"thrust that deviates by {100 * off:.0f} % of its largest value from any rising curve"
        hint = "Is there a propeller, and did the motor run through? Different drives do not share a map"
        raise InputError(Fault(", ".join(files), "thrust_N", got, "thrust that rises with the pulse width", hint))
    trip = bench_map.held_out(points)
    spread, speed = bench_map.repeat_spread(points, chart), map_scatter.document(points)
    document: dict[str, Any] = {
        "schema": SCHEMA, "name": name, "files": list(files), **map_export.document(chart, nodes),
        "steady_points": len(points),
        "held_out": {"points": len(trip.error), "worst_of_full_thrust": trip.worst, "rms_of_full_thrust": trip.rms,
                     "share_within_1_pct": float(np.mean(np.abs(trip.error) <= 0.01))},
        "repeat_spread_of_full_thrust": spread, "speed_known": speed,
        "misfit_of_full_thrust": off,
    }  # fmt: skip
    reached = True
    if thrust is not None:
        pulse = float(chart.pulse_for(thrust, voltage))
        document["answer"] = {"thrust_N": thrust, "voltage_V": voltage, "pulse_us": pulse}
        reached = math.isfinite(pulse)
    if out:
        _write(Path(out), name, chart, nodes, json_text(document))
    return MapResult(chart, document, nodes, reached)


def text(result: MapResult) -> str:
    """Lay a map out for a terminal."""
    chart, nodes, document = result.chart, result.nodes, result.document
    trip, spread = document["held_out"], document["repeat_spread_of_full_thrust"]
    speed, answer = document["speed_known"], document.get("answer")
    forward, _ = map_export.tables(chart, nodes)
    rows = [[number_text(float(v[i])) for v in forward.values()] for i in range(nodes)]
    lines = [text_table(list(forward), rows, left=())]
    worst, rms = (100 * trip[f"{key}_of_full_thrust"] for key in ("worst", "rms"))
    lines.append(f"held out: {trip['points']} points, worst {worst:.2f} %, rms {rms:.2f} % of full thrust")
    if np.isfinite(spread):
        lines.append(f"the recording itself scatters by up to {100 * spread:.2f} % of full thrust at equal pulse width")
    if speed["points"]:
        worst, rms = (100 * speed[f"{key}_of_full_thrust"] for key in ("worst", "rms"))
        lines.append(
            f"with known speed the thrust error would still be {worst:.2f} %, rms {rms:.2f} %: scatter of the readings"
        )
    if chart.with_voltage:
        m = chart.curves["thrust"].exponent
        low, high = chart.voltage_range
        law = f"thrust scales with (V / {chart.voltage_ref:.2f} V)^{m:.2f}"
        lines.append(f"{law}, recorded from {low:.2f} to {high:.2f} V")
    lines += [f"! {note}" for note in chart.notes]
    if answer is not None:
        shown = number_text(answer["pulse_us"], 6, none="more than this drive can give")
        lines.append(f"{answer['thrust_N']:g} N: pulse width {shown}{' us' if np.isfinite(answer['pulse_us']) else ''}")
    return "\n".join(lines) + "\n"


def _option_faults(thrust: float | None, voltage: float | None, nodes: int, name: str | None) -> list[Fault]:
    """What is wrong with the options."""
    faults = []
    if thrust is not None and not 0.0 <= thrust < math.inf:
        hint = "--sign -1 reverses the recorded thrust" if thrust < 0.0 else ""
        faults.append(Fault("", "--thrust-N", f"{thrust:g}", "a finite number of 0 or more [N]", hint))
    if voltage is not None and not 0.0 < voltage < math.inf:
        faults.append(Fault("", "--voltage-V", f"{voltage:g}", "a finite number above 0 [V]"))
    if voltage is not None and thrust is None:
        faults.append(Fault("", "--voltage-V", f"{voltage:g}", "none without --thrust-N, which it belongs to"))
    if nodes < 2:
        faults.append(Fault("", "--nodes", str(nodes), "2 or more: between them the tables are read"))
    if name is not None and (not name.strip(" .") or any(c in "/\\:" or c < " " for c in name)):
        hint = "It names files in --out DIR"
        faults.append(Fault("", "--name", repr(name), "a name without /, \\ and :, and not of dots alone", hint))
    return faults


def _sources(path: Path, got: object) -> set[Path]:
    """The file itself and the tables beside it that it names."""
    names = str(got.provenance.get("file", "")).split("+") if isinstance(got, Dataset) else []
    beside = [path.parent / Path(name).name for name in names if name]
    return {path.resolve(), *(p.resolve() for p in beside if p.is_file())}


def _write(folder: Path, name: str, chart: bench_map.BenchMap, nodes: int, text: str) -> None:
    forward, inverse = map_export.tables(chart, nodes)
    contents: Iterable[bytes | str] = (
        text,
        map_export.table_csv(forward),
        map_export.table_csv(inverse),
        map_export.c_header(chart, name, nodes),
        picture.bench_map(chart, name),
    )
    for form, content in zip(RESULTS, contents, strict=True):
        write_atomic(folder / form.format(name), content)
