"""The promise of the readers of paired recordings: SI per rotor, what a file does not say as a warning, faults told."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from bemt.base.errors import InputError
from bemt.base.units import G0
from bemt.recordings.load import import_file

COAXIAL = (
    "PWM Left,PWM Right,Thrust Left [g],Torque Left [Nm],Thrust Right [g],Torque Right [Nm],"
    "Speed Left [rpm],Speed Right [rpm],Time [s]"
)


def coaxial(right_turns: bool) -> str:
    rows = ["1000,1000,19.5,0.004,14.0,-0.008,0,0,10", "1070,1000,0.05,0,0,0,0,0,20"]
    for k in range(8):
        n = 3000 + 400 * k
        right = 0.95 * n if right_turns else 0.0
        left = (1400 + 50 * k, 3e-5 * n**2, -4e-9 * n**2)
        other = (1400 if right_turns else 1000, 2e-5 * right**2, 3.9e-9 * right**2)
        cells = [left[0], other[0], left[1], left[2], other[1], other[2], n, right, 30 + k]
        rows.append(",".join(str(c) for c in cells))
    return "\n".join([COAXIAL, *rows]) + "\n"


def test_one_rotor_that_turned_gets_the_plain_names(tmp_path: Path) -> None:
    path = tmp_path / "15in_single.csv"
    path.write_text(coaxial(False), "utf-8")
    got = import_file(path)
    assert got.provenance["format"] == "coaxial_stand"
    assert got.provenance["constants"]["diameter_m"] == pytest.approx(15 * 0.0254)
    assert got["thrust_N"][2] == pytest.approx(3e-5 * 3000**2 * G0 / 1000.0)
    assert got["torque_Nm"][2] > 0.0 and any("sign" in w for w in got.notes)
    assert np.isnan(got["thrust_N"][0]), "a reading before the tare is no zero"


def test_two_rotors_keep_their_sides(tmp_path: Path) -> None:
    path = tmp_path / "map.csv"
    path.write_text(coaxial(True), "utf-8")
    got = import_file(path)
    assert {"thrust_left_N", "thrust_right_N", "left_rpm", "right_rpm"} <= got.values.keys()
    assert got["speed_ratio"][3] == pytest.approx(0.95)


def test_four_propellers_on_a_scale_are_read_per_propeller(tmp_path: Path) -> None:
    path = tmp_path / "bench.csv"
    lines = []
    for k in range(8):
        n = 1000 * k
        cells = [20000 + 4000 * k, 4.0 - 0.05 * k, 10000 + n, 12000 + n, 10000 + n, 12000 + n, 8 + 3 * k]
        lines.append(",".join(str(c) for c in cells))
    path.write_text("\n".join(["pwm,vbat[V],rpm1,rpm2,rpm3,rpm4,thrust[g]", *lines]) + "\n", "utf-8")
    got = import_file(path)
    assert got.provenance["format"] == "crazyflie_bench"
    assert got["thrust_N"][0] == pytest.approx(8e-3 * G0 / 4)
    assert got["rpm"][0] == pytest.approx(np.sqrt((10000**2 + 12000**2) / 2))
    assert got["throttle"][0] == pytest.approx(20000 / 65535)


def flight(rows: int = 20, version: int = 2) -> bytes:
    names = [f"rpm.m{k}(H)" for k in range(1, 5)] + ["acc.z(f)", "pm.vbatMV(H)"]
    data = (
        struct.pack("<BHH", 0xBC, version, 1)
        + struct.pack("<H", 7)
        + b"fixedFrequency\0"
        + struct.pack("<H", len(names))
    )
    data += b"".join(n.encode() + b"\0" for n in names)
    for k in range(rows):
        data += struct.pack("<HQ" if version == 2 else "<HI", 7, 1000 * k)
        data += struct.pack("<HHHHfH", 20000, 20000, 20000, 20000, 1.0, 3700)
    return data + struct.pack("<I", zlib.crc32(data))


@pytest.mark.parametrize("version", [1, 2])
def test_a_flight_log_is_read_whole_or_refused(tmp_path: Path, version: int) -> None:
    path = tmp_path / "flight.usdlog"
    path.write_bytes(flight(version=version))
    got = import_file(path)
    assert got.provenance["format"] == "crazyflie_log" and len(got) == 20
    assert got["time_s"][-1] == pytest.approx(0.019)
    assert got["acceleration_z_m_s2"][0] == pytest.approx(G0)
    assert got["voltage_V"][0] == pytest.approx(3.7)
    damaged = bytearray(path.read_bytes())
    damaged[-20] ^= 0xFF
    path.write_bytes(bytes(damaged))
    with pytest.raises(InputError, match="checksum"):
        import_file(path)
    path.write_bytes(flight()[:40])
    with pytest.raises(InputError):
        import_file(path)
