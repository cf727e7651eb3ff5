"""Write flights of a small quadrotor as Crazyflie logs: six healthy ones, and one with a cut blade on motor 3.

    python docs/flight_log.py FOLDER

The rotors obey T = k n^2, less 4 % for each m/s of climb; the damaged one has 20 % less k, so it turns faster to
balance the body. The battery sits elsewhere in each flight, so that healthy flights differ as real ones do.
"""

from __future__ import annotations

import struct
import sys
import zlib
from pathlib import Path

import numpy as np

G, MASS, K, ARM = 9.80665, 0.035, 2.15e-10, 0.032  # m/s2, kg, N/rpm^2, m
NAMES = ("motor.m1(H)", "motor.m2(H)", "motor.m3(H)", "motor.m4(H)", "rpm.m1(H)", "rpm.m2(H)", "rpm.m3(H)", "rpm.m4(H)",
         "stateEstimate.z(f)", "stateEstimate.vx(f)", "stateEstimate.vy(f)", "stateEstimate.vz(f)",
         "stateEstimate.qw(f)", "stateEstimate.qx(f)", "stateEstimate.qy(f)", "stateEstimate.qz(f)",
         "acc.x(f)", "acc.y(f)", "acc.z(f)", "pm.vbatMV(H)")  # fmt: skip


def flight(
    seed: int, strength: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0), mass: float = MASS, seconds: float = 12.0
) -> bytes:
    """One flight at 250 Hz as the bytes of a log."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 0.004)
    z = 1.0 + 0.5 * np.cos(0.5 * np.pi * t)
    vz = np.gradient(z, t)
    up = G + np.gradient(vz, t)
    offset = rng.normal(0.0, 0.0002, 2)  # of the battery [m]
    moments = np.array([[-1, -1, 1, 1], [1, -1, -1, 1], [1, -1, 1, -1], [1, 1, 1, 1]])
    loads = np.array([offset[0] / ARM, offset[1] / ARM, 0.004 * rng.normal(), 1.0])
    thrust = mass * up[:, None] * np.linalg.solve(moments, loads)
    k = K * np.array(strength) * (1.0 - 0.04 * vz[:, None])
    rpm = np.sqrt(thrust / k) * (1.0 + 0.002 * rng.normal(size=thrust.shape))
    volts = 3.9 - 0.03 * np.minimum(t, 12.0)
    command = 65535.0 * rpm / (7500.0 * volts[:, None])
    noise = 0.02 * rng.normal(size=(t.size, 3))
    head = struct.pack("<BHHH", 0xBC, 2, 1, 1) + b"fixedFrequency\0" + struct.pack("<H", len(NAMES))
    out = [head, *(n.encode() + b"\0" for n in NAMES)]
    form = struct.Struct("<HQ8H11fH")
    for i, s in enumerate(t):
        whole = [int(v) for v in (*command[i], *rpm[i])]
        state = (z[i], 0.0, 0.0, vz[i], 1.0, 0.0, 0.0, 0.0)
        acc = (noise[i, 0], noise[i, 1], up[i] / G + noise[i, 2])
        out.append(form.pack(1, round(1e6 * s), *whole, *state, *acc, int(1000.0 * volts[i])))
    body = b"".join(out)
    return body + struct.pack("<I", zlib.crc32(body))


def main(folder: str) -> None:
    """Write the flights."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    for k in range(6):
        (Path(folder) / f"before_{k + 1}.usdlog").write_bytes(flight(k))
    (Path(folder) / "after.usdlog").write_bytes(flight(9, (1.0, 1.0, 0.8, 1.0)))


if __name__ == "__main__":
    main(sys.argv[1])
