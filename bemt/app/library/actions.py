"""Functions of the public API that make something: estimate, plan, calibrate_rotor, export, report, cite."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from bemt.app.library.given import in_words_of_the_library, number, numbers, path_text
from bemt.app.library.rotors import Propeller, load, rotor_of
from bemt.base.errors import Fault, InputError, system_fault
from bemt.physics.dataset import Dataset, from_pandas

if TYPE_CHECKING:
    import pandas as pd

    from bemt.judge.diagnose.plan import Plan
    from bemt.rotors.as_measured import AsMeasured
    from bemt.rotors.case.sources import Source

__all__ = [
    "CalibratedRotor", "ExportedCase", "TestPlan", "calibrate_rotor", "cite", "estimate", "export", "plan", "report",
]  # fmt: skip

Recording = str | os.PathLike[str]


def estimate(
    label: str, rpm: ArrayLike, airspeed_m_s: ArrayLike = 0.0, *, blades: int | None = None,
    chord_mm: float | None = None, measured_pitch_in: float | None = None, series: str | None = None,
    density_kg_m3: float | None = None, angle_deg: ArrayLike = 0.0,
) -> Dataset:  # fmt: skip
    """Estimate thrust and power from a label, every speed of rotation with every airspeed at every angle.

    Parameters
    ----------
    label : str
        As on the propeller: ``10x4.7``, ``APC 10x4.7SF``, ``8x5x3``.
    rpm : array_like
        Speeds of rotation. [rev/min]
    airspeed_m_s : array_like
        Speeds of the wind. [m/s]
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

    Returns
    -------
    Dataset
        Kind ``bemt``, with standard uncertainties in ``u``; ``k1k2_thrust_N`` is the K1/K2 formula. The speed of
        rotation is the outer loop.

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
    from bemt.rotors.case import estimate as estimating

    asked = (("rpm", rpm), ("airspeed_m_s", airspeed_m_s), ("angle_deg", angle_deg))
    n, V, angle = (np.atleast_1d(numbers(*pair)).tolist() for pair in asked)
    density = None if density_kg_m3 is None else number("density_kg_m3", density_kg_m3)
    with in_words_of_the_library():
        found = estimating.document(label, n, V, blades, chord_mm, measured_pitch_in, series, density, angle)
    rows: list[dict[str, Any]] = found["rows"]
    columns = {k: np.array([np.nan if r[k] is None else r[k] for r in rows], float) for k in rows[0] if k != "flags"}
    u = {k[2:]: v for k, v in columns.items() if k.startswith("u_")}
    values = {k: v for k, v in columns.items() if not k.startswith(("u_", "u95_"))}
    if (sideslip := np.radians(values.pop("angle_deg"))).any():
        values["sideslip_rad"] = sideslip
    return Dataset("bemt", found["case"], values, u, flags=tuple(tuple(r["flags"]) for r in rows))


@dataclass(frozen=True, eq=False)
class TestPlan:
    """What a set of test points can show, returned by :func:`plan`.

    Parameters
    ----------
    found : bemt.judge.diagnose.plan.Plan
        The complete result.

    Examples
    --------
    >>> p = plan({"rpm": [4000, 6000, 8000]}, "10x5")
    >>> p
    <plan of 3 points>
    >>> set(p.detectable.values()) <= {"yes", "maybe", "no"}, p.to_dict()["schema"], len(p.text) > 100
    (True, 'bemt.plan/1', True)
    """

    __test__ = False  # the name is no test of pytest's
    found: Plan

    def __repr__(self) -> str:
        """Say how many points."""
        return f"<plan of {self.found.points} points>"

    @property
    def detectable(self) -> dict[str, str]:
        """Each effect: yes, maybe or no at its ordinary strength."""
        from bemt.judge.diagnose.plan import DETECTABLE

        return {effect: DETECTABLE[word] for effect, word in self.found.sight.items()}

    @property
    def text(self) -> str:
        """The tables, as on the command line."""
        from bemt.judge.diagnose.plan import text

        return text(self.found)

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values of schema ``bemt.plan/1``."""
        from bemt.judge.diagnose.plan import document

        return document(self.found)


def plan(
    points: Recording | Dataset | pd.DataFrame | Mapping[str, ArrayLike], propeller: Propeller | str, *,
    progress: Callable[[str], None] | None = None,
) -> TestPlan:  # fmt: skip
    """Say which effects a set of test points can see, before anyone measures.

    Parameters
    ----------
    points : path, Dataset, DataFrame or mapping
        Columns ``rpm``, ``airspeed_m_s``, ``time_s`` and others, one row per point; no loads.
    propeller : Propeller or str
        Propeller, case or label.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    TestPlan
        ``.detectable``, ``.text``, ``.to_dict()``.

    Raises
    ------
    InputError
        For points without a speed of rotation.

    Examples
    --------
    >>> plan({"airspeed_m_s": [0.0]}, "10x5")
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: points: got columns airspeed_m_s; expected a column rpm.
    """
    from bemt.judge.diagnose import plan as planning

    with in_words_of_the_library():
        case = rotor_of(propeller).case
        if isinstance(points, (str, os.PathLike)):
            record = planning.points(path_text("points", points), case)
        else:
            record = planning.record_of(_table(points), case)
        return TestPlan(planning.plan(record, case, progress))


def _table(points: Any) -> Dataset:
    if isinstance(points, Dataset):
        return points
    import pandas as pd

    if not isinstance(points, (Mapping, pd.DataFrame)):
        expected = "a path, a Dataset, a DataFrame or columns by name"
        raise InputError(Fault("", "points", f"{type(points).__name__} {points!r:.40}", expected))
    return from_pandas(pd.DataFrame(points), name="points")


@dataclass(frozen=True, eq=False)
class CalibratedRotor:
    """A rotor as its own runs show it, returned by :func:`calibrate_rotor`.

    Parameters
    ----------
    source : Propeller
        The propeller as its case describes it.
    found : bemt.rotors.as_measured.AsMeasured
        What the runs say.
    recordings : tuple of str
        The files.

    Examples
    --------
    See :func:`calibrate_rotor`, which shows ``.converged``, ``.text``, ``.to_dict()`` and ``.write(folder)``.
    """

    source: Propeller
    found: AsMeasured
    recordings: tuple[str, ...]

    @property
    def converged(self) -> bool:
        """Whether the fit converged."""
        return bool(self.found.found.converged)

    @property
    def text(self) -> str:
        """The answer, as on the command line."""
        from bemt.judge.diagnose.rotor_calibration import text

        return text(self.to_dict())

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values of schema ``bemt.rotor_calibration/1``."""
        from bemt.judge.diagnose.rotor_calibration import document

        return document(self.source.case, self.found, self.recordings)

    def write(self, folder: str | os.PathLike[str]) -> Propeller:
        """Write the case of the rotor as measured, and load it.

        Parameters
        ----------
        folder : str or path
            Folder for the case; not the one of the case itself.

        Returns
        -------
        Propeller
            The rotor with its narrower band.
        """
        from bemt.judge.diagnose.rotor_calibration import write

        with in_words_of_the_library():
            write(self.source.case, self.found, self.recordings, path_text("folder", folder))
        return load(folder)


def calibrate_rotor(
    recordings: Recording | Sequence[Recording], propeller: Propeller | Recording, *,
    progress: Callable[[str], None] | None = None,
) -> CalibratedRotor:  # fmt: skip
    r"""Learn a rotor's blade as built from clean runs of it.

    Parameters
    ----------
    recordings : path or sequence of paths
        Runs of this rotor with nothing else changed; best a static one and a flight point.
    propeller : Propeller or path
        Its case, in a file: what is learnt is written next to a copy of it.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    CalibratedRotor
        ``.converged``, ``.text``, ``.to_dict()``, ``.write(folder)``.

    Raises
    ------
    InputError
        For recordings without loads, and for loads that no blade of the case has.

    Examples
    --------
    >>> import tempfile
    >>> from bemt.app.library import propeller
    >>> folder = Path(tempfile.mkdtemp())
    >>> case = propeller("10x5").write(folder / "case")
    >>> d = load(case).solve(rpm=[4000, 6000, 8000])
    >>> rows = [f"{n},{T:.4f},{Q:.5f}" for n, T, Q in zip(d.rpm, 1.05 * d.thrust_N, 1.05 * d.torque_Nm)]
    >>> _ = (folder / "run.csv").write_text("\n".join(["rpm,thrust_N,torque_Nm", *rows]))
    >>> rotor = calibrate_rotor(folder / "run.csv", case)
    >>> rotor.converged, rotor.to_dict()["points"], rotor.text.splitlines()[0].startswith("prop_10x5: 3 points")
    (True, 3, True)
    >>> measured = rotor.write(folder / "measured").solve(rpm=6000)
    >>> bool(measured.u["thrust_N"][0] < 0.7 * d.u["thrust_N"][1])
    True
    """
    from bemt.judge.diagnose.rotor_calibration import calibrate

    given = [recordings] if isinstance(recordings, (str, os.PathLike)) else list(recordings)
    paths = tuple(path_text("recordings", one) for one in given)
    if not paths:
        raise InputError(Fault("", "recordings", "none", "one or more"))
    path = propeller.case.path if isinstance(propeller, Propeller) else Path(path_text("propeller", propeller))
    with in_words_of_the_library():
        case, found = calibrate(paths, str(path), progress)
    return CalibratedRotor(load(case.path), found, paths)


@dataclass(frozen=True, eq=False)
class ExportedCase:
    """What an export wrote, returned by :func:`export`.

    Parameters
    ----------
    folder : Path
        Where the files are.
    manifest : dict
        Contents of ``manifest.json``: files with hashes, what each target holds, its greatest error, notes.

    Examples
    --------
    See :func:`export`.
    """

    folder: Path
    manifest: dict[str, Any]

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that were written now."""
        from bemt.tools.exports.folder import listed

        return tuple(self.folder / name for name in listed(self.manifest))

    @property
    def text(self) -> str:
        """What was written and how well it holds the case, as on the command line."""
        from bemt.tools.exports.folder import text

        return text(self.manifest, self.folder)


def export(
    propeller: Propeller | str, folder: str | os.PathLike[str], formats: str | Sequence[str] = "stl", *,
    rpm: float | None = None, airspeed_m_s: float | None = None, hold: Sequence[str] = (),
) -> ExportedCase:  # fmt: skip
    """Write a propeller or fan for other programs.

    Parameters
    ----------
    propeller : Propeller or str
        Propeller, case or label.
    folder : str or path
        Folder for the files and ``manifest.json``.
    formats : str or sequence of str
        Targets, such as ``"stl"``, ``"jsbsim"`` or ``"qprop"``; docs/exports.md lists them.
    rpm : float, optional
        Highest speed of tables and fits, speed of a disk; from the case by default. [rev/min]
    airspeed_m_s : float, optional
        Axial speed of disks, blades and openfoam; from the case by default. [m/s]
    hold : sequence of str
        Refuse targets that cannot represent these: torque, airspeed, density and others.

    Returns
    -------
    ExportedCase
        ``.files``, ``.text``, ``.manifest``.

    Raises
    ------
    InputError
        For unknown targets, and for targets that were refused; other targets are written.

    Examples
    --------
    >>> import tempfile
    >>> made = export("10x5", tempfile.mkdtemp(), "qprop")
    >>> [file.suffix for file in made.files], "qprop" in made.text.lower()
    (['.qprop'], True)
    >>> export("10x5", tempfile.mkdtemp(), "qpropp")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: formats: got 'qpropp'; expected one of ...
    """
    from bemt.tools.cfd.openfoam.write import Run, check_run
    from bemt.tools.exports import target_ids
    from bemt.tools.exports.folder import export_case

    wanted = [formats] if isinstance(formats, str) else list(formats)
    known = target_ids()
    faults = [Fault("", "formats", repr(word), f"one of {', '.join(known)}") for word in wanted if word not in known]
    flow = Run(
        rpm=None if rpm is None else number("rpm", rpm),
        airspeed_m_s=None if airspeed_m_s is None else number("airspeed_m_s", airspeed_m_s),
    )
    faults += check_run(flow)
    if faults:
        raise InputError(faults)
    out = Path(path_text("folder", folder))
    try:
        with in_words_of_the_library():
            return ExportedCase(out, export_case(rotor_of(propeller).case, out, wanted, flow=flow, hold=tuple(hold)))
    except OSError as error:
        raise InputError(system_fault(error)) from error


def report(
    cases: Recording | Sequence[Recording], folder: str | os.PathLike[str], *, title: str = "", author: str = "",
    date: str = "", progress: Callable[[str], None] | None = None,
) -> tuple[Path, Path]:  # fmt: skip
    """Write the validation report of cases: one HTML file that opens from disk, and a summary in Markdown.

    Parameters
    ----------
    cases : path or sequence of paths
        Case files, or folders of cases.
    folder : str or path
        Folder for the report and its sweep.
    title, author, date : str
        For the head of the page.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    tuple of Path
        The HTML file and the summary.

    Raises
    ------
    InputError
        If no case is found, or the folder cannot be written.

    Examples
    --------
    >>> report("no/such/case", "out")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no/such/case: got ...
    """
    from bemt.results.report import write

    given = [cases] if isinstance(cases, (str, os.PathLike)) else list(cases)
    about = {"title": title, "author": author, "date": date}
    with in_words_of_the_library():
        return write([path_text("cases", one) for one in given], path_text("folder", folder),
                     progress or (lambda line: None), about)[1]  # fmt: skip


def cite(propeller: Propeller | str) -> tuple[Source, ...]:
    """List what an answer for this propeller stands on: method, effects, section tables, bands, data.

    Parameters
    ----------
    propeller : Propeller or str
        Propeller, case or label.

    Returns
    -------
    tuple of bemt.rotors.case.sources.Source
        Each with ``kind``, ``name`` and ``source``.

    Examples
    --------
    >>> found = cite("10x5")
    >>> [s.source[:25] for s in found if s.name == "swirl"]
    ['Glauert (1935), Airplane ']
    >>> sorted({s.kind for s in found})
    ['band', 'comparison', 'effect', 'method', 'sections']
    """
    from bemt.rotors.case.sources import sources

    return sources(rotor_of(propeller).case)
