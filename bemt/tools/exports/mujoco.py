"""MuJoCo: a body with a site, two actuators on it, and the table that drives them."""

from __future__ import annotations

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.exports.base import Files, Job, LoadsExport
from bemt.tools.exports.parts import header, plain_name, run_hub, run_module, table_module

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


class MujocoExport(LoadsExport):
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

    def write(self, job: Job) -> Files:
        """MJCF and callback."""
        name = plain_name(job.case.name)
        t = job.performance
        top_T = 4.0 * float(np.abs(t.thrust_N).max())
        top_Q = max(4.0 * float(np.abs(t.torque_Nm).max()), 0.5 * t.diameter_m * top_T)
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

    def hub_loads(self, files: Files, rpm: Array, airspeed_m_s: Array, side_m_s: Array) -> Array:
        """The written Python, run."""
        return run_hub(str(next(t for n, t in files.items() if n.endswith("_mujoco.py"))), rpm, airspeed_m_s, side_m_s)
