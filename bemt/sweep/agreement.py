"""When a model and a recording agree after ASME V&V 20, also where nobody states how good the recording is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from bemt.base.tables import number_text


def _u(c: Mapping[str, Any], name: str) -> float:
    value = c.get(name, 0.0)
    return math.nan if value is None else float(value)


def known(c: Mapping[str, Any]) -> float:
    """Standard uncertainty of the model's side of a comparison; NaN where a part of it is unknown."""
    return math.sqrt(sum(_u(c, name) ** 2 for name in ("u_num", "u_input", "u_model")))


def needed(c: Mapping[str, Any]) -> float:
    """Least standard uncertainty of the recording with which the two agree: |E| <= u_val; 0 inside the model's band.

    >>> needed({"E": 5.0, "u_num": 0.0, "u_input": 3.0, "u_model": 0.0})
    4.0
    """
    own = known(c)
    return math.nan if math.isnan(own) else math.sqrt(max(_u(c, "E") ** 2 - own**2, 0.0))


def doubted(c: Mapping[str, Any]) -> str:
    """Why agreement means little at this point, to be added to it; empty where nothing is flagged.

    >>> doubted({"doubts": ["supersonic tip"]}), doubted({})
    (', but flagged: supersonic tip', '')
    """
    return f", but flagged: {', '.join(c['doubts'])}" if c.get("doubts") else ""


def agreement(c: Mapping[str, Any]) -> str:
    """Say how a comparison stands, or what the recording's uncertainty would have to be."""
    return _words(c) + doubted(c)


def _words(c: Mapping[str, Any]) -> str:
    E, own, u_D = abs(_u(c, "E")), known(c), _u(c, "u_D")
    if math.isnan(E):
        return "no result"
    if math.isnan(own):
        return "uncertainty of the model unknown"
    if math.isfinite(u_D):
        return "not distinguishable from noise" if E <= math.hypot(own, u_D) else "differs"
    if E <= own:
        return "u_D unknown; within the uncertainty of the model"
    share = f" ({100.0 * needed(c) / abs(c['D']):.2g} %)" if c.get("D") else ""
    return f"u_D unknown; agrees only if it is {number_text(needed(c), 2)} {c['unit']}{share} or more"
