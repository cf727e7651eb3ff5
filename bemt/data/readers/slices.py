r"""Loads along the blade, as a table of slices: radius, thrust and torque per radius of all blades together.

Headings state their units, by the vocabulary of any recording: ``r [mm],dT/dr [N/m],dQ/dr [N m/m]``,
``radius_mm,thrust_per_radius_N_m,torque_per_radius_Nm_m``; the radius may be ``r/R``. A column ``run`` (or ``case``)
keeps several runs apart; rpm, airspeed and density of the slices may stand beside them, as in any table. An XY plot of
Fluent is such a table where its labels and the keys of its curves are such headings, over the same radii.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bemt.base import units
from bemt.base.arrays import Array
from bemt.base.tables import some
from bemt.data.readers import Reader, SourceText, head_text, load_text, number
from bemt.data.readers.cfd import unit_of
from bemt.data.readers.headings import channel_of, heading
from bemt.data.readers.split import decimal_mark, split_table

LOADS = {"thrust": "force", "torque": "torque"}
_RADIUS = re.compile(r"r|rad|radius|radial[_ ](position|coordinate|distance)|position\[r\]", re.IGNORECASE)
_OVER_R = re.compile(r"r ?/ ?R(_?tip)?|r_over_R(_?tip)?")
_CURVE = re.compile(r'\(\(xy/key/label "(.*)"\)')
_PER = re.compile(
    r"d(?P<letter>[TFQM])[ _]?[/_]?[ _]?dr|(?P<words>[a-z]+(?:[_ ]force)?)[_ ](?:per|over|/)[_ ](?:unit[_ ])?"
    r"(?:radius|length|span|metre|meter|m|r)",
    re.IGNORECASE,
)
_LETTER = {"t": "thrust", "f": "thrust", "q": "torque", "m": "torque"}
_UNIT = re.compile(r"(.*?)\s*[\[(]([^\[\]()]*)[\])]\s*")
_EXAMPLE = "r [m], dT/dr [N/m], dQ/dr [N m/m]: loads of all blades together"


@dataclass(frozen=True, eq=False)
class Slices:
    """Slices of one run: radius [m], thrust [N/m] and torque [N m/m] per radius, (N,) each, and what they state.

    The radius is over that of the tip [1] where ``over_R``; the loads are per metre all the same.
    """

    r: Array
    thrust: Array
    torque: Array
    stated: Mapping[str, float]  # rpm, airspeed_m_s, density_kg_m3, as far as columns have them
    over_R: bool = False


def slice_heading(text: str) -> tuple[str, float] | str:
    """Quantity of a heading of slices and its factor to SI; a text says what is wrong; "" for any other column.

    >>> slice_heading("r [mm]"), slice_heading("dT/dr [N/m]"), slice_heading("torque_per_radius_Nm_m")
    (('r', 0.001), ('thrust', 1.0), ('torque', 1.0))
    >>> slice_heading("dQ/dr [N m/m]"), slice_heading("dQ/dr (N)"), slice_heading("chord [mm]")
    (('torque', 1.0), ('torque', 1.0), '')
    >>> slice_heading("Position[r] (m)"), slice_heading("Thrust per Radius (N/m)")  # of STAR-CCM+
    (('r', 1.0), ('thrust', 1.0))
    >>> slice_heading("dT/dr"), slice_heading("dT/dr [N]")
    ('no unit', "'N' is no force per length")
    >>> slice_heading("r/R"), slice_heading("r_over_R [-]")
    (('r/R', 1.0), ('r/R', 1.0))
    """
    found = _UNIT.fullmatch(text.strip())
    base, stated = (found[1], found[2].strip()) if found else (text.strip(), "")
    if _OVER_R.fullmatch(base) and stated in ("", "-", "1"):
        return "r/R", 1.0
    if (per := _PER.match(base)) and (found or base[per.end() :].startswith("_") or per.end() == len(base)):
        quantity = _LETTER.get((per["letter"] or "").lower()) or channel_of(per["words"] or "").lower()
        quantity = {"force": "thrust", "lift": "thrust", "moment": "torque"}.get(quantity, quantity)
        if quantity not in LOADS:
            return ""
        stated = stated or base[per.end() :].strip("_")
        if not stated:
            return "no unit"
        factor = _per_length(LOADS[quantity], stated)
        return (quantity, factor) if factor else f"{stated!r} is no {LOADS[quantity]} per length"
    name = base if found else units.split_suffix(base)[0]
    if _RADIUS.fullmatch(name):
        own = heading(text)
        if own.unit is None or own.unit.dimension != "length":
            return "no unit" if not stated else f"{stated!r} is no length"
        return "r", own.unit.factor
    return ""


def sniff(head: bytes | str) -> bool:
    r"""Tell whether a table holds loads, or lift and drag, at radii: no polar, no recording.

    >>> sniff('"Radius (m)","Thrust per Length (N/m)"'), sniff("r_m,chord_m,alpha_deg,cl,cd"), sniff("r_mm,chord_mm")
    (True, True, False)
    """
    lines = (t for t in head_text(head).splitlines() if t.strip() and not t.lstrip().startswith("#"))
    cells = [c.strip(' "') for c in re.split(r"[;\t,]", next(lines, ""))]
    known = {c for c in map(slice_heading, cells) if c}
    section = {"cl", "cd"} <= {c.lower() for c in cells}
    at = {k[0] for k in known if isinstance(k, tuple)}
    return bool(at & {"r", "r/R"}) and bool(at & {*LOADS}) or "r" in at and (len(known - {("r/R", 1.0)}) > 1 or section)


def _per_length(dimension: str, text: str) -> float:
    """Factor to SI of a unit of a load per length; 0 for any other."""
    for found in re.finditer(r"[/_ ]+", text):
        load, length = unit_of(text[: found.start()]), unit_of(re.sub(r"\^?-1$", "", text[found.end() :]))
        if load and length and (load.dimension, length.dimension) == (dimension, "length"):
            return load.factor / length.factor
    whole = unit_of(text)  # a torque per length is a force
    return whole.factor if whole and dimension == "torque" and whole.dimension == "force" else 0.0


def read(path: str | os.PathLike[str]) -> dict[str, Slices]:
    """Slices of each run in a table; one without a column ``run`` is one run, named "slices"."""
    table = split_table(_as_table(load_text(path)))
    source = table.source
    comma = decimal_mark(table) == ","
    heads = [h.strip() for h in table.headings]
    loads, over_R = _load_columns(source, heads)
    wanted = loads | _state_columns(heads)
    label = next((k for k, h in enumerate(heads) if h.lower() in ("run", "case", "name", "design point")), None)
    runs: dict[str, list[list[float]]] = {}
    for line, cells in zip(table.lines, table.rows, strict=True):
        row = []
        for k, factor in wanted.values():
            text = cells[k].strip()
            if (value := number(text.replace(",", ".") if comma else text)) is None:
                source.add(f"{line}: {heads[k]}", repr(text), "a number")
            row.append((value or 0.0) * factor)
        runs.setdefault("slices" if label is None else cells[label].strip(), []).append(row)
    source.check()
    return {run: _slices(source, run, [*wanted], np.array(body).T, over_R) for run, body in runs.items()}


def _load_columns(source: SourceText, heads: Sequence[str]) -> tuple[dict[str, tuple[int, float]], bool]:
    """Column and factor to SI of the radius and of each load, and whether the radius is over that of the tip."""
    at: dict[str, tuple[int, float]] = {}
    for k, h in enumerate(heads):
        meant = slice_heading(h)
        if isinstance(meant, tuple):
            at.setdefault(meant[0], (k, meant[1]))
        elif meant:
            source.add(h, meant, "a unit", f"As in {_EXAMPLE}")
    share = at.pop("r/R", None)
    over_R = share is not None and "r" not in at
    at |= {"r": share} if share is not None and over_R else {}
    words = {"r": "radius", "thrust": "thrust_per_radius_N_m", "torque": "torque_per_radius_Nm_m"}
    if not source.faults and (missing := [text for q, text in words.items() if q not in at]):
        source.add("", f"columns {some(heads, 8)}: no {', '.join(missing)}", _EXAMPLE)
    source.check()
    return at, over_R


def _state_columns(heads: Sequence[str]) -> dict[str, tuple[int, float]]:
    """Column and factor to SI, rev/min for a speed, of what is stated beside the slices."""
    state: dict[str, tuple[int, float]] = {}
    for k, h in enumerate(heads):
        quantity, unit = channel_of(h), heading(h).unit
        if quantity in ("rpm", "airspeed_m_s", "density_kg_m3") and unit is not None:
            state.setdefault(quantity, (k, 1.0 if unit.suffix == "rpm" else unit.factor))
    return state


def _as_table(source: SourceText) -> SourceText:
    """An XY plot of Fluent as a table, a column for each curve; any other text as it is."""
    labels = re.search(r'\(labels "(.*?)" "(.*?)"\)', source.text)
    curves: dict[str, list[list[str]]] = {}
    for line in source.lines if labels else ():
        if key := _CURVE.match(line.strip()):
            curves[key[1]] = []
        elif curves and len(cells := line.split()) == 2:
            curves[[*curves][-1]].append(cells)
    if not labels or not curves:
        return source
    radii = [[x for x, _ in rows] for rows in curves.values()]
    known = [c for c in curves if isinstance(meant := slice_heading(c), tuple) and meant[0] in LOADS]
    if len(known) < len(curves) or radii.count(radii[0]) < len(radii):
        got = f"a Fluent XY plot of {labels[2]!r} over {labels[1]!r}, curves {some(map(repr, curves), 4)}"
        hint = "One table with both loads at the same radii; Fluent takes such labels of axes and curves"
        source.refuse("", got, _EXAMPLE, hint)
    rows = zip(radii[0], *([y for _, y in rows] for rows in curves.values()), strict=True)
    return replace(source, text="\n".join("\t".join(row) for row in ((labels[1], *curves), *rows)) + "\n")


def _slices(source: SourceText, run: str, names: list[str], values: Array, over_R: bool) -> Slices:
    """One run, by radius."""
    v = dict(zip(names, values[:, np.argsort(values[names.index("r")], kind="stable")], strict=True))
    stated = {}
    for key in v.keys() - {"r", *LOADS}:
        if np.ptp(v[key]) > 1e-3 * abs(float(v[key][0])):
            got = f"{', '.join(f'{x:g}' for x in np.unique(v[key])[:4])} in run {run}"
            source.refuse(key, got, "one value in each run", "A column run keeps the runs apart")
        stated[key] = float(v[key][0])
    return Slices(v["r"], v["thrust"], v["torque"], stated, over_R)


READERS = (Reader("slices", sniff, read),)
