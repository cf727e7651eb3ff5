"""What a user types of a recording: units, columns and signs of a table, or of a run of CFD with zones and set-up."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bemt.base import units
from bemt.base.action import did_you_mean
from bemt.base.errors import Fault, InputError, refuse
from bemt.base.tables import write_atomic
from bemt.base.toml import validated
from bemt.base.toml_text import Collector
from bemt.data import readers
from bemt.data.readers import generic_csv, load_text, number
from bemt.data.readers.cfd import unit_of
from bemt.data.readers.cfd_run import QUANTITIES, ReferenceTable, RunHead, RunToml, SetupTable, toml_text
from bemt.data.readers.headings import counts_electrical, heading, meanings, surely_shaft_speed
from bemt.data.readers.recording_toml import QUANTITIES as CHANNELS
from bemt.data.readers.recording_toml import RecordingToml
from bemt.data.readers.split import decimal_mark, some, split_table
from bemt.data.readers.unit_text import BY_THE_CASE, TWO_MEANINGS, unit_for
from bemt.data.recordings.cfd_files import home_of
from bemt.data.recordings.cfd_loads import DUCT
from bemt.data.recordings.channels import named, names_of
from bemt.physics.dataset import Dataset

Facts = dict[str, str | int]
"""What options say of one quantity: ``column``, ``unit``, ``sign``."""
Told = dict[str, str | float | bool | None]
"""What options say of the set-up, and of what coefficients rest on."""
_REFERENCE = {re.sub(r"_(m2|m|m_s|kg_m3)$", "", k): k for k in ReferenceTable.model_fields}
_LOADS = ("thrust", "duct_thrust", "torque", "power")
_WORDS = {"true": True, "yes": True, "false": False, "no": False}


def pairs(option: str, given: Iterable[str], faults: list[Fault]) -> dict[str, str]:
    """Options ``NAME=VALUE`` as a table, each name once."""
    out: dict[str, str] = {}
    for text in given:
        name, mark, value = text.partition("=")
        if not mark or not name.strip() or not value.strip():
            fault = Fault("", option, text, "NAME=VALUE", f"As in {option} thrust=N" if option == "--unit" else "")
            faults.append(fault)
        elif name.strip() in out:
            faults.append(Fault("", option, f"{name.strip()} twice", "each once"))
        else:
            out[name.strip()] = value.strip()
    return out


def _in_case(name: str, known: Iterable[str]) -> str:
    """Word as it is known, if only its case differs; else as typed.

    >>> _in_case("Torque", ["torque", "rpm"]), _in_case("T", ["t", "T"]), _in_case("lift", ["rpm"])
    ('torque', 'T', 'lift')
    """
    like = [word for word in dict.fromkeys(known) if word.casefold() == name.casefold()]
    return like[0] if len(like) == 1 else name


def _quantity(name: str, unit: str) -> str | None:
    """Quantity of a column by the dimension of its unit."""
    if name in QUANTITIES:
        return name
    known = unit_of(unit)
    dimension = "" if known is None else known.dimension
    found = [q for q, (own, _) in QUANTITIES.items() if own == dimension]
    return ("duct_thrust" if DUCT.search(name) else "thrust") if dimension == "force" else found[0] if found else None


def _gather(
    option: str, given: Iterable[str], meaning: Callable[[str, str], tuple[str, Facts] | Fault],
    columns: dict[str, Facts], faults: list[Fault],
) -> dict[str, str]:  # fmt: skip
    """Add the facts that an option ``NAME=VALUE`` gives of quantities, or its faults; the pairs without one."""
    sound: dict[str, str] = {}
    for name, text in pairs(option, given, faults).items():
        found = meaning(name, text)
        if isinstance(found, Fault):
            faults.append(found)
        else:
            columns.setdefault(found[0], {}).update(found[1])
            sound[name] = text
    return sound


def _of_unit(name: str, text: str) -> tuple[str, Facts] | Fault:
    """What ``--unit NAME=UNIT`` says of a run: NAME is a quantity, or a column whose unit tells it."""
    quantity = _quantity(_in_case(name, QUANTITIES), text)
    if quantity is None or unit_of(text) is None:
        usual = ", ".join(dict.fromkeys(u for _, u in QUANTITIES.values()))
        return Fault("", "--unit", f"{name}={text}", f"a unit of a load or a speed, such as {usual}")
    return quantity, {"unit": text}


def _of_column(name: str, text: str) -> tuple[str, Facts] | Fault:
    """What ``--column QUANTITY=NAME`` says of a run."""
    if name not in QUANTITIES:
        return Fault("", "--column", name, f"one of {', '.join(QUANTITIES)}", "As in --column thrust=NAME")
    return name, {"column": text}


def _of_sign(text: str, by_column: Mapping[str | int, str]) -> tuple[Sequence[str], int] | Fault:
    """Loads that ``--sign NAME=-1`` or ``--sign -1`` turns, and how."""
    name, mark, value = text.rpartition("=")
    quantity = by_column.get(name, name)
    if value.lstrip("+") not in ("1", "-1") or (mark and not name):
        return Fault("", "--sign", text, "NAME=-1, NAME=1, or -1 for all loads")
    if mark and quantity not in QUANTITIES:
        expected = f"one of {', '.join(_LOADS)}, or a column named by --unit or --column"
        return Fault("", "--sign", name, expected)
    return (quantity,) if mark else _LOADS[:1] + _LOADS[2:], int(value)


def run_from(
    files: Sequence[str], *, rpm: float | None = None, airspeed_m_s: float | None = None,
    density_kg_m3: float | None = None, revolutions: int | None = None, sector: int | None = None,
    axis: str | None = None,
    zones: Sequence[str] = (), rotor_zones: Sequence[str] = (), unit: Sequence[str] = (), column: Sequence[str] = (),
    sign: Sequence[str] = (), reference: Sequence[str] = (), setup: Sequence[str] = (), ignore: Sequence[str] = (),
) -> RunToml:  # fmt: skip
    """Make a run of options; all their faults at once.

    >>> run = run_from(["a.out"], rpm=6000, unit=["thrust=N", "report-def-0=N m"], sign=["torque=-1"])
    >>> run.columns.thrust.unit, run.columns.torque
    ('N', RunColumn(column='report-def-0', unit='N m', sign=-1))
    """
    faults: list[Fault] = []
    columns: dict[str, Facts] = {}
    united = _gather("--unit", unit, _of_unit, columns, faults)
    several: dict[str, list[str]] = {}
    for name, text in united.items():
        if name not in QUANTITIES:
            several.setdefault(str(_quantity(_in_case(name, QUANTITIES), text)), []).append(name)
    for quantity, names in several.items():
        if len(names) == 1:
            columns[quantity]["column"] = names[0]
        else:
            zones = [*zones, *names]
    _gather("--column", column, _of_column, columns, faults)
    by_column = {c["column"]: q for q, c in columns.items() if "column" in c}
    for text in sign:
        found = _of_sign(text, by_column)
        if isinstance(found, Fault):
            faults.append(found)
            continue
        for quantity in found[0]:
            columns.setdefault(quantity, {})["sign"] = found[1]
    head = {"files": tuple(files), "rpm": rpm, "airspeed_m_s": airspeed_m_s, "density_kg_m3": density_kg_m3,
            "revolutions": revolutions, "sector": sector, "axis": axis,
            "zones": tuple(_split(zones)) or None, "rotor_zones": tuple(_split(rotor_zones)) or None,
            "ignore": tuple(ignore) or None}  # fmt: skip
    told = _setup(setup, faults)
    if grids := _grids(files, told, faults):
        del head["files"], told["cells"]
    document = {"run": {k: v for k, v in head.items() if v is not None}, "columns": columns, "grids": grids,
                "reference": _numbers(reference, faults), "setup": told}  # fmt: skip
    out = Collector("")
    made = validated(RunToml, {k: v for k, v in document.items() if k != "grids" or v}, out)
    for f in out.faults:
        key = f.where.removeprefix("setup.")
        got = f.got if key == f.where else f"{key}: {f.got}"
        faults.append(Fault("", _option(f.where), got, f.expected, f.hint))
    if faults or made is None:
        raise InputError(faults)
    return made


def _grids(files: Sequence[str], told: Told, faults: list[Fault]) -> list[Mapping[str, object]]:
    """Grids of a study: every run.toml of several, or files whose cells are listed; [] for one run.

    A number for each file, or one for each grid of which there is one file of each kind, by its columns, in this order.
    """
    cells = told.get("cells")
    if isinstance(cells, str) and "," in cells:
        each, own = [number(part) for part in cells.split(",")], [_home(f) for f in files]
        at = [own[:k].count(home) for k, home in enumerate(own)]  # of files of one kind
        if len(each) != len(files) and {own.count(home) for home in own} == {len(each)}:
            each = [each[k] for k in at]
        if len(each) == len(files) and None not in each:
            grids = {n: [k for k, m in enumerate(each) if m == n] for n in each}
            if any(len({own[k] for k in of}) < len(of) for of in grids.values()):  # of several conditions
                return [{"files": (f,), "cells": n} for f, n in zip(files, each, strict=True)]
            return [{"files": tuple(files[k] for k in of), "cells": n} for n, of in grids.items()]
        got, wanted = f"cells={cells} for {len(files)} files", "one number for each file, in their order"
        hint = f"Or {len(each)} files of each kind; a folder counts as one"
        faults.append(Fault("", "--setup", got, wanted, hint))
        told["cells"] = None
        return []
    made = [(Path(f) / "run.toml").as_posix() if (Path(f) / "run.toml").is_file() else f for f in files]
    told.setdefault("cells", None)
    return [{"files": (f,)} for f in made] if len(made) > 1 and all(map(_is_grid, made)) else []


def _home(file: str) -> object:
    """What files of one kind have in common: format and columns; any other file is of its own kind."""
    with suppress(InputError, OSError):
        record = readers.read(file)
        if isinstance(record, Dataset):
            return home_of(file, record)
    return file


def _option(where: str) -> str:
    if where.startswith("columns."):
        return f"--{where.rsplit('.', 1)[1]} {where.split('.')[1]}"
    return "--" + where.removeprefix("run.").split(".")[0].replace("_m_s", "").replace("_kg_m3", "").replace("_", "-")


def _split(texts: Sequence[str]) -> list[str]:
    return [part.strip() for text in texts for part in text.split(",") if part.strip()]


def _numbers(texts: Sequence[str], faults: list[Fault]) -> Told:
    out: Told = {}
    for name, text in pairs("--reference", _split(texts), faults).items():
        out[_REFERENCE.get(name, name)] = value = number(text)
        if value is None:
            faults.append(Fault("", "--reference", f"{name}={text}", f"a number for one of {', '.join(_REFERENCE)}"))
    return out


def _setup(texts: Sequence[str], faults: list[Fault]) -> Told:
    out: Told = {}
    for name, text in pairs("--setup", texts, faults).items():
        kind = SetupTable.model_fields.get(name)
        out[name] = text
        if kind is not None and "str" not in str(kind.annotation) and "Literal" not in str(kind.annotation):
            with suppress(ValueError):
                out[name] = _WORDS[text.lower()] if text.lower() in _WORDS else float(text)
    return out


def _is_grid(file: str) -> bool:
    """Whether a file is a run by itself, and may be one grid of several."""
    from bemt.data.recordings.cfd_run import run_of  # which needs this module

    try:
        return Path(file).is_file() and run_of(file) is not None
    except InputError:  # said where it is read
        return False


def write_run(run: RunToml, out: str) -> Path:
    """Write ``run.toml``, or the ``study.toml`` of several grids; its files are named relative to it."""
    path = Path(out)
    path = path if path.suffix == ".toml" else path / "run.toml"
    if path.is_file() and readers.kind_of(path) != "cfd_run":
        raise InputError(Fault("--out", "", f"{path.as_posix()}, which is no run", "a new name, or a run to replace"))
    path.parent.mkdir(parents=True, exist_ok=True)

    def near(files: Sequence[str]) -> tuple[str, ...]:
        return tuple(Path(os.path.relpath(f, path.parent)).as_posix() for f in files)

    grids = tuple(g.model_copy(update={"files": near(g.files)}) for g in run.grids)
    head = run.run.model_dump(exclude_unset=True, exclude={"files"}) | ({} if grids else {"files": near(run.run.files)})
    if head.get("rpm") is not None:
        head["rpm"] = float(f"{head['rpm']:.12g}")
    own = {"run": RunHead.model_validate(head)} | ({"grids": grids} if grids else {})
    tables = run.model_copy(update=own).model_dump(exclude_unset=True, exclude_none=True)
    what = "One condition on several grids" if run.grids else "One CFD run"
    comment = f"{what}, written by bemt import. Give this file in place of the exports.\n"
    write_atomic(path, toml_text(tables, comment))
    return path


# A recording.toml from what a user types: units, columns and signs that the headings of a table do not say.
_BY_UNIT = ("thrust", "torque", "rpm", "voltage", "current", "airspeed", "density", "pressure")
"""Quantities that their unit alone stands for."""


def _unit(quantity: str, text: str) -> str | None:
    """Unit under the name that recording.toml has for it."""
    found = unit_for(CHANNELS[quantity], text)
    return found[0].suffix if found and found[0].suffix in units.UNITS else None


@dataclass(frozen=True)
class _Measured:
    """Headings of a table of measurements: what an option says of them is a quantity with facts, or a fault."""

    known: Sequence[str]
    taken: dict[str, str] = field(default_factory=dict)  # heading that --column named, its quantity
    read_as: Mapping[str, str] = field(default_factory=dict)  # quantity that the reader took a heading for

    def column(self, name: str, text: str) -> tuple[str, Facts] | Fault:
        """``--column QUANTITY=HEADING``."""
        name, text = _in_case(name, CHANNELS), _in_case(text, self.known)
        if name not in CHANNELS:
            return Fault("", "--column", name, f"one of {', '.join(CHANNELS)}", "As in --column thrust=Fz")
        if text not in self.known:
            return Fault("", "--column", text, f"one of {some(map(repr, self.known), 12)}")
        self.taken[text] = name
        return name, {"column": text}

    def unit(self, name: str, text: str) -> tuple[str, Facts] | Fault:
        """``--unit NAME=UNIT``, of a quantity or a heading."""
        name = _in_case(name, self.known if _in_case(name, self.known) in self.known else CHANNELS)
        if name not in CHANNELS and name not in self.known:
            meant = did_you_mean(name, [*CHANNELS, *self.known]).strip()
            return Fault("", "--unit", name, f"one of {some(map(repr, self.known), 12)}, or a quantity", meant)
        if name in self.known and (unit := heading(name).unit) and unit.dimension == "none":
            return Fault("", "--unit", f"{name}={text}", "no unit", f"Leave it out: {BY_THE_CASE}")
        quantity = name if name in CHANNELS else self.taken.get(name)
        quantity = quantity or next((q for q in (*meanings(name), *_BY_UNIT) if _unit(q, text)), None)
        told = None if quantity is None else _unit(quantity, text)
        if quantity is None or told is None:
            wanted = [d for q in (meanings(name) or [name]) if (d := CHANNELS.get(q))]
            choice = ", ".join(u for d in dict.fromkeys(wanted) for u in units.suffixes(d))
            every = "; ".join(f"{q} {', '.join(units.suffixes(d))}" for q, d in list(CHANNELS.items())[:8])
            hint = TWO_MEANINGS.get(text, "").capitalize()
            return Fault("", "--unit", f"{name}={text}", choice or f"a unit of a quantity: {every}", hint)
        facts: Facts = {"unit": told}
        return quantity, facts | ({"column": name} if name in self.known else {})

    def sign(self, name: str, text: str) -> tuple[str, Facts] | Fault:
        """``--sign QUANTITY=-1``, or of a heading that --column named."""
        quantity = self.taken.get(_in_case(name, self.taken), _in_case(name, CHANNELS))
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


def write_recording(
    file: str, out: str, unit: Iterable[str] = (), column: Iterable[str] = (), sign: Sequence[str] = (),
    pole_pairs: int | None = None, density_kg_m3: float | None = None, ignore: Sequence[str] = (),
    rpm: float | None = None, airspeed_m_s: float | None = None,
) -> Path:  # fmt: skip
    """Write a recording.toml beside a table of measurements, in the same folder; all faults of the options at once.

    `unit` ``NAME=UNIT``, of a quantity or a heading; `column` ``QUANTITY=HEADING``; `sign` ``QUANTITY=-1``;
    `pole_pairs` of a speed that counts electrical revolutions; density; `ignore` headings; `rpm` and airspeed
    that no column has. InputError on what is no column, unit or quantity, and where `out` exists.
    """
    path = Path(out) if out.endswith(".toml") else Path(out) / "recording.toml"
    faults: list[Fault] = []
    if path.resolve().parent != Path(file).resolve().parent:
        faults.append(Fault("", "--out", out, f"a file in the folder of {Path(file).name}", "Both stay together"))
    if path.exists():
        faults.append(Fault(path.as_posix(), "", "a file that exists", "a new name", "Add the lines to it by hand"))
    document = recording_from(file, unit, column, sign, pole_pairs, density_kg_m3, faults, ignore,
                              rpm, airspeed_m_s)  # fmt: skip
    write_atomic(path, toml_text(document, "Written by bemt import. Give this file in place of the table."))
    return path


def recording_from(
    file: str, unit: Iterable[str] = (), column: Iterable[str] = (), sign: Sequence[str] = (),
    pole_pairs: int | None = None, density_kg_m3: float | None = None, faults: Sequence[Fault] = (),
    ignore: Sequence[str] = (), rpm: float | None = None, airspeed_m_s: float | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Tables of a recording.toml from what options say of a table of measurements; their faults come after `faults`."""
    faults = list(faults)
    table = split_table(load_text(file))
    faults += [Fault("", "--ignore", repr(h), f"one of {some(map(repr, table.headings), 12)}")
               for h in ignore if h not in table.headings]  # fmt: skip
    read_as = {q: h for q, h in _read_as(file).items() if h not in ignore}
    headings = _Measured([h for h in table.headings if h and h not in ignore], {}, read_as)
    loads = [q for q in ("thrust", "torque") if q in headings.read_as]
    if loads and list(sign) in (["-1"], ["1"]):  # turns all
        sign = [f"{q}={text}" for q in loads for text in sign]
    columns = _facts(headings, unit, column, sign, faults)
    if not (columns or faults):
        columns = headings.plain()
    if pole_pairs:
        columns |= {} if "electrical_rpm" in columns else headings.electrical(columns.pop("rpm", {}))
    for quantity, facts in columns.items():
        faults += headings.complete(quantity, facts)
    refuse(faults)
    head: dict[str, Any] = {"file": Path(file).name} | ({"decimal": ","} if decimal_mark(table) == "," else {})
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
    faults: list[Fault] = []
    headings = _Measured([str(h) for h in frame.columns])
    columns = _facts(headings, unit, column, sign, faults)
    if pole_pairs:
        columns |= {} if "electrical_rpm" in columns else headings.electrical(columns.pop("rpm", {}))
    for quantity, facts in columns.items():
        faults += headings.complete(quantity, facts)
    refuse(faults)
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
    headings: _Measured, unit: Iterable[str], column: Iterable[str], sign: Sequence[str], faults: list[Fault]
) -> dict[str, Facts]:
    """What options say of the columns of a table."""
    columns: dict[str, Facts] = {}
    _gather("--column", column, headings.column, columns, faults)
    _gather("--unit", unit, headings.unit, columns, faults)
    _gather("--sign", sign, headings.sign, columns, faults)
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
        notes.append(f"{name}: {value:g} as given" if own is None else f"{name}: ignored, the file has {own}")
    values = {**imported.values, **told}
    units = {k: unit for k, unit in imported.units.items() if k not in told}
    return replace(imported, values=values, units=units, notes=(*imported.notes, *notes)) if notes else imported
