"""Plain tables: CSV, JSON, and a C header with its lookup."""

from __future__ import annotations

import json

import numpy as np
from numpy.typing import NDArray

from bemt.base.tables import csv_text, json_text
from bemt.exports.base import Files, Job, LoadsExport
from bemt.exports.parts import header, plain_name, table_document, table_of_document

Array = NDArray[np.float64]

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


class TableExport(LoadsExport):
    """The numbers themselves, for any program."""

    id = "table"
    title = "tables as CSV, JSON and a C header"
    holds = "tables CT(rpm, J), CP(rpm, J), linear, held at the ends"
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "density", "rest", "duct", "rotation"})
    source = "own format"

    def write(self, job: Job) -> Files:
        """Three files with the same numbers."""
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
        return {
            f"{name}.csv": csv_text(list(rows[0]), rows),
            f"{name}.json": json_text(table_document(job)),
            f"{name}.h": _c_header(job, name.lower()),
        }

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """The JSON, bilinear."""
        text = str(next(t for n, t in files.items() if n.endswith(".json")))
        return table_of_document(json.loads(text), rpm, airspeed_m_s)


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
    return "\n".join(lines) + _LOOKUP.format(p=p, P=P) + f"#endif /* {P}_TABLE_H */\n"
