"""What ``import`` says of a recording first: what it holds, and whether it contradicts itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bemt.base.tables import number_of, some
from bemt.data.recordings.findings import Finding
from bemt.data.recordings.reduce import reduction
from bemt.physics.dataset import Dataset

_WORDS = {"thrust_N": "thrust", "torque_Nm": "torque", "power_W": "shaft power",
          "electrical_power_W": "electrical power", "CT": "CT", "CP": "CP", "CQ": "CQ"}  # fmt: skip
"""Loads, in a sentence."""


def _range(points: Dataset) -> list[str]:
    """Speeds, or advance ratios or throttle where no speed is told, of some points."""
    for name, unit in (("rpm", " rev/min"), ("J", " of advance ratio"), ("throttle", " of full throttle")):
        seen = points.values.get(name, np.zeros(0))
        if np.isfinite(seen).any():
            ends = (f"{f(seen):.{0 if name == 'rpm' else 2}f}" for f in (np.nanmin, np.nanmax))
            return [f"{' to '.join(dict.fromkeys(ends))}{unit}"]
    return []


def _gaps(record: Dataset) -> list[str]:
    """Channels that lack a number in some rows, each with its lines."""
    gone = {k: np.flatnonzero(~np.isfinite(v)) for k, v in record.values.items()}
    lines = [str(n) for n in record.lines] or [str(k + 1) for k in range(len(record))]
    return [f"{record.headings.get(k) or k} (line{'s' * (at.size > 1)} {some([lines[i] for i in at], 4)})"
            for k, at in gone.items() if 0 < at.size < len(record)]  # fmt: skip


def sentence(record: Dataset, points: Dataset, findings: Sequence[Finding], open_: bool) -> str:
    """Of a recording and its points; ``open_``: whether some of it is not read yet."""
    loads = [words for k, words in _WORDS.items() if k in points and np.isfinite(points[k]).any()]
    loads = [words for words in loads if words != "shaft power" or "torque" not in loads]
    listed = " and ".join(filter(None, [", ".join(loads[:-1]), *loads[-1:]])) or "no load"
    told = [number_of(len(points), "point"), *_range(points), listed]
    wrong, doubt = ([f.channel for f in findings if f.severity == kind] for kind in ("error", "warning"))
    gaps = _gaps(record) if points is record or reduction(points).mode == "points" else []
    parts = (("cannot be right:", wrong), ("in doubt:", doubt), ("no number in", gaps))
    said = [f"{words} {some(dict.fromkeys(which), 4)}" for words, which in parts if which]
    said += ["not all of it is read, see Next"] if open_ else []
    return f"{', '.join(told)}; {'; '.join(said) or 'nothing contradicts itself'}."
