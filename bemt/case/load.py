"""Case files: a TOML document with units in its key names becomes a rotor, a duct, air and operating points.

The schema is in :mod:`bemt.case.schema`; objects are built in :mod:`bemt.case.build`. A case knows which of its values
are *assumptions* (not given by the source) and the range of each.
"""

from __future__ import annotations

import copy
import hashlib
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.errors import Fault, InputError
from bemt.base.toml import Collector, load_toml
from bemt.case.build import build_air, build_duct, build_rotor, check_build
from bemt.case.rules import check_case
from bemt.case.schema import AXES, DEFAULTS, GROUPS, INCH

if TYPE_CHECKING:
    from bemt.air import Air
    from geometry.duct import Duct
    from geometry.rotor import Rotor

__all__ = ["Assumption", "Case", "check_name", "find_cases", "load_case"]

FILE_NAME = "case.toml"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


@dataclass(frozen=True)
class Assumption:
    """A value that the source of a case does not give.

    Parameters
    ----------
    key : str
        Dotted key in the case file.
    nominal : float or str
        Value used, in the unit of the key.
    values : tuple
        The ends of the range, or the discrete values that it may take.
    discrete : bool
        Whether ``values`` are all values that it may take.
    why : str
        Where nominal value and range come from.
    """

    key: str
    nominal: Any
    values: tuple[Any, ...]
    discrete: bool
    why: str

    @property
    def range_text(self) -> str:
        """The range as a user would write it.

        Examples
        --------
        >>> Assumption("blade.pitch_mm", 110.0, (100.0, 120.0), False, "").range_text
        '100 .. 120'
        """
        words = [f"{v:g}" if isinstance(v, (int, float)) else str(v) for v in self.values]
        return (", " if self.discrete else " .. ").join(words)


@dataclass(frozen=True)
class Case:
    """One validated case.

    Parameters
    ----------
    path : Path
        The case file.
    document : dict
        Its content with defaults filled in; use :meth:`get` and :meth:`replaced`.
    assumptions : tuple of Assumption
        Declared unknowns.
    """

    path: Path
    document: Mapping[str, Any]
    assumptions: tuple[Assumption, ...]

    @property
    def name(self) -> str:
        """Name of the case, fit for a folder."""
        return str(self.document["name"])

    @property
    def title(self) -> str:
        """One line for people."""
        return str(self.document["title"]) or self.name

    @property
    def folder(self) -> Path:
        """Folder that holds the case and its files."""
        return self.path.parent

    @property
    def kind(self) -> str:
        """``propeller`` or ``fan``."""
        return str(self.document["rotor"]["kind"])

    @property
    def ducted(self) -> bool:
        """Whether there is a duct."""
        return "duct" in self.document

    @property
    def rpm(self) -> float:
        """Rotational speed. [rev/min]"""
        return float(self.document["operating"]["rpm"])

    @property
    def airspeed_m_s(self) -> float:
        """Axial speed of flight. [m/s]"""
        return float(self.document["operating"]["airspeed_m_s"])

    @property
    def references_path(self) -> Path | None:
        """File of the recorded values, if the case names one."""
        name = self.document.get("references")
        return None if name is None else self.folder / name

    @property
    def diameter_m(self) -> float:
        """Rotor diameter. [m]"""
        return self.length_m("rotor", "diameter")

    @property
    def hub_diameter_m(self) -> float:
        """Hub diameter. [m]"""
        ratio = self.document["rotor"].get("hub_ratio")
        return self.length_m("rotor", "hub_diameter") if ratio is None else float(ratio) * self.diameter_m

    def length_m(self, table: str, stem: str) -> float:
        """Length in metres of whichever of ``stem_in``, ``stem_mm``, ``stem_m`` is given, else NaN.

        Parameters
        ----------
        table : str
            Table of the case file.
        stem : str
            Key without its unit.

        Returns
        -------
        float
            The length. [m]
        """
        values = self.document.get(table, {})
        for suffix, factor in (("_in", INCH), ("_mm", 1e-3), ("_m", 1.0)):
            if stem + suffix in values:
                return float(values[stem + suffix]) * factor
        return math.nan

    def get(self, key: str, default: Any = None) -> Any:
        """Value at a dotted key.

        Parameters
        ----------
        key : str
            Such as ``blade.section.camber``.
        default : object
            Returned when the case does not hold the key.

        Returns
        -------
        object
            The value.
        """
        value: Any = self.document
        for part in key.split("."):
            if not isinstance(value, Mapping) or part not in value:
                return default
            value = value[part]
        return value

    def replaced(self, overrides: Mapping[str, Any] | None) -> Case:
        """Case with some values changed; keys of the same quantity in another unit are dropped.

        Parameters
        ----------
        overrides : mapping of str to object, or None
            Dotted key to new value.

        Returns
        -------
        Case
            A new case, or this one when nothing changes.
        """
        if not overrides:
            return self
        document = copy.deepcopy(dict(self.document))
        for key, value in overrides.items():
            table_name, _, name = key.rpartition(".")
            table = document
            for part in table_name.split(".") if table_name else ():
                table = table.setdefault(part, {})
            for group_table, names, _required in GROUPS:
                if group_table == table_name and name in names:
                    for other in names:
                        table.pop(other, None)
            table[name] = value
            if key in ("air.altitude_m", "air.density_kg_m3"):
                table.pop("humidity_pct", None)
        return replace(self, document=document)

    def rotor(self, overrides: Mapping[str, Any] | None = None) -> Rotor:
        """Build the rotor.

        Parameters
        ----------
        overrides : mapping, optional
            Changed values, as in :meth:`replaced`.

        Returns
        -------
        geometry.rotor.Rotor
            Blades, hub and rotation.
        """
        return build_rotor(self.replaced(overrides))

    def duct(self, overrides: Mapping[str, Any] | None = None) -> Duct | None:
        """Build the duct.

        Parameters
        ----------
        overrides : mapping, optional
            Changed values, as in :meth:`replaced`.

        Returns
        -------
        geometry.duct.Duct or None
            None when the case has no duct.
        """
        return build_duct(self.replaced(overrides))

    def air(self, overrides: Mapping[str, Any] | None = None) -> Air:
        """Build the state of the air.

        Parameters
        ----------
        overrides : mapping, optional
            Changed values, as in :meth:`replaced`.

        Returns
        -------
        bemt.air.Air
            Density, viscosity, speed of sound.
        """
        return build_air(self.replaced(overrides).document["air"])

    def axes(self) -> dict[str, NDArray[np.float64]]:
        """Axes of the parameter sweep, in the order of the file.

        Returns
        -------
        dict of str to (N,) float
            Axis name (with its unit) to values.
        """
        out: dict[str, NDArray[np.float64]] = {}
        for name, axis in self.document.get("sweep", {}).items():
            if isinstance(axis, Mapping):
                out[name] = np.linspace(float(axis["start"]), float(axis["stop"]), int(axis["num"]))
            else:
                out[name] = np.array(axis, dtype=float)
        return out

    def axis_key(self, axis: str) -> str:
        """Dotted key that a sweep axis changes.

        Parameters
        ----------
        axis : str
            Axis name.

        Returns
        -------
        str
            Dotted key.
        """
        return AXES[axis]

    def files(self) -> list[Path]:
        """All files that the case names, itself first.

        Returns
        -------
        list of Path
            Existing files.
        """
        names = [self.document.get("references"), *(self.get(f"blade.{k}") for k in ("stations", "uiuc", "apc"))]
        dat = self.get("blade.section.dat")
        names += dat if isinstance(dat, list) else [dat]
        names += [polar["file"] for polar in self.document.get("polars", [])]
        return [self.path, *(self.folder / name for name in names if name)]

    def content_hash(self) -> str:
        """SHA-256 over the content of all files of the case.

        Returns
        -------
        str
            Hexadecimal digest; it does not depend on where the case lies.
        """
        digest = hashlib.sha256()
        for path in self.files():
            data = path.read_bytes()
            digest.update(f"{path.name}\0{len(data)}\0".encode() + data)
        return digest.hexdigest()


def _with_defaults(document: Mapping[str, Any]) -> dict[str, Any]:
    filled = copy.deepcopy(dict(document))
    for table, values in DEFAULTS.items():
        target: Any = filled
        for part in table.split(".") if table else ():
            if part not in target:
                if table == "blade.section":
                    target = None
                    break
                target[part] = {}
            target = target[part]
        if target is not None:
            for key, value in values.items():
                target.setdefault(key, copy.deepcopy(value))
    return filled


def _assumptions(document: Mapping[str, Any], filled: Case) -> tuple[Assumption, ...]:
    out = []
    for item in document.get("assumptions", []):
        discrete = "values" in item
        values: Sequence[Any] = item["values"] if discrete else (item["low"], item["high"])
        out.append(Assumption(item["key"], filled.get(item["key"]), tuple(values), discrete, item["why"]))
    return tuple(out)


def check_name(out: Collector, name: Any) -> None:
    """Check a name that becomes the name of a folder or file; add what is wrong to the collector.

    Parameters
    ----------
    out : Collector
        Receives the fault.
    name : object
        Value of the key ``name``; what is no text, or empty, is a fault of the schema and none here.

    Examples
    --------
    >>> out = Collector("case.toml")
    >>> check_name(out, "8x5_v1.2"), check_name(out, "../8x5")
    (None, None)
    >>> [fault.got for fault in out.faults]
    ["'../8x5'"]
    """
    if isinstance(name, str) and name.strip() and not _NAME.fullmatch(name):
        out.add("name", repr(name), "letters, digits, dot, dash and underscore", "It names a folder of results")


def load_case(path: str | Path) -> Case:
    """Read and check a case file.

    Parameters
    ----------
    path : str or Path
        ``case.toml``, or the folder that holds it.

    Returns
    -------
    Case
        The validated case; its geometry has been built once.

    Raises
    ------
    InputError
        With every fault of the file.
    """
    path = Path(path)
    if path.is_dir():
        path = path / FILE_NAME
    out = Collector(path.as_posix())
    document = load_toml(path, out)
    if document is None:
        raise InputError(out.faults)
    check_case(out, document, path.parent)
    check_name(out, document.get("name"))
    if out.faults:
        raise InputError(out.faults)
    bare = Case(path, _with_defaults(document), ())
    case = replace(bare, assumptions=_assumptions(document, bare))
    check_build(case)
    return case


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sort key that counts digits as numbers."""
    return [(int(word), "") if word.isdigit() else (-1, word) for word in re.split(r"(\d+)", path.as_posix()) if word]


def find_cases(paths: Iterable[str | Path]) -> list[Path]:
    """Case files below the given folders.

    Parameters
    ----------
    paths : iterable of str or Path
        Case files, folders with a ``case.toml``, or folders of such folders.

    Returns
    -------
    list of Path
        Case files, sorted within each folder (8x5 before 10x5), each once.

    Raises
    ------
    InputError
        When a path does not exist or holds no case.
    """
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
                faults.append(Fault(item.as_posix(), "", "no case", f"a folder with <name>/{FILE_NAME}"))
            found += here
        elif item.is_file():
            found.append(item)
        else:
            faults.append(
                Fault(item.as_posix(), "", "nothing there", "a case file or a folder of cases", "Check the path")
            )
    if faults:
        raise InputError(faults)
    return list(dict.fromkeys(found))


def repeated_names(cases: Mapping[int, Case]) -> dict[int, Fault]:
    """Find cases that would write into the folder of another one.

    Parameters
    ----------
    cases : mapping of int to Case
        Cases by any number, in order.

    Returns
    -------
    dict of int to Fault
        Every case but the first of a name; names that differ in case alone are one folder on some disks.
    """
    first: dict[str, str] = {}
    faults = {}
    for i, case in cases.items():
        file = case.path.as_posix()
        earlier = first.setdefault(case.name.casefold(), file)
        if earlier != file:
            faults[i] = Fault(file, "name", f"{case.name!r} as in {earlier}", "a name of its own")
    return faults
