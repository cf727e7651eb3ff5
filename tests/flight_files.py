"""Flights of any layout as ArduPilot and PX4 write them: the bytes of a DataFlash log and of a ULog.

The body hovers: thrust and moments are balanced by A^+ loads, each rotor obeys T = k n^2, a damaged one has less k.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import InputError
from bemt.tools.flight.answer import answer_on
from bemt.tools.flight.layout import LAYOUTS, effect_matrix, layout_of
from bemt.tools.flight.read import read_log
from bemt.tools.flight.text import text

Array = NDArray[np.float64]
G = 9.80665


@dataclass(frozen=True, eq=False)
class Hover:
    """A hovering vehicle: constants, and what was done to it."""

    layout: str = "quad-x"
    seconds: float = 20.0
    seed: int = 0
    mass: float = 1.5
    full_rpm: float = 9000.0
    loss: tuple[tuple[int, float], ...] = ()  # motor (0 is the first), share of k that is lost
    loss_from_s: float = 0.0
    unbalanced: tuple[int, float] | None = None  # motor, amplitude [m/s2]
    battery: float = 1.0  # command at equal thrust

    @property
    def rotors(self) -> int:
        """Number of rotors."""
        return len(LAYOUTS[self.layout].split())

    def drives(self, t: Array) -> tuple[Array, Array]:
        """Commands (thrust asked over thrust at full drive) and speeds [rev/min], (N, B)."""
        rng = np.random.default_rng(self.seed)
        placed = layout_of(self.layout, self.rotors)
        assert placed is not None
        A = effect_matrix(placed)
        k = self.mass * G / (0.5 * self.rotors * self.full_rpm**2)  # hover at half the full thrust
        loads = self.mass * G * np.array([*(0.004 * rng.normal(size=3)), 1.0])
        thrust = np.broadcast_to(np.linalg.pinv(A) @ loads, (t.size, self.rotors))
        strength = np.ones((t.size, self.rotors))
        for motor, lost in self.loss:
            strength[t >= self.loss_from_s, motor] -= lost
        # The controller moves along the mixer until the loads balance: A (strength * command) = A thrust.
        command = np.empty_like(thrust)
        for row in {tuple(s) for s in strength}:
            here = np.all(strength == row, axis=1)
            back = np.linalg.pinv(A)
            command[here] = (back @ np.linalg.solve(A * np.array(row) @ back, A @ thrust[0])).T
        command = self.battery * command / (k * self.full_rpm**2)
        slow = np.sin(2.0 * np.pi * t[:, None] * rng.uniform(0.2, 1.0, 4) + rng.uniform(0.0, 6.0, 4))
        command = command * (1.0 + 0.01 * slow @ A / 2.0 + 0.004 * rng.normal(size=command.shape))
        return command, self.full_rpm * np.sqrt(command / self.battery)

    def demands(self, t: Array, gains: tuple[float, float, float]) -> Array:
        """Roll, pitch, yaw and thrust that a mixer of these gains turns into the commands of four rotors, (N, 4)."""
        placed = layout_of(self.layout, self.rotors)
        assert placed is not None
        rows = effect_matrix(placed)
        rows = rows / np.abs(rows).max(axis=1, keepdims=True) * np.array([*gains, 1.0])[:, None]
        return np.asarray(self.drives(t)[0] @ np.linalg.inv(rows), dtype=float)

    def acceleration(self, t: Array) -> Array:
        """Specific force, z up, (N, 3): noise, and the rotor that shakes."""
        rng = np.random.default_rng(self.seed + 1000)
        out = 0.3 * rng.normal(size=(t.size, 3)) + [0.0, 0.0, G]
        if self.unbalanced is not None:
            motor, size = self.unbalanced
            speed = self.drives(t)[1][:, motor] / 60.0
            turn = 2.0 * np.pi * np.cumsum(speed * np.gradient(t))
            out[:, 0] += size * np.cos(turn)
            out[:, 1] += size * np.sin(turn)
        return out


def dataflash(
    flight: Hover, imu_hz: float = 50.0, bursts: bool = False, frame: tuple[int, int] = (1, 1), motors: bool = True
) -> bytes:
    """A DataFlash log: FMT, PARM, RCOU, ESC, BAT, ATT, XKF1, IMU, and ISBH with ISBD.

    Without motors RATE, VIBE and GPS stand in the place of RCOU and ESC.
    """
    letters = {"Q": "Q", "H": "H", "B": "B", "f": "f", "c": "h", "N": "16s", "a": "64s", "h": "h", "I": "I"}
    kinds: dict[str, tuple[int, struct.Struct]] = {}
    out = bytearray()

    def fmt(number: int, name: str, form: str, labels: str) -> None:
        made = struct.Struct("<" + "".join(letters.get(c, c) for c in form))
        kinds[name] = (number, made)
        out.extend(struct.pack("<3sBB4s16s64s", b"\xa3\x95\x80", number, made.size + 3, name.encode(), form.encode(),
                               labels.encode()))  # fmt: skip

    def put(name: str, *values: object) -> None:
        number, made = kinds[name]
        out.extend(b"\xa3\x95" + bytes([number]) + made.pack(*values))

    kinds["FMT"] = (128, struct.Struct("<BB4s16s64s"))
    put("FMT", 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    fmt(129, "PARM", "QNf", "TimeUS,Name,Value")
    channels = ",".join(f"C{n}" for n in range(1, 15))
    fmt(130, "RCOU", "Q" + "H" * 14, f"TimeUS,{channels}")
    fmt(131, "ESC", "QBfff", "TimeUS,Instance,RPM,Volt,Curr")
    fmt(132, "BAT", "QBff", "TimeUS,Instance,Volt,Curr")
    fmt(133, "ATT", "Qccccccf", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP")
    fmt(134, "XKF1", "QBffffff", "TimeUS,C,VN,VE,VD,PN,PE,PD")
    fmt(135, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")
    fmt(136, "ISBH", "QHBBHHQf", "TimeUS,N,type,instance,mul,smp_cnt,SampleUS,smp_rate")
    fmt(137, "ISBD", "QHHaaa", "TimeUS,N,seqno,x,y,z")
    fmt(138, "RATE", "Qffffffffffff", "TimeUS,RDes,R,ROut,PDes,P,POut,YDes,Y,YOut,ADes,A,AOut")
    fmt(139, "VIBE", "QBfffI", "TimeUS,IMU,VibeX,VibeY,VibeZ,Clip")
    fmt(140, "GPS", "QBIH", "TimeUS,I,GMS,GWk")
    B = flight.rotors
    params = {"FRAME_CLASS": frame[0], "FRAME_TYPE": frame[1], "MOT_PWM_MIN": 1000, "MOT_PWM_MAX": 2000}
    for name, value in (params | {f"SERVO{i + 1}_FUNCTION": 33 + i for i in range(B)}).items():
        put("PARM", 1000, name.encode(), float(value))
    t = np.arange(0.0, flight.seconds, 0.02)
    command, rpm = flight.drives(t)
    height = np.clip(t - 1.0, 0.0, 3.0)
    asked = None if motors else flight.demands(t, (0.5, 0.5, 0.5))
    if asked is not None:
        put("GPS", 60_000_000, 0, 3 * 86_400_000, 2311)
    for k, s in enumerate(t):
        us = round(1e6 * s) + 60_000_000
        if asked is not None:
            r, p, y, a = asked[k] * (height[k] > 0.0)
            put("RATE", us, 0.0, 0.0, r, 0.0, 0.0, p, 0.0, 0.0, y, 0.0, 0.0, a)
            put("VIBE", us, 0, 3.0, 4.0, 5.0, 0)
            put("XKF1", us, 0, 0.0, 0.0, 0.0, 0.0, 0.0, -height[k])
            put("ATT", us, 0, 0, 0, 0, 0, 0, 0.0)
            continue
        pulses = [round(1000.0 + 1000.0 * c) if height[k] > 0.0 else 1000 for c in command[k]] + [0] * (14 - B)
        put("RCOU", us, *pulses)
        put("XKF1", us, 0, 0.0, 0.0, 0.0, 0.0, 0.0, -height[k])
        put("ATT", us, 0, 0, 0, 0, 0, 0, 0.0)
        if k % 5 == 0:
            for i in range(B):
                put("ESC", us + 100 * i, i, rpm[k, i], 16.0, 5.0 + i)
            put("BAT", us, 0, 16.0 - 0.01 * s, 20.0)
    at = np.arange(0.0, flight.seconds, 1.0 / imu_hz)
    for s, a in zip(at, flight.acceleration(at), strict=True):
        for i in (0, 1):
            put("IMU", round(1e6 * s) + 60_000_000, i, 0.0, 0.0, 0.0, a[0], -a[1], -a[2])
    if bursts:
        at = np.arange(0.0, flight.seconds, 1e-3)
        raw = flight.acceleration(at) * [1.0, -1.0, -1.0] * 200.0
        for n, begin in enumerate(range(5000, at.size - 1024, 2000)):
            put("ISBH", round(1e6 * at[begin]) + 60_000_000, n, 0, 0, 200, 1024, round(1e6 * at[begin]) + 60_000_000,
                1000.0)  # fmt: skip
            for q in range(32):
                block = raw[begin + 32 * q : begin + 32 * q + 32].astype("<i2")
                put("ISBD", round(1e6 * at[begin]) + 60_000_000, n, q, *(block[:, i].tobytes() for i in range(3)))
    return bytes(out)


def ulog(
    flight: Hover, imu_hz: float = 200.0, fifo: bool = False, airframe: int = 0, motors: bool = True,
    landed: bool | None = None,
) -> bytes:  # fmt: skip
    """A ULog: parameters of the allocation, actuator_motors, esc_status, sensors, attitude, position, battery.

    With the number of an airframe it is one of before the allocation: pulse widths, and no speeds; below zero, of the
    allocation, with motor 1 at the last output. Without motors actuator_controls_0 stands in their place.
    What the land detector said once, at the start, may be added.
    """
    out = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0))

    def message(kind: str, body: bytes) -> None:
        out.extend(struct.pack("<Hc", len(body), kind.encode()) + body)

    message("B", bytes(40))
    B = flight.rotors
    shapes = {
        "actuator_motors": "uint64_t timestamp;float[12] control;",
        "actuator_outputs": "uint64_t timestamp;uint32_t noutputs;float[16] output;",
        "actuator_controls_0": "uint64_t timestamp;float[8] control;",
        "esc_status": "uint64_t timestamp;esc_report[8] esc;",
        "esc_report": "int32_t esc_rpm;float esc_current;uint8_t actuator_function;",
        "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;",
        "vehicle_attitude": "uint64_t timestamp;float[4] q;",
        "vehicle_local_position": "uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;",
        "battery_status": "uint64_t timestamp;float voltage_v;float current_a;",
        "vehicle_land_detected": "uint64_t timestamp;bool landed;",
        "sensor_accel_fifo": "uint64_t timestamp;uint64_t timestamp_sample;float dt;float scale;uint8_t samples;"
        "int16_t[32] x;int16_t[32] y;int16_t[32] z;",
    }
    for name, fields in shapes.items():
        message("F", f"{name}:{fields}".encode())
    placed = layout_of(flight.layout, B)
    assert placed is not None
    params: list[tuple[str, float]] = [("CA_ROTOR_COUNT", B)]
    for i, (angle, turn, _) in enumerate(placed):
        params += [(f"CA_ROTOR{i}_PX", 0.2 * np.cos(angle)), (f"CA_ROTOR{i}_PY", -0.2 * np.sin(angle)),
                   (f"CA_ROTOR{i}_KM", 0.05 * turn)]  # fmt: skip
    if airframe > 0:
        params = [("SYS_AUTOSTART", airframe)]
    elif airframe:
        params += [(f"PWM_MAIN_FUNC{B - i}", 101 + i) for i in range(B)]
    params += [("PWM_MIN", 1075), ("PWM_MAX", 1950)]
    for name, value in params:
        key = f"float {name}".encode()
        message("P", bytes([len(key)]) + key + struct.pack("<f", value))
    names = [n for n in shapes if n != "esc_report"]
    for k, name in enumerate(names):
        message("A", struct.pack("<BH", 0, k) + name.encode())

    def put(name: str, form: str, *values: object) -> None:
        message("D", struct.pack("<H", names.index(name)) + struct.pack("<" + form, *values))

    if landed is not None:
        put("vehicle_land_detected", "Q?", 1_000_000, landed)
    t = np.arange(0.0, flight.seconds, 0.02)
    command, rpm = flight.drives(t)
    height = np.clip(t - 1.0, 0.0, 3.0)
    gap, asked = [float("nan")] * (12 - B), None if motors else flight.demands(t, (0.5**0.5, 0.5**0.5, 1.0))
    for k, s in enumerate(t):
        us = round(1e6 * s) + 1_000_000
        there = command[k] if height[k] > 0.0 else 0.0 * command[k]
        if asked is not None:
            put("actuator_controls_0", "Q8f", us, *(asked[k] * (height[k] > 0.0)), 0.0, 0.0, 0.0, 0.0)
        elif airframe:
            pulses = 1075.0 + 875.0 * there[:: np.sign(airframe)]
            put("actuator_outputs", "QI16f", us, 16, *pulses, *[900.0] * (16 - B))
        else:
            put("actuator_motors", "Q12f", us, *there, *gap)
        put("vehicle_attitude", "Q4f", us, 1.0, 0.0, 0.0, 0.0)
        put("vehicle_local_position", "Q6f", us, 0.0, 0.0, -height[k], 0.0, 0.0, 0.0)
        if k % 5 == 0 and not airframe and motors:
            order = list(reversed(range(B)))  # the controllers are wired the other way round
            escs = [v for i in order for v in (int(rpm[k, i]), 5.0, 101 + i)] + [0, 0.0, 0] * (8 - B)
            put("esc_status", "Q" + "ifB" * 8, us, *escs)
            put("battery_status", "Q2f", us, 16.0 - 0.01 * s, 20.0)
    at = np.arange(0.0, flight.seconds, 1.0 / imu_hz)
    for s, a in zip(at, flight.acceleration(at), strict=True):
        put("sensor_combined", "Q6f", round(1e6 * s) + 1_000_000, 0.0, 0.0, 0.0, a[0], -a[1], -a[2])
    if fifo:
        at = np.arange(0.0, flight.seconds, 5e-4)
        raw = np.clip(flight.acceleration(at) * [1.0, -1.0, -1.0] / 0.005, -32000, 32000).astype(int)
        for begin in range(0, at.size - 32, 32):
            block, us = raw[begin : begin + 32], round(1e6 * at[begin + 31]) + 1_000_000
            put("sensor_accel_fifo", "QQffB96h", us + 50, us, 500.0, 0.005, 32, *block.T.reshape(-1).tolist())
    return bytes(out)


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """A copy cut short, with bytes turned, a piece lost, or a piece overwritten."""
    out = bytearray(data)
    at = int(rng.integers(0, len(out)))
    match int(rng.integers(0, 4)):
        case 0:
            del out[at:]
        case 1:
            for k in rng.integers(0, len(out), 20):
                out[k] ^= int(rng.integers(1, 256))
        case 2:
            del out[at : at + int(rng.integers(1, 5000))]
        case _:
            out[at : at + 64] = rng.integers(0, 256, 64, dtype=np.uint8).tobytes()
    return bytes(out)


def broken_copies(samples: list[bytes], count: int, file: Path) -> int:
    """Read damaged copies and answer; how many were refused."""
    rng, refused = np.random.default_rng(3), 0
    for k in range(count):
        file.write_bytes(damaged(samples[k % len(samples)], rng))
        try:
            with np.errstate(all="ignore"):
                text(answer_on(read_log(file)))
        except InputError:
            refused += 1
    return refused
