"""Text and numbers that several exports share."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt import __version__
from bemt.base.arrays import Array
from bemt.tools.exports.hub import WRENCH_CODE, HubTable, hub_document, hub_loads
from bemt.tools.exports.performance import Performance, table_loads

if TYPE_CHECKING:
    from bemt.tools.exports.base import Job

BLADE_DENSITY = 1400.0
"""Of moulded blades, glass-filled nylon; for the estimate of inertia alone [kg/m3]."""


def plain_name(name: str) -> str:
    """Name that XML, C and Python take as an identifier."""
    word = re.sub(r"\W", "_", name)
    return f"p_{word}" if not word or word[0].isdigit() else word


def header(job: Job, title: str) -> list[str]:
    """Lines for the head of a text file."""
    table = job.performance
    return [
        f"{title}: {job.case.name}, written by bemt {__version__}",
        f"{table.rpm[0]:.6g} to {table.rpm[-1]:.6g} rev/min, J {table.J[0]:.4g} to {table.J[-1]:.4g}, "
        f"density {table.rho:.6g} kg/m3; fit error, band and range: manifest.json",
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
        "name": t.name,
        "diameter_m": t.diameter_m,
        "blades": t.blades,
        "rotation": "right" if t.sense > 0 else "left",
        "density_kg_m3": t.rho,
        "rpm": t.rpm.tolist(),
        "J": t.J.tolist(),
        "CT": t.CT.tolist(),
        "CP": t.CP.tolist(),
        "J_zero_thrust": t.J_zero.tolist(),
    }


def table_of_document(doc: dict[str, Any], rpm: Array, V: Array) -> tuple[Array, Array]:
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
            ("DIAMETER", "diameter_m"),
            ("DENSITY", "density_kg_m3"),
            ("RPM", "rpm"),
            ("J_AXIS", "J"),
            ("CT", "CT"),
            ("CP", "CP"),
        )
    ]
    head = "\n".join(header(job, title))
    return (
        f'"""{head}"""\n\nimport bisect\nimport math\n\nSENSE = {job.performance.sense}  # +1 right-handed\n'
        + "\n".join(values)
        + f"\nHUB = {hub!r}\n"
        + TABLE_CODE
        + WRENCH_CODE
    )


def run_module(text: str, rpm: Array, V: Array) -> tuple[Array, Array]:
    """Loads by the lookup of such a text."""
    space: dict[str, Any] = {}
    exec(compile(text, "<export>", "exec"), space)
    pairs = np.array([space["loads"](float(n), float(v)) for n, v in zip(rpm, V, strict=True)])
    return pairs[:, 0], pairs[:, 1]


def run_hub(text: str, rpm: Array, V: Array, side: Array) -> Array:
    """Loads of the hub by the lookup of such a text, (6, P)."""
    space: dict[str, Any] = {}
    exec(compile(text, "<export>", "exec"), space)
    return np.array([space["hub"](*map(float, at)) for at in zip(rpm, V, side, strict=True)]).T
