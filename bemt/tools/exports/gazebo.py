"""Gazebo: the motor model of a multicopter's rotor."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.exports.base import Files, Job, LoadsExport
from bemt.tools.exports.parts import edgewise, header, inertia_estimate, plain_name, slope, static_fit


class GazeboExport(LoadsExport):
    """The plugin block of gz-sim; the older gazebo plugins take the same constants."""

    id = "gazebo"
    title = "Gazebo multicopter motor model (SDF)"
    holds = (
        "T = motorConstant W^2, Q = momentConstant T, H = rotorDragCoefficient W V_xy, roll moment "
        "rollingMomentCoefficient W V_xy; no airspeed, density baked in"
    )
    features = frozenset({"torque", "rest", "rotation", "hub"})
    conventions = "motorConstant in N/(rad/s)^2, momentConstant Q/T in m; turningDirection ccw seen from above"
    source = "gz-sim MulticopterMotorModel.cc; rotors_simulator gazebo_motor_model.cpp"

    def write(self, job: Job) -> Files:
        """SDF model of a stand whose plugin is fitted at rest."""
        job = self.asked(job)
        t, name = job.performance, plain_name(job.case.name)
        (kT, kQ), izz = static_fit(t), inertia_estimate(job)
        drag, roll = _fit_hub(job)
        comment = "\n".join(f"<!-- {line.replace('--', '-')} -->" for line in header(job, "Gazebo motor model"))
        text = f"""<?xml version="1.0"?>
{comment}
<!-- a stand: move the plugin into your vehicle and set motorNumber, joint, link, topic and time constants -->
<sdf version="1.9">
 <model name="{name}_stand">
  <link name="base"><inertial><mass>1</mass></inertial></link>
  <link name="rotor_0">
   <inertial>
    <mass>0.01</mass>
    <inertia><ixx>{izz:.6g}</ixx><iyy>{izz:.6g}</iyy><izz>{izz:.6g}</izz></inertia>
   </inertial>
  </link>
  <joint name="rotor_0_joint" type="revolute">
   <parent>base</parent><child>rotor_0</child><axis><xyz>0 0 1</xyz></axis>
  </joint>
  <plugin filename="gz-sim-multicopter-motor-model-system" name="gz::sim::systems::MulticopterMotorModel">
   <jointName>rotor_0_joint</jointName>
   <linkName>rotor_0</linkName>
   <turningDirection>{"ccw" if t.sense > 0 else "cw"}</turningDirection>
   <maxRotVelocity>{t.rpm[-1] * np.pi / 30.0:.9g}</maxRotVelocity>
   <motorConstant>{kT:.12e}</motorConstant>
   <momentConstant>{kQ / kT:.12e}</momentConstant>
   <rotorDragCoefficient>{drag:.12e}</rotorDragCoefficient>
   <rollingMomentCoefficient>{t.sense * roll:.12e}</rollingMomentCoefficient>
   <motorType>velocity</motorType>
  </plugin>
 </model>
</sdf>
"""
        return {f"{name}_motor.sdf": text}

    def notes(self, job: Job) -> list[str]:
        """What this model class leaves out."""
        return [
            "base, rotor link and joint are a stand: the plugin is what goes into your vehicle",
            "the constants hold at rest; thrust does not fall with airspeed here: see fit_error_pct.thrust.flight",
            "rotorDragCoefficient and rollingMomentCoefficient are fitted in edgewise flow up to the airspeed of zero "
            "thrust; pitch moment, side force and the gain of thrust across the shaft are not in this model",
            "the plugin's rolling moment does not know the direction of rotation: the sign of its coefficient is that "
            "of this rotor, negative for a left-handed one; on a vehicle whose rotors turn both ways it cancels",
            "a right-handed propeller turns clockwise seen from behind, which is from below on a multicopter: ccw from "
            "above; check turningDirection with the axis of your joint",
            "the plugin of PX4's gazebo-classic also fades thrust with airspeed by a rule of its own (1 - V/25)",
        ]

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """Motor model at speed W, whatever the airspeed."""
        root = ET.fromstring(str(next(iter(files.values()))))
        k, m = (float(root.findtext(f".//{key}") or "nan") for key in ("motorConstant", "momentConstant"))
        T = k * (rpm * np.pi / 30.0) ** 2
        return T, m * T

    def hub_loads(self, files: Files, rpm: Array, airspeed_m_s: Array, side_m_s: Array) -> Array:
        """Motor model with a wind across the shaft; without side force and pitch moment."""
        root = ET.fromstring(str(next(iter(files.values()))))
        drag, roll = (
            float(root.findtext(f".//{key}") or "nan") for key in ("rotorDragCoefficient", "rollingMomentCoefficient")
        )
        T, Q = self.loads(files, rpm, airspeed_m_s)
        sense = 1.0 if root.findtext(".//turningDirection") == "ccw" else -1.0
        reach, none = rpm * np.pi / 30.0 * side_m_s, np.full(rpm.shape, np.nan)
        return np.array([T, Q, drag * reach, none, sense * roll * reach, none])


def _fit_hub(job: Job) -> tuple[float, float]:
    """Coefficients of H and of the roll moment by least squares in edgewise flow, relative to the load at rest."""
    if job.hub is None:
        return 0.0, 0.0
    rpm, V, loads = edgewise(job)
    rest = job.performance.lookup(rpm, 0.0 * rpm)[0]
    reach = rpm * np.pi / 30.0 * V / rest
    return slope(reach, loads[2] / rest), slope(reach, loads[4] / rest)
