"""Body behind the propeller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bemt.physics.effects.base import Effect, Flow, Loads, Parameter, RotorBuild


@dataclass(frozen=True)
class Nacelle(Effect):
    """Motor, nacelle or stand behind the disk: slower air near the root, and drag on the balance.

    Notes
    -----
    A half-body of radius a slows the axial flow by V deficit (1 + (r/a)^2)^-1.5 (Rankine 1871; Katz and Plotkin 2001,
    Low-Speed Aerodynamics, sec. 3.10; not checked). It is a source of flux pi a^2 V one radius behind the disk, deficit
    1/4 on the axis; a is the hub radius where ``body_over_R`` is smaller. The balance reads the drag
    cd 1/2 rho W^2 pi a^2; 0.1 a spinner to 1.2 a bluff motor (Hoerner 1965, Fluid-Dynamic Drag, ch. 3; not checked). W
    = V + wash v: a body behind the disk stands in the slipstream, whose induced speed is v at the disk and 2 v in the
    far wake (Glauert 1935, ch. VII). A rotor without hub uses a = R/10. Motors, balances and fairings are often wider
    than the hub.
    """

    deficit: float = 0.10
    cd: float = 0.5
    body_over_R: float = 0.0
    wash: float = 0.0

    id = "nacelle"
    inviscid = True
    title = "body behind the propeller"
    check = "run without the propeller at the same airspeeds and subtract that drag"
    sign = "thrust is low by an amount that grows with V^2 (in the slipstream also with load), torque barely changes"
    flies = True
    parameters = (
        Parameter("deficit", "1", 0.0, 0.6, "0.25 on the axis of a half-body, more of a blunt one", 4, 0.0),
        Parameter("cd", "1", 0.0, 1.2, "spinner to bluff motor, on hub area, Hoerner 1965", 4, 0.0),
        Parameter("body_over_R", "1", 0.0, 0.5, "declared, hub to a wide balance", 3),
        Parameter("wash", "1", 0.0, 2.0, "0: ahead of the disk; 1 to 2: in the slipstream, momentum theory", 0),
    )
    discrete = ("wash",)
    on_by_default = False

    def inflow(self, bake: RotorBuild) -> None:
        """Slow the axial flow, most at the root."""
        bake.Vx_factor = bake.Vx_factor * (1.0 - self.deficit * (1.0 + (bake.r / self._radius(bake)) ** 2) ** -1.5)

    def solved(self) -> Nacelle:
        """The body without its drag, which only the balance reads."""
        return Nacelle(self.deficit, 0.0, self.body_over_R if self.deficit else 0.0)

    def loads(self, loads: Loads, flow: Flow) -> None:
        """Take the drag of the body off the thrust."""
        area = np.pi * self._radius(flow) ** 2
        W = flow.V + self.wash * flow.induced
        loads.T = loads.T - self.cd * 0.5 * flow.rho * W * np.abs(W) * area

    def _radius(self, rotor: Flow | RotorBuild) -> float:
        return max(rotor.Rhub if rotor.Rhub > 0.0 else 0.1 * rotor.R, self.body_over_R * rotor.R)

    def variants(self) -> tuple[dict[str, float], ...]:
        """Three bodies of three deficits and four drags in ratio, ahead of the disk and behind it."""
        return tuple(
            {"deficit": d, "cd": c, "body_over_R": b, "wash": w}
            for b in (0.0, 0.3, 0.5)
            for d in (0.0, 0.2, 0.5)
            for c in (0.0, 0.1, 0.3, 1.0)
            for w in ((0.0, 1.5) if c else (0.0,))
            if d + c > 0.0
        )
