"""Blade angle other than stated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Effect, Parameter, RotorBuild


@dataclass(frozen=True)
class PitchOffset(Effect):
    """All blade angles differ by the same amount: manufacture, setting of the hub, wrong reference line.

    Notes
    -----
    beta + offset at every station. Manual settings and moulded blades are off by about a degree, a wrong label or
    reference line (chord or underside) by several. Hence a heavy-tailed prior; both declared.
    """

    offset_deg: float = 1.0

    id = "pitch_offset"
    geometric = True
    title = "wrong blade angle"
    check = "measure the blade angle at 0.75 R relative to the plane of rotation"
    sign = "shifts the advance ratio of zero thrust equally at every speed; a gain or density error does not shift it"
    parameters = (Parameter("offset_deg", "deg", -8.0, 8.0, "declared: workshop, or another label", 9, 0.0, 1.0),)
    on_by_default = False

    def blade(self, bake: RotorBuild) -> None:
        """Turn the blade."""
        bake.beta = bake.beta + np.radians(self.offset_deg)
