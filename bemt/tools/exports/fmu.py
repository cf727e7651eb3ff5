"""FMU: the table as a co-simulation unit (FMI 2.0)."""

from __future__ import annotations

import hashlib
import json
import tempfile
from pathlib import Path

from bemt.base.arrays import Array
from bemt.tools.exports.base import Files, Job, LoadsExport
from bemt.tools.exports.parts import plain_name, run_hub, run_module, table_document, table_module

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


class FmuExport(LoadsExport):
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

    def notes(self, job: Job) -> list[str]:
        """What the unit needs."""
        return ["the FMU holds Python code: where it runs, Python and pythonfmu must be installed"]

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """The lookup in the unit's source."""
        text = str(next(t for n, t in files.items() if n.endswith("_fmu.py")))
        return run_module(text.split("\nfrom xml")[0], rpm, airspeed_m_s)

    def hub_loads(self, files: Files, rpm: Array, airspeed_m_s: Array, side_m_s: Array) -> Array:
        """The lookup in the unit's source."""
        text = str(next(t for n, t in files.items() if n.endswith("_fmu.py")))
        return run_hub(text.split("\nfrom xml")[0], rpm, airspeed_m_s, side_m_s)
