"""What a user types of a table of measurements: units, columns, signs and poles that its headings do not say."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base import units
from bemt.base.action import did_you_mean
from bemt.base.errors import Fault, InputError, refuse
from bemt.base.tables import some, write_atomic
from bemt.base.toml import validated
from bemt.base.toml_text import Collector
from bemt.data.readers import generic_csv, load_text
from bemt.data.readers.cfd_run import toml_text
from bemt.data.readers.headings import counts_electrical, heading, meanings, surely_shaft_speed
from bemt.data.readers.recording_toml import QUANTITIES as CHANNELS
from bemt.data.readers.recording_toml import RecordingToml
from bemt.data.readers.split import decimal_mark, split_table
from bemt.data.readers.unit_text import BY_THE_CASE, TWO_MEANINGS, unit_for
from bemt.data.recordings.cfd_options import Facts, gather, in_case
from bemt.data.recordings.channels import named, names_of
from bemt.physics.dataset import Dataset

_BY_UNIT = ("thrust", "torque", "rpm", "voltage", "current", "airspeed", "density", "pressure")
"""Quantities that their unit alone stands for."""
IGNORED = "ignored, the file has"
"""What is said of a value that a file states itself, before the channel."""


def _unit(quantity: str, text: str) -> str | None:
    """Unit under the name that recording.toml has for it."""
    found = unit_for(CHANNELS[quantity], text)
    return found[0].suffix if found and found[0].suffix in units.UNITS else None


def _units_of(name: str) -> str:
    """Units that a quantity or a heading may have; those of the first quantities where it has no meaning."""
    wanted = [d for q in (meanings(name) or [name]) if (d := CHANNELS.get(q))]
    choice = ", ".join(u for d in dict.fromkeys(wanted) for u in units.suffixes(d))
    every = "; ".join(f"{q} {', '.join(units.suffixes(d))}" for q, d in list(CHANNELS.items())[:8])
    return choice or f"a unit of a quantity: {every}"


@dataclass(frozen=True)
class _Measured:
    """Headings of a table of measurements: what an option says of them is a quantity with facts, or a fault."""

    known: Sequence[str]
    taken: dict[str, str] = field(default_factory=dict)  # heading that --column named, its quantity
    read_as: Mapping[str, str] = field(default_factory=dict)  # quantity that the reader took a heading for

    def column(self, name: str, text: str) -> tuple[str, Facts] | Fault:
        """``--column QUANTITY=HEADING``."""
        name, text = in_case(name, CHANNELS), in_case(text, self.known)
        if name not in CHANNELS:
            return Fault("", "--column", name, f"one of {', '.join(CHANNELS)}", "As in --column thrust=Fz")
        if text not in self.known:
            return Fault("", "--column", text, f"one of {some(map(repr, self.known), 12)}")
        self.taken[text] = name
        return name, {"column": text}

    def unit(self, name: str, text: str) -> tuple[str, Facts] | Fault:
        """``--unit NAME=UNIT``, of a quantity or a heading."""
        name = in_case(name, self.known if in_case(name, self.known) in self.known else CHANNELS)
        if name not in CHANNELS and name not in self.known:
            meant = did_you_mean(name, [*CHANNELS, *self.known]).strip()
            return Fault("", "--unit", name, f"one of {some(map(repr, self.known), 12)}, or a quantity", meant)
        if name in self.known and (unit := heading(name).unit) and unit.dimension == "none":
            return Fault("", "--unit", f"{name}={text}", "no unit", f"Leave it out: {BY_THE_CASE}")
        quantity = name if name in CHANNELS else self.taken.get(name)
        quantity = quantity or next((q for q in (*meanings(name), *_BY_UNIT) if _unit(q, text)), None)
        told = None if quantity is None else _unit(quantity, text)
        if quantity is None or told is None:
            return Fault("", "--unit", f"{name}={text}", _units_of(name), TWO_MEANINGS.get(text, "").capitalize())
        facts: Facts = {"unit": told}
        return quantity, facts | ({"column": name} if name in self.known else {})

    def sign(self, name: str, text: str) -> tuple[str, Facts] | Fault:
        """``--sign QUANTITY=-1``, or of a heading that --column named."""
        quantity = self.taken.get(in_case(name, self.taken), in_case(name, CHANNELS))
        if quantity not in CHANNELS or text not in ("1", "-1"):
            return Fault("", "--sign", f"{name}={text}", "a quantity and -1, as in --sign thrust=-1")
        return quantity, {"sign": int(text)}

    def plain(self) -> dict[str, Facts]:
        """Quantities of the headings that say quantity and unit themselves."""
        out: dict[str, Facts] = {}
        for h in self.known:
            head = heading(h)
            named = {*meanings(h), head.name.removesuffix(f"_{head.unit.suffix}") if head.unit else ""}
            told = [q for q in named if q in CHANNELS and head.unit and head.unit.dimension == CHANNELS[q]]
            if len(told) == 1:
                out.setdefault(told[0], {"column": h})
        return out

    def electrical(self, facts: Facts) -> dict[str, Facts]:
        """Column that counts electrical revolutions: that of the rpm, else the one whose heading says so."""
        speeds = {h: u for h in self.known if (u := heading(h).unit) is not None and u.dimension == "angular_speed"}
        said = [h for h in speeds if counts_electrical(h)] or list(speeds)
        if "column" not in facts and len(said) == 1:
            facts = {"column": said[0], "unit": speeds[said[0]].suffix, **facts}
        return {"electrical_rpm": facts}

    def complete(self, quantity: str, facts: Facts) -> Iterator[Fault]:
        """Add the column and the unit that the headings tell; faults where they do not."""
        if "column" not in facts:
            named = [h for h in self.known if quantity in meanings(h)]
            named = named if len(named) == 1 or quantity not in self.read_as else [self.read_as[quantity]]
            if len(named) != 1:
                expected = f"--column {quantity}=HEADING with one of {some(map(repr, named or self.known), 12)}"
                yield Fault("", "--column", f"no column for {quantity}", expected)
                return
            facts["column"] = named[0]
        text, dimension = str(facts["column"]), CHANNELS[quantity]
        found = heading(text).unit or heading(re.sub(r"^[^(\[]*(?=[(\[])", f"{quantity} ", text)).unit
        if "unit" not in facts:
            if found is None or found.suffix not in units.UNITS or found.dimension != dimension:
                expected = f"--unit {quantity}= {' or '.join(units.suffixes(dimension))}"
                yield Fault("", "--unit", f"no unit for {quantity}", expected)
                return
            facts["unit"] = found.suffix


def _read_as(file: str) -> dict[str, str]:
    """Heading of each quantity as the reader of tables understands it."""
    try:
        found = named(generic_csv.read(file))
    except InputError:
        return {}
    own = names_of(found)
    return {units.split_suffix(name)[0]: found.headings[was] for name, was in own.items() if was in found.headings}


def write_recording(file: str, out: str, **stated: Any) -> Path:
    """Write a recording.toml beside a table of measurements, in the same folder; all faults of the options at once.

    `stated` as `recording_from` takes it. InputError on what is no column, unit or quantity, and where `out` exists.
    """
    path = Path(out) if out.endswith(".toml") else Path(out) / "recording.toml"
    faults: list[Fault] = []
    if path.resolve().parent != Path(file).resolve().parent:
        faults.append(Fault("", "--out", out, f"a file in the folder of {Path(file).name}", "Both stay together"))
    if path.exists():
        faults.append(Fault(path.as_posix(), "", "a file that exists", "a new name", "Add the lines to it by hand"))
    document = recording_from(file, **stated, faults=faults)
    write_atomic(path, toml_text(document, "Written by bemt import. Give this file in place of the table."))
    return path


def recording_from(
    file: str, unit: Iterable[str] = (), column: Iterable[str] = (), sign: Sequence[str] = (),
    pole_pairs: int | None = None, density_kg_m3: float | None = None, faults: Sequence[Fault] = (),
    ignore: Sequence[str] = (), rpm: float | None = None, airspeed_m_s: float | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Tables of a recording.toml from what options say of a table of measurements; their faults come after `faults`.

    `unit` ``NAME=UNIT``, of a quantity or a heading; `column` ``QUANTITY=HEADING``, of a table without headings
    ``QUANTITY=NUMBER``; `sign` ``QUANTITY=-1``; `pole_pairs` of a speed that counts electrical revolutions; headings to
    `ignore`; what no column has.
    """
    faults, table = list(faults), split_table(load_text(file))
    faults += [Fault("", "--ignore", repr(h), f"one of {some(map(repr, table.headings), 12)}")
               for h in ignore if h not in table.headings]  # fmt: skip
    read_as = {q: h for q, h in _read_as(file).items() if h not in ignore}
    bare = [] if table.headings else [str(k + 1) for k in range(table.width)]  # columns by their number
    headings = _Measured(bare or [h for h in table.headings if h and h not in ignore], {}, read_as)
    loads = [q for q in ("thrust", "torque") if q in headings.read_as]
    if loads and list(sign) in (["-1"], ["1"]):  # turns all
        sign = [f"{q}={text}" for q in loads for text in sign]
    columns = _facts(headings, unit, column, sign, pole_pairs, faults, plain=True)
    for facts in columns.values() if bare else ():
        facts["column"] = int(facts["column"])
    head: dict[str, Any] = {"file": Path(file).name} | ({"header": False} if bare else {})
    head |= {"decimal": ","} if decimal_mark(table) == "," else {}
    head |= {"ignore": list(ignore)} if ignore else {}
    head |= {k: v for k, v in (("rpm", rpm), ("airspeed_m_s", airspeed_m_s)) if v is not None}
    out = Collector(file)
    document = {"recording": head, "columns": columns} | ({"rotor": {"pole_pairs": pole_pairs}} if pole_pairs else {})
    document |= {} if density_kg_m3 is None else {"air": {"density_kg_m3": density_kg_m3}}
    validated(RecordingToml, document, out)
    out.check()
    return document


def stated_frame(
    frame: Any, unit: Iterable[str] = (), column: Iterable[str] = (), sign: Sequence[str] = (),
    pole_pairs: int | None = None,
) -> Any:  # fmt: skip
    """A DataFrame with what is said of its columns in their names, as `from_pandas` reads them.

    >>> import pandas as pd
    >>> told = stated_frame(pd.DataFrame({"n": [100.0], "F": [2.0]}), ["F=gf"], ["rpm=n", "thrust=F"], ["thrust=-1"])
    ... # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: --unit: got no unit for rpm; expected --unit rpm=...
    >>> stated_frame(pd.DataFrame({"rpm": [6000.0], "F": [2.0]}), ["F=gf"], ["thrust=F"], ["thrust=-1"]).to_dict("list")
    {'rpm': [6000.0], 'thrust_gf': [-2.0]}
    >>> stated_frame(pd.DataFrame({"eRPM": [42000.0]}), pole_pairs=7).to_dict("list")
    {'rpm': [6000.0]}
    """
    columns = _facts(_Measured([str(h) for h in frame.columns]), unit, column, sign, pole_pairs, [])
    out = frame.rename(columns=str)
    for quantity, facts in columns.items():
        own, told = facts["column"], units.UNITS[str(facts["unit"])]
        turning = CHANNELS[quantity] == "angular_speed"
        if quantity == "electrical_rpm" and pole_pairs:
            out[own] = out[own] / pole_pairs
            quantity = "rpm" if own == "rpm" or "rpm" not in out else "rpm_from_electrical_rpm"
        factor = float(facts.get("sign", 1)) * (told.factor / units.RPM if turning else 1.0)
        out[own] = out[own] * factor
        out = out.rename(columns={own: quantity if turning else f"{quantity}_{told.suffix}"})
    return out


def _facts(
    headings: _Measured, unit: Iterable[str], column: Iterable[str], sign: Sequence[str], pole_pairs: int | None,
    faults: list[Fault], plain: bool = False,
) -> dict[str, Facts]:  # fmt: skip
    """Column, unit and sign of each quantity that options name, or with `plain` the headings where none does."""
    columns: dict[str, Facts] = {}
    gather("--column", column, headings.column, columns, faults)
    gather("--unit", unit, headings.unit, columns, faults)
    gather("--sign", sign, headings.sign, columns, faults)
    if plain and not (columns or faults):
        columns = headings.plain()
    if pole_pairs:
        columns |= {} if "electrical_rpm" in columns else headings.electrical(columns.pop("rpm", {}))
    for quantity, facts in columns.items():
        faults += headings.complete(quantity, facts)
    refuse(faults)
    return columns


def filled(
    imported: Dataset, rpm: float | None = None, airspeed_m_s: float | None = None, density_kg_m3: float | None = None
) -> Dataset:  # fmt: skip
    """Recording with the speed, the airspeed and the density that the user states where it has no column of them."""
    known = named(imported).values
    told, notes = {}, []
    if rpm is not None and "rpm" not in known:
        for name, v in imported.values.items():
            varies = not imported.unit(name) and np.unique(v[np.isfinite(v)]).size > 1
            text = imported.headings.get(name) or name
            if varies and surely_shaft_speed(text):
                got = f"--rpm {rpm:g}, and a column of {np.unique(v).size} speeds without a unit"
                hint = f"Head it {text} (rev/min) or {text} (rad/s), and leave out --rpm"
                raise InputError(Fault(imported.file, text, got, "one source of the speed", hint))
    moist = ("pressure_Pa",) if "temperature_K" in known else ()
    for name, value, same in (
        ("rpm", rpm, ("rpm",)), ("airspeed_m_s", airspeed_m_s, ("airspeed_m_s", "J")),
        ("density_kg_m3", density_kg_m3, ("density_kg_m3", *moist)),
    ):  # fmt: skip
        if value is None:
            continue
        own = next((k for k in same if k in known), None)
        if f"{name}: {value:g} as given" in imported.notes:
            continue
        if own is None:
            told[name] = np.full(len(imported), float(value))
        notes.append(f"{name}: {value:g} as given" if own is None else f"{name}: {IGNORED} {own}")
    values = {**imported.values, **told}
    units = {k: unit for k, unit in imported.units.items() if k not in told}
    return replace(imported, values=values, units=units, notes=(*imported.notes, *notes)) if notes else imported
