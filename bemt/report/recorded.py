"""A user's own recordings of a case: diagnosed into the folder of the report, where its page finds them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from bemt.base.errors import Fault, InputError
from bemt.base.tables import json_text, write_atomic
from bemt.case import find_cases

__all__ = ["diagnose_into"]


def diagnose_into(
    paths: Sequence[str | Path], recordings: Sequence[str], out: Path, progress: Callable[[str], None] | None = None
) -> None:
    """Diagnose recordings of the one case of a report into ``out/NAME/diagnosis``.

    They are analysed together; too few readings are shown beside the model.
    """
    from bemt.compare.one_run import compare_run
    from bemt.diagnose import folder
    from bemt.diagnose.chain import diagnose
    from bemt.diagnose.document import document
    from bemt.diagnose.figures_recording import FIRST, first_picture
    from bemt.diagnose.load import load_all

    cases = find_cases(paths)
    if len(cases) != 1:
        raise InputError(Fault("--recording", "", f"{len(cases)} cases", "one case, the rotor that was recorded"))
    found, records = load_all(list(recordings), [str(cases[0])])
    target = (out / found[0].name / "diagnosis").as_posix()
    folder.check(target, found)
    about: dict[str, Any] = {"recordings": list(recordings), "cases": [c.name for c in found]}
    try:
        answer = diagnose(records, found, None, progress)
    except InputError as error:
        if len(recordings) > 1 or any(f.where != "readings" for f in error.faults):
            raise
        told = compare_run(recordings[0], found[0], progress) | about
        few = f"Too few readings for a diagnosis ({error.faults[0].got}). {told['sentence']} Next: {told['next']}."
        told |= {"verdict": "insufficient", "effects": [], "explanation": few}
        write_atomic(Path(target) / "diagnosis.json", json_text(told))
        write_atomic(Path(target) / f"{FIRST}.png", first_picture(records, found)[0].png())
        return
    folder.write(target, answer, document(answer) | about, found)
