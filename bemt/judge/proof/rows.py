"""What the proof keeps: key and entries, answers as far as they are read, the document of a score.

The seal is a key that is fixed before the diagnosis begins, and the check that nothing was changed since.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any, Self

from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError
from bemt.base.tables import json_text, write_atomic

Names = set[str]  # An entry has a field of that name


class TrueValue(Documented):
    """Parameter of a concealed cause."""

    value: float
    unit: str = ""


class Entry(Documented):
    """What the key says of an item; by cause where it is a sequence."""

    folder: str = ""
    files: Mapping[str, str] = field(default_factory=dict)  # SHA-256 by name
    set: str = ""
    causes: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    strengths: tuple[float, ...] = ()
    parameters: Mapping[str, Mapping[str, TrueValue]] = field(default_factory=dict)
    separation: tuple[float, ...] = ()  # Over noise and nuisances, over noise alone [1]
    separation_noise: tuple[float, ...] = ()
    alike: tuple[tuple[str, ...], ...] = ()  # Causes that the plan cannot tell from it
    variables: tuple[tuple[str, ...], ...] = ()  # Along which it shows
    plan: str = ""
    rig: str = ""
    ducted: bool = False
    seed: int = 0
    referenced: bool | None = None
    stated: bool | None = None
    air_known: bool | None = None
    rows: int = 0
    stand: Mapping[str, Any] = field(default_factory=dict)
    separation_together: tuple[float, float] | None = None  # Of a pair, when the other may take what it can
    reason: str | None = None

    @property
    def seen(self) -> Sequence[float]:
        """Separation of each cause beside the others. [1]"""
        return self.separation_together or self.separation

    @property
    def allowed(self) -> list[Names]:
        """Names that stand for each cause."""
        return [{c, *a} for c, a in zip(self.causes, self.alike, strict=True)]


class Key(Documented):
    """A sealed key."""

    schema: str
    version: str
    seed: str
    size: str
    items: tuple[Entry, ...] = ()


class Estimate(Documented):
    """Parameter that an answer tells, with its 90 % interval."""

    value: Any = None
    low: float = math.nan
    high: float = math.nan


class Ranked(Documented):
    """One explanation."""

    effect: str
    probability: float = math.nan
    parameters: Mapping[str, Estimate] = field(default_factory=dict)


class ToldFit(Documented):
    """Errors of a channel."""

    noise: float = math.nan
    gp_only: float = math.nan
    holdout_before: float = math.nan
    holdout_after: float = math.nan


class ToldLocation(Documented):
    """Where the residual lies."""

    variable: str = ""
    ties: tuple[str, ...] = ()


class Step(Documented):
    """What an answer recommends."""

    kind: str = ""
    commands: tuple[str, ...] = ()
    points: tuple[Mapping[str, float], ...] = ()
    separates: tuple[str, ...] = ()
    checks: str | None = None
    otherwise: Step | None = None


class ToldAnswer(Documented):
    """A diagnosis or comparison, as far as the proof reads it; without a verdict, none."""

    verdict: str = ""
    effects: tuple[str, ...] = ()
    ranking: tuple[Ranked, ...] = ()
    sets: tuple[tuple[str, ...], ...] = ()
    fit: Mapping[str, ToldFit] = field(default_factory=dict)
    location: ToldLocation | None = None
    next_measurement: Step | None = None
    log_bayes: Mapping[str, float] | None = None
    nearest_signature: str | None = None
    probability: float = 0.0
    inclusion: Mapping[str, float] = field(default_factory=dict)
    confirmed: bool = False
    whole: Mapping[str, Any] = field(default_factory=dict)  # As printed

    def __bool__(self) -> bool:
        """Whether there is an answer."""
        return bool(self.verdict)

    def document(self) -> dict[str, object]:
        """The answer as it was printed, with what a check has found since."""
        now = {"effects": list(self.effects), "confirmed": True} if self.confirmed else {}
        return {**self.whole, "verdict": self.verdict, **now}

    @classmethod
    def from_document(cls, document: Any, lenient: bool = True) -> Self:
        """Answer of a printed document; what has another type counts as not said."""
        whole = document if isinstance(document, Mapping) else {}
        return replace(super().from_document(whole, True), whole=whole)

    @property
    def step(self) -> Step:
        """Recommended step, an empty one where there is none."""
        return self.next_measurement or Step()

    @property
    def sure(self) -> float:
        """Its probability, 0 where none is told. [1]"""
        return 0.0 if math.isnan(self.probability) else self.probability


class Stored(Documented):
    """File of an answer."""

    answer: ToldAnswer = ToldAnswer()
    error: str = "no answer"
    seconds: float = math.nan


class ScoreRow(Documented):
    """A row of the score table."""

    what: str  # Metric
    # Count, of how many; for medians the count of values. [-]
    hits: int
    n: int
    # Share or median, with its 95 % Wilson interval (NaN for medians). [-]
    value: float
    low: float
    high: float
    target: str  # Wanted
    met: bool | None  # Whether the value meets the target; None without data


class Reliability(Documented):
    """Printed probabilities of effects between two limits, and how often these effects were there."""

    reference: bool  # Whether the items had one
    low: float
    high: float
    n: int
    stated: float  # Mean of what was printed [1]
    there: int  # How many of the effects were at work


class Stratum(Documented):
    """Single causes between two separations."""

    low: float
    high: float
    n: int
    top1: int
    claims: int
    right: int


class Miss(Documented):
    """An item that was not answered as it should be."""

    folder: str
    set: str
    causes: tuple[str, ...]
    plan: str
    rig: str
    separation: float
    alike: tuple[tuple[str, ...], ...]
    said: str
    verdict: str | None
    effects: tuple[str, ...]
    ranking: tuple[tuple[str, float], ...]
    error: str


class Proof(Documented):
    """Document of a proof."""

    schema: str
    version: str
    size: str
    seed: str
    commit: str
    key_sha256: str
    items: int
    score: tuple[ScoreRow, ...]
    baselines: tuple[ScoreRow, ...]
    strata: tuple[Stratum, ...]
    confusion: Mapping[str, Mapping[str, int]]
    reliability: tuple[Reliability, ...] = ()
    answers: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    misses: tuple[Miss, ...] = ()
    seconds_median: float = math.nan
    seconds: Mapping[str, float] | None = None  # Spent on concealing and on diagnosing


KEY, SEAL = "key.json", "key.sha256"


def sha256(text: str) -> str:
    """Hash of a text.

    Examples
    --------
    >>> sha256("")[:8]
    'e3b0c442'
    """
    return hashlib.sha256(text.encode()).hexdigest()


def seal(folder: Path, key: Key) -> str:
    """Write a key and its hash."""
    text = json_text(key.document())
    folder.mkdir(parents=True, exist_ok=True)
    write_atomic(folder / KEY, text)
    digest = sha256(text)
    write_atomic(folder / SEAL, digest + "\n")
    return digest


def unseal(folder: Path, digest: str | None = None) -> Key:
    """Read a key after checking it and every file that it vouches for."""
    path = folder / KEY
    try:
        text = path.read_text(encoding="utf-8")
        wanted = digest or (folder / SEAL).read_text(encoding="utf-8").strip()
    except OSError as error:
        raise InputError(Fault(str(error.filename), "", "no such file", "the key and its seal of a proof")) from error
    if sha256(text) != wanted:
        raise InputError(Fault(path.as_posix(), "", f"SHA-256 {sha256(text)}", wanted, "The key was changed"))
    key = Key.from_document(json.loads(text))
    faults = []
    for item in key.items:
        for name, known in item.files.items():
            file = folder / "items" / item.folder / name
            try:
                found = sha256(file.read_text(encoding="utf-8"))
            except (OSError, UnicodeDecodeError):
                found = "nothing readable"
            if found != known:
                faults.append(Fault(file.as_posix(), "", found, f"SHA-256 {known}", "The file was changed"))
    if faults:
        raise InputError(faults)
    return key


def stored(file: Path) -> Stored:
    """What a file of an answer holds; no answer where there is no file."""
    return Stored.from_document(json.loads(file.read_text(encoding="utf-8"))) if file.exists() else Stored()
