"""What a user types of a recording: units, columns and signs of a table, or of a run of CFD with zones and set-up."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from bemt.base.errors import Fault, InputError
from bemt.base.tables import write_atomic
from bemt.base.toml import validated
from bemt.base.toml_text import Collector
from bemt.data import readers
from bemt.data.readers import number
from bemt.data.readers.cfd import unit_of
from bemt.data.readers.cfd_run import QUANTITIES, ReferenceTable, RunHead, RunToml, SetupTable, toml_text
from bemt.data.recordings.cfd_files import home_of
from bemt.data.recordings.cfd_loads import DUCT
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


def in_case(name: str, known: Iterable[str]) -> str:
    """Word as it is known, if only its case differs; else as typed.

    >>> in_case("Torque", ["torque", "rpm"]), in_case("T", ["t", "T"]), in_case("lift", ["rpm"])
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


def gather(
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
    quantity = _quantity(in_case(name, QUANTITIES), text)
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


def _add_signs(sign: Sequence[str], columns: dict[str, Facts], faults: list[Fault]) -> None:
    """Add the stated signs to what is known of the quantities."""
    by_column = {c["column"]: q for q, c in columns.items() if "column" in c}
    for text in sign:
        found = _of_sign(text, by_column)
        if isinstance(found, Fault):
            faults.append(found)
        else:
            for quantity in found[0]:
                columns.setdefault(quantity, {})["sign"] = found[1]


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
    united = gather("--unit", unit, _of_unit, columns, faults)
    several: dict[str, list[str]] = {}
    for name, text in united.items():
        if name not in QUANTITIES:
            several.setdefault(str(_quantity(in_case(name, QUANTITIES), text)), []).append(name)
    for quantity, names in several.items():
        if len(names) == 1:
            columns[quantity]["column"] = names[0]
        else:
            zones = [*zones, *names]
    gather("--column", column, _of_column, columns, faults)
    _add_signs(sign, columns, faults)
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
        got = f.got if key == f.where else f"{f.got}, {key}"
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
        each, kinds = [number(part) for part in cells.split(",")], [_home(f) for f in files]
        if (found := _listed(files, each, kinds)) is None:
            got, wanted = f"cells={cells} for {len(files)} files", "one number for each file, in their order"
            hint = f"Or {len(each)} files of each kind; a folder counts as one"
            faults.append(Fault("", "--setup", got, wanted, hint))
            told["cells"] = None
        return found or []
    made = [(Path(f) / "run.toml").as_posix() if (Path(f) / "run.toml").is_file() else f for f in files]
    told.setdefault("cells", None)
    return [{"files": (f,)} for f in made] if len(made) > 1 and all(map(_is_grid, made)) else []


def _listed(
    files: Sequence[str], each: Sequence[float | None], kinds: Sequence[object]
) -> list[Mapping[str, object]] | None:
    """Files of each grid by the cells that are listed; None where the list does not go with the files."""
    if len(each) != len(files) and {kinds.count(kind) for kind in kinds} == {len(each)}:
        each = [each[kinds[:k].count(kind)] for k, kind in enumerate(kinds)]  # of files of one kind
    if len(each) != len(files) or None in each:
        return None
    grids = {n: [k for k, m in enumerate(each) if m == n] for n in each}
    if any(len({kinds[k] for k in of}) < len(of) for of in grids.values()):  # of several conditions
        return [{"files": (f,), "cells": n} for f, n in zip(files, each, strict=True)]
    return [{"files": tuple(files[k] for k in of), "cells": n} for n, of in grids.items()]


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
