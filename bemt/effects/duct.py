"""A duct around the rotor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bemt.effects.base import Effect, Parameter


@dataclass(frozen=True)
class DuctEffect(Effect):
    """Jet that leaves through a duct of given exit area instead of contracting freely.

    Notes
    -----
    T / T_rotor = 2 sigma_w at rest, sigma_w exit over disk area; fades with speed (McCormick 1967, Aerodynamics of
    V/STOL Flight, ch. 9; Pereira 2008, PhD thesis Univ. of Maryland, eq. 2.20-2.40; see :mod:`bemt.bem.duct`).  A case
    with a duct has it from its geometry and not from here; ``effects_off = ["duct"]`` leaves it out.  Lip, walls and
    gap of the case are kept where it states them.
    """

    wake_ratio: float = 1.0

    id = "duct"
    inviscid = True
    title = "thrust of a duct"
    sign = "more thrust for the same torque, fading with advance ratio"
    parameters = (Parameter("wake_ratio", "1", 0.8, 1.3, "exit over disk area; Pereira 2008"),)
    on_by_default = False

    def duct(self) -> Mapping[str, float] | None:
        """Exit area ratio of the duct."""
        return {"wake_ratio": self.wake_ratio}
