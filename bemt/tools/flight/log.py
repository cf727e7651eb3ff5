"""One flight on one time base, with a column for each rotor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sized
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError

Source = tuple[Array, Array]
T = TypeVar("T", bound=Sized)

_ON, _LOW_M, _TRIM_S = 0.3, 0.15, 0.5  # share of the usual largest command; height; time after the start [m, s]
_LARGEST = 1e9  # value above which a number is damage: no unit here comes near
MOST = 200_000  # samples on the common time base; longer logs are thinned (an hour at 50 Hz is 180,000)
DENSE, SPARSE = 1_000_000, 20  # samples of a fast sensor that are kept whole; of stretches beyond, every 20th


@dataclass(frozen=True)
class SpeedSensor:
    """A speed sensor that cannot have read its rotor's speed, and how it was repaired."""

    motor: int  # From one
    count: str  # Blades seen over blades that pass, such as "1/2"; empty where it is no such fraction
    # Reading over the repaired speed where it reads; share of rows in the air without a reading, and at zero [1]
    ratio: float
    lost: float
    zeros: float
    u: float  # Standard uncertainty of the repaired speed, a share of it [1]


@dataclass(frozen=True, eq=False)
class FlightLog:
    """One flight; N samples, B rotors; a quantity that was not logged is None."""

    # Where it was read, and the format by content
    file: str
    format: str
    t: Array  # (N,) Time from the first sample [s]
    command: Array | None = None  # (N, B) Command of each motor; 0 to 1 unless `command_unit` says otherwise
    rpm: Array | None = None  # (N, B) Speeds [rev/min]
    current: Array | None = None  # (N, B) Currents of the speed controllers [A]
    acceleration: Array | None = None  # (N, 3) Specific force in body axes, z up [m/s2]
    airborne: Array | None = None  # (N,) Whether the autopilot holds the vehicle armed and off the ground: 1 or 0
    rates: Array | None = None  # (N, 3) Angular velocity in body axes, z up [rad/s]
    upright: Array | None = None  # (N,) Cosine of the tilt [1]
    axis: Array | None = None  # (N, 3) Unit vector of the thrust, in axes of the world, z up [1]
    # (N, 3) In axes of the world, z up [m/s, m]
    velocity: Array | None = None
    position: Array | None = None
    force: Array | None = None  # (N, 3) Residual force that the log holds, in its own unit
    # (N,) Battery [V, A]
    voltage: Array | None = None
    battery_current: Array | None = None
    # (times, values) Accelerometer at its own rate, with gaps where it was sampled in bursts: (M,) [s], (M, 3) [m/s2];
    # where there is none, the gyro [rad/s], as `raw_unit` says
    raw: Source | None = None
    raw_unit: str = "m/s2"
    # Unit of the commands; layout that the log states or the format usually has, may be empty
    command_unit: str = "1"
    duty: float = 0.5  # Probability, by what was logged, that commands are shares of the battery's voltage [1]
    layout: str = ""
    # Half the sample interval of each quantity's source: how far a value may lie from its time [s]
    join_s: dict[str, float] = field(default_factory=dict)
    # Controller's demand: thrust (N,) and roll to the right, nose up, yaw to the right (N, 3), shares of full [1]
    thrust: Array | None = None
    torque: Array | None = None
    vibe: Array | None = None  # (N, 3) Vibration that the autopilot states, root mean square of each axis [m/s2]
    stated_rotors: int = 0  # Rotors by the parameters, for a log without motors
    mixed: str = ""  # Messages whose demands make up the commands, where no output of a motor was logged
    date: str = ""  # Day of the flight by the clock of the log, YYYY-MM-DD; may be empty
    parameters: dict[str, float] = field(default_factory=dict)  # Of the autopilot, those of its thrust curve
    ends: str = ""  # Where a damaged log ends; empty for a whole one
    sensors: tuple[SpeedSensor, ...] = ()  # Speed sensors at fault, whose columns of `rpm` are repaired

    @property
    def rotors(self) -> int:
        """Number of rotors."""
        drive = self.command if self.command is not None else self.rpm
        return 0 if drive is None else drive.shape[1]

    @property
    def sound(self) -> list[int]:
        """Rotors (0 is the first) whose speed sensor is not at fault."""
        return [i for i in range(self.rotors) if i + 1 not in {s.motor for s in self.sensors}]

    @property
    def drive(self) -> Array | None:
        """What each rotor's thrust is in proportion to, (N, B): its command, else its squared speed."""
        return self.command if self.command is not None else None if self.rpm is None else self.rpm**2

    @property
    def flying(self) -> NDArray[np.bool_]:
        """Samples in the air, (N,): motors on, off the ground if a height or the autopilot tells, without the start."""
        drive = self.command if self.command is not None else self.rpm
        if drive is None and self.thrust is not None:
            drive = self.thrust[:, None]
        if drive is None:
            return np.zeros(self.t.size, dtype=bool)
        total = np.nan_to_num(drive.sum(axis=1))
        if self.command_unit == "us":
            total = total - 1000.0 * drive.shape[1] if total.min() > 700.0 * drive.shape[1] else total
        high = float(np.percentile(total, 90.0))
        on = (total > _ON * high) & (high > 0.0)
        if self.position is not None and np.ptp(self.position[:, 2]) > 2.0 * _LOW_M:
            z = self.position[:, 2]
            # A log that does not begin near zero began in the air, or its zero is elsewhere: the lowest place counts.
            on &= z - (np.percentile(z, 1.0) if abs(z[0]) > _LOW_M else 0.0) > _LOW_M
        if self.airborne is not None:
            on &= self.airborne > 0.5
        starts = self.t[np.flatnonzero(on)[:1]]
        late = self.t >= starts[0] + _TRIM_S if starts.size else on
        return np.asarray(on & late, dtype=bool)


def thrust_axis(q: Array) -> Array:
    """The body's z axis in axes of the world, (N, 3), from unit quaternions body to world, scalar first, (N, 4).

    >>> thrust_axis(np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0]]))[:, 2]
    array([ 1., -1.])
    """
    w, x, y, z = q.T
    return np.stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x**2 + y**2)], axis=1)


class Stretches(Generic[T]):
    """A fast sensor in memory that does not follow the length of the log.

    Stretches are kept whole up to :data:`DENSE` samples; beyond, of every second whole one every 20th sample stays. So
    the slow motion is there throughout, and the fast one in stretches that spread over the log.
    """

    def __init__(self, thin: Callable[[T], T], each: int = 1) -> None:
        """Begin empty; `thin` takes every 20th sample of a stretch, whose rows hold `each` samples."""
        self._thin, self._each, self.parts, self._whole = thin, each, cast(list[T], []), cast(list[bool], [])

    def add(self, part: T) -> None:
        """Keep a stretch."""
        self.parts.append(part)
        self._whole.append(True)
        while self._each * sum(len(p) for p in self.parts) > DENSE and sum(self._whole) > 2:
            for i in [k for k, whole in enumerate(self._whole) if whole][1::2]:
                self.parts[i], self._whole[i] = self._thin(self.parts[i]), False


def held(source: Source | None) -> Source | None:
    """A state that is logged when it changes: it holds until the next message, so nothing lies between two."""
    if source is None or not source[0].size:
        return None
    t, v = source
    last = np.append(t[1:], t[-1] + 1.0) - 1e-6
    return np.stack([t, last], axis=1).ravel(), np.repeat(v, 2)


def scaled(source: Source | None, by: float | Array) -> Source | None:
    """Values times a factor, or one for each column."""
    return None if source is None else (source[0], source[1] * by)


def column(source: Source | None, which: int | slice) -> Source | None:
    """Some columns of the values."""
    return None if source is None else (source[0], source[1][:, which])


def joined(
    file: str, kind: str, sources: Mapping[str, Source | None], main: str, raw: Source | None = None, **more: Any
) -> FlightLog:
    """Put sources (times, values) with clocks of their own on one time base, linearly; units as in :class:`FlightLog`.

    The times of `main` are kept; of more than 200,000 as many, evenly spread. `raw` keeps its own. InputError when
    fewer than 20 whole samples remain.
    """

    def clean(source: Source | None) -> Source:
        return (np.zeros(0), np.zeros(0)) if source is None else _whole(source[0], source[1])

    t = clean(sources.get(main))[0]
    if t.size < 20:
        raise InputError(Fault(file, main, "fewer than 20 whole samples", "a flight", "Log commands of the motors"))
    if t.size > MOST:
        t = t[np.unique(np.searchsorted(t, np.linspace(t[0], t[-1], MOST)))]
    columns, halves = {}, {}
    for key, source in sources.items():
        at, v = clean(source)  # one at a time: fast sources are most of the memory
        if at.size > 1:
            put = np.stack([np.interp(t, at, c) for c in v.reshape(at.size, -1).T], axis=1)
            columns[key] = put[:, 0] if v.ndim == 1 else put
            halves[key] = 0.0 if key == main else 0.5 * float(np.median(np.diff(at)))
    fast = None
    if raw is not None and raw[0].size > 1:
        at, v = _whole(raw[0], raw[1])
        fast = (at - t[0], v)
    return FlightLog(file, kind, t - t[0], raw=fast, join_s=halves, **columns, **more)  # type: ignore[arg-type]


def _whole(t: Array, v: Array) -> Source:
    """Samples that can be, in order of time. A damaged clock jumps: back, or by hours; there the usable part ends."""
    t, v = np.asarray(t, dtype=float), np.asarray(v, dtype=float)
    good = np.isfinite(t) & (np.abs(v.reshape(t.size, -1)) < _LARGEST).all(axis=1)  # not so of NaN
    t, v = t[good], v[good]
    jump = np.flatnonzero((np.diff(t) < -1.0) | (np.diff(t) > 3600.0))
    if jump.size:
        t, v = t[: jump[0] + 1], v[: jump[0] + 1]
    t, order = np.unique(t, return_index=True)
    return t, v[order]
