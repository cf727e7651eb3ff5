"""Plain tables: CSV, JSON, and a C header with its lookup."""

from __future__ import annotations

import json

import numpy as np

from bemt.base.arrays import Array
from bemt.base.tables import csv_text, json_text
from bemt.tools.exports.base import Files, Job, LoadsExport
from bemt.tools.exports.parts import (
    COEFFICIENTS,
    header,
    hub_document,
    hub_loads,
    plain_name,
    still_hub,
    table_document,
    table_of_document,
)

_LOOKUP = """
/* Thrust [N] and shaft torque [N m] at rev/min, axial airspeed [m/s] and density [kg/m3];
   CT and CP bilinear, held at the ends of the table. */
static inline void {p}_loads(double rpm, double airspeed, double density, double *thrust, double *torque)
{{
    const double n = rpm / 60.0;
    double J, a, b, ct, cp, scale;
    int i = 0, j = 0;
    if (n <= 0.0) {{ *thrust = 0.0; *torque = 0.0; return; }}
    J = airspeed / (n * {P}_DIAMETER_M);
    while (i < {P}_N_RPM - 2 && rpm >= {p}_rpm[i + 1]) ++i;
    while (j < {P}_N_J - 2 && J >= {p}_J[j + 1]) ++j;
    a = (rpm - {p}_rpm[i]) / ({p}_rpm[i + 1] - {p}_rpm[i]);
    b = (J - {p}_J[j]) / ({p}_J[j + 1] - {p}_J[j]);
    a = a < 0.0 ? 0.0 : (a > 1.0 ? 1.0 : a);
    b = b < 0.0 ? 0.0 : (b > 1.0 ? 1.0 : b);
    ct = (1 - a) * ((1 - b) * {p}_CT[i][j] + b * {p}_CT[i][j + 1])
       + a * ((1 - b) * {p}_CT[i + 1][j] + b * {p}_CT[i + 1][j + 1]);
    cp = (1 - a) * ((1 - b) * {p}_CP[i][j] + b * {p}_CP[i][j + 1])
       + a * ((1 - b) * {p}_CP[i + 1][j] + b * {p}_CP[i + 1][j + 1]);
    scale = density * n * n * {P}_DIAMETER_M * {P}_DIAMETER_M * {P}_DIAMETER_M * {P}_DIAMETER_M;
    *thrust = ct * scale;
    *torque = cp * scale * {P}_DIAMETER_M / 6.283185307179586;
}}
"""

_WRENCH = """
/* Force [N] and moment [N m] on the vehicle, x y z; velocity of the hub through the air [m/s], z along the thrust.
   Table of the hub: changes of CT and CP, CH downstream, CY to the advancing side over rho n^2 D^4, moments that lift
   the advancing and the upstream side over rho n^2 D^5; linear in rpm and in the advance ratios along and across the
   shaft, held at the ends. */
static inline void {p}_wrench(double rpm, const double velocity[3], double density, double force[3], double moment[3])
{{
    const double n = rpm / 60.0, side = sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1]);
    const double *axis[3] = {{{p}_hub_rpm, {p}_hub_J, {p}_hub_side}};
    const int size[3] = {{{P}_HUB_N_RPM, {P}_HUB_N_J, {P}_HUB_N_SIDE}};
    double at[3], weight[3], v[6], T, Q, scale, x, y;
    int cell[3], d, i, j, k, m;
    {p}_loads(rpm, velocity[2], density, &T, &Q);
    for (m = 0; m < 6; ++m) v[m] = 0.0;
    at[0] = rpm;
    at[1] = n > 0.0 ? velocity[2] / (n * {P}_DIAMETER_M) : 0.0;
    at[2] = n > 0.0 ? side / (n * {P}_DIAMETER_M) : 0.0;
    for (d = 0; d < 3; ++d) {{
        cell[d] = 0;
        while (cell[d] < size[d] - 2 && at[d] >= axis[d][cell[d] + 1]) ++cell[d];
        weight[d] = (at[d] - axis[d][cell[d]]) / (axis[d][cell[d] + 1] - axis[d][cell[d]]);
        weight[d] = weight[d] < 0.0 ? 0.0 : (weight[d] > 1.0 ? 1.0 : weight[d]);
    }}
    for (i = 0; i < 2; ++i) for (j = 0; j < 2; ++j) for (k = 0; k < 2; ++k) {{
        const double w = (i ? weight[0] : 1.0 - weight[0]) * (j ? weight[1] : 1.0 - weight[1])
                       * (k ? weight[2] : 1.0 - weight[2]);
        for (m = 0; m < 6; ++m) v[m] += w * {p}_hub[m][cell[0] + i][cell[1] + j][cell[2] + k];
    }}
    scale = density * n * n * {P}_DIAMETER_M * {P}_DIAMETER_M * {P}_DIAMETER_M * {P}_DIAMETER_M;
    T += v[0] * scale;
    Q += v[1] * scale * {P}_DIAMETER_M / 6.283185307179586;
    x = side > 0.0 ? velocity[0] / side : 0.0;
    y = side > 0.0 ? velocity[1] / side : 0.0;
    force[0] = scale * (-v[2] * x + v[3] * {P}_SENSE * y);
    force[1] = scale * (-v[2] * y - v[3] * {P}_SENSE * x);
    force[2] = T;
    moment[0] = scale * {P}_DIAMETER_M * (-v[4] * {P}_SENSE * x + v[5] * y);
    moment[1] = scale * {P}_DIAMETER_M * (-v[4] * {P}_SENSE * y - v[5] * x);
    moment[2] = -({P}_SENSE) * Q;
}}
"""


class TableExport(LoadsExport):
    """The numbers themselves, for any program."""

    id = "table"
    title = "tables as CSV, JSON and a C header"
    holds = (
        "tables CT(rpm, J), CP(rpm, J) and of the hub over rpm, J along and across the shaft, linear, held at the ends"
    )
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "density", "rest", "duct", "rotation", "hub"})
    source = "own format"

    def write(self, job: Job) -> Files:
        """Four files, of the same numbers; the table of the hub is a CSV of its own."""
        t, name = job.performance, plain_name(job.case.name)
        rows = [
            {
                "rpm": t.rpm[i],
                "airspeed_m_s": t.J[j] * t.rpm[i] / 60.0 * t.diameter_m,
                "J": t.J[j],
                "CT": t.CT[i, j],
                "CP": t.CP[i, j],
                "thrust_N": t.thrust_N[i, j],
                "torque_Nm": t.torque_Nm[i, j],
                "density_kg_m3": t.rho,
            }
            for i in range(t.rpm.size)
            for j in range(t.J.size)
        ]
        hub = _hub_rows(job)
        return {
            f"{name}.csv": csv_text(list(rows[0]), rows),
            f"{name}_hub.csv": csv_text(list(hub[0]), hub),
            f"{name}.json": json_text(table_document(job) | {"hub": hub_document(job.hub or still_hub())}),
            f"{name}.h": _c_header(job, name.lower()),
        }

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """The JSON, bilinear."""
        text = str(next(t for n, t in files.items() if n.endswith(".json")))
        return table_of_document(json.loads(text), rpm, airspeed_m_s)

    def hub_loads(self, files: Files, rpm: Array, airspeed_m_s: Array, side_m_s: Array) -> Array:
        """The JSON, linear in each axis."""
        doc = json.loads(str(next(t for n, t in files.items() if n.endswith(".json"))))
        found = hub_loads(doc["hub"], doc["density_kg_m3"], doc["diameter_m"], rpm, airspeed_m_s, side_m_s)
        found[:2] += table_of_document(doc, rpm, airspeed_m_s)
        return found


def _hub_rows(job: Job) -> list[dict[str, float]]:
    """The table of the hub, a row per node, with airspeed and angle between wind and shaft."""
    t, hub = job.performance, job.hub or still_hub()
    nodes = np.array([v.ravel() for v in np.meshgrid(hub.rpm, hub.J, hub.side, indexing="ij")])
    speed = np.hypot(nodes[1], nodes[2]) * nodes[0] / 60.0 * t.diameter_m
    angle = np.degrees(np.arctan2(nodes[2], nodes[1]))
    columns = [*nodes, speed, angle, *hub.values.reshape(6, -1)]
    names = ("rpm", "J_axial", "J_side", "airspeed_m_s", "angle_deg", *COEFFICIENTS)
    return [dict(zip(names, map(float, row), strict=True)) for row in zip(*columns, strict=True)]


def _c_header(job: Job, p: str) -> str:
    t, P = job.performance, p.upper()

    def row(values: Array) -> str:
        return "{" + ", ".join(f"{v:.10e}" for v in values) + "}"

    lines = [f"/* {line} */" for line in header(job, "Propeller table")]
    lines += [
        f"#ifndef {P}_TABLE_H",
        f"#define {P}_TABLE_H",
        f"#define {P}_DIAMETER_M {t.diameter_m:.12g}",
        f"#define {P}_DENSITY_KG_M3 {t.rho:.12g}",
        f"#define {P}_SENSE {t.sense} /* +1 right-handed: the reaction on the vehicle is -SENSE x torque */",
        f"#define {P}_N_RPM {t.rpm.size}",
        f"#define {P}_N_J {t.J.size}",
        f"static const double {p}_rpm[{t.rpm.size}] = {row(t.rpm)};",
        f"static const double {p}_J[{t.J.size}] = {row(t.J)};",
    ]
    for name, C in (("CT", t.CT), ("CP", t.CP)):
        body = ",\n ".join(row(values) for values in C)
        lines.append(f"static const double {p}_{name}[{t.rpm.size}][{t.J.size}] = {{\n {body}}};")
    hub = job.hub or still_hub()
    for name, word, axis in (("rpm", "RPM", hub.rpm), ("J", "J", hub.J), ("side", "SIDE", hub.side)):
        lines.append(f"#define {P}_HUB_N_{word} {axis.size}")
        lines.append(f"static const double {p}_hub_{name}[{axis.size}] = {row(axis)};")
    blocks = ",\n ".join(
        "{" + ",\n  ".join("{" + ",\n   ".join(map(row, plane)) + "}" for plane in block) + "}" for block in hub.values
    )
    sizes = "".join(f"[{n}]" for n in hub.values.shape)
    lines.append(f"static const double {p}_hub{sizes} = {{\n {blocks}}};")
    lines.insert(lines.index(f"#define {P}_TABLE_H") + 1, "#include <math.h>")
    return "\n".join(lines) + (_LOOKUP + _WRENCH).format(p=p, P=P) + f"#endif /* {P}_TABLE_H */\n"
