"""The three verbs of a stand: set the pulse width, read a row, stop. The wire is the guard's (:mod:`.guard`)."""

from __future__ import annotations

import atexit
import contextlib
import json
import math
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from bemt.base.errors import Fault, InputError
from bemt.tools.stand.drivers import connect
from bemt.tools.stand.guard import Limits, Word

T = TypeVar("T")
_POLL_S = 0.02
# The speed is steady when it has moved by less than this share for that share of the longest wait; that near to what
# was asked for is near enough; attempts
_STEADY, _WINDOW, _NEAR, _TRIES = 0.005, 0.15, 0.01, 5


class Stopped(Exception):
    """The guard has stopped the stand; says why."""


@dataclass(frozen=True)
class SettledRow:
    """A settled point: mean of each channel, and the scatter of its samples."""

    mean: Mapping[str, float]
    scatter: Mapping[str, float]  # Standard deviation of one sample [units of the channels]
    samples: int
    seconds: float  # On the clock of this machine, since the stand was opened [s]


class Stand(contextlib.AbstractContextManager["Stand"]):
    """A stand behind its guard, for a ``with`` statement: :func:`connect` on what the first three words say.

    ``settle_s`` is the longest wait [s] until a command has come and the speed is steady; ``samples`` make a row.
    """

    def __init__(
        self, driver: str, address: str, line: str, limits: Limits, settle_s: float = 2.0, samples: int = 20
    ) -> None:  # fmt: skip
        self.wire, self.limits, self.settle_s, self.samples = (driver, address, line), limits, settle_s, samples
        self.began, self.stopped, self.us = time.monotonic(), "", limits.stop_us
        self.known: dict[float, float] = {}  # Speed by pulse width, as it was read
        self._rows: deque[tuple[float, float, Mapping[str, float]]] = deque(maxlen=2000)
        self._refused: list[Mapping[str, Any]] = []
        command = [sys.executable, "-m", "bemt.tools.stand.guard"]
        self.guard = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                                      start_new_session=True, stderr=subprocess.DEVNULL)  # fmt: skip
        assert self.guard.stdin is not None and self.guard.stdout is not None
        self._orders, self._words = self.guard.stdin, self.guard.stdout
        self._say([driver, address, line, limits.document()])
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()
        atexit.register(self.close)
        while not self._rows and not self.stopped:  # the guard tells of the wire, or it ends
            time.sleep(_POLL_S)
        if not self._rows:
            self.close()
            raise InputError(Fault(**f) for f in self._refused) if self._refused else Stopped(self.stopped)

    def __exit__(self, *error: object) -> None:
        self.close()

    def _say(self, said: Any) -> None:
        try:
            self._orders.write(json.dumps(said) + "\n")
            self._orders.flush()
        except (OSError, ValueError):  # the pipe is broken, or closed
            self.stopped = self.stopped or "the guard is gone"

    def _listen(self) -> None:
        for text in self._words:
            if not text.startswith("{"):  # words of a client
                continue
            said = Word.from_document(json.loads(text))
            self.us, self.stopped = said.us, said.stopped or self.stopped
            self._refused += said.refused
            if said.row:
                self._rows.append((said.at, said.us, said.row))
        self.stopped = self.stopped or "the guard is gone"
        if not self._orders.closed and not self._refused:  # killed: nobody else can reach the stand
            with contextlib.suppress(Exception), contextlib.closing(connect(*self.wire)) as wire:
                wire.write(self.limits.stop_us)

    def rest(self, seconds: float) -> None:
        """Wait with a beat; raises as soon as the guard has stopped."""
        until = time.monotonic() + seconds
        while True:
            self._say({})
            if self.stopped:
                raise Stopped(self.stopped)
            if (left := until - time.monotonic()) <= 0.0:
                return
            time.sleep(min(left, _POLL_S))

    def meanwhile(self, do: Callable[[], T]) -> T:
        """Do something else, and keep the beat."""
        with ThreadPoolExecutor(1) as pool:
            doing = pool.submit(do)
            while not doing.done():
                self.rest(_POLL_S)
            return doing.result()

    def pulse(self, pulse_us: float) -> None:
        """Set the pulse width and wait until it has come and the speed is steady. [us]"""
        limits = self.limits
        if not limits.stop_us <= pulse_us <= limits.largest_us:
            expected = f"{limits.stop_us:g} to {limits.largest_us:g} us, the largest that was allowed"
            raise InputError(Fault("", "pulse width", f"{pulse_us:g}", expected))
        self._say({"go": pulse_us})
        until = time.monotonic() + abs(pulse_us - self.us) / limits.ramp_us_s + self.settle_s
        step = min(10.0 * limits.tick_s, 0.1)
        while time.monotonic() < until:
            self.rest(step)
            since = time.monotonic() - _WINDOW * self.settle_s
            seen = [(row.get("rpm", math.nan), us) for at, us, row in list(self._rows) if at > since]
            speeds = [rpm for rpm, us in seen if us == pulse_us]
            if len(seen) == len(speeds) >= 5 and max(speeds) - min(speeds) <= _STEADY * max(speeds):
                return

    def row(self) -> SettledRow:
        """Read a row: the mean of the next samples."""
        since = time.monotonic()
        while len(taken := [row for at, _, row in list(self._rows) if at > since][: self.samples]) < self.samples:
            if time.monotonic() - since > self.settle_s + self.samples * self.limits.silence_s:
                raise Stopped("the stand sends no rows")
            self.rest(min(self.limits.tick_s, _POLL_S))
        names = [n for n in taken[0] if n != "stamp_s"]
        read = np.array([[row.get(n, np.nan) for n in names] for row in taken])
        mean, spread = (dict(zip(names, v.tolist(), strict=True)) for v in (read.mean(0), read.std(0, ddof=1)))
        return SettledRow(mean, spread, len(taken), time.monotonic() - self.began)

    def at_speed(self, rpm: float) -> SettledRow:
        """Find the pulse width of a speed from what was read so far, and read a row there. [rev/min]"""
        low, high = self.limits.stop_us, self.limits.largest_us
        for _ in range(_TRIES):
            speeds, widths = zip(*sorted((n, us) for us, n in {low: 0.0, **self.known}.items()), strict=True)
            if rpm < speeds[-1]:
                us = np.interp(rpm, speeds, widths)
            elif speeds[-1] > 0.0:
                us = low + (widths[-1] - low) * min(rpm / speeds[-1], 1.5)
            else:
                us = low + 0.15 * (high - low)
            us = float(round(min(us, high)))  # steps of common ESCs
            self.pulse(us)
            row = self.row()
            self.known[us] = row.mean["rpm"]
            if abs(row.mean["rpm"] / rpm - 1.0) < _NEAR or us >= high:
                break
        return row

    def stop(self) -> None:
        """Stop the motor; the stand stays open."""
        self._say({"go": self.limits.stop_us})
        while self.us > self.limits.stop_us and not self.stopped:
            self.rest(_POLL_S)

    def close(self) -> None:
        """Stop for good and let go of the stand."""
        atexit.unregister(self.close)
        with contextlib.suppress(OSError):
            self._orders.close()  # the guard stops at the end of its orders
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.guard.wait(5.0)
        self._listener.join(5.0)
        if not self._listener.is_alive():
            self._words.close()
