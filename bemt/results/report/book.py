"""What a report shows, typed: cases with their curves, diagnoses, pages of tools.

Arrays are along the abscissa that stands first; NaN where nothing is known.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from bemt.base.arrays import Array
from bemt.base.document import Documented
from bemt.data.recordings.grid_study import GridStudy
from bemt.physics.dataset import Dataset
from bemt.results.sweep.rows import Result, Row
from geometry.mesh import Surface

# Plain values that the report's templates show: parts of a section, pictures.

Part = tuple[str, Any]
"""What it is, and its value: words, command, verdict, table, list, figures, more (see `templates/report.html`)."""
Section = tuple[str, list[Part]]


@dataclass(frozen=True)
class Beside:
    """Parts beside a figure."""

    parts: list[Part]
    kind: ClassVar[str] = "block"


@dataclass(frozen=True)
class ShownAnswer:
    """A case in one sentence, with its badge and picture."""

    id: str
    title: str
    kind: str
    word: str
    words: str
    picture: str


@dataclass(frozen=True)
class Page:
    """A page of the menu."""

    id: str
    name: str  # In the menu
    title: str
    top: Sequence[Part]  # Above the sections
    sections: Sequence[Section]
    answers: Sequence[ShownAnswer] = ()


def sections(*found: Section) -> list[Section]:
    """Leave out what is empty: figures and tables of a part, parts of a section, sections."""
    out = []
    for title, parts in found:
        kept = [(kind, [f for f in value if f] if kind == "figures" else value) for kind, value in parts]
        kept = [(kind, value) for kind, value in kept if value]
        if any(kind != "words" for kind, _ in kept):
            out.append((title, kept))
    return out


def uri(data: bytes, kind: str = "png") -> str:
    """Embed a picture."""
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


@dataclass(frozen=True)
class Picture:
    """A picture with its words."""

    alt: str
    src: str
    narrow: bool = False
    kind: ClassVar[str] = "picture"


def picture(name: str, data: bytes, alt: str = "", narrow: bool = False) -> Picture:
    """Show a file, with its name in words if there are no others."""
    kind = "png" if name.endswith(".png") else "svg+xml"
    return Picture(alt or name.rpartition(".")[0].replace("_", " "), uri(data, kind), narrow)


@dataclass(frozen=True, eq=False)
class BladeCurves:
    """Blade over the radius."""

    r_over_R: Array
    chord_mm: Array
    beta_deg: Array


@dataclass(frozen=True, eq=False)
class CaseCurves:
    """BEMT with its bands and K1/K2, over J at the case's rpm and over rpm at its airspeed; flags of both."""

    over_J: Dataset
    over_rpm: Dataset
    k1k2_CT: Array  # Over J
    k1k2_thrust_N: Array  # Over rpm
    flags: Sequence[str]


@dataclass(frozen=True, eq=False)
class RadialCurves:
    """Loading along the blade at the case's own operating point."""

    r_over_R: Array
    dT_dr: Array
    dQ_dr: Array
    alpha_deg: Array
    M: Array


@dataclass(frozen=True, eq=False)
class Refinement:
    """Thrust and torque against the number of blade elements."""

    stations: Sequence[int]
    thrust_N: Array
    torque_Nm: Array
    used: int
    change_to_finest: float
    grid_study: GridStudy | None


class ShownParameter(Documented):
    """Parameter of an effect: a number with its 90 % interval, or a form of the law; None is one of another form."""

    value: Any = None
    low: float = math.nan
    high: float = math.nan
    unit: str = ""


class RankedEffect(Documented):
    """An explanation and its probability."""

    effect: str = ""
    probability: float = math.nan
    parameters: Mapping[str, ShownParameter] = field(default_factory=dict)


class FitErrors(Documented):
    """Errors of one channel."""

    before: float = math.nan
    after: float = math.nan
    noise: float = math.nan
    gp_only: float = math.nan
    holdout_before: float = math.nan
    holdout_after: float = math.nan


class Place(Documented):
    """Where the residual lies."""

    channel: str = ""
    variable: str = ""
    low: float = math.nan
    high: float = math.nan
    size: float = math.nan
    z: float = math.nan


class NextStep(Documented):
    """What to measure next."""

    text: str = ""
    commands: tuple[str, ...] = ()


class ShownDiagnosis(Documented):
    """A diagnosis (schema ``bemt.diagnosis/1``) as far as a page shows it."""

    verdict: str = ""
    effects: tuple[str, ...] = ()
    explanation: str = ""
    location: Place = Place()
    ranking: tuple[RankedEffect, ...] = ()
    fit: Mapping[str, FitErrors] = field(default_factory=dict)
    classes: tuple[tuple[str, ...], ...] = ()
    next_measurement: NextStep = NextStep()
    not_tried: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis in the folder of results with its figures (name, content)."""

    name: str
    told: ShownDiagnosis
    figures: Sequence[tuple[str, bytes]] = ()


@dataclass(frozen=True, eq=False)
class CasePage:
    """A case with what is drawn of it; the last four come from recordings beside its own."""

    result: Result
    files: Sequence[tuple[str, str]] = ()  # Name and SHA-256
    problems: tuple[str, ...] = ()
    surfaces: Sequence[Surface] = ()
    picture: bytes = b""
    blade: BladeCurves | None = None
    curves: CaseCurves | None = None
    radial: RadialCurves | None = None
    refinement: Refinement | None = None
    own_rows: Sequence[Row] = ()
    own_points: Sequence[tuple[str, str, float, float]] = ()  # Source, label, thrust and its u [N]
    own_radial: Mapping[str, Sequence[tuple[float, float, float]]] = field(default_factory=dict)
    """By name: radius [m], thrust [N/m] and torque [N] per radius."""
    diagnosis: Diagnosed | None = None


class About(Documented):
    """Head of the page, as far as wanted."""

    title: str = ""
    author: str = ""
    date: str = ""
    revision: str = ""


@dataclass(frozen=True, eq=False)
class Book:
    """Everything a report shows."""

    version: str
    cases: tuple[CasePage, ...]
    exit_code: int
    tools: tuple[Page, ...] = ()
    diagnoses: tuple[Diagnosed, ...] = ()
    about: About = About()
