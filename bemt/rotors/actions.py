"""Actions on a rotor: from a label to numbers, to a case, to its sources, and against measured rotors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from bemt.base.action import Cells, Count, Told, action

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike

    from bemt.rotors.case.estimate import RotorEstimate
    from bemt.rotors.case.sources import Sources
    from bemt.rotors.propeller import Propeller

    Recorded = str | os.PathLike[str] | Any  # a file or folder, or its table: Dataset or DataFrame

__all__ = ["calibrate", "cite", "estimate", "measured_rotors", "new", "stations", "validate"]


_ELSEWHERE = {
    "duct": "A duct is [duct] in the case (docs/duct.md); bemt new DIAMETER --fan writes one.",
    "pitch": "The pitch is in the label, as the 5 of 10x5.",
}


@action(
    "Propellers and fans", "estimate 10x5 --rpm 6000", words=("label",), shown=True,
    common=("rpm", "airspeed_m_s", "blades", "chord_mm", "series", "reading", "angle_deg"),
    elsewhere=_ELSEWHERE | dict.fromkeys(
        ("motor", "kv", "cells", "mass", "rotors", "capacity"),
        "With a motor and a battery: bemt drive 10x4.5 --kv 920 --cells 3.",
    ),
)  # fmt: skip
def estimate(
    label: str, rpm: ArrayLike, airspeed_m_s: ArrayLike = 0.0, *, blades: Count | None = None,
    chord_mm: float | None = None, measured_pitch_in: float | None = None, series: str | None = None,
    density_kg_m3: float | None = None, angle_deg: ArrayLike = 0.0,
    reading: str | Mapping[str, float] | None = None,
) -> RotorEstimate:  # fmt: skip
    """Estimate thrust and power from a label such as 10x5, with bands; K1/K2 for comparison.

    Every speed of rotation is solved with every airspeed at every angle.

    Parameters
    ----------
    label : str
        As on the propeller: ``10x4.7``, ``APC 10x4.7SF``, ``8x5x3``, ``5045``. Endings (E, MR, SF) tell the kind of
        blade and change the answer.
    rpm : array_like
        Speeds of rotation. [rev/min]
    airspeed_m_s : array_like
        Speeds of the wind, 0 by default. [m/s]
    blades : int, optional
        Number of blades; from the label by default, else 2.
    chord_mm : float, optional
        Measured chord at 0.75 R; it narrows the band most. [mm]
    measured_pitch_in : float, optional
        Measured pitch, 2 pi r tan(blade angle) at 0.75 R. [in]
    series : str, optional
        Maker and series, such as ``"APC Thin Electric"`` or ``"apce"``.
    density_kg_m3 : float, optional
        Air density; 1.225 by default, with 1.16 to 1.29 in the band. [kg/m3]
    angle_deg : array_like
        Angles between wind and shaft: 0 climb, 90 edgewise, 180 descent. [deg]
    reading : str or mapping, optional
        One reading of this propeller, or several: ``rpm=5400,thrust_g=410`` with
        ``airspeed_m_s`` and ``power_W``, that of the shaft, if known.

    Returns
    -------
    Dataset
        Kind ``bemt``, with standard uncertainties in ``u``; ``k1k2_thrust_N`` is the K1/K2 formula. The speed of
        rotation is the outer loop. ``.text`` is the table, ``.to_dict()`` has schema ``bemt.estimate/2``.

    Raises
    ------
    InputError
        For a label that cannot be read, impossible numbers, or an unknown series; all faults at once.

    Examples
    --------
    >>> d = estimate("10x5", rpm=[6000, 9000])
    >>> d.thrust_N.round(1), bool((d.u["thrust_N"] > 0).all())
    (array([ 4.8, 11. ]), True)
    >>> estimate("10x5", rpm=6000, density_kg_m3=1225)
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: density_kg_m3: got 1225; expected 0.01 to 10 kg/m3. In g/m3? Divide by 1000.
    """
    from bemt.base.given import number
    from bemt.rotors.case.estimate import of_label

    density = None if density_kg_m3 is None else number("density_kg_m3", density_kg_m3, finite=False)
    return of_label(label, rpm, airspeed_m_s, blades, chord_mm, measured_pitch_in, series, density, angle_deg, reading)


@action(
    "Propellers and fans", "new 10x5", words=("label",), shown=True,
    common=("stations", "scan", "fan", "blades", "kv", "cells", "rpm", "out"),
    elsewhere=_ELSEWHERE,
)  # fmt: skip
def new(
    label: str | None = None, *, stations: str | os.PathLike[str] | None = None,
    scan: str | os.PathLike[str] | None = None, unit: Literal["mm", "m", "in"] | None = None,
    diameter_mm: float | None = None, diameter_in: float | None = None, fan: bool = False,
    blades: Count | None = None, rpm: float | None = None, airspeed_m_s: float = 0.0, series: str | None = None,
    kv: float | None = None, cells: Cells | None = None,
    reading: str | Mapping[str, float] | None = None, campaign: bool = False,
    out: str | os.PathLike[str] | None = None,
) -> Told:  # fmt: skip
    """Write a new case: from a label, blade stations, a scan, or a fan's diameter.

    Parameters
    ----------
    label : str, optional
        As on the propeller: ``10x5``, or ``quad=10x5`` with a name for the case; with ``--fan`` the diameter, ``70mm``;
        with a file the name of the case.
    stations : str or path, optional
        File with blade stations: CSV with r_over_R, chord_over_R, beta_deg (or r_mm, chord_mm); UIUC geometry; APC PE0.
    scan : str or path, optional
        Scan or CAD model of the blade (STL, OBJ, STEP); the label is then the name of the case.
    unit : {"mm", "m", "in"}, optional
        With a scan: its unit, if the file does not state it.
    diameter_mm, diameter_in : float, optional
        With stations or a fan: the diameter. [mm] or [in]
    fan : bool
        A ducted fan; with a diameter the label is the name of the case.
    blades : int, optional
        Number of blades; from the label by default, else 2.
    rpm : float, optional
        Speed of the operating point; by default one of a typical tip speed. [rev/min]
    airspeed_m_s : float
        Airspeed of the operating point. [m/s]
    series : str, optional
        Maker and series, such as ``"APC Thin Electric"`` or ``apce``.
    kv : float, optional
        Speed constant of the motor. [rev/min/V]
    cells : int, optional
        LiPo cells in series, with K_v.
    reading : str or mapping, optional
        With a label: one reading of this propeller, ``rpm=5400,thrust_g=410``.
    campaign : bool
        Also write ``cfd/campaign.toml``: OpenFOAM runs on three grids.
    out : str or path, optional
        Folder to write; named after the label by default.

    Returns
    -------
    Told
        Folder and files, and the next commands.

    Raises
    ------
    InputError
        For what cannot be read or does not go together; nothing is written then.

    Examples
    --------
    >>> import tempfile
    >>> print(new("10x5", out=tempfile.mkdtemp() + "/mine").text)  # doctest: +ELLIPSIS
    /.../mine: case.toml
    ! no ending (BN, E, F, MR, SF): ...
    next: bemt sweep /.../mine
    """
    import os
    import re
    import shlex

    from bemt.base.errors import Fault, InputError
    from bemt.rotors.case import new_folder
    from bemt.rotors.case.reading import reading_text

    if diameter_in is not None and diameter_mm is not None:
        raise InputError(Fault("", "--diameter-mm, --diameter-in", "both", "one of them"))
    diameter_mm = diameter_mm if diameter_in is None else diameter_in * 25.4
    table, solid = (None if path is None else os.fspath(path) for path in (stations, scan))
    name, is_named, rest = (label or "").partition("=")
    label = rest if is_named else label
    wanted = new_folder.Wanted(label, table, solid, unit, diameter_mm, fan, blades, rpm, airspeed_m_s, series, kv,
                               cells, campaign, None if reading is None else reading_text(reading),
                               diameter_in is not None, name if is_named else "")  # fmt: skip
    folder, files, notes = new_folder.write(wanted, None if out is None else os.fspath(out))
    if fan and label and re.fullmatch(r"[\d.]+x[\d.]+(x\d+)?", label):
        notes = [*notes, f"the chord, hub and sections are those of ducted fans, not of a propeller {label}"]
    typed = shlex.quote(folder.as_posix())
    lines = [
        f"{folder.as_posix()}: {', '.join(files)}",
        *(f"! {note}" for note in notes),
        f"next: bemt sweep {typed}",
    ]
    lines += [f"      bemt drive {typed}"] if kv is not None else []
    lines += [f"      bemt cfd {typed}/cfd"] if campaign else []
    document = {"schema": "bemt.new/1", "folder": folder.as_posix(), "files": files}
    return Told(document, "\n".join(lines))


@action("Solids and CFD", "stations rotor.stl --unit mm --out cases/mine", words=("file",))
def stations(
    file: str | os.PathLike[str], *, unit: Literal["mm", "m", "in"] | None = None,
    out: str | os.PathLike[str] | None = None,
) -> Told:  # fmt: skip
    """Turn the blade of a CAD model, a scan or a design file into a case.

    Parameters
    ----------
    file : str or path
        STL, OBJ, STEP; XROTOR, QPROP, DFDC.
    unit : {"mm", "m", "in"}, optional
        Unit of an STL or OBJ that does not state it.
    out : str or path, optional
        Folder for case.toml, stations.csv and section files.

    Returns
    -------
    Told
        Schema ``bemt.stations/1``.

    Raises
    ------
    InputError
        For a file without a blade.

    Examples
    --------
    >>> stations("no/such/rotor.stl")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no/such/rotor.stl: got ...
    """
    from pathlib import Path

    from bemt.rotors.case import from_solid

    path, folder = Path(file), None if out is None else Path(out)
    blade = from_solid.read_blade(path, unit)
    told = None if folder is None else str(folder)
    if blade is not None:
        if folder is not None:
            from_solid.write_blade(blade, path, folder)
        return Told(from_solid.blade_document(blade, path), from_solid.blade_text(blade, path, told))
    found, scale, words = from_solid.find_stations(path, unit)
    if folder is not None:
        from_solid.write(found, scale, path, folder)
    return Told(from_solid.document(found, scale, path, words), from_solid.text(found, scale, path, words, told))


@action("Models and checks", "cite cases/prop_8x5", words=("case",))
def cite(case: Propeller | str | os.PathLike[str], *, bibtex: bool = False) -> Sources:
    """List the sources that an answer for a case stands on: method, effects, section tables, bands, data.

    Parameters
    ----------
    case : Propeller, str or path
        Propeller, case or label.
    bibtex : bool
        As BibTeX.

    Returns
    -------
    Sources
        Tuple of :class:`bemt.rotors.case.sources.Source`, each with ``kind``, ``name`` and ``source``; ``.text``.

    Examples
    --------
    >>> [s.source[:25] for s in cite("10x5") if s.name == "swirl"]
    ['Glauert (1935), Airplane ']
    """
    from bemt.rotors.case.sources import sources
    from bemt.rotors.propeller import rotor_of

    found = sources(rotor_of(case).case)
    found.as_bibtex = bibtex
    return found


@action("Propellers and fans", "rotors apc 10x5", words=("query",), command="rotors")
def measured_rotors(query: str | Sequence[str] = "") -> Told:
    """List propellers that a database measured: they are found by maker and label at every door.

    Parameters
    ----------
    query : str
        Words such as ``apc 10x5``; all propellers by default.

    Returns
    -------
    Told
        Schema ``bemt.rotors/1``: label, name and source of each.

    Examples
    --------
    >>> [one["label"] for one in measured_rotors("gws direct 9x5").to_dict()["rotors"]]
    ['GWS Direct Drive 9x5']
    """
    from bemt.rotors import measured

    found = measured.measured_rotors(query if isinstance(query, str) else " ".join(query))
    rows = [{"label": one.label, "name": one.name, "source": one.source} for one in found]
    return Told({"schema": "bemt.rotors/1", "rotors": rows}, measured.table(found))


@action("Models and checks", "validate uiuc", words=("folders",))
def validate(
    folders: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], *, off: Sequence[str] = (),
    match_J0: bool = False, out: str | os.PathLike[str] | None = None, progress: Callable[[str], None] | None = None,
) -> Told:  # fmt: skip
    """Compare BEMT with folders of measured propellers in UIUC layout.

    Parameters
    ----------
    folders : path or sequence of paths
        Folders with geometry, static and J files, or ``uiuc`` for the installed data.
    off : sequence of str
        Effects to switch off; the stations are then taken as given, without the population of rotors as built.
    match_J0 : bool
        Also turn each blade to the measured zero-thrust J (an experiment that uses the measurement).
    out : str or path, optional
        Folder for the tables.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Told
        Schema ``bemt.validation/1``; ``exit_code`` 1 when points did not converge.

    Raises
    ------
    InputError
        If a folder contains no propeller that can be compared.

    Examples
    --------
    >>> validate("no/such/folder")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no/such/folder: got ...
    """
    import os

    from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED
    from bemt.base.given import paths_text
    from bemt.rotors.validate import propellers

    effects = propellers.effects_without(off)
    found = [propellers.where(name) for name in paths_text("folders", folders, 1)]
    made = propellers.validate(found, effects, progress, match_J0)
    if out is not None:
        propellers.write(made, os.fspath(out))
    code = EXIT_UNCONVERGED if made.unconverged else EXIT_OK
    return Told(made.document(), propellers.text(made), exit_code=code)


@action("Models and checks", "calibrate uiuc --out calibration", words=("files",))
def calibrate(
    files: Recorded | Sequence[Recorded] = (), *, test: Recorded | Sequence[Recorded] = (), label: str | None = None,
    out: str | os.PathLike[str] | None = None, progress: Callable[[str], None] | None = None,
) -> Told:  # fmt: skip
    """Refit K1/K2 on measured propellers, with intervals and scores.

    Parameters
    ----------
    files : path, Dataset, DataFrame, or sequence of them
        Recordings and folders with speed, thrust or CT, diameter and pitch; ``uiuc``, the installed data, by default.
        A column of labels (10x4.5) states a size as well.
    test : path, Dataset, DataFrame, or sequence of them
        Held-out data: scored, never fitted.
    label : str, optional
        Propeller of files that do not state it: 10x4.5, or 10x4.5x3 with three blades.
    out : str or path, optional
        Folder for tables and JSON.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Told
        Schema ``bemt.calibration/2``.

    Raises
    ------
    InputError
        For files that cannot be read or say nothing of thrust.

    Examples
    --------
    >>> calibrate("no/such/file.csv")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no/such/file.csv: got ...
    """
    import os

    from bemt.rotors import k1k2_calibration as k1k2
    from bemt.rotors.k1k2_points import given, read

    fitted, held = given("files", files), given("test", test)
    points, scored = read(fitted, held, label)
    of_fit, of_test = ([one if isinstance(one, str) else one.name for one in some] for some in (fitted, held))
    found = k1k2.calibrate(points, scored, of_fit, of_test, progress or (lambda line: None))
    if out is not None:
        k1k2.write(found, os.fspath(out))
    return Told(found.document(), k1k2.text(found))
