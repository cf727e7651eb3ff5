"""The hand of the loop: rows of a run through the wire, and whoever does at the stand what no wire does."""

from __future__ import annotations

import contextlib
import json
import math
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

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
_READ = ("airspeed_m_s", "voltage_V")  # Channels of the wire that go into a recording, beside speed and loads


class Person(Protocol):
    """Who stands at the stand."""

    def set_up(self, kind: str, runs: Sequence[Points], mended: Sequence[str], day: int) -> Rows:
        """Prepare a run (``again``, ``run``, ``reference``); its rows, none where it cannot be."""
        ...

    def place(self, row: Mapping[str, float]) -> Mapping[str, float]:
        """Bring wind and wall to a row; what is known of it beside what the wire reads."""
        ...

    def look(self, name: str) -> bool:
        """Whether a cause is there."""
        ...

    def mend(self, names: Sequence[str]) -> Sequence[str]:
        """Put causes right; those that were there."""
        ...


class Wired:
    """Hand of a stand behind a wire (:class:`bemt.judge.proof.loop.Hand`)."""

    def __init__(self, stand: Stand, person: Person, may: Callable[[str, Rows], bool] | None = None, keep: str = ""):
        self.stand, self.person, self.may, self.keep = stand, person, may, keep
        self.made: list[tuple[str, str]] = []  # Kind and text of every run, in order

    def reference(self) -> str:
        """Make the points of the recording without the causes that can be taken away."""
        return self._measured("reference", self.person.set_up("reference", [], (), 0))

    def run(self, runs: Sequence[Points], mended: Sequence[str], day: int) -> str:
        """Make the last of the runs that were asked for."""
        return self._measured("run", self.person.set_up("run", runs, mended, day))

    def again(self, mended: Sequence[str], day: int) -> str:
        """Make the points of the recording once more."""
        return self._measured("again", self.person.set_up("again", [], mended, day))

    def there(self, name: str) -> bool:
        """Look whether a cause is at work."""
        return self.person.look(name)

    def mend(self, names: Sequence[str]) -> Sequence[str]:
        """Put causes right; those that were there."""
        return self.person.mend(names)

    def _measured(self, kind: str, rows: Rows) -> str:
        """Recording of the rows of a run: means, and the scatter of a sample as their uncertainty."""
        out: list[dict[str, float]] = []
        able = bool(rows) and max(r["rpm"] for r in rows) <= self.stand.limits.rpm
        if not able or (self.may is not None and not self.may(kind, rows)):
            return ""
        for row in rows:
            known = {"time_s": math.nan, **self.stand.meanwhile(partial(self.person.place, row))}
            read = self.stand.at_speed(row["rpm"])
            mine: dict[str, float] = {"run": row.get("run", 0), "rpm": read.mean["rpm"]}
            mine["airspeed_m_s"] = row.get("airspeed_m_s", 0.0)
            mine |= {n: read.mean[n] for n in (*_LOADS, *_READ) if n in read.mean}
            mine |= {n: v for n, v in known.items() if n not in ("k", "rpm", "airspeed_m_s", "run")}
            mine["time_s"] = read.seconds if math.isnan(known["time_s"]) else known["time_s"]
            mine |= {f"u_{n}": read.scatter[n] for n in _LOADS if n in read.mean}
            out.append(mine)
        self.stand.stop()
        if len(out) < 2:
            return ""
        self.made.append((kind, recording_text({n: np.array([r[n] for r in out]) for n in out[0]})))
        if self.keep:
            write_atomic(Path(self.keep) / f"{len(self.made)}_{kind}.csv", self.made[-1][1])
        return self.made[-1][1]


class Simulated:
    """Person at a simulated stand: the other end of its lines."""

    def __init__(self, key: Path, item: str, wire: str, lapse: float) -> None:
        command = [sys.executable, "-m", "bemt.tools.stand.simulated", str(key), item, wire, str(lapse)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        first = self._line()
        self.wire, self.address = wire, str(first["address"])

    def _line(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError("the simulated stand ended")
        said: dict[str, Any] = json.loads(line)
        return said

    def ask(self, do: str, **more: Any) -> Any:
        """Do something at the stand."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"do": do, **more}) + "\n")
        self.process.stdin.flush()
        return self._line()["done"]

    def set_up(self, kind: str, runs: Sequence[Points], mended: Sequence[str], day: int) -> Any:
        """Prepare a run; its rows."""
        return self.ask("set up", kind=kind, runs=[[dict(p) for p in r] for r in runs], mended=list(mended), day=day)

    def place(self, row: Mapping[str, float]) -> Mapping[str, float]:
        """Bring wind and wall to a row."""
        self.ask("place", k=row["k"])
        return row

    def look(self, name: str) -> bool:
        """Whether a cause is there."""
        return bool(self.ask("look", name=name))

    def mend(self, names: Sequence[str]) -> Sequence[str]:
        """Put causes right."""
        return [str(n) for n in self.ask("mend", names=list(names))]

    def close(self) -> None:
        """End the process."""
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.close()
        self.process.wait(5.0)
        self.process.stdout.close()


def wire_of_the_simulated() -> str:
    """Tyto's client where it is installed, else UDP."""
    import importlib.util

    return "flightstand" if importlib.util.find_spec("FlightStand") else "rcbenchmark"


def lapsed(limits: Limits, lapse: float) -> Limits:
    """Limits of a simulated stand whose time runs faster; that much less depends on how busy the machine is."""
    if lapse == 1.0:
        return limits
    return replace(limits, ramp_us_s=limits.ramp_us_s * lapse, tick_s=0.002, patience_s=20.0)


@contextlib.contextmanager
def wired(out: Path, entry: Entry) -> Iterator[Hand]:
    """Hand on the simulated stand of an item of a proof: in another process, behind the wire of a real one."""
    person = Simulated(out, entry.folder, wire_of_the_simulated(), _LAPSE)
    try:
        with Stand(person.wire, person.address, "", lapsed(_LIMITS, _LAPSE), 0.5, 10) as stand:
            yield Wired(stand, person)
    finally:
        person.close()
