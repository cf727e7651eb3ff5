"""What the manifest of an export says of one target: what its files hold, and what they do not."""

from __future__ import annotations

import hashlib
from typing import Any

from bemt.base.plugins import missing_for
from bemt.tools.exports.base import Export, Files, Job
from bemt.tools.exports.performance import THINNER

HUB_NOTE = (
    "steady, stiff blades; moments come out too large, because the inflow that they cause themselves is left out; "
    "neither H, Y nor the moments have been compared with a measurement"
)


def _lost(export: Export, job: Job) -> list[str]:
    """What the target does not hold, for its notes: direction of rotation, Reynolds number, the end of a table."""
    out = []
    if "rotation" not in export.features:
        out.append(f"the direction of rotation is not in the file: this rotor is {job.rotation}")
    if export.kind != "loads":
        return out
    out += missing_for(job.case)
    if "hub" not in export.features:
        out.append("loads across the shaft are not in the file: no H force, no hub moments, thrust as in axial flow")
    elif job.case.ducted:
        out.append("a ducted rotor has no loads across the shaft here: its hub loads are 0")
    else:
        out.append(f"loads across the shaft: {HUB_NOTE}")
    air, (thrust, torque) = job.case.air(), job.thinner
    out.append(
        f"the coefficients hold the Reynolds numbers of the case's air ({air.rho:.4g} kg/m3): at {THINNER:g} of that "
        f"density, static CT would be {100 * thrust:+.2g} %, CP {100 * torque:+.2g} %"
    )
    if {"windmill", "reynolds"} <= export.features:
        t = job.performance
        out.append(
            f"the table covers each speed up to {t.range_document()['airspeed_m_s_greatest']:.3g} m/s and descent to J "
            f"{t.J[0]:.2g}; beyond, the last coefficient is held, so the drag of a windmill stops growing with airspeed"
        )
    return out


def entry(export: Export, job: Job, files: Files) -> dict[str, Any]:
    """Manifest entry of one target: what a reader of its files must know, and a hash of each."""
    found: dict[str, Any] = {
        "target": export.id,
        "title": export.title,
        "kind": export.kind,
        "holds": export.holds,
        "features": sorted(export.features),
        "conventions": export.conventions,
        "rotation": job.rotation,
        "source": export.source,
    }
    found |= export.checked(job, files)
    if export.kind == "loads" and job.rpm is None and job.full_throttle is not None:
        found["full_throttle"] = job.full_throttle
    found["notes"] = export.notes(job) + _lost(export, job)
    found["files"] = [
        {"path": name, "bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
        for name, data in ((n, d.encode() if isinstance(d, str) else d) for n, d in files.items())
    ]
    return found


def joined(first: dict[str, Any], second: dict[str, Any]) -> dict[str, Any]:
    """Both manifests in one; the second is the newer."""
    joined = {**first, **second}
    for key in ("volumes_m3", "case_sha256"):
        if key in first or key in second:
            joined[key] = {**first.get(key, {}), **second.get(key, {})}
    for key in ("files", "targets"):
        if key in first or key in second:
            joined[key] = [*first.get(key, []), *second.get(key, [])]
    return joined
