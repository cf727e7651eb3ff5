"""Actions that judge recordings: diagnose, compare, plan, calibrate_rotor, prove."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from bemt.base.action import Count, Told, action

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping, Sequence
    from typing import TypeAlias

    import pandas as pd
    from numpy.typing import ArrayLike

    from bemt.judge.diagnose.ask import Answer, OnePoint
    from bemt.judge.diagnose.contrast import Contrast
    from bemt.judge.diagnose.plan import Plan
    from bemt.judge.diagnose.rotor_calibration import CalibratedRotor
    from bemt.physics.dataset import Dataset
    from bemt.rotors.propeller import Propeller

    Path: TypeAlias = str | os.PathLike[str]
    Recording: TypeAlias = str | os.PathLike[str] | Dataset | pd.DataFrame

__all__ = ["calibrate_rotor", "compare", "diagnose", "plan", "prove"]


@action(
    "Recordings", "diagnose log.csv --case cases/prop_8x5", words=("recordings",), shown=True,
    common=("case", "reference", "ruled_out", "changed", "only", "rpm", "airspeed_m_s", "out"),
    elsewhere=dict.fromkeys(("--air", "--air-a", "--air-b", "--temperature-C", "--pressure-hPa"), (
        "State --density-kg-m3 1.19, or temperature_C and pressure_hPa in [air] of the case or of a recording.toml."))
    | {"--case": "A label is one, as --case 10x5; two runs need none: bemt compare A B."},
)  # fmt: skip
def diagnose(
    recordings: Recording | Sequence[Recording], case: Propeller | Path | Sequence[Propeller | Path], *,
    reference: Recording | Sequence[Recording] | None = None, reference_case: Propeller | Path | None = None,
    only: Sequence[str] = (), ruled_out: Sequence[str] = (), changed: Sequence[str] = (), off: Sequence[str] = (),
    baseline: Literal["bemt", "k1k2"] = "bemt", channels: Sequence[Literal["thrust", "torque", "speed"]] = (),
    rpm: ArrayLike = (), airspeed_m_s: ArrayLike = (), density_kg_m3: ArrayLike = (),
    repeatability_pct: float | None = None, top_rpm: float | None = None,
    unit: Mapping[str, str] = {}, column: Mapping[str, str] = {}, sign: Mapping[str, str] = {},  # noqa: B006
    pole_pairs: Count | None = None, zones: Sequence[str] = (), along: Path | None = None, out: Path | None = None,
    figures: bool = True, progress: Callable[[str], None] | None = None,
) -> Answer | OnePoint:  # fmt: skip
    """Say which physics or stand fault explains why a recording differs from the model.

    Parameters
    ----------
    recordings : path, Dataset, DataFrame, or sequence of these
        Tables or logs, analysed together; columns of a frame carry units (``thrust_N``, ``thrust_gf``).
    case : Propeller, str, path, or sequence of these
        Case or label of all recordings, or one per recording.
    reference : path, Dataset, DataFrame, or sequence of these, optional
        Recordings from the same stand without the cause; they show how far model and stand differ anyway.
    reference_case : Propeller, str or path, optional
        Case of the references where it differs: without an effect that was put into the case.
    only : sequence of str
        Consider only these effects; all by default.
    ruled_out : sequence of str
        Effects that a check has ruled out.
    changed : sequence of str
        Effects that you changed, such as duct ("I put a duct on"): said, weighed, checked.
    off : sequence of str
        Effects to leave out of the baseline.
    baseline : {"bemt", "k1k2"}
        Model to compare with the recordings; k1k2 knows thrust only.
    channels : sequence of {"thrust", "torque", "speed"}
        Use only these channels; all that were measured by default.
    rpm : array_like
        Speed for files without one: one for all, or one per file. [rev/min]
    airspeed_m_s : array_like
        Airspeed for files without one: one for all, or one per file; from the case by default. [m/s]
    density_kg_m3 : array_like
        Density of the air for files that record none, the same way; from the case by default. [kg/m3]
    repeatability_pct : float, optional
        What runs of this stand differ by, standard deviation; 0.2 to 2, from the readings, by default. [%]
    top_rpm : float, optional
        Fastest that the stand may run: no run beyond it is asked for. [rev/min]
    unit : mapping
        Unit of a quantity or heading of every table, or of a CFD run, that states none: thrust=N.
    column : mapping
        Heading of a quantity, in every table or in the exports of a CFD run: thrust=fz.
    sign : mapping
        Sign of a load: torque=-1; -1 alone turns all.
    pole_pairs : int, optional
        Of the motor, where the speed of every table counts electrical revolutions; 14 magnets are 7 pairs.
    zones : sequence of str
        Runs of CFD: zones whose loads count.
    along : path, optional
        Blade loads (radial.csv of a campaign), compared with the first case.
    out : path, optional
        Folder for diagnosis.json, figures and the improved cases.
    figures : bool
        Draw the figures into the folder.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Answer
        ``.verdict``, ``.effects``, ``.text``, ``.to_dict()``, ``.plot(folder)``, ``.improved``. For a single point,
        which cannot be diagnosed, the point beside the model, with the verdict ``insufficient``.

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
    >>> bemt.diagnose(points, p).verdict
    'none'
    """
    from bemt.judge.diagnose.ask import diagnosed
    from bemt.judge.import_files import words

    return diagnosed(
        recordings, case, reference, reference_case, only=only, ruled_out=ruled_out, changed=changed, off=off,
        baseline=baseline, channels=channels, rpm=rpm, airspeed_m_s=airspeed_m_s, density_kg_m3=density_kg_m3,
        repeatability_pct=repeatability_pct, top_rpm=top_rpm, along=along, out=out, figures=figures, progress=progress,
        run={"unit": words(unit), "column": words(column), "sign": words(sign), "pole_pairs": pole_pairs,
             "zones": list(zones)},
    )  # fmt: skip


@action(
    "Recordings", "compare monday.csv tuesday.csv --case cases/prop_8x5", words=("a", "b"), shown=True,
    common=("case", "rows_a", "rows_b", "air_a", "air_b", "ruled_out", "changed", "out"),
    elsewhere=dict.fromkeys(("--density-kg-m3", "--airspeed-m-s"), "Each run has its own: --air-a 1.19kg/m3,5m/s.")
    | dict.fromkeys(("", "--reference"), "A is the reference; several: bemt diagnose B --reference A1 A2 --case CASE."),
)  # fmt: skip
def compare(
    a: Recording, b: Recording | None = None, *, case: Propeller | Path | None = None, label: str | None = None,
    diameter_m: float | None = None, rows_a: Sequence[str] = (), rows_b: Sequence[str] = (), air_a: str | None = None,
    air_b: str | None = None, ruled_out: Sequence[str] = (), changed: Sequence[str] = (),
    rpm: float | None = None, unit: Mapping[str, str] = {}, column: Mapping[str, str] = {},  # noqa: B006
    sign: Mapping[str, str] = {}, pole_pairs: Count | None = None, zones: Sequence[str] = (),  # noqa: B006
    out: Path | None = None, figures: bool = True, progress: Callable[[str], None] | None = None,
) -> Contrast | Told:  # fmt: skip
    r"""Say what changed between two recordings, or compare one CFD run with BEMT.

    Parameters
    ----------
    a : path, Dataset or DataFrame
        First recording, before or without the change.
    b : path, Dataset or DataFrame, optional
        Second recording, after or with the change; without it `a` is one CFD run, compared with BEMT of the case.
    case : Propeller, str or path, optional
        Case or label of the rotor: `b` is diagnosed with `a` as its reference. Without it, causes that scale like the
        ratios are named.
    label : str, optional
        Label such as 10x5; it gives the diameter for the advance ratio.
    diameter_m : float, optional
        The diameter instead of a label. [m]
    rows_a, rows_b : sequence of str
        Rows of `a` or `b` to use: column=text, column=number, column=low:high, rotor=left.
    air_a, air_b : str, optional
        Air of `a` or `b`, overrides the recording: 22C,1013hPa, or only 22C, or 1.19kg/m3; wind: 18m/s, 35kt.
    ruled_out : sequence of str
        Effects that a check has ruled out.
    changed : sequence of str
        Effects that you changed, such as propeller ("these are two propellers"): said, weighed, checked.
    rpm : float, optional
        Speed of files without one, tables or exports of CFD. [rev/min]
    unit : mapping
        Unit of a quantity or heading of both tables, or of one CFD run, that states none: thrust=N.
    column : mapping
        Heading of a quantity, in both tables or in the exports of one CFD run: thrust=fz.
    sign : mapping
        Sign of a load: torque=-1; -1 alone turns all.
    pole_pairs : int, optional
        Of the motor, where the speed of both tables counts electrical revolutions; 14 magnets are 7 pairs.
    zones : sequence of str
        One CFD run: zones whose loads count.
    out : path, optional
        Folder for comparison.json, its text and a picture.
    figures : bool
        Draw the picture into the folder.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Contrast
        ``.verdict``, ``.effects``, ``.text``, ``.to_dict()`` in the format ``bemt.comparison/1``.

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
    ('class', ('thrust_gain', 'coaxial_neighbour', 'section', 'duct'))
    """
    from bemt.base.errors import Fault, InputError
    from bemt.base.given import number, path_text
    from bemt.judge.diagnose import contrast
    from bemt.judge.diagnose.load import is_table
    from bemt.judge.import_files import words

    if diameter_m is not None and not 0.01 <= number("diameter_m", diameter_m) <= 10.0:
        raise InputError(Fault("", "diameter_m", f"{diameter_m:g}", "0.01 to 10 m", "Is that in mm? Divide by 1000"))
    one = a if is_table(a) else path_text("a", a)
    two = b if b is None or is_table(b) else path_text("b", b)
    return contrast.compared(
        one, two, case, label=label, diameter_m=diameter_m, rows_a=rows_a, rows_b=rows_b, air_a=air_a, air_b=air_b,
        ruled_out=ruled_out, changed=changed, out=None if out is None else path_text("out", out), figures=figures,
        progress=progress, run={"rpm": rpm, "unit": words(unit), "column": words(column), "sign": words(sign),
                                "pole_pairs": pole_pairs, "zones": list(zones)},
    )  # fmt: skip


@action("Recordings", "plan points.csv --case cases/prop_8x5", words=("points",))
def plan(
    points: Recording | Mapping[str, ArrayLike], case: Propeller | Path, *, off: Sequence[str] = (),
    out: Path | None = None, progress: Callable[[str], None] | None = None,
) -> Plan:  # fmt: skip
    """Say which effects a set of test points can see, before anyone measures.

    Parameters
    ----------
    points : path, Dataset, DataFrame or mapping
        Columns ``rpm``, ``airspeed_m_s``, ``time_s`` and others, one row per point; no loads.
    case : Propeller, str or path
        Propeller, case or label.
    off : sequence of str
        Effects to leave out of the baseline.
    out : path, optional
        Folder for plan.json.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Plan
        ``.detectable``, ``.text``, ``.to_dict()``.

    Raises
    ------
    InputError
        For points without a speed of rotation.

    Examples
    --------
    >>> p = plan({"rpm": [4000, 6000, 8000]}, "10x5")
    >>> set(p.detectable.values()) <= {"yes", "maybe", "no"}, p.to_dict()["schema"], len(p.text) > 100
    (True, 'bemt.plan/1', True)
    >>> plan({"airspeed_m_s": [0.0]}, "10x5")
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: points: got columns airspeed_m_s; expected a column rpm.
    """
    from pathlib import Path as File

    from bemt.base.tables import json_text, write_atomic
    from bemt.judge.diagnose import plan as planning
    from bemt.judge.diagnose.load import cases_of

    (rotor,) = cases_of([case], off, 1)
    found = planning.plan(planning.given(points, rotor), rotor, progress)
    if out is not None:
        write_atomic(File(out) / "plan.json", json_text(found.to_dict()))
    return found


@action("Recordings", "calibrate-rotor static.csv --case cases/prop_10x5 --out measured_10x5", words=("recordings",))
def calibrate_rotor(
    recordings: Path | Sequence[Path], case: Propeller | Path, *, out: Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> CalibratedRotor:  # fmt: skip
    r"""Learn a rotor's blade as built from clean runs of it.

    Parameters
    ----------
    recordings : path or sequence of paths
        Runs of this rotor with nothing else changed; best a static one and a flight point.
    case : Propeller or path
        Its case, in a file: what is learnt is written next to a copy of it.
    out : path, optional
        Folder for the case of the rotor as measured.
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
    >>> import bemt, tempfile
    >>> from pathlib import Path
    >>> folder = Path(tempfile.mkdtemp())
    >>> case = bemt.propeller("10x5").write(folder / "case")
    >>> d = bemt.load(case).solve(rpm=[4000, 6000, 8000])
    >>> rows = [f"{n},{T:.4f},{Q:.5f}" for n, T, Q in zip(d.rpm, 1.05 * d.thrust_N, 1.05 * d.torque_Nm)]
    >>> _ = (folder / "run.csv").write_text("\n".join(["rpm,thrust_N,torque_Nm", *rows]))
    >>> rotor = calibrate_rotor(folder / "run.csv", case)
    >>> rotor.converged, rotor.to_dict()["points"], rotor.text.splitlines()[0].startswith("prop_10x5: 3 points")
    (True, 3, True)
    >>> measured = rotor.write(folder / "measured").solve(rpm=6000)
    >>> bool(measured.u["thrust_N"][0] < 0.7 * d.u["thrust_N"][1])
    True
    """
    from bemt.base.given import path_text, paths_text
    from bemt.judge.diagnose.rotor_calibration import CalibratedRotor, calibrate, write
    from bemt.rotors.propeller import load, rotor_of

    paths = tuple(paths_text("recordings", recordings, 1))
    rotor, found = calibrate(paths, rotor_of(case).case.path.as_posix(), progress)
    folder = None if out is None else path_text("out", out)
    files = () if folder is None else write(rotor, found, paths, folder)
    return CalibratedRotor(load(rotor.path), found, paths, folder, tuple(files))


@action("Models and checks", "prove --seed 1")
def prove(
    *, size: Literal["small", "full", "stand", "ccblade", "real"] = "small", seed: int | None = None,
    jobs: Count | None = None, loop: Count | None = None, fixed: bool = False,
    wired: bool = False, out: Path | None = None, progress: Callable[[str], None] | None = None,
) -> Told:  # fmt: skip
    """Hide causes in recordings, diagnose them, score the answers.

    Parameters
    ----------
    size : {"small", "full", "stand", "ccblade", "real"}
        Items: small makes 41, full 605, stand 60 for a stand, ccblade 68 (extra wisdem); real is published recordings.
    seed : int, optional
        Random seed; from the operating system by default.
    jobs : int, optional
        Parallel diagnoses; one per core by default.
    loop : int, optional
        Then take the runs that open answers recommend, up to so many each, on the hidden stand.
    fixed : bool
        With a loop: a fixed programme of runs instead.
    wired : bool
        With a loop and size stand: measure everything on simulated stands in other processes, through their wire.
    out : path, optional
        Folder that keeps items, key, answers and score.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Told
        Schema ``bemt.proof/1``; ``exit_code`` 0 if every target is met, 1 if some are missed.

    Raises
    ------
    InputError
        For a loop without a folder.

    Examples
    --------
    >>> prove(loop=3)
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: loop: got size small without out; expected generated items and out.
    """
    import os
    from pathlib import Path as File

    from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED, Fault, InputError
    from bemt.base.plugins import load, missing, offered
    from bemt.judge.proof import loop as looping
    from bemt.judge.proof import score
    from bemt.judge.proof.prove import prove as run

    got, hands = f"size {size}" + ("" if out else " without out"), offered("HANDS").get("wired") if wired else None
    for wrong, option, told, expected, *hint in (
        (loop and not (out and size != "real"), "--loop", got, "generated items and out"),
        ((seed or 0) < 0, "--seed", f"{seed}", "a whole number of 0 or more"),
        (wired and not (loop and size == "stand"), "--wired", got, "size stand and a loop"),
        (wired and not hands, "--wired", "no simulated stand", "the stand tool", missing("stand")),
    ):
        if wrong:
            raise InputError(Fault(option, "", told, expected, *hint))
    say, cores = progress or (lambda line: None), jobs or os.cpu_count() or 1
    found = run(None if out is None else os.fspath(out), size, seed, jobs, say, lambda line: say(f"{line}\n"))
    parts = [score.text(found)]
    if loop:
        parts.append(looping.loop(File(out or "."), loop, cores, fixed, say, load(hands) if hands else None).text)
    code = EXIT_OK if all(row.met is not False for row in found.score) else EXIT_UNCONVERGED
    return Told(found.document(), "\n\n".join(parts), exit_code=code)
