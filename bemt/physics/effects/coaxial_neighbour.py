"""Second rotor on the same axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bemt.physics.effects.base import Array, Effect, Flow, Parameter
from bemt.physics.wake import ahead, contracted, hover_gain, streamtubes

_SIDES = ("upstream", "downstream")
# Twist of a neighbour's blade: the middle of the -16 to -12 deg of propellers of P/D 0.35 and more [deg].
_TWIST = -14.0
# Middles of rings inside of the wake, over its radius, and outside of it.
_INSIDE, _OUTSIDE = (np.arange(25) + 0.5) / 25.0, np.linspace(1.0, 3.0, 81)


@dataclass(frozen=True)
class CoaxialNeighbour(Effect):
    """A rotor ahead of or behind this one, whose wake or suction it works in.

    Notes
    -----
    The wake is that of a coaxial pair of uniform load (:mod:`bemt.physics.wake`; closed form as in Leishman and
    Ananthan 2008, J. AHS 53(1), not checked). The neighbour has blades like this one's. A rotor downstream meets the
    faster stream inside the wake and its upwash outside, one upstream the suction of the other
    (:func:`bemt.physics.wake.ahead`). The solver knows one onset speed: that at which thrust is the mean
    over both parts of the disk, by momentum theory and blades whose thrust falls linearly with the flow through the
    disk, here with the solver's slope. ``load`` is the neighbour's thrust over that of this rotor alone; its induced
    speed follows from momentum theory, of a neighbour downstream in the wake of this rotor. Where
    ``second_rotor_rad_s`` is recorded, ``load`` holds at equal speeds, and the neighbour's thrust goes with the square
    of its own. Swirl is neglected: which way the neighbour turns is not known.
    """

    side: str = "upstream"
    z_over_R: float = 1.0
    load: float = 1.0

    id = "coaxial_neighbour"
    evident = True
    inviscid = True
    along = ("second_rotor_rad_s",)
    title = "second rotor on the same axis"
    sign = (
        "less thrust at the same speed, as in the wake of another rotor; strongest in static runs, fading with "
        "airspeed; gone when the other rotor stops"
    )
    check = "see whether a second rotor is on the axis; if so, repeat with it stopped"
    words = {"side": _SIDES}
    in_duct = "the rotor has a duct"
    check_minutes = 1.0
    parameters = (
        Parameter("z_over_R", "1", 0.1, 4.0, "coaxial stands, 0.1 to 1 diameters apart"),
        Parameter("load", "1", 0.0, 2.0, "declared; thrust of the neighbour over that of this rotor", 0, 0.0),
    )
    tried = {"side": _SIDES, "z_over_R": (0.2, 0.4, 0.7, 1.2, 2.0, 4.0), "load": (0.5, 0.8, 1.0, 1.4)}
    on_by_default = False

    def flow(self, flow: Flow) -> None:
        """Add what the neighbour induces."""
        V, own = np.maximum(flow.V, 0.0), np.maximum(flow.T0, 0.0)
        other = self.load * own
        if "second_rotor_rad_s" in flow.extra:
            other = other * (np.nan_to_num(flow.extra["second_rotor_rad_s"]) / np.maximum(flow.omega, 1e-9)) ** 2
        # in the helicopter convention; that of the neighbour is the same at any speed of its own
        CT = own / (flow.rho * flow.area * np.maximum(flow.omega * flow.R, 1e-9) ** 2)
        if self.side == "downstream":
            core, outside, share = self._wake(flow, V, CT, own, other)
            met = V + share * core + (1.0 - share) * outside
            flow.V = flow.V + _induced(flow, met, other) * _mean(_cylinder(self.z_over_R)[0])
        else:
            core, outside, share = self._wake(flow, V, self.load * CT, other, own)
            flow.V = flow.V + _uniform(flow, V, core, outside, share)

    def _wake(
        self, flow: Flow, V: Array, CT: Array, ahead_N: Array, behind_N: Array
    ) -> tuple[Array, Array, Array]:  # fmt: skip
        """Speeds that the wake of a rotor adds inside and outside of its core at one behind it, and the core's share.

        Each (P,); ``ahead_N`` and ``behind_N`` are the thrusts of both rotors, ``CT`` is that of the one ahead.
        """
        inside, outside = _cylinder(self.z_over_R)
        v = _induced(flow, V, ahead_N)
        sigma = flow.B * flow.chord / (math.pi * flow.R)
        grown = hover_gain(contracted(self.z_over_R, CT, sigma, _TWIST, flow.B))
        faster = v * (1.0 - _mean(inside))
        core, drawn = v, np.zeros_like(v)
        for _ in range(2):  # what the second rotor adds narrows the core, not its speed
            core, area, _ = streamtubes(v, V, V + v, faster, grown, drawn, self.z_over_R)
            drawn = _induced(flow, V + core, behind_N)
        share = np.minimum(area, 1.0)
        edge = np.maximum(np.sqrt(share), 1.0 / _OUTSIDE[-1])
        middle = 0.5 * (_OUTSIDE[1:] + _OUTSIDE[:-1])
        flux = np.concatenate([[0.0], np.cumsum(np.diff(_OUTSIDE**2) * np.interp(middle, _OUTSIDE, outside))])
        upwash = v * edge**2 * np.interp(1.0 / edge, _OUTSIDE, flux) / np.maximum(1.0 - edge**2, 1e-9)
        return core, -upwash, share


@lru_cache(maxsize=64)
def _cylinder(z_over_R: float) -> tuple[Array, Array]:
    """What a cylinder induces that far ahead of its disk, over the velocity in it, at `_INSIDE` and `_OUTSIDE` [1]."""
    return ahead(_INSIDE, 1.0, z_over_R), ahead(_OUTSIDE, 1.0, z_over_R)


def _mean(velocity: Array) -> float:
    """Mean over the disk of a velocity at `_INSIDE`."""
    return float(_INSIDE @ velocity / np.sum(_INSIDE))


def _induced(flow: Flow, V: Array, thrust_N: Array) -> Array:
    """Induced speed of a thrust by momentum theory of an open disk, (P,) [m/s]."""
    half = 0.5 * V
    return np.asarray(np.sqrt(half**2 + thrust_N / (2.0 * flow.rho * flow.area)) - half)


def _uniform(flow: Flow, V: Array, core: Array, outside: Array, share: Array) -> Array:
    """Uniform speed that changes thrust like one in a share of the disk and another one outside of it, (P,) [m/s].

    With w the flow through the disk and m = 2 rho A, momentum says T = m w (w - V), the blades say T = T1 - S w. The
    slope D = dT/dV of the solver gives S = -D m (2 w - V) / (m w + D).
    """
    m = 2.0 * flow.rho * flow.area
    w = V + _induced(flow, V, np.maximum(flow.T0, 0.0))
    D = np.clip(flow.dT_dV, -0.9 * m * w, 0.0)
    S = -D * m * (2.0 * w - V) / np.maximum(m * w + D, 1e-12)
    alone = m * w * (w - V) + S * w

    def through(onset: Array) -> Array:
        half = 0.5 * (onset - S / m)
        return np.asarray(half + np.sqrt(half**2 + alone / m))

    mean = share * through(V + core) + (1.0 - share) * through(V + outside)
    with np.errstate(divide="ignore", invalid="ignore"):
        add = mean - (alone - S * mean) / (m * mean) - V
    return np.asarray(np.where(mean > 0.0, add, 0.0))
