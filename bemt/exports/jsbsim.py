"""JSBSim: a propeller with its table over J and speed, on a stand that runs as it is."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from bemt.exports.base import Files, Job, LoadsExport
from bemt.exports.parts import header, inertia_estimate, plain_name
from bemt.exports.performance import table_loads

Array = NDArray[np.float64]
SMALLEST_INERTIA = 1.4e-6
"""JSBSim raises what is smaller. [kg m2]"""


class JsbsimExport(LoadsExport):
    """A JSBSim root folder: engine, propeller, the system that passes on the speed, an aircraft that is a stand."""

    id = "jsbsim"
    title = "JSBSim propeller with a stand"
    holds = "tables CT(J, rpm), CP(J, rpm), linear, held at the ends; density of the simulation"
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "density", "rest", "rotation"})
    conventions = (
        "C_THRUST = T/(rho n^2 D^4), C_POWER = P/(rho n^3 D^5), J = V/(n D); sense in the thruster of "
        "the aircraft, +1 clockwise seen from behind; "
        "the column of a table is rpm/1000, passed on as blade-angle by the system file"
    )
    source = "JSBSim 1.3 FGPropeller.cpp: GetThrust, GetPowerRequired; blade-angle is free with constspeed 0"

    def write(self, job: Job) -> Files:
        """Root folder of JSBSim."""
        t, name = job.performance, plain_name(job.case.name)
        head = "\n".join(f"<!-- {line.replace('--', '-')} -->" for line in header(job, "JSBSim propeller"))

        def table(label: str, values: Array) -> str:
            columns = " ".join(f"{n / 1000.0:.9g}" for n in t.rpm)
            rows = "\n".join(
                f"{j:.10g} " + " ".join(f"{v:.10g}" for v in row) for j, row in zip(t.J, values.T, strict=True)
            )
            return (
                f' <table name="{label}" type="internal">\n  <tableData>\n{columns}\n{rows}\n  </tableData>\n </table>'
            )

        top = t.rpm[-1] / 1000.0
        propeller = f"""<?xml version="1.0"?>
{head}
<propeller name="{name}" version="1.1">
 <ixx unit="KG*M2"> {max(inertia_estimate(job), SMALLEST_INERTIA):.6g} </ixx>
 <diameter unit="M"> {t.diameter_m:.9g} </diameter>
 <numblades> {t.blades} </numblades>
 <gearratio> 1 </gearratio>
 <minpitch> 0 </minpitch>
 <maxpitch> {2.0 * top:.9g} </maxpitch>
 <constspeed> 0 </constspeed>
 <p_factor> 0 </p_factor>
{table("C_THRUST", t.CT)}
{table("C_POWER", t.CP)}
</propeller>
"""
        watts = 1.3 * float(np.max(t.torque_Nm[-1] * t.rpm[-1] * np.pi / 30.0))
        motor = f"""<?xml version="1.0"?>
<electric_engine name="{name}_motor">
 <power unit="WATTS"> {watts:.6g} </power>
</electric_engine>
"""
        system = f"""<?xml version="1.0"?>
<system name="{name}_speed">
 <channel name="Speed of the propeller as column of its tables">
  <fcs_function name="fcs/{name}-krpm">
   <function><quotient><property>propulsion/engine[0]/propeller-rpm</property><value>1000.0</value></quotient></function>
   <output>propulsion/engine[0]/blade-angle</output>
  </fcs_function>
 </channel>
</system>
"""
        return {
            f"engine/{name}_propeller.xml": propeller,
            f"engine/{name}_motor.xml": motor,
            f"systems/{name}_speed.xml": system,
            f"aircraft/{name}_stand/{name}_stand.xml": _stand(name, t.sense),
        }

    def notes(self, job: Job) -> list[str]:
        """What stands in for numbers that the case does not give."""
        return [
            "ixx is an estimate from the blades' sections at 1400 kg/m3, hub and motor left out: replace it",
            "the power of the motor is 1.3 times the greatest shaft power; it limits nothing below",
            "the system file serves engine 0; repeat it for others",
            "sense stands in the thruster element of the aircraft file, where JSBSim reads it: take it into yours",
            "a stopped propeller (0 rev/min) has neither thrust nor drag in JSBSim",
            "tip Mach number changes with speed at the air of the table only",
        ]

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """Tables of the propeller file, bilinear, at the density that the head states."""
        text = str(next(t for name, t in files.items() if name.endswith("_propeller.xml")))
        root = ET.fromstring(text)
        tables = {}
        for node in root.iter("table"):
            lines = [line.split() for line in (node.findtext("tableData") or "").strip().splitlines()]
            columns = np.array(lines[0], dtype=float)
            body = np.array(lines[1:], dtype=float)
            tables[node.get("name")] = (columns * 1000.0, body[:, 0], body[:, 1:].T)
        speeds, J, CT = tables["C_THRUST"]
        rho = float(text.split("density ")[1].split()[0])
        D = float(root.findtext("diameter") or "nan")
        return table_loads(speeds, J, CT, tables["C_POWER"][2], rho, D, rpm, airspeed_m_s)


def _stand(name: str, sense: int) -> str:
    """An aircraft that only carries the propeller; no aerodynamics, 1 kg."""
    return f"""<?xml version="1.0"?>
<fdm_config name="{name}_stand" version="2.0" release="BETA">
 <fileheader><description>A stand: one propeller on a kilogram, no aerodynamics</description></fileheader>
 <metrics>
  <wingarea unit="M2"> 1 </wingarea> <wingspan unit="M"> 1 </wingspan> <chord unit="M"> 1 </chord>
  <location name="AERORP" unit="M"> <x> 0 </x> <y> 0 </y> <z> 0 </z> </location>
 </metrics>
 <mass_balance>
  <ixx unit="KG*M2"> 1 </ixx> <iyy unit="KG*M2"> 1 </iyy> <izz unit="KG*M2"> 1 </izz>
  <emptywt unit="KG"> 1 </emptywt>
  <location name="CG" unit="M"> <x> 0 </x> <y> 0 </y> <z> 0 </z> </location>
 </mass_balance>
 <ground_reactions/>
 <propulsion>
  <engine file="{name}_motor">
   <thruster file="{name}_propeller">
    <sense> {sense} </sense>
    <location unit="M"> <x> 0 </x> <y> 0 </y> <z> 0 </z> </location>
    <orient unit="DEG"> <roll> 0 </roll> <pitch> 0 </pitch> <yaw> 0 </yaw> </orient>
   </thruster>
  </engine>
 </propulsion>
 <system file="{name}_speed"/>
 <flight_control name="stand"/>
 <aerodynamics/>
</fdm_config>
"""
