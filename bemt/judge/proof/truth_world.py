"""World of the truth: everything that acts on a rotor between its blades and the load cell's flange.

`World` says what is there and how strong, `Conditions` where and when; `loads` gives thrust and torque.  Every
correction has another form than the one in the solver's library (named in `World`), so that a diagnosis never fits the
formula that made the data.

A duct is a wall of ring vortices that cancel the flow through it; from the trailing edge on, a semi-infinite vortex
tube of strength w (jet over outer speed) goes straight back.  What the rings do at the rotor disk is linear in w and in
the speed of flight, and is solved once per duct shape.  The jet's speed follows from Bernoulli across the rotor, the
whole thrust from the mass flow that the rings let through: T = rho A (V + u) w.

The blades are those of `bemt.judge.proof.truth`, or of CCBlade of WISDEM (extra ``wisdem``), somebody else's
blade-element momentum code, which shares no line with this project's solver.  It gives no loads at rest and knows
uniform axial flow only; what an item may conceal with it is in `EXPRESSIBLE`.  Sections are those of
`bemt.judge.proof.truth_section`.

References
----------
.. [1] D. Kuechemann, J. Weber, "Aerodynamics of Propulsion", 1953, ch. 3-4 (ring-vortex method; not checked).
.. [2] S. A. Ning, "A simple solution method for the blade element momentum equations with guaranteed convergence",
       Wind Energy 17(9), 2014, DOI 10.1002/we.1636.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.judge.proof import truth
from bemt.judge.proof import truth_section as ts
from bemt.judge.proof.truth_section import SectionPhysics

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
    physics: ts.SectionPhysics, around: truth.Around,
) -> truth.TrueAnswer:  # fmt: skip
    """Loads of an open rotor in axial flow."""
    try:
        from wisdem.ccblade.ccblade import CCBlade
    except ImportError as error:
        raise InputError(
            Fault("", "wisdem", "a package that is not installed", "CCBlade", "pip install 'bemt[wisdem]'")
        ) from error
    if around.duct is not None or np.any(around.axial) or np.any(around.induction != 1.0):
        raise ValueError("CCBlade models uniform axial flow only")
    P, N, R = rpm.size, rotor.x.size, rotor.radius
    rho, mu, sound = truth.air(temperature_C, pressure_Pa)
    omega = rpm * (2.0 * np.pi / 60.0)
    beta = rotor.twist + np.broadcast_to(around.twist, (P, N))
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


_PHI = (np.arange(96) + 0.5) * (2.0 * np.pi / 96)


@dataclass(frozen=True)
class TruthDuct:
    """Shape of a duct; lengths over the tip radius."""

    # Length; rotor plane behind the lip. [-]
    length: float
    position: float
    gap: float = 0.01  # Tip clearance over the tip radius. [-]
    exit_ratio: float = 1.0  # Exit area over the area of the rotor annulus. [-]
    lip_radius: float = 0.1  # Radius of the lip over the tip radius. [-]


def ring_speed(x: Array, z: Array, a: Array) -> tuple[Array, Array]:
    """Axial and radial speed of unit ring vortices. [-]"""
    x, z, a = np.broadcast_arrays(x, z, a)
    cos = np.cos(_PHI)
    s2 = (a**2 + x**2 + z**2)[..., None] - 2.0 * (a * x)[..., None] * cos
    k = a[..., None] / np.maximum(s2, 1e-8) ** 1.5 / (2.0 * _PHI.size)
    return np.sum(k * (a[..., None] - x[..., None] * cos), axis=-1), np.sum(k * z[..., None] * cos, axis=-1)


def tube_speed(x: Array, z: Array, a: float) -> tuple[Array, Array]:
    """Axial and radial speed of a semi-infinite vortex tube of unit strength that begins at z = 0 and goes to +z."""
    x, z = np.broadcast_arrays(np.asarray(x, float), np.asarray(z, float))
    cos = np.cos(_PHI)
    s2 = np.maximum((a**2 + x**2)[..., None] - 2.0 * a * x[..., None] * cos, 1e-8)
    root = np.sqrt(s2 + z[..., None] ** 2)
    axial = np.mean(a * (a - x[..., None] * cos) / s2 * (1.0 + z[..., None] / root), axis=-1) / 2.0
    radial = -np.mean(a * cos / root, axis=-1) / 2.0
    return axial, radial


@lru_cache(maxsize=64)
def disk_speeds(duct: TruthDuct, hub: float, x: tuple[float, ...]) -> tuple[Array, Array]:
    """Axial speed at the rotor disk per jet excess w and per speed of flight. [-]"""
    wall = 1.0 + duct.gap
    # the hub ends behind the rotor: the jet fills a circle of the exit's area
    leave = np.sqrt(duct.exit_ratio * (wall**2 - hub**2) + hub**2)
    m = 40
    ends = duct.length * 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, m + 1)))
    aft = max(duct.length - duct.position, 1e-6)

    def radius(z: Array) -> Array:
        # a rounded lip opens the mouth; behind the rotor the wall goes straight to the exit
        mouth = duct.lip_radius * np.maximum(1.0 - z / max(duct.lip_radius, 1e-9), 0.0) ** 2
        return np.asarray(wall + mouth + (leave - wall) * np.clip((z - duct.position) / aft, 0.0, 1.0))

    rings, points = ends[:-1] + 0.25 * np.diff(ends), ends[:-1] + 0.75 * np.diff(ends)
    slope = (radius(points + 1e-4) - radius(points - 1e-4)) / 2e-4
    axial, radial = ring_speed(radius(points)[:, None], points[:, None] - rings[None, :], radius(rings)[None, :])
    matrix = radial - slope[:, None] * axial
    ta, tr = tube_speed(radius(points), points - duct.length, float(radius(np.array(duct.length))))
    right = np.stack([-(tr - slope * ta), slope], axis=1)  # for w = 1 and for V = 1
    # the strength per length at the trailing edge runs on into the tube; wider of two conditions, by least squares
    kutta = np.zeros((1, m))
    kutta[0, -1] = 1.0
    scale = 10.0
    matrix = np.vstack([matrix, scale * kutta])
    right = np.vstack([right, [[scale * np.diff(ends)[-1], 0.0]]])
    strengths = np.linalg.lstsq(matrix, right, rcond=None)[0]
    at = np.asarray(x)
    axial, _ = ring_speed(at[:, None], duct.position - rings[None, :], radius(rings)[None, :])
    tube = tube_speed(at, np.full(at.size, duct.position - duct.length), float(radius(np.array(duct.length))))[0]
    out = axial @ strengths
    return out[:, 0] + tube, out[:, 1]


def seal(gap_over_span: Array, scale: float) -> Array:
    """Strength of the images of the tip vortices in the wall behind a gap. [-]

    Notes
    -----
    1 / (1 + g / 0.03): half of the image is lost at 3 % of the span (declared; gives one to two points of thrust per
    point of gap over span).
    """
    return np.asarray(1.0 / (1.0 + scale * np.asarray(gap_over_span) / 0.03))


@dataclass(frozen=True)
class World:
    """What is really there.  The defaults are a plain rotor in free, quiet air with all its section physics."""

    section: SectionPhysics = field(default_factory=SectionPhysics)  # Reynolds, Mach and rotation in the sections
    pitch_offset: float = 0.0  # Every blade angle is larger by this. [deg]
    # Elastic turn of the tip at ``untwist_at``; along the blade the integral of torsion moment over stiffness. [deg]
    untwist: float = 0.0
    untwist_at: float = 1.0  # rho Omega^2 where the tip turns by ``untwist``. [kg/m3/s2]
    leak: float = 1.0  # Scale of the leakage over the tips of a ducted rotor, 1 is real. [-]
    lip: float = 0.0  # Head that an inlet loses behind its lip once that has separated, over 1/2 rho (w - V)^2. [-]
    ground: float = 0.0  # Scale of the images of the wake in a wall behind the rotor, 1 is real. [-]
    # Onset speed over induced speed when the room has been stirred up for long; time to half of it. [-], [s]
    recirculation: float = 0.0
    recirculation_time: float = 5.0
    blockage: float = 0.0  # Rotor over tunnel area: the stream outside the slipstream slows down by continuity. [-]
    # Radius of a body behind the rotor over R, whose half-body flow slows the root; its tare drag on pi R^2. [-]
    nacelle: float = 0.0
    nacelle_cd: float = 0.0
    oblique: float = 0.0  # Angle of the stream to the axis: azimuth by azimuth with Pitt-Peters skew. [deg]
    inflow_lag: float = 0.0  # Time by which induced flow follows the load. [s]
    inertia: float = 0.0  # Rotor inertia, seen by a torque cell under the motor. [kg m2]
    density_error: float = 0.0  # Real density over the one that the air data say, less 1. [-]
    # Share of thrust and torque lost at the peak of a blade's resonance; where. [-], [rev/min]
    resonance: float = 0.0
    resonance_rpm: float = 6000.0
    bearing: float = 0.0  # Viscous drag of a bearing behind the torque cell, at 10,000 rev/min. [N m]


@dataclass(frozen=True)
class Conditions:
    """Where and when each of P rows of a recording was taken; real values, not recorded ones."""

    # (P,) [rev/min], [m/s], [C], [Pa]
    rpm: Array
    airspeed: Array
    temperature_C: Array
    pressure_Pa: Array
    time: Array  # (P,) Since the first row. [s]
    since_start: Array  # (P,) Since the rotor of this run was started. [s]
    wall: Array  # (P,) Distance to a wall behind the rotor, NaN without one. [m]
    gap: Array  # (P,) Tip clearance in a duct, NaN without one. [m]
    run: NDArray[np.int64]  # (P,) Number of the run
    transient: bool = False  # Whether the rows are one history in time rather than settled points


@dataclass(frozen=True)
class TrueLoads:
    """Real loads of P rows."""

    # (P,) On the shaft and the duct together [N], on the shaft [N m]; NaN where the rotor has no solution
    thrust: Array
    torque: Array
    # (P,) Reynolds number at 0.75 R; tip Mach number. [-]
    re75: Array
    m_tip: Array
    answer: truth.TrueAnswer  # What the rotor does, to begin another solution from


def torsion(rotor: truth.TruthRotor) -> Array:
    """Turn along the blade over that of the tip: moment ~ chord^2 r^2 gathered from the tip, stiffness ~ chord^4."""
    x, c, dx = rotor.x, rotor.chord / rotor.radius, np.diff(rotor.edges)
    moment = np.cumsum((c**2 * x**2 * dx)[::-1])[::-1]
    turn = np.cumsum(moment / np.maximum(c, 0.25 * c.max()) ** 4 * dx)
    return np.asarray(turn / turn[-1])


def _wall_factor(x: Array, distance: Array) -> Array:
    """Share of the wake's downwash that is left before a wall, (P, N): the wake ends there, its image blows back.

    Vortex tubes of the contracted wake from the disk to the wall and, of opposite sense, from the wall to twice the
    distance, as M. Knight and R. A. Hefner did (NACA TN 835, 1941).  Mixing and the turn along the wall leave a share
    of that, declared so that the power at given thrust falls as J. S. Hayden's flight tests say (AHS Forum 32, 1976:
    P / P_free = 1 / (0.9926 + 0.0379 (2 R / z)^2); not checked against the paper).
    """
    out = np.ones((distance.size, x.size))
    radius, left = 0.78, 0.6
    inside = np.minimum(x, radius - 0.08)
    here = tube_speed(inside, np.zeros(x.size), radius)[0]
    for z in np.unique(distance[np.isfinite(distance)]):
        wall = tube_speed(inside, np.full(x.size, -z), radius)[0]
        far = tube_speed(inside, np.full(x.size, -2.0 * z), radius)[0]
        out[distance == z] = 1.0 - left * (2.0 * wall - far) / here
    return out


def _solve(
    rotor: truth.TruthRotor, c: Conditions, pressure: Array, world: World, around: truth.Around,
    start: truth.TrueAnswer | None,
) -> truth.TrueAnswer:  # fmt: skip
    v = c.airspeed * np.cos(np.radians(world.oblique))
    if rotor.code == "ccblade":
        return solve(rotor, c.rpm, v, c.temperature_C, pressure, world.section, around)
    return truth.solve(rotor, c.rpm, v, c.temperature_C, pressure, world.section, around, start)


def loads(
    rotor: truth.TruthRotor, world: World, c: Conditions, duct: TruthDuct | None = None,
    start: truth.TrueAnswer | None = None,
) -> TrueLoads:  # fmt: skip
    """Thrust and torque of every row."""
    pressure = c.pressure_Pa * (1.0 + world.density_error)
    rho = truth.air(c.temperature_C, pressure)[0]
    omega = c.rpm * (2.0 * np.pi / 60.0)
    area = np.pi * rotor.radius**2
    shape = (c.rpm.size, rotor.x.size)
    twist = np.full(shape, np.radians(world.pitch_offset))
    twist = twist + np.radians(world.untwist) * np.outer(rho * omega**2 / world.untwist_at, torsion(rotor))
    around = truth.Around(twist=twist)
    span = (1.0 - rotor.hub) * rotor.radius
    leak = np.zeros(c.rpm.size)
    per_v: Array = np.zeros(rotor.x.size)
    if duct is not None:
        per_w, per_v = disk_speeds(duct, rotor.hub, tuple(rotor.x))
        gap = np.where(np.isfinite(c.gap), c.gap, duct.gap * rotor.radius) / span
        leak = world.leak * gap
        around = replace(around, duct=per_w, seal=seal(gap, world.leak))
        if world.lip:
            # suction peak over head of the lip, with the flow that turns into the mouth; separates gradually above 4
            bears = np.full(c.rpm.size, 240.0 * duct.lip_radius)
            around = replace(around, lip=np.full(c.rpm.size, world.lip), lip_bears=bears)
    if world.ground and np.any(np.isfinite(c.wall)):
        near = _wall_factor(rotor.x, c.wall / rotor.radius) - 1.0
        around = replace(around, induction=1.0 + world.ground * near)
    along = c.airspeed * np.cos(np.radians(world.oblique))
    axial = np.outer(along, per_v)
    if world.nacelle:
        # Rankine half body of this radius, its nose half a radius behind the disk: axial speed of its point source
        x2 = rotor.x**2
        axial = axial - np.outer(along, 0.25 * world.nacelle**2 * 0.5 / (x2 + 0.25) ** 1.5)
    around = replace(around, axial=axial)
    if world.recirculation or world.blockage or world.inflow_lag or world.oblique:
        first = start = _solve(rotor, c, pressure, world, around, start)
        vi = np.nan_to_num(first.induced)
        if world.recirculation:
            stirred = c.since_start / (c.since_start + world.recirculation_time)
            fade = 1.0 / (1.0 + (along / np.maximum(vi, 1e-3)) ** 2)
            axial = axial + (world.recirculation * vi * stirred * fade)[:, None]
        if world.blockage:
            stream = (along + vi) / np.maximum(along + 2.0 * vi, 1e-3)
            axial = axial - (0.5 * world.blockage * 2.0 * vi * stream * (along > 0.05))[:, None]
        if world.inflow_lag and c.transient:
            late = _two_stage_lag(c.time, vi, world.inflow_lag)
            axial = axial + (late - vi)[:, None]
        around = replace(around, axial=axial)
    how = _round if world.oblique else _solve
    answer = how(rotor, c, pressure, world, around, start)
    thrust, torque = answer.thrust, answer.torque
    if duct is not None:
        thrust = (thrust + _shroud(rotor, duct, rho, along, per_v, answer)) * (1.0 - 1.3 * leak)
        torque = torque * (1.0 - 0.5 * leak)
    if world.nacelle_cd:
        slip = along + 2.0 * np.maximum(np.nan_to_num(answer.induced), 0.0)
        thrust = thrust - 0.5 * rho * slip**2 * world.nacelle_cd * area
    if world.resonance:
        bell = 1.0 / (1.0 + ((c.rpm - world.resonance_rpm) / (0.035 * world.resonance_rpm)) ** 2)
        thrust, torque = thrust * (1.0 - world.resonance * bell), torque * (1.0 + 0.6 * world.resonance * bell)
    if world.bearing:
        torque = torque + world.bearing * (c.rpm / 1e4)
    if world.inertia and c.transient:
        torque = torque + world.inertia * np.gradient(omega, c.time)
    return TrueLoads(thrust, torque, answer.re75, answer.m_tip, answer)


def _shroud(
    rotor: truth.TruthRotor, duct: TruthDuct, rho: Array, along: Array, per_v: Array, answer: truth.TrueAnswer
) -> Array:
    """Thrust of the duct alone: that of the mass flow, less the blades' and the friction."""
    ring = rotor.x * np.diff(rotor.edges)
    through = np.sum((along[:, None] * (1.0 + per_v) + answer.ua) * ring, axis=1) / np.sum(ring)
    whole = rho * (np.pi * rotor.radius**2) * (1.0 - rotor.hub**2) * through * answer.jet
    skin = 0.5 * rho * (0.006 * 2.0 * np.pi * rotor.radius**2 * duct.length) * (through**2 + along**2)
    return np.asarray(whole - answer.thrust - skin)


def _two_stage_lag(time: Array, target: Array, lag: float) -> Array:
    """Two first-order stages in row, half of the time each: near wake, then far wake."""
    near, far, out = target[0], target[0], np.empty_like(target)
    for i, aim in enumerate(target):
        dt = 0.0 if i == 0 else max(time[i] - time[i - 1], 0.0)
        k = 1.0 - np.exp(-dt / (0.5 * lag))
        near += k * (aim - near)
        far += k * (near - far)
        out[i] = far
    return out


def _round(
    rotor: truth.TruthRotor, c: Conditions, pressure: Array, world: World, around: truth.Around,
    start: truth.TrueAnswer | None,
) -> truth.TrueAnswer:  # fmt: skip
    """Mean of eight azimuths of a blade in a stream across the disk.

    Induced speed is skewed by 15 pi / 32 tan(chi / 2) r/R cos psi (D. M. Pitt and D. A. Peters, Vertica 5, 1981).
    """
    first = _solve(rotor, c, pressure, world, around, start)
    across = c.airspeed * np.sin(np.radians(world.oblique))
    vi = np.maximum(np.nan_to_num(first.induced), 0.0)
    into = c.airspeed * np.cos(np.radians(world.oblique)) + vi
    # Glauert's mean induced speed: the resultant flow feeds the disk
    feed = np.maximum(into, 1e-3) / np.hypot(np.maximum(into, 1e-3), across)
    chi = np.arctan2(across, np.maximum(into, 1e-3))
    skew = 15.0 * np.pi / 32.0 * np.tan(0.5 * chi)
    parts = []
    for psi in np.arange(8) * (np.pi / 4.0):
        more = replace(
            around, tangential=np.broadcast_to((across * np.sin(psi))[:, None], (c.rpm.size, rotor.x.size)),
            axial=around.axial + np.outer(vi * skew * np.cos(psi) * feed, rotor.x),
            induction=feed[:, None] * np.broadcast_to(around.induction, (c.rpm.size, rotor.x.size)),
        )  # fmt: skip
        parts.append(_solve(rotor, c, pressure, world, more, first))
    return replace(
        first, thrust=np.mean([p.thrust for p in parts], axis=0), torque=np.mean([p.torque for p in parts], axis=0)
    )
