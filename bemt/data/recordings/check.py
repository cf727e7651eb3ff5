"""Sanity before physics: faults of a recording, each named with its evidence and the correction it would take.

Nothing is corrected here. The checks work with whatever channels there are, and say nothing where they cannot know:
slips of units (:mod:`bemt.data.recordings.slips`); columns, signs and physical bounds
(:mod:`bemt.data.recordings.columns`). A new check is one function with the decorator ``check_for``.
"""

from __future__ import annotations

import numpy as np

from bemt.data.recordings import columns, slips  # they register themselves
from bemt.data.recordings.findings import CHECKS, SEVERITIES, Finding, facts_of
from bemt.physics.dataset import Dataset

__all__ = ["Finding", "check"]

_ROOMS = (slips, columns)


@np.errstate(all="ignore")  # a damaged file may hold any number
def check(
    source: Dataset, *, diameter_m: float | None = None, pitch_m: float | None = None, blades: int | None = None,
    ducted: bool = False,
) -> tuple[Finding, ...]:  # fmt: skip
    """Look for faults in a recording.

    >>> rpm = [4000.0, 5000.0, 6000.0, 7000.0]
    >>> stand = Dataset("bench", "stand", {"rpm": rpm, "thrust_N": [0.22, 0.34, 0.50, 0.68]})  # kgf, not N
    >>> [(f.id, f.correction.split(".")[0]) for f in check(stand, diameter_m=0.254)]
    [('thrust_unit', 'thrust_N: kgf taken for N: multiply by 9')]
    """
    facts = facts_of(source, diameter_m, pitch_m, blades, ducted)
    # what a computation holds constant, somebody has set
    checks = (run for name, run in CHECKS.items() if (source.kind, name) != ("cfd", "constant"))
    found = [finding for run in checks for finding in run(facts)]
    return tuple(sorted(found, key=lambda f: SEVERITIES.index(f.severity)))
