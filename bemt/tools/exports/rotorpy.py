"""RotorPy: the rotor's entries of a vehicle's parameters."""

from __future__ import annotations

import numpy as np

from bemt.base.arrays import Array
from bemt.tools.exports.base import Files, Job, LoadsExport
from bemt.tools.exports.parts import edgewise, header, plain_name, slope


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
        k_d, k_h, k_flap = _fit_hub(job)
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
            "torque does not change with airspeed in this model; no Reynolds or Mach number",
            "k_d, k_h and k_flap are fitted in edgewise flow up to the airspeed of zero thrust; in this model side "
            "force and roll moment are 0, and torque does not change with a wind across the shaft",
            f"density {job.performance.rho:g} kg/m3 is in all constants: scale them with yours",
            "k_eta weighs all speeds of the table alike; export with --rpm near the speed that you fly",
        ]

    def loads(self, files: Files, rpm: Array, airspeed_m_s: Array) -> tuple[Array, Array]:
        """Compute_body_wrench of one rotor along its axis."""
        space: dict[str, dict[str, float]] = {}
        exec(str(next(iter(files.values()))), {}, space)
        k, W = space["rotor_params"], rpm * np.pi / 30.0
        return k["k_eta"] * W**2 - k["k_z"] * W * airspeed_m_s, k["k_m"] * W**2

    def hub_loads(self, files: Files, rpm: Array, airspeed_m_s: Array, side_m_s: Array) -> Array:
        """Compute_body_wrench of one rotor; without side force and roll moment."""
        space: dict[str, dict[str, float]] = {}
        exec(str(next(iter(files.values()))), {}, space)
        k, W = space["rotor_params"], rpm * np.pi / 30.0
        T, Q = self.loads(files, rpm, airspeed_m_s)
        none = np.full(W.shape, np.nan)
        return np.array([T + k["k_h"] * side_m_s**2, Q, k["k_d"] * W * side_m_s, none, none,
                         -k["k_flap"] * W * side_m_s])  # fmt: skip


def _fit_hub(job: Job) -> tuple[float, float, float]:
    """k_d, k_h and k_flap by least squares in edgewise flow, each load relative to that at rest at the same speed."""
    if job.hub is None:
        return 0.0, 0.0, 0.0
    rpm, V, loads = edgewise(job)
    W, rest = rpm * np.pi / 30.0, job.performance.lookup(rpm, 0.0 * rpm)[0]
    return tuple(slope(x / rest, y / rest) for x, y in ((W * V, loads[2]), (V**2, loads[0] - rest), (W * V, -loads[5])))  # type: ignore[return-value]


def _fit(job: Job) -> tuple[float, float, float]:
    t = job.performance
    rpm, J, CT, CP = t.flight_nodes()
    # relative to the load at rest at the same speed, so that no speed dominates
    ct0, cp0 = (np.interp(rpm, t.rpm, C[:, t.at_rest]) for C in (t.CT, t.CP))
    a, b = np.linalg.lstsq(np.stack([1.0 / ct0, -J / ct0], axis=1), CT / ct0, rcond=None)[0]
    c = float(np.sum(CP / cp0**2) / np.sum(1.0 / cp0**2))
    scale = t.rho * t.diameter_m**4 / (2.0 * np.pi) ** 2
    # CT = a - b J: T = scale (a W^2 - b 2 pi / D W V)
    return (
        float(scale * a),
        float(scale * b * 2.0 * np.pi / t.diameter_m),
        float(scale * c * t.diameter_m / (2 * np.pi)),
    )
