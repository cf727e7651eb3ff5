"""FMU: the table as a co-simulation unit (FMI 2.0)."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bemt.exports.base import Files, Job, LoadsExport
from bemt.exports.parts import plain_name, run_module, table_document, table_module

Array = NDArray[np.float64]

_SLAVE = '''

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class {name}(Fmi2Slave):
    """Inputs rpm, airspeed, density; outputs thrust, torque."""

    author = "bemt"
    description = "propeller table"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.rpm = 0.0
        self.airspeed_m_s = 0.0
        self.density_kg_m3 = DENSITY
        self.thrust_N = 0.0
        self.torque_Nm = 0.0
        for word in ("rpm", "airspeed_m_s", "density_kg_m3"):
            self.register_variable(Real(word, causality=Fmi2Causality.input, variability=Fmi2Variability.continuous))
        for word in ("thrust_N", "torque_Nm"):
            self.register_variable(Real(word, causality=Fmi2Causality.output, variability=Fmi2Variability.continuous))

    def do_step(self, current_time, step_size):
        self.thrust_N, self.torque_Nm = loads(self.rpm, self.airspeed_m_s, self.density_kg_m3)
        return True
'''


class FmuExport(LoadsExport):
    """A functional mock-up unit by pythonfmu."""

    id = "fmu"
    title = "FMU, FMI 2.0 co-simulation"
    holds = "table CT(J, rpm), CP(J, rpm) in Python; density is an input"
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "density", "rest", "duct"})
    conventions = (
        "inputs rpm [rev/min], airspeed_m_s, density_kg_m3; outputs thrust_N, torque_Nm; loads follow at each step"
    )
    source = "pythonfmu 0.7; the machine that runs the FMU needs Python with pythonfmu"
    needs = ("pythonfmu",)

    def write(self, job: Job) -> Files:
        """The FMU and its source."""
        from pythonfmu.builder import FmuBuilder

        name = plain_name(job.case.name)
        text = table_module(job, "FMU of a propeller") + _SLAVE.format(name=name)
        with tempfile.TemporaryDirectory() as folder:
            script = Path(folder) / f"{name}_fmu.py"
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
        return run_module(text.split("\nfrom pythonfmu")[0], rpm, airspeed_m_s)
