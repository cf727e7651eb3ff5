"""A quadrotor hovers in MuJoCo on an exported 10x5, at the speed that `drive` predicts: ``python docs/hover.py``.

Four rotors turn at the predicted speed, nothing controls them: what the vehicle then climbs or sinks is the error of
the whole chain, from the blade to the simulator. Needs ``pip install 'bemt[simulators]'``.
"""

from __future__ import annotations

from pathlib import Path

import mujoco

from bemt.rotors.case import load_case
from bemt.rotors.case.load import with_changes
from bemt.tools.drive import drive_result
from bemt.tools.exports import exports
from bemt.tools.exports.base import Job

CASE = Path(__file__).resolve().parent.parent / "cases/prop_10x5/case.toml"
MASS = 1.8  # of the vehicle [kg]
SECONDS = 2.0
DRIVE = {
    "drive.kv": 900.0, "drive.cells": 4, "drive.soc": 1.0, "drive.rotor_inertia_kg_mm2": 40.0,
    "drive.battery.capacity_Ah": 5.0, "drive.battery.resistance_mohm": 15.0, "drive.esc.resistance_mohm": 5.0,
    "drive.esc.idle_A": 0.05, "drive.esc.current_limit_A": 40.0, "drive.motor.resistance_mohm": 70.0,
    "drive.motor.no_load_A": 0.7, "drive.motor.inertia_kg_mm2": 10.0, "drive.vehicle.mass_kg": MASS,
    "drive.vehicle.rotors": 4,
}  # fmt: skip


def vehicle(one: str, name: str) -> str:
    """MJCF of a cross with four of the exported propellers: the second and the third turn the other way."""
    site = f'<site name="{name}_site"'
    actuators = one[one.index("<actuator>") + len("<actuator>") : one.index("</actuator>")]
    sites, motors = [], []
    for k, (x, y) in enumerate(((1, 1), (-1, 1), (1, -1), (-1, -1))):
        sites.append(f'{site.replace(name, f"{name}_{k}")} pos="{0.16 * x} {0.16 * y} 0" size="0.01"/>')
        motors.append(actuators.replace(name, f"{name}_{k}"))
    return f"""<mujoco><option timestep="0.002" gravity="0 0 -9.80665"/><worldbody>
<body name="quad" pos="0 0 10"><freejoint/>
<inertial pos="0 0 0" mass="{MASS}" diaginertia="0.02 0.02 0.035"/>{"".join(sites)}</body></worldbody>
<actuator>{"".join(motors)}</actuator></mujoco>"""


def main() -> dict[str, float]:
    """Predict, export, fly; the numbers that are printed."""
    hover = drive_result.solve(with_changes(load_case(CASE), DRIVE)).hover
    rpm = hover["rpm"].value
    job = Job(load_case(CASE), rpm=1.5 * rpm)
    files = exports()["mujoco"].write(job)
    space: dict[str, object] = {}
    exec(str(files["prop_10x5_mujoco.py"]), space)
    model = mujoco.MjModel.from_xml_string(vehicle(str(files["prop_10x5.xml"]), "prop_10x5"))
    data = mujoco.MjData(model)
    propellers = [space["Propeller"](model, f"prop_10x5_{k}") for k in range(4)]  # type: ignore[operator]
    for k, propeller in enumerate(propellers):
        propeller.rpm = rpm
        propeller.sense *= -1 if k in (1, 2) else 1
    while data.time < SECONDS:
        for propeller in propellers:
            propeller(model, data)
        mujoco.mj_step(model, data)
    return {"rpm": rpm, "pulse_us": 1000.0 + 1000.0 * hover["throttle"].value, "climb_m_s": float(data.qvel[2]),
            "height_m": float(data.qpos[2]) - 10.0, "yaw_rate_rad_s": float(data.qvel[5])}  # fmt: skip


if __name__ == "__main__":
    found = main()
    print(f"drive: hover at {found['rpm']:.0f} rev/min, {found['pulse_us']:.0f} us")
    print(f"MuJoCo after {SECONDS:g} s at that speed, uncontrolled: climb {found['climb_m_s'] * 1e3:+.2f} mm/s, "
          f"height {found['height_m'] * 1e3:+.2f} mm, yaw rate {found['yaw_rate_rad_s']:+.1e} rad/s")  # fmt: skip
