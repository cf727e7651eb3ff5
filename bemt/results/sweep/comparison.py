"""A model's value against a recorded one after ASME V&V 20, also where nobody states how good the recording is."""

from __future__ import annotations

import math
from dataclasses import field
from typing import Any, Literal

from bemt.base.document import Documented
from bemt.base.tables import number_text

State = Literal["no result", "model unknown", "agrees", "differs", "inside", "open"]
"""`inside` the model's own band whatever the recording's uncertainty is, `open` until that is stated."""


class Comparison(Documented):
    """One channel at one point: E = S - D beside its standard uncertainties, in `unit`; NaN where unknown.

    >>> Comparison(S=12.0, D=7.0, u_input=3.0).needed, Comparison(S=12.0, D=7.0, u_input=3.0).state
    (4.0, 'open')
    """

    model: str = "bemt"
    reference: str = ""
    source: str = ""
    quantity: str = "thrust_N"
    unit: str = "N"
    # Simulated and recorded value; their difference, also in per cent of the recording, follows where it is not given
    S: float = math.nan
    D: float = math.nan
    E: float = field(default=math.nan, kw_only=True)
    E_pct: float = field(default=math.nan, kw_only=True)
    # Of the model's numerics, inputs and form; of the recording
    u_num: float = 0.0
    u_input: float = 0.0
    u_model: float = 0.0
    u_D: float = math.nan
    u_val: float = field(default=math.nan, kw_only=True)  # Of both sides, follows likewise
    doubts: tuple[str, ...] = ()  # Flags for which agreement means little here

    def __post_init__(self) -> None:
        """Fill in what follows; a stored line keeps what was computed before its parts were rounded."""
        E = self.S - self.D
        follows = {"E": E, "E_pct": 100.0 * E / self.D if self.D else math.nan,
                   "u_val": math.sqrt(self.u_num**2 + self.u_input**2 + self.u_model**2 + self.u_D**2)}  # fmt: skip
        for name, value in follows.items():
            if math.isnan(getattr(self, name)):
                object.__setattr__(self, name, value)

    @property
    def known(self) -> float:
        """Standard uncertainty of the model's side; NaN where a part of it is unknown."""
        return math.sqrt(self.u_num**2 + self.u_input**2 + self.u_model**2)

    @property
    def needed(self) -> float:
        """Least standard uncertainty of the recording with which the two agree: |E| <= u_val; 0 inside the band."""
        return math.nan if math.isnan(self.known) else math.sqrt(max(self.E**2 - self.known**2, 0.0))

    @property
    def needed_pct(self) -> str:
        """The same as a share of the recording, with two figures; "" where that is zero."""
        return f"{100.0 * self.needed / abs(self.D):.2g} %" if self.D else ""

    @property
    def state(self) -> State:
        """How model and recording stand, whatever is flagged."""
        if not math.isfinite(self.E):
            return "no result"
        if not math.isfinite(self.known):
            return "model unknown"
        if math.isfinite(self.u_D):
            return "agrees" if abs(self.E) <= self.u_val else "differs"
        return "inside" if abs(self.E) <= self.known else "open"

    @property
    def but_flagged(self) -> str:
        """Why agreement means little at this point, to be added to it; empty where nothing is flagged."""
        return f", but flagged: {', '.join(self.doubts)}" if self.doubts else ""

    @property
    def verdict(self) -> str:
        """How the comparison stands, or what the recording's uncertainty would have to be."""
        share = f" ({self.needed_pct})" if self.needed_pct else ""
        words: dict[State, str] = {
            "no result": "no result", "model unknown": "uncertainty of the model unknown",
            "agrees": "not distinguishable from noise", "differs": "differs",
            "inside": "u_D unknown; within the uncertainty of the model",
            "open": f"u_D unknown; agrees only if it is {number_text(self.needed, 2)} {self.unit}{share} or more",
        }  # fmt: skip
        return words[self.state] + self.but_flagged

    def document(self) -> dict[str, Any]:
        """Line of a result, what follows from it included."""
        return super().document() | {"verdict": self.verdict}
