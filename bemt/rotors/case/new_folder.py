"""Folder of a new case: case.toml and the stations it names."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bemt.base.errors import Fault, InputError, installs, refuse
from bemt.base.packed import part_of
from bemt.base.tables import write_atomic
from bemt.base.units import INCH
from bemt.data.readers import load_text
from bemt.data.readers.split import decimal_mark, split_table
from bemt.data.readers.stations import column_of
from bemt.data.readers.uiuc_names import find_family
from bemt.physics.sections.neuralfoil import to_install
from bemt.rotors.case import Case, fresh, from_solid, load_case
from bemt.rotors.case.motor import full_speed


@dataclass(frozen=True)
class Wanted:
    """What the user of `bemt new` knows of a propeller or fan."""

    label: str | None = None
    stations: str | None = None
    scan: str | None = None
    unit: str | None = None
    diameter_mm: float | None = None
    fan: bool = False
    blades: int | None = None
    rpm: float | None = None
    airspeed_m_s: float = 0.0
    series: str | None = None
    kv: float | None = None
    cells: int | None = None
    campaign: bool = False
    reading: str | None = None
    inches: bool = False  # The diameter was given so
    name: str = ""  # Of the case, where it is given beside the label
    folder: str = ""  # To write, where it is told: a fan that nobody calls by a name has that of its folder

    @property
    def motor(self) -> tuple[float, int] | None:
        """K_v and cells. [rev/min/V]"""
        return None if self.kv is None or self.cells is None else (self.kv, self.cells)

    @property
    def family(self) -> str | None:
        """Family of the series."""
        return None if self.series is None else find_family(self.series)


_SIZE = re.compile(r"(\d+(?:\.\d+)?)\s*(mm|in)?")
_CAMPAIGN = """\
# OpenFOAM runs of this case: bemt cfd {name}/cfd
schema = "bemt.cfd/1"
name = "{name}"
case = "../case.toml"

[defaults]
airspeed_m_s = {V:g}

[axes]                    # every combination; three grids show what a grid is worth
rpm = [{rpm:g}]
level = [5, 5.5, 6]       # cells on the blade R / 2^(level + 2): about 35,000, 65,000 and 115,000 for half a rotor
"""


def write(wanted: Wanted, out: str | None = None) -> tuple[Path, list[str], list[str]]:
    """Write a new case that can be solved; nothing is written unless all of it is sound.

    Gives folder and files; what was assumed of a fan, was not used of the stations, or why a reading may not be this
    rotor's.
    """
    wanted = replace(wanted, folder=Path(out).resolve().name if out else "")
    faults = _faults(wanted)
    refuse(faults)
    files = _files(wanted)
    try:
        case = checked(files)
        notes = [] if wanted.reading is None or not (doubt := case.as_built().doubt) else [doubt]
    except InputError as error:
        raise InputError([_of_motor(fault, wanted) for fault in error.faults]) from None
    if wanted.motor is not None and wanted.rpm is None:  # a guess so far
        rpm = f"rpm = {full_speed(case):.6g}".encode()
        files["case.toml"] = re.sub(rb"^rpm = \S+", rpm, files["case.toml"], count=1, flags=re.M)
        case = checked(files)
    if wanted.campaign:
        files["cfd/campaign.toml"] = _CAMPAIGN.format(name=case.name, rpm=case.rpm, V=case.airspeed_m_s).encode()
    folder = Path(out) if out else Path(case.name)
    if not _as_written(wanted, folder):
        own = wanted.motor is not None and (folder / "case.toml").is_file()
        free_folder(folder, f", and copy its [drive] into {(folder / 'case.toml').as_posix()}" if own else "")
    _put(files, folder)
    kind, read = _read_of_label(wanted)
    if not case.file.polars and to_install([s for _, s in case.rotor().blade.anchors], case.file.model.n_crit):
        read.append(f"its sections are not in the shipped table: first {installs('neuralfoil')}")
    unused = re.findall(r"^# (column .*)$", files["case.toml"].decode(), re.M)
    return folder, sorted(files), [*_assumed(wanted, case), *kind, *notes, *read, *unused]


def _assumed(wanted: Wanted, case: Case) -> Iterator[str]:
    """What nobody stated of a fan; the size that stations have."""
    open_ = [item for item in case.assumptions if item.key.startswith(("rotor.", "duct.", "blade."))]
    told = [f"{item.key.rpartition('.')[2]} {item.nominal:.3g}" for item in open_
            if isinstance(item.nominal, int | float)]  # fmt: skip
    if wanted.fan and told:
        yield f"assumed, with ranges in case.toml: {', '.join(told)}"
    if wanted.stations:
        whence = "" if wanted.diameter_mm is not None else f" of the label {wanted.label}"
        reach = _outermost(Path(wanted.stations))
        at = f", outermost station at {1e3 * reach[0]:.5g} mm" if reach else ""
        hub = 1e3 * case.diameter_m * case.get("rotor.hub_ratio")
        size = f"diameter {1e3 * case.diameter_m:.5g} mm{whence}{at}, {case.get('rotor.blades')} blades"
        yield f"taken: {size}, hub {hub:.3g} mm, by the innermost station; yours: hub_ratio in case.toml"


def _read_of_label(wanted: Wanted) -> tuple[list[str], list[str]]:
    """What a label alone leaves open, and how it was read where that is not as it is written."""
    label = wanted.label
    if not label or wanted.stations or wanted.scan or wanted.fan or wanted.series:
        return [], []
    given = fresh.read_label(label, wanted.blades)
    read, kind = fresh.read_as(label, given.diameter_in, given.pitch_in), fresh.open_kind(label, wanted.blades)
    return [kind] * bool(kind), [read] * (read != label)


def _of_motor(fault: Fault, wanted: Wanted) -> Fault:
    """Fault of a speed that nobody typed: it comes from K_v and cells."""
    if wanted.motor is None or wanted.rpm is not None or fault.where != "operating.rpm":
        return fault
    speed = fault.got.replace(" with", " rev/min with", 1)
    got = f"{wanted.motor[0]:g} rev/min/V on {wanted.motor[1]} cells, that is {speed}"
    return replace(fault, file="", where="--kv, --cells", got=got, hint="Check both numbers")


@contextmanager
def temporary(files: Mapping[str, bytes]) -> Iterator[Case]:
    """Case of the files of a folder, as long as the folder is needed; faults name the files alone."""
    with tempfile.TemporaryDirectory() as made:
        for name, content in files.items():
            (Path(made) / name).write_bytes(content)
        try:
            yield load_case(made)
        except InputError as error:
            place = Path(made).as_posix() + "/"
            raise InputError([replace(f, file=f.file.removeprefix(place)) for f in error.faults]) from None


def checked(files: Mapping[str, bytes]) -> Case:
    """Check the files of a case together; the case of them, whose files are not there."""
    with temporary(files) as case:
        return case


def companions(case: Case) -> dict[str, bytes]:
    """Section files of a case, by name: coordinates and polars that another blade with its sections needs."""
    section = case.file.blade.section
    dat = () if section is None or section.dat is None else section.dat
    names = [*((dat,) if isinstance(dat, str) else dat), *(polar.file for polar in case.file.polars)]
    return {name: (case.folder / name).read_bytes() for name in names}


def free_folder(folder: Path, otherwise: str = "") -> None:
    """Refuse a folder that holds something; `otherwise`: what helps beside another one."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        got = f"a {'folder' if folder.is_dir() else 'file'} that already exists"
        raise InputError(Fault(folder.as_posix(), "", got, "a new folder", f"Choose --out DIR{otherwise}"))


def _as_written(wanted: Wanted, folder: Path) -> bool:
    """Whether a folder holds the same case without its motor, as this command wrote it: it may get one."""
    if wanted.motor is None or not folder.is_dir():
        return False
    before = _files(replace(wanted, kv=None, cells=None))
    there = {p.relative_to(folder).as_posix(): p for p in folder.rglob("*") if p.is_file()}
    return there.keys() == before.keys() and all(there[name].read_bytes() == before[name] for name in before)


def write_files(files: Mapping[str, bytes], folder: Path) -> None:
    """Write the files of a case into a new folder."""
    free_folder(folder)
    _put(files, folder)


def _put(files: Mapping[str, bytes], folder: Path) -> None:
    """Write files; case.toml last, so that what it names is there."""
    for name in sorted(files, key=lambda name: name == "case.toml"):
        write_atomic(folder / name, files[name])


def _broken(*rules: tuple[bool, str, str, str, str]) -> list[Fault]:
    """Faults of options: those rules of which the first entry is true."""
    return [Fault("", *words) for wrong, *words in rules if wrong]


def _faults(w: Wanted) -> list[Fault]:
    """What does not go together."""
    stations, scan = w.stations is not None, w.scan is not None
    drawn, alone = stations or scan, "--kv" if w.kv is not None else "--cells"
    nothing = w.label is None and not (drawn or (w.fan and w.diameter_mm))
    return [
        *_broken(
            (stations and scan, "--scan, --stations", "both", "one of them", ""),
            (nothing, "label, --stations", "neither", "one of them, or --scan", "As in: new 10x5"),
            (w.fan and drawn, "--fan", "together with a blade file", "--fan with the diameter as label",
             'Without --fan; then kind = "fan" and [duct] into the case (docs/duct.md)'),
            (scan and w.blades is not None, "--blades", f"{w.blades}", "nothing with --scan, which shows them", ""),
            (w.unit is not None and not scan, "--unit", f"{w.unit}", "nothing without --scan", ""),
        ),
        *_size_faults(w),
        *_broken(
            (w.reading is not None and (w.fan or drawn), "--reading", "without a label alone", "a label",
             "Write it into the case: reading under [blade.as_built]"),
            (w.kv is not None and scan, "--kv", "together with --scan", "a label or stations",
             "Write [drive] into the case"),
            ((w.kv is None) != (w.cells is None), alone, "alone", "--kv and --cells together", ""),
        ),
    ]  # fmt: skip


def _outermost(file: Path) -> tuple[float, str] | None:
    """Outermost radius of a table of stations [m] and its unit; None where it has none in a length."""
    with suppress(InputError):
        table = split_table(load_text(file), header=True, most_misfits=1.0)
        for j, text in enumerate(table.headings):
            if (column := column_of(j, text, 1.0)) and column.name == "r" and not column.share:
                r = table.numbers(j, decimal_mark(table))[0] * column.scale
                unit = "in" if abs(column.scale / INCH - 1.0) < 1e-9 else "mm"
                return (float(np.nanmax(r)), unit) if np.isfinite(r).any() else None
    return None


def _size_faults(w: Wanted) -> Iterator[Fault]:
    """Where a diameter is missing, out of range or said twice."""
    if w.diameter_mm is None:
        if w.stations is not None and fresh.label_or_name(w.label, None, Path(w.stations))[1]:
            expected, hint = "the diameter, with --stations", "Or the propeller's label"
            if reach := _outermost(Path(w.stations)):
                size = 2.0 * reach[0] / (INCH if reach[1] == "in" else 1e-3)
                hint = f"Is the outermost station the tip? --diameter-{reach[1]} {size:.5g}. {hint}"
            yield Fault("", "--diameter-mm", "nothing", expected, hint)
        return
    sized = w.stations is not None or w.fan
    if not sized or not 5.0 <= w.diameter_mm <= 10000.0:
        unit, one = ("in", 25.4) if w.inches else ("mm", 1.0)
        value, ends = w.diameter_mm / one, " to ".join(f"{end / one:.5g}" for end in (5.0, 10000.0))
        expected = f"{ends} {unit}" if sized else "nothing without --stations or --fan"
        hint = f"In m? Times {1e3 / one:.4g}" if sized and 5.0 <= value * 1e3 <= 1e4 else ""
        yield Fault("", f"--diameter-{unit}", f"{value:g}", expected, hint)
    if w.fan and _SIZE.fullmatch((w.label or "").strip()):
        yield Fault("label", "", repr(w.label), "a name, with --diameter-mm or --diameter-in")


def _files(w: Wanted) -> dict[str, bytes]:
    """Content of the folder by name."""
    if w.scan is not None:
        found, scale, _ = from_solid.find_stations(Path(w.scan), w.unit)
        name = fresh.case_name(w.label or Path(w.scan).stem)
        source = re.sub(r'["\\\n]', "_", Path(w.scan).name)
        texts = from_solid.case_files(found, scale, name, source, "scan", w.rpm, w.airspeed_m_s)
        return {name: text.encode() for name, text in texts.items()}
    if w.stations is not None:
        file = Path(w.stations)
        told, name = fresh.label_or_name(w.label, w.blades, file)
        D = (w.diameter_mm or 0.0) * 1e-3 if told is None or w.diameter_mm is not None else told.diameter_in * INCH
        hub, key, table = fresh.of_stations(file, D)
        blades = w.blades or (told.blades if told else None) or 2
        part = part_of(file)[1]  # of a workbook that sheet is kept, as text
        kept = f"{re.sub(r'[^A-Za-z0-9]+', '_', part)}.csv" if part else file.name
        held = load_text(file).text.encode() if part else file.read_bytes()
        text = fresh.stations_text(
            kept, D, blades, w.rpm, w.airspeed_m_s, hub, key, told, w.family, w.motor, name, table
        )
        return {kept: held, "case.toml": _called(w, text).encode()}
    return {"case.toml": _called(w, _label_text(w, w.label or "")).encode()}


def _called(w: Wanted, text: str) -> str:
    """Case file with the name that the user gave it."""
    given = w.label or ""
    sized = w.fan and w.diameter_mm is not None
    called = w.name or (given if sized or fresh.own_name(given) else w.folder if w.fan else "")
    name = fresh.case_name(called) if called else ""
    return re.sub(r'^name = ".*"$', f'name = "{name}"', text, count=1, flags=re.M) if name else text


def _label_text(w: Wanted, label: str) -> str:
    if not w.fan:
        try:
            fresh.read_label(label, w.blades)
        except InputError as error:
            raise fresh.or_a_fan(error, label) from None
        return fresh.label_text(label, w.blades, w.rpm, w.airspeed_m_s, w.family, w.motor, reading=w.reading)
    if w.diameter_mm is not None:
        return fresh.fan_text(w.diameter_mm * 1e-3, None, w.blades, w.rpm, w.motor)
    size = _SIZE.fullmatch(label.strip())
    if size is None:
        if "x" in label.lower():
            told = fresh.read_label(label, w.blades)
            blades = told.blades if (told.blades or 2) > 2 else w.blades
            return fresh.fan_text(told.diameter_in * INCH, told.pitch_in, blades, w.rpm, w.motor)
        raise InputError(Fault("label", "", repr(label), "a diameter, as in 70mm",
                               "A name goes with --diameter-mm or --diameter-in"))  # fmt: skip
    value = float(size[1])
    return fresh.fan_text(value * INCH if size[2] == "in" else value * 1e-3, None, w.blades, w.rpm, w.motor)
