r"""Flow360 force histories (``total_forces_v2.csv``): coefficients by physical and pseudo step.

::

    physical_step, pseudo_step, CL, CD, CFx, CFy, CFz, CMx, CMy, CMz, CLPressure, ...
    0, 0, -1.480, 12.750, ...

A steady run counts pseudo steps; of a transient one the last pseudo step of each physical step holds. Coefficients rest
on the reference area, lengths and velocity of the case, which the file does not state.
"""

from __future__ import annotations

from bemt.data.readers.cfd import Column, Layout, cells_of, outermost

KIND = "flow360_forces"

_STEPS = ("physical_step", "pseudo_step")


def _names(line: str) -> tuple[str, ...] | None:
    cells = cells_of(line, ",")
    return cells if cells[:2] == _STEPS else None


_LAYOUT = Layout(
    KIND, "physical_step, pseudo_step, CL, CD", _names, lambda line: cells_of(line, ","),
    lambda name: Column(name or "unnamed", "", "counter" if name in _STEPS else "value"),
    notes=("coefficients rest on reference values that the file does not state",), commas=False, finish=outermost,
)  # fmt: skip
sniff, read = _LAYOUT.sniff, _LAYOUT.read
