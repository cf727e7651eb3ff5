"""A bench map as CSV, JSON and a C header, for the controller that asks for a thrust."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.tables import csv_text
from bemt.tools.drive.bench_map import BenchMap

COLUMNS = {"thrust": "thrust_N", "rpm": "rpm", "current": "current_A", "power": "power_W"}


def tables(chart: BenchMap, nodes: int = 41) -> tuple[dict[str, Array], dict[str, Array]]:
    """Sample the map and its inverse."""
    pulse = np.linspace(*chart.pulse_range_us, nodes)
    forward = {"pulse_us": pulse}
    forward |= {COLUMNS[name]: chart.at(name, pulse) for name in COLUMNS if name in chart.curves}
    if chart.voltage is not None:
        forward["recorded_voltage_V"] = chart.voltage_at(pulse)
    low = max(float(chart.curves["thrust"].values[0]), 0.0)
    wanted = np.linspace(low, chart.full_thrust_N, nodes)
    return forward, {"thrust_N": wanted, "pulse_us": chart.pulse_for(wanted)}


def table_csv(table: dict[str, Array]) -> str:
    """One table as CSV."""
    rows = [{name: float(v[i]) for name, v in table.items()} for i in range(len(next(iter(table.values()))))]
    return csv_text(list(table), rows)


def document(chart: BenchMap, nodes: int = 41) -> dict[str, Any]:
    """The map as a JSON document."""
    forward, inverse = tables(chart, nodes)
    return {
        "full_thrust_N": chart.full_thrust_N,
        "voltage_is_a_parameter": chart.with_voltage,
        "voltage_ref_V": chart.voltage_ref,
        "voltage_range_V": list(chart.voltage_range),
        "voltage_exponent": {name: curve.exponent for name, curve in chart.curves.items()},
        "smoothness": {name: curve.smoothness for name, curve in chart.curves.items()},
        "forward": forward,
        "inverse": inverse,
        "notes": list(chart.notes),
    }


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
    m = chart.curves["thrust"].exponent
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
