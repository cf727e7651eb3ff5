"""What the answer for a case stands on: the source of each effect, table and data set that takes part."""

from __future__ import annotations

import re
import shutil
import textwrap
import unicodedata
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from bemt.data.readers import references as reference_file
from bemt.physics.effects import source_of
from bemt.rotors.case import Case
from bemt.rotors.measured import records

SCHEMA = "bemt.sources/1"
YEAR = 2026
"""Of this version."""
BEMT = ("bemt, propellers and ducted fans by blade element momentum theory, compared with recordings, version {}; "
        "CITATION.cff gives the entry to cite")  # fmt: skip
METHOD = (
    "Blade element momentum theory: Glauert (1935), Airplane Propellers, in Durand, Aerodynamic Theory IV, ch. VII; "
    "one residual in the inflow angle: Ning (2014), Wind Energy 17:1327, doi:10.1002/we.1636"
)
DUCT = (
    "control volume of rotor and duct: McCormick (1967), Aerodynamics of V/STOL Flight, ch. 9; Pereira (2008), PhD "
    "thesis Univ. of Maryland, eq. 2.20-2.40; walls as ring vortices: Kuechemann and Weber (1953), Aerodynamics of "
    "Propulsion, ch. 4 and 6; not checked; jet: Drela and Youngren (2005), Axisymmetric Analysis and Design of Ducted "
    "Rotors; not checked; Bontempo and Manna (2013), J. Fluid Mech. 728:163; not checked; swirl in the jet: Glauert "
    "(1935); Horlock (1958), Axial Flow Compressors, ch. 4; not checked; lip: Crane TP-410, p. A-29; Idelchik (2007), "
    "Handbook of Hydraulic Resistance, diagram 3-4; not checked; walls: Hoerner (1965), Fluid-Dynamic Drag, ch. 3 and "
    "6; not checked"
)
TABLES = (
    "NeuralFoil (Sharpe 2024, github.com/peterdsharpe/NeuralFoil), a fit to XFOIL (Drela 1989, in Low Reynolds Number "
    "Aerodynamics, Springer)"
)
K1K2 = (
    "K1/K2 formula, for comparison: Staples (2013), Propeller Static & Dynamic Thrust Calculation, "
    "electricrcaircraftguy.com"
)
RULE = (
    "section rule of this project (bemt/physics/sections/rule.py), calibrated on UIUC volume 1: "
    "NACA four-digit section, n_crit {}, drag times {}"
)


@dataclass(frozen=True)
class Source:
    """One thing that an answer stands on.

    Parameters
    ----------
    kind : str
        ``method``, ``effect``, ``sections``, ``band``, ``comparison`` or ``data``.
    name : str
        Effect, table or file.
    source : str
        Law and reference; "not checked" marks a formula whose source could not be read.
    """

    kind: str
    name: str
    source: str


class Sources(tuple[Source, ...]):
    """Sources of an answer, returned by :func:`bemt.cite`."""

    case = ""  # name of the case
    as_bibtex = False  # whether the text is BibTeX

    @property
    def text(self) -> str:
        """As a list, at the width of the terminal, or as BibTeX."""
        return self.bibtex() if self.as_bibtex else text(self, min(100, shutil.get_terminal_size((100, 24)).columns))

    def bibtex(self) -> str:
        """Works that the answer stands on, as BibTeX."""
        return bibtex(self)

    def to_dict(self) -> dict[str, Any]:
        """Plain values of schema ``bemt.sources/1``."""
        return {"schema": SCHEMA, "case": self.case, "sources": [asdict(s) for s in self]}


def sources(case: Case) -> Sources:
    """Everything that takes part in the answer for a case, the method first.

    Effects are those that are switched on; one that is inert for this rotor (a tip gap without a duct) is left out.
    """
    from bemt import __version__
    from bemt.rotors.case.prepare import prepare_case

    effects = [e for e in prepare_case(case).effects if case.ducted or e.id not in ("duct", "tip_gap")]
    of = {e.id: source_of(type(e), getattr(e, "form", "")) or "declared by this project" for e in effects}
    found = Sources((
        Source("method", "program", BEMT.format(__version__)),
        Source("method", "blade element momentum", METHOD),
        *([Source("method", "duct", DUCT)] if case.ducted else []),
        *(Source("effect", name, told) for name, told in of.items()),
        *_sections(case),
        *_bands(case),
        Source("comparison", "k1k2", K1K2),
        *_data(case),
    ))  # fmt: skip
    found.case = case.name
    return found


def _sections(case: Case) -> list[Source]:
    given = case.file.polars
    if given:
        return [Source("sections", item.file, "table of the case; its file names its origin") for item in given]
    model = case.file.model
    return [
        Source("sections", "tables", TABLES),
        Source("sections", "rule", RULE.format(f"{model.n_crit:g}", f"{model.drag_level:g}")),
    ]


def _bands(case: Case) -> list[Source]:
    from bemt.rotors import population

    about = population.population().provenance
    words = f"{about['propellers']} measured propellers ({about['points']} points) of {len(about['families'])} families"
    found = [Source("band", "population", f"{about['source']}: {words}")]
    stated = case.file.blade.as_built
    if stated is not None and stated.measured is not None:
        found.insert(0, Source("band", "measured", f"{records()[stated.measured].source}; numbers of bemt's own fit"))
    elif stated is not None:
        origin = "runs of this rotor, taken in by `bemt lab calibrate-rotor`"
        found.insert(0, Source("band", "as built", origin))
    return found


def _data(case: Case) -> list[Source]:
    """Sources of the recorded values, each once."""
    found = [Source("data", "case", case.file.origin)] if case.file.origin else []
    path = case.references_path
    rows = [] if path is None else reference_file.read(path)
    told = dict.fromkeys((row.kind, row.source) for row in rows if row.source)
    return found + [Source("data", kind, source) for kind, source in told]


_WORK = re.compile(
    r"([A-Z]\w+(?:,? (?:and |van |von )*[A-Z][\w.'-]*)*(?: et al\.)?)(?:,)? \(?(1[89]\d\d|20[0-4]\d)\)?"
    r"((?:(?!(?:(?<=[a-z]{4})|(?<=\d))\. [A-Z`]|,(?: and)? [A-Z]\w+ \(?(?:1[89]|20)\d\d)[^;()])*)"
)
"""Authors, year and what follows in a source, up to the next semicolon, bracket or sentence."""
_LATEX = {c: f"\\{c}" for c in "&%$#_"} | {
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "\\": "/", "{": r"\textbraceleft{}",
    "}": r"\textbraceright{}",
}  # fmt: skip
"""As LaTeX prints a character; BibTeX counts a brace behind a backslash too."""


@lru_cache
def works() -> dict[str, tuple[str, dict[str, str]]]:
    """Type and fields of the works in ``works.bib``; by first author and year, a letter for a second one."""
    text = Path(__file__).with_name("works.bib").read_text(encoding="utf-8")
    rows = re.findall(r"^@(\w+)\{(\w+), (.*)\}$", text, re.M)
    return {key: (kind, dict(re.findall(r"(\w+) = \{(.*?)\}(?=, \w+ = \{|$)", rest))) for kind, key, rest in rows}


def _named(text: str, keys: Iterable[str]) -> list[str]:
    """Those of the works whose title or number a text has."""
    told = {k: [re.sub(r"[{}\\]", "", works()[k][1].get(name, "")) for name in ("title", "number")] for k in keys}
    return [k for k in told if any(len(words) > 5 and words.lower() in text.lower() for words in told[k])]


def _key_of(who: str, year: str, rest: str) -> str:
    """First author and year; of several such works that whose title follows."""
    plain = unicodedata.normalize("NFKD", who).encode("ascii", "ignore").decode()
    key = re.sub(r"\W", "", plain.split(",")[0].split(" ")[0].lower()) + year
    return next(iter(_named(rest, [k for k in works() if k.rstrip("abc") == key])), key)


def bibtex(found: Sources) -> str:
    """Works that an answer stands on, as BibTeX.

    A work that the physics names has the fields of ``works.bib``; any other with an author and a year, as of a user's
    table of references, is ``@misc`` with what the source says of it as title. The note tells where it is used and
    "not checked"; a source that names no work is a comment.

    Parameters
    ----------
    found : Sources
        Sources of the answer.

    Returns
    -------
    str
        Entries, each key once, in their order.
    """
    from bemt import __version__

    about = {"author": "{the bemt maintainers}", "title": "bemt", "year": str(YEAR), "version": __version__}
    entries = {"bemt": ("misc", about)}
    notes: dict[str, dict[str, None]] = {}
    used: dict[str, dict[str, None]] = {}
    bare = []
    for source in found[1:]:
        cited: dict[str, bool] = {}  # whether the source doubts it
        for work in _WORK.finditer(source.source):
            who, year, rest = work.groups()
            key = _key_of(who, year, rest)
            what = " ".join(rest.split()).strip(" ,.:").removeprefix("not checked")
            if key not in works() and (key not in entries or entries[key][1]["title"] == next(iter(used[key]))):
                author = re.sub(r"\s*,\s*(?:and )?", " and ", who).replace(" et al.", " and others")
                told = {"author": author, "title": what or source.name, "year": year}
                entries[key] = "misc", {name: _latex(value) for name, value in told.items()}
            doubted = re.match(r"[^;()]*?[ (,;]*(?:\w+ ){0,2}not checked", rest + source.source[work.end() :])
            cited[key] = cited.get(key, False) or doubted is not None
        cited |= {key: False for key in _named(_WORK.sub("", source.source), works()) if key not in cited}
        for key, doubt in cited.items():
            entries.setdefault(key, works().get(key, ("misc", {})))
            said = entries[key][1].get("note", "not checked" if doubt else "")
            notes.setdefault(key, {}).update({said: None} if said else {})
            used.setdefault(key, {})[source.name] = None
        if not cited:
            words = " ".join(source.source.split()).replace("@", " at ")  # which would begin an entry
            bare.append(f"% {source.name}: {words}")
    lines = []
    for key, (kind, fields) in entries.items():
        where = [f"in {_latex(', '.join(used[key]))}"] if key in used else []
        told = fields | ({"note": "; ".join([*notes[key], *where])} if where else {})
        lines += [f"@{kind}{{{key},", *(f"  {name} = {{{value}}}," for name, value in told.items()), "}"]
    return "\n".join([*lines, *bare]) + "\n"


def _latex(text: str) -> str:
    return "".join(_LATEX.get(c, c) for c in text)


def text(found: Sources, width: int = 100) -> str:
    """Sources for a terminal, in groups."""
    titles = {"method": "Method", "effect": "Effects that are switched on", "sections": "Section tables",
              "band": "Uncertainty band", "comparison": "Comparison", "data": "Recorded values"}  # fmt: skip
    lines = [f"What the answer for {found.case} stands on:"]
    for kind, title in titles.items():
        rows = [s for s in found if s.kind == kind]
        lines += ["", title] if rows else []
        for s in rows:
            lines += textwrap.wrap(f"{s.name}: {s.source}", width, initial_indent="  ", subsequent_indent="    ",
                                   break_on_hyphens=False, break_long_words=False)  # fmt: skip
    return "\n".join([*lines, "", "--bibtex prints the works as BibTeX"])
