"""Simulators of vehicles: Gazebo, RotorPy, MuJoCo."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.exports.base import Files, Job, LoadsExport
from bemt.tools.exports.parts import (
    edgewise,
    fit_weight,
    header,
    inertia_estimate,
    plain_name,
    slope,
    static_fit,
    table_module,
)
from bemt.tools.exports.tables import ModuleExport


class GazeboExport(LoadsExport):
    """The plugin block of gz-sim; the older gazebo plugins take the same constants."""

    id = "gazebo"
    title = "Gazebo multicopter motor model (SDF; for ROS and ROS 2)"
    holds = (
        "T = motorConstant W^2, Q = momentConstant T, H = rotorDragCoefficient W V_xy, roll moment "
        "rollingMomentCoefficient W V_xy; no airspeed, density baked in"
    )
    features = frozenset({"torque", "rest", "rotation", "hub"})
    conventions = "motorConstant in N/(rad/s)^2, momentConstant Q/T in m; turningDirection ccw seen from above"
    source = "gz-sim MulticopterMotorModel.cc; rotors_simulator gazebo_motor_model.cpp"
    told = (
        "base, rotor link and joint are a stand: the plugin is what goes into your vehicle",
        "the constants are fitted at rest; thrust does not fall with airspeed: see fit_error_pct.thrust.flight",
        "rotorDragCoefficient and rollingMomentCoefficient are fitted in edgewise flow up to the airspeed of zero "
        "thrust; pitch moment, side force and the gain of thrust across the shaft are not in this model",
        "the plugin's rolling moment does not know the direction of rotation: the sign of its coefficient is that "
        "of this rotor, negative for a left-handed one; on a vehicle whose rotors turn both ways it cancels",
        "a right-handed propeller turns clockwise seen from behind, which is from below on a multicopter: ccw from "
        "above; check turningDirection with the axis of your joint",
        "the plugin of PX4's gazebo-classic also fades thrust with airspeed by a rule of its own (1 - V/25)",
    )

    def write(self, job: Job) -> Files:
        """SDF model of a stand whose plugin is fitted at rest."""
        job = self.asked(job)
        t, name = job.performance, plain_name(job.case.name)
        (kT, kQ), izz = static_fit(job.fitted), inertia_estimate(job)
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


# RotorPy: the rotor's entries of a vehicle's parameters.


def _rotor_params(files: Files) -> list[float]:
    """k_eta, k_z, k_m, k_d, k_h and k_flap that a written file sets."""
    space: dict[str, dict[str, float]] = {}
    exec(str(next(iter(files.values()))), {}, space)
    return [space["rotor_params"][key] for key in ("k_eta", "k_z", "k_m", "k_d", "k_h", "k_flap")]


class RotorpyExport(LoadsExport):
    """Six constants: thrust, torque, the loss of thrust with axial speed, and three of the wind across the shaft."""

    id = "rotorpy"
    title = "RotorPy rotor parameters"
    holds = (
        "T = k_eta W^2 - k_z W V + k_h V_xy^2 (CT linear in J, needs aero=True), Q = k_m W^2, H = k_d W V_xy, pitch "
        "moment -k_flap W V_xy; density baked in"
    )
    features = frozenset({"torque", "airspeed", "rest", "rotation", "hub"})
    conventions = (
        "N/(rad/s)^2, N m/(rad/s)^2, N/(rad/s)/(m/s); speeds in rad/s; V along the body's z; rotor_direction: the "
        "sign of the reaction about z (up)"
    )
    source = "rotorpy 3.0 vehicles/multirotor.py, compute_body_wrench"

    def write(self, job: Job) -> Files:
        """Parameters from least squares of T and Q, from rest to zero thrust, each relative to the load at rest."""
        job = self.asked(job)
        t = job.performance
        k_eta, k_z, k_m = _fit(job)
        k_d, k_h, k_flap = _rotorpy_hub(job)
        name = plain_name(job.case.name)
        head = "\n".join(f"# {line}" for line in header(job, "RotorPy rotor"))
        text = f"""{head}
# Update quad_params of a vehicle with this; tau_m is not in the case.
# Multirotor(..., aero=True), else k_z, k_d, k_h and k_flap are not used.
rotor_params = {{
    "k_eta": {k_eta:.12e},  # T = k_eta W^2 - k_z W V  [N/(rad/s)^2]
    "k_z": {k_z:.12e},  # [N/(rad/s)/(m/s)]
    "k_m": {k_m:.12e},  # Q = k_m W^2  [N m/(rad/s)^2]
    "k_d": {k_d:.12e},  # H = k_d W V_xy  [N/(rad/s)/(m/s)]
    "k_h": {k_h:.12e},  # T grows by k_h V_xy^2  [N/(m/s)^2]
    "k_flap": {k_flap:.12e},  # moment -k_flap W V_xy x z of a stiff rotor  [N m/(rad/s)/(m/s)]
    "rotor_speed_max": {t.rpm[-1] * np.pi / 30.0:.9g},  # end of the table [rad/s]
}}
# Entry of this rotor in quad_params["rotor_directions"]: the sign of the yaw moment on the vehicle (z up). A
# right-handed rotor turns counter-clockwise seen from above, so its reaction is clockwise: -1.
rotor_direction = {-t.sense}
"""
        return {f"{name}_rotor_params.py": text}

    def notes(self, job: Job) -> list[str]:
        """What this model class leaves out."""
        return [
            *super().notes(job),
            "torque does not change with airspeed in this model; no Reynolds or Mach number",
            "k_d, k_h and k_flap are fitted in edgewise flow up to the airspeed of zero thrust; in this model side "
            "force and roll moment are 0, and torque does not change with a wind across the shaft",
            f"density {job.performance.rho:g} kg/m3 is in all constants: scale them with yours",
        ]

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """Compute_body_wrench of one rotor along its axis."""
        (k_eta, k_z, k_m, *_), W = _rotor_params(files), rpm * np.pi / 30.0
        return k_eta * W**2 - k_z * W * airspeed_m_s, k_m * W**2

    def hub_loads(self, files: Files, rpm: Array, airspeed_m_s: Array, side_m_s: Array) -> Array:
        """Compute_body_wrench of one rotor; without side force and roll moment."""
        (*_, k_d, k_h, k_flap), W = _rotor_params(files), rpm * np.pi / 30.0
        T, Q = self.loads(files, rpm, airspeed_m_s)
        none = np.full(W.shape, np.nan)
        return np.array([T + k_h * side_m_s**2, Q, k_d * W * side_m_s, none, none, -k_flap * W * side_m_s])


def _rotorpy_hub(job: Job) -> tuple[float, float, float]:
    """k_d, k_h and k_flap by least squares in edgewise flow, each load relative to that at rest at the same speed."""
    if job.hub is None:
        return 0.0, 0.0, 0.0
    rpm, V, loads = edgewise(job)
    W, rest = rpm * np.pi / 30.0, job.performance.lookup(rpm, 0.0 * rpm)[0]
    return tuple(slope(x / rest, y / rest) for x, y in ((W * V, loads[2]), (V**2, loads[0] - rest), (W * V, -loads[5])))  # type: ignore[return-value]


def _fit(job: Job) -> tuple[float, float, float]:
    t = job.fitted
    rpm, J, CT, CP = t.flight_nodes()
    # relative to the load at rest at the same speed, so that no speed dominates
    ct0, cp0 = (np.interp(rpm, t.rpm, C[:, t.at_rest]) / fit_weight(job, J) for C in (t.CT, t.CP))
    a, b = np.linalg.lstsq(np.stack([1.0 / ct0, -J / ct0], axis=1), CT / ct0, rcond=None)[0]
    c = float(np.sum(CP / cp0**2) / np.sum(1.0 / cp0**2))
    scale = t.rho * t.diameter_m**4 / (2.0 * np.pi) ** 2
    # CT = a - b J: T = scale (a W^2 - b 2 pi / D W V)
    return (
        float(scale * a),
        float(scale * b * 2.0 * np.pi / t.diameter_m),
        float(scale * c * t.diameter_m / (2 * np.pi)),
    )


# MuJoCo: a body with a site, two actuators on it, and the table that drives them.

_CALLBACK = '''

class Propeller:
    """Sets the six actuators of one propeller from its speed; call it before every mj_step.

    The site's z axis points along the thrust. `rpm` is set by whoever models the motor.
    """

    def __init__(self, model, prefix="{name}", density_kg_m3=None):
        import mujoco

        self._mujoco = mujoco
        self.site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, prefix + "_site")
        words = ("force_x", "force_y", "thrust", "moment_x", "moment_y", "torque")
        self.actuators = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, f"{{prefix}}_{{w}}") for w in words]
        if min(self.site, *self.actuators) < 0:
            raise ValueError(f"the model has no site and six actuators of {{prefix}}")
        self.density = (model.opt.density or DENSITY) if density_kg_m3 is None else density_kg_m3
        self.sense = SENSE  # -1 for the mirror image of a right-handed propeller
        self.rpm = 0.0

    def velocity(self, model, data):
        """Velocity of the site through the air in its own axes, z along the thrust [m/s]; less model.opt.wind."""
        import numpy

        velocity = numpy.zeros(6)
        self._mujoco.mj_objectVelocity(model, data, self._mujoco.mjtObj.mjOBJ_SITE, self.site, velocity, 1)
        return velocity[3:] - data.site_xmat[self.site].reshape(3, 3).T @ model.opt.wind

    def __call__(self, model, data):
        """Force [N] and moment [N m] in the axes of the site now; both are written to data.ctrl."""
        force, moment = wrench(self.rpm, self.velocity(model, data), self.density, self.sense)
        data.ctrl[self.actuators] = (*force, *moment)
        return force, moment
'''


class MujocoExport(ModuleExport):
    """MJCF of one propeller and the Python file that looks its tables up."""

    id = "mujoco"
    title = "MuJoCo site, actuators and table"
    holds = (
        "tables CT(J, rpm), CP(J, rpm) and of the hub over J along and across the shaft, by a Python call before each "
        "step; density of the simulation"
    )
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "density", "rest", "rotation", "hub"})
    conventions = (
        "thrust along +z of the site, reaction torque -sense Q about it, forces and moments of the hub along its x and "
        "y; gear 1, so data.ctrl is in N and N m; a plain site motor with a torque gear would hold Q proportional to T"
    )
    source = "MuJoCo documentation, XML reference: actuator/general with site transmission, gear"
    told = (
        "the body of 1 kg is a stand: move site and actuators into your model",
        "density is that of the table unless option/density of the model or the call says otherwise; a density in "
        "the model also switches on MuJoCo's own drag of bodies",
    )

    def write(self, job: Job) -> Files:
        """MJCF and callback."""
        name = plain_name(job.case.name)
        t = job.performance
        top_T, top_Q = (2.0 * load for load in t.greatest)  # room for denser air and a wind across the shaft
        top_Q = max(top_Q, 0.5 * t.diameter_m * top_T)
        axes = np.eye(6, dtype=int)
        words = ("force_x", "force_y", "thrust", "moment_x", "moment_y", "torque")
        actuators = "\n".join(
            f'  <general name="{name}_{word}" site="{name}_site" gear="{" ".join(map(str, axis))}" ctrllimited="true"\n'
            f'   ctrlrange="{-top:.9g} {top:.9g}"/>'
            for word, axis, top in zip(words, axes, [top_T] * 3 + [top_Q] * 3, strict=True)
        )
        comment = "\n".join(f"<!-- {line.replace('--', '-')} -->" for line in header(job, "MuJoCo propeller"))
        mjcf = f"""<mujoco model="{name}">
{comment}
 <option density="0"/>
 <worldbody>
  <body name="{name}_body">
   <freejoint/>
   <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
   <site name="{name}_site" pos="0 0 0" size="{0.02 * t.diameter_m:.6g}"/>
   <geom name="{name}_disk" type="cylinder" size="{0.5 * t.diameter_m:.9g} 0.002" mass="0" contype="0" conaffinity="0"/>
  </body>
 </worldbody>
 <actuator>
{actuators}
 </actuator>
</mujoco>
"""
        code = table_module(job, "MuJoCo propeller") + _CALLBACK.format(name=name)
        return {f"{name}.xml": mjcf, f"{name}_mujoco.py": code}
