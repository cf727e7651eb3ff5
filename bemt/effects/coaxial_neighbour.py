"""Second rotor on the same axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.effects.base import Array, Effect, Flow, Parameter, choice
from bemt.vortex_cylinder import on_axis

_SIDES = ("upstream", "downstream")


@dataclass(frozen=True)
class CoaxialNeighbour(Effect):
    """A rotor ahead of or behind this one, whose wake or suction it works in.

    Notes
    -----
    On the axis of a semi-infinite vortex cylinder the induced speed is v (1 + s / sqrt(1 + s^2)), s = z/R counted
    downstream (McCormick 1967, Aerodynamics of V/STOL Flight; not checked against the book). Continuity contracts the
    wake to the share a^2 = 1 / (1 + s / sqrt(1 + s^2)) of the disk. A rotor downstream sees that speed inside the wake
    and none outside. Its loads are computed at the mean, weighted by r^2 like blade loads (declared): v a. A rotor
    upstream sees v (1 - s / sqrt(1 + s^2)). ``load`` is the neighbour's thrust over that of this rotor; its v follows
    from momentum theory of the open disk, `Flow.induced`; where ``second_rotor_rad_s`` is recorded, ``load`` holds at
    equal speeds, and the neighbour's thrust goes with the square of its own. The swirl of the neighbour is neglected; a
    contra-rotating pair gains a few per cent from it.
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
    parameters = (
        Parameter("z_over_R", "1", 0.1, 4.0, "coaxial stands, 0.1 to 1 diameters apart"),
        Parameter("load", "1", 0.0, 2.0, "declared; thrust of the neighbour over that of this rotor", 0, 0.0),
    )
    on_by_default = False

    def __post_init__(self) -> None:
        """Refuse unknown sides."""
        choice("side", self.side, _SIDES)

    def applies(self, flow: Flow) -> str:
        """The law is that of two open disks."""
        return super().applies(flow) or ("the rotor has a duct" if flow.ducted else "")

    def flow(self, flow: Flow) -> None:
        """Add what the neighbour induces."""
        flow.V = flow.V + self.mean() * self._speed(flow)

    def mean(self) -> float:
        """Mean onset speed over the neighbour's own induced speed [1].

        >>> CoaxialNeighbour("downstream", 1e9).mean(), round(CoaxialNeighbour("downstream", 1e-9).mean(), 3)
        (0.0, 1.0)
        """
        s = on_axis(self.z_over_R)
        if self.side == "downstream":
            return float(1.0 - s)
        # speed (1 + s) v inside the radius a R of the wake, weighted by r^2: (1 + s) a^3 = a
        return float(1.0 / np.sqrt(1.0 + s))

    def _speed(self, flow: Flow) -> Array:
        """Induced speed of the neighbour, (P,) [m/s]."""
        load: Array | float = self.load
        if "second_rotor_rad_s" in flow.extra:
            load = load * (np.nan_to_num(flow.extra["second_rotor_rad_s"]) / np.maximum(flow.omega, 1e-9)) ** 2
        disk = load * np.maximum(flow.T0, 0.0) / (2.0 * flow.rho * flow.area)
        half = 0.5 * np.abs(flow.V)
        return np.asarray(np.sqrt(half**2 + disk) - half)

    def variants(self) -> tuple[dict[str, str | float], ...]:
        """Both sides, six distances and four loads in ratio."""
        return tuple(
            {"side": side, "z_over_R": z, "load": k}
            for side in _SIDES for z in (0.2, 0.4, 0.7, 1.2, 2.0, 4.0) for k in (0.5, 0.8, 1.0, 1.4)
        )  # fmt: skip
