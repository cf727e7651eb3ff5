"""Audit of the CFD values of a case: what the remarks of their references say of the set-up."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

from bemt.data.recordings.audit import CfdFacts

_PHRASES: tuple[tuple[str, dict[str, Any]], ...] = (
    (r"cylinder of the (propeller|rotor|fan)'s (own )?diameter", {"domain_over_D": 1.0}),
    (r"\bincompressible\b", {"compressible": False}),
    (r"(?<!in)\bcompressible\b", {"compressible": True}),
    (r"\bno grid study\b|\bno mesh study\b", {"grids": 0}),
    (r"\bscalable wall functions?\b", {"wall": "scalable"}),
    (r"(?<!scalable )(?<!automatic )\bwall functions?\b", {"wall": "function"}),
    (r"\bautomatic wall functions?\b", {"wall": "automatic"}),
    (r"\bat (one|a single) node\b", {"thrust_from": "node"}),
    (r"\bforces integrated\b|\bintegrated over the blades\b", {"thrust_from": "forces"}),
    (r"\brotating (cell )?(zone|frame)\b|\bMRF\b|\bfrozen rotor\b", {"steady_mrf": True}),
    (r"\bsliding mesh\b", {"steady_mrf": False}),
    (r"\brealizable k-epsilon\b", {"turbulence": "realizable k-epsilon"}),
    (r"\bk-omega SST\b", {"turbulence": "k-omega SST"}),
)
"""Words of a remark and what they state."""
_NUMBER = r"([0-9]*\.?[0-9]+)"
_NUMBERS: tuple[tuple[str, str, float], ...] = (
    (rf"\bdomain {_NUMBER} D\b", "domain_over_D", 1.0),
    (rf"\by\+ {_NUMBER}", "y_plus", 1.0),
    (rf"\bu_grid {_NUMBER} ?%", "u_grid", 0.01),
    (rf"\bGCI {_NUMBER} ?%", "u_grid", 0.01 / 1.15),
    (rf"\bdrift {_NUMBER} ?%", "drift", 0.01),
    (rf"\bskew {_NUMBER} deg\b", "skew_deg", 1.0),
    (rf"\bmass balance {_NUMBER} ?%", "mass_balance", 0.01),
    (rf"\bmomentum balance {_NUMBER} ?%", "momentum_balance", 0.01),
    (rf"\b{_NUMBER} cells\b", "cells", 1.0),
)


def facts_from_remark(remark: str, known: CfdFacts | None = None) -> CfdFacts:
    """Read set phrases of a remark in ``references.csv``; other words say nothing.

    >>> f = facts_from_remark("MRF; k-omega SST with automatic wall functions; domain 5 D, y+ 51, GCI 2.3 %")
    >>> f.steady_mrf, f.wall, f.domain_over_D, f.y_plus, f.u_grid, f.compressible
    (True, 'automatic', 5.0, 51.0, 0.02, None)
    """
    found: dict[str, Any] = {}
    for pattern, values in _PHRASES:
        if re.search(pattern, remark, re.IGNORECASE):
            found |= values
    for pattern, name, factor in _NUMBERS:
        match = re.search(pattern, remark, re.IGNORECASE)
        if match:
            found[name] = float(f"{float(match[1]) * factor:.12g}")
    return replace(known or CfdFacts(), **found)
