r"""SU2 convergence history: quoted names padded with blanks, commas between cells (CSV, or its Tecplot form).

::

    "Time_Iter","Outer_Iter","Inner_Iter",     "rms[Rho]"     ,       "CD"       , ...
              0,           0,           0,       -1.56427034,      0.2293788208, ...

Coefficients rest on reference values (``RefForce`` when it is written). A dual-time run keeps the last inner iteration
of each time step; with ``Cur_Time`` it is a history by time. Older versions head the first column "Iteration", as
STAR-CCM+ does; their coefficients and residuals tell them apart.
"""

from __future__ import annotations

import re

from bemt.data.readers.cfd import Column, Layout, cells_of, outermost

KIND = "su2_history"

_STEPS = ("Time_Iter", "Outer_Iter", "Inner_Iter", "Iteration")
_START = re.compile(
    r'(VARIABLES\s*=\s*)?"\s*((Time|Outer|Inner)_Iter\s*"\s*,|Iteration\s*",(?=.*"\s*(C[DL]|Res_|rms\[)))',
    re.IGNORECASE,
)


def _names(line: str) -> tuple[str, ...] | None:
    """Quoted names that begin with an iteration of SU2.

    >>> _names('"Time_Iter","Inner_Iter", "CD"'), _names('"Iteration","Thrust 1 Monitor: Thrust (N)"')
    (('Time_Iter', 'Inner_Iter', 'CD'), None)
    """
    return cells_of(re.sub(r"^VARIABLES\s*=\s*", "", line), ",") if _START.match(line) else None


def _column(name: str) -> Column:
    if name == "Cur_Time":
        return Column("time_s", "s", "time")
    if name.startswith("Time("):  # wall time
        return Column(name, "", "wall")
    return Column(name or "unnamed", "", "counter" if name in _STEPS else "value")


_LAYOUT = Layout(
    KIND, '"Time_Iter","Inner_Iter","CD"', _names, lambda line: cells_of(line, ","), _column,
    lambda line: re.match(r"(TITLE|ZONE)\b", line) is not None,
    ("coefficients rest on reference values that the history does not state",), commas=False,
    finish=outermost, within=4,
)  # fmt: skip
sniff, read = _LAYOUT.sniff, _LAYOUT.read
