"""Force files of CFD as points of a recording: thrust and torque along the shaft, at a speed that the user states."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.dataset import Dataset

if TYPE_CHECKING:
    from bemt.base.averaging import Mean

__all__ = ["has_forces", "point_of"]

_AXES = "xyz"
_FORCE = re.compile(r"force_(total|pressure|viscous)_([xyz])_N(?:\((.*)\))?")
_MOMENT = re.compile(r"moment_(total|pressure|viscous)_([xyz])_Nm(?:\((.*)\))?")
# A thrust stands out of the side forces by this factor, or the shaft is not along an axis.
_ALONG = 3.0
# Uncertainty of a settled value, share of it; a drift counts as well.
_SETTLED = 0.01
_NET = ("net", "total", "")
# Files that OpenFOAM writes beside each other.
_BESIDE = {"force.dat": "moment.dat", "moment.dat": "force.dat"}


def has_forces(imported: Dataset) -> bool:
    """Whether a file holds forces of a computation and no points of a stand."""
    return imported.kind == "cfd" and any(_FORCE.fullmatch(k) or _MOMENT.fullmatch(k) for k in imported.values)


def _components(d: Dataset, pattern: re.Pattern[str], path: str) -> dict[str, tuple[float, float]]:
    """Mean and drift of the whole load by axis; {} without one."""
    zones: dict[str, dict[str, dict[str, tuple[float, float]]]] = {}
    means: Mapping[str, Mean] = d.provenance.get("means", {})
    for name, v in d.values.items():
        m = pattern.fullmatch(name)
        if m is None:
            continue
        mean, _, drift = means.get(name, (float(np.nanmean(v)), "", None))
        zones.setdefault((m[3] or "").lower(), {}).setdefault(m[2], {})[m[1]] = (mean, abs(mean * (drift or 0.0)))
    if not zones:
        return {}
    zone = next((z for z in _NET if z in zones), None)
    if zone is None and len(zones) > 1:
        got, expected = f"zones {', '.join(zones)}", "one zone, or a net one"
        raise InputError(Fault(path, "zones", got, expected, "Export the forces of the blades and hub alone"))
    parts = zones[next(iter(zones)) if zone is None else zone]
    out = {}
    for axis, kinds in parts.items():
        told = [kinds["total"]] if "total" in kinds else list(kinds.values())
        out[axis] = sum(v for v, _ in told), sum(d for _, d in told)
    return out


def point_of(imported: Dataset, path: str, rpm: float | None, airspeed_m_s: float | None) -> Dataset:
    """One point of a force file, and of the moment file that OpenFOAM writes beside it."""
    from bemt.recordings.load import import_file

    if rpm is None:
        raise InputError(Fault(path, "--rpm", "a force file of CFD without a speed of rotation", "--rpm N",
                               "One number for all files, or one each; --airspeed likewise"))  # fmt: skip
    files = [imported]
    other = Path(path).with_name(_BESIDE.get(Path(path).name, Path(path).name))
    if other.name != Path(path).name and other.is_file():
        files.insert(0, import_file(str(other)))
    forces, moments = ({k: v for d in files for k, v in _components(d, p, path).items()} for p in (_FORCE, _MOMENT))
    lead = forces or moments
    axis = max(lead, key=lambda a: abs(lead[a][0]))
    side = max((abs(v) for a, (v, _) in lead.items() if a != axis), default=0.0)
    if abs(lead[axis][0]) < _ALONG * side:
        got = ", ".join(f"{a} {v:.4g}" for a, (v, _) in lead.items())
        raise InputError(Fault(path, "axis", got, "one component that stands out: the thrust along x, y or z",
                               "Turn the frame so that the shaft is an axis"))  # fmt: skip
    values: dict[str, float] = {"rpm": float(rpm)}
    u: dict[str, float] = {}
    if airspeed_m_s is not None:
        values["airspeed_m_s"] = float(airspeed_m_s)
    for name, load in (("thrust_N", forces), ("torque_Nm", moments)):
        if axis in load:
            mean, drift = load[axis]
            values[name], u[name] = abs(mean), float(np.hypot(_SETTLED * abs(mean), drift / np.sqrt(12.0)))
    return Dataset("cfd", Path(path).name, {k: np.array([v]) for k, v in values.items()},
                   {k: np.array([v]) for k, v in u.items()}, provenance={"file": path})  # fmt: skip
