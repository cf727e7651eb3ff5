"""The guard: a process of its own that owns the wire. Whatever happens to the one that gives orders, the motor stops.

``python -m bemt.tools.stand.guard`` reads a line of JSON, ``[driver, address, line, limits]``, then an :class:`Order` a
line; it answers with a :class:`Word` a line. An order is approached at the ramp rate, the stop value at once. It stops
for good at the end of its input (the other process is dead), without an order, without a new row, at a reading that is
no number, above a limit, and where the wire is lost; then it goes on writing the stop value.
"""

from __future__ import annotations

import json
import math
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Mapping
from dataclasses import field
from typing import Any

from bemt.base.document import Documented
from bemt.base.errors import InputError
from bemt.tools.stand import drivers
from bemt.tools.stand.drivers import Wire, connect

_QUIET_S = 0.1  # A command is written again after that
_LINGER_S = 0.3  # The stop value is written for so long before the end
_WATCHED = ("thrust_N", "torque_Nm", "rpm", "current_A", "vibration_m_s2")


class Limits(Documented):
    """What the stand may do."""

    largest_us: float  # Largest pulse width, and that of standstill [us]
    ramp_us_s: float  # Fastest rise of the command [us/s]
    current_A: float = math.inf
    vibration_m_s2: float = math.inf
    rpm: float = math.inf
    stop_us: float = 1000.0
    tick_s: float = 0.01
    patience_s: float = 0.2  # Longest wait for the stand; no beat for two of it stops [s]

    @property
    def silence_s(self) -> float:
        """Longest time without a new row. [s]"""
        return 1.5 * self.patience_s

    def broken(self, row: dict[str, float]) -> str:
        """What a row says against going on; "" if nothing.

        >>> Limits(2000, 500, current_A=40).broken({"rpm": 5000.0, "current_A": 41.5})
        'current 41.5 A above 40'
        >>> Limits(2000, 500).broken({"rpm": float("nan")})
        'rpm is no number'
        """
        for name in _WATCHED:
            value, limit = row.get(name, 0.0), getattr(self, name, math.inf)
            what, _, unit = name.partition("_")
            if not math.isfinite(value):
                return f"{name} is no number"
            if abs(value) > limit:
                return f"{what} {value:.4g} {unit.replace('m_s2', 'm/s2')}".strip() + f" above {limit:.4g}"
        return ""


class Order(Documented):
    """A line to the guard: a pulse width to go to [us], or, without one, a sign of life."""

    go: float | None = None


class Word(Documented):
    """A line from the guard: when [s], its pulse width [us], a new row, why it stopped, what is wrong with the wire."""

    at: float  # A line may wait in the pipe of a busy machine
    us: float
    row: Mapping[str, float] = field(default_factory=dict)
    stopped: str = ""
    refused: tuple[Mapping[str, Any], ...] = ()


class Guard:
    """State of the guard: the command, where it goes, and why it was stopped."""

    def __init__(self, wire: Wire, limits: Limits) -> None:
        self.wire, self.limits = wire, limits
        self.us = self.target = limits.stop_us
        self.stopped = ""
        self.written = self.stamp = -math.inf
        self.beat = self.fresh = self.then = time.monotonic()
        self.row: dict[str, float] = {}

    def order(self, said: Order) -> None:
        """Take an order."""
        self.beat = time.monotonic()
        if said.go is not None and not self.stopped:
            self.target = min(max(said.go, self.limits.stop_us), self.limits.largest_us)

    def stop(self, why: str) -> None:
        """Stop for good, at once."""
        self.stopped = self.stopped or why
        self.us = self.target = self.limits.stop_us
        self.write()

    def write(self) -> None:
        """Write the command."""
        try:
            self.wire.write(self.us)
        except OSError as error:
            self.stopped = self.stopped or f"wire lost: {error}"
            self.us = self.target = self.limits.stop_us
        self.written = time.monotonic()

    def tick(self) -> None:
        """Read, check, go a step of the ramp."""
        try:
            self.row = self.wire.read()
        except OSError as error:
            self.stop(f"wire lost: {error}")
        now = time.monotonic()
        if now - self.then > self.limits.patience_s:  # this process was late: the beats are still in the pipe
            self.beat = max(self.beat, now - self.limits.patience_s)
        if self.row.get("stamp_s", 0.0) != self.stamp:
            self.stamp, self.fresh = self.row.get("stamp_s", 0.0), now
        turning = max(self.us, self.target) > self.limits.stop_us
        if why := self.limits.broken(self.row):
            self.stop(why)
        elif turning and now - self.fresh > self.limits.silence_s:
            self.stop(f"no row from the stand for {now - self.fresh:.2f} s")
        elif turning and now - self.beat > 2.0 * self.limits.patience_s:
            self.stop(f"no heartbeat for {now - self.beat:.2f} s")
        before, step = self.us, self.limits.ramp_us_s * (now - self.then)
        self.us, self.then = min(self.target, self.us + step), now  # down goes at once
        if self.us != before or now - self.written > _QUIET_S:
            self.write()

    def told(self) -> Word:
        """What to tell after a tick. A row is told once: again, a rotor that spins up would look steady."""
        return Word(self.then, self.us, self.row if self.fresh == self.then else {}, self.stopped)


def _hear(orders: queue.SimpleQueue[Order | str]) -> None:
    """Put orders into a queue; the last is a word, why there are no more."""
    try:
        for line in sys.stdin:
            orders.put(Order.from_document(json.loads(line)))
        orders.put("the orders ended")
    except (ValueError, TypeError):
        orders.put("an order that cannot be read")


def _tell(said: Word) -> None:
    """Write a line without ever waiting for a reader."""
    try:
        os.write(1, (json.dumps(said.document()) + "\n").encode())
    except (BlockingIOError, BrokenPipeError):
        pass


def main() -> None:
    """Guard a wire until the orders end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the one that gives orders
    *where, told = json.loads(sys.stdin.readline())
    limits = Limits.from_document(told)
    os.set_blocking(1, False)
    drivers.PATIENCE_S = limits.patience_s
    try:
        guard = Guard(connect(*where), limits)
    except InputError as error:
        _tell(Word(time.monotonic(), limits.stop_us, refused=tuple(vars(f) for f in error.faults)))
        return
    orders: queue.SimpleQueue[Order | str] = queue.SimpleQueue()
    signal.signal(signal.SIGTERM, lambda *_: orders.put("terminated"))
    threading.Thread(target=_hear, args=(orders,), daemon=True).start()
    end = math.inf
    try:
        while time.monotonic() < end:
            while not orders.empty():
                said = orders.get()
                if isinstance(said, Order):
                    guard.order(said)
                else:
                    guard.stop(said)
                    end = min(end, time.monotonic() + _LINGER_S)
            guard.tick()
            _tell(guard.told())
            time.sleep(limits.tick_s)
    finally:
        guard.stop("the guard failed")
        guard.wire.close()


if __name__ == "__main__":
    main()
