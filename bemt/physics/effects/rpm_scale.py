"""Speed of rotation that is not the indicated one."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from bemt.base import unit_errors
from bemt.physics.effects.base import Effect, Flow, Parameter

# Small errors, and the step to the next: close together where most counters err.
_STEPS = {e / 400.0: 1.0 if abs(e) <= 6 else 2.0 for e in range(-40, 41) if e and (abs(e) <= 6 or not e % 2)}
# Rarer ones are left to the scaling laws; nearer ones (11 : 12) are within what the level of a model may be off.
_RATIOS = unit_errors.speed_ratios(rarest=1.0, nearest=Fraction(8, 7))


@dataclass(frozen=True)
class RpmScale(Effect):
    """The indicated speed is factor (1 + eps) times the true one.

    Notes
    -----
    Electronic speed controllers count electrical revolutions (pole pairs times mechanical), optical tachometers count
    blades. A wrong setting gives a rational factor (`bemt.base.unit_errors`, declared). ``eps``: clock of a cheap
    counter, +-1 %, and pulses lost or counted twice, up to 10 % (declared). The rotor turns at the indicated speed over
    the factor.
    """

    factor: float = 1.0
    eps: float = 0.01

    id = "rpm_scale"
    title = "wrong speed of rotation"
    check = "count the revolutions with an optical tachometer; check the pole pairs or blades set in the counter"
    sign = (
        "thrust and torque off by the same square, and airspeed effects appear at another J; a rational ratio of "
        "pole or blade counts; density does not change J"
    )
    kind = "stand"
    fault = "scale"
    sensor = "rpm"
    discrete = ("factor",)
    parameters = (
        Parameter("factor", "1", 1.0 / 24.0, 24.0, "pole pairs and blade counts", 0, 1.0),
        Parameter("eps", "1", -0.1, 0.1, "declared, clock and pulses of a counter", 0, 0.0, 0.01),
    )
    on_by_default = False

    def flow(self, flow: Flow) -> None:
        """Turn the rotor at its true speed."""
        flow.rpm = flow.rpm / (self.factor * (1.0 + self.eps))

    def variants(self) -> tuple[dict[str, float], ...]:
        """Small errors, then the rational factors."""
        small = [{"factor": 1.0, "eps": e} for e in _STEPS]
        return (*small, *({"factor": f, "eps": 0.0} for f in sorted(r.ratio for r in _RATIOS)))

    def odds(self) -> float:
        """Relative frequency of the ratio, or step between small errors."""
        return next((r.weight for r in _RATIOS if r.ratio == self.factor), _STEPS.get(self.eps, 1.0))
