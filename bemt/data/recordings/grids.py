"""CFD of one condition on several grids: one study, of which the finest grid gives the point and the grids its u.

Each load of each condition is extrapolated by itself (`bemt.data.recordings.grid_study`: Celik 2008; Roache 1994). The
value stays that of the finest grid; what its grid is worth is u = GCI / 1.15, or three times the spread of the grids
where they oscillate, diverge or show an implausible order. A load that is on one grid only keeps the floor.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from bemt.base.arrays import Array
from bemt.base.document import Documented
from bemt.base.errors import Fault, InputError, refuse
from bemt.base.tables import number_text
from bemt.data.readers.headings import CELLS
from bemt.data.recordings.cfd_setup import CONDITIONS, CfdRun, conditions_of, stated_of, with_grid_floor
from bemt.data.recordings.channels import named
from bemt.data.recordings.grid_study import COVERAGE, grid_study, ratios
from bemt.physics.dataset import Dataset, concat
from bemt.physics.dataset.channels import channel_fault

T = TypeVar("T")
LOADS = {"thrust_N": "N", "duct_thrust_N": "N", "torque_Nm": "N m", "power_W": "W", "CT": "", "CQ": "", "CP": ""}
"""Loads that are extrapolated, and their units."""
_SAME = {"rpm": (2e-3, 0.0), "airspeed_m_s": (5e-3, 0.02), "density_kg_m3": (2e-3, 0.0), "J": (5e-3, 1e-3)}
"""Differences within which runs are of one condition, relative and absolute: what is typed in two solvers."""
MOST = 3
"""Grids of which the order is taken, the finest."""
CELL_SIZE = re.compile(r"((cell|mesh|grid|element|base)[_ ]?(size|spacing)|dx|h)(_m)?", re.IGNORECASE)
"""Columns of a size of cells in a table of grids."""
FEWEST_CELLS = 1000.0
"""A grid around a rotor has more cells [1]; a battery, whose cells tables of benches count, has fewer."""
HEIGHT = re.compile(r"h(_m)?", re.IGNORECASE)
"""Of these, one that in somebody's table may be a height over ground as well."""


class LoadStudy(Documented):
    """Grid study of one load at one condition; the finest grid comes first."""

    channel: str
    cells: tuple[float, ...]  # () where the sizes are stated
    values: tuple[float, ...]  # unit of the channel
    u_relative: float  # Standard uncertainty on the finest grid; NaN where no value differs: the floor holds [1]
    # As in `GridStudy`, of the finest three grids
    order: float | None = None
    extrapolated: float | None = None
    gci_fine: float | None = None
    gci_coarse: float | None = None
    asymptotic: float | None = None
    flags: tuple[str, ...] = ()
    rpm: float = math.nan
    airspeed_m_s: float = math.nan
    density_kg_m3: float = math.nan
    J: float = math.nan
    sizes: tuple[float, ...] = ()  # Size of the cells of each grid as stated, [m] or unknown unit
    size_unit: str = ""  # "m", or unknown

    @property
    def h(self) -> tuple[float, ...]:
        """Size of the cells over the finest grid's."""
        return tuple(v / self.sizes[0] for v in self.sizes) or tuple((self.cells[0] / n) ** (1 / 3) for n in self.cells)

    @property
    def name(self) -> str:
        """Load in words."""
        return self.channel if not LOADS[self.channel] else self.channel.rsplit("_", 1)[0].replace("_", " ")

    def sentence(self) -> str:
        """What the grids say.

        >>> s = grid_study([7.57, 7.42, 7.05], ratios([5.8e6, 1.7e6, 0.5e6]))
        >>> told = s.u_relative, s.order, s.extrapolated, s.gci_fine
        >>> LoadStudy("thrust_N", (5.8e6, 1.7e6, 0.5e6), s.values, *told, rpm=6000.0).sentence()
        'thrust on 5.8, 1.7, 0.5 million cells at 6000 rev/min: 7.57, 7.42, 7.05 N; order 2.22, 7.672 N at cell size 0, GCI 1.68 %, u 1.5 %'
        """  # noqa: E501
        unit, many, mm = LOADS[self.channel], max(self.cells, default=0.0) >= 1e5, self.size_unit == "m"
        grids = ", ".join(f"{c / (1e6 if many else 1.0):.3g}" for c in self.cells)
        on = f"{grids}{' million' if many else ''} cells"
        if self.sizes:
            sizes = ", ".join(f"{1e3 * v if mm else v:.4g}" for v in self.sizes)
            on = f"cells of {sizes} {'mm' if mm else '(no unit)'}"
        state = "one speed" if math.isnan(self.rpm) else f"{self.rpm:g} rev/min"
        state += f", {self.airspeed_m_s:g} m/s" if self.airspeed_m_s > 0.0 else ""
        state += f", J {self.J:g}" if self.J > 0.0 else ""
        values = ", ".join(f"{v:.4g}" for v in self.values)
        lead = f"{self.name} on {on} at {state}: {values} {unit}".rstrip()
        if math.isnan(self.u_relative):
            return f"{lead}; {'; '.join(self.flags)}, u is that of a run without a grid study"
        end = f"u {100 * self.u_relative:.1f} %" + (f" ({'; '.join(self.flags)})" if self.flags else "")
        if self.order is None or self.gci_fine is None:
            return f"{lead}; no order: three times their spread is taken, {end}"
        best = f"{number_text(self.extrapolated, 4)} {unit}".rstrip()
        order = f"order {self.order:.2f}" if len(self.values) > 2 else f"assumed order {self.order:g}"
        used = "" if self.u_relative * COVERAGE <= self.gci_fine * (1.0 + 1e-9) else " not used"
        return f"{lead}; {order}, {best} at cell size 0, GCI {100 * self.gci_fine:.2f} %{used}, {end}"


def groups(d: Dataset) -> list[list[int]]:
    """Rows of one condition each: speed, airspeed, density."""
    return _grouped(range(len(d)), lambda rows, i: _alike(d, rows[0], i))


def _grouped(items: Iterable[T], fits: Callable[[list[T], T], bool]) -> list[list[T]]:
    """Items in order, each in the first group that it fits, else in one of its own."""
    out: list[list[T]] = []
    for item in items:
        home = next((group for group in out if fits(group, item)), None)
        if home is None:
            out.append(home := [])
        home.append(item)
    return out


def _alike(d: Dataset, i: int, k: int) -> bool:
    for name, (share, least) in _SAME.items():
        if name in d:
            a, b = float(d[name][i]), float(d[name][k])
            if not (a == b or abs(a - b) <= least + share * max(abs(a), abs(b)) or (math.isnan(a) and math.isnan(b))):
                return False
    return True


def by_grid(d: CfdRun, cells: Array, size_unit: str | None = None) -> CfdRun:
    """Points of a run of which some rows are one condition on several grids, as points with u of the grid.

    `cells` (N,) are those of each row's grid [1], NaN where not stated; h^-3 where their size h is, whose `size_unit`
    is "m", or "" if not known (Celik 2008: only ratios of h count). One point for each condition, that of its finest
    grid; `studies` has a `LoadStudy` for each load that was extrapolated.
    """
    keep: list[int] = []
    studies: list[LoadStudy] = []
    sizes: dict[str, Array] = {k: np.full(len(d), np.nan) for k in LOADS if k in d}
    coarseness = np.where(np.isfinite(cells), -cells, 1.0)
    for group in groups(d):
        order = sorted(group, key=coarseness.__getitem__)
        keep.append(order[0])
        if len(group) > 1:
            _are_unlike(d, group, cells, size_unit)
            found = [s for k in sizes if (s := _study(d, k, order, cells, size_unit)) is not None]
            studies += found
            for s in found:
                sizes[s.channel][order[0]] = s.u_relative
    # a condition on one grid owes what the grid costs elsewhere
    sizes = {k: np.where(np.isfinite(u), u, np.fmax.reduce(u)) for k, u in sizes.items()}
    rows = np.array(sorted(keep), dtype=np.intp)
    told = {**d.conditions, "grids": max((len(s.values) for s in studies), default=1)}
    told |= {"cells": float(np.nanmax(cells[rows]))} if size_unit is None else {}
    if u_thrust := [s.u_relative for s in studies if s.channel in ("thrust_N", "CT") and s.u_relative >= 0.0]:
        told["u_grid"] = max(u_thrust)
    random = _of_its_own(d)
    values, u, grid = ({k: v[rows] for k, v in table.items()} for table in (d.values, random, sizes))
    labels = tuple(d.labels[i] for i in rows if d.labels)
    made = replace(d, values=values, u=u, u_by={}, flags=(), labels=labels, conditions=told, studies=tuple(studies))
    return with_grid_floor(made, grid, tuple(s.sentence() for s in studies))


def _are_unlike(d: CfdRun, rows: Sequence[int], cells: Array, size_unit: str | None) -> None:
    """Refuse rows of one condition of which some are on one grid, or on none that is stated."""
    if len(set(cells[rows][np.isfinite(cells[rows])])) == len(rows):
        return
    shown = [f"{cells[i]:,.0f}" if size_unit is None else f"h {_size(cells[i]):.4g}" for i in rows]
    got = f"{len(rows)} runs at {_state(d, rows[0])} on {', '.join(shown)}"
    hint = "State the cells of each grid: --setup cells=N; runs on one grid are no study"
    raise InputError(Fault(d.file or d.name, "cells", got, "grids of unlike size", hint))


def _state(d: Dataset, row: int) -> str:
    words = {"rpm": "rev/min", "airspeed_m_s": "m/s", "J": "J"}
    told = [f"{d[k][row]:g} {w}" for k, w in words.items() if k in d and math.isfinite(d[k][row])]
    return ", ".join(told) or "one speed"


def _size(cells: float) -> float:
    return float(cells ** (-1.0 / 3.0))


def _study(d: Dataset, channel: str, order: Sequence[int], cells: Array, unit: str | None) -> LoadStudy | None:
    """Grid study of one load at one condition, finest grid first; None where there is none."""
    order = [i for i in order if math.isfinite(d[channel][i])]
    fine = order[:MOST]
    if len(fine) < 2 or any(d[channel][i] == 0.0 for i in fine[:2]):
        return None
    found = grid_study([float(d[channel][i]) for i in fine], ratios([float(cells[i]) for i in fine]))
    if np.ptp(found.values) == 0.0:  # too few digits, or one run under several names
        none = "the values do not differ: the convergence cannot be judged"
        found = replace(found, order=None, u_relative=math.nan, flags=(none,))
    grids = tuple(float(cells[i]) if unit is None else _size(cells[i]) for i in order)
    more = (f"{len(order)} grids: the order is that of the finest {MOST}",) if len(order) > MOST else ()
    return LoadStudy(
        channel, grids if unit is None else (), tuple(float(d[channel][i]) for i in order), found.u_relative,
        found.order, found.extrapolated, found.gci_fine, found.gci_coarse, found.asymptotic, (*found.flags, *more),
        sizes=() if unit is None else grids, size_unit=unit or "",
        **{k: float(d[k][order[0]]) for k in _SAME if k in d},
    )  # fmt: skip


def together(parts: Sequence[Dataset], name: str = "") -> CfdRun:
    """Runs on several grids as one run with the uncertainty of its grids; the cells [1] as their set-ups state."""
    cells = [float(stated_of(d).get("cells") or math.nan) for d in parts]
    if bare := [d.file or d.name for d, n in zip(parts, cells, strict=True) if math.isnan(n)]:
        hint = "`bemt import FILES --setup cells=N` writes them into its run.toml"
        raise InputError([Fault(f, "cells", "not stated", "the cells of the grid", hint) for f in bare])
    runs = [d for d in parts if isinstance(d, CfdRun)]  # all: they state their cells
    finest = runs[int(np.argmax(cells))]
    about = {
        **{k: v for k, v in finest.provenance.items() if k != "means"},
        "file": name or " + ".join(d.name for d in parts),
        "sha256": "+".join(d.sha256 for d in parts),
    }  # fmt: skip
    _one_study(runs, finest)
    joined = concat([replace(d, kind="cfd", u=_of_its_own(d), u_by={}) for d in parts])
    name = name or f"{finest.name} and {len(parts) - 1} coarser"
    files = tuple(f for d in runs for f in d.files)
    whole = replace(finest, name=name, values=joined.values, u=joined.u, u_by={}, flags=(), labels=(),
                    provenance=about, notes=_notes_of(runs, finest), files=files, studies=())  # fmt: skip
    return by_grid(whole, np.repeat(cells, [len(d) for d in parts]))


def _notes_of(runs: Sequence[CfdRun], finest: CfdRun) -> tuple[str, ...]:
    """Notes of the finest grid, and of the others what they alone say."""
    own = {_bare(t) for t in finest.notes}
    others = [f"{Path(d.file or d.name).name}: {t}" for d in runs if d is not finest for t in d.notes
              if _bare(t) not in own and "no grid study" not in t]  # fmt: skip
    return tuple(dict.fromkeys([*(t for t in finest.notes if "no grid study" not in t), *others]))


def _of_its_own(d: Dataset) -> Mapping[str, Array]:
    """What the points of a run are uncertain by without its grid."""
    return d.u_by.get("random", {}) if d.u_by else d.u


def _bare(note: str) -> str:
    """A note without its numbers, which each grid has of its own."""
    return re.sub(r"[-+.\d]+", "", note)


def _one_study(runs: Sequence[CfdRun], finest: CfdRun) -> None:
    """Refuse grids that have no condition in common with any other, or some of the zones of another only."""
    names = [Path(d.file or d.name).name for d in runs]
    faults = []
    for k, d in enumerate(runs):
        rest = [other for i, other in enumerate(runs) if i != k]
        if not any(_alike_rows(d, i, other, j) for other in rest for i in range(len(d)) for j in range(len(other))):
            others = "; ".join(dict.fromkeys(_state(o, 0) for o in rest))
            hint = "A study is of one speed, airspeed and density"
            faults.append(Fault(names[k], "", _state(d, 0), f"a condition of another grid ({others})", hint))
    fine, finest_name = finest.zones, Path(finest.file or finest.name).name
    for name, d in zip(names, runs, strict=True):
        if d.zones & fine and d.zones != fine:
            got, want = (" + ".join(sorted(zones)) for zones in (d.zones, fine))
            hint = "Import it again with the same --zones"
            faults.append(Fault(name, "zones", f"thrust of {got}", f"{want}, as {finest_name}", hint))
    refuse(faults)


def _alike_rows(a: Dataset, i: int, b: Dataset, k: int) -> bool:
    both = {n: np.array([a[n][i], b[n][k]]) for n in _SAME if n in a and n in b}
    return _alike(Dataset("cfd", "", both), 0, 1) if both else True


def are_grids(parts: Sequence[Dataset]) -> bool:
    """Whether runs are one condition, or the same ones, on grids of different cells: no repeats."""
    cells = [conditions_of(d).get("cells") for d in parts]
    if len(parts) < 2 or None in cells or len({*cells}) < len(parts):
        return False
    others = [{k: v for k, v in conditions_of(d).items() if k not in ("cells", "grid_level", "y_plus")} for d in parts]
    if any(a.get(k, v) != v for a in others[1:] for k, v in others[0].items()):
        return False
    keys = [k for k in _SAME if all(k in d for d in parts)]
    if not keys or any(len(d) != len(parts[0]) for d in parts):
        return False
    size = len(parts)
    both = Dataset("cfd", "", {k: np.concatenate([d[k] for d in parts]) for k in keys})
    return all(len(g) == size for g in groups(both))


def merged(parts: Sequence[Dataset]) -> list[Dataset]:
    """Runs, those that are one condition on several grids as one study in the place of the first."""
    from bemt.data.recordings.cfd_run import is_run

    found = _grouped(parts, lambda runs, d: is_run(d) and is_run(runs[0]) and are_grids([*runs, d]))
    return [together(runs) if len(runs) > 1 else runs[0] for runs in found]


def of_table(record: Dataset) -> Dataset:
    """Somebody's table with a column of cells or of their size, as a run on the finest grids; any other as it is.

    Rows of one condition on several grids are no repeats; rows of unlike conditions on one grid owe what a grid costs
    elsewhere, in a table of speeds and loads. A table that states its uncertainties keeps its rows.
    """
    counted = next(filter(CELLS.search, record.values), None)
    column = counted or next(filter(CELL_SIZE.fullmatch, record.values), None)
    d = named(record)
    loads = [k for k in LOADS if k in d]
    if column is None or not loads or any(np.isfinite(d.u[k]).any() for k in loads):
        return record
    cells, stated = record[column], {k.lower(): {*v} for k, v in record.texts.items() if k.lower() in CONDITIONS}
    again = len(groups(d)) < len(d)  # a condition on several grids, or read twice on one
    if not (_grids(cells).size > 1 if again else counted and _on_one_grid(d, cells, stated)):
        return record
    if HEIGHT.fullmatch(column):
        note = f"{column}: a height, or the size of cells? A grid study takes it from a column headed cell_size"
        return replace(record, notes=(*record.notes, note))
    told = {k: next(iter(said)) for k, said in stated.items() if len(said) == 1}
    values = {k: v for k, v in d.values.items() if k in (*LOADS, *_SAME)}
    made = CfdRun("cfd", record.name, values, provenance={**record.provenance, "format": "cfd_run"},
                  notes=record.notes, files=(record.file,), conditions=told)  # fmt: skip
    return by_grid(made, cells) if counted else by_grid(made, cells**-3.0, "m" if column.endswith("_m") else "")


def _on_one_grid(d: Dataset, cells: Array, stated: Mapping[str, set[str]]) -> bool:
    """Whether all rows are runs on one grid, and the table has nothing that a run has no place for."""
    known = _grids(cells)
    lost = [k for k in d.values if k not in (*LOADS, *_SAME) and not channel_fault(k)]
    several = any(len(said) > 1 for said in stated.values())
    return known.size == 1 and bool(known[0] >= FEWEST_CELLS) and not several and not lost


def _grids(cells: Array) -> Array:
    return np.unique(cells[np.isfinite(cells)])
