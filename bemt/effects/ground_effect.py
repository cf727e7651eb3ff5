"""Wall behind the propeller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.effects.base import Array, Effect, Flow, Parameter, choice

FORMS = ("cheeseman_bennett", "hayden")


@dataclass(frozen=True)
class GroundEffect(Effect):
    """Wall or stand behind the rotor that dams the slipstream and lowers the induced speed.

    Notes
    -----
    ``form = "cheeseman_bennett"``: the image of a source at the rotor takes (R/4z)^2 off the induced speed, hence
    T/T_inf = 1 / (1 - (R/4z)^2) at constant power, and less with speed by 1 / (1 + (V/v)^2) (Cheeseman and Bennett
    1955, ARC R&M 3021).  ``form = "hayden"``: induced power at equal thrust times 1 / (0.9926 + 0.0379 (2R/z)^2), a fit
    of flight tests (Hayden 1976, 32nd AHS Forum), fading in the same way.  Coefficients checked against public codes,
    not against the papers; the fading belongs to edgewise flow there and is used for axial flow here.  The rotor
    meets V - share v.  A recorded ``wall_distance_m`` replaces ``z_over_R``; closer than R/2 counts as R/2.
    """

    form: str = "cheeseman_bennett"
    z_over_R: float = 1.0
    strength: float = 1.0

    id = "ground_effect"
    title = "wall behind the propeller"
    along = ("wall_distance_m",)
    sign = "more thrust at the same speed and torque, at rest only: it fades with airspeed, as no load-cell gain does"
    parameters = (
        Parameter("z_over_R", "1", 0.5, 3.0, "validity of Cheeseman and Bennett 1955"),
        Parameter("strength", "1", 0.0, 1.5, "1 is the published form", steps=0, off=0.0),
    )
    on_by_default = False

    def __post_init__(self) -> None:
        """Refuse unknown forms."""
        choice("form", self.form, FORMS)

    def flow(self, flow: Flow) -> None:
        """Take the dammed share of the induced speed off the onset speed."""
        z = flow.extra["wall_distance_m"] / flow.R if "wall_distance_m" in flow.extra else np.array(self.z_over_R)
        v = flow.induced
        fade = v**2 / np.maximum(v**2 + flow.V**2, 1e-12)
        flow.V = flow.V - self.strength * self.relief(z) * v * fade

    def relief(self, z_over_R: Array) -> Array:
        """Share of the induced speed that the wall takes off.

        Parameters
        ----------
        z_over_R : (P,) float
            Distance of the wall over tip radius [1]; NaN: no wall.

        Returns
        -------
        (P,) float
            Share [1].

        >>> round(float(GroundEffect().relief(np.array(1.0))), 4)
        0.0625
        """
        z = np.maximum(np.where(np.isnan(z_over_R), np.inf, z_over_R), 0.5)
        if self.form == "hayden":
            return np.asarray(np.maximum(1.0 - 1.0 / (0.9926 + 0.0379 * (2.0 / z) ** 2), 0.0))
        return np.asarray((0.25 / z) ** 2)

    def variants(self) -> tuple[dict[str, str | float], ...]:
        """Both forms at twelve distances."""
        return tuple({"form": f, "z_over_R": z} for f in FORMS for z in map(float, np.geomspace(0.5, 3.0, 12)))
