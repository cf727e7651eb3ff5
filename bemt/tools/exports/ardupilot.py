"""ArduPilot: the frame file of its simulator and the thrust exponent."""

from __future__ import annotations

import json

import numpy as np

from bemt.base.arrays import Array
from bemt.base.units import G0
from bemt.tools.exports.base import Files, Job, LoadsExport
from bemt.tools.exports.parts import header, plain_name
from bemt.tools.exports.px4 import thrust_factor

ROTORS = 4
HOVER = 0.5


class ArdupilotExport(LoadsExport):
    """Frame file of SITL for a quadrotor that hovers at half of its thrust; outflow speed and area fitted to T(V)."""

    id = "ardupilot"
    title = "ArduPilot SITL frame and MOT_THST_EXPO"
    holds = "T = rho/2 A_e (v_max^2 (e c^2 + (1 - e) c) - V^2), c the share of full speed; no torque, no rpm"
    features = frozenset({"airspeed", "density", "rest"})
    conventions = "command c is taken as the share of full speed; disc_area of all rotors in m2"
    source = "ArduPilot SIM_Motor.cpp calc_thrust, SIM_Frame.cpp init (effective area from hover power)"

    def write(self, job: Job) -> Files:
        """Frame JSON and parameter lines."""
        job = self.asked(job)
        t, name = job.performance, plain_name(job.case.name)
        e = thrust_factor(t.rpm, t.thrust_N[:, t.at_rest])
        area, v_max = _fit(job, e)
        T_max = 0.5 * t.rho * area * v_max**2
        hover = HOVER * T_max
        v_hover = v_max * float(np.sqrt(HOVER))
        volts = 22.2
        frame = {
            "mass": ROTORS * hover / G0,
            "num_motors": ROTORS,
            "disc_area": ROTORS * np.pi * t.diameter_m**2 / 4.0,
            "propExpo": e,
            "hoverThrOut": HOVER,
            "refVoltage": volts,
            "maxVoltage": volts,
            "refCurrent": ROTORS * hover * v_hover / (2.0 * volts),
            "refAlt": 0.0,
            "spin_min": 0.0,
            "spin_max": 1.0,
            "pwmMin": 1000,
            "pwmMax": 2000,
        }
        lines = [f"# {line}" for line in header(job, "ArduPilot frame")] + [f"# {job.rotation}"]
        lines += [
            "# mass, num_motors and hoverThrOut are a stand-in: four rotors at half of full thrust. Keep them and",
            "# refVoltage x refCurrent together: SITL works the outflow speed and the effective area out of them.",
            "# refSpd, refAngle, refRotRate and the battery are the vehicle's; add them.",
        ]
        body = json.dumps({k: float(f"{v:.9g}") if isinstance(v, float) else v for k, v in frame.items()}, indent=1)
        return {f"{name}.json": "\n".join(lines) + "\n" + body + "\n", f"{name}.parm": f"MOT_THST_EXPO,{e:.6g}\n"}

    def notes(self, job: Job) -> list[str]:
        """What the frame file stands on."""
        return [
            "the frame is a stand-in with four rotors and thrust-to-weight 2; the battery drain in SITL is not that "
            "of the propeller",
            "MOT_THST_EXPO is for a command that is the share of full speed; ESCs that control duty need less: see "
            "`map`",
            "no torque and no rpm in this model class; yaw comes from the frame's motor table, whose order says which "
            "motor turns how: a right-handed rotor turns counter-clockwise seen from above",
        ]

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """One motor as SIM_Frame sets it up, c = rpm over the greatest rpm of the table; no torque."""
        text = str(next(t for n, t in files.items() if n.endswith(".json")))
        f = json.loads("\n".join(line for line in text.splitlines() if not line.startswith("#")))
        rho = float(text.split("density ")[1].split()[0])
        top = float(text.split(" to ")[1].split()[0])
        weight = f["mass"] * G0
        v_hover = 2.0 * f["refVoltage"] * f["refCurrent"] / weight
        area = weight / (0.5 * rho * v_hover**2) / f["num_motors"]
        v_max = v_hover / np.sqrt(f["hoverThrOut"])
        c = rpm / top
        T = 0.5 * rho * area * (v_max**2 * (f["propExpo"] * c**2 + (1.0 - f["propExpo"]) * c) - airspeed_m_s**2)
        return T, np.full(rpm.shape, np.nan)


def _fit(job: Job, e: float) -> tuple[float, float]:
    """Effective area [m2] and outflow speed at full command [m/s], least squares of T over rest to zero thrust."""
    t = job.performance
    rpm, J, CT, _ = t.flight_nodes()
    n = rpm / 60.0
    c, V = rpm / t.rpm[-1], J * n * t.diameter_m
    T = CT * t.rho * n**2 * t.diameter_m**4
    w = 1.0 / np.interp(rpm, t.rpm, t.thrust_N[:, t.at_rest])
    A = 0.5 * t.rho * np.stack([(e * c**2 + (1.0 - e) * c) * w, -(V**2) * w], axis=1)
    a, b = np.linalg.lstsq(A, T * w, rcond=None)[0]
    return float(b), float(np.sqrt(a / b))
