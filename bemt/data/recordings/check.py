"""Sanity before physics: faults of a recording, each named with its evidence and the correction it would take.

Nothing is corrected here. The checks work with whatever channels there are, and say nothing where they cannot know:
slips of units (:mod:`bemt.data.recordings.slips`); columns (:mod:`bemt.data.recordings.columns`), signs and physical
bounds (:mod:`bemt.data.recordings.limits`). A new check is one function with the decorator ``check_for``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bemt.data.recordings import columns, limits, slips  # they register themselves
from bemt.data.recordings.channels import file_name, named
from bemt.data.recordings.findings import CHECKS, SEVERITIES, Finding, facts_of
from bemt.physics.dataset import Dataset

__all__ = ["Finding", "check", "left_out", "without_current"]

_ROOMS = (slips, columns, limits)
LEFT_OUT = ("misread", "stuck_sensor")
OPEN_OR_OUT = (*LEFT_OUT, "unnamed_column")
"""Findings whose readings are left out, and these with what is to be asked about."""


@np.errstate(all="ignore")  # a damaged file may hold any number
def check(
    source: Dataset, *, diameter_m: float | None = None, pitch_m: float | None = None, ducted: bool = False,
    density_kg_m3: float | None = None,
) -> tuple[Finding, ...]:  # fmt: skip
    """Look for faults in a recording of a rotor, in air or water of a density where it states none.

    >>> rpm = [4000.0, 5000.0, 6000.0, 7000.0]
    >>> stand = Dataset("bench", "stand", {"rpm": rpm, "thrust_N": [0.22, 0.34, 0.50, 0.68]})  # kgf, not N
    >>> [(f.id, f.correction.split(".")[0]) for f in check(stand, diameter_m=0.254)]
    [('thrust_unit', 'thrust_N: kgf taken for N: multiply by 9')]
    """
    facts = facts_of(source, diameter_m, pitch_m, ducted, density_kg_m3)
    # what a computation holds constant, somebody has set
    checks = (run for name, run in CHECKS.items() if (source.kind, name) != ("cfd", "constant"))
    found = [finding for run in checks for finding in run(facts)]
    return tuple(sorted(found, key=lambda f: SEVERITIES.index(f.severity)))


def left_out(source: Dataset, findings: Sequence[Finding]) -> Dataset:
    """The recording without the readings that its checks leave out; a row whose airspeed stuck is no row.

    >>> made = Dataset("bench", "table", {"rpm": [4e3, 5e3], "airspeed_m_s": [8.0, 8.0]}, lines=(2, 3))
    >>> left_out(made, [Finding("stuck_sensor", "airspeed_m_s", "", "", (1,), "warning")]).lines
    (2,)
    """
    values, keep = {**source.values}, np.ones(len(source), dtype=bool)
    airspeed = file_name(named(source), "airspeed_m_s")
    for f in findings:
        if f.id in LEFT_OUT:
            values[f.channel] = np.array(values[f.channel])
            values[f.channel][list(f.rows)] = np.nan
            keep[list(f.rows)] &= f.channel != airspeed
    found = replace(source, values=values)
    return found if keep.all() else found.select(keep)


def without_current(source: Dataset, findings: Sequence[Finding]) -> tuple[Dataset, tuple[Finding, ...]]:
    """The recording without a current that cannot be right where a torque is there, and what that makes of its errors.

    Thrust, torque and speed stand without it, so that the error is a warning then.

    >>> made = Dataset("bench", "table", {"rpm": [4e3], "torque_Nm": [0.1], "voltage_V": [12.0], "current_A": [9.0]})
    >>> left, (wrong,) = without_current(made, [Finding("power_above_input", "current_A", "", "", (0,))])
    >>> sorted(left.values), wrong.severity
    (['rpm', 'torque_Nm', 'voltage_V'], 'warning')
    """
    known = named(source)
    own = file_name(known, "current_A")
    wrong = [f for f in findings if f.severity == "error" and f.channel == own]
    if not wrong or "torque_Nm" not in known.values:
        return source, tuple(findings)
    gone = {own, file_name(known, "electrical_power_W")}
    values = {k: v for k, v in source.values.items() if k not in gone}
    mended = "it is left out here: thrust, torque and speed do not need it"
    found = tuple(replace(f, severity="warning", correction=mended) if f in wrong else f for f in findings)
    return replace(source, values=values, u={k: v for k, v in source.u.items() if k in values}, u_by={}), found
