"""Errors of many propellers together, and how many points the intervals hold."""

from __future__ import annotations

from typing import Any

import numpy as np

from bemt.rotors.mixture import LEVELS
from bemt.validate.built import Expected
from bemt.validate.points import KINDS, Array, Rows, errors, statistics


class Pool:
    """Errors of many propellers, together; with intervals also how many points they hold and how wide they are."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str, str], list[Array]] = {}

    def add(self, rows: Rows, expected: Expected | None = None) -> dict[str, Any]:
        """Take the points of one propeller; returns its own statistics."""
        own = Pool()
        for kind, found in errors(rows).items():
            for q, e in found.items():
                own._found[kind, q, "error"] = [e]
                if expected is not None:
                    own._found[kind, q, "probability"] = [expected.probability[kind][q]]
                    own._found[kind, q, "width"] = [expected.width[kind][q]]
                    own._found[kind, q, "log_density"] = [expected.log_density[kind][q]]
        for key, values in own._found.items():
            self._found.setdefault(key, []).extend(values)
        out = own.total()
        for kind in KINDS:
            out[kind].pop("propellers")
        return out

    def add_kind(self, expected: Expected, kind: str) -> None:
        """Take the points of one kind only."""
        own = Pool()
        own.add(expected.rows, expected)
        for key, values in own._found.items():
            if key[0] == kind:
                self._found.setdefault(key, []).extend(values)

    def total(self) -> dict[str, Any]:
        """Statistics over all points; ``log_score`` is a mean over propellers of the mean log density of their
        points.
        """
        out: dict[str, Any] = {}
        for kind in KINDS:
            sizes = [e.size for e in self._found.get((kind, "CT", "error"), [])]
            out[kind] = {"propellers": sum(size > 0 for size in sizes), "points": sum(sizes)}
            for q in ("CT", "CP"):
                e, probability, width = (
                    np.concatenate([*self._found.get((kind, q, what), []), np.empty(0)])
                    for what in ("error", "probability", "width")
                )
                out[kind][q] = statistics(e)
                if (kind, q, "probability") in self._found:
                    out[kind][q] |= coverage(probability, width)
                    means = [float(np.mean(v)) for v in self._found[kind, q, "log_density"] if v.size]
                    out[kind][q]["log_score"] = float(np.mean(means)) if means else None
        return out


def coverage(probability: Array, width: Array) -> dict[str, Any]:
    """Share of points inside the 68 and 95 % intervals, and the median half width of the first [1]."""
    if probability.size == 0:
        return {"coverage": {"68": None, "95": None}, "width68": None}
    held = {name: float(np.mean(probability <= level)) for name, level in zip(("68", "95"), LEVELS, strict=True)}
    return {"coverage": held, "width68": float(np.median(width))}
