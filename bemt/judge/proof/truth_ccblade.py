"""Second truth of the proof: CCBlade of WISDEM (extra ``wisdem``), somebody else's blade-element momentum code.

It shares no line with this project's solver.  It gives no loads at rest and knows uniform axial flow only; what an item
may conceal with it is in `EXPRESSIBLE`.  Sections are those of `bemt.judge.proof.truth_section`.

References
----------
.. [1] S. A. Ning, "A simple solution method for the blade element momentum equations with guaranteed convergence",
       Wind Energy 17(9), 2014, DOI 10.1002/we.1636.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.judge.proof import truth
from bemt.judge.proof import truth_section as ts

EXPRESSIBLE = frozenset({
    "reynolds", "compressibility", "drag_divergence", "stall_delay", "section", "pitch_offset", "untwist",
    "air_density", "rpm_scale", "airspeed_offset", "airspeed_gain", "thrust_gain", "torque_gain", "thrust_zero",
    "torque_zero", "cross_talk", "thrust_drift", "torque_drift", "unit_slip", "resonance", "bearing_drag", "hysteresis",
    "bubble_step",
})  # fmt: skip
"""Causes that act on sections, blade angle, air or stand."""
LEAST_J = 0.02
"""Advance ratio below which CCBlade is not asked. [1]"""


_ALPHA = np.radians(np.concatenate([np.arange(-180.0, -30.0, 2.0), np.arange(-30.0, 40.0, 0.2),
                                    np.arange(40.0, 181.0, 2.0)]))  # fmt: skip


@dataclass(frozen=True)
class _Foil:
    """Section in CCBlade's sense: a turbine's, which is a propeller's turned over.

    Its Reynolds number is CCBlade's own, that of the flow without induction.
    """

    cl: Array
    cd: Array

    def evaluate(self, alpha: float, Re: float, return_cm: bool = False) -> tuple[float, ...]:  # noqa: N803
        """Lift and drag coefficients; CCBlade calls this."""
        out = (-float(np.interp(-alpha, _ALPHA, self.cl)), float(np.interp(-alpha, _ALPHA, self.cd)))
        return (*out, 0.0) if return_cm else out


def solve(
    rotor: truth.TruthRotor, rpm: Array, airspeed: Array, temperature_C: Array, pressure_Pa: Array,
    physics: ts.SectionPhysics, extra: Mapping[str, Any],
) -> truth.TrueAnswer:  # fmt: skip
    """Loads of an open rotor in axial flow."""
    try:
        from wisdem.ccblade.ccblade import CCBlade
    except ImportError as error:
        raise InputError(
            Fault("", "wisdem", "a package that is not installed", "CCBlade", "pip install 'bemt[wisdem]'")
        ) from error
    if "duct" in extra or np.any(extra.get("axial", 0.0)) or np.any(np.asarray(extra.get("induction", 1.0)) != 1.0):
        raise ValueError("CCBlade models uniform axial flow only")
    P, N, R = rpm.size, rotor.x.size, rotor.radius
    rho, mu, sound = truth.air(temperature_C, pressure_Pa)
    omega = rpm * (2.0 * np.pi / 60.0)
    beta = rotor.twist + np.broadcast_to(extra.get("twist", 0.0), (P, N))
    r = rotor.x * R
    W = np.hypot(np.outer(omega, r), airspeed[:, None])
    thrust, torque = np.full(P, np.nan), np.full(P, np.nan)
    for k in np.flatnonzero(airspeed > LEAST_J * rpm / 60.0 * 2.0 * R):
        ratio = float(omega[k] * R / np.hypot(airspeed[k], omega[k] * R))
        re, mach = rho[k] * W[k] * rotor.chord / mu[k], W[k] / sound[k]
        shape = (_ALPHA.size, N)
        alpha = np.broadcast_to(_ALPHA[:, None], shape)
        Re, M, c_r, speed = (np.broadcast_to(v, shape) for v in (re, mach, rotor.chord / r, ratio))
        cl, cd = ts.loads(alpha, Re, M, c_r, speed, rotor.aspect, rotor.section, physics)
        foils = [_Foil(cl[:, i], cd[:, i]) for i in range(N)]
        blade = CCBlade(r, rotor.chord, np.degrees(beta[k]), foils, rotor.hub * R, R, rotor.blades, float(rho[k]),
                        float(mu[k]), shearExp=0.0)  # fmt: skip
        got = blade.evaluate([float(airspeed[k])], [float(rpm[k])], [0.0])
        loads = got[0] if isinstance(got, tuple) else got
        T, Q = -float(np.ravel(loads["T"])[0]), -float(np.ravel(loads["Q"])[0])
        if T != 0.0 and np.isfinite(T + Q):
            thrust[k], torque[k] = T, Q
    good = np.isfinite(thrust)
    none = np.zeros((P, N))
    at75 = int(np.argmin(np.abs(rotor.x - 0.75)))
    area = np.pi * R**2 * (1.0 - rotor.hub**2)
    # mean induced speed by momentum, for what is derived from it
    induced = -0.5 * airspeed + np.sqrt(0.25 * airspeed**2 + np.maximum(np.nan_to_num(thrust), 0.0) / (2 * rho * area))
    return truth.TrueAnswer(
        thrust, torque, good, none, none, none, induced, np.full(P, np.nan),
        rho * W[:, at75] * rotor.chord[at75] / mu, omega * R / sound, np.where(good, 0.0, np.inf),
    )  # fmt: skip
