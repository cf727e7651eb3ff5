"""Jet of a duct with a sheet that follows its stream: ``python reports/studies/duct_jet.py`` (two minutes).

`bemt.physics.bem.duct_stream` leaves the sheet between jet and stream a cylinder.  Here its shape is iterated as well,
until the stream function is the same all along it, and two things are asked: how far the mass flow through the exit is
from that of the cylinder, and whether the pressures on duct and body, added to the rotor's force, are the momentum of
the jet.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bemt.physics.bem import duct_stream as ds
from geometry.duct import Duct

Array = NDArray[np.float64]

RATIOS = (0.0, 0.2, 0.4, 0.6, 0.8)
STEPS, RELAX, TOL = 120, 0.4, 2e-4


class Settled(NamedTuple):
    """Flow with a sheet in its own place, jet speed 1."""

    volume: float  # Volume flow through the exit
    force: float  # Force of the pressures on duct and body over density, forward


def ducts() -> dict[str, tuple[Duct, float]]:
    """Ducts over their bore's radius, with the radius of the hub."""
    R, hub = 0.15, 0.033
    annulus = R**2 - hub**2
    f1 = Duct(R, 0.13, 0.018, exit_radius=R, exit_hub_radius=hub, rotor_x=0.045, te_thickness=0.0023)
    out = {f"F1, exit ratio {ratio:g}": (replace(f1, exit_radius=math.sqrt(ratio * annulus + hub**2)), hub)
           for ratio in (0.85, 1.0, 1.15)}  # fmt: skip
    out["X-22A, exit ratio 1.27"] = Duct(1.077, 1.2446, 0.128, exit_radius=1.178, rotor_x=0.3556), 0.2134
    out["nozzle 19A"] = Duct(0.1208, 0.12, 0.0219, exit_radius=0.12363, rotor_x=0.06), 0.02
    out["thick lip, short"] = Duct(R, 0.10, 0.030, exit_hub_radius=hub, rotor_x=0.033), hub
    return out


def follow(duct: Duct, hub: float, nu: float) -> Settled:
    """Iterate strength and shape of the sheet in a stream of ``nu``."""
    wall, body = ds._wall(duct), ds._body(duct, hub)
    at = np.concatenate([0.5 * (b[1:] + b[:-1]) for b in (wall, body)])
    n, m, radius = at.shape[0], wall.shape[0] - 1, float(wall[0, 1])
    first = float(np.hypot(*(wall[-1] - wall[-2])))
    steps = int(np.ceil(np.log1p(40.0 * radius * 0.15 / first) / np.log(1.15)))
    x = duct.length + first * np.concatenate([[0.0], np.cumsum(1.15 ** np.arange(steps))])
    r, gamma, head = np.full(x.size, radius), np.full(steps, 1.0 - nu), 0.5 * (1.0 - nu * nu)
    A = np.zeros((n + 1, n + 1))
    A[:n, :n] = np.concatenate([ds._stream(at, b) for b in (wall, body)], axis=1)
    A[:m, n], A[n, [0, m - 1]] = -1.0, 1.0
    solve = np.linalg.inv(A)
    far = x - x[0] > 10.0 * radius
    for _ in range(STEPS):
        sheet = np.stack([x, r], axis=1)
        on = 0.5 * (sheet[1:] + sheet[:-1])
        rhs = np.append(-0.5 * nu * at[:, 1] ** 2 - ds._stream(at, sheet) @ gamma, gamma[0])
        found = solve @ rhs
        parts = ((wall, found[:m]), (body, found[m:n]), (sheet, gamma))
        psi = 0.5 * nu * on[:, 1] ** 2 + sum(ds._stream(on, b) @ g for b, g in parts)
        u = np.einsum("smx,m->sx", np.concatenate([ds._velocity(on, b) for b, _ in parts], axis=1),
                      np.concatenate([g for _, g in parts]))  # fmt: skip
        u[:, 0] += nu
        slow = np.maximum(u[:, 0], 0.15 * (1.0 + nu))
        off = np.where(far[1:], 0.0, (found[n] - psi) / (on[:, 1] * slow))
        moved = on[:, 1] + RELAX * np.clip(off, -0.1 * radius, 0.1 * radius)
        r = np.interp(x, np.append(x[0], on[:, 0]), np.append(radius, moved))
        r[far] = math.sqrt(2.0 * found[n])
        wanted = np.where(far[1:], 1.0 - nu, head / np.maximum(np.hypot(*u.T), 0.15 * (1.0 + nu)))
        gamma = gamma + RELAX * (wanted - gamma)
        if np.max(np.abs(off)) < TOL * radius and np.max(np.abs(wanted - gamma)) < TOL:
            break
    force = _force(duct, wall, body, found[:n], nu)
    return Settled(2.0 * math.pi * float(found[n]), force)


def _force(duct: Duct, wall: Array, body: Array, speed: Array, nu: float) -> float:
    """Pressure on duct and body: a ring is as strong as the flow along it is fast; the disk adds head behind it."""
    nodes = np.concatenate([wall[:-1], body[:-1]]), np.concatenate([wall[1:], body[1:]])
    middle = 0.5 * (nodes[0] + nodes[1])
    lip = int(np.argmin(wall[:, 0]))
    bore = np.arange(middle.shape[0]) < lip
    inside = (bore | (np.arange(middle.shape[0]) >= wall.shape[0] - 1)) & (middle[:, 0] > float(duct.rotor_x or 0.0))
    p = 0.5 * (nu * nu - speed**2) + np.where(inside, 0.5 * (1.0 - nu * nu), 0.0)
    faces = np.pi * (nodes[1][:, 1] ** 2 - nodes[0][:, 1] ** 2)
    return -float(np.sum(p * faces))


def main() -> None:
    """Print a table."""
    print("duct, V / V_j: flow with a cylinder over that with a free sheet - 1; pressures over momentum - 1;")
    print("largest strength of the sheet over V_j - V")
    for name, (duct, hub) in ducts().items():
        stream = ds.Stream.around(duct, hub)
        swept = math.pi * (duct.inner_radius**2 - hub**2)
        for nu in RATIOS:
            free = follow(duct, hub, nu)
            total = free.force + 0.5 * (1.0 - nu * nu) * swept
            momentum = free.volume * (1.0 - nu)
            strongest = stream.strength(nu)[~stream.settled].max() / (1.0 - nu)
            flow, pressure = 100.0 * (stream.through(nu) / free.volume - 1.0), 100.0 * (total / momentum - 1.0)
            print(f"{name:24s} {nu:4.1f} {flow:+6.2f} % {pressure:+6.2f} % {strongest:5.2f}")


if __name__ == "__main__":
    main()
