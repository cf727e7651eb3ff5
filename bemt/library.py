"""What `import bemt` offers: propellers and fans, their curves, recordings, diagnoses, drives.

Every function here takes and gives plain things: a label or a file, numbers in the unit of their name, a
:class:`bemt.dataset.Dataset` out. Nothing prints; bad input raises :class:`bemt.base.errors.InputError`, which says
file, place and remedy.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.errors import Fault, InputError
from bemt.case import Case, case_of, find_cases, fresh, load_case
from bemt.dataset import Dataset, from_pandas

if TYPE_CHECKING:
    import pandas as pd

    from bemt.air import Air
    from bemt.diagnose.chain import Diagnosis
    from bemt.diagnose.contrast import Contrast
    from bemt.diagnose.record import Record
    from bemt.drive.from_label import DriveEstimate

__all__ = ["Answer", "Propeller", "compare", "diagnose", "drive", "load", "propeller", "read", "validate"]

Array = NDArray[np.float64]
CHANNELS = (
    "rpm", "airspeed_m_s", "density_kg_m3", "J", "thrust_N", "torque_Nm", "power_W", "CT", "CP", "eta", "M_tip",
)  # fmt: skip
DUCTED = ("rotor_thrust_N", "duct_thrust_N", "stator_thrust_N", "exhaust_speed_m_s", "duct_share")
RPM_MAX, AIRSPEED_MAX = 300000.0, 300.0  # as in a case file [rev/min], [m/s]
BANDED = ("thrust_N", "torque_Nm", "power_W", "CT", "CP", "eta")


@dataclass(frozen=True, eq=False)
class Propeller:
    """A propeller or fan that can be solved; :func:`propeller` and :func:`load` make one.

    Parameters
    ----------
    case : bemt.case.Case
        Geometry, air, model and declared unknowns.
    text : str
        The case as a file has it, which :meth:`write` writes.

    Examples
    --------
    >>> p = propeller("10x5")
    >>> p.diameter_m, p.blades
    (0.254, 2)
    """

    case: Case
    text: str

    def __repr__(self) -> str:
        """Say what it is in a line."""
        kind = "fan" if self.case.ducted else "propeller"
        return f"<{kind} {self.name}: {self.diameter_m:.4g} m, {self.blades} blades, {len(self.unknowns)} unknowns>"

    @property
    def name(self) -> str:
        """Name of its case."""
        return self.case.name

    @property
    def diameter_m(self) -> float:
        """Diameter. [m]"""
        return self.case.diameter_m

    @property
    def blades(self) -> int:
        """Number of blades."""
        return int(self.case.file.rotor.blades)

    @property
    def unknowns(self) -> dict[str, str]:
        """Declared unknowns and their ranges; bands come from these."""
        return {item.key: item.range_text for item in self.case.assumptions}

    def solve(
        self, rpm: ArrayLike | None = None, airspeed_m_s: ArrayLike | None = None, *, J: ArrayLike | None = None,
        density_kg_m3: float | None = None, bands: bool = True,
    ) -> Dataset:  # fmt: skip
        """Solve operating points one by one.

        Parameters
        ----------
        rpm : array_like, optional
            Speed of rotation; the case's by default. [rev/min]
        airspeed_m_s : array_like, optional
            Axial speed; the case's by default. Broadcast with `rpm`. [m/s]
        J : array_like, optional
            Advance ratio V/(n D) instead of `airspeed_m_s`. [-]
        density_kg_m3 : float, optional
            Of the air; the case's by default. [kg/m3]
        bands : bool
            Also move every declared unknown through its range: the standard uncertainty of what comes out.

        Returns
        -------
        Dataset
            Kind ``bemt``. A point without a solution is NaN and flagged, never zero.

        Raises
        ------
        InputError
            When both `airspeed_m_s` and `J` are given, or numbers are not finite.

        Examples
        --------
        >>> d = propeller("10x5").solve(rpm=[6000, 9000])
        >>> d.thrust_N.round(1), d.power_W.round(0)
        (array([ 5.1, 11.7]), array([ 49., 169.]))
        """
        n, V = self._conditions(rpm, airspeed_m_s, J)
        density = None if density_kg_m3 is None else float(_numbers("density_kg_m3", density_kg_m3))
        air = self.case.air(None if density is None else {"air.density_kg_m3": density})
        values, flags, u_model = _solved(self.case, n, V, air, bands)
        variance = {key: np.zeros(n.size) for key in BANDED}
        if bands:
            from bemt.compare.sweep.case import spread

            for item in self.case.assumptions:
                at = [values if v == item.nominal else _solved(self.case.replaced({item.key: v}), n, V, air)[0]
                      for v in item.values]  # fmt: skip
                for key in BANDED:
                    variance[key] += spread(item.discrete, values[key], [run[key] for run in at]) ** 2
        parts: dict[str, dict[str, Array]] = {"model": u_model} if bands else {}
        if bands and self.case.assumptions:
            parts["input"] = {key: np.sqrt(v) for key, v in variance.items() if key in u_model}
        notes = ("bands, one standard deviation: declared unknowns (input), real rotors against BEMT (model)",)
        about = {"source": "bemt", "file": self.case.path.as_posix()}
        return Dataset("bemt", self.name, values, flags=flags, provenance=about, u_by=parts,
                       notes=notes if bands else ())  # fmt: skip

    def curve(
        self, rpm: ArrayLike | None = None, J: ArrayLike | None = None, *, airspeed_m_s: ArrayLike | None = None,
        density_kg_m3: float | None = None, bands: bool = True,
    ) -> Dataset:  # fmt: skip
        """Solve every speed of rotation with every advance ratio or airspeed.

        Parameters
        ----------
        rpm : array_like, optional
            Speeds of rotation; the case's by default. [rev/min]
        J : array_like, optional
            Advance ratios; 0 to 0.9 when neither these nor `airspeed_m_s` are given. [-]
        airspeed_m_s : array_like, optional
            Airspeeds instead. [m/s]
        density_kg_m3 : float, optional
            Of the air. [kg/m3]
        bands : bool
            As for :meth:`solve`.

        Returns
        -------
        Dataset
            One point for each pair, the speeds of rotation outermost.

        Examples
        --------
        >>> d = propeller("10x5").curve(rpm=6000, J=[0.0, 0.3, 0.6])
        >>> bool(d.u["CT"][0] > 0), d.CT.round(2)
        (True, array([0.1 , 0.07, 0.01]))
        """
        given = J is not None or airspeed_m_s is not None
        n = np.atleast_1d(_numbers("rpm", self.case.rpm if rpm is None else rpm))
        x = np.linspace(0.0, 0.9, 19)
        if given:
            x = np.atleast_1d(_numbers("airspeed_m_s", airspeed_m_s) if J is None else _numbers("J", J))
        a, b = (v.ravel() for v in np.meshgrid(n, x, indexing="ij"))
        speed: dict[str, Any] = {"airspeed_m_s": b} if airspeed_m_s is not None and J is None else {"J": b}
        if J is not None and airspeed_m_s is not None:
            speed = {"J": b, "airspeed_m_s": airspeed_m_s}  # refused below
        return self.solve(a, density_kg_m3=density_kg_m3, bands=bands, **speed)

    def replaced(self, changes: Mapping[str, Any]) -> Propeller:
        """Set values of the case; one that was a declared unknown is known then.

        Parameters
        ----------
        changes : mapping
            Dotted key, as in a case file, to value: ``{"blade.pitch_in": 6}``.

        Returns
        -------
        Propeller
            A new one.

        Examples
        --------
        >>> p = propeller("10x5")
        >>> steeper = p.replaced({"blade.pitch_in": 7})
        >>> bool(steeper.solve(6000, bands=False).thrust_N > p.solve(6000, bands=False).thrust_N)
        True
        """
        import tomlkit

        given: object = changes
        if not isinstance(given, Mapping):
            expected = "a mapping of dotted keys to values"
            raise InputError(Fault("", "changes", repr(changes), expected, 'As in {"blade.pitch_in": 6}'))
        written = dict(self.case.replaced(changes).written)
        unknowns = [item for item in written.pop("assumptions", []) if item["key"] not in changes]
        text = tomlkit.dumps(written | ({"assumptions": unknowns} if unknowns else {}))
        return Propeller(case_of(text, self.case.folder), text)

    def write(self, folder: str | os.PathLike[str]) -> Path:
        """Write the case into a new folder, for the command line.

        Parameters
        ----------
        folder : str or path
            Where ``case.toml`` goes; it must not hold one.

        Returns
        -------
        Path
            The file.
        """
        from bemt.base.errors import system_fault
        from bemt.base.tables import write_atomic

        file = Path(_path("folder", folder)) / "case.toml"
        if file.exists():
            raise InputError(Fault(file.as_posix(), "", "a file that is there", "a new folder"))
        try:
            write_atomic(file, self.text)
        except OSError as error:
            raise InputError(system_fault(error)) from error
        return file

    def _conditions(self, rpm: Any, airspeed_m_s: Any, J: Any) -> tuple[Array, Array]:
        faults = []
        if J is not None and airspeed_m_s is not None:
            faults.append(Fault("", "J, airspeed_m_s", "both", "one of them"))
        given = {"rpm": rpm, "airspeed_m_s": airspeed_m_s, "J": J}
        numbers: dict[str, Array] = {}
        for name, value in given.items():
            if value is None:
                continue
            try:
                numbers[name] = _numbers(name, value)
            except InputError as error:
                faults += error.faults
        if "rpm" in numbers and np.any(numbers["rpm"] <= 0.0):
            faults.append(Fault("", "rpm", f"{np.min(numbers['rpm']):g}", "speeds above 0 rev/min", "Drop the sign?"))
        elif "rpm" in numbers and np.any(numbers["rpm"] > RPM_MAX):
            faults.append(Fault("", "rpm", f"{np.max(numbers['rpm']):g}", f"up to {RPM_MAX:g} rev/min"))
        fast = np.max(np.abs(numbers.get("airspeed_m_s", np.zeros(1))))
        if fast > AIRSPEED_MAX:
            hint = "km/h? Divide by 3.6"
            faults.append(Fault("", "airspeed_m_s", f"{fast:g}", f"up to {AIRSPEED_MAX:g} m/s", hint))
        shapes = {name: value.shape for name, value in numbers.items()}
        try:
            np.broadcast_shapes(*shapes.values())
        except ValueError:
            got = ", ".join(f"{value.size} of {name}" for name, value in numbers.items())
            faults.append(Fault("", ", ".join(shapes), got, "as many of each, or one", "curve() takes every pair"))
        if faults:
            raise InputError(faults)
        n = numbers.get("rpm", np.asarray(self.case.rpm, dtype=float))
        if J is not None:
            V = numbers["J"] * n / 60.0 * self.diameter_m
        else:
            V = numbers.get("airspeed_m_s", np.asarray(self.case.airspeed_m_s, dtype=float))
        n, V = np.broadcast_arrays(n, V)
        return np.atleast_1d(n).astype(float).ravel(), np.atleast_1d(V).astype(float).ravel()


def _numbers(name: str, value: Any) -> Array:
    """Finite numbers, one or more, of what somebody hands over."""
    try:
        found = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(Fault("", name, repr(value), "a number, or several")) from None
    if not found.size:
        raise InputError(Fault("", name, "no number", "one or more"))
    if not np.all(np.isfinite(found)):
        raise InputError(Fault("", name, "a number that is not finite", "finite numbers"))
    return found


def _path(name: str, value: Any) -> str:
    """Path as text; anything else is refused."""
    if isinstance(value, (str, os.PathLike)) and os.fspath(value):
        return os.fspath(value)
    raise InputError(Fault("", name, f"{type(value).__name__} {value!r:.40}", "the path of a file or folder"))


def _solved(
    case: Case, rpm: Array, V: Array, air: Air, bands: bool = False
) -> tuple[dict[str, Array], tuple[tuple[str, ...], ...], dict[str, Array]]:
    """Channels, flags and the model's own uncertainty of points: the one place where this face meets the solver."""
    from bemt.case.prepare import prepare_case

    model = prepare_case(case)
    found = model.solve(rpm, V, air)
    flags = found.flags
    more = DUCTED if case.ducted else ()
    u: dict[str, Array] = {}
    if bands:
        from bemt.compare.sweep.model_error import beyond, u_model

        u = {key: value for key, value in u_model(case, model, found, air).items() if key in BANDED}
        wider = beyond(case, found)[1]
        flags = tuple((*f, *filter(None, [w])) for f, w in zip(flags, wider, strict=True))
    return {key: np.asarray(found[key], dtype=float) for key in (*CHANNELS, *more)}, flags, u


def propeller(
    label: str | None = None, *, stations: str | os.PathLike[str] | None = None, diameter_m: float | None = None,
    blades: int | None = None, rpm: float | None = None, airspeed_m_s: float = 0.0,
) -> Propeller:  # fmt: skip
    """Make a propeller of a label, or of a file of blade stations.

    Parameters
    ----------
    label : str, optional
        Diameter x pitch in inches, blades if not two: ``"10x5"``, ``"8x4.5x3"``.
    stations : str or path, optional
        Instead of the label: a CSV with ``r_over_R,chord_over_R,beta_deg``, a geometry file of the UIUC database or
        an APC PE0 file.
    diameter_m : float, optional
        With `stations`: diameter. [m]
    blades : int, optional
        Number of blades; 2 unless the label says.
    rpm : float, optional
        Speed at which :meth:`Propeller.solve` works when it is told none. [rev/min]
    airspeed_m_s : float
        The same for the airspeed. [m/s]

    Returns
    -------
    Propeller
        What is not known is a declared unknown with its range, see :attr:`Propeller.unknowns`.

    Raises
    ------
    InputError
        For an unreadable label or file, or numbers that make no propeller.

    Examples
    --------
    >>> propeller("8x4.5x3").blades
    3
    >>> propeller("10 by 5")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: LABEL: '10 by 5': got unreadable text; expected ...
    """
    faults = []
    if (label is None) == (stations is None):
        got = "neither" if label is None else "both"
        faults.append(Fault("", "label, stations", got, "one of them", 'As in propeller("10x5")'))
    if stations is not None and diameter_m is None:
        faults.append(Fault("", "diameter_m", "nothing", "the diameter [m] beside stations"))
    name: object = label
    if name is not None and not isinstance(name, str):
        faults.append(Fault("", "label", repr(label), "a text: diameter x pitch in inches", 'As in propeller("10x5")'))
    if blades is not None and not (isinstance(blades, (int, np.integer)) and blades >= 1):
        faults.append(Fault("", "blades", repr(blades), "a whole number of 1 or more"))
    if stations is not None:
        stations = _path("stations", stations)
    rpm = None if rpm is None else float(_numbers("rpm", rpm))
    airspeed_m_s = float(_numbers("airspeed_m_s", airspeed_m_s))
    diameter_m = None if diameter_m is None else float(_numbers("diameter_m", diameter_m))
    if diameter_m is not None and not 0.01 <= diameter_m <= 10.0:
        hint = "Is that in mm? Divide by 1000" if 10.0 < diameter_m <= 1e4 else ""
        faults.append(Fault("", "diameter_m", f"{diameter_m:g}", "0.01 to 10 m", hint))
    if label is not None and diameter_m is not None:
        faults.append(Fault("", "diameter_m", f"{diameter_m:g}", "nothing beside a label, which states it"))
    if faults:
        raise InputError(faults)
    if label is not None:
        text = fresh.label_text(label, blades, rpm, airspeed_m_s)
        return Propeller(case_of(text), text)
    assert stations is not None and diameter_m is not None
    file = Path(stations)
    text = fresh.stations_text(file.name, diameter_m, blades or 2, rpm, airspeed_m_s, *fresh.of_stations(file))
    return Propeller(case_of(text, file.parent), text)


def load(path: str | os.PathLike[str]) -> Propeller:
    """Read a case.

    Parameters
    ----------
    path : str or path
        ``case.toml`` or its folder.

    Returns
    -------
    Propeller
        The propeller or fan of the case.

    Raises
    ------
    InputError
        With every fault of the file.

    Examples
    --------
    >>> load("no/such/folder")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no/such/folder: got nothing there; expected ...
    """
    files = find_cases([_path("path", path)])
    if len(files) != 1:
        raise InputError(Fault(os.fspath(path), "", f"{len(files)} cases", "one case", "Name its folder"))
    case = load_case(files[0])
    return Propeller(case, case.path.read_text(encoding="utf-8-sig"))


def read(path: str | os.PathLike[str], format: str | None = None) -> Dataset:  # noqa: A002
    """Read a recording: a bench log, a table, an export of CFD, a vendor's file.

    Parameters
    ----------
    path : str or path
        The file.
    format : str, optional
        Name of the reader; found by content by default.

    Returns
    -------
    Dataset
        Steady points of a log; the rows of a table of points; one point of means of a CFD history. ``notes`` say what
        was decided on the way and what looks wrong; nothing suspicious is corrected.

    Raises
    ------
    InputError
        When the file is not understood, with the line to write.
    """
    from bemt.recordings.load import as_dataset, import_file

    return as_dataset(import_file(_path("path", path), format))


@dataclass(frozen=True, eq=False)
class Answer:
    """What a diagnosis says; :func:`diagnose` makes one.

    Parameters
    ----------
    diagnosis : bemt.diagnose.chain.Diagnosis
        All of it.
    propeller : Propeller
        What was compared with the recording.
    """

    diagnosis: Diagnosis
    propeller: Propeller

    def __repr__(self) -> str:
        """Say the verdict in a line."""
        return f"<answer on {self.propeller.name}: {' '.join((self.verdict, ', '.join(self.effects))).strip()}>"

    @property
    def verdict(self) -> str:
        """One of none, named, class, sensor, unknown, insufficient."""
        return self.diagnosis.decision.verdict

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects of the verdict; of a class all members."""
        return self.diagnosis.decision.effects

    @property
    def text(self) -> str:
        """The answer in words, as the command line prints it."""
        from bemt.diagnose.document import text

        return text(self.diagnosis)

    @property
    def improved(self) -> Propeller | None:
        """The propeller with what was found switched on; None when nothing that can be simulated was named."""
        from bemt.diagnose.improve import improved_case

        text = improved_case(self.diagnosis, self.propeller.case, self.propeller.text)
        return Propeller(case_of(text, self.propeller.case.folder), text) if text else None

    def to_dict(self) -> dict[str, Any]:
        """Give the answer as plain values.

        Returns
        -------
        dict
            Schema ``bemt.diagnosis/1``.
        """
        from bemt.diagnose.document import document

        return document(self.diagnosis)

    def plot(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Draw the figures of the answer.

        Parameters
        ----------
        folder : str or path
            Where the PNG files go.

        Returns
        -------
        list of Path
            The files.
        """
        from bemt.base.errors import system_fault
        from bemt.diagnose import figures

        try:
            return figures.draw(self.diagnosis, Path(_path("folder", folder)))
        except OSError as error:
            raise InputError(system_fault(error)) from error


def diagnose(
    recording: str | os.PathLike[str] | Dataset | pd.DataFrame | Sequence[Any], propeller: Propeller | str, *,
    reference: str | os.PathLike[str] | Dataset | pd.DataFrame | Sequence[Any] | None = None,
    only: Sequence[str] | None = None, progress: Callable[[str], None] | None = None,
) -> Answer:  # fmt: skip
    """Say what physics was left out where a recording and the simulation differ.

    Parameters
    ----------
    recording : path, Dataset, DataFrame, or sequence of these
        What was measured; columns of a frame carry units (``thrust_N``, ``thrust_gf``, ``torque_Nm``).
    propeller : Propeller or str
        What it was measured on; a label or a case will do.
    reference : path, Dataset, DataFrame, or sequence of these, optional
        Recordings of the same stand without the cause in question: how far model and stand differ anyway.
    only : sequence of str, optional
        Consider these effects only.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Answer
        ``.verdict``, ``.effects``, ``.text``, ``.plot(folder)``, ``.improved``.

    Raises
    ------
    InputError
        For recordings without a load, and effects that nobody knows.
    """
    from dataclasses import replace

    from bemt.diagnose import load as loading
    from bemt.diagnose import record as records
    from bemt.diagnose.chain import diagnose as run

    rotor = _propeller(propeller)

    def record(given: Any) -> Record:
        if isinstance(given, (str, os.PathLike)):
            return loading.load(os.fspath(given), rotor.case)
        if not isinstance(given, Dataset) and not hasattr(given, "columns"):
            expected = "a path, a Dataset or a DataFrame"
            raise InputError(Fault("", "recording", f"{type(given).__name__} {given!r:.40}", expected))
        table = given if isinstance(given, Dataset) else from_pandas(given)
        return records.from_series(table, rotor.case)

    only = [only] if isinstance(only, str) else only
    loading.check_effects(only or ())
    if not _several(recording):
        raise InputError(Fault("", "recording", "none", "one or more"))
    loaded = [record(given) for given in _several(recording)]
    loaded += [replace(record(given), reference=True) for given in _several(reference)]
    return Answer(run(loaded, [rotor.case], list(only) if only else None, progress), rotor)


def _several(given: Any) -> list[Any]:
    return [] if given is None else list(given) if isinstance(given, (list, tuple)) else [given]


def _propeller(given: Propeller | str | os.PathLike[str]) -> Propeller:
    """Propeller as it is, of a case, or of a label."""
    if isinstance(given, Propeller):
        return given
    what: object = given
    if not isinstance(what, (str, os.PathLike)):
        expected = "a Propeller, a case or a label"
        raise InputError(Fault("", "propeller", f"{type(given).__name__} {given!r:.40}", expected))
    text = os.fspath(given)
    if Path(text).exists() or text.endswith(".toml") or "/" in text:
        return load(text)
    return propeller(text)


def drive(
    propeller: Propeller | str, *, kv: float, cells: int, mass_kg: float | None = None, rotors: int = 1,
    capacity_Ah: float | None = None, airspeed_m_s: float = 0.0,
) -> DriveEstimate:  # fmt: skip
    """Estimate what a motor makes of a propeller when its K_v and the battery are all that is known.

    Parameters
    ----------
    propeller : Propeller or str
        Propeller, case or label.
    kv : float
        Speed constant of the motor. [rev/min/V]
    cells : int
        LiPo cells in series.
    mass_kg : float, optional
        Of the vehicle, for the hover point. [kg]
    rotors : int
        That carry it and share the battery.
    capacity_Ah : float, optional
        Of the battery, for the time aloft. [A h]
    airspeed_m_s : float
        Speed of flight. [m/s]

    Returns
    -------
    bemt.drive.from_label.DriveEstimate
        ``.full``, ``.hover``, ``.text``, ``.to_dict()``; every number with its band.

    Raises
    ------
    InputError
        For impossible numbers.

    Examples
    --------
    >>> d = drive("10x5", kv=1000, cells=3)
    >>> bool(7.0 < d.full["thrust_N"].value < 13.0)
    True
    """
    from bemt.drive import from_label

    for name, value in (("kv", kv), ("cells", cells), ("mass_kg", mass_kg), ("rotors", rotors),
                        ("capacity_Ah", capacity_Ah), ("airspeed_m_s", airspeed_m_s)):  # fmt: skip
        if value is not None and (isinstance(value, bool) or not isinstance(value, (int, float, np.number))):
            raise InputError(Fault("", name, repr(value), "a number"))
    return from_label.estimate(_propeller(propeller).case, kv, cells, mass_kg, rotors, capacity_Ah, airspeed_m_s)


def compare(
    a: str | os.PathLike[str], b: str | os.PathLike[str], *, case: str | os.PathLike[str] | None = None,
    diameter_m: float | None = None,
) -> Contrast:  # fmt: skip
    """Say what changed between two recordings of one stand.

    Parameters
    ----------
    a, b : str or path
        Recordings before and after, or without and with.
    case : str or path, optional
        The rotor: `b` is then diagnosed with `a` as its reference.
    diameter_m : float, optional
        Of the rotor where there is no case, for the advance ratio. [m]

    Returns
    -------
    bemt.diagnose.contrast.Contrast
        ``.document`` is the answer as ``bemt.comparison/1``.

    Raises
    ------
    InputError
        For files that are no recordings, or have no point in common.
    """
    from bemt.diagnose import contrast

    diameter = contrast.label_diameter(None) if diameter_m is None else float(_numbers("diameter_m", diameter_m))
    if diameter_m is not None and not 0.01 <= diameter_m <= 10.0:
        raise InputError(Fault("", "diameter_m", f"{diameter_m:g}", "0.01 to 10 m", "Is that in mm? Divide by 1000"))
    known = None if case is None else _path("case", case)
    return contrast.compare(_path("a", a), _path("b", b), known, diameter_m=diameter)


def validate(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """Compare BEMT with a folder of measured propellers in the layout of the UIUC database.

    Parameters
    ----------
    folder : str or path
        The folder, or ``"uiuc"`` for the data found.

    Returns
    -------
    dict
        Schema ``bemt.validation/1``.

    Raises
    ------
    InputError
        When it holds no propeller that can be compared.
    """
    from bemt.compare.validate import propellers

    return propellers.validate(propellers.where(_path("folder", folder)))
