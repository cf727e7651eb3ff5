"""Wall behind the propeller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Array, Effect, Flow, Parameter, induced_speed

FORMS = ("cheeseman_bennett", "hayden")
_ROUNDS = 3  # Of thrust and induced speed: each leaves less than a tenth of the error, 3e-4 in all.
# Largest share of the induced speed that is taken off: at rest the solver is then given -0.45 v, below which it would
# balance a vortex ring, which a wall is not (:mod:`bemt.physics.bem.residual`).
_MOST = 0.2


@dataclass(frozen=True)
class GroundEffect(Effect):
    """Wall or stand behind the rotor that dams the slipstream and lowers the induced speed.

    Notes
    -----
    ``form = "cheeseman_bennett"``: T/T_inf = 1 / (1 - (R/4z)^2) at constant power, fading with speed as 1 / (1 +
    (V/v)^2) (Cheeseman and Bennett 1955, ARC R&M 3021). Constant power is v/v_inf = 1 - (R/4z)^2, and at equal thrust,
    as v_inf goes with the root of thrust, v/v_inf = (1 - (R/4z)^2)^(3/2). ``form = "hayden"``: induced power at equal
    thrust times 1 / (0.9926 + 0.0379 (2R/z)^2), a fit of flight tests (Hayden 1976, 32nd AHS Forum), fading in the same
    way.

    Coefficients checked against public codes, not against the papers; the fading belongs to edgewise flow there and is
    used for axial flow here. The solver balances momentum anew with any onset speed and makes up for half of what is
    taken off. So it is given the onset speed whose balance leaves the flow w = V + v v/v_inf of the law through the
    disk: at equal thrust v (V + v) / w - (w - V) less than V. A wall takes no more than a fifth off v: nearer than two
    thirds of R the effect grows no further. A recorded ``wall_distance_m`` replaces z_over_R. The wall also decelerates
    wind along the axis. Ahead of a disk of radius a, on its axis, a stream V is V (1 - (2/pi) (acot(zeta) - zeta / (1 +
    zeta^2))), zeta = z/a (potential of a disk moving broadside on, Lamb 1932, Hydrodynamics, art. 108, superposed on
    the stream; derived here from the potential). Used only if the wall distance is recorded; ``plate_radius_over_R`` is
    a, and 0 leaves the wind unchanged.
    """

    form: str = "cheeseman_bennett"
    z_over_R: float = 1.0
    strength: float = 1.0
    plate_radius_over_R: float = 0.0

    id = "ground_effect"
    inviscid = True
    title = "wall behind the propeller"
    check = "measure the distance to the nearest wall behind the propeller"
    check_minutes = 2.0
    along = ("wall_distance_m",)
    sign = (
        "more thrust at the same speed and torque; fades with airspeed, unlike a cell gain, unless the wall also "
        "blocks the wind"
    )
    words = {"form": FORMS}
    in_duct = "what a wall behind a duct does is not modelled"
    parameters = (
        Parameter("z_over_R", "1", 0.5, 3.0, "validity of Cheeseman and Bennett 1955"),
        Parameter("strength", "1", 0.0, 3.0, "1 is the published form; at most v/5 is taken off", steps=0, off=0.0),
        Parameter("plate_radius_over_R", "1", 0.0, 3.0, "radius of plates of stands", steps=0, off=0.0),
    )
    on_by_default = False

    def flow(self, flow: Flow) -> None:
        """Take the dammed shares of induced speed and wind off the onset speed."""
        z = flow.extra["wall_distance_m"] / flow.R if "wall_distance_m" in flow.extra else np.array(self.z_over_R)
        wind = flow.V * (self.dammed(z) if "wall_distance_m" in flow.extra else 0.0)
        share = self.strength * self.relief(z)
        T, less = flow.T0, np.zeros_like(flow.V)
        for _ in range(_ROUNDS):  # the induced speed goes with the thrust that the wall makes
            less = _taken_off(flow.V, induced_speed(T, flow.V, flow.rho * flow.area), share)
            T = flow.T0 - np.minimum(flow.dT_dV, 0.0) * less
        flow.V = flow.V - wind - less

    def dammed(self, z_over_R: Array) -> Array:
        """Share of the wind that the plate takes off at the rotor."""
        if self.plate_radius_over_R <= 0.0:
            return np.zeros_like(z_over_R)
        zeta = np.where(np.isnan(z_over_R), np.inf, z_over_R) / self.plate_radius_over_R
        with np.errstate(invalid="ignore"):
            share = np.arctan2(1.0, zeta) - zeta / (1.0 + zeta**2)
        return np.asarray(2.0 / np.pi * np.where(np.isinf(zeta), 0.0, share))

    def relief(self, z_over_R: Array) -> Array:
        """Share of the induced speed that the wall takes off."""
        z = np.maximum(np.where(np.isnan(z_over_R), np.inf, z_over_R), 0.5)
        if self.form == "hayden":
            return np.asarray(np.maximum(1.0 - 1.0 / (0.9926 + 0.0379 * (2.0 / z) ** 2), 0.0))
        return np.asarray(1.0 - (1.0 - (0.25 / z) ** 2) ** 1.5)

    def variants(self) -> tuple[dict[str, str | float], ...]:
        """Both forms at twelve distances as published; weaker, stronger and behind plates at three."""
        settings = [(f, z, 1.0, 0.0) for f in FORMS for z in map(float, np.geomspace(0.5, 3.0, 12))]
        settings += [
            (f, z, s, a) for f in FORMS for z in (0.7, 1.2, 2.0) for s in (0.6, 1.0, 1.7, 3.0) for a in (0.0, 1.0, 2.0)
            if (s, a) != (1.0, 0.0)
        ]  # fmt: skip
        names = ("form", "z_over_R", "strength", "plate_radius_over_R")
        return tuple(dict(zip(names, values, strict=True)) for values in settings)


def _taken_off(V: Array, v: Array, share: Array) -> Array:
    """What the onset speed loses so that at equal thrust the flow through the disk loses a share of v, (P,) [m/s]."""
    V = np.abs(V)
    fade = v**2 / np.maximum(v**2 + V**2, 1e-12)
    left = v * (1.0 - np.minimum(share, _MOST) * fade)
    return np.asarray(v * (V + v) / np.maximum(V + left, 1e-12) - left)
