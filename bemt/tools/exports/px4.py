"""PX4: parameters of the simulator in hardware (SIH), of control allocation and of the thrust curve."""

from __future__ import annotations

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.exports.base import Files, Job, LoadsExport
from bemt.tools.exports.parts import header, plain_name

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
            allocation.append(
                f"# CA_ROTOR0_CT is left at its default: {T:.6g} N is above the {MOST_CT:g} that PX4 takes"
            )
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

    def notes(self, job: Job) -> list[str]:
        """Ranges and what u means."""
        return [
            "PX4 admits CT2 and CP2 up to 0 only: where the best quadratic bends upwards, a straight line is written",
            "two files: thrust in the SIH is linear in u, so THR_MDL_FAC is 0; the vehicle gets the rotor's curve",
            "u of the vehicle's THR_MDL_FAC is the share of full speed (an ESC that controls speed); for an ESC that "
            "controls duty fit it to a bench map (`map`)",
            "the sign of KM is for a rotor that turns as the case says; PX4 counts ccw from above as positive. The SIH "
            "fixes the directions of its own rotors and takes no direction for the forward propeller",
            f"CA_ROTOR0_CT is written up to the {MOST_CT:g} that PX4 takes; the allocation is normalised, so with "
            "equal rotors the value does not matter",
            "one quadratic for all speeds: Reynolds and Mach number are averaged over the table",
        ]

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """Forward propeller of the SIH at the density of the table."""
        text = str(next(t for n, t in files.items() if n.endswith("_sih.params")))
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

    t = job.performance
    rpm, J, CT, CP = t.flight_nodes()
    found = []
    for C, table in ((CT, t.CT), (CP, t.CP)):
        w = 1.0 / np.interp(rpm, t.rpm, table[:, t.at_rest])
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
