"""Truth of the proof: a vortex rotor, lifting lines with helical wakes and their own Kutta-Joukowski balance.

Each blade is a lifting line of horseshoe vortices; the trailing ones are the helices of
`bemt.judge.proof.truth_wake`, whose advance and contraction follow the speed that the rotor itself induces.  On every
panel the circulation equals that of the section's lift in the local flow.  No momentum theory, no tip-loss factor:
finite blade number, swirl and hub come out of Biot-Savart.  All operating points of a recording are solved at once.

References
----------
.. [1] J. E. Kerwin, C.-S. Lee, J. SNAME Transactions 86, 1978 (moderately loaded lifting line and lattice).
.. [2] A. J. Landgrebe, J. AHS 17(4), 1972 (contraction, see `bemt.judge.proof.truth_wake`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.judge.proof import truth_section as ts
from bemt.judge.proof import truth_wake as tw

# rounds and largest Newton step, each for the points that the one before left; stalled panels need small steps
_STAGES = ((12, 1.0), (12, 1.0), (40, 0.5), (60, 0.25), (300, 0.1))
_TOLERANCE, _TIGHT, _GOOD = 1e-6, 3e-6, 2e-4  # end of a stage; no further stage; counts as solved


@dataclass(frozen=True)
class TruthRotor:
    """Blades of the truth."""

    radius: float  # Tip radius. [m]
    blades: int  # Count. [-]
    # (S,) Stations: r/R, chord over R [-], blade angle [rad]; the first is the hub, the last the tip
    r_R: tuple[float, ...]
    c_R: tuple[float, ...]
    beta: tuple[float, ...]
    section: ts.TrueSection = field(default_factory=ts.TrueSection)  # One section for the whole blade
    panels: int = 14  # Lifting-line panels. [-]
    wall: float = float("nan")  # Inner radius of a duct over R, NaN without one. [-]
    code: str = "vortex"  # Which code solves it: ``vortex`` (this module) or ``ccblade``

    @property
    def hub(self) -> float:
        """Hub over tip radius. [-]"""
        return self.r_R[0]

    @cached_property
    def edges(self) -> Array:
        """Panel edges r/R, (N + 1,). [-]"""
        return tw.edges_and_centres(self.hub, self.panels)[0]

    @cached_property
    def x(self) -> Array:
        """Control radii r/R, (N,). [-]"""
        return tw.edges_and_centres(self.hub, self.panels)[1]

    @cached_property
    def chord(self) -> Array:
        """Chords at the control radii, (N,). [m]"""
        return np.asarray(np.interp(self.x, self.r_R, self.c_R)) * self.radius

    @cached_property
    def twist(self) -> Array:
        """Blade angles at the control radii, (N,). [rad]"""
        return np.asarray(np.interp(self.x, self.r_R, self.beta))

    @property
    def aspect(self) -> float:
        """Aspect ratio of a blade. [-]"""
        return float((1.0 - self.hub) * self.radius / np.mean(self.chord))


@dataclass(frozen=True)
class TrueAnswer:
    """Loads of P points."""

    # (P,) Of the blades [N], [N m]; NaN where not converged
    thrust: Array
    torque: Array
    converged: NDArray[np.bool_]  # (P,) Whether the circulations are found
    # (P, N) Circulation per blade [m2/s]; induced speed downstream and in the direction of rotation [m/s]
    circulation: Array
    ua: Array
    ut: Array
    # (P,) Thrust-weighted axial induced speed; excess speed of a duct's jet, NaN without one. [m/s]
    induced: Array
    jet: Array
    # (P,) Reynolds number at 0.75 R; rotational tip Mach number. [-]
    re75: Array
    m_tip: Array
    residual: Array  # (P,) Largest relative miss of a circulation, or of the wake's speed over the tip speed. [-]


def air(temperature_C: Array, pressure_Pa: Array) -> tuple[Array, Array, Array]:
    """Density, viscosity and speed of sound of dry air.

    Notes
    -----
    Ideal gas; viscosity 1.716e-5 (T / 273.15)^0.7 (power law, within 1 % of Sutherland's from -20 to 50 C).
    """
    kelvin = np.asarray(temperature_C, float) + 273.15
    rho = np.asarray(pressure_Pa, float) / (287.05 * kelvin)
    return rho, 1.716e-5 * (kelvin / 273.15) ** 0.7, np.sqrt(1.4 * 287.05 * kelvin)


def solve(
    rotor: TruthRotor, rpm: Array, airspeed: Array, temperature_C: Array, pressure_Pa: Array,
    physics: ts.SectionPhysics | None = None, extra: Mapping[str, Any] | None = None, start: TrueAnswer | None = None,
) -> TrueAnswer:  # fmt: skip
    """Find circulations and loads at P points at once."""
    rpm, airspeed, temperature, pressure = (
        np.atleast_1d(v)
        for v in np.broadcast_arrays(*(np.asarray(v, float) for v in (rpm, airspeed, temperature_C, pressure_Pa)))
    )
    state = [rpm, airspeed, *air(temperature, pressure)]
    more = dict(extra or {})
    n = rotor.x.size
    for key in ("axial", "tangential", "twist", "induction"):
        more[key] = np.broadcast_to(more.get(key, 1.0 if key == "induction" else 0.0), (rpm.size, n))
    more["seal"] = np.broadcast_to(more.get("seal", 1.0), rpm.shape)
    physics = physics or ts.SectionPhysics()
    answer = _solve(rotor, state, physics, more, *_STAGES[0], start)
    for stage in _STAGES[1:]:
        lost = np.flatnonzero(~(answer.residual < _TIGHT))
        if not lost.size:
            break
        fewer = {k: v if k == "duct" else v[lost] for k, v in more.items()}
        so_far = replace(answer, **{name: value[lost] for name, value in vars(answer).items()})
        again = _solve(rotor, [v[lost] for v in state], physics, fewer, *stage, so_far)
        for name, value in vars(again).items():
            getattr(answer, name)[lost] = value
    return answer


def _solve(
    rotor: TruthRotor,
    state: list[Array],
    physics: ts.SectionPhysics,
    extra: Mapping[str, Any],
    rounds: int,
    most: float,
    start: TrueAnswer | None,
) -> TrueAnswer:
    """Iterate circulations, wake and jet of all points; ``most`` is the largest Newton step."""
    rpm, airspeed, rho, mu, sound = state
    R, B, n = rotor.radius, rotor.blades, rotor.x.size
    r, dr = rotor.x * R, np.diff(rotor.edges) * R
    omega = rpm * (2.0 * np.pi / 60.0)
    shape = (rpm.size, n)
    va = airspeed[:, None] + extra["axial"]
    vt = omega[:, None] * r + extra["tangential"]
    twist = rotor.twist + extra["twist"]
    factor = extra["induction"]
    ducted = "duct" in extra
    axial_t, swirl_t = tw.wake_tables(rotor.hub, rotor.panels, B, not ducted)
    if ducted:
        image_a, image_s = tw.image_tables(rotor.hub, rotor.panels, B, float(rotor.wall))
        seal = extra["seal"][:, None, None]
    c_r = np.broadcast_to(rotor.chord / r, shape)
    speed_ratio = (omega * R / np.hypot(airspeed, omega * R))[:, None]

    def forces(alpha: Array, w: Array) -> tuple[Array, Array]:
        return ts.loads(alpha, rho[:, None] * w * rotor.chord / mu[:, None], w / sound[:, None], c_r, speed_ratio,
                        rotor.aspect, rotor.section, physics)  # fmt: skip

    def section(gamma: Array, ma: Array, ms: Array) -> tuple[Array, ...]:
        ua = np.einsum("pij,pj->pi", ma, gamma)
        ut = np.einsum("pij,pj->pi", ms, gamma)
        wa, wt = va + ua, vt - ut
        w = np.hypot(wa, wt)
        alpha = twist - np.arctan2(wa, wt)
        cl, cd = forces(alpha, w)
        return ua, ut, wa, wt, w, cl, cd, alpha

    induced = 0.06 * omega * R + 0.0 * airspeed
    jet = 2.0 * induced
    gamma = np.zeros(shape)
    if start is not None:
        gamma, induced = start.circulation.copy(), start.induced.copy()
        jet = np.where(np.isfinite(start.jet), start.jet, jet)
    change = np.full(rpm.shape, np.inf)
    step = np.full((rpm.size, 1), most if start is not None else min(0.7, most))
    eye = np.eye(n)[None]
    for k in range(rounds):
        h = np.clip((airspeed + induced) / (omega * R), tw.H_GRID[0], tw.H_GRID[-1])
        load = np.clip(induced / np.maximum(airspeed + induced, 1e-3), 0.0, 1.0)
        ma = tw.interpolate(axial_t, h, load) / R
        ms = tw.interpolate(swirl_t, h, load) / R
        if ducted:
            ma = ma + seal * tw.interpolate(image_a, h, load) / R
            ms = ms + seal * tw.interpolate(image_s, h, load) / R
            # Bernoulli across the rotor gives the jet: w (V + w/2) = Omega B Gamma / 2 pi, mean over the annulus;
            # it replaces the mean of the open wake's tube
            share = (B * dr * r / np.sum(dr * r))[None, :] / (2.0 * np.pi)
            per_w = np.asarray(extra["duct"])[None, :, None]
            ma = ma + (share * (omega / np.maximum(airspeed + 0.5 * jet, 1e-3))[:, None])[:, None, :] * per_w
            ma = ma - 0.5 * (share / (h * R)[:, None])[:, None, :]
        ma = ma * factor[:, :, None]
        ua, ut, wa, wt, w, cl, _cd, alpha = section(gamma, ma, ms)
        if k % 3 == 0 or k == 1:
            rise = (forces(alpha + 2e-3, w)[0] - cl) / 2e-3
        wanted = 0.5 * w * rotor.chord * cl
        miss = wanted - gamma
        # Newton; a lower bound on the lift slope keeps it stable through the stall
        slope = 0.5 * rotor.chord * wt / np.maximum(w, 1e-6) * np.maximum(rise, 1.0 if most > 0.3 else -1.5)
        jacobian = eye + slope[:, :, None] * ma
        move = np.linalg.solve(jacobian, miss[:, :, None])[:, :, 0]
        gamma = gamma + step * move
        new = np.maximum(np.abs(gamma).max(axis=1), 1e-9)
        now = np.abs(miss).max(axis=1) / new
        step = np.where((now > change)[:, None], np.maximum(0.6 * step, 0.03), np.minimum(1.15 * step, most))
        weights = np.abs(gamma) * r * dr + 1e-12
        fresh = np.sum(ua * weights, axis=1) / np.sum(weights, axis=1)
        if ducted:
            head = B * omega / np.pi * np.sum(gamma * r * dr, axis=1) / np.sum(r * dr)
            jet = jet + 0.5 * (np.sqrt(np.maximum(airspeed**2 + head, 0.0)) - airspeed - jet)
        drift = np.abs(fresh - induced) / (omega * R)
        induced = np.maximum(induced + 0.7 * (fresh - induced), -0.4 * np.maximum(airspeed, 0.0))
        change = now
        if np.all(now < _TOLERANCE) and np.all(drift < _TOLERANCE):
            break
    ua, ut, wa, wt, w, cl, cd, _ = section(gamma, ma, ms)
    q = 0.5 * rho[:, None] * w * rotor.chord * dr
    thrust = B * np.sum(q * (cl * wt - cd * wa), axis=1)
    torque = B * np.sum(q * (cl * wa + cd * wt) * r, axis=1)
    residual = np.maximum(change, drift)
    good = residual < _GOOD
    at75 = int(np.argmin(np.abs(rotor.x - 0.75)))
    return TrueAnswer(
        np.where(good, thrust, np.nan), np.where(good, torque, np.nan), good, gamma, ua, ut, induced,
        jet if ducted else np.full_like(jet, np.nan),
        rho * w[:, at75] * rotor.chord[at75] / mu, omega * R / sound, residual,
    )  # fmt: skip
