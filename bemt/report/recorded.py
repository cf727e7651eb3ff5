"""A user's own recordings of a case: diagnosed into the folder of the report, where its page finds them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from bemt.base.errors import Fault, InputError
from bemt.case import find_cases

__all__ = ["diagnose_into"]


def diagnose_into(
    paths: Sequence[str | Path], recordings: Sequence[str], out: Path, progress: Callable[[str], None] | None = None
) -> None:
    """Diagnose recordings of one case into ``out/NAME/diagnosis``.

    Parameters
    ----------
    paths : sequence of path
        The cases of the report: one.
    recordings : sequence of str
        Tables, logs or CFD runs of its rotor, analysed together.
    out : Path
        Folder of the report.
    progress : callable, optional
        Told what is being done.

    Raises
    ------
    InputError
        If there are several cases, or a file cannot be used.
    """
    from bemt.diagnose import folder
    from bemt.diagnose.chain import diagnose
    from bemt.diagnose.document import document
    from bemt.diagnose.load import load_all

    cases = find_cases(paths)
    if len(cases) != 1:
        raise InputError(Fault("--recording", "", f"{len(cases)} cases", "one case, the rotor that was recorded"))
    found, records = load_all(list(recordings), [str(cases[0])])
    target = (out / found[0].name / "diagnosis").as_posix()
    folder.check(target, found)
    answer = diagnose(records, found, None, progress)
    told: dict[str, Any] = document(answer) | {"recordings": list(recordings), "cases": [c.name for c in found]}
    folder.write(target, answer, told, found)
