"""Autopilots: parameters of ArduPilot and of PX4 for their simulators."""

from __future__ import annotations

import json

import numpy as np

from bemt.base.arrays import Array
from bemt.base.units import G0
from bemt.tools.exports.base import Files, Job, LoadsExport
from bemt.tools.exports.parts import fit_weight, header, plain_name, written

# PX4: parameters of the simulator in hardware (SIH), of control allocation and of the thrust curve.

INCH = 0.0254
MOST_CT = 100.0
"""Greatest CA_ROTORi_CT that the firmware takes (control_allocator/module.yaml)."""


class Px4Export(LoadsExport):
    """Quadratics of CT and CP for a forward propeller, constants for a lifting rotor."""

    id = "px4"
    title = "PX4 parameters (SIH, control allocation)"
    holds = "forward propeller: CT(J), CP(J) quadratic, concave (CT2, CP2 <= 0); lifting rotor: T_MAX u, Q_MAX u"
    features = frozenset({"torque", "airspeed", "windmill", "density", "rest", "rotation"})
    conventions = "CT = T/(rho n^2 D^4), CP = P/(rho n^3 D^5), J = V/(n D); diameter in inches, RPM_MAX in rev/min"
    source = "PX4 1.17 simulator_sih: sih.cpp, sih_params.yaml (ranges); control_allocator/module.yaml"
    told = (
        "PX4 admits CT2 and CP2 up to 0 only: where the best quadratic bends upwards, a straight line is written",
        "two files: thrust in the SIH is linear in u, so THR_MDL_FAC is 0; the vehicle gets the rotor's curve",
        "u of the vehicle's THR_MDL_FAC is the share of full speed (an ESC that controls speed); for an ESC that "
        "controls duty fit it to a bench map (`map`)",
        "the sign of KM is for a rotor that turns as the case says; PX4 counts ccw from above as positive. The SIH "
        "fixes the directions of its own rotors and takes no direction for the forward propeller",
        f"CA_ROTOR0_CT is written up to the {MOST_CT:g} that PX4 takes; the allocation is normalised, so with "
        "equal rotors the value does not matter",
        "one quadratic for all speeds: no Reynolds or Mach number",
    )

    def write(self, job: Job) -> Files:
        """Parameter lines as airframe scripts take them: one file for the simulator, one for the vehicle."""
        job = self.asked(job)
        t, name = job.performance, plain_name(job.case.name)
        ct, cp = fits(job)
        T, Q = (float(loads[-1, t.at_rest]) for loads in (t.thrust_N, t.torque_Nm))  # at full speed, not of a fit
        f = thrust_factor(t.rpm, t.thrust_N[:, t.at_rest])
        head = [f"# {line}" for line in header(job, "PX4 parameters")]
        allocation = [
            "# Control allocation, rotor 0: T = CT u^2 [N], Q = KM T; KM > 0 turns counter-clockwise from above"
        ]
        if T <= MOST_CT:
            allocation.append(f"param set-default CA_ROTOR0_CT {T:.9g}")
        else:
            text = f"# CA_ROTOR0_CT is left at its default: {T:.6g} N is above the {MOST_CT:g} that PX4 takes"
            allocation.append(text)
        allocation.append(f"param set-default CA_ROTOR0_KM {t.sense * Q / T:.9g}")
        lines = [*head, "# Forward propeller of the SIH (fixed wing, tailsitter, pusher)"]
        lines += [
            f"param set-default SIH_F_DIA_INCH {t.diameter_m / INCH:.9g}",
            f"param set-default SIH_F_RPM_MAX {t.rpm[-1]:.9g}",
        ]
        lines += [
            f"param set-default SIH_F_C{word}{k} {value:.9g}"
            for word, fit in (("T", ct), ("P", cp))
            for k, value in enumerate(fit)
        ]
        lines += [
            "# Lifting rotor of the SIH, T = SIH_T_MAX u, Q = SIH_Q_MAX u: largest static thrust [N] and torque [N m]",
            f"param set-default SIH_T_MAX {T:.9g}",
            f"param set-default SIH_Q_MAX {Q:.9g}",
            "# Thrust is linear in u here, so the thrust curve is the straight one",
            "param set-default THR_MDL_FAC 0",
        ]
        vehicle = [*head, "# Thrust curve T/T_max = f u^2 + (1 - f) u, u the share of full speed; not for the SIH"]
        vehicle += [f"param set-default THR_MDL_FAC {f:.6g}"]
        return {
            f"{name}_sih.params": "\n".join([*lines, *allocation]) + "\n",
            f"{name}_vehicle.params": "\n".join([*vehicle, *allocation]) + "\n",
        }

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """Forward propeller of the SIH at the density of the table."""
        text = written(files, "_sih.params")
        p = parameters(text)
        rho = float(text.split("density ")[1].split()[0])
        n, D = rpm / 60.0, p["SIH_F_DIA_INCH"] * INCH
        J = airspeed_m_s / (n * D)
        ct, cp = (sum(p[f"SIH_F_C{word}{k}"] * J**k for k in range(3)) for word in "TP")
        return ct * rho * n**2 * D**4, cp * rho * n**2 * D**5 / (2.0 * np.pi)


def parameters(text: str) -> dict[str, float]:
    """Values that a file sets."""
    return {w[2]: float(w[3]) for w in (line.split() for line in text.splitlines()) if w[:1] == ["param"]}


def fits(job: Job) -> tuple[Array, Array]:
    """Quadratics of CT and CP over J from rest to zero thrust, concave, relative to the coefficient at rest."""
    from scipy.optimize import lsq_linear

    t = job.fitted
    rpm, J, CT, CP = t.flight_nodes()
    found = []
    for C, table in ((CT, t.CT), (CP, t.CP)):
        w = fit_weight(job, J) / np.interp(rpm, t.rpm, table[:, t.at_rest])
        A = np.stack([w, J * w, J**2 * w], axis=1)
        fit = lsq_linear(A, C * w, bounds=([0.0, -np.inf, -np.inf], [np.inf, np.inf, 0.0])).x
        fit[2] = min(float(fit[2]), 0.0)
        if fit[2] > -1e-12:  # on the bound: the straight line exactly
            fit = np.append(np.linalg.lstsq(A[:, :2], C * w, rcond=None)[0], 0.0)
        found.append(np.asarray(fit, dtype=float))
    return found[0], found[1]


def thrust_factor(rpm: Array, thrust_N: Array) -> float:
    """Share f of the square in T/T_max = f u^2 + (1 - f) u with u = rpm/rpm_max, held to 0 .. 1 [-]."""
    u, y = rpm / rpm[-1], thrust_N / thrust_N[-1]
    a, b = u**2 - u, y - u
    return float(np.clip(np.sum(a * b) / np.sum(a * a), 0.0, 1.0))


ROTORS = 4
HOVER = 0.5
CELL_V = 3.7
"""Nominal voltage of a lithium-polymer cell [V]."""


class ArdupilotExport(LoadsExport):
    """Frame file of SITL for a quadrotor that hovers at half of its thrust; outflow speed and area fitted to T(V)."""

    id = "ardupilot"
    title = "ArduPilot SITL frame and MOT_THST_EXPO"
    holds = "T = rho/2 A_e (v_max^2 (e c^2 + (1 - e) c) - V^2), c the share of full speed; no torque, no rpm"
    features = frozenset({"airspeed", "density", "rest"})
    conventions = "command c is taken as the share of full speed; disc_area of all rotors in m2"
    source = "ArduPilot SIM_Motor.cpp calc_thrust, SIM_Frame.cpp init (effective area from hover power)"
    told = (
        "the frame is a stand-in with four rotors and thrust-to-weight 2; the battery drain in SITL is not that "
        "of the propeller",
        "MOT_THST_EXPO is for a command that is the share of full speed; ESCs that control duty need less: see `map`",
        "no torque and no rpm in this model class; yaw comes from the frame's motor table, whose order says which "
        "motor turns how: a right-handed rotor turns counter-clockwise seen from above",
    )

    def write(self, job: Job) -> Files:
        """Frame JSON and parameter lines."""
        job = self.asked(job)
        t, name = job.performance, plain_name(job.case.name)
        e = thrust_factor(t.rpm, t.thrust_N[:, t.at_rest])
        area, v_max = _fit(job, e)
        T_max = 0.5 * t.rho * area * v_max**2
        hover = HOVER * T_max
        v_hover = v_max * float(np.sqrt(HOVER))
        cells = job.case.get("drive.cells")
        volts = CELL_V * (cells or 6)
        frame = {
            "mass": ROTORS * hover / G0, "num_motors": ROTORS, "disc_area": ROTORS * np.pi * t.diameter_m**2 / 4.0,
            "propExpo": e, "hoverThrOut": HOVER, "refVoltage": volts, "maxVoltage": volts,
            "refCurrent": ROTORS * hover * v_hover / (2.0 * volts), "refAlt": 0.0, "spin_min": 0.0, "spin_max": 1.0,
            "pwmMin": 1000, "pwmMax": 2000,
        }  # fmt: skip
        lines = [f"# {line}" for line in header(job, "ArduPilot frame")] + [f"# {job.rotation}"]
        lines += [
            "# mass, num_motors and hoverThrOut are a stand-in: four rotors at half of full thrust. Keep them and",
            "# refVoltage x refCurrent together: SITL works the outflow speed and the effective area out of them.",
            *([] if cells else ["# refVoltage and maxVoltage are those of six cells: the case states no battery."]),
            "# refSpd, refAngle, refRotRate and the battery are the vehicle's; add them.",
        ]
        body = json.dumps({k: float(f"{v:.9g}") if isinstance(v, float) else v for k, v in frame.items()}, indent=1)
        return {f"{name}.json": "\n".join(lines) + "\n" + body + "\n", f"{name}.parm": f"MOT_THST_EXPO,{e:.6g}\n"}

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """One motor as SIM_Frame sets it up, c = rpm over the greatest rpm of the table; no torque."""
        text = written(files, ".json")
        f = json.loads("\n".join(line for line in text.splitlines() if not line.startswith("#")))
        rho = float(text.split("density ")[1].split()[0])
        top = float(text.split(" to ")[1].split()[0])
        mass, volts, amps, motors, hover, e = (
            f[key] for key in ("mass", "refVoltage", "refCurrent", "num_motors", "hoverThrOut", "propExpo")
        )
        weight, c = mass * G0, rpm / top
        v_hover = 2.0 * volts * amps / weight
        area = weight / (0.5 * rho * v_hover**2) / motors
        v_max = v_hover / np.sqrt(hover)
        T = 0.5 * rho * area * (v_max**2 * (e * c**2 + (1.0 - e) * c) - airspeed_m_s**2)
        return T, np.full(rpm.shape, np.nan)


def _fit(job: Job, e: float) -> tuple[float, float]:
    """Effective area [m2] and outflow speed at full command [m/s], least squares of T over rest to zero thrust."""
    t = job.fitted
    rpm, J, CT, _ = t.flight_nodes()
    n = rpm / 60.0
    c, V = rpm / job.performance.rpm[-1], J * n * t.diameter_m
    T = CT * t.rho * n**2 * t.diameter_m**4
    w = fit_weight(job, J) / np.interp(rpm, t.rpm, t.thrust_N[:, t.at_rest])
    A = 0.5 * t.rho * np.stack([(e * c**2 + (1.0 - e) * c) * w, -(V**2) * w], axis=1)
    a, b = np.linalg.lstsq(A, T * w, rcond=None)[0]
    return float(b), float(np.sqrt(a / b))
