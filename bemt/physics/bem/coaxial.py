"""Two rotors on one axis, solved together: each works in what the other induces.  SI, radians.

The annuli of each rotor are balanced by the axial kernel, unchanged; the other rotor enters as an onset velocity of
every annulus.  ``w = V + (from the other) + v`` is the axial velocity in a disk, v the mean that its own annulus
induces (Prandtl's factor times that at the blade).  The wake of either rotor is a bundle of vortex cylinders, one per
edge of its annuli, of strength ``v_j - v_(j+1)``; A(r, z) is what they induce a distance z ahead of their disk
(:func:`bemt.physics.wake.ahead`; superposition: Branlard and Gaunaa 2015, Wind Energy 18(8), "Superposition
of vortex cylinders", not checked).

Upper rotor: the axial onset gains the suction of the lower one, A_lower(r, z).

Lower rotor: inside the wake of the upper one it meets the streamtubes of :mod:`bemt.physics.wake`.

Outside of the wake the lower rotor feels the upwash of the cylinders, -A.  The swirl of the upper wake, twice that in
its disk, keeps its angular momentum; it adds to the speed of blades that turn against it and takes from that of blades
that turn with it.  A rotor has no swirl ahead of it.

With k = 0.707 and a developed wake, a few diameters down, that is the balance of Leishman and Ananthan (2008; equation
numbers not checked), whose lower rotor sees 2 v on half of its area.  Their wake never ends; ours is a jet from 6.2 of
its diameters on.  Limits (tested): both rotors are alone at a great distance; at z = 0 both see the velocity that both
induce, so that equal thrusts cost sqrt(2) times the ideal power of two rotors alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array
from bemt.physics import coefficients as co
from bemt.physics.air import Air
from bemt.physics.bem import kernel as K
from bemt.physics.bem import solver
from bemt.physics.bem.model import Flags, Model
from bemt.physics.dataset import Dataset
from bemt.physics.effects import to_text
from bemt.physics.wake import WAKE_RADIUS, ahead, contracted, hover_gain, streamtubes

if TYPE_CHECKING:
    from bemt.physics.bem.solver import Prepared, Solution
    from bemt.physics.effects import Effect

_TOL, _MOST = 1e-8, 200  # of the tip speed; steps
_MEMORY, _WILD = 5, 20.0  # steps that a next one is made of; their greatest weight
_PASSES = 3  # through the radii of the streamtubes and what the lower rotor adds to their speed there
_OUTSIDE = np.linspace(1.0, 6.0, 251)  # radii outside of the wake, over its own, where the upwash is tabulated
_BLOCK = 512  # points that are solved together, which bounds the memory
_UNSETTLED = "not converged: the exchange between the two rotors did not settle"
_BACKWARDS = "not solved: in descent the wake of the first rotor does not reach the second"
_RAD_PER_RPM = math.pi / 30.0
_REACH = np.array([0.6, 1.0, 1.7])  # speeds of the lower rotor with balanced torques, over that of the upper one


@dataclass(frozen=True, eq=False)
class Pair:
    """Two prepared open rotors on one axis."""

    # The rotor upstream and the one in its wake
    upper: Prepared
    lower: Prepared
    spacing_m: float  # Distance of their disks [m]
    opposite: bool = True  # Whether they turn against each other
    # Radius of the upper rotor's developed wake in hover over its own, 0.707 by momentum theory [1]
    wake_radius: float = WAKE_RADIUS
    interference: float = 1.0  # Factor on all that the rotors induce at each other; 0: two rotors alone [1]
    swirl: float = 1.0  # Share of the upper rotor's swirl that reaches the lower one [1]

    @cached_property
    def _influence(self) -> tuple[Array, Array, Array]:
        """A of the upper rotor at its own stations and outside of its wake, that of the lower at the upper's."""
        upper, lower, z = _edges(self.upper), _edges(self.lower), self.spacing_m
        stations = self.upper.stations.r[:, None]
        outside = self.upper.rotor.R * _OUTSIDE[:, None]
        return ahead(stations, upper[1:], z), ahead(outside, upper[1:], z), ahead(stations, lower[1:], z)

    def _grown(self, upper: _Rotor) -> Array:
        """What hover adds to the induced velocity on the way to the lower disk, s in v (1 + s), (P, 1) [1]."""
        rotor, k = self.upper.rotor, self.wake_radius
        tip = upper.points[:, K.P_OMEGA] * rotor.R
        CT = np.nan_to_num(upper.out[:, K.O_T]) / (upper.points[:, K.P_RHO] * math.pi * rotor.R**2 * tip**2)
        half, end = np.interp([0.5 * rotor.R, rotor.R], self.upper.stations.r, self.upper.stations.beta)
        sigma = rotor.B * float(np.interp(0.75 * rotor.R, self.upper.stations.r, self.upper.stations.chord))
        twist = 2.0 * math.degrees(end - half)
        radius = contracted(self.spacing_m / rotor.R, CT, sigma / (math.pi * rotor.R), twist, rotor.B, k)
        return hover_gain(radius, k)[:, None]


@dataclass(frozen=True, eq=False)
class PairSolution:
    """Results of both rotors at P points; NaN and flagged where either, or their exchange, did not converge."""

    upper: Solution
    lower: Solution
    onset: tuple[Array, Array]  # Mean axial onset of upper and lower, weighted by the area [m/s]
    converged: NDArray[np.bool_]
    steps: int


def _edges(prep: Prepared) -> Array:
    """Edges of the annuli, (N + 1,) [m]."""
    s = prep.stations
    return np.concatenate([s.r - 0.5 * s.dr, [s.r[-1] + 0.5 * s.dr[-1]]])


def _strengths(v: Array) -> Array:
    """Strengths of the vortex cylinders at the outer edges of annuli, (P, N), of the velocities in them [m/s]."""
    return np.asarray(v - np.concatenate([v[:, 1:], np.zeros((v.shape[0], 1))], axis=1))


class _Rotor:
    """One rotor at P points, each with an onset of its own."""

    def __init__(self, prep: Prepared, points: Array) -> None:
        self.prep, self.points = prep, points
        self.entry, self.st, self.tab, self.par = prep.kernel
        n, P = self.st.shape[0], points.shape[0]
        self.out, self.radial = np.empty((P, K.N_OUT)), np.empty((P, n, K.N_RADIAL))
        self.axial, self.swirl = np.zeros((P, n)), np.zeros((P, n))

    def solve(self, which: NDArray[np.intp]) -> None:
        """Balance the annuli of some points with the onset that they have now."""
        st = self.st.copy()
        for p in which:
            st[:, K.S_AXIAL] = self.st[:, K.S_AXIAL] + self.axial[p]
            st[:, K.S_TANG] = self.st[:, K.S_TANG] + self.swirl[p]
            self.entry(self.points[p : p + 1], st, self.tab, self.par, self.out[p : p + 1], self.radial[p : p + 1])

    @property
    def onset(self) -> Array:
        """Axial onset of each annulus, (P, N) [m/s]."""
        own = self.points[:, K.P_V, None] * self.st[:, K.S_AXIAL_FACTOR] + self.st[:, K.S_AXIAL]
        return np.asarray(own + self.axial)

    @property
    def induced(self) -> Array:
        """Mean axial velocity that each annulus induces in the disk, (P, N) [m/s]."""
        return np.asarray(self.radial[:, :, 7] * (self.radial[:, :, 5] - self.onset))

    @property
    def whirl(self) -> Array:
        """Angular momentum behind the disk per mass, r times twice the swirl in it, (P, N) [m2/s]."""
        return np.asarray(2.0 * self.radial[:, :, 7] * self.radial[:, :, 6] * self.prep.stations.r, dtype=float)

    def mean(self) -> Array:
        """Mean of the axial onset over the disk, (P,) [m/s]."""
        s = self.prep.stations
        return np.asarray(self.onset @ (s.r * s.dr) / np.sum(s.r * s.dr))


def solve(pair: Pair, rpm: Array, lower_rpm: Array | None, V: Array, rho: Array, mu: Array, a_sound: Array
          ) -> PairSolution:  # fmt: skip
    """Solve points, (P,) each [rev/min], [m/s], [kg/m3], [Pa s], [m/s].

    ``lower_rpm`` None balances the torques: the speed of the lower rotor at which its torque is that of the upper one.

    Raises ValueError for a rotor in a duct, and for balanced torques of rotors that turn alike.
    """
    if pair.upper.duct is not None or pair.lower.duct is not None:
        raise ValueError("pair: got a ducted rotor; expected two open rotors")
    if lower_rpm is None and not pair.opposite:
        raise ValueError("lower_rpm: got balanced torques of rotors that turn alike; expected opposite senses")
    balanced = lower_rpm is None
    n = np.array(rpm, dtype=float)
    m = n.copy() if lower_rpm is None else np.array(lower_rpm, dtype=float)
    fields = (V, rho, mu, a_sound)
    upper, lower = (
        _Rotor(prep, np.stack([_RAD_PER_RPM * speed, *fields], axis=1))
        for prep, speed in ((pair.upper, n), (pair.lower, m))
    )
    tip = upper.points[:, K.P_OMEGA] * pair.upper.rotor.R
    along = V >= 0.0  # the wake goes from the upper to the lower rotor
    settled = ~along
    mixer = _Anderson()
    x = np.zeros((n.size, upper.axial.shape[1] + 2 * lower.axial.shape[1] + 1))
    cut = np.cumsum([upper.axial.shape[1], lower.axial.shape[1], lower.axial.shape[1]])
    steps = 0
    while steps < _MOST:
        busy = np.flatnonzero(~settled)
        upper.axial, lower.axial, lower.swirl, turned = np.split(x, cut, axis=1)
        lower.points[:, K.P_OMEGA] = _RAD_PER_RPM * m * np.exp(turned[:, 0] / tip)
        upper.solve(busy if steps else np.arange(n.size))
        lower.solve(busy if steps else np.arange(n.size))
        if not busy.size:
            break
        steps += 1
        faster = np.zeros((n.size, 1))
        if balanced:
            with np.errstate(invalid="ignore", divide="ignore"):
                step = 0.5 * np.log(upper.out[:, K.O_Q] / lower.out[:, K.O_Q])
            faster[:, 0] = turned[:, 0] + tip * np.clip(np.where(np.isfinite(step), step, 0.0), -0.3, 0.3)
        new = np.concatenate([*_exchange(pair, upper, lower), faster], axis=1)
        lost = ~np.isfinite(new).all(axis=1)
        new[lost] = 0.5 * x[lost]
        settled = settled | (np.max(np.abs(new - x), axis=1) < _TOL * tip) & ~lost
        x = np.where(settled[:, None], x, mixer.next(x, new))
    return _collected(pair, upper, lower, settled & along, steps)


class _Anderson:
    """Fixed-point steps of many points, each sped up by its last ones (Anderson 1965; Walker and Ni 2011, eq. 2.2)."""

    def __init__(self) -> None:
        self.x: list[Array] = []
        self.f: list[Array] = []

    def next(self, x: Array, new: Array) -> Array:
        """Give the next state of each point, (P, S), from this one and what the fixed-point map makes of it."""
        self.x, self.f = [*self.x, x][-_MEMORY - 1 :], [*self.f, new - x][-_MEMORY - 1 :]
        if len(self.x) < 2:
            return new
        dx, df = (np.diff(np.stack(v, axis=2), axis=2) for v in (self.x, self.f))
        f = self.f[-1]
        normal = np.einsum("psi,psj->pij", df, df)
        size = np.trace(normal, axis1=1, axis2=2)[:, None, None] + 1e-300
        normal = normal + 1e-10 * size * np.eye(normal.shape[1])
        weights = np.linalg.solve(normal, np.einsum("psi,ps->pi", df, f)[..., None])[..., 0]
        # far from linear: the plain step
        weights[np.max(np.abs(weights), axis=1, initial=0.0) > _WILD] = 0.0
        return np.asarray(x + f - np.einsum("psi,pi->ps", dx + df, weights))


def _exchange(pair: Pair, upper: _Rotor, lower: _Rotor) -> tuple[Array, Array, Array]:
    """Axial onset of the upper rotor's annuli, axial and tangential onset of the lower one's, (P, N) [m/s]."""
    inside, outside, suction = pair._influence
    hovering = pair._grown(upper)
    v, V, w = upper.induced, upper.points[:, K.P_V, None], upper.onset + upper.induced
    own = _strengths(v)
    up, low, r = _edges(pair.upper), _edges(pair.lower), pair.lower.stations.r
    drawn, z_over_R = np.zeros_like(v), pair.spacing_m / pair.upper.rotor.R
    for _ in range(_PASSES):
        add, area, kept = streamtubes(v, V, w, v - own @ inside.T, hovering, drawn, z_over_R, pair.wake_radius)
        area = np.diff(up**2) * area
        # radii on which streamtubes arrive, from the axis outwards; the hub's area shrinks as that of all
        hub = up[0] ** 2 * area.sum(axis=1, keepdims=True) / np.sum(np.diff(up**2))
        squares = np.concatenate([hub, area], axis=1).cumsum(axis=1)
        arrive = np.sqrt(0.5 * (squares[:, 1:] + squares[:, :-1]))
        drawn = np.stack([np.interp(at, r, one) for at, one in zip(arrive, lower.induced, strict=True)])
    flux, spin = (np.concatenate([x[:, :1] * squares[:, :1], x * area], axis=1).cumsum(axis=1)
                  for x in (add, kept * upper.whirl))  # fmt: skip
    shares = np.empty((v.shape[0], r.size))
    axial, whirl = np.empty_like(shares), np.empty_like(shares)
    upwash = own @ outside.T
    for p, edge in enumerate(squares):
        bounds = np.concatenate([[0.0], edge])
        of = [np.interp(low**2, bounds, np.concatenate([[0.0], total])) for total in (flux[p], spin[p], edge)]
        axial[p], whirl[p], shares[p] = (np.diff(x) / np.diff(low**2) for x in of)
        axial[p] -= (1.0 - shares[p]) * np.interp(r / math.sqrt(edge[-1]), _OUTSIDE, upwash[p])
    sense = 1.0 if pair.opposite else -1.0
    f = pair.interference
    return f * (_strengths(lower.induced) @ suction.T), f * axial, f * pair.swirl * sense * whirl / r


def _collected(pair: Pair, upper: _Rotor, lower: _Rotor, settled: NDArray[np.bool_], steps: int) -> PairSolution:
    """Results of both rotors, NaN where the pair did not converge."""
    parts = []
    for rotor in (upper, lower):
        rpm = rotor.points[:, K.P_OMEGA] / _RAD_PER_RPM
        out = rotor.out.copy()
        out[~settled, K.O_STATUS] = np.maximum(out[~settled, K.O_STATUS], K.NOT_CONVERGED)
        parts.append(solver._collect(rotor.prep, rpm, rotor.points, out, np.empty((rpm.size, 0, K.N_RADIAL))))
    ok = settled & parts[0].converged & parts[1].converged
    return PairSolution(parts[0], parts[1], (upper.mean(), lower.mean()), ok, steps)


LOADS = ("upper_thrust_N", "upper_torque_Nm", "lower_thrust_N", "lower_torque_Nm", "reaction_torque_Nm")
"""Channels of a pair beside the usual ones, which are totals."""
RATIOS = ("upper_thrust_ratio", "lower_thrust_ratio", "thrust_ratio")
"""Thrust over that of the same rotor alone at the same speeds; of both rotors together."""


@dataclass(frozen=True, eq=False)
class PairModel:
    """Two models on one axis, solved together as one of them is.

    Attributes
    ----------
    upper, lower : Model
        The rotor upstream and the one in its wake.
    spacing_m, opposite, wake_radius, interference, swirl
        As in :class:`Pair`.
    rpm_ratio : float
        Speed of the lower rotor over that of the upper one [1].
    lower_rpm : float or None
        Its speed, if it does not follow that of the upper one [rev/min].
    torque_balance : bool
        Whether the lower rotor turns at the speed of equal torques instead.
    mount_drag : float
        Drag of what carries the lower rotor in the wake of the upper one, over the thrust of that one; it takes from
        the thrust of the lower rotor [1].
    """

    upper: Model
    lower: Model
    spacing_m: float
    opposite: bool = True
    wake_radius: float = WAKE_RADIUS
    interference: float = 1.0
    rpm_ratio: float = 1.0
    lower_rpm: float | None = None
    torque_balance: bool = False
    swirl: float = 1.0
    mount_drag: float = 0.0

    @property
    def rotors(self) -> tuple[Model, Model]:
        """Upper and lower model."""
        return self.upper, self.lower

    @property
    def diameter_m(self) -> float:
        """Diameter of the upper rotor, to which coefficients refer [m]."""
        return self.upper.diameter_m

    @property
    def hub_diameter_m(self) -> float:
        """Hub diameter of the upper rotor [m]."""
        return self.upper.hub_diameter_m

    @property
    def pitch_m(self) -> float:
        """Geometric pitch of the upper rotor at 0.75 R [m]."""
        return self.upper.pitch_m

    @property
    def solidity(self) -> float:
        """Blade area of the upper rotor over its disk area [1]."""
        return self.upper.solidity

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Physics of the upper rotor."""
        return self.upper.effects

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks of the section tables."""
        return tuple(dict.fromkeys((*self.upper.notes, *self.lower.notes)))

    def at_speeds(self, rpm: ArrayLike, V: ArrayLike, air: Air) -> PairModel:
        """Model with the tables of the Reynolds and Mach numbers that these points reach."""
        if self.torque_balance:
            reach = np.multiply.outer(_REACH, rpm)
        else:
            reach = np.asarray(np.multiply(rpm, self.rpm_ratio) if self.lower_rpm is None else self.lower_rpm)
        return replace(self, upper=self.upper.at_speeds(rpm, V, air), lower=self.lower.at_speeds(reach, V, air))

    def solve(
        self, rpm: ArrayLike, V: ArrayLike = 0.0, air: Air | None = None, threads: int = 1, side: ArrayLike = 0.0
    ) -> Dataset:
        """Solve operating points; ``rpm`` is that of the upper rotor, thrust, torque and power are totals.

        Coefficients refer to diameter and speed of the upper rotor. ``reaction_torque_Nm`` is what the vehicle gets
        about the axis, the upper rotor's counted positive. Raises ValueError for a wind that is not along the shaft.
        """
        return self.dataset(*self.channels(rpm, V, Air.from_density() if air is None else air, threads, side))

    def dataset(self, values: Mapping[str, Array], flags: Flags) -> Dataset:
        """Channels and flags with what they came from."""
        provenance = {"source": "bemt", "effects": tuple(to_text(e) for e in self.effects),
                      "stations": self.upper.n_stations}  # fmt: skip
        return Dataset("bemt", self.upper.rotor.name or "pair", values, flags=flags, provenance=provenance,
                       notes=self.notes, units={"lower_rpm": "rpm"})  # fmt: skip

    def channels(
        self, rpm: ArrayLike, V: ArrayLike, air: Air, threads: int, side: ArrayLike = 0.0
    ) -> tuple[dict[str, Array], Flags]:
        """Channels and flags of :meth:`solve`."""
        if np.any(np.asarray(side) != 0.0):
            raise ValueError("side: got in-plane wind on a coaxial pair; expected axial flow")
        fields = np.broadcast_arrays(*(np.asarray(v, float) for v in (rpm, V, air.rho, air.mu, air.a_sound)))
        n, speed, rho, mu, a = (np.atleast_1d(v).ravel().astype(float) for v in fields)
        lower = None if self.torque_balance else n * self.rpm_ratio
        if self.lower_rpm is not None:
            lower = np.full(n.shape, self.lower_rpm)
        pair = Pair(
            self.upper.prep, self.lower.prep, self.spacing_m, self.opposite, self.wake_radius, self.interference,
            self.swirl,
        )  # fmt: skip
        parts = []
        for k in range(0, n.size, _BLOCK):
            at = slice(k, k + _BLOCK)
            found = solve(pair, n[at], None if lower is None else lower[at], speed[at], rho[at], mu[at], a[at])
            parts.append(self._channels(found, n[at], speed[at], rho[at], a[at], mu[at]))
        values = {key: np.concatenate([one[key] for one, _ in parts]) for key in parts[0][0]}
        return values, tuple(words for _, some in parts for words in some)

    def _channels(
        self, found: PairSolution, n: Array, V: Array, rho: Array, a: Array, mu: Array
    ) -> tuple[dict[str, Array], Flags]:
        """Channels and flags of solved points."""
        nan = np.where(found.converged, 1.0, np.nan)
        parts, m = (found.upper, found.lower), found.lower.rpm * nan
        T, Q = (np.array([getattr(one, key) * nan for one in parts]) for key in ("T", "Q"))
        T[1] -= self.mount_drag * np.maximum(T[0], 0.0)
        power = Q * np.array([n, m]) * _RAD_PER_RPM
        air = cast("Air", SimpleNamespace(rho=rho, mu=mu, a_sound=a))
        turning = np.where(found.converged, found.lower.rpm, n)
        alone = np.array([
            solver.solve(model.prep, speed, V, air).T for model, speed in zip(self.rotors, (n, turning), strict=True)
        ])  # fmt: skip
        D, rev = self.diameter_m, n / 60.0
        total, mass = T.sum(axis=0), found.lower.mass_flow * nan
        CT, CP, J = co.CT(total, rho, rev, D), co.CP(power.sum(axis=0), rho, rev, D), V / (rev * D)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio, whole = T / alone, total / alone.sum(axis=0)
            exhaust = np.where(mass > 0.0, V + total / mass, np.nan)
        sign = -1.0 if self.opposite else 1.0
        values = {
            "rpm": n, "airspeed_m_s": V, "density_kg_m3": rho, "thrust_N": total,
            "torque_Nm": power.sum(axis=0) / (n * _RAD_PER_RPM), "power_W": power.sum(axis=0), "CT": CT, "CP": CP,
            "J": J, "eta": co.eta(J, CT, CP), "M_tip": co.M_tip(rev, D, a),
            "Re75": co.Re75(self.upper.chord75_m, rev, D, V, rho, mu), "exhaust_speed_m_s": exhaust,
            "duct_share": 0.0 * total, "mass_flow_kg_s": mass, "lower_rpm": m,
            "upper_thrust_N": T[0], "upper_torque_Nm": Q[0], "lower_thrust_N": T[1], "lower_torque_Nm": Q[1],
            "reaction_torque_Nm": Q[0] + sign * Q[1], "upper_thrust_ratio": ratio[0], "lower_thrust_ratio": ratio[1],
            "thrust_ratio": whole, "upper_onset_m_s": found.onset[0] * nan, "lower_onset_m_s": found.onset[1] * nan,
        }  # fmt: skip
        words = tuple(
            (
                *(f"first rotor: {word}" for word in one), *(f"second rotor: {word}" for word in two),
                *(() if ok else (_BACKWARDS if behind else _UNSETTLED,)),
            )
            for one, two, ok, behind in zip(found.upper.flags, found.lower.flags, found.converged, V < 0.0, strict=True)
        )  # fmt: skip
        return values, words
