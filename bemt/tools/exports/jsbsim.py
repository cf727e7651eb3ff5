"""JSBSim: a propeller with its table over J and speed, on a stand that runs as it is."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import Any

import numpy as np

from bemt.base import plugins
from bemt.base.arrays import Array
from bemt.tools.exports.base import Files, Job, LoadsExport
from bemt.tools.exports.parts import COEFFICIENTS, header, hub_loads, inertia_estimate, plain_name, still_hub, written
from bemt.tools.exports.performance import table_loads

# The motor that turns the rotor of an exported model: that of the case's drive, else one as large as the rotor needs.
#
# A direct-current machine behind a battery, as in `bemt.tools.drive.drive_model`: at the duty d and the EMF E = n /
# K_v,
#
#     I = (d V - E) / (R + d^2 R_b),  Q = k (I - I_0),  k = 30 / (pi K_v)
#
# Programs have one resistance, so d is passed on as d' = (E + R I) / V, which is the same current without R_b.

STAND_IN_V = 14.8
"""Voltage of the motor that stands in: any would do, for its current follows from the rotor's power [V]."""
DROP, IDLE = 0.20, 0.073
"""Shares of voltage and current that it loses at full throttle: medians of 859 and 1088 recorded motors with a
propeller, see `bemt.rotors.case.drive_schema` [1]."""
STAND_IN_INERTIA = 0.3
"""Inertia of that motor over the rotor's, as `drive` takes it [1]."""


@dataclass(frozen=True)
class JsbsimMotor:
    """Motor, controller and battery of one rotor, and the inertia of what turns."""

    kv_rpm_V: float
    volts: float  # At no load [V]
    ohm: float  # Of winding, controller and leads [ohm]
    battery_ohm: float
    no_load_A: float
    exponent: float  # Duty is throttle to this power [1]
    limit_A: float | None  # Of the battery's current
    inertia_kg_m2: float  # Of motor and rotor together
    known: bool  # Whether the case says which motor it is

    @property
    def k(self) -> float:
        """Torque per current. [N m/A]"""
        return 30.0 / (math.pi * self.kv_rpm_V)

    def duty(self, throttle: Array, rpm: Array) -> Array:
        """Duty at a throttle, below the limit of the current [1]."""
        d, emf = np.asarray(throttle, dtype=float) ** self.exponent, np.asarray(rpm, dtype=float) / self.kv_rpm_V
        if self.limit_A is None:
            return d
        rest = self.volts - self.limit_A * self.battery_ohm  # d I(d) = limit, a quadratic in d
        most = (emf + np.sqrt(emf**2 + 4.0 * rest * self.limit_A * self.ohm)) / (2.0 * rest)
        return np.minimum(d, most)

    def torque(self, throttle: Array, rpm: Array) -> Array:
        """Torque on the shaft, above the friction [N m]."""
        d = self.duty(throttle, rpm)
        amps = (d * self.volts - np.asarray(rpm) / self.kv_rpm_V) / (self.ohm + d**2 * self.battery_ohm)
        return np.asarray(self.k * (amps - self.no_load_A))

    def throttle_for(self, rpm: float, torque_Nm: float) -> float:
        """Throttle that holds a speed against a torque, NaN where none does [1]."""
        amps, emf = torque_Nm / self.k + self.no_load_A, rpm / self.kv_rpm_V
        # d^2 R_b I - d V + E + R I = 0, the smaller root
        root = self.volts**2 - 4.0 * self.battery_ohm * amps * (emf + self.ohm * amps)
        d = 2.0 * (emf + self.ohm * amps) / (self.volts + math.sqrt(root)) if root >= 0.0 else math.nan
        return d ** (1.0 / self.exponent) if 0.0 <= d <= 1.0 else math.nan

    def largest_step_s(self, job: Job) -> float:
        """Step of an explicit Euler that settles without overshoot at any speed up to full throttle [s]."""
        t = job.performance
        W, Q = t.rpm * math.pi / 30.0, t.torque_Nm[:, t.at_rest]
        steepest = float(np.max(np.gradient(Q, W)))
        return self.inertia_kg_m2 / (self.k**2 / self.ohm + steepest)


def motor_of(job: Job) -> JsbsimMotor:
    """Motor of the case's drive; without one, a motor that turns the rotor at the greatest speed of the tables."""
    t, blades = job.performance, inertia_estimate(job)
    c: Any = plugins.part("circuit", job.case)
    if c is not None:
        rotor = blades if c.rotor_inertia_kg_m2 is None else c.rotor_inertia_kg_m2
        return JsbsimMotor(c.kv_rpm_V, c.volts, c.ohm, c.battery_ohm, c.no_load_A, c.exponent, c.limit_A,
                           rotor + c.motor_inertia_kg_m2, True)  # fmt: skip
    kv = float(t.rpm[-1]) / (STAND_IN_V * (1.0 - DROP))
    amps = float(t.torque_Nm[-1, t.at_rest]) * math.pi * kv / 30.0 / (1.0 - IDLE)
    return JsbsimMotor(kv, STAND_IN_V, DROP * STAND_IN_V / amps, 0.0, IDLE * amps, 1.0, None,
                 (1.0 + STAND_IN_INERTIA) * blades, False)  # fmt: skip


SMALLEST_INERTIA = 1.4e-6
"""JSBSim raises what is smaller. [kg m2]"""
STEP = 1.0 / 120.0
"""JSBSim's own step, by explicit Euler for the speed of a propeller (FGPropeller.cpp, Calculate) [s]"""


def _inertia(job: Job) -> tuple[float, float]:
    """Inertia of rotor and motor that settles at JSBSim's own step, and as it is [kg m2]."""
    m = motor_of(job)
    return max(m.inertia_kg_m2 * max(STEP / m.largest_step_s(job), 1.0), SMALLEST_INERTIA), m.inertia_kg_m2


class JsbsimExport(LoadsExport):
    """A JSBSim root folder: engine, propeller, the system that passes on the speed, an aircraft that is a stand."""

    id = "jsbsim"
    title = "JSBSim propeller with a stand"
    holds = (
        "tables CT(J, rpm), CP(J, rpm), and of the hub over J along and across the shaft as external reactions, "
        "linear, held at the ends; density of the simulation"
    )
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "density", "rest", "rotation", "hub"})
    conventions = (
        "C_THRUST = T/(rho n^2 D^4), C_POWER = P/(rho n^3 D^5), J = V/(n D); sense in the thruster of "
        "the aircraft, +1 clockwise seen from behind; "
        "the column of a table is rpm/1000, passed on as blade-angle by the system file; what a wind across the shaft "
        "adds acts as external reactions in BODY axes, thrust along x"
    )
    source = (
        "JSBSim 1.3 FGPropeller.cpp: GetThrust, GetPowerRequired; blade-angle is free with constspeed 0; "
        "FGExternalReactions.h: force and moment with a function"
    )

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
 <ixx unit="KG*M2"> {_inertia(job)[0]:.6g} </ixx>
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
        m = motor_of(job)
        motor = f"""<?xml version="1.0"?>
{head}
<brushless_dc_motor name="{name}_motor">
 <maxvolts unit="VOLTS"> {m.volts:.9g} </maxvolts>
 <velocityconstant> {m.kv_rpm_V:.9g} </velocityconstant>
 <coilresistance unit="OHMS"> {m.ohm:.9g} </coilresistance>
 <noloadcurrent unit="AMPERES"> {m.no_load_A:.9g} </noloadcurrent>
</brushless_dc_motor>
"""
        system = f"""<?xml version="1.0"?>
<system name="{name}_speed">
 <channel name="Speed of the propeller as column of its tables">
  <fcs_function name="fcs/{name}-krpm">
   <function><quotient><property>propulsion/engine[0]/propeller-rpm</property><value>1000.0</value></quotient></function>
   <output>propulsion/engine[0]/blade-angle</output>
  </fcs_function>
 </channel>
{_motor_channel(m, name)}
{_hub_channel(job, name)}
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
        m, (used, own) = motor_of(job), _inertia(job)
        step = m.largest_step_s(job) * used / m.inertia_kg_m2
        whose = "is the case's drive, at the stated charge and 25 C" if m.known else (
            f"stands in, for the case has no [drive]: it turns the rotor at {job.performance.rpm[-1]:.6g} rev/min at "
            "full throttle and rest, and loses what motors lose in the median"
        )  # fmt: skip
        raised = "" if used <= own else f", raised from {own:.3g} so that JSBSim's own step of 1/120 s holds"
        return [
            f"the motor {whose}; the system file takes the battery's resistance and the current limit off the throttle",
            f"ixx is {used:.3g} kg m2 of blades and motor{raised}; steps up to {1e3 * step:.3g} ms settle without "
            "overshoot from rest at full throttle",
            "the system file serves engine 0; repeat it for others",
            "sense stands in the thruster element of the aircraft file, where JSBSim reads it: take it into yours",
            "a stopped propeller (0 rev/min) has neither thrust nor drag in JSBSim",
            "the external reactions of the aircraft file carry what a wind across the shaft adds: take them into "
            "yours, with the location of the propeller; its shaft along body x; the shaft power stays that of axial "
            "flow",
            "tip Mach number changes with speed at the air of the table only",
        ]

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """Tables of the propeller file, bilinear, at the density that the head states."""
        text = written(files, "_propeller.xml")
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

    def hub_loads(self, files: Files, rpm: Array, airspeed_m_s: Array, side_m_s: Array) -> Array:
        """Tables of the propeller and the system file, at the density that the head states."""
        text = written(files, "_propeller.xml")
        rho, D = float(text.split("density ")[1].split()[0]), float(ET.fromstring(text).findtext("diameter") or "nan")
        root = ET.fromstring(written(files, "_speed.xml"))
        doc: dict[str, Any] = {}
        for node in root.iter("table"):
            blocks = node.findall("tableData")
            rows = [[line.split() for line in (b.text or "").strip().splitlines()] for b in blocks]
            doc["rpm"] = [1000.0 * float(b.get("breakPoint") or "nan") for b in blocks]
            doc["J_side"] = [float(v) for v in rows[0][0]]
            doc["J_axial"] = [float(line[0]) for line in rows[0][1:]]
            doc[str(node.get("name"))] = [[[float(v) for v in line[1:]] for line in block[1:]] for block in rows]
        found = hub_loads(doc, rho, D, rpm, airspeed_m_s, side_m_s)
        found[:2] += self.loads(files, rpm, airspeed_m_s)
        return found


_LBS, _LBSFT, _FT, _SLUGS = 4.4482216152605, 1.3558179483314, 0.3048, 515.378818  # N, N m, m, kg/m3 in one of them
_AXES = (("x", 0), ("y", 1), ("z", 2))


def _function(name: str, word: str, body: str, output: str = "") -> str:
    out = f"<output>{output}</output>" if output else ""
    return f'  <fcs_function name="fcs/{name}-{word}"><function>\n{body}\n  </function>{out}</fcs_function>'


def _value(number: float) -> str:
    return f"<value>{number:.12g}</value>"


def _product(*parts: str) -> str:
    return f"<product>{''.join(parts)}</product>"


def _sum(*parts: str) -> str:
    return f"<sum>{''.join(parts)}</sum>"


def _motor_channel(m: JsbsimMotor, name: str) -> str:
    """Channel of the system file: throttle with the battery's resistance and the current limit, see `motor`."""
    emf = f"<quotient><property>propulsion/engine[0]/propeller-rpm</property>{_value(m.kv_rpm_V)}</quotient>"
    duty = f"<pow><property>fcs/throttle-cmd-norm[0]</property>{_value(m.exponent)}</pow>"
    if m.limit_A is not None:
        rest = m.volts - m.limit_A * m.battery_ohm
        root = f"<sqrt>{_sum(_product(emf, emf), _value(4.0 * rest * m.limit_A * m.ohm))}</sqrt>"
        duty = f"<min>{duty}<quotient>{_sum(emf, root)}{_value(2.0 * rest)}</quotient></min>"
    d = f"<property>fcs/{name}-duty</property>"
    drop = f"<difference>{_product(_value(m.volts), d)}{emf}</difference>"
    in_all = _sum(_value(m.ohm), _product(_value(m.battery_ohm), d, d))
    used = _sum(emf, f"<quotient>{_product(_value(m.ohm), drop)}{in_all}</quotient>")
    body = [
        _function(name, "duty", duty),
        _function(name, "motor-share", f"<quotient>{used}{_value(m.volts)}</quotient>", "fcs/throttle-pos-norm[0]"),
    ]
    return ' <channel name="Motor behind its battery">\n' + "\n".join(body) + "\n </channel>"


def _hub_channel(job: Job, name: str) -> str:
    """Channel of the system file: what a wind across the shaft adds, in BODY axes, thrust along x."""
    t, hub = job.performance, job.hub or still_hub()

    def of(word: str) -> str:
        return f"<property>fcs/{name}-{word}</property>"

    def table(word: str, values: Array) -> str:
        blocks = []
        for n, plane in zip(hub.rpm, values, strict=True):
            rows = "\n".join(
                f"{j:.10g} " + " ".join(f"{v:.10g}" for v in row) for j, row in zip(hub.J, plane, strict=True)
            )
            head = " ".join(f"{v:.10g}" for v in hub.side)
            blocks.append(f'<tableData breakPoint="{n / 1000.0:.9g}">\n{head}\n{rows}\n</tableData>')
        keys = "".join(
            f'<independentVar lookup="{lookup}">fcs/{name}-{key}</independentVar>'
            for lookup, key in (("row", "J-axial"), ("column", "J-side"), ("table", "krpm"))
        )
        return f'<table name="{word}">{keys}\n' + "\n".join(blocks) + "\n</table>"

    u, v, w = (f"<property>velocities/{axis}-aero-fps</property>" for axis in "uvw")
    rev = f"<max>{of('krpm')}{_value(1e-6)}</max>"
    per_speed = _FT * 60.0 / (1000.0 * t.diameter_m)  # advance ratio of 1 ft/s at 1000 rev/min
    rho = "<property>atmosphere/rho-slugs_ft3</property>"
    force = _SLUGS * (1000.0 / 60.0) ** 2 * t.diameter_m**4 / _LBS
    across = f"<sqrt>{_sum(_product(v, v), _product(w, w))}</sqrt>"
    parts = [
        _function(name, "J-axial", f"<quotient>{_product(_value(per_speed), u)}{rev}</quotient>"),
        _function(name, "side-fps", across),
        _function(name, "J-side", f"<quotient>{_product(_value(per_speed), of('side-fps'))}{rev}</quotient>"),
        *(_function(name, f"u{axis}", f"<quotient>{speed}<max>{of('side-fps')}{_value(1e-9)}</max></quotient>")
          for axis, speed in (("y", v), ("z", w))),
        _function(name, "force-scale", _product(_value(force), rho, of("krpm"), of("krpm"))),
        *(_function(name, word, table(word, values)) for word, values in zip(COEFFICIENTS, hub.values, strict=True)),
    ]  # fmt: skip
    D, s = t.diameter_m * _LBS / _LBSFT, float(t.sense)
    uy, uz = of("uy"), of("uz")
    minus = _value(-1.0)
    forces = {
        "x": of("dCT"),
        "y": _sum(_product(minus, of("CH"), uy), _product(_value(s), of("CY"), uz)),
        "z": _sum(_product(minus, of("CH"), uz), _product(_value(-s), of("CY"), uy)),
    }
    moments = {
        "x": _product(_value(-s / (2.0 * np.pi)), of("dCP")),
        "y": _sum(_product(_value(-s), of("CMroll"), uy), _product(of("CMpitch"), uz)),
        "z": _sum(_product(_value(-s), of("CMroll"), uz), _product(minus, of("CMpitch"), uy)),
    }
    parts += [_function(name, f"force-{axis}-lbs", _product(of("force-scale"), body)) for axis, body in forces.items()]
    parts += [
        _function(name, f"moment-{axis}-lbsft", _product(_value(D), of("force-scale"), body))
        for axis, body in moments.items()
    ]
    body = "\n".join(parts)
    return f' <channel name="Loads of the hub with a wind across the shaft">\n{body}\n </channel>'


def _reactions(name: str) -> str:
    """External reactions of the aircraft file, which read the channel."""
    out = []
    for axis, i in _AXES:
        way = " ".join(f"<{a}> {int(k == i)} </{a}>" for a, k in _AXES)
        out.append(
            f'  <force name="{name}-hub-force-{axis}" frame="BODY">\n   <function><property>fcs/{name}-force-{axis}-lbs'
            "</property></function>\n"
            '   <location unit="M"> <x> 0 </x> <y> 0 </y> <z> 0 </z> </location>\n'
            f"   <direction> {way} </direction>\n  </force>"
        )
        out.append(
            f'  <moment name="{name}-hub-moment-{axis}" frame="BODY">\n   <function><property>'
            f"fcs/{name}-moment-{axis}-lbsft</property></function>\n   <direction> {way} </direction>\n  </moment>"
        )
    return "\n".join(out)


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
 <external_reactions>
{_reactions(name)}
 </external_reactions>
 <flight_control name="stand"/>
 <aerodynamics/>
</fdm_config>
"""
