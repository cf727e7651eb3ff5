"""What to do next with the vehicle: the step that tells the causes apart which a flight leaves open."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bemt.judge.diagnose.suggest import Suggestion
from bemt.judge.explanation import Explanation
from bemt.judge.loss import Decision
from bemt.tools.flight.balance import BLADE, DAY, WEIGHT, WIND

_HOVER = "hover 30 s in still air and judge that flight"


def next_flight(said: Decision, layout: NDArray[np.float64] | None, given: int) -> Suggestion:
    """Choose the next step after a decision that compared with so many `given` healthy flights."""
    motors = [int(i.removeprefix(BLADE)) for i in said.effects if i.startswith(BLADE) and i[len(BLADE) :].isdigit()]
    others = [i for i in said.effects if not i.startswith(BLADE)]
    several = "s" if len(motors) > 1 else ""
    looked = f"look at the propeller{several} of motor{several} {' and '.join(map(str, motors))}"
    text, kind = "no further flight is needed", ""
    if said.verdict == "none":
        text = "no further flight is needed; more healthy flights with --healthy would show smaller damage"
    elif said.effects[:1] == (WIND,):
        text, kind = _HOVER, "run"
    elif said.verdict == "insufficient" and said.leading == Explanation.of(DAY):
        text, kind = "three flights of this day that are known to be healthy, with --healthy and --healthy-day same; " \
                     "else check propellers and arms by hand", "reference"  # fmt: skip
    elif given < 3 and said.verdict != "named":
        text, kind = "three or more healthy flights of this vehicle, in still air, with --healthy", "reference"
        if motors:
            text = f"{looked}, and give {text}"
    elif said.verdict in ("unknown", "insufficient"):
        text, kind = f"{_HOVER}; check arms, motor tilt and propellers by hand", "run"
    elif any(i.startswith("imbalance") for i in others):
        text, kind = "look for tape, dirt and nicks on the blades and balance the propeller", "look"
    elif len(motors) > 1 and any(i.startswith(WEIGHT) for i in others):
        text, kind = f"weigh the vehicle, look where battery and payload sit, and {looked}", "look"
    elif motors and any(i.startswith(WEIGHT) for i in others):
        swap = _partner(motors[0], layout)
        text, kind = f"{looked}; if it looks right, exchange it {swap} and fly again: damage moves with it, a weight " \
                     "stays", "run"  # fmt: skip
    elif motors:
        text, kind = f"{looked} and replace what is damaged; the next flight should be within the healthy ones", "look"
    elif any(i.startswith(WEIGHT) for i in others):
        text, kind = "look where battery and payload sit", "look"
    elif others:
        text, kind = _HOVER, "run"
    return Suggestion(text, (), said.effects[:2], 0.0, 0.0, kind)


def _partner(motor: int, layout: NDArray[np.float64] | None) -> str:
    """With which propeller it can be exchanged: one that turns the same way, far from it."""
    if layout is None:
        return "with one that turns the same way"
    angle, turn, _ = layout.T
    away = np.where(turn == turn[motor - 1], -np.cos(angle - angle[motor - 1]), -np.inf)
    away[motor - 1] = -np.inf
    return f"with that of motor {int(np.argmax(away)) + 1}" if np.isfinite(away).any() else "with a new one"
