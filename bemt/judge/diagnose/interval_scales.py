"""Factors on the intervals of parameters, so that as many hold the truth as they say: split conformal calibration.

A half-width times the factor of its parameter (of its kind of fault, where few were seen) held 90 % of the truths
in the development sets that ``bemt lab prove --calibrate-intervals DIR`` drew (Vovk, Gammerman and Shafer
2005, Algorithmic Learning in a Random World, ch. 4; Lei et al. 2018, J. Am. Stat. Assoc. 113:1094). The file says
which seeds and version.
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from importlib import resources
from typing import Any

from bemt.judge.explanation import Size, Sizes
from bemt.physics import effects

FILE = "interval_scales.json"


@cache
def _scales() -> dict[str, Any]:
    text = resources.files("bemt.judge.diagnose").joinpath(FILE).read_text(encoding="utf-8")
    found: dict[str, Any] = json.loads(text)
    return found


def scale_of(effect: str, parameter: str) -> float:
    """Factor on the half-widths of a parameter [1]."""
    table = _scales()
    own = table["parameters"].get(f"{effect}.{parameter}")
    return float((own or table["kinds"].get(effects.catalogue()[effect].kind, {"scale": 1.0}))["scale"])


def widened(told: Sizes) -> dict[str, dict[str, Size]]:
    """Parameters of effects with calibrated intervals, within their physical ranges."""
    return {i: {k: _widened(i, k, v) for k, v in numbers.items()} for i, numbers in told.items()}


def _widened(effect: str, name: str, v: Size) -> Size:
    cls = effects.catalogue()[effect]
    p = next((p for p in cls.parameters if p.name == name), None)
    if p is None or name in cls.discrete or not isinstance(v.value, float):
        return v
    s = scale_of(effect, name)
    low, high = v.value - s * (v.value - v.low), v.value + s * (v.high - v.value)
    return replace(v, low=max(low, min(p.low, v.value)), high=min(high, max(p.high, v.value)))
