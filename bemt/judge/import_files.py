"""The action ``import``: files read, checked, kept with what the user states, and set beside a case."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from bemt.base.action import Count, Told, action

if TYPE_CHECKING:
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
    from bemt.base.canvas import kind_of
    from bemt.base.errors import Fault, InputError
    from bemt.base.given import paths_text
    from bemt.data.recordings import cfd_options, load
    from bemt.data.recordings.adapt import asked
    from bemt.data.recordings.stated import filled

    if picture is not None and case is None:
        raise InputError(Fault("--picture", "", "no case", "--case CASE, whose band is drawn"))
    if picture is not None:
        kind_of(os.fspath(picture))
    names = [f"{name}#{sheet}" if sheet else name for name in paths_text("files", files, 1)]
    choice = asked(rpm, period_s, revolutions)
    load.check_format(format)
    columns = {"unit": words(unit), "column": words(column), "sign": words(sign)}
    left = [os.fspath(heading) for heading in ([ignore] if isinstance(ignore, str) else ignore)]
    air = {"airspeed_m_s": airspeed_m_s, "density_kg_m3": density_kg_m3}
    run: dict[str, Any] = {"sector": sector, "zones": list(zones), "rotor_zones": list(rotor_zones), "axis": axis,
                           "reference": words(reference), "setup": words(setup)}  # fmt: skip
    measured = not any(run.values()) and all(map(load.is_measured, names))
    run |= {} if measured else air
    insist = any((*columns.values(), *run.values(), left, out is not None, pole_pairs))
    facts = {**columns, "pole_pairs": pole_pairs, "ignore": left}
    table, stated = _tables(names, out, insist, {"rpm": rpm, **air}, facts) if measured else ("", {})
    taken = bool(table or stated)  # then nothing that is stated is left to be applied
    if pole_pairs and not taken:
        raise InputError(Fault("", "--pole-pairs", f"{pole_pairs} with these files", "one table of measurements"))
    names = [table] if table else names
    if measured and not table and any(v is not None for v in air.values()):
        with suppress(InputError):  # said where it is read
            read = {n: stated.get(n) or load.import_file(n, format, choice) for n in names}
            stated |= {n: filled(one, **air) for n, one in read.items()}
    speed = None if choice.period is None else 60.0 / choice.period
    options = {} if taken else {**run, **columns, "ignore": left}
    made = cfd_options.run_from(names, rpm=speed, revolutions=revolutions, **options)
    rotor = None if case is None else _rotor(case)
    found = load.import_files(names, format, choice, made, insist and not taken, stated, rotor)
    wrote, document, lines = "", found.document(), []
    if out is not None and not table and found.runs:
        own = made.run.model_copy(update={"files": found.runs[-1].files})
        made = made.model_copy(update={"run": own})
        wrote = cfd_options.write_run(made, os.fspath(out)).as_posix()
    if table and not found.runs:
        lines.append(f"{table} written\n")
    if case is not None:
        runs: list[Any] = [] if wrote else load.runs_of(names, made)[0]  # as the options say, not as the files do
        others = [f.path for f in found.files if f.record is None or f.record.kind != "cfd"] if runs else names
        seen = [wrote] if wrote else [*runs, *(stated.get(name, name) for name in others)]
        told = {} if wrote or runs else {"rpm": rpm, **({} if measured else {"airspeed_m_s": airspeed_m_s})}
        sentence, document["prediction"] = _beside(seen, case, picture, told)
        lines.append(f"{sentence}\n")
    again: dict[str, list[Any]] = {"case": [str(case) if isinstance(case, str | os.PathLike) else "CASE"]}
    if not table:
        of_tables = {"airspeed-m-s": airspeed_m_s, "density-kg-m3": density_kg_m3, "rpm": rpm if measured else None}
        again |= {**columns, **{k: [v] for k, v in of_tables.items() if v is not None}}
    text = "\n".join([*lines, found.text(wrote or (table if found.runs else ""), again)])
    return Told(document, text, exit_code=found.exit_code, complaints=found.complaints)


def _tables(
    names: Sequence[str], out: File | None, insist: bool, conditions: Mapping[str, Any], facts: Mapping[str, Any]
) -> tuple[str, dict[str, Any]]:
    """Tables of measurements as the user states them: one is kept, with the file that says so, others are read."""
    from bemt.data.recordings import load
    from bemt.data.recordings.stated import write_recording

    if out is not None and len(names) == 1:
        return write_recording(names[0], os.fspath(out), **conditions, **facts).as_posix(), {}
    if out is None and insist:
        return "", dict(zip(names, load.as_stated(names, facts), strict=True))
    return "", {}


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
