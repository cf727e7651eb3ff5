"""Actions on cases: sweep, report, and the list of effects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from bemt.base.action import Count, Told, action

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Sequence

    from bemt.results.sweep.answer import SweepAnswer

    Path = str | os.PathLike[str]

__all__ = ["effects", "report", "sweep"]


@action(
    "Propellers and fans", "sweep cases/", words=("cases",), shown=True,
    common=("out", "jobs", "strict", "tolerance_pct", "resume"),
)  # fmt: skip
def sweep(
    cases: Path | Sequence[Path] = ".", *, out: Path | None = None, jobs: Count | None = None, strict: bool = False,
    tolerance_pct: float | None = None, resume: bool = True, engine: Literal["local", "dask"] = "local",
    scheduler: str | None = None,
    progress: Callable[[str], None] | None = None,
) -> SweepAnswer:  # fmt: skip
    """Solve cases and compare them with recorded values.

    Parameters
    ----------
    cases : path or sequence of paths
        Case files, or folders of <name>/case.toml; this folder by default.
    out : path, optional
        Folder for tables, grids and sweep.json; the sweep resumes from it.
    jobs : int, optional
        Solve so many cases in parallel; by default one case, its grid on all cores. With dask: local workers.
    strict : bool
        End with 1 if a point is unconverged or BEMT differs from a reference by more than the tolerance.
    tolerance_pct : float, optional
        Thrust tolerance of strict, percent of the reference; 15 by default. [%]
    resume : bool
        Reuse results found in the folder.
    engine : {"local", "dask"}
        Where to solve grids: this machine or a Dask cluster; the results are identical.
    scheduler : str, optional
        With dask: an existing cluster such as tcp://host:8786; processes on this machine by default.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    SweepAnswer
        ``.text`` (one screen), ``.details`` (every case in full), ``.to_dict()`` (schema ``bemt.sweep/1``).

    Raises
    ------
    InputError
        If no case is found, or the folder cannot be written. Faults of single cases are in the answer.

    Examples
    --------
    >>> import bemt
    >>> answer = bemt.sweep("cases/prop_8x5")
    >>> print(answer.text.splitlines()[1].split()[:3])
    ['prop_8x5', '20000', '27.1']
    """
    from bemt.base.errors import Fault, InputError
    from bemt.base.given import path_text, paths_text
    from bemt.results.sweep.answer import sweep as run

    tolerance = 15.0 if tolerance_pct is None else tolerance_pct
    if not 0.0 <= tolerance < float("inf"):
        raise InputError(Fault("", "--tolerance-pct", f"{tolerance:g}", "a finite number of 0 or more"))
    if tolerance_pct is not None and not strict:
        raise InputError(Fault("", "--tolerance-pct", f"{tolerance:g}", "--strict, which ends with 1 beyond it"))
    return run(
        paths_text("cases", cases), None if out is None else path_text("out", out), jobs=jobs, resume=resume,
        progress=progress or (lambda line: None), engine=engine, scheduler=scheduler,
        tolerance=tolerance if strict else None,
    )  # fmt: skip


@action(
    "Propellers and fans", "report cases/ --out reports", words=("cases",), shown=True,
    common=("out", "recording", "reference", "title", "author"),
)  # fmt: skip
def report(
    cases: Path | Sequence[Path] = (), *, out: Path, recording: Path | Sequence[Path] = (),
    reference: Path | Sequence[Path] = (), title: str = "", author: str = "", date: str | None = None,
    commit: str | None = None, progress: Callable[[str], None] | None = None,
) -> Told:  # fmt: skip
    """Write the validation report of cases: one HTML file that opens from disk, and a summary in Markdown.

    Parameters
    ----------
    cases : path or sequence of paths
        Case files, or folders of cases; this folder by default.
    out : path
        Folder for the report and its sweep.
    recording : path or sequence of paths
        Recordings of the one case: diagnosed together, and shown on its page inside the prediction.
    reference : path or sequence of paths
        Recordings from the same stand without the cause, as in a diagnosis.
    title : str
        Title; that of the case if there is one, else Validation report.
    author : str
        Author, shown under the title.
    date : str, optional
        Date under the title; today by default.
    commit : str, optional
        Revision under the title; by default the last commit where the cases lie.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Told
        The files that were written; ``exit_code`` is that of the sweep behind it.

    Raises
    ------
    InputError
        If no case is found, or the folder cannot be written.

    Examples
    --------
    >>> report("no/such/case", out="out")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    bemt.base.errors.InputError: no/such/case: got ...
    """
    import datetime
    from pathlib import Path as File

    from bemt.base.checkout import commit as checked_out
    from bemt.base.given import path_text, paths_text
    from bemt.results.report import HTML_NAME, write
    from bemt.rotors.case.words import sorted_out

    given, own = sorted_out(paths_text("cases", cases), paths_text("recording", recording))
    given, known = given or ["."], paths_text("reference", reference)
    about = {"title": title, "author": author, "date": datetime.date.today().isoformat() if date is None else date}
    revision = checked_out(File(given[0])) if commit is None else commit
    about |= {"revision": f"commit {revision}"} if revision else {}
    book, files = write(given, path_text("out", out), progress or (lambda line: None), about, own, known)
    count = len(book.cases)
    size = f": {files[0].stat().st_size / 1e6:.2f} MB, {count} case{'s' * (count != 1)}"
    lines = [f"{file}{size if file.name == HTML_NAME else ''}" for file in files]
    faults = tuple(str(fault) for page in book.cases for fault in page.result.faults)
    document = {"schema": "bemt.report/1", "files": [str(file) for file in files], "exit_code": book.exit_code}
    return Told(document, "\n".join(lines), exit_code=book.exit_code, complaints=faults,
                files=tuple(files))  # fmt: skip


@action("Models and checks", "effects")
def effects() -> Told:
    """List every effect: parameters, ranges, sources, signature.

    Returns
    -------
    Told
        Schema ``bemt.effects/1``.

    Examples
    --------
    >>> len(effects().to_dict()["effects"]) > 30
    True
    """
    from bemt.results.report import effects_list

    return Told(effects_list.document(), effects_list.text())
