"""How `compare` was called, so that every command that is recommended carries it."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, replace
from typing import Any

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
