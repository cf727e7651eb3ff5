"""MuJoCo: a body with a site, two actuators on it, and the table that drives them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bemt.exports.base import Files, Job, LoadsExport
from bemt.exports.parts import header, plain_name, run_module, table_module

Array = NDArray[np.float64]

_CALLBACK = '''

class Propeller:
    """Sets the two actuators of one propeller from its speed; call it before every mj_step.

    The site's z axis points along the thrust. `rpm` is set by whoever models the motor.
    """

    def __init__(self, model, prefix="{name}", density_kg_m3=None):
        import mujoco

        self._mujoco = mujoco
        self.site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, prefix + "_site")
        self.thrust = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, prefix + "_thrust")
        self.torque = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, prefix + "_torque")
        if min(self.site, self.thrust, self.torque) < 0:
            raise ValueError(f"the model has no site and actuators of {{prefix}}")
        self.density = (model.opt.density or DENSITY) if density_kg_m3 is None else density_kg_m3
        self.sense = SENSE
        self.rpm = 0.0

    def airspeed(self, model, data):
        """Axial speed through the air along the thrust [m/s]; model.opt.wind is taken off."""
        import numpy

        velocity = numpy.zeros(6)
        self._mujoco.mj_objectVelocity(model, data, self._mujoco.mjtObj.mjOBJ_SITE, self.site, velocity, 1)
        axis = data.site_xmat[self.site].reshape(3, 3)[:, 2]
        return float(velocity[5] - axis @ model.opt.wind)

    def __call__(self, model, data):
        """Thrust [N] and torque [N m] now; both are written to data.ctrl."""
        T, Q = loads(self.rpm, self.airspeed(model, data), self.density)
        data.ctrl[self.thrust] = T
        data.ctrl[self.torque] = -self.sense * Q
        return T, Q
'''


class MujocoExport(LoadsExport):
    """MJCF of one propeller and the Python file that looks its table up."""

    id = "mujoco"
    title = "MuJoCo site, actuators and table"
    holds = "table CT(J, rpm), CP(J, rpm) by a Python call before each step; density of the simulation"
    features = frozenset({"torque", "airspeed", "windmill", "reynolds", "density", "rest", "rotation"})
    conventions = (
        "force along +z of the site, reaction torque -sense Q about it; gear 1, so data.ctrl is in N and N m; a plain "
        "site motor with a torque gear would hold Q proportional to T only"
    )
    source = "MuJoCo documentation, XML reference: actuator/general with site transmission, gear"

    def write(self, job: Job) -> Files:
        """MJCF and callback."""
        name = plain_name(job.case.name)
        t = job.performance
        top_T, top_Q = 2.0 * float(np.abs(t.thrust_N).max()), 2.0 * float(np.abs(t.torque_Nm).max())
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
  <general name="{name}_thrust" site="{name}_site" gear="0 0 1 0 0 0" ctrllimited="true"
   ctrlrange="{-top_T:.9g} {top_T:.9g}"/>
  <general name="{name}_torque" site="{name}_site" gear="0 0 0 0 0 1" ctrllimited="true"
   ctrlrange="{-top_Q:.9g} {top_Q:.9g}"/>
 </actuator>
</mujoco>
"""
        code = table_module(job, "MuJoCo propeller") + _CALLBACK.format(name=name)
        return {f"{name}.xml": mjcf, f"{name}_mujoco.py": code}

    def notes(self, job: Job) -> list[str]:
        """What stands in, and how density is chosen."""
        return [
            "the body of 1 kg is a stand: move site and actuators into your model",
            "density is that of the table unless option/density of the model or the call says otherwise; a density in "
            "the model also switches on MuJoCo's own drag of bodies",
        ]

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """The written Python, run."""
        return run_module(str(next(t for n, t in files.items() if n.endswith("_mujoco.py"))), rpm, airspeed_m_s)
