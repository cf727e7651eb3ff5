"""A bench recording becomes a map of pulse width to thrust, and back."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError, gathered, refuse
from bemt.base.tables import csv_text, json_text, number_text, text_table, write_atomic
from bemt.data import readers as importers
from bemt.physics.dataset import Dataset
from bemt.tools.drive import bench_map, outputs
from bemt.tools.drive.bench_map import BenchMap

# What of a round trip the stand itself scatters: thrust over speed squared, which ESC and battery do not move.

LEAST_THRUST = 0.05
"""Share of the greatest thrust below which a level does not speak for T/rpm^2: there it is mostly zero point."""


def speed_known(points: Dataset) -> Array:
    """Errors of the same held-out levels if their speed were known: what is left is not the map's, (M,) [1].

    A propeller at rest has thrust = k rpm^2, with k almost constant (Reynolds number). Each level's k is read between
    the nearest levels below and above in speed; its thrust then misses by this much. It holds the scatter of the
    readings of thrust and speed, whatever ESC and battery do.
    """
    thrust, rpm = points.thrust_N, points.rpm
    usable = np.isfinite(thrust) & np.isfinite(rpm) & (rpm > 0.0)
    if not np.any(usable):
        return np.empty(0)
    full = float(np.max(thrust[usable]))
    usable &= thrust > LEAST_THRUST * full
    errors = []
    for run in np.unique(points.run[usable]):
        own = np.flatnonzero(usable & (points.run == run))
        own = own[np.argsort(rpm[own])]
        n = rpm[own]
        k = thrust[own] / n**2
        for i in range(1, own.size - 1):
            # a level of the very same speed is a repeat: it counts as a neighbour on both sides
            share = (n[i] - n[i - 1]) / (n[i + 1] - n[i - 1]) if n[i + 1] > n[i - 1] else 0.5
            between = (1.0 - share) * k[i - 1] + share * k[i + 1]
            errors.append((between * n[i] ** 2 - thrust[own[i]]) / full)
    return np.array(errors)


def scatter(points: Dataset) -> tuple[int, float, float]:
    """Points of `speed_known`, the largest of its errors and their root mean square [1]."""
    e = speed_known(points)
    return (e.size, float(np.max(np.abs(e))), float(np.sqrt(np.mean(e**2)))) if e.size else (0, math.nan, math.nan)


# A bench map as CSV, JSON and a C header, for the controller that asks for a thrust.

COLUMNS = {"thrust": "thrust_N", "rpm": "rpm", "current": "current_A", "power": "power_W"}


def tables(chart: BenchMap, nodes: int = 41) -> tuple[dict[str, Array], dict[str, Array]]:
    """Sample the map and its inverse."""
    pulse = np.linspace(*chart.pulse_range_us, nodes)
    forward = {"pulse_us": pulse}
    forward |= {COLUMNS[name]: chart.at(name, pulse) for name in COLUMNS if name in chart.curves}
    if chart.voltage is not None:
        forward["recorded_voltage_V"] = chart.voltage_at(pulse)
    low = max(float(chart.thrust.values[0]), 0.0)
    wanted = np.linspace(low, chart.full_thrust_N, nodes)
    return forward, {"thrust_N": wanted, "pulse_us": chart.pulse_for(wanted)}


def table_csv(table: dict[str, Array]) -> str:
    """One table as CSV."""
    rows = [{name: float(v[i]) for name, v in table.items()} for i in range(len(next(iter(table.values()))))]
    return csv_text(list(table), rows)


def _array(name: str, values: Array, comment: str) -> str:
    cells = [f"{v:.7g}" for v in values]
    cells = [c if re.search(r"[.e]", c) else c + ".0" for c in cells]
    lines = [", ".join(c + "f" for c in cells[i : i + 8]) for i in range(0, len(cells), 8)]
    body = ",\n    ".join(lines)
    return f"static const float {name}[{len(cells)}] = {{ /* {comment} */\n    {body}\n}};\n"


def c_header(chart: BenchMap, name: str = "drive", nodes: int = 41) -> str:
    """The map as a C99 header: tables at equal steps, and two functions that interpolate between them."""
    p = re.sub(r"\W", "_", name.strip()).lower() or "drive"
    p = f"m_{p}" if p[0].isdigit() else p
    guard = f"{p.upper()}_MAP_H"
    forward, inverse = tables(chart, nodes)
    lo, hi = chart.pulse_range_us
    t0, t1 = float(inverse["thrust_N"][0]), float(inverse["thrust_N"][-1])
    m = chart.thrust.exponent
    parts = [
        f"/* Bench map of {p}: pulse width [us], thrust [N]; written by bemt. Equal steps, linear between them. */",
        *[f"/* {note.replace('*/', '')} */" for note in chart.notes],
        f"#ifndef {guard}\n#define {guard}\n",
        *(["#include <math.h>\n"] if m else []),
        f"#define {guard[:-2]}_NODES {nodes}",
        f"#define {guard[:-2]}_PULSE_MIN_US {lo:.7e}f",
        f"#define {guard[:-2]}_PULSE_MAX_US {hi:.7e}f",
        f"#define {guard[:-2]}_THRUST_MIN_N {t0:.7e}f",
        f"#define {guard[:-2]}_THRUST_MAX_N {t1:.7e}f\n",
    ]
    for column, values in forward.items():
        if column != "pulse_us":
            parts.append(_array(f"{p}_{column.lower()}", values, f"{column} at equal steps of pulse width"))
    parts.append(_array(f"{p}_pulse_us", inverse["pulse_us"], "pulse width [us] at equal steps of thrust"))
    parts.append(_LOOKUP.format(p=p, g=guard[:-2]))
    arg, scale = ("", "")
    if m:
        arg = ", float voltage_V"
        scale = f"    const float scale = powf(voltage_V / {chart.voltage_ref:.7e}f, {m:.7e}f);\n"
    parts.append(
        _FUNCTIONS.format(
            p=p, g=guard[:-2], arg=arg, scale=scale, by=" * scale" if m else "", over=" / scale" if m else ""
        )
    )
    return "\n".join(parts) + f"\n#endif /* {guard} */\n"


_LOOKUP = """static inline float {p}_lookup_(const float *table, float x) /* x from 0 to 1, held at the ends */
{{
    const float at = (x > 0.0f ? (x < 1.0f ? x : 1.0f) : 0.0f) * ({g}_NODES - 1);
    int i = (int)at;
    if (i > {g}_NODES - 2) i = {g}_NODES - 2;
    return table[i] + (at - (float)i) * (table[i + 1] - table[i]);
}}
"""
_FUNCTIONS = """/* Thrust [N] that a pulse width [us] gives. */
static inline float {p}_thrust(float pulse_us{arg})
{{
{scale}    return {p}_lookup_({p}_thrust_n,
        (pulse_us - {g}_PULSE_MIN_US) / ({g}_PULSE_MAX_US - {g}_PULSE_MIN_US)){by};
}}

/* Pulse width [us] for a wanted thrust [N]; held at the ends of the map. */
static inline float {p}_pulse(float thrust_N{arg})
{{
{scale}    return {p}_lookup_({p}_pulse_us,
        (thrust_N{over} - {g}_THRUST_MIN_N) / ({g}_THRUST_MAX_N - {g}_THRUST_MIN_N));
}}
"""


SCHEMA = "bemt.map/1"
UNFIT = 0.05
"""Misfit from which a recording holds no map. [1]"""
RESULTS = ("{}.map.json", "{}.map.csv", "{}.inverse.csv", "{}_map.h", "{}.map.png")
"""Names of the results, for the name of the map."""


@dataclass(frozen=True)
class MapResult:
    """A map, and how well it holds its recordings."""

    chart: bench_map.BenchMap
    name: str
    files: tuple[str, ...]
    nodes: int
    steady_points: int
    trip: bench_map.HeldOut
    spread: float  # Of repeats at one pulse width, over full thrust [1]
    speed_known: tuple[int, float, float]  # Of :func:`scatter`
    misfit: float  # Over full thrust [1]
    asked: tuple[float, float | None] | None = None  # Thrust [N] that is wanted, and its voltage [V]

    @property
    def pulse_us(self) -> float:
        """Pulse width for the thrust that is wanted; NaN where it is more than the drive gives."""
        return math.nan if self.asked is None else float(self.chart.pulse_for(*self.asked))

    @property
    def reached(self) -> bool:
        """Whether the drive gives the thrust that is wanted."""
        return self.asked is None or math.isfinite(self.pulse_us)

    def document(self) -> dict[str, Any]:
        """Plain values, ``bemt.map/1``."""
        chart, trip = self.chart, self.trip
        forward, inverse = tables(chart, self.nodes)
        points, worst, rms = self.speed_known
        near = float(np.mean(np.abs(trip.error) <= 0.01))
        out = {
            "schema": SCHEMA, "name": self.name, "files": list(self.files), "full_thrust_N": chart.full_thrust_N,
            "voltage_is_a_parameter": chart.with_voltage, "voltage_ref_V": chart.voltage_ref,
            "voltage_range_V": list(chart.voltage_range),
            "voltage_exponent": {name: curve.exponent for name, curve in chart.curves.items()},
            "smoothness": {name: curve.smoothness for name, curve in chart.curves.items()}, "forward": forward,
            "inverse": inverse, "notes": list(chart.notes), "steady_points": self.steady_points,
            "held_out": {"points": len(trip.error), "worst_of_full_thrust": trip.worst,
                         "rms_of_full_thrust": trip.rms, "share_within_1_pct": near},
            "repeat_spread_of_full_thrust": self.spread,
            "speed_known": {"points": points, "worst_of_full_thrust": worst, "rms_of_full_thrust": rms},
            "misfit_of_full_thrust": self.misfit,
        }  # fmt: skip
        if self.asked is not None:
            out["answer"] = {"thrust_N": self.asked[0], "voltage_V": self.asked[1], "pulse_us": self.pulse_us}
        return out


def fit(
    files: Sequence[str], sign: int = 1, nodes: int = 41, name: str | None = None, thrust: float | None = None,
    voltage: float | None = None, out: str | None = None,
) -> MapResult:  # fmt: skip
    """Fit a map to recordings of one drive and write it where told; faults of options and files come at once."""
    parts: list[Dataset] = []
    faults = _option_faults(thrust, voltage, nodes, name)
    name = name or Path(files[0]).stem
    read: dict[Path, str] = {}
    for i, file in enumerate(files):
        with gathered(faults):
            got = importers.read(file)
            own = _sources(Path(file), got)
            if twice := next((read[path] for path in own if path in read), None):
                hint = "A recording that counts twice makes the map look more certain than it is"
                raise InputError(Fault(file, "", f"the recording of {twice} again", "each recording once", hint))
            read |= dict.fromkeys(own, file)
            if not isinstance(got, Dataset):
                raise InputError(Fault(file, "", "no recording", "a log or a table of a thrust stand"))
            parts.append(bench_map.points(got, file, sign, i))
    if out:
        faults += outputs.faults("--out", Path(out), [form.format(name) for form in RESULTS], read)
    refuse(faults)
    points = bench_map.join(parts)
    chart = bench_map.fit(points)
    off = bench_map.misfit(points, chart)
    if off > UNFIT:
        got = f"thrust that deviates by {100 * off:.0f} % of its largest value from any rising curve"
        hint = "Is there a propeller, and did the motor run through? Different drives do not share a map"
        raise InputError(Fault(", ".join(files), "thrust_N", got, "thrust that rises with the pulse width", hint))
    asked = None if thrust is None else (thrust, voltage)
    made = MapResult(chart, name, tuple(files), nodes, len(points), bench_map.held_out(points),
                     bench_map.repeat_spread(points, chart), scatter(points), off, asked)  # fmt: skip
    if out:
        _write(Path(out), name, chart, nodes, json_text(made.document()))
    return made


def text(result: MapResult) -> str:
    """Lay a map out for a terminal."""
    chart, nodes, trip, spread = result.chart, result.nodes, result.trip, result.spread
    forward, _ = tables(chart, nodes)
    rows = [[number_text(float(v[i])) for v in forward.values()] for i in range(nodes)]
    lines = [text_table(list(forward), rows, left=())]
    worst, rms = 100 * trip.worst, 100 * trip.rms
    lines.append(f"held out: {len(trip.error)} points, worst {worst:.2f} %, rms {rms:.2f} % of full thrust")
    if np.isfinite(spread):
        lines.append(f"the recording itself scatters by up to {100 * spread:.2f} % of full thrust at equal pulse width")
    known, worst, rms = result.speed_known
    if known:
        words = f"{100 * worst:.2f} %, rms {100 * rms:.2f} %: scatter of the readings"
        lines.append(f"with known speed the thrust error would still be {words}")
    if chart.with_voltage:
        m = chart.thrust.exponent
        low, high = chart.voltage_range
        law = f"thrust scales with (V / {chart.voltage_ref:.2f} V)^{m:.2f}"
        lines.append(f"{law}, recorded from {low:.2f} to {high:.2f} V")
    lines += [f"! {note}" for note in chart.notes]
    if result.asked is not None:
        shown = number_text(result.pulse_us, 6, none="more than this drive can give")
        lines.append(f"{result.asked[0]:g} N: pulse width {shown}{' us' if result.reached else ''}")
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
    """The file itself and the tables that it names."""
    names = got.file.split("+") if isinstance(got, Dataset) else []
    beside = [place for name in names if name for place in (Path(name), path.parent / name)]
    return {path.resolve(), *(p.resolve() for p in beside if p.is_file())}


def _write(folder: Path, name: str, chart: bench_map.BenchMap, nodes: int, text: str) -> None:
    forward, inverse = tables(chart, nodes)
    contents: Iterable[bytes | str] = (
        text, table_csv(forward), table_csv(inverse), c_header(chart, name, nodes), outputs.bench_map(chart, name),
    )  # fmt: skip
    for form, content in zip(RESULTS, contents, strict=True):
        write_atomic(folder / form.format(name), content)
