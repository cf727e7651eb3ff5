"""The whole table of thrust and torque: CSV, JSON, a C header with its lookup; and the same as an FMU."""

from __future__ import annotations

import hashlib
import json
import tempfile
from pathlib import Path

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
    run_hub,
    run_module,
    still_hub,
    table_document,
    table_module,
    table_of_document,
    written,
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
                "rpm": t.rpm[i], "airspeed_m_s": t.J[j] * t.rpm[i] / 60.0 * t.diameter_m, "J": t.J[j],
                "CT": t.CT[i, j], "CP": t.CP[i, j], "thrust_N": t.thrust_N[i, j], "torque_Nm": t.torque_Nm[i, j],
                "density_kg_m3": t.rho,
            }
            for i in range(t.rpm.size)
            for j in range(t.J.size)
        ]  # fmt: skip
        hub = _hub_rows(job)
        return {
            f"{name}.csv": csv_text(list(rows[0]), rows),
            f"{name}_hub.csv": csv_text(list(hub[0]), hub),
            f"{name}.json": json_text(table_document(job) | {"hub": hub_document(job.hub or still_hub())}),
            f"{name}.h": _c_header(job, name.lower()),
        }

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """The JSON, bilinear."""
        return table_of_document(json.loads(written(files, ".json")), rpm, airspeed_m_s)

    def hub_loads(self, files: Files, rpm: Array, airspeed_m_s: Array, side_m_s: Array) -> Array:
        """The JSON, linear in each axis."""
        doc = json.loads(written(files, ".json"))
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


class ModuleExport(LoadsExport):
    """A target that looks the tables up in Python: the lookup in its one ``.py`` is what is checked."""

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """The written Python, run."""
        return run_module(_lookup(files), rpm, airspeed_m_s)

    def hub_loads(self, files: Files, rpm: Array, airspeed_m_s: Array, side_m_s: Array) -> Array:
        """The written Python, run."""
        return run_hub(_lookup(files), rpm, airspeed_m_s, side_m_s)


def _lookup(files: Files) -> str:
    """Python of the tables without what other packages build on it."""
    return written(files, ".py").split("\nfrom xml")[0]


# FMU: the table as a co-simulation unit (FMI 2.0).

_SLAVE = '''

from xml.etree.ElementTree import Element, SubElement

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real


UNITS = {{
    "rpm": ("rev/min", {{"s": "-1", "rad": "1", "factor": "0.10471975511965977"}}, "speed of rotation"),
    "airspeed_m_s": ("m/s", {{"m": "1", "s": "-1"}}, "axial speed through the air, along the thrust"),
    "velocity_x_m_s": ("m/s", {{"m": "1", "s": "-1"}}, "velocity through the air across the shaft, x; z is the thrust"),
    "velocity_y_m_s": ("m/s", {{"m": "1", "s": "-1"}}, "velocity through the air across the shaft, y"),
    "density_kg_m3": ("kg/m3", {{"kg": "1", "m": "-3"}}, "air density"),
    "thrust_N": ("N", {{"kg": "1", "m": "1", "s": "-2"}}, "thrust"),
    "torque_Nm": ("N.m", {{"kg": "1", "m": "2", "s": "-2"}}, "shaft torque; the vehicle gets -sense of it"),
    "force_x_N": ("N", {{"kg": "1", "m": "1", "s": "-2"}}, "force on the vehicle across the shaft, x"),
    "force_y_N": ("N", {{"kg": "1", "m": "1", "s": "-2"}}, "force on the vehicle across the shaft, y"),
    "moment_x_Nm": ("N.m", {{"kg": "1", "m": "2", "s": "-2"}}, "moment of the hub on the vehicle about x"),
    "moment_y_Nm": ("N.m", {{"kg": "1", "m": "2", "s": "-2"}}, "moment of the hub on the vehicle about y"),
}}
INPUTS = ("rpm", "airspeed_m_s", "velocity_x_m_s", "velocity_y_m_s", "density_kg_m3")


class {name}(Fmi2Slave):
    """Inputs rpm, velocity through the air, density; outputs thrust, torque, force and moment across the shaft."""

    author = "bemt"
    description = "propeller table, {rotation}"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        for word in UNITS:
            setattr(self, word, DENSITY if word == "density_kg_m3" else 0.0)
        self.sense = SENSE
        for word, (_, _, what) in UNITS.items():
            kind = Fmi2Causality.input if word in INPUTS else Fmi2Causality.output
            self.register_variable(
                Real(word, causality=kind, variability=Fmi2Variability.continuous, description=what))
        self.register_variable(Integer("sense", causality=Fmi2Causality.output, variability=Fmi2Variability.constant,
                                       description="+1 right-handed, clockwise seen from behind; -1 left-handed"))

    def to_xml(self, model_options=dict()):
        """Description of the model with the units and initial unknowns that pythonfmu leaves out."""
        root = super().to_xml(model_options)
        definitions = Element("UnitDefinitions")
        for name in dict.fromkeys(unit for unit, _, _ in UNITS.values()):
            base = next(base for unit, base, _ in UNITS.values() if unit == name)
            SubElement(SubElement(definitions, "Unit", name=name), "BaseUnit", base)
        root.insert(list(root).index(root.find("CoSimulation")) + 1, definitions)
        for variable in root.iter("ScalarVariable"):
            if variable.get("name") in UNITS:
                variable.find("Real").set("unit", UNITS[variable.get("name")][0])
        unknowns = SubElement(root.find("ModelStructure"), "InitialUnknowns")
        for index, variable in enumerate(root.iter("ScalarVariable"), 1):
            if variable.get("causality") == "output" and variable.get("variability") != "constant":
                SubElement(unknowns, "Unknown", index=str(index))
        return root

    def exit_initialization_mode(self):
        self.do_step(0.0, 0.0)

    def do_step(self, current_time, step_size):
        velocity = self.velocity_x_m_s, self.velocity_y_m_s, self.airspeed_m_s
        force, moment = wrench(self.rpm, velocity, self.density_kg_m3)
        self.force_x_N, self.force_y_N, self.thrust_N = force
        self.moment_x_Nm, self.moment_y_Nm = moment[:2]
        self.torque_Nm = -SENSE * moment[2]
        return True
'''


class FmuExport(ModuleExport):
    """A functional mock-up unit by pythonfmu."""

    id = "fmu"
    title = "FMU, FMI 2.0 co-simulation"
    holds = "tables CT(J, rpm), CP(J, rpm) and of the hub over J along and across the shaft in Python; density an input"
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "density", "rest", "duct", "rotation", "hub"})
    conventions = (
        "inputs rpm [rev/min], airspeed_m_s (z, along the thrust), velocity_x_m_s, velocity_y_m_s, density_kg_m3; "
        "outputs thrust_N, torque_Nm, force_x_N, force_y_N, moment_x_Nm, moment_y_Nm, sense; loads follow each step"
    )
    source = "pythonfmu 0.7; the machine that runs the FMU needs Python with pythonfmu"
    needs = ("pythonfmu",)
    told = ("the FMU holds Python code: where it runs, Python and pythonfmu must be installed",)

    def write(self, job: Job) -> Files:
        """The FMU and its source."""
        from pythonfmu.builder import FmuBuilder

        name = plain_name(job.case.name)
        text = table_module(job, "FMU of a propeller") + _SLAVE.format(name=name, rotation=job.rotation)
        with tempfile.TemporaryDirectory() as folder:
            # two units with modules of one name in one process would share the tables of the first
            script = Path(folder) / f"{name}_{hashlib.sha256(text.encode()).hexdigest()[:12]}.py"
            script.write_text(text, encoding="utf-8")
            FmuBuilder.build_FMU(script, dest=folder)
            made = next(Path(folder).glob("*.fmu"))
            return {
                f"{name}.fmu": made.read_bytes(),
                f"{name}_fmu.py": text,
                f"{name}_fmu.json": json.dumps(table_document(job)) + "\n",
            }
