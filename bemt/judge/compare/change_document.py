"""The document ``bemt.comparison/1`` of two recordings without a case, and the step that would settle it."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bemt import __version__
from bemt.base.document import Documented
from bemt.base.tables import or_null
from bemt.judge.compare.drive_laws import FAMILY, Judgement, law
from bemt.judge.compare.matched import LOADS
from bemt.judge.compare.recordings import AS_RECORDED, IN_WIND, RunChange
from bemt.judge.compare.smooth_change import Ratio
from bemt.judge.explanation import Size
from bemt.physics.effects import catalogue

PLACE = {"temperature": "TEMPERATURE", "pressure": "PRESSURE"}
"""What stands in a command for a reading that the user has to fill in."""


@dataclass(frozen=True)
class Invocation:
    """Files and options of a comparison, as a command line has them."""

    a: str = "A"  # First recording
    b: str = "B"  # Second recording
    # Conditions on their rows
    rows_a: tuple[str, ...] = ()
    rows_b: tuple[str, ...] = ()
    air_a: str | None = None  # Air of A
    air_b: str | None = None  # Air of B
    label: str | None = None  # Label that gives the diameter
    case: str | None = None  # Case of the rotor

    @property
    def chosen(self) -> bool:
        """Whether rows or air were given, which no other command takes."""
        return bool(self.rows_a or self.rows_b or self.air_a or self.air_b)

    def command(self, **other: Any) -> str:
        """Command that asks this, some of it replaced.

        >>> Invocation("a.csv", "b.csv", rows_b=("rotor=right",), label="10x5").command(case="CASE")
        'bemt compare a.csv b.csv --rows-b rotor=right --label 10x5 --case CASE'
        """
        given = replace(self, **other)
        words = [given.a, given.b]
        for option, rows in (("--rows-a", given.rows_a), ("--rows-b", given.rows_b)):
            words += [word for row in rows for word in (option, row)]
        options = {"--air-a": given.air_a, "--air-b": given.air_b, "--label": given.label, "--case": given.case}
        words += [word for option, text in options.items() if text is not None for word in (option, text)]
        return " ".join(["bemt compare", *(shlex.quote(word) for word in words)])

    def with_rows(self, letter: str, column: str) -> str:
        """Command that also chooses a range of one column of A or B; LOW and HIGH are the user's to fill in."""
        name = f"rows_{letter}"
        return self.command(**{name: (*getattr(self, name), f"{column}=LOW:HIGH")})

    def with_days(self) -> str:
        """Command with the air of both days; what was not given is the user's to fill in.

        >>> Invocation("a.csv", "b.csv", air_a="45kt", air_b="1.2kg/m3").with_days()
        'bemt compare a.csv b.csv --air-a TEMPERATURE,PRESSURE,45kt --air-b 1.2kg/m3'
        """
        return self.command(air_a=_with_places(self.air_a), air_b=_with_places(self.air_b))


def _with_places(air: str | None) -> str:
    """Air with a place for the temperature and the pressure that are not in it."""
    parts = [part.strip() for part in (air or "").split(",") if part.strip()]
    if any(part.endswith("kg/m3") for part in parts):
        return ",".join(parts)
    warm = [part for part in parts if part.endswith(("C", "K"))] or [PLACE["temperature"]]
    pressure = [part for part in parts if part.endswith("Pa")] or [PLACE["pressure"]]
    return ",".join([*warm, *pressure, *(part for part in parts if part not in (*warm, *pressure))])


AIR_OF_BOTH = "--air-a TEMPERATURE,PRESSURE --air-b TEMPERATURE,PRESSURE"
DAYS = (
    "note temperature and pressure of both days, with units as in 20C,1013hPa; density is the first thing that differs "
    "between days"
)
"""What tells two runs apart whose loads differ by a share."""
SCHEMA = "bemt.comparison/1"
_TORQUES = {"torque_Nm", "power_W", "CP", "CQ"}
# Density is asked for unless it is this many times less likely than the likeliest cause.
_FIRST = 5.0
# Change of a load that days of one site can make, and from which on it is worth a thermometer, in ln.
_DAY, _SEEN = 0.12, 0.03
# Start of a verdict that rests on what both recordings state.
_TOLD = (*AS_RECORDED, "voltage as recorded")
# Scatter of readings at one speed, share, that no stand has: something else changes from reading to reading.
_RESTLESS = 0.10


def next_step(change: RunChange, asked: Invocation) -> dict[str, str]:
    """Run or reading that would settle the answer, and the command to give then, with all that was asked."""
    said = change.leading
    with_case = asked.command(case=asked.case or "CASE")
    checks = {k: check for k in said.effects if (check := _check(k))}
    loads = [r for r in change.ratios.values() if r.kind in LOADS]
    apart = max((abs(math.log(r.ratio)) for r in loads), default=0.0)
    days = math.isnan(change.density_ratio) and apart < _DAY
    if said.verdict == "none" and days and apart > _SEEN:
        return {"text": DAYS, "command": asked.with_days()}
    if said.verdict == "none":
        text = "to see smaller changes, remove the propeller, mount it again and repeat each run once"
        return {"text": text, "command": ""}
    if said.why.startswith(_TOLD):
        return {"text": "", "command": ""}
    if said.verdict in ("named", "sensor"):
        text = next(iter(checks.values()), "read the label of the channel")
        return {"text": f"to be sure, {text}", "command": with_case}
    if said.why.endswith(IN_WIND):
        letter = "a" if math.isfinite(change.a.zero_thrust_rpm) else "b"
        air = getattr(asked, f"air_{letter}")
        there = {f"air_{letter}": ",".join([*filter(None, [air]), "AIRSPEED"])}
        text = f"state the airspeed of {letter.upper()}, with its unit as in 18m/s"
        return {"text": text, "command": asked.command(**there)}
    if loads and all(r.extrapolated for r in loads):
        where = "where A was measured"
        c = next(iter(change.loads_by_name.values()))
        if "rpm" in change.a.points:
            low, high = (math.exp(f(c.x[~c.second, 0])) for f in (np.min, np.max))
            where = f"at the speeds of A, {low:.0f} to {high:.0f} rev/min"
        return {"text": f"run B again {where}, and at its airspeeds", "command": asked.command(b="B_AGAIN.csv")}
    if said.verdict in ("insufficient", "unknown") and (letter := _unrepeatable(change)):
        run = change.a if letter == "a" else change.b
        column = run.conditions[0] if run.conditions else "COLUMN"
        others = f" (the file has {', '.join(run.conditions[:4])})" if run.conditions else ""
        text = f"choose the rows of {letter.upper()} in which nothing else changes{others}"
        return {"text": text, "command": asked.with_rows(letter, column)}
    likely = {k: p for k, p in said.probability.items() if k not in ("none", "unknown")}
    density = likely.get("air_density", 0.0) * _FIRST >= max(likely.values(), default=1.0)
    if density and loads and days:
        return {"text": DAYS, "command": asked.with_days()}
    if not _TORQUES & change.ratios.keys() and change.loads is said:
        text = "record torque in both runs: thrust alone cannot tell gain, air and blade apart"
        return {"text": text, "command": asked.command(a="A_WITH_TORQUE.csv", b="B_WITH_TORQUE.csv")}
    if checks:
        firsts = {FAMILY.get(k, k): check for k, check in reversed(checks.items())}
        text = "; or ".join(reversed(firsts.values()))
        return {"text": text, "command": with_case}
    text = "repeat the run of A and compare it with A; their difference is not a cause"
    again = asked.command(b="A_AGAIN.csv", rows_b=asked.rows_a, air_b=asked.air_a)
    return {"text": text, "command": again}


def _check(name: str) -> str:
    """Measurement that distinguishes a cause from others."""
    row = law(name)
    return row.settles if row is not None else catalogue()[name].check if name in catalogue() else ""


def _unrepeatable(change: RunChange) -> str:
    """Letter of the recording whose readings at one speed differ by more than those of any stand; "" where none do."""
    for name in LOADS:
        c = change.loads_by_name.get(name)
        if c is not None:
            for letter, here in (("b", c.second), ("a", ~c.second)):
                if float(np.median(c.u[here])) > _RESTLESS:
                    return letter
    return ""


class RankedCause(Documented):
    """One explanation."""

    effect: str
    probability: float
    parameters: Mapping[str, Size] = field(default_factory=dict)


class SubVerdict(Documented):
    """What is said of loads or drive."""

    verdict: str
    effects: tuple[str, ...]
    rule: str
    ranking: tuple[RankedCause, ...]


class Densities(Documented):
    """Recorded densities [kg/m3]; None where they are not told."""

    A: float | None
    B: float | None
    ratio: float | None


class ComparedRuns(Documented):
    """``bemt.comparison/1``: what two recordings say, and what the diagnosis with a case says of them."""

    verdict: str
    effects: tuple[str, ...]
    probability: float | None
    diameter_m: float | None
    density: Densities
    rule: str = ""
    sets: tuple[tuple[str, ...], ...] = ()
    ranking: tuple[RankedCause, ...] = ()
    subsystems: Mapping[str, SubVerdict] = field(default_factory=dict)
    ratios: Mapping[str, Ratio] = field(default_factory=dict)
    points: Mapping[str, int] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    recordings: tuple[str, ...] = ()
    rows: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    next_measurement: Mapping[str, Any] = field(default_factory=dict)
    case: str | None = None
    diagnosis: Mapping[str, Any] | None = None
    told: tuple[str, ...] | None = None  # Lines of the diagnosis

    def document(self) -> dict[str, Any]:
        """Plain values; verdict and ranking in the words of the diagnosis where there is one."""
        said = {k: self.diagnosis[k] for k in DIAGNOSED} if self.diagnosis else {}
        return {"schema": SCHEMA, "version": __version__, **super().document(), **said}


DIAGNOSED = ("verdict", "effects", "probability", "ranking", "rule")
"""What a diagnosis says in place of the ratios."""


def document(change: RunChange) -> ComparedRuns:
    """What is said without a case."""
    said = change.leading
    return ComparedRuns(
        said.verdict, tuple(said.effects), said.mass, or_null(change.diameter_m),
        Densities(*map(or_null, (change.a.density, change.b.density, change.density_ratio))), said.why, said.sets,
        _ranking(said),
        {name: SubVerdict(j.verdict, tuple(j.effects), j.why, _ranking(j))
         for name, j in (("loads", change.loads), ("drive", change.drive))},
        change.ratios, {"A": len(change.a), "B": len(change.b)}, change.assumed, change.notes,
    )  # fmt: skip


def _ranking(said: Judgement) -> tuple[RankedCause, ...]:
    return tuple(RankedCause(k, p, said.parameters.get(k, {})) for k, p in list(said.probability.items())[:12])
