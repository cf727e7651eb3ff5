"""What the headings of a table leave open: what a user is asked, and the command or the file that states it."""

from __future__ import annotations

import difflib
import re
import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path

from bemt.base import units
from bemt.base.tables import some
from bemt.data.readers._words import DIMENSIONS
from bemt.data.readers.headings import may_be_shaft_speed, meanings, slug, surely_shaft_speed

OWN = {"UNIT": "units", "PAIRS": "number"}
"""What a user puts in place of a mark."""
NEEDED = {"rpm", "thrust", "torque"}
"""Quantities of which nothing can be said while their unit is open."""
_MEANINGS = ("rpm", "thrust", "torque", "voltage", "current", "power", "time", "airspeed", "throttle", "pressure",
             "temperature", "density", "humidity")  # fmt: skip


def one_step(table: str, options: Iterable[str]) -> str:
    """Command that states options of a table and keeps them in a file beside it."""
    return f"bemt import {shlex.quote(table)} {' '.join(options)} --out {kept_beside([Path(table)])[0]}"


def kept_beside(tables: Sequence[Path]) -> list[str]:
    """Files, as typed, that can keep what is stated of tables: beside each, and of a name that is free."""
    out = []
    for table in tables:
        stems = ("recording", table.stem) if len(tables) == 1 else (table.stem,)
        places = [table.with_name(f"{stem}.toml") for stem in stems]
        out.append(next((p for p in places if not p.exists()), table.with_name(f"{table.stem}_stated.toml")))
    return [shlex.quote(p.as_posix()) for p in out]


def asked(headings: Sequence[str], channels: Iterable[str]) -> dict[str, str]:
    """Options of ``bemt import``, by quantity, that state the unit of headings whose words are one quantity."""
    names = [label[1:].rsplit("'", 1)[0].split("' (")[0] for label in headings]
    return {quantity: f"--unit {shlex.quote(name)}=UNIT" for quantity, name in meant(names, channels).items()}


def meant(names: Iterable[str], channels: Iterable[str]) -> dict[str, str]:
    """Headings whose words are one quantity that no other channel is, by quantity.

    >>> meant(["Voltage", "x"], ["thrust_N"])
    {'voltage': 'Voltage'}
    """
    out: dict[str, str] = {}
    channels = {*channels} - {slug(name) for name in names}
    for name in names:
        found = {"rpm"} if surely_shaft_speed(name) else set(meanings(name))
        found -= {"pulse_width"} if "throttle" in found else set()
        quantity = found.pop() if len(found) == 1 else ""
        if quantity and not any(k == quantity or k.startswith(f"{quantity}_") for k in channels):
            out.setdefault(quantity, name)
    return out


def nearest(headings: Sequence[str], channels: Iterable[str] = ()) -> str:
    r"""What headings without a unit may mean, and the line of a recording.toml that says so; empty: nothing is near.

    A bare ``speed`` is that of the shaft or of the air, whichever the file has not.

    >>> nearest(["'Trust'", "'x'"])  # doctest: +ELLIPSIS
    '; nearest meaning: \'Trust\' thrust. The line: [columns] thrust = { column = "Trust", unit = "..." }, unit N, ...'
    >>> nearest(["'speed'"], ["airspeed_m_s"])  # doctest: +ELLIPSIS
    '; nearest meaning: \'speed\' rpm. The line: [columns] rpm = { column = "speed", unit = "..." }, unit rad_s, ...'
    """
    near: dict[str, list[str]] = {}
    for label in headings:
        name = label.split("'")[1] if "'" in label else label
        word = re.split(r"[\s_(\[]", name.strip().lower())[0]
        found = _speeds_meant(name, channels) if may_be_shaft_speed(name) else None
        if found is None:
            known = [q for q in meanings(name) if q in _MEANINGS]
            found = known or difflib.get_close_matches(word, _MEANINGS, 1, 0.75)
        if found:
            near[name] = found
    if not near:
        return ""
    name, meant = next(iter(near.items()))
    lines = [
        f'{m} = {{ column = "{name}", unit = "..." }}, unit {some(units.suffixes(DIMENSIONS[m]), 5)}' for m in meant
    ]
    told = ", ".join(f"{k!r} {' or '.join(v)}" for k, v in near.items())
    return f"; nearest meaning: {told}. The line: [columns] {', or '.join(lines)}"


def _speeds_meant(name: str, channels: Iterable[str]) -> list[str]:
    """Speeds that a heading may mean, of those that the file has not yet."""
    known = list(channels)
    turning = any(re.search(r"(^|_)rpm|rad_s$", k) for k in known)
    moving = any(k == "J" or k.endswith("_m_s") for k in known)
    return [*([] if turning else ["rpm"]), *([] if moving or surely_shaft_speed(name) else ["airspeed"])]
