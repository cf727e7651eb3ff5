"""Flow that leaves the lip of a duct."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from bemt.physics.effects.base import Array, Effect, Flow, Parameter, RotorBuild


@dataclass(frozen=True)
class LipSeparation(Effect):
    """Head that the inlet loses once the suction on the lip exceeds what its boundary layer bears.

    Notes
    -----
    Separated flow at an inlet costs ``loss`` of the head 1/2 rho (w - V)^2: 0.5 at a sharp edge, 0.8 to 1 where a pipe
    reaches into the stream (Crane TP-410, p. A-29; Idelchik 1986, diagram 3-1; not checked). By momentum less flow
    goes with less thrust of the duct, and blades that meet less flow need more torque. Small lip radii (below 6 % of
    the diameter) separate early and lose up to half of the duct's thrust: Martin and Tung (2004), 60th AHS Forum;
    Pereira (2008), PhD thesis Univ. of Maryland, ch. 4 (not checked).

    The lip holds up to ``onset``, a share of the largest thrust of the recording, and is separated from 1 + ``width``
    times it on (0: at the largest); without a recording it is separated. Hysteresis is declared: once separated, the
    flow reattaches below onset (1 - hysteresis), visible only if the recording has time.

    A lip also stalls because of the flow direction, at any load: the stagnation point moves outside as the velocity
    ratio V / w of the inlet falls, and the suction peak is sharpest at rest (Kuechemann and Weber 1953, Aerodynamics
    of Propulsion, ch. 4; not checked). ``by`` = "advance" uses 1 - V / w instead of the load: at rest, where it is 1,
    an inviscid flow loses the same share at every speed. ``by`` = "turning" uses the flow that turns into the mouth,
    (w - V)^2. The speed w is that of a straight duct by momentum, T = rho A w (w - V).
    """

    onset: float = 0.7
    loss: float = 0.5
    hysteresis: float = 0.0
    width: float = 0.0
    by: str = "load"

    id = "lip_separation"
    torque_open = True
    inviscid = True
    title = "flow separation at the duct lip"
    sign = (
        "thrust drops and torque rises above one loading and they recover below a lower one; Mach effects have no "
        "hysteresis"
    )
    words = {"by": ("load", "advance", "turning")}
    needs_duct = True
    parameters = (
        Parameter("onset", "1", 0.005, 0.95, "declared; share of the largest value of what `by` asks", 4),
        Parameter("loss", "1", 0.0, 1.0, "over 1/2 rho (w - V)^2, Idelchik 1986, diagram 3-1", 3, 0.0),
        Parameter("hysteresis", "1", 0.0, 0.3, "declared", 2),
        Parameter("width", "1", 0.0, 4.0, "declared; a lip stalls at once or bit by bit", 2),
    )
    on_by_default = False

    def momentum(self, bake: RotorBuild) -> None:
        """Lose the head."""
        if bake.ducted:
            bake.num.lip_loss += bake.level * self.loss
            bake.level = 1.0

    def solved(self) -> LipSeparation:
        """One that loses a whole head: all settings are shares of it."""
        return LipSeparation(loss=1.0)

    def share(self, flow: Flow) -> Array:
        """Head that is lost at each point."""
        pull = np.maximum(flow.T0, 0.0) / (flow.rho * flow.area)
        V = np.maximum(flow.V, 0.0)
        inlet = 0.5 * V + np.sqrt(0.25 * V**2 + pull)
        if self.by == "advance":
            load = np.divide(inlet - V, inlet, out=np.zeros_like(inlet), where=inlet > 0.0)
        else:
            load = flow.T0 if self.by == "load" else (inlet - V) ** 2
            top = np.max(load, initial=0.0, where=np.isfinite(load))
            load = np.maximum(load, 0.0) / top if top > 0.0 else np.zeros_like(load)
        low = np.where(self._separated(load, flow), self.onset * (1.0 - self.hysteresis), self.onset)
        span = self.width * low if self.width > 0.0 else 1.0 - low
        return np.asarray(self.loss * np.clip((load - low) / span, 0.0, 1.0))

    def _separated(self, load: Array, flow: Flow) -> NDArray[np.bool_]:
        """Whether the flow has separated at a point or before and not attached since."""
        state = load > self.onset
        for run in flow.runs:
            order = np.arange(run.size)
            gone = np.maximum.accumulate(np.where(load[run] > self.onset, order, -1))
            back = np.maximum.accumulate(np.where(load[run] < self.onset * (1.0 - self.hysteresis), order, -1))
            state[run] = gone > back
        return state

    def odds(self) -> float:
        """Each measure is as likely as the others, however many of its settings are tried."""
        return 1.0 / _tried(self.by)

    def variants(self) -> tuple[dict[str, str | float], ...]:
        """Onsets and losses, at once and bit by bit: by the load, with hysteresis too, by V/w, by turning."""
        return _variants()


@cache
def _variants() -> tuple[dict[str, str | float], ...]:
    onsets, losses = (0.02, 0.04, 0.08, 0.15, 0.22, 0.32, 0.45, 0.6, 0.85), (0.1, 0.2, 0.35, 0.5, 0.7, 1.0)
    by_load: tuple[dict[str, str | float], ...] = tuple(
        {"onset": o, "loss": k, "hysteresis": h, "width": w, "by": "load"}
        for o in onsets for k in losses for h, w in ((0.0, 0.0), (0.2, 0.0), (0.0, 0.3), (0.0, 1.0))
    )  # fmt: skip
    by_advance: tuple[dict[str, str | float], ...] = tuple(
        {"onset": o, "loss": k, "hysteresis": 0.0, "width": w, "by": "advance"}
        for o in (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85) for k in losses for w in (0.0, 0.3, 1.0)
    )  # fmt: skip
    by_turning: tuple[dict[str, str | float], ...] = tuple(
        {"onset": o, "loss": k, "hysteresis": 0.0, "width": w, "by": "turning"}
        for o in (0.01, *onsets) for k in losses for w in (0.0, 1.0, 3.0)
    )  # fmt: skip
    return by_load + by_advance + by_turning


@cache
def _tried(by: str) -> int:
    return sum(v["by"] == by for v in _variants())
