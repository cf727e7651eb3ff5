"""Functions of the public API: read, diagnose, compare, drive, validate."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.app.library.given import in_words_of_the_library, number, path_text
from bemt.app.library.rotors import Propeller, rotor_of
from bemt.base.errors import Fault, InputError
from bemt.base.face import as_html
from bemt.physics.dataset import Dataset, from_pandas
from bemt.rotors.case import case_of

if TYPE_CHECKING:
    import pandas as pd

    from bemt.judge.diagnose.answer import Diagnosis
    from bemt.judge.diagnose.contrast import Contrast
    from bemt.judge.diagnose.record import Record
    from bemt.tools.drive.drive_result import DriveResult

__all__ = ["Answer", "compare", "diagnose", "drive", "read", "validate"]


def read(path: str | os.PathLike[str], format: str | None = None) -> Dataset:  # noqa: A002
    r"""Read a recording: a bench log, a table, a CFD export, a vendor file.

    Parameters
    ----------
    path : str or path
        The file.
    format : str, optional
        Name of the reader; detected from the content by default.

    Returns
    -------
    Dataset
        Steady points of a log, rows of a table of points, or one point with the means of a CFD history. ``notes`` list
        the decisions made and what looks wrong. Suspicious data are not corrected.

    Raises
    ------
    InputError
        If the file cannot be interpreted; the message says what to write.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> file = Path(tempfile.mkdtemp()) / "bench.csv"
    >>> _ = file.write_text("rpm,thrust_gf,torque_Nm\n5000,340,0.05\n6000,490,0.07\n")
    >>> read(file).thrust_N.round(2)
    array([3.33, 4.81])
    """
    from bemt.data.recordings.load import as_dataset, import_file

    return as_dataset(import_file(path_text("path", path), format))


@dataclass(frozen=True, eq=False)
class Answer:
    """Result of a diagnosis, returned by :func:`diagnose`.

    Parameters
    ----------
    diagnosis : bemt.judge.diagnose.answer.Diagnosis
        The complete result.
    propeller : Propeller
        The propeller that was compared with the recording.

    Examples
    --------
    The blades of this recording are 1.5 deg steeper than those of its reference:

    >>> import numpy as np
    >>> from bemt.app.library import propeller
    >>> p = propeller("10x5")
    >>> rpm, J = np.repeat([5000.0, 10000.0, 15000.0], 6), np.tile(np.linspace(0.0, 0.5, 6), 3)
    >>> turned = p.replaced({"blade.beta_offset_deg": 2.2}).solve(rpm, J=J, bands=False)
    >>> answer = diagnose(turned, p, reference=p.solve(rpm, J=J, bands=False), only=["pitch_offset", "torque_gain"])
    >>> answer
    <answer on prop_10x5: named pitch_offset>
    >>> answer.verdict, answer.effects, answer.to_dict()["schema"]
    ('named', ('pitch_offset',), 'bemt.diagnosis/1')
    >>> print(answer.text.splitlines()[0])
    Cause found: wrong blade angle (+1.49 deg).
    >>> improved = answer.improved.solve(rpm, J=J, bands=False)
    >>> bool(np.max(np.abs(improved.thrust_N / turned.thrust_N - 1)) < 0.02)
    True
    >>> import tempfile
    >>> "before_after.png" in {file.name for file in answer.plot(tempfile.mkdtemp())}
    True
    """

    diagnosis: Diagnosis
    propeller: Propeller

    def __repr__(self) -> str:
        """Say the verdict in a line."""
        return f"<answer on {self.propeller.name}: {' '.join((self.verdict, ', '.join(self.effects))).strip()}>"

    def _repr_html_(self) -> str:
        """Show the answer in a notebook."""
        return as_html(f"{self.propeller.name}: {' '.join((self.verdict, ', '.join(self.effects)))}", self.text)

    @property
    def verdict(self) -> str:
        """One of none, named, class, sensor, unknown, insufficient."""
        return self.diagnosis.said.verdict

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects of the verdict; for a class, all members."""
        return self.diagnosis.said.effects

    @property
    def text(self) -> str:
        """The answer as text, as on the command line."""
        from bemt.judge.diagnose.document import text

        return text(self.diagnosis)

    @property
    def improved(self) -> Propeller | None:
        """The propeller with the named effects switched on; None if nothing was named that can be simulated."""
        from bemt.judge.diagnose.improve import improved_case

        text = improved_case(self.diagnosis, self.propeller.case, self.propeller.text)
        return Propeller(case_of(text, self.propeller.case.folder), text) if text else None

    def to_dict(self) -> dict[str, Any]:
        """Convert the answer to plain values.

        Returns
        -------
        dict
            Schema ``bemt.diagnosis/1``.
        """
        from bemt.judge.diagnose.document import document

        return document(self.diagnosis)

    def plot(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Draw the figures of the answer.

        Parameters
        ----------
        folder : str or path
            Folder for the PNG files.

        Returns
        -------
        list of Path
            The files.
        """
        from bemt.base.errors import system_fault
        from bemt.judge.diagnose import figures

        try:
            return figures.draw(self.diagnosis, Path(path_text("folder", folder)))
        except OSError as error:
            raise InputError(system_fault(error)) from error


def diagnose(
    recording: str | os.PathLike[str] | Dataset | pd.DataFrame | Sequence[Any], propeller: Propeller | str, *,
    reference: str | os.PathLike[str] | Dataset | pd.DataFrame | Sequence[Any] | None = None,
    only: Sequence[str] | None = None, progress: Callable[[str], None] | None = None,
) -> Answer:  # fmt: skip
    """Find the physics or the stand fault that explains why a recording differs from the model.

    Parameters
    ----------
    recording : path, Dataset, DataFrame, or sequence of these
        The measurement; columns of a frame carry units (``thrust_N``, ``thrust_gf``, ``torque_Nm``).
    propeller : Propeller or str
        The propeller that was measured; a label or a case is enough.
    reference : path, Dataset, DataFrame, or sequence of these, optional
        Recordings from the same stand without the suspected cause; they show how far model and stand differ anyway.
    only : sequence of str, optional
        Consider only these effects.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Answer
        ``.verdict``, ``.effects``, ``.text``, ``.plot(folder)``, ``.improved``.

    Raises
    ------
    InputError
        For recordings without a load and for unknown effects.

    Examples
    --------
    Static points made by the model itself: nothing is missing.

    >>> import bemt
    >>> p = bemt.propeller("10x5")
    >>> points = p.solve(rpm=[4000, 6000, 8000], bands=False)
    >>> bemt.diagnose(points, p, only=["pitch_offset", "thrust_gain"]).verdict
    'none'
    """
    from dataclasses import replace

    from bemt.judge.diagnose import load as loading
    from bemt.judge.diagnose import record as records
    from bemt.judge.diagnose.chain import diagnose as run

    rotor = rotor_of(propeller)

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


def drive(
    propeller: Propeller | str, *, kv: float | None = None, cells: int | None = None, mass_kg: float | None = None,
    rotors: int | None = None, capacity_Ah: float | None = None, airspeed_m_s: float = 0.0,
) -> DriveResult:  # fmt: skip
    """Solve a propeller with its motor and battery.

    Parameters
    ----------
    propeller : Propeller or str
        Propeller, case or label.
    kv : float, optional
        Speed constant of the motor; from the case's table [drive] by default, like all that follows. [rev/min/V]
    cells : int, optional
        LiPo cells in series.
    mass_kg : float, optional
        Mass of the vehicle, for the hover point. [kg]
    rotors : int, optional
        Number of rotors that carry the vehicle and share the battery.
    capacity_Ah : float, optional
        Capacity of the battery, for the flight time. [A h]
    airspeed_m_s : float
        Flight speed. [m/s]

    Returns
    -------
    bemt.tools.drive.drive_result.DriveResult
        ``.full``, ``.hover``, ``.text``, ``.to_dict()``; each value with its band.

    Raises
    ------
    InputError
        For impossible values, and without K_v and cells from either side.

    Examples
    --------
    >>> import bemt
    >>> d = bemt.drive("10x5", kv=1000, cells=3)
    >>> bool(7.0 < d.full["thrust_N"].value < 13.0)
    True
    """
    from bemt.tools.drive import drive_result

    given = {"kv": kv, "cells": cells, "mass_kg": mass_kg, "rotors": rotors, "capacity_Ah": capacity_Ah}
    for name, value in (*given.items(), ("airspeed_m_s", airspeed_m_s)):
        if value is not None and (isinstance(value, bool) or not isinstance(value, (int, float, np.number))):
            raise InputError(Fault("", name, repr(value), "a number"))
    case = rotor_of(propeller).case
    with in_words_of_the_library():
        return drive_result.solve(drive_result.with_drive(case, **given), float(airspeed_m_s))


def compare(
    a: str | os.PathLike[str], b: str | os.PathLike[str], *, case: str | os.PathLike[str] | None = None,
    diameter_m: float | None = None,
) -> Contrast:  # fmt: skip
    r"""Find what changed between two recordings from one stand.

    Parameters
    ----------
    a, b : str or path
        Recordings before and after a change, or without and with it.
    case : str or path, optional
        Case of the rotor; `b` is then diagnosed with `a` as its reference.
    diameter_m : float, optional
        Rotor diameter for the advance ratio, if there is no case. [m]

    Returns
    -------
    bemt.judge.diagnose.contrast.Contrast
        ``.document`` is the answer in the format ``bemt.comparison/1``.

    Raises
    ------
    InputError
        For files that are not recordings or have no point in common.

    Examples
    --------
    >>> import bemt, tempfile
    >>> from pathlib import Path
    >>> a, b = (Path(tempfile.mkdtemp()) / name for name in ("a.csv", "b.csv"))
    >>> rows = [(n, 1e-7 * n**2, 2e-9 * n**2) for n in range(4000, 9001, 500)]
    >>> for file, gain in ((a, 1.0), (b, 0.9)):
    ...     lines = ["rpm,thrust_N,torque_Nm"] + [f"{n},{gain * T:.4f},{Q:.5f}" for n, T, Q in rows]
    ...     _ = file.write_text("\n".join(lines))
    >>> found = bemt.compare(a, b)
    >>> found.verdict, found.effects
    ('class', ('thrust_gain', 'coaxial_neighbour'))
    >>> print(found.text.splitlines()[0])
    Gain error of the thrust cell, or second rotor on the same axis (thrust -10.0% and torque +0.0%).
    """
    from bemt.judge.diagnose import contrast

    diameter = contrast.label_diameter(None) if diameter_m is None else number("diameter_m", diameter_m)
    if diameter_m is not None and not 0.01 <= diameter_m <= 10.0:
        raise InputError(Fault("", "diameter_m", f"{diameter_m:g}", "0.01 to 10 m", "Is that in mm? Divide by 1000"))
    known = None if case is None else path_text("case", case)
    return contrast.compare(path_text("a", a), path_text("b", b), known, diameter_m=diameter)


def validate(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """Compare BEMT with a folder of measured propellers in UIUC layout.

    Parameters
    ----------
    folder : str or path
        The folder, or ``"uiuc"`` for the installed data.

    Returns
    -------
    dict
        Schema ``bemt.validation/1``.

    Raises
    ------
    InputError
        If it contains no propeller that can be compared.

    Examples
    --------
    >>> validate("no/such/folder")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no/such/folder: got ...
    """
    from bemt.rotors.validate import propellers

    return propellers.validate(propellers.where(path_text("folder", folder)))
