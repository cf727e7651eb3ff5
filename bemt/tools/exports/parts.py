"""Text and numbers that several exports share."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt import __version__
from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.plugins import missing_for
from bemt.physics.bem.model import HUB_LOADS
from bemt.rotors.case.prepare import prepare_case
from bemt.tools.exports.performance import LOWEST, THINNER, Performance, held, table_loads

if TYPE_CHECKING:
    from bemt.rotors.case import Case
    from bemt.tools.exports.base import Export, Files, Job, Manifest


# Loads of the hub in oblique flow for the exports: a table over speed, axial and in-plane advance ratio.
#
# Coefficients refer to diameter and speed like CT: forces over rho n^2 D^4, moments over rho n^2 D^5.  Thrust and
# power are changes against axial flow at the same axial advance ratio, so that the finer axial table of
# `bemt.tools.exports.performance` stays what it is.  With u the direction in which the rotor moves through the air in
# the plane of its disk, z along the thrust, s = +1 for a right-handed rotor and a = s u x z the side on which blades
# advance::
#
#     force  = (T + dT) z - H u + Y a
#     moment = -s (Q + dQ) z + roll a x z + pitch u x z

COEFFICIENTS = ("dCT", "dCP", "CH", "CY", "CMroll", "CMpitch")
"""Values of the table, in this order."""
N_RPM = 5
IN_FLIGHT = np.array([0.0, 0.12, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0, 1.2])
"""Advance ratios over that of zero thrust, axial and in-plane."""
FAST = np.array([1.6, 2.4, 4.8])
"""The same beyond: what a slow rotor meets at the airspeed at which the fastest has no thrust."""
CHECK_ANGLES = (20.0, 45.0, 70.0, 90.0, 110.0)
"""Angles between wind and shaft at which the written numbers are checked [deg]."""


@dataclass(frozen=True, eq=False)
class HubTable:
    """Coefficients over speed, axial and in-plane advance ratio, linear, held at the ends."""

    rpm: Array  # (R,) ascending [rev/min]
    J: Array  # (K,) of the axial speed, ascending, from descent [-]
    side: Array  # (S,) of the in-plane speed, from 0 [-]
    values: Array  # (6, R, K, S) of COEFFICIENTS [-]


def hub_of(case: Case, table: Performance) -> HubTable:
    """Solve the table of an open rotor; beyond the flight range, unsolved points hold the last one towards rest."""
    ready, air, D = prepare_case(case), case.air(), table.diameter_m
    greatest = float(table.J_zero.max())
    rpm = np.linspace(LOWEST * table.rpm[-1], table.rpm[-1], N_RPM)
    deep = np.linspace(min(table.J[0], -0.5 * greatest), 0.0, 5)[:-1]
    J = np.concatenate([deep, greatest * IN_FLIGHT, greatest * FAST])
    side = np.concatenate([greatest * IN_FLIGHT, greatest * FAST])
    n, j, s = np.meshgrid(rpm, J, side, indexing="ij")
    rev = n.ravel() / 60.0
    along = np.minimum(j.ravel() * rev * D, air.a_sound)  # a table node, not a flight
    across = np.minimum(s.ravel() * rev * D, air.a_sound)
    found = ready.solve(n.ravel(), along, air, side=across)
    scale = air.rho * rev**2 * D**4
    columns = [found.CT, found.CP, *(found[key] / scale / (1.0 if key.endswith("_N") else D) for key in HUB_LOADS)]
    values = np.array([np.where(found.converged, v, np.nan) for v in columns]).reshape(6, *n.shape)
    values[2:, :, :, 0] = 0.0  # no wind from the side
    values[:2] -= values[:2, :, :, :1]
    inside = (j >= 0.0) & (j <= 1.2 * greatest) & (s <= 1.2 * greatest)
    bad = inside & np.isnan(values).any(axis=0)
    if bad.any():
        at = np.argwhere(bad)[0]
        where = f"{rpm[at[0]]:.0f} rev/min, J {J[at[1]]:.2g} along and {side[at[2]]:.2g} across the shaft"
        fault = Fault(case.path.as_posix(), where, "not converged", "a converged point", "Nothing was written")
        raise InputError(fault)
    for k in range(1, side.size):
        values[..., k] = np.where(np.isnan(values[..., k]), values[..., k - 1], values[..., k])
    return HubTable(rpm, J, side, np.nan_to_num(values))


def hub_document(hub: HubTable) -> dict[str, Any]:
    """The table as plain values."""
    named = {name: v.tolist() for name, v in zip(COEFFICIENTS, hub.values, strict=True)}
    return {"rpm": hub.rpm.tolist(), "J_axial": hub.J.tolist(), "J_side": hub.side.tolist(), **named}


def hub_loads(doc: Mapping[str, Any], rho: float, D: float, rpm: Array, V: Array, side: Array) -> Array:
    """Changes of thrust [N] and torque [N m], H, Y [N], roll, pitch [N m] of such a document at points, (6, P)."""
    axes = [np.asarray(doc[key], dtype=float) for key in ("rpm", "J_axial", "J_side")]
    n = rpm / 60.0
    tables = np.array([doc[name] for name in COEFFICIENTS], dtype=float)
    arms = np.array([1.0, D / (2.0 * np.pi), 1.0, 1.0, D, D])
    scale: Array = arms[:, None] * rho * n**2 * D**4
    return held(axes, tables, rpm, V / (n * D), side / (n * D)) * scale


WRENCH_CODE = '''

def hub(rpm, axial_m_s, side_m_s, density_kg_m3=DENSITY):
    """Thrust [N], torque [N m], H, Y [N], roll and pitch moment [N m] with a wind across the shaft.

    H points downstream, Y to the side where blades advance; roll lifts that side, pitch the upstream side.
    """
    T, Q = loads(rpm, axial_m_s, density_kg_m3)
    n = rpm / 60.0
    if n <= 0.0:
        return T, Q, 0.0, 0.0, 0.0, 0.0
    i, a = _cell(HUB["rpm"], rpm)
    j, b = _cell(HUB["J_axial"], axial_m_s / (n * DIAMETER))
    k, c = _cell(HUB["J_side"], side_m_s / (n * DIAMETER))
    scale = density_kg_m3 * n**2 * DIAMETER**4
    corners = [(p, q, r, (a if p else 1 - a) * (b if q else 1 - b) * (c if r else 1 - c))
               for p in (0, 1) for q in (0, 1) for r in (0, 1)]
    dT, dQ, H, Y, roll, pitch = (
        scale * factor * sum(w * HUB[name][i + p][j + q][k + r] for p, q, r, w in corners)
        for name, factor in (("dCT", 1.0), ("dCP", DIAMETER / (2.0 * math.pi)), ("CH", 1.0), ("CY", 1.0),
                             ("CMroll", DIAMETER), ("CMpitch", DIAMETER)))
    return T + dT, Q + dQ, H, Y, roll, pitch


def wrench(rpm, velocity_m_s, density_kg_m3=DENSITY, sense=SENSE):
    """Force [N] and moment [N m] on the vehicle, x y z; velocity of the hub through the air, z along the thrust.

    `sense` -1 is the mirror image of a right-handed propeller.
    """
    x, y, z = velocity_m_s
    side = math.hypot(x, y)
    T, Q, H, Y, roll, pitch = hub(rpm, z, side, density_kg_m3)
    if side > 0.0:
        x, y = x / side, y / side
    force = -H * x + Y * sense * y, -H * y - Y * sense * x, T
    moment = -roll * sense * x + pitch * y, -roll * sense * y - pitch * x, -sense * Q
    return force, moment
'''
"""Python that looks the table up, behind `bemt.tools.exports.parts.TABLE_CODE`: standard library only."""


BLADE_DENSITY = 1400.0
"""Of moulded blades, glass-filled nylon; for the estimate of inertia alone [kg/m3]."""


def plain_name(name: str) -> str:
    """Name that XML, C and Python take as an identifier."""
    word = re.sub(r"\W", "_", name)
    return f"p_{word}" if not word or word[0].isdigit() else word


def written(files: Files, end: str) -> str:
    """Text of the file whose name ends so."""
    return str(next(data for name, data in files.items() if name.endswith(end)))


def header(job: Job, title: str) -> list[str]:
    """Lines for the head of a text file."""
    table = job.performance
    matched = "" if job.matched_rpm is None else f"; loads at rest matched at {job.matched_rpm:.6g} rev/min"
    return [
        f"{title}: {job.case.name}, written by bemt {__version__}",
        f"{table.rpm[0]:.6g} to {table.rpm[-1]:.6g} rev/min, J 0 to {table.J_zero.max():.4g}, "
        f"density {table.rho:.6g} kg/m3; fit error, band and range: manifest.json{matched}",
    ]


def inertia_estimate(job: Job) -> float:
    """Inertia of the blades about the shaft, from their sections and the density of a moulding [kg m2]."""
    rotor = job.case.rotor()
    stations = rotor.blade.midpoints(60)
    thickness = np.array([rotor.blade.section(float(r)).thickness if rotor.blade.anchors else 0.12 for r in stations.r])
    area = 0.68 * thickness * stations.chord**2
    return float(rotor.B * BLADE_DENSITY * np.sum(area * stations.r**2 * stations.dr))


def static_fit(table: Performance) -> tuple[float, float]:
    """K in T = kT W^2 and Q = kQ W^2 at rest, least squares over the speeds relative to each load [N s2], [N m s2]."""
    W = table.rpm * np.pi / 30.0
    T, Q = table.thrust_N[:, table.at_rest], table.torque_Nm[:, table.at_rest]
    return tuple(float(np.sum(W**2 / y) / np.sum((W**2 / y) ** 2)) for y in (T, Q))  # type: ignore[return-value]


HEAVY = 1e4
"""Weight of rest in a fit that is matched there: flight moves it by 1e-6 at most. [1]"""


def fit_weight(job: Job, J: Array) -> Array:
    """What nodes at these advance ratios count in a fit of few numbers, (N,) [1]."""
    return np.where((J == 0.0) & (job.matched_rpm is not None), HEAVY, 1.0)


def edgewise(job: Job) -> tuple[Array, Array, Array]:
    """Speed [rev/min], airspeed across the shaft [m/s] and loads (6, P) where models of few numbers are fitted."""
    t, hub = job.performance, job.hub
    assert hub is not None  # an open rotor
    rpm, share = (v.ravel() for v in np.meshgrid(t.rpm[t.rpm >= 0.5 * t.rpm[-1]], np.linspace(0.1, 1.0, 10)))
    V = share * np.interp(rpm, t.rpm, t.J_zero) * rpm / 60.0 * t.diameter_m
    loads = hub_loads(hub_document(hub), t.rho, t.diameter_m, rpm, 0.0 * V, V)
    loads[:2] += t.lookup(rpm, 0.0 * V)
    return rpm, V, loads


def slope(x: Array, y: Array) -> float:
    """K of y = k x by least squares."""
    return float(np.sum(x * y) / np.sum(x * x))


def table_document(job: Job) -> dict[str, Any]:
    """The whole table as plain values."""
    t = job.performance
    return {
        "name": t.name, "diameter_m": t.diameter_m, "blades": t.blades,
        "rotation": "right" if t.sense > 0 else "left", "density_kg_m3": t.rho, "rpm": t.rpm.tolist(),
        "J": t.J.tolist(), "CT": t.CT.tolist(), "CP": t.CP.tolist(), "J_zero_thrust": t.J_zero.tolist(),
    }  # fmt: skip


def table_of_document(doc: Mapping[str, Any], rpm: Array, V: Array) -> tuple[Array, Array]:
    """Loads of such a document, bilinear."""
    n, J, CT, CP = (np.asarray(doc[key], dtype=float) for key in ("rpm", "J", "CT", "CP"))
    return table_loads(n, J, CT, CP, float(doc["density_kg_m3"]), float(doc["diameter_m"]), rpm, V)


TABLE_CODE = '''

def loads(rpm, airspeed_m_s, density_kg_m3=DENSITY):
    """Thrust [N] and shaft torque [N m] at rev/min and axial airspeed [m/s]; CT and CP bilinear, held at the ends."""
    n = rpm / 60.0
    if n <= 0.0:
        return 0.0, 0.0
    J = airspeed_m_s / (n * DIAMETER)
    i, a = _cell(RPM, rpm)
    j, b = _cell(J_AXIS, J)
    ct, cp = ((1 - a) * ((1 - b) * C[i][j] + b * C[i][j + 1]) + a * ((1 - b) * C[i + 1][j] + b * C[i + 1][j + 1])
              for C in (CT, CP))
    scale = density_kg_m3 * n**2 * DIAMETER**4
    return ct * scale, cp * scale * DIAMETER / (2.0 * math.pi)


def _cell(axis, x):
    i = min(max(bisect.bisect_right(axis, x) - 1, 0), len(axis) - 2)
    return i, min(max((x - axis[i]) / (axis[i + 1] - axis[i]), 0.0), 1.0)
'''
"""Python that looks the table up, for files that go to other programs: standard library only."""


def still_hub() -> HubTable:
    """Hub table of a rotor without loads across the shaft."""
    two = np.array([0.0, 1.0])
    return HubTable(two, two, two, np.zeros((6, 2, 2, 2)))


def table_module(job: Job, title: str) -> str:
    """Python text of the tables, axial and of the hub, and their lookup."""
    doc = table_document(job)
    hub = hub_document(job.hub or still_hub())
    values = [
        f"{name} = {doc[key]!r}"
        for name, key in (
            ("DIAMETER", "diameter_m"), ("DENSITY", "density_kg_m3"), ("RPM", "rpm"), ("J_AXIS", "J"), ("CT", "CT"),
            ("CP", "CP"),
        )
    ]  # fmt: skip
    head = "\n".join(header(job, title))
    return (
        f'"""{head}"""\n\nimport bisect\nimport math\n\nSENSE = {job.performance.sense}  # +1 right-handed\n'
        + "\n".join(values)
        + f"\nHUB = {hub!r}\n"
        + TABLE_CODE
        + WRENCH_CODE
    )


def _run(text: str, name: str, *axes: Array) -> Array:
    """What a function of such a text gives at points, (P, n)."""
    space: dict[str, Callable[..., tuple[float, ...]]] = {}
    exec(compile(text, "<export>", "exec"), space)
    return np.array([space[name](*map(float, at)) for at in zip(*axes, strict=True)])


def run_module(text: str, rpm: Array, V: Array) -> tuple[Array, Array]:
    """Loads by the lookup of such a text."""
    pairs = _run(text, "loads", rpm, V)
    return pairs[:, 0], pairs[:, 1]


def run_hub(text: str, rpm: Array, V: Array, side: Array) -> Array:
    """Loads of the hub by the lookup of such a text, (6, P)."""
    return _run(text, "hub", rpm, V, side).T


# What the manifest of an export says of one target: what its files hold, and what they do not.

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
            f"the table covers each speed up to {t.fastest_m_s:.3g} m/s and descent to J "
            f"{t.J[0]:.2g}; beyond, the last coefficient is held, so the drag of a windmill stops growing with airspeed"
        )
    return out


def entry(export: Export, job: Job, files: Files) -> Manifest:
    """Manifest entry of one target: what a reader of its files must know, and a hash of each."""
    found: Manifest = {
        "target": export.id, "title": export.title, "kind": export.kind, "holds": export.holds,
        "features": sorted(export.features), "conventions": export.conventions, "rotation": job.rotation,
        "source": export.source,
    }  # fmt: skip
    found |= export.checked(job, files)
    if export.kind == "loads" and job.rpm is None and job.full_throttle is not None:
        found["full_throttle"] = job.full_throttle
    speeds = [] if job.speeds_note is None or job.rpm is not None else [job.speeds_note]
    found["notes"] = speeds + export.notes(job) + _lost(export, job)
    found["files"] = [
        {"path": name, "bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
        for name, data in ((n, d.encode() if isinstance(d, str) else d) for n, d in files.items())
    ]
    return found


def joined(first: Manifest, second: Manifest) -> Manifest:
    """Both manifests in one; the second is the newer."""
    joined = {**first, **second}
    for key in ("volumes_m3", "case_sha256"):
        if key in first or key in second:
            joined[key] = {**first.get(key, {}), **second.get(key, {})}
    for key in ("files", "targets"):
        if key in first or key in second:
            joined[key] = [*first.get(key, []), *second.get(key, [])]
    return joined
