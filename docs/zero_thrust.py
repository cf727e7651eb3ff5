"""A JSBSim aircraft where BEMT says that the thrust of its 10x5 vanishes: ``python docs/zero_thrust.py``.

JSBSim gets the airspeed, and the throttle at which the motor of the file holds BEMT's torque at that point; speed and
thrust are its own answer. Needs ``pip install 'bemt[simulators]'``.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import jsbsim
import numpy as np

from bemt.base.tables import write_atomic
from bemt.rotors.case import load_case
from bemt.tools.exports import exports
from bemt.tools.exports.base import Job
from bemt.tools.exports.jsbsim import motor_of
from bemt.tools.exports.performance import solve_points

CASE = Path(__file__).resolve().parent.parent / "cases/prop_10x5/case.toml"
RPM = 8000.0
FOOT, POUND, WATT = 0.3048, 4.4482216152605, 1.3558179483314  # m, N, W per ft lbf/s
SECONDS = 6.0


def fly(root: Path, airspeed_m_s: float, throttle: float) -> tuple[float, float]:
    """Speed [rev/min] and thrust [N] that JSBSim settles to."""
    fdm = jsbsim.FGFDMExec(str(root))
    fdm.set_debug_level(0)
    fdm.set_aircraft_path("aircraft")
    fdm.set_engine_path("engine")
    fdm.set_systems_path("systems")
    fdm.load_model("prop_10x5_stand")
    fdm.run_ic()
    fdm["forces/hold-down"] = 1
    fdm["atmosphere/wind-north-fps"] = -airspeed_m_s / FOOT
    fdm["propulsion/set-running"] = -1
    fdm["fcs/throttle-cmd-norm"] = throttle
    for _ in range(int(SECONDS / fdm.get_delta_t())):
        fdm.run()
    return fdm["propulsion/engine/propeller-rpm"], fdm["propulsion/engine/thrust-lbs"] * POUND


def main() -> dict[str, float]:
    """Find the point by BEMT, export, fly; the numbers that are printed."""
    job = Job(load_case(CASE), rpm=1.25 * RPM)
    table = job.performance
    J = float(np.interp(RPM, table.rpm, table.J_zero))
    V = J * RPM / 60.0 * table.diameter_m
    torque = float(solve_points(job.case, RPM, V).torque_Nm[0])
    at_rest = float(solve_points(job.case, RPM, 0.0).thrust_N[0])
    files = exports()["jsbsim"].write(job)
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            write_atomic(Path(folder) / name, text)
        rpm, thrust = fly(Path(folder), V, motor_of(job).throttle_for(RPM, torque))
    return {"airspeed_m_s": V, "J": J, "rpm": rpm, "thrust_N": thrust, "thrust_at_rest_N": at_rest}


if __name__ == "__main__":
    found = main()
    print(f"BEMT: no thrust at J {found['J']:.4f}, {found['airspeed_m_s']:.2f} m/s at {RPM:.0f} rev/min")
    share = 100 * found["thrust_N"] / found["thrust_at_rest_N"]
    print(f"JSBSim there, with BEMT's torque: {found['rpm']:.0f} rev/min, thrust {found['thrust_N']:+.4f} N")
    print(f"which is {share:+.2f} % of the {found['thrust_at_rest_N']:.2f} N at rest")
