"""Truth of the proof: a vortex rotor, lifting lines with helical wakes and their own Kutta-Joukowski balance.

Each blade is a lifting line of horseshoe vortices, which sheds one filament per panel edge.  All filaments of a rotor
share one advance h per radian (a regular helicoid, Betz's condition [3]_) and one contraction; both follow the speed
that the rotor itself induces, so the influence of a wake is a table over (h, load) that depends on the blade count and
the panel radii only.  Biot-Savart on straight segments; the part of the wake beyond `REACH` radii counts as a vortex
tube.  On every panel the circulation equals that of the section's lift in the local flow.  No momentum theory, no
tip-loss factor: finite blade number, swirl and hub come out of Biot-Savart.  All operating points of a recording are
solved at once.

References
----------
.. [1] A. J. Landgrebe, "The wake geometry of a hovering helicopter rotor and its influence on rotor performance",
       J. American Helicopter Society 17(4), 1972: r/R = A + (1 - A) exp(-Lambda psi), A = 0.78, and a wake that
       speeds up behind the next blade (coefficients not checked against the paper).
.. [2] J. E. Kerwin, C.-S. Lee, J. SNAME Transactions 86, 1978 (moderately loaded lifting line and lattice).
.. [3] A. Betz, "Schraubenpropeller mit geringstem Energieverlust", 1919.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.judge.proof import truth_section as ts

H_GRID: Array = np.geomspace(0.02, 2.0, 21)
"""Advance of the wake per radian over the tip radius. [-]"""
LOADS: Array = np.array([0.0, 0.2, 0.45, 0.72, 1.0])
"""Share of the induced speed in the speed of the wake: 0 cruise, 1 hover. [-]"""
REACH = 5.0
HOVER_CONTRACTION = 0.78  # [1]
# Axial speed over the mean induced one, before and after the next blade has passed.  The tip vortex dwells under its
# blade [1: 0.25 CT/sigma over sqrt(CT/2), CT/sigma of 0.05 to 0.15]; then it goes at half the speed of the stream that
# it bounds, which continuity gives: 1 / contraction^2.  The inner sheet goes with that stream.
STREAM = 1.0 / HOVER_CONTRACTION**2
TIP_SPEEDS = (0.3, 0.5 * STREAM)
SHEET_SPEEDS = (1.1, STREAM)
ROLL_UP = (0.78, 0.92)  # r/R where filaments belong to the sheet and to the tip vortex
_RATE = 0.35  # Lambda of [1] is 0.145 + 27 CT_rotor per radian, at CT_rotor = 0.0076
_CORE = 0.01  # viscous core over tip radius


def edges_and_centres(hub: float, panels: int) -> tuple[Array, Array]:
    """Panel edges and control radii from hub to tip, finer at both ends."""
    half = np.arange(2 * panels + 1) * (np.pi / (2 * panels))
    x = hub + (1.0 - hub) * 0.5 * (1.0 - np.cos(half))
    return x[::2], x[1::2]


def _ages(h: float) -> Array:
    """Wake ages of the segment ends [rad]: fine behind the blade, coarser where the wake is far."""
    near = np.concatenate(([0.0], np.cumsum(np.geomspace(0.02, 0.25, 60))))
    last = max(REACH / h, near[-1] + 1.0)
    return np.concatenate((near, np.linspace(near[-1], last, max(int((last - near[-1]) / 0.45), 2) + 1)[1:]))


def _path(edges: Array, psi: Array, blades: int, load: float) -> tuple[Array, Array]:
    """Radius over the one at birth and axial way over h, (E, S), of the filaments at the given wake ages."""
    final = 1.0 - (1.0 - HOVER_CONTRACTION) * (1.0 - np.sqrt(1.0 / (1.0 + load))) / (1.0 - np.sqrt(0.5))
    shrink = final + (1.0 - final) * np.exp(-_RATE * psi)
    late = np.maximum(psi - 2.0 * np.pi / blades, 0.0)
    tip = TIP_SPEEDS[0] * (psi - late) + TIP_SPEEDS[1] * late
    sheet = SHEET_SPEEDS[0] * (psi - late) + SHEET_SPEEDS[1] * late
    w = np.clip((edges - ROLL_UP[0]) / (ROLL_UP[1] - ROLL_UP[0]), 0.0, 1.0)[:, None]
    way = (1.0 - load) * psi[None, :] + load * (w * tip[None, :] + (1.0 - w) * sheet[None, :])
    return np.broadcast_to(shrink, way.shape), way


def _influence(x: Array, edges: Array, births: Array, blades: int, h: float, load: float) -> tuple[Array, Array]:
    """Axial and tangential speed at radii x from unit filaments (N, E), length unit R, per unit circulation.

    ``births`` are the radii where the filaments begin; ``edges`` decide how they move.
    """
    psi = _ages(h)
    shrink, way = _path(edges, psi, blades, load)
    r, z = births[:, None] * shrink, h * way
    axial, tangential = np.zeros((x.size, edges.size)), np.zeros((x.size, edges.size))
    for b in range(blades):
        angle = 2.0 * np.pi * b / blades - psi
        px, py = r * np.cos(angle), r * np.sin(angle)
        ax, ay, az = px[:, :-1], py[:, :-1], z[:, :-1]
        dx, dy, dz = np.diff(px), np.diff(py), np.diff(z)
        for i, radius in enumerate(x):
            # from the point to both ends; Biot-Savart of a straight segment with a core
            ux, uy, uz = ax - radius, ay, az
            vx, vy, vz = ux + dx, uy + dy, uz + dz
            cy, cz = uz * vx - ux * vz, ux * vy - uy * vx
            nu, nv = np.sqrt(ux * ux + uy * uy + uz * uz), np.sqrt(vx * vx + vy * vy + vz * vz)
            dot = ux * vx + uy * vy + uz * vz
            k = (nu + nv) / (nu * nv * (nu * nv + dot) + _CORE**2 * (nu * nv)) / (4.0 * np.pi)
            axial[i] += np.sum(k * cz, axis=1)
            tangential[i] += np.sum(k * cy, axis=1)
    # beyond the reach: a tube of rings, on its axis
    slope = (z[:, -1] - z[:, -2]) / (psi[-1] - psi[-2])
    tail = 0.5 * blades / (2.0 * np.pi * np.maximum(slope, 1e-9)) * (1.0 - z[:, -1] / np.hypot(z[:, -1], r[:, -1]))
    return -axial + tail[None, :], -tangential


def _horseshoe(filament: Array) -> Array:
    """Panels from filaments: circulation of a panel leaves at its outer edge and comes in at its inner one."""
    return filament[:, 1:] - filament[:, :-1]


@lru_cache(maxsize=64)
def wake_tables(hub: float, panels: int, blades: int, hovers: bool) -> tuple[Array, Array]:
    """Influence of the panels on each other over wake advance and load. [-]"""
    edges, x = edges_and_centres(hub, panels)
    loads = LOADS if hovers else np.array([0.0])
    out = np.empty((2, H_GRID.size, loads.size, panels, panels))
    for i, h in enumerate(H_GRID):
        for j, c in enumerate(loads):
            a, t = _influence(x, edges, edges, blades, float(h), float(c))
            out[0, i, j], out[1, i, j] = _horseshoe(a) * h, _horseshoe(t) * h
    return out[0], out[1]


@lru_cache(maxsize=32)
def image_tables(hub: float, panels: int, blades: int, wall: float) -> tuple[Array, Array]:
    """Influence of the image of the wake in a coaxial wall, without its mean axial flow.

    Notes
    -----
    The image of a filament at r is one of opposite sense at wall^2 / r.  Inside the tube of the images the mean axial
    speed is uniform and belongs to the duct's own rings, so it is taken out here.
    """
    edges, x = edges_and_centres(hub, panels)
    image = wall**2 / edges
    out = np.empty((2, H_GRID.size, 1, panels, panels))
    for i, h in enumerate(H_GRID):
        a, t = _influence(x, edges, image, blades, float(h), 0.0)
        mean = 0.5 * blades / (2.0 * np.pi * h)
        out[0, i, 0], out[1, i, 0] = -_horseshoe(a - mean) * h, -_horseshoe(t) * h
    return out[0], out[1]


def interpolate(table: Array, h: Array, load: Array) -> Array:
    """Influence matrices at the wakes of P points, (P, N, N) [-]."""
    u = np.clip(np.log(h / H_GRID[0]) / np.log(H_GRID[1] / H_GRID[0]), 0.0, H_GRID.size - 1.0001)
    i = u.astype(np.intp)
    f = (u - i)[:, None, None]
    if table.shape[1] == 1:
        out = (1.0 - f) * table[i, 0] + f * table[i + 1, 0]
    else:
        w = np.clip(np.interp(load, LOADS, np.arange(LOADS.size)), 0.0, LOADS.size - 1.0001)
        j = w.astype(np.intp)
        g = (w - j)[:, None, None]
        out = (1.0 - f) * ((1.0 - g) * table[i, j] + g * table[i, j + 1])
        out += f * ((1.0 - g) * table[i + 1, j] + g * table[i + 1, j + 1])
    return np.asarray(out / np.clip(h, H_GRID[0], H_GRID[-1])[:, None, None])


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
        return edges_and_centres(self.hub, self.panels)[0]

    @cached_property
    def x(self) -> Array:
        """Control radii r/R, (N,). [-]"""
        return edges_and_centres(self.hub, self.panels)[1]

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


@dataclass(frozen=True)
class Around:
    """What meets the blades of a rotor in its stream, at P points x N elements or what spreads to them."""

    axial: Array = field(default_factory=lambda: np.zeros(1))  # Speed more than the stream's [m/s]
    tangential: Array = field(default_factory=lambda: np.zeros(1))  # The same against the rotation [m/s]
    twist: Array = field(default_factory=lambda: np.zeros(1))  # More than the blade's [rad]
    induction: Array = field(default_factory=lambda: np.ones(1))  # Factor on what the blades induce [1]
    seal: Array = field(default_factory=lambda: np.ones(1))  # (P,) Share of the images that a duct has at the gap [1]
    duct: Array | None = None  # (N,) Axial speed of a duct over that of its jet [1]; none: an open rotor
    # (P,) Head lost behind the lip over the mouth's, and the head ratio that it bears [1]
    lip: Array | None = None
    lip_bears: Array | None = None


def solve(
    rotor: TruthRotor, rpm: Array, airspeed: Array, temperature_C: Array, pressure_Pa: Array,
    physics: ts.SectionPhysics | None = None, around: Around | None = None, start: TrueAnswer | None = None,
) -> TrueAnswer:  # fmt: skip
    """Find circulations and loads at P points at once."""
    rpm, airspeed, temperature, pressure = (
        np.atleast_1d(v)
        for v in np.broadcast_arrays(*(np.asarray(v, float) for v in (rpm, airspeed, temperature_C, pressure_Pa)))
    )
    state = [rpm, airspeed, *air(temperature, pressure)]
    more, shape = around or Around(), (rpm.size, rotor.x.size)
    spread = {key: np.broadcast_to(getattr(more, key), shape) for key in ("axial", "tangential", "twist", "induction")}
    more = replace(more, **spread, seal=np.broadcast_to(more.seal, rpm.shape))
    physics = physics or ts.SectionPhysics()
    answer = _solve(rotor, state, physics, more, *_STAGES[0], start)
    for stage in _STAGES[1:]:
        lost = np.flatnonzero(~(answer.residual < _TIGHT))
        if not lost.size:
            break
        fewer = replace(more, **{k: v[lost] for k, v in vars(more).items() if k != "duct" and v is not None})
        so_far = replace(answer, **{name: value[lost] for name, value in vars(answer).items()})
        again = _solve(rotor, [v[lost] for v in state], physics, fewer, *stage, so_far)
        for name, value in vars(again).items():
            getattr(answer, name)[lost] = value
    return answer


def _solve(
    rotor: TruthRotor, state: list[Array], physics: ts.SectionPhysics, around: Around, rounds: int, most: float,
    start: TrueAnswer | None,
) -> TrueAnswer:  # fmt: skip
    """Iterate circulations, wake and jet of all points; ``most`` is the largest Newton step."""
    rpm, airspeed, rho, mu, sound = state
    R, B, n = rotor.radius, rotor.blades, rotor.x.size
    r, dr = rotor.x * R, np.diff(rotor.edges) * R
    omega = rpm * (2.0 * np.pi / 60.0)
    shape = (rpm.size, n)
    va = airspeed[:, None] + around.axial
    vt = omega[:, None] * r + around.tangential
    twist = rotor.twist + around.twist
    factor = around.induction
    ducted = around.duct is not None
    axial_t, swirl_t = wake_tables(rotor.hub, rotor.panels, B, not ducted)
    if ducted:
        image_a, image_s = image_tables(rotor.hub, rotor.panels, B, float(rotor.wall))
        seal = around.seal[:, None, None]
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
    left = np.ones_like(rpm)  # of the rotor's head, behind the lip
    gamma = np.zeros(shape)
    if start is not None:
        gamma, induced = start.circulation.copy(), start.induced.copy()
        jet = np.where(np.isfinite(start.jet), start.jet, jet)
    most_gamma = 1.5 * np.hypot(airspeed, omega * R)[:, None] * rotor.chord  # A lift coefficient of 3: none runs away
    change = np.full(rpm.shape, np.inf)
    step = np.full((rpm.size, 1), most if start is not None else min(0.7, most))
    eye = np.eye(n)[None]
    for k in range(rounds):
        h = np.clip((airspeed + induced) / (omega * R), H_GRID[0], H_GRID[-1])
        load = np.clip(induced / np.maximum(airspeed + induced, 1e-3), 0.0, 1.0)
        ma = interpolate(axial_t, h, load) / R
        ms = interpolate(swirl_t, h, load) / R
        if ducted:
            ma = ma + seal * interpolate(image_a, h, load) / R
            ms = ms + seal * interpolate(image_s, h, load) / R
            # Bernoulli across the rotor gives the jet: w (V + w/2) = Omega B Gamma / 2 pi, mean over the annulus;
            # it replaces the mean of the open wake's tube
            share = (B * dr * r / np.sum(dr * r))[None, :] / (2.0 * np.pi)
            per_w = np.asarray(around.duct)[None, :, None]
            ma = ma + (share * (omega * left / np.maximum(airspeed + 0.5 * jet, 1e-3))[:, None])[:, None, :] * per_w
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
        gamma = np.clip(gamma + step * move, -most_gamma, most_gamma)
        new = np.maximum(np.abs(gamma).max(axis=1), 1e-9)
        now = np.abs(miss).max(axis=1) / new
        step = np.where((now > change)[:, None], np.maximum(0.6 * step, 0.03), np.minimum(1.15 * step, most))
        weights = np.abs(gamma) * r * dr + 1e-12
        fresh = np.sum(ua * weights, axis=1) / np.sum(weights, axis=1)
        if ducted:
            head = B * omega / np.pi * np.sum(gamma * r * dr, axis=1) / np.sum(r * dr)
            if around.lip is not None and around.lip_bears is not None:
                mouth = np.maximum(np.sum((va + ua) * r * dr, axis=1) / np.sum(r * dr) - airspeed, 0.0)
                lost = around.lip / (1.0 + np.exp(-(mouth**2 / around.lip_bears - 4.0) / 0.6))
                # At its onset the loss rises three times as fast as the head that drives it: slow, or it oscillates
                left = left + 0.15 * (1.0 / (1.0 + lost * mouth**2 / np.maximum(left * head, 1e-9)) - left)
            jet = jet + 0.5 * (np.sqrt(np.maximum(airspeed**2 + left * head, 0.0)) - airspeed - jet)
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
