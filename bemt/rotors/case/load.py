"""Case files: a TOML document with units in its key names becomes a rotor, a duct, air and operating points.

The models are in :mod:`bemt.rotors.case.schema`; objects are built in :mod:`bemt.rotors.case.build`, each once. A case
knows which of its values are *assumptions* (not given by the source) and the range of each.
"""

from __future__ import annotations

import copy
import hashlib
import os
import re
import shlex
import tomllib
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError, refuse
from bemt.base.toml import validated
from bemt.base.toml_text import Collector, load_toml
from bemt.rotors.case.as_built import CaseAsBuilt, as_built_of
from bemt.rotors.case.build import build_air, build_duct, build_rotor
from bemt.rotors.case.rules import check_case, check_shape, value_at
from bemt.rotors.case.schema import AXES, GROUPS, CaseFile
from bemt.rotors.case.unknowns import completed, out_of_place, replaced
from bemt.rotors.latents import AsBuilt, as_built

if TYPE_CHECKING:
    from bemt.physics.air import Air
    from geometry.duct import Duct
    from geometry.rotor import Rotor

FILE_NAME = "case.toml"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


T = TypeVar("T")
# Changed cases that a case keeps.
_MOST = 256


def _frozen(value: Any) -> Hashable | None:
    """Value of a key that tells equal values of different types apart; None for what is not plain."""
    if isinstance(value, (list, tuple)):
        parts = tuple(map(_frozen, value))
        return None if None in parts else (type(value).__name__, *parts)
    return (type(value).__name__, value) if isinstance(value, (bool, int, float, str)) else None


@dataclass(frozen=True)
class Assumption:
    """A value that the source of a case does not give."""

    key: str  # Dotted key in the case file
    nominal: Any  # Value used, in the unit of the key
    values: tuple[Any, ...]  # The ends of the range, or the discrete values that it may take
    discrete: bool  # Whether ``values`` are all values that it may take
    why: str  # Where nominal value and range come from

    @property
    def range_text(self) -> str:
        """The range as a user would write it.

        >>> Assumption("blade.pitch_mm", 110.0, (100.0, 120.0), False, "").range_text
        '100 .. 120'
        """
        words = [f"{v:g}" if isinstance(v, (int, float)) else str(v) for v in self.values]
        return (", " if self.discrete else " .. ").join(words)


@dataclass(frozen=True, eq=False)
class Case:
    """One validated case. :meth:`replaced` gives a new one; nothing else knows of changed values."""

    path: Path  # The case file
    written: Mapping[str, Any]  # The document as the file has it, without defaults
    file: CaseFile  # The same, typed, with defaults
    assumptions: tuple[Assumption, ...] = ()  # Declared unknowns
    unused: tuple[str, ...] = ()  # What the file declares and states as well, as sentences
    beside: tuple[Path, ...] = ()  # CFD runs elsewhere that count like those in its folder
    _built: dict[Any, Any] = field(default_factory=dict, repr=False)  # Shared by the cases that `replaced` gives
    _own: dict[Any, Any] = field(default_factory=dict, init=False, repr=False)  # Of this very case

    @property
    def name(self) -> str:
        """Name of the case, fit for a folder."""
        return self.file.name

    @property
    def title(self) -> str:
        """One line for people."""
        return self.file.title or self.name

    @property
    def folder(self) -> Path:
        """Folder that holds the case and its files."""
        return self.path.parent

    @property
    def kind(self) -> str:
        """``propeller`` or ``fan``."""
        return self.file.rotor.kind

    @property
    def ducted(self) -> bool:
        """Whether there is a duct."""
        return self.file.duct is not None

    @property
    def rpm(self) -> float:
        """Rotational speed. [rev/min]"""
        return self.file.operating.rpm

    @property
    def airspeed_m_s(self) -> float:
        """Speed of flight, against the wind that :attr:`angle_deg` turns. [m/s]"""
        return self.file.operating.airspeed_m_s

    @property
    def angle_deg(self) -> float:
        """Angle between wind and shaft. [deg]"""
        return self.file.operating.angle_deg

    def axial_only(self) -> None:
        """Refuse an angle between wind and shaft, for what knows axial flow only."""
        if self.angle_deg:
            hint = "sweep, estimate and the library's solve take an angle"
            expected = "0 deg: this knows axial flow only"
            fault = Fault(self.path.as_posix(), "operating.angle_deg", f"{self.angle_deg:g} deg", expected, hint)
            raise InputError(fault)

    @property
    def paired(self) -> bool:
        """Whether there is a second rotor on the axis."""
        return self.file.second_rotor is not None

    def one_rotor_only(self) -> None:
        """Refuse a second rotor, for what knows one rotor only."""
        if self.paired:
            hint = "sweep and the library's solve take a pair"
            raise InputError(Fault(self.path.as_posix(), "second_rotor", "two rotors", "one rotor here", hint))

    def second(self) -> Case:
        """Give the case of the second rotor: its blades and section tables; all else is that of the pair."""
        second = self.file.second_rotor
        assert second is not None  # the caller asks for a pair
        if second.label is None and second.case is None:
            written = {key: value for key, value in self.written.items() if key != "second_rotor"}
            file = self.file.model_copy(update={"second_rotor": None})
            return self.once("second", lambda: replace(self, written=written, file=file))

        def other() -> Case:
            try:
                if second.case is not None:
                    found = load_case(self.folder / second.case)
                else:
                    from bemt.rotors.case import fresh

                    found = case_of(fresh.label_text(str(second.label)), self.folder)
            except InputError as error:
                where = "second_rotor.label" if second.case is None else "second_rotor.case"
                raise InputError([
                    Fault(self.path.as_posix(), where, f"{f.file}: {f.where}: {f.got}".strip(": "), f.expected, f.hint)
                    for f in error.faults
                ]) from error  # fmt: skip
            if found.ducted or found.paired:
                got = "a rotor in a duct" if found.ducted else "a pair"
                raise InputError(Fault(self.path.as_posix(), "second_rotor", got, "one open rotor"))
            return found

        return self.once("second", other)

    @property
    def references_path(self) -> Path | None:
        """File of the recorded values, if the case names one."""
        name = self.file.references
        return None if name is None else self.folder / name

    @property
    def run_paths(self) -> tuple[Path, ...]:
        """CFD runs in the folder of the case and beside it: recorded values like those of the references.

        Files that ``bemt import --out`` writes, by what is in them; a study stands in place of the runs that it names.
        """
        own = sorted(self.folder.glob("*.toml")) if self.path.is_file() else []
        others = list({p.resolve(): p for p in (*self.beside, *own) if p != self.path}.values())
        if not others:
            return ()
        from bemt.data.readers.cfd_run import sniff

        runs = [p for p in others if sniff(p.read_bytes()[:4096])]
        named = {path.resolve() for run in runs for path in _exports(run)}
        return tuple(p for p in runs if p.resolve() not in named)

    @property
    def diameter_m(self) -> float:
        """Rotor diameter. [m]"""
        return self.file.rotor.diameter_m

    @property
    def hub_diameter_m(self) -> float:
        """Hub diameter. [m]"""
        return self.file.rotor.hub_diameter_m

    @property
    def stated_pitch_m(self) -> float:
        """Advance per turn that the case states, NaN where it states none. [m]"""
        return self.file.blade.pitch_m(self.diameter_m)

    def declared(self, keep: Callable[[str], bool]) -> list[dict[str, Any]]:
        """Entries [[assumptions]] as written, of the keys to keep."""
        return [item for item in self.written.get("assumptions", ()) if keep(item["key"])]

    def get(self, key: str, default: Any = None) -> Any:
        """Value at a dotted key such as ``blade.section.camber``; ``default`` where the case does not hold it."""
        value = value_at(self.file, key)
        return default if value is None else value

    def replaced(self, overrides: Mapping[str, Any] | None) -> Case:
        """Case with some values changed, by dotted key; keys of the same quantity in another unit are dropped."""
        if not overrides:
            return self
        given = tuple((key, _frozen(value)) for key, value in overrides.items())
        if any(value is None for _, value in given):
            return self._replaced(overrides)
        if len(self._own) > _MOST:
            self._own.clear()
        return self.once(("replaced", given), lambda: self._replaced(overrides))

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """Give what depends on nothing but this very case, made once."""
        if key not in self._own:
            self._own[key] = make()
        found: T = self._own[key]
        return found

    def _replaced(self, overrides: Mapping[str, Any]) -> Case:
        written = copy.deepcopy(dict(self.written))
        for key, value in overrides.items():
            table_name, _, name = key.rpartition(".")
            table = written
            for part in table_name.split(".") if table_name else ():
                table = table.setdefault(part, {})
            for group_table, names, _required in GROUPS:
                if group_table == table_name and name in names:
                    for other in names:
                        table.pop(other, None)
            table[name] = list(value) if isinstance(value, tuple) else value
            if key in ("air.altitude_m", "air.density_kg_m3"):
                table.pop("humidity_pct", None)
        out = Collector(self.path.as_posix())
        file = validated(CaseFile, written, out)
        if file is None:
            raise InputError(out.faults)
        return replace(self, written=written, file=file)

    def _once(self, what: str, parts: tuple[Any, ...], make: Callable[[Case], Any], overrides: Any) -> Any:
        """Build one object of the case, or take the one that was built of the same tables."""
        case = self.replaced(overrides)
        tables = [getattr(case.file, part) for part in parts]
        key = (what, *("" if table is None else table.model_dump_json() for table in tables))
        if key not in self._built:
            self._built[key] = make(case)
        return self._built[key]

    def kept(self, what: str, make: Callable[[], float]) -> float:
        """Give a number of the whole case, computed once."""
        key = (what, self.file.model_dump_json())
        if key not in self._built:
            self._built[key] = make()
        return float(self._built[key])

    def rotor(self, overrides: Mapping[str, Any] | None = None) -> Rotor:
        """Give the rotor, built once per geometry; overrides as in :meth:`replaced`."""
        rotor: Rotor = self._once(
            "rotor", ("rotor", "blade"), lambda case: build_rotor(case.file, case.path), overrides
        )
        return rotor

    def duct(self, overrides: Mapping[str, Any] | None = None) -> Duct | None:
        """Give the duct, None when the case has none; overrides as in :meth:`replaced`."""

        def make(case: Case) -> Duct | None:
            return build_duct(case.file, case.path, case.rotor())

        duct: Duct | None = self._once("duct", ("rotor", "blade", "duct"), make, overrides)
        return duct

    def stated_effects(self) -> tuple[AsBuilt, ...]:
        """Give the effect of what the case states of the rotor as built, if anything."""
        drawn = self.as_built().drawn
        return (as_built(drawn),) if drawn.any() else ()

    def as_built(self, counting_assumptions: bool = True) -> CaseAsBuilt:
        """Give what is known of the rotor as built, less what the declared assumptions move already."""
        told = self.file.blade.as_built
        if told is None or told.reading is None:
            return as_built_of(self.file, self.folder, self.rotor(), counting_assumptions)
        from bemt.rotors.case.reading import conditioned

        reading = told.reading
        found: CaseAsBuilt = self._once("as built", ("rotor", "blade"), lambda case: conditioned(case, reading), None)
        return found

    def air(self, overrides: Mapping[str, Any] | None = None) -> Air:
        """Give the state of the air; overrides as in :meth:`replaced`."""
        case = self.replaced(overrides)
        return case.once("air", lambda: build_air(case.file.air))

    def axes(self) -> dict[str, NDArray[np.float64]]:
        """Axes of the parameter sweep in the order of the file: name (with its unit) to values, (N,)."""
        made = self.file.sweep.axes()
        return {name: made[name] for name in self.written.get("sweep", {})}

    def axis_key(self, axis: str) -> str:
        """Dotted key that a sweep axis changes."""
        return AXES[axis]

    def files(self) -> list[Path]:
        """All files that the case names, itself first."""
        blade = self.file.blade
        dat = blade.section.dat if blade.section is not None else None
        names = [self.file.references, blade.stations, blade.uiuc, blade.apc]
        names += dat if isinstance(dat, tuple) else [dat]
        names += [polar.file for polar in self.file.polars]
        names += [blade.as_built.file] if blade.as_built is not None else []
        if self.file.second_rotor is not None and self.file.second_rotor.case is not None:
            names += [os.path.relpath(path, self.folder) for path in self.second().files()]
        named = [p for run in self.run_paths for p in (run, *_exports(run))]
        runs = [p for name in named for p in (name, *(_exports(name) if name not in self.run_paths else ()))]
        runs = [p for p in dict.fromkeys(runs) if p.is_file()]
        return [self.path, *(self.folder / name for name in names if name), *runs]

    def content_hash(self) -> str:
        """SHA-256 over the content of all files of the case; it does not depend on where the case lies."""
        digest = hashlib.sha256()
        for path in self.files():
            made_here = path == self.path and not path.exists()  # of a text, never a file
            data = repr(self.written).encode() if made_here else path.read_bytes()
            digest.update(f"{path.name}\0{len(data)}\0".encode() + data)
        return digest.hexdigest()


def _exports(run: Path) -> list[Path]:
    """Files of a CFD run; none where its run.toml cannot be read, which the sweep says."""
    from bemt.data.readers.cfd_run import read

    try:
        return [run.parent / name for name in read(run).files] if run.suffix == ".toml" else []
    except InputError:
        return []


def _assumptions(case: CaseFile) -> tuple[Assumption, ...]:
    from bemt.rotors.case.reading import SETTLED

    out, told = [], case.blade.as_built
    settled = SETTLED if told is not None and told.reading is not None else frozenset()
    for item in case.assumptions:
        if item.key in settled:
            continue
        values = item.values if item.values is not None else (item.low, item.high)
        out.append(Assumption(item.key, value_at(case, item.key), tuple(values), item.values is not None, item.why))
    return tuple(out)


def check_name(out: Collector, name: Any) -> None:
    """Check a name that becomes the name of a folder or file; no text, or an empty one, is a fault of the schema.

    >>> out = Collector("case.toml")
    >>> check_name(out, "8x5_v1.2"), check_name(out, "../8x5")
    (None, None)
    >>> [fault.got for fault in out.faults]
    ["'../8x5'"]
    """
    if isinstance(name, str) and name.strip() and not _NAME.fullmatch(name):
        out.add("name", repr(name), "letters, digits, dot, dash and underscore", "It names a folder of results")


def load_case(path: str | Path) -> Case:
    """Read and check a case file, or the one of a folder; its geometry has been built once."""
    path = Path(path)
    if path.is_dir():
        path = path / FILE_NAME
    out = Collector(path.as_posix())
    document = load_toml(path, out)
    if document is None:
        raise InputError(out.faults)
    return _checked(path, document, out)


def case_of(text: str, folder: str | Path = ".", ends: bool = True) -> Case:
    """Case of the text of a case file; files that it names are looked for in the folder. Raises as `load_case`.

    ``ends = False`` leaves out building the blade at the ends of sweeps and assumptions, for text that bemt wrote.
    """
    path = Path(folder) / FILE_NAME
    return _checked(path, tomllib.loads(text), Collector(path.as_posix()), ends)


def with_changes(case: Case, changes: Mapping[str, Any]) -> Case:
    """The case with values set by dotted key, completed and checked anew, as if its file said so."""
    written = copy.deepcopy(dict(case.written))

    def home(key: str) -> tuple[dict[str, Any], str]:
        *tables, name = key.split(".")
        table = written
        for part in tables:
            table = table.setdefault(part, {})
        return table, name

    for key in replaced(changes):
        table, name = home(key)
        table.pop(name, None)
    for key, value in changes.items():
        table, name = home(key)
        table[name] = value
    return replace(_checked(case.path, written, Collector(case.path.as_posix())), unused=case.unused)


def _checked(path: Path, document: dict[str, Any], out: Collector, ends: bool = True) -> Case:
    unused = tuple(f"the assumption about {key} is not used: the case states {said}; its block can be deleted"
                   for key, said in out_of_place(document).items())  # fmt: skip
    document = completed(document)
    file = check_case(out, document, path.parent)
    check_name(out, document.get("name"))
    if file is None or out.faults:
        raise InputError(out.faults)
    case = Case(path, document, file, _assumptions(file), unused)
    _check_build(case, ends)
    if case.paired:
        case.second()
    return case


def _check_build(case: Case, ends: bool) -> None:
    """Build everything once, nominal and at the ends of geometric sweeps and assumptions; raise all faults."""
    faults: list[Fault] = []

    def attempt(overrides: Mapping[str, Any] | None, place: str) -> None:
        found: Sequence[Fault] = ()
        if overrides:
            joined = Collector(case.path.as_posix())
            check_shape(joined, case.replaced(overrides).file)
            found = joined.faults
        try:
            if not found:
                case.rotor(overrides)
                case.duct(overrides)
        except InputError as error:
            found = error.faults
        for fault in found:
            where = f"{place}: {fault.where}" if place else fault.where
            faults.append(Fault(fault.file, where, fault.got, fault.expected, fault.hint))

    attempt(None, "")
    if ends and not faults:
        for name, values in case.axes().items():
            if name in ("pitch_in", "diameter_in", "tip_gap_mm"):
                for value in (values.min(), values.max()):
                    attempt({case.axis_key(name): float(value)}, f"sweep.{name} at {value:g}")
        for i, item in enumerate(case.assumptions):
            for option in item.values:
                attempt({item.key: option}, f"assumptions[{i}] at {option}")
    refuse(faults)


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sort key that counts digits as numbers."""
    return [(int(word), "") if word.isdigit() else (-1, word) for word in re.split(r"(\d+)", path.as_posix()) if word]


def find_cases(paths: Iterable[str | Path]) -> list[Path]:
    """Case files, each once, of files, folders with a case and folders of such; sorted, 8x5 before 10x5."""
    found: list[Path] = []
    faults: list[Fault] = []
    for item in map(Path, paths):
        if item.is_dir():
            here = (
                [item / FILE_NAME]
                if (item / FILE_NAME).is_file()
                else sorted(item.glob(f"*/{FILE_NAME}"), key=_natural)
            )
            if not here:
                hint = "`bemt new 10x5` writes one; stations.csv alone is not a case"
                faults.append(Fault(item.as_posix(), "", "no case", f"a folder with <name>/{FILE_NAME}", hint))
            found += here
        elif item.is_file() and item.suffix.lower() in (".csv", ".txt", ".dat", ".xlsx", ".stl", ".step", ".out"):
            solid = item.suffix.lower() in (".stl", ".step")
            hint = "`bemt lab stations` cuts one from a solid" if solid else "`bemt import` reads recordings"
            faults.append(Fault(item.as_posix(), "", f"a {item.suffix} file", "a case, case.toml or its folder", hint))
        elif item.is_file():
            found.append(item)
        else:
            hint = "Check the path"
            from geometry.common import GeometryError
            from geometry.designation import parse_designation

            with suppress(GeometryError):
                parse_designation(item.name if len(item.parts) == 1 else "")
                hint = f"A label? `bemt new {shlex.quote(item.as_posix())}` writes its case"
            fault = Fault(item.as_posix(), "", "no such file or folder", "a case file or a folder of cases", hint)
            faults.append(fault)
    refuse(faults)
    return list(dict.fromkeys(found))


def repeated_names(cases: Mapping[int, Case]) -> dict[int, Fault]:
    """Cases but the first that would write into one folder; case of letters does not tell names apart on some disks."""
    first: dict[str, str] = {}
    faults = {}
    for i, case in cases.items():
        file = case.path.as_posix()
        earlier = first.setdefault(case.name.casefold(), file)
        if earlier != file:
            faults[i] = Fault(file, "name", f"{case.name!r} as in {earlier}", "a unique name")
    return faults
