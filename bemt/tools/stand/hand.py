"""The hand of the loop: rows of a run through the wire, and whoever does at the stand what no wire does."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import subprocess
import sys
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from bemt.base.tables import write_atomic
from bemt.judge.proof.items import recording_text
from bemt.judge.proof.loop import Hand, Points
from bemt.judge.proof.rows import Entry
from bemt.tools.stand.guard import Limits
from bemt.tools.stand.verbs import Stand

Rows = Sequence[Mapping[str, float]]
# Of a simulated stand that nobody watches
_LAPSE, _LIMITS = 300.0, Limits(2000.0, 500.0, current_A=5e3, vibration_m_s2=50.0)
_LOADS = ("thrust_N", "torque_Nm")
_READ = ("rpm", *_LOADS, "airspeed_m_s", "voltage_V")  # Channels of the wire that go into a recording


class Wired(Hand):
    """Hand of a stand behind a wire, and the person who stands there."""

    stand: Stand
    keep = ""  # Folder for every run

    def __init__(self) -> None:
        self.may: Callable[[str, Rows], bool] = lambda kind, rows: True
        self.made: list[tuple[str, str]] = []  # Kind and text of every run, in order

    @abstractmethod
    def set_up(self, kind: str, runs: Sequence[Points], mended: Sequence[str], day: int) -> Rows:
        """Prepare a run; its rows, none where it cannot be."""

    @abstractmethod
    def place(self, row: Mapping[str, float]) -> Mapping[str, float]:
        """Bring wind and wall to a row; what is known of it beside what the wire reads."""

    def measured(self, kind: str, runs: Sequence[Points] = (), mended: Sequence[str] = (), day: int = 0) -> str:
        """Make a run: means, and the scatter of a sample as their uncertainty."""
        rows, out = self.set_up(kind, runs, mended, day), list[dict[str, float]]()
        if not rows or max(r["rpm"] for r in rows) > self.stand.limits.rpm or not self.may(kind, rows):
            return ""
        for row in rows:
            known = self.stand.meanwhile(partial(self.place, row))
            read = self.stand.at_speed(row["rpm"])
            told = {"run": 0, "time_s": read.seconds, **known}
            told |= {n: read.mean[n] for n in _READ if n in read.mean}
            told |= {f"u_{n}": read.scatter[n] for n in _LOADS if n in read.mean}
            told.pop("k", None)  # the simulated stand's own count
            out.append(told)
        self.stand.stop()
        if len(out) < 2:
            return ""
        text = recording_text({n: [r[n] for r in out] for n in out[0]})
        self.made.append((kind, text))
        if self.keep:
            write_atomic(Path(self.keep) / f"{len(self.made)}_{kind}.csv", text)
        return text


class Simulated(Wired):
    """The other end of the lines of a simulated stand, in a process of its own."""

    def __init__(self, key: Path, item: str, wire: str, lapse: float) -> None:
        super().__init__()
        command = [sys.executable, "-m", "bemt.tools.stand.simulated", str(key), item, wire, str(lapse)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.wire, self.address = wire, self._told()

    def _told(self) -> Any:
        assert self.process.stdout is not None
        if line := self.process.stdout.readline():
            return json.loads(line)
        raise RuntimeError("the simulated stand ended")

    def ask(self, do: str, **more: Any) -> Any:
        """Do something at the stand."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"do": do, **more}) + "\n")
        self.process.stdin.flush()
        return self._told()

    def set_up(self, kind: str, runs: Sequence[Points], mended: Sequence[str], day: int) -> Any:
        """Prepare a run; its rows."""
        return self.ask("set up", kind=kind, runs=runs, mended=mended, day=day)

    def place(self, row: Mapping[str, float]) -> Mapping[str, float]:
        """Bring wind and wall to a row."""
        self.ask("place", k=row["k"])
        return row

    def there(self, name: str) -> bool:
        """Look whether a cause is at work."""
        return bool(self.ask("at work", names=[name]))

    def mend(self, names: Sequence[str]) -> Any:
        """Put causes right; those that were there."""
        return self.ask("at work", names=names)

    def close(self) -> None:
        """End the process."""
        self.process.communicate(timeout=5.0)


def wire_of_the_simulated() -> str:
    """Tyto's client where it is installed, else UDP."""
    return "flightstand" if importlib.util.find_spec("FlightStand") else "rcbenchmark"


def lapsed(limits: Limits, lapse: float) -> Limits:
    """Limits of a simulated stand whose time runs faster; that much less depends on how busy the machine is."""
    if lapse == 1.0:
        return limits
    return replace(limits, ramp_us_s=limits.ramp_us_s * lapse, tick_s=0.002, patience_s=20.0)


@contextlib.contextmanager
def wired(out: Path, entry: Entry) -> Iterator[Hand]:
    """Hand on the simulated stand of an item of a proof: in another process, behind the wire of a real one."""
    hand = Simulated(out, entry.folder, wire_of_the_simulated(), _LAPSE)
    with contextlib.closing(hand), Stand(hand.wire, hand.address, "", lapsed(_LIMITS, _LAPSE), 0.5, 10) as hand.stand:
        yield hand
