"""Flow that leaves the lip of a duct."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from bemt.physics.effects.base import Array, Effect, Flow, Loads, Parameter


@dataclass(frozen=True)
class LipSeparation(Effect):
    """Duct thrust that is lost once the suction on the lip exceeds what its boundary layer bears.

    Notes
    -----
    The suction of the lip is limited to a share of the largest duct thrust of the recording (Martin and Tung 2004;
    Pereira 2008, ch. 4; not checked). Beyond ``onset`` a share of it is lost in proportion, up to ``loss`` at the
    largest. Small lip radii (below 6 % of the diameter) separate early and lose up to half of the thrust: Martin and
    Tung (2004), 60th AHS Forum; Pereira (2008), PhD thesis Univ. of Maryland, ch. 4 (not checked). Proportion and
    hysteresis are declared: once separated, the flow reattaches below onset (1 - hysteresis),
    visible only if the recording has time.

    A lip also stalls because of the flow direction, at any load: the stagnation point moves outside as the velocity
    ratio V / V_i of the inlet falls, and the suction peak is sharpest at rest (Kuchemann and Weber 1953, Aerodynamics
    of Propulsion, ch. 4; not checked). ``by`` = "advance" uses 1 - V / V_i instead of the load: at rest, where it is 1,
    an inviscid flow loses the same share at every speed. ``by`` = "turning" uses the flow that turns into the mouth,
    since in flight the duct's thrust is what wall and exit leave of it: the suction of a lip is rho A w^2 / 2, by
    momentum as of a straight duct, with V_i = V + w = T / (rho A (V_e - V)) and
    V_e^2 = V^2 + 2 (T - T_duct) / (rho A). ``onset`` is a share of the largest w^2, so that thinner air does not
    change it.
    """

    onset: float = 0.7
    loss: float = 0.3
    hysteresis: float = 0.0
    width: float = 0.0
    by: str = "load"

    id = "lip_separation"
    torque_open = True
    title = "flow separation at the duct lip"
    sign = (
        "thrust drops above one loading and recovers below a lower one, torque is unchanged; Mach effects have no "
        "hysteresis"
    )
    words = {"by": ("load", "advance", "turning")}
    needs_duct = True
    parameters = (
        Parameter("onset", "1", 0.005, 0.95, "declared; share of the largest value of what `by` asks", 4),
        Parameter("loss", "1", 0.0, 1.0, "share of the duct's thrust, Martin and Tung 2004", 3, 0.0),
        Parameter("hysteresis", "1", 0.0, 0.3, "declared", 2),
        Parameter("width", "1", 0.0, 4.0, "declared; a lip stalls at once or bit by bit", 2),
    )
    on_by_default = False

    def loads(self, loads: Loads, flow: Flow) -> None:
        """Take the lost share off the duct's thrust."""
        gained = _gained(loads, flow)
        suction = 0.5 * flow.rho * flow.area * gained**2 if self.by == "turning" else loads.T_duct
        measure = gained**2 if self.by == "turning" else suction
        top = np.max(measure, initial=0.0, where=np.isfinite(measure))
        if not (flow.ducted and top > 0.0):
            return
        suction, load = np.maximum(suction, 0.0), np.maximum(measure, 0.0) / top
        if self.by == "advance":
            inlet = np.maximum(flow.V, 0.0) + gained
            load = np.divide(gained, inlet, out=np.zeros_like(inlet), where=inlet > 0.0)
        low = np.where(self._separated(load, flow), self.onset * (1.0 - self.hysteresis), self.onset)
        span = self.width * low if self.width > 0.0 else 1.0 - low
        lost = self.loss * np.clip((load - low) / span, 0.0, 1.0) * suction
        loads.T = loads.T - lost
        loads.T_duct = loads.T_duct - lost

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
        return 1.0 / sum(v["by"] == self.by for v in _variants())

    def variants(self) -> tuple[dict[str, str | float], ...]:
        """Onsets and losses in ratio: by the load with hysteresis, by V/V_i, by turning at once and bit by bit."""
        return _variants()


@cache
def _variants() -> tuple[dict[str, str | float], ...]:
    onsets, losses = (0.02, 0.04, 0.08, 0.16, 0.32, 0.6, 0.85), (0.1, 0.2, 0.35, 0.5, 0.7, 1.0)
    by_load: tuple[dict[str, str | float], ...] = tuple(
        {"onset": o, "loss": k, "hysteresis": h, "width": 0.0, "by": "load"}
        for o in onsets for k in losses for h in (0.0, 0.2)
    )  # fmt: skip
    by_advance: tuple[dict[str, str | float], ...] = tuple(
        {"onset": o, "loss": k, "hysteresis": 0.0, "width": 0.0, "by": "advance"}
        for o in (0.1, 0.35, 0.6, 0.85) for k in losses
    )  # fmt: skip
    by_turning: tuple[dict[str, str | float], ...] = tuple(
        {"onset": o, "loss": k, "hysteresis": 0.0, "width": w, "by": "turning"}
        for o in (0.01, *onsets) for k in losses for w in (0.0, 1.0, 3.0)
    )  # fmt: skip
    return by_load + by_advance + by_turning


def _gained(loads: Loads, flow: Flow) -> Array:
    """Speed that the flow gains on its way into a straight duct, by momentum, (P,) [m/s]."""
    mass, V = flow.rho * flow.area, np.maximum(flow.V, 0.0)
    rise = np.sqrt(V**2 + 2.0 * np.maximum(loads.T - loads.T_duct, 0.0) / mass) - V
    through = np.divide(np.maximum(loads.T, 0.0), mass * rise, out=V.copy(), where=rise > 0.0)
    return np.asarray(np.maximum(through - V, 0.0))
