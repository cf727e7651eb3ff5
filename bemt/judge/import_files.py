"""The action ``import``: files read, checked, kept with what the user states, and set beside a case."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from bemt.base.action import Count, Told, action
from bemt.base.errors import Fault, InputError

if TYPE_CHECKING:
    from bemt.data.readers.cfd_run import RunToml
    from bemt.data.recordings.shown import Imported
    from bemt.rotors.propeller import Propeller

    File = str | os.PathLike[str]

__all__ = ["import_"]


@action(
    "Recordings", "import log.csv", words=("files",), command="import", shown=True,
    common=("case", "rpm", "sheet", "unit", "column", "sign", "zones", "out"),
    elsewhere=dict.fromkeys(("--air", "--air-a"), "Air that no column has: diagnose --density-kg-m3, compare --air-a."),
)  # fmt: skip
def import_(
    files: File | Sequence[File], *, format: str | None = None, sheet: str | None = None,  # noqa: A002
    rpm: float | None = None, period_s: float | None = None, revolutions: Count | None = None,
    pole_pairs: Count | None = None, case: Propeller | File | None = None,
    picture: File | None = None, unit: Mapping[str, str] = {}, column: Mapping[str, str] = {},  # noqa: B006
    sign: Mapping[str, str] = {}, sector: Count | None = None, zones: Sequence[str] = (),  # noqa: B006
    rotor_zones: Sequence[str] = (), axis: Literal["x", "y", "z"] | None = None,
    airspeed_m_s: float | None = None, density_kg_m3: float | None = None,
    reference: Mapping[str, str] = {}, setup: Mapping[str, str] = {}, ignore: Sequence[str] = (),  # noqa: B006
    out: File | None = None,
) -> Told:  # fmt: skip
    r"""Read CFD, bench or vendor data: channels, means, drift, warnings.

    Parameters
    ----------
    files : path or sequence of paths
        Files, or folders that a reader takes as a whole.
    format : str, optional
        Reader to use; detected from the content by default.
    sheet : str, optional
        Sheet of a workbook, or file in a zip; other commands take BOOK.xlsx#SHEET.
    rpm : float, optional
        Speed, for averages over whole revolutions. [rev/min]
    period_s : float, optional
        Duration of a revolution, instead. [s]
    revolutions : int, optional
        Average the last so many revolutions; 4, or half, by default.
    pole_pairs : int, optional
        Of the motor, where a speed counts electrical revolutions; 14 magnets are 7 pairs. `out` keeps it.
    case : Propeller, str or path, optional
        Say how the recordings lie in the prediction band of this case.
    picture : path, optional
        With a case: draw the recordings inside the band, to this file: .png, .pdf or .svg.
    unit : mapping
        What the files do not say: unit of a quantity or column, thrust=N.
    column : mapping
        Column of a quantity: thrust=fz.
    sign : mapping
        Sign of a load: torque=-1; -1 alone turns all.
    sector : int, optional
        The model is one of so many equal sectors: loads are multiplied.
    zones : sequence of str
        Zones whose loads count: blade,hub,duct.
    rotor_zones : sequence of str
        Those of them on the shaft, where neither names nor moments tell: blade,hub.
    axis : {"x", "y", "z"}, optional
        Axis of the shaft; that of the largest force by default.
    airspeed_m_s : float, optional
        Speed of flight. [m/s]
    density_kg_m3 : float, optional
        Density of the fluid. [kg/m3]
    reference : mapping
        What coefficients rest on: area=A length=L speed=V density=RHO, in m2, m, m/s, kg/m3. Forces are
        multiplied by the density of the run over that one: OpenFOAM's of rhoInf 1 with density=1.
    setup : mapping
        How it was computed: cells=2.1e6 grid_level=fine turbulence='k-omega SST' solver=pressure steady=no gci_pct=2
        (of the thrust; gci_torque_pct of the torque);
        cells=0.5e6,1.7e6,5.8e6 makes a grid study of three folders, or of three files of each kind.
    ignore : sequence of str
        Headings of columns that count for nothing.
    out : path, optional
        File that keeps what you state: run.toml, study.toml of several grids or recording.toml; every command takes it
        in place of the files.

    Returns
    -------
    Told
        Schema ``bemt.import/1``; the worst file sets ``exit_code``.

    Raises
    ------
    InputError
        For options that do not go together.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> file = Path(tempfile.mkdtemp()) / "bench.csv"
    >>> _ = file.write_text("rpm,thrust_gf,torque_Nm\n5000,340,0.05\n6000,490,0.07\n")
    >>> import_(file).to_dict()["schema"]
    'bemt.import/1'
    """
    from bemt.base.given import paths_text
    from bemt.data.recordings import cfd_options, load
    from bemt.data.recordings.adapt import asked

    _drawable(picture, case)
    names = [f"{name}#{sheet}" if sheet else name for name in paths_text("files", files, 1)]
    choice = asked(rpm, period_s, revolutions)
    load.check_format(format)
    run: dict[str, Any] = {"sector": sector, "zones": list(zones), "rotor_zones": list(rotor_zones), "axis": axis,
                           "reference": words(reference), "setup": words(setup)}  # fmt: skip
    columns = {"unit": words(unit), "column": words(column), "sign": words(sign)}
    left = [os.fspath(heading) for heading in ([ignore] if isinstance(ignore, str) else ignore)]
    air = {"airspeed_m_s": airspeed_m_s, "density_kg_m3": density_kg_m3}
    measured = not any(run.values()) and all(map(load.is_measured, names))
    stated = _Stated(names, measured, columns, left, run | ({} if measured else air), air, pole_pairs,
                     None if out is None else os.fspath(out))  # fmt: skip
    table, told = stated.tables(rpm)
    taken = bool(table or told)  # then nothing that is stated is left to be applied
    if pole_pairs and not taken:
        raise InputError(Fault("", "--pole-pairs", f"{pole_pairs} with these files", "one table of measurements"))
    names = [table] if table else names
    if measured and not table:
        told |= _in_air(names, air, lambda n: told.get(n) or load.import_file(n, format, choice))
    speed = None if choice.period is None else 60.0 / choice.period
    options: Any = {} if taken else {**stated.run, **columns, "ignore": left}
    made = cfd_options.run_from(names, rpm=speed, revolutions=revolutions, **options)
    rotor = None if case is None else _rotor(case)
    found = load.import_files(names, format, choice, made, stated.insists and not taken, told, rotor)
    wrote = _kept_run(made, found, stated.out) if found.runs and not table else ""
    document, lines = found.document(), [f"{table} written\n"] if table and not found.runs else []
    if case is not None:
        seen, own = _seen(found, names, told, wrote, made)
        flow = {} if own else {"rpm": rpm, **({} if measured else {"airspeed_m_s": airspeed_m_s})}
        sentence, document["prediction"] = _beside(seen, case, picture, flow)
        lines.append(f"{sentence}\n")
    again = {"case": [str(case) if isinstance(case, str | os.PathLike) else "CASE"],
             **({} if table else stated.again(rpm))}  # fmt: skip
    text = "\n".join([*lines, found.text(wrote or (table if found.runs else ""), again)])
    return Told(document, text, exit_code=found.exit_code, complaints=found.complaints)


@dataclass(frozen=True)
class _Stated:
    """What the user states of files."""

    names: list[str]
    measured: bool  # Whether all are tables of measurements
    columns: dict[str, list[str]]
    left: list[str]
    run: dict[str, Any]  # Of a CFD run, with its air
    air: dict[str, float | None]
    pole_pairs: int | None
    out: str | None

    @property
    def insists(self) -> bool:
        """Whether anything is stated that must be applied to something."""
        return any((*self.columns.values(), *self.run.values(), self.left, self.out is not None, self.pole_pairs))

    def tables(self, rpm: float | None) -> tuple[str, dict[str, Any]]:
        """Tables of measurements as stated: one is kept, with the file that says so, others are read."""
        from bemt.data.recordings import load
        from bemt.data.recordings.stated import write_recording

        facts: dict[str, Any] = {**self.columns, "pole_pairs": self.pole_pairs, "ignore": self.left}
        if self.measured and self.out is not None and len(self.names) == 1:
            return write_recording(self.names[0], self.out, rpm=rpm, **self.air, **facts).as_posix(), {}
        if self.measured and self.out is None and self.insists:
            return "", dict(zip(self.names, load.as_stated(self.names, facts), strict=True))
        return "", {}

    def again(self, rpm: float | None) -> dict[str, list[Any]]:
        """Options of a next command."""
        air = {name.replace("_", "-"): v for name, v in self.air.items()} | {"rpm": rpm if self.measured else None}
        return {**self.columns, **{k: [v] for k, v in air.items() if v is not None}}


def _drawable(picture: File | None, case: object) -> None:
    """Refuse a picture without the case whose band it shows, or of no known kind."""
    from bemt.base.canvas import kind_of

    if picture is not None and case is None:
        raise InputError(Fault("--picture", "", "no case", "--case CASE, whose band is drawn"))
    if picture is not None:
        kind_of(os.fspath(picture))


def _kept_run(made: RunToml, found: Imported, out: str | None) -> str:
    """Write the run as stated, of the files that were read; its path, "" where none is asked for."""
    from bemt.data.recordings.cfd_options import write_run

    if out is None:
        return ""
    own = made.run.model_copy(update={"files": found.runs[-1].files})
    return write_run(made.model_copy(update={"run": own}), out).as_posix()


def _seen(
    found: Imported, names: Sequence[str], told: Mapping[str, Any], wrote: str, made: RunToml
) -> tuple[list[Any], bool]:  # fmt: skip
    """What is set beside a case, and whether it has its own conditions, as CFD runs do."""
    from bemt.data.recordings.load import runs_of

    if wrote:
        return [wrote], True
    runs: list[Any] = runs_of(names, made)[0]  # as the options say, not as the files do
    others = [f.path for f in found.files if f.record is None or f.record.kind != "cfd"] if runs else names
    return [*runs, *(told.get(name, name) for name in others)], bool(runs)


def _in_air(
    names: Sequence[str], air: Mapping[str, float | None], read: Callable[[str], Any]
) -> dict[str, Any]:  # fmt: skip
    """Recordings with the air that the user states; none where one cannot be read, which is said where it is."""
    from bemt.data.recordings.stated import filled

    if any(v is not None for v in air.values()):
        with suppress(InputError):
            return {n: filled(one, **air) for n, one in {n: read(n) for n in names}.items()}
    return {}


def words(given: Mapping[str, str] | Sequence[str]) -> list[str]:
    """``NAME=VALUE`` of a mapping, in which the empty name stands for all, or as a command has them."""
    if not isinstance(given, Mapping):
        return [given] if isinstance(given, str) else list(given)
    return [f"{name}={value}" if name else str(value) for name, value in given.items()]


def _rotor(case: Propeller | File) -> tuple[float, float, bool]:
    """Diameter [m] and density [kg/m3] of a case, and whether it has a duct."""
    from bemt.rotors.propeller import rotor_of

    made = rotor_of(case).case
    return made.diameter_m, float(made.air().rho), made.ducted


def _beside(
    files: Sequence[Any], case: object, picture: object, told: Mapping[str, float | None]
) -> tuple[str, Mapping[str, object]]:
    """How the files lie in the prediction band of the case: a sentence and a document; drawn where that is asked."""
    from bemt.base.canvas import kind_of
    from bemt.base.tables import write_atomic
    from bemt.judge.diagnose.figures import first_picture
    from bemt.judge.diagnose.load import load_all

    conditions: dict[str, Any] = {k: [v] for k, v in told.items() if v is not None}
    cases, records = load_all(files, [case], **conditions)
    (view,) = first_picture(records, cases)
    if picture is not None:
        write_atomic(Path(str(picture)), view.picture(kind_of(str(picture))))
    return " ".join((view.sentence, *view.notes)), view.document()
