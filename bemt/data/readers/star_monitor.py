r"""STAR-CCM+ monitors and plots saved as CSV: quoted headings with the unit in parentheses.

::

    "Iteration","Thrust 1 Monitor: Thrust (N)","Torque 1 Monitor: Moment (N-m)"
    1,12.5,0.31

Steady runs count "Iteration"; implicit unsteady ones have "Physical Time: Physical Time (s)". A monitor is named by
what stands before " Monitor:".
"""

from __future__ import annotations

import re

from bemt.data.readers.cfd import Column, Layout, cells_of, si_unit

KIND = "star_monitor"

_HEADING = re.compile(r"(?P<name>.*?)(?P<monitor> Monitor(: (?P<what>[^()]*?))?)?( ?\((?P<unit>[^()]*)\))?")
_CLOCK = re.compile(r"(Physical )?Time(: Physical Time)?( \(s\))?|Time Step(: Time Step)?|Iteration(: Iteration)?")


def _names(line: str) -> tuple[str, ...] | None:
    """Headings of monitors under a clock of STAR-CCM+.

    >>> _names('"Iteration","Thrust 1 Monitor: Thrust (N)"'), _names('"Iteration","CL","CD"')
    (('Iteration', 'Thrust 1 Monitor: Thrust (N)'), None)
    """
    cells = cells_of(line, ",")
    own = line.startswith(("Physical Time: ", '"Physical Time: ')) or " Monitor" in line
    return cells if own and any(_CLOCK.fullmatch(cell) for cell in cells) else None


def _column(name: str) -> Column:
    if _CLOCK.fullmatch(name):
        timed = "Time" in name and "Step" not in name
        return Column("time_s", "s", "time") if timed else Column(name.split(":")[0], "", "step")
    match = _HEADING.fullmatch(name)
    unit = match["unit"] or "" if match else ""
    return Column((match["name"] if match else name) or "unnamed", si_unit(unit) or unit)


_LAYOUT = Layout(
    KIND, '"Iteration","Thrust 1 Monitor: Thrust (N)"', _names, lambda line: cells_of(line, ","), _column,
    notes=("monitors state neither sector nor sign convention",), commas=False,
)  # fmt: skip
sniff, read = _LAYOUT.sniff, _LAYOUT.read
