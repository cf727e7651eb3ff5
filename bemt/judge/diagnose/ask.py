"""A diagnosis as both doors ask for it: recordings of any kind, cases and what the user knows give an `Answer`."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.action import Told
from bemt.base.errors import Fault, InputError, refuse, system_fault
from bemt.base.given import number, numbers, path_text
from bemt.data.recordings.grids import together
from bemt.data.recordings.load import as_stated, import_file, stated_options
from bemt.data.recordings.shown import options_of
from bemt.judge.compare import one_run
from bemt.judge.diagnose import figures as pictures
from bemt.judge.diagnose import folder, other_rotor
from bemt.judge.diagnose.along_blade import AlongBlade
from bemt.judge.diagnose.along_blade import along as along_blade
from bemt.judge.diagnose.answer import Diagnosis
from bemt.judge.diagnose.chain import diagnose
from bemt.judge.diagnose.document import document, text
from bemt.judge.diagnose.load import cases_of, load_all
from bemt.judge.diagnose.record import Record
from bemt.judge.diagnose.suggest import Given
from bemt.judge.loss import CLAIMS, VerdictAnswer
from bemt.rotors.case import Case, case_of
from bemt.rotors.case.words import sorted_out
from bemt.rotors.propeller import Propeller, rotor_of

if TYPE_CHECKING:
    import pandas as pd

CHANNELS = {"thrust": "thrust_N", "torque": "torque_Nm", "speed": "rpm"}
REPEATABILITY_MAX = 20.0
"""Beyond this runs do not repeat [%]."""


@dataclass(frozen=True, eq=False)
class Answer(VerdictAnswer):
    """Result of a diagnosis, returned by :func:`diagnose`.

    Parameters
    ----------
    diagnosis : bemt.judge.diagnose.answer.Diagnosis
        The complete result.
    propeller : Propeller
        The propeller that was compared with the recording.
    document : dict
        Plain values of schema ``bemt.diagnosis/1``.
    blade : dict
        Blade loads beside the model, where they were given.

    Examples
    --------
    The blades of this recording are 1.5 deg steeper than those of its reference:

    >>> import numpy as np
    >>> from bemt import diagnose, propeller
    >>> p = propeller("10x5")
    >>> rpm, J = np.repeat([5000.0, 10000.0, 15000.0], 6), np.tile(np.linspace(0.0, 0.5, 6), 3)
    >>> turned = p.replaced({"blade.beta_offset_deg": 2.2}).solve(rpm, J=J, bands=False)
    >>> answer = diagnose(turned, p, reference=p.solve(rpm, J=J, bands=False), only=["pitch_offset", "torque_gain"])
    >>> answer
    <answer on prop_10x5: named pitch_offset>
    >>> answer.verdict, answer.effects, answer.to_dict()["schema"]
    ('named', ('pitch_offset',), 'bemt.diagnosis/1')
    >>> print(answer.text.splitlines()[0])
    Cause found: wrong blade angle (+1.5 deg), probability above 0.99.
    >>> improved = answer.improved.solve(rpm, J=J, bands=False)
    >>> bool(np.max(np.abs(improved.thrust_N / turned.thrust_N - 1)) < 0.02)
    True
    >>> import tempfile
    >>> "before_after.png" in {file.name for file in answer.plot(tempfile.mkdtemp())}
    True
    """

    diagnosis: Diagnosis
    propeller: Propeller
    document: dict[str, Any]
    blade: dict[str, AlongBlade]
    beside: str = ""  # How all readings lie to the band of the case, where they lie alike and no cause is claimed

    def __repr__(self) -> str:
        """Say the verdict in a line."""
        return f"<answer on {self.propeller.name}: {' '.join((self.verdict, ', '.join(self.effects))).strip()}>"

    @property
    def text(self) -> str:
        """The answer as text, as on the command line."""
        return "\n\n".join([text(self.diagnosis, lead=self.beside), *(c.text() for c in self.blade.values())])

    @property
    def details(self) -> str:
        """All sentences, and the tables behind them."""
        return "\n\n".join([text(self.diagnosis, True, self.beside), *(c.text() for c in self.blade.values())])

    @property
    def improved(self) -> Propeller | None:
        """The propeller with the named effects switched on; None if nothing was named that can be simulated."""
        text = folder.improved_case(self.diagnosis, self.propeller.case, self.propeller.text)
        return Propeller(case_of(text, self.propeller.case.folder), text) if text else None

    def to_pandas(self) -> pd.DataFrame:
        """The ranking: a row for each explanation that was weighed, the likeliest first."""
        import pandas as pd

        return pd.DataFrame(self.document["ranking"])

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
        try:
            return pictures.draw(self.diagnosis, Path(path_text("folder", folder)))
        except OSError as error:
            raise InputError(system_fault(error)) from error


class OnePoint(VerdictAnswer, Told):
    """One point, which cannot be diagnosed, beside the model."""


def several(given: Any) -> list[Any]:
    """One or more things as a list; paths as text."""
    many = [] if given is None else list(given) if isinstance(given, (list, tuple)) else [given]
    return [os.fspath(one) if isinstance(one, os.PathLike) else one for one in many]


def diagnosed(
    recordings: Any, case: Any, reference: Any, reference_case: Any, *, only: Sequence[str], ruled_out: Sequence[str],
    changed: Sequence[str], off: Sequence[str], baseline: str, channels: Sequence[str], rpm: Any, airspeed_m_s: Any,
    density_kg_m3: Any, repeatability_pct: float | None, top_rpm: float | None, along: Any, out: Any, figures: bool,
    progress: Callable[[str], None] | None,
    run: Mapping[str, Any],
) -> Answer | OnePoint:  # fmt: skip
    """Diagnose, and write what is asked; parameters as `bemt.diagnose`."""
    given, files = sorted_out(several(case), several(recordings))
    known = several(reference)
    _both_there(given, files, known, reference_case, repeatability_pct, top_rpm)
    target = None if out is None else path_text("out", out)
    theirs = None if reference_case is None else cases_of([reference_case], off, 1)[0]
    flow = {k: numbers(k, v, finite=False).ravel().tolist() if np.size(v) else []
            for k, v in (("rpm", rpm), ("airspeed_m_s", airspeed_m_s), ("density_kg_m3", density_kg_m3))}  # fmt: skip
    speeds = flow["rpm"]
    stated = as_stated(files, {**run, **({"rpm": speeds[0]} if len(speeds) == 1 and any(run.values()) else {})})
    known_of = known if run["zones"] else as_stated(known, run)
    said = {"--only": only, "--ruled-out": ruled_out, "--changed": changed}
    cases, records = load_all(stated, given, known_of, off, said, before=lambda found: folder.check(target, found),
                              reference_case=theirs, **flow)  # fmt: skip
    repeats = np.nan if repeatability_pct is None else repeatability_pct / 100.0
    records = [replace(r, repeatability=repeats, top_rpm=np.inf if top_rpm is None else top_rpm) for r in records]
    chosen = cases * len(stated) if len(cases) == 1 else cases
    each = cases if theirs is None else [*chosen, *[theirs] * len(known)]
    rest = {
        "off": off, "only": only, "channels": channels, "reference-case": _named(several(reference_case), "CASE"),
        **{name.replace("_", "-"): v for name, v in flow.items()}, "repeatability-pct": several(repeatability_pct),
        "zones": run["zones"], "top-rpm": several(top_rpm), "baseline": [baseline] * (baseline != "bemt"),
    }  # fmt: skip
    own, others = (tuple(map(shlex.quote, _named(*f))) for f in ((files, "RECORDING"), (known, "REFERENCE")))
    of_case, more = (" ".join(options_of(w)) for w in ({"case": _named(given, "CASE")}, rest))
    asked = Given(own, others, of_case, more, tuple(ruled_out), tuple(changed), stated_options(run))
    heard = [CHANNELS[c] for c in channels] or None
    one = [flow[name][0] if len(flow[name]) == 1 else None for name in ("rpm", "airspeed_m_s")]
    blade = {} if along is None else along_blade(cases[0], Path(path_text("along", along)), records, *one)
    try:
        answer = diagnose(records, each, only or None, progress, baseline=baseline, given=asked, channels=heard)
    except InputError as error:
        if len(records) > 1 or any(f.where != "readings" for f in error.faults) or not isinstance(files[0], str):
            raise
        many = len(stated) > 1
        seen = [import_file(f) if isinstance(f, str) and many else f for f in stated]
        label = given[0] if isinstance(given[0], str) else ""
        beside = one_run.compare_run(together(seen) if many else seen[0], cases[0], progress, label)
        return _too_few(error, beside, blade)
    names = [one if isinstance(one, str) else "recording" for one in files]
    told = document(answer) | {"recordings": names, "cases": [c.name for c in cases]} | _along(blade)
    if target is not None:
        made = [rotor_of(one).text for one in given] if len(given) == len(cases) else []  # a label has no file
        folder.write(target, answer, told, cases, figures, made)
    lies = "" if answer.said.verdict in CLAIMS else _beside_band(answer, records, chosen)
    return Answer(answer, rotor_of(given[0] if len(given) == 1 and cases else cases[0]), told, blade, lies)


def _along(blade: Mapping[str, AlongBlade]) -> dict[str, Any]:
    """Loads along the blade as a part of a document, where there are any."""
    return {"along_blade": {name: c.document() for name, c in blade.items()}} if blade else {}


def _too_few(error: InputError, found: one_run.RunComparison, blade: Mapping[str, AlongBlade]) -> OnePoint:
    """One point, or grids of one condition, beside the model."""
    lead = f"Too few readings for a diagnosis ({error.faults[0].got}).\n{one_run.text(found)}"
    told = {**found.document(), "verdict": "insufficient", "effects": [], **_along(blade)}
    return OnePoint(told, "\n\n".join([lead, *(c.text() for c in blade.values())]))


def _beside_band(answer: Diagnosis, records: Sequence[Record], cases: Sequence[Case]) -> str:
    """That every reading lies inside the band of its case, and what that hides, or that none does; else ""."""
    own = [r for r in records if not r.reference]
    (view, *more) = pictures.first_picture(own, cases)
    counts = [view.inside(c)[:2] for c in view.channels]
    if more or not any(total for _, total in counts):
        return ""
    told, alone = view.sentence.partition(";")[0].rstrip("."), len(own) == len(records)
    if all(n == total for n, total in counts):
        wide = " and ".join(f"{100.0 * w:.0f} %" for w in map(view.width, view.channels) if np.isfinite(w))
        return f"{told}{f' (± {wide} wide: a level inside it tells nothing)' if alone and wide else ''}."
    doubted = other_rotor.foreign(answer.problem) or other_rotor.doubted(answer.problem, answer.said)
    if alone and not doubted and not any(n for n, _ in counts) and not answer.problem.findings:
        return f"{told}: are diameter, pitch and blades of the case those of this rotor?"
    return ""


def _both_there(
    cases: list[Any], files: list[Any], known: list[Any], theirs: Any, percent: float | None, top_rpm: float | None
) -> None:  # fmt: skip
    """Refuse a diagnosis without a recording or without a case."""
    faults = [] if files else [Fault("", "recordings", "none", "one or more tables or logs")]
    if theirs is not None and not known:
        faults.append(Fault("--reference-case", "", "no reference", "--reference RECORDING beside it"))
    faults += [] if cases else [Fault("--case", "", "no case", "the case of the rotor, as in cases/prop_8x5")]
    if percent is not None and not 0.0 < percent <= REPEATABILITY_MAX:
        expected = f"a percentage above 0 and up to {REPEATABILITY_MAX:g}"
        faults.append(Fault("--repeatability-pct", "", f"{percent:g}", expected))
    if top_rpm is not None and not number("top_rpm", top_rpm) > 0.0:
        faults.append(Fault("--top-rpm", "", f"{top_rpm:g}", "a speed above 0 rev/min"))
    refuse(faults)


def _named(given: Sequence[Any], word: str) -> list[str]:
    """Files as a command has them; objects of the library have a word in their place."""
    return [one if isinstance(one, str) else word for one in given]
