"""Reynolds number of the sections."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bemt.physics.effects.base import Effect, Parameter, RotorBuild
from bemt.physics.sections.polars import RE_FIXED


@dataclass(frozen=True)
class Reynolds(Effect):
    """Sections at their own Reynolds number: the tables as they are, or power laws on one of them.

    Notes
    -----
    ``form = "table"``: section tables over Reynolds number, their change from Re0 = 1e5 times ``amount`` (Selig et al.
    1989, Airfoils at Low Speeds, SoarTech 8; not checked: such tables disagree by that much at low Re). ``form =
    "power"`` keeps the table at Re0 and scales drag by (Re0/Re)^exponent and
    attached lift by (Re/Re0)^lift_exponent: drag exponents are 0.5 for a laminar, 0.2 for a turbulent flat plate
    (Schlichting 1979, Boundary-Layer Theory, eq. 7.34 and 21.12, exponents there), up to 0.6 with laminar bubbles
    (Hoerner 1965, Fluid-Dynamic Drag, ch. 6; not checked), which cost lift too (range declared). Off: Re0 everywhere.
    """

    form: str = "table"
    amount: float = 1.0
    exponent: float = 0.3
    lift_exponent: float = 0.0

    id = "reynolds"
    title = "Reynolds number effect on the sections"
    sign = "torque coefficient falls and thrust coefficient rises with speed; both collapse on the Reynolds number"
    words = {"form": ("table", "power")}
    parameters = (
        Parameter("amount", "1", 0.0, 3.0, "1: the tables; declared range", 4),
        Parameter("exponent", "1", 0.0, 0.6, "0.2 turbulent, 0.5 laminar flat plate", steps=0),
        Parameter("lift_exponent", "1", 0.0, 0.2, "declared; low-Re lift of cambered sections", steps=0),
    )
    order = 5

    def section(self, bake: RotorBuild) -> None:
        """Stretch the tables, or replace them by the power laws."""
        if bake.Re.size == 1 or (self.form == "table" and self.amount == 1.0):
            return
        at = np.interp(np.log(RE_FIXED), np.log(bake.Re), np.arange(bake.Re.size))
        low = min(int(at), bake.Re.size - 2)
        w = at - low
        cl, cd = (((1.0 - w) * t[:, :, low] + w * t[:, :, low + 1])[:, :, None] for t in (bake.cl, bake.cd))
        if self.form == "table":
            bake.cl[:] = cl + self.amount * (bake.cl - cl)
            # a ratio, so that drag stays positive
            bake.cd[:] = cd * (bake.cd / cd) ** self.amount
            return
        attached = np.clip((np.radians(30.0) - np.abs(bake.alpha_col)) / np.radians(15.0), 0.0, 1.0)
        ratio = (bake.Re / RE_FIXED)[None, None, :, None]
        bake.cl[:] = cl * (1.0 + attached * (ratio**self.lift_exponent - 1.0))
        bake.cd[:] = cd * (1.0 + attached * (ratio**-self.exponent - 1.0))

    def variants(self) -> tuple[dict[str, Any], ...]:
        """Tables stretched, and power laws of drag and lift."""
        tables = ({"form": "table", "amount": a} for a in (0.5, 1.0, 1.5, 2.0, 3.0))
        laws = ({"form": "power", "exponent": p, "lift_exponent": q}
                for p in (0.0, 0.15, 0.3, 0.5) for q in (0.0, 0.05, 0.1, 0.2) if p + q > 0.0)  # fmt: skip
        return (*tables, *laws)
