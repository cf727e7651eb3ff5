"""CFD of one condition on several grids: one study, of which the finest grid gives the point and the grids its u.

Each load of each condition is extrapolated by itself (`bemt.data.recordings.grid_study`: Celik 2008; Roache 1994).
The value stays that of the finest grid; what its grid is worth is u = GCI / 1.15, or three times the spread of the
grids where they oscillate, diverge or show an implausible order. A load that is on one grid only keeps the floor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.data.recordings.cfd_loads import CELLS
from bemt.data.recordings.cfd_setup import CONDITIONS, conditions_of, with_grid_floor
from bemt.data.recordings.channels import named
from bemt.data.recordings.grid_study import LOADS, LoadStudy, grid_study, ratios
from bemt.physics.dataset import Dataset

_SAME = {"rpm": (2e-3, 0.0), "airspeed_m_s": (5e-3, 0.02), "density_kg_m3": (2e-3, 0.0), "J": (5e-3, 1e-3)}
"""Differences within which runs are of one condition, relative and absolute: what is typed in two solvers."""
MOST = 3
"""Grids of which the order is taken, the finest."""


def groups(d: Dataset) -> list[list[int]]:
    """Rows of one condition each: speed, airspeed, density."""
    out: list[list[int]] = []
    for i in range(len(d)):
        home = next((g for g in out if _alike(d, g[0], i)), None)
        if home is None:
            out.append([i])
        else:
            home.append(i)
    return out


def _alike(d: Dataset, i: int, k: int) -> bool:
    for name, (share, least) in _SAME.items():
        if name in d:
            a, b = float(d[name][i]), float(d[name][k])
            if not (a == b or abs(a - b) <= least + share * max(abs(a), abs(b)) or (math.isnan(a) and math.isnan(b))):
                return False
    return True


def by_grid(d: Dataset, cells: Array) -> Dataset:
    """Points of a run of which some rows are one condition on several grids, as points with u of the grid.

    `cells` (N,) are those of each row's grid [1], NaN where not stated. One point for each condition, that of its
    finest grid; ``provenance["studies"]`` has a `LoadStudy` for each load that was extrapolated.
    """
    keep: list[int] = []
    studies: list[LoadStudy] = []
    sizes: dict[str, Array] = {k: np.full(len(d), np.nan) for k in LOADS if k in d}
    for group in groups(d):
        order = sorted(group, key=lambda i: -cells[i] if math.isfinite(cells[i]) else 1.0)
        if len(group) > 1 and len({float(cells[i]) for i in group if math.isfinite(cells[i])}) < len(group):
            got = f"{len(group)} runs at {_state(d, group[0])} on " + ", ".join(f"{cells[i]:,.0f}" for i in group)
            hint = "State the cells of each grid: --setup cells=N; runs on one grid are no study"
            raise InputError(Fault(str(d.provenance.get("file", d.name)), "cells", got, "grids of unlike size", hint))
        keep.append(order[0])
        if len(group) > 1:
            found = [s for k in sizes if (s := _study(d, k, order, cells))]
            studies += found
            for s in found:
                sizes[s.channel][order[0]] = s.u_relative
    for k, u in sizes.items():  # a condition on one grid owes what the grid costs elsewhere
        most = np.nanmax(u) if np.isfinite(u).any() else math.nan
        sizes[k] = np.where(np.isfinite(u), u, most)
    rows = np.array(sorted(keep), dtype=np.intp)
    told = dict(d.provenance.get("conditions", {}))
    told |= {"cells": float(np.nanmax(cells[rows])), "grids": max((len(s.cells) for s in studies), default=1)}
    u_thrust = [s.u_relative for s in studies if s.channel in ("thrust_N", "CT")]
    if u_thrust:
        told["u_grid"] = max(u_thrust)
    random = d.u_by.get("random", d.u)
    labels = tuple(d.labels[i] for i in rows) if d.labels else ()
    made = Dataset(
        "cfd", d.name, {k: v[rows] for k, v in d.values.items()}, {k: v[rows] for k, v in random.items()}, (),
        {**d.provenance, "conditions": told, "studies": tuple(studies)}, labels, notes=d.notes,
    )  # fmt: skip
    return with_grid_floor(made, {k: v[rows] for k, v in sizes.items()}, tuple(s.sentence() for s in studies))


def _state(d: Dataset, row: int) -> str:
    words = {"rpm": "rev/min", "airspeed_m_s": "m/s", "J": "J"}
    return (
        ", ".join(f"{d[k][row]:g} {w}" for k, w in words.items() if k in d and math.isfinite(d[k][row])) or "one speed"
    )


def _study(d: Dataset, channel: str, order: Sequence[int], cells: Array) -> LoadStudy | None:
    """Grid study of one load at one condition, finest grid first; None where there is none."""
    order = [i for i in order if math.isfinite(d[channel][i])]
    fine = order[:MOST]
    if len(fine) < 2 or any(d[channel][i] == 0.0 for i in fine[:2]):
        return None
    found = grid_study([float(d[channel][i]) for i in fine], ratios([float(cells[i]) for i in fine]))
    more = (f"{len(order)} grids: the order is that of the finest {MOST}",) if len(order) > MOST else ()
    return LoadStudy(
        channel, tuple(float(cells[i]) for i in order), tuple(float(d[channel][i]) for i in order), found.u_relative,
        found.order, found.extrapolated, found.gci_fine, found.gci_coarse, found.asymptotic, (*found.flags, *more),
        **{k: float(d[k][order[0]]) for k in _SAME if k in d},
    )  # fmt: skip


def together(parts: Sequence[Dataset], cells: Sequence[float] | None = None, name: str = "") -> Dataset:
    """Runs on several grids as one run with the uncertainty of its grids; cells [1] as set-ups state, unless given."""
    own = [d.provenance.get("conditions", {}).get("cells", math.nan) for d in parts] if cells is None else cells
    known = [math.nan if n is None else float(n) for n in own]
    bare = [str(d.provenance.get("file", d.name)) for d, n in zip(parts, known, strict=True) if math.isnan(n)]
    if bare:
        hint = "`bemt import FILES --setup cells=N` writes them into its run.toml"
        raise InputError([Fault(f, "cells", "not stated", "the cells of the grid", hint) for f in bare])
    names = list(dict.fromkeys(k for d in parts for k in d.values))
    size = sum(map(len, parts))
    n = np.concatenate([np.full(len(d), c) for d, c in zip(parts, known, strict=True)]) if size else np.empty(0)

    def join(of: str) -> dict[str, Array]:
        every = [d.values if of == "values" else d.u_by.get("random", d.u) for d in parts]
        empty = [np.full(len(d), math.nan if of == "values" else 0.0) for d in parts]
        keys = [k for k in names if any(k in e for e in every)]
        return {k: np.concatenate([e.get(k, z) for e, z in zip(every, empty, strict=True)]) for k in keys}

    first = max(range(len(parts)), key=lambda i: known[i])
    about = parts[first].provenance
    files = tuple(f for d in parts for f in d.provenance.get("files", (d.provenance.get("file", d.name),)))
    sha256 = "+".join(str(d.provenance.get("sha256", "")) for d in parts)
    about = {**about, "file": name or " + ".join(d.name for d in parts), "files": files, "sha256": sha256}
    about.pop("means", None)
    notes = tuple(dict.fromkeys(t for d in parts for t in d.notes if "no grid study" not in t))
    whole = Dataset(
        "cfd", name or f"{parts[first].name} and {len(parts) - 1} coarser", join("values"), join("u"), (), about,
        notes=notes,
    )  # fmt: skip
    return by_grid(whole, n)


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

    out: list[list[Dataset]] = []
    for d in parts:
        home = next((g for g in out if is_run(d) and is_run(g[0]) and are_grids([*g, d])), None)
        if home is None:
            out.append([d])
        else:
            home.append(d)
    return [together(g) if len(g) > 1 else g[0] for g in out]


def of_table(record: Dataset) -> Dataset:
    """Somebody's table with a column of cells, as a run on the finest grids; any other recording as it is.

    Rows of one condition on several grids are no repeats. A table that states its uncertainties keeps its rows.
    """
    cells = next((record[k] for k in record.values if CELLS.search(k)), np.empty(0))
    d = named(record)
    loads = [k for k in LOADS if k in d]
    if not loads or np.unique(cells[np.isfinite(cells)]).size < 2 or any(np.isfinite(d.u[k]).any() for k in loads):
        return record
    if all(len(g) == 1 for g in groups(d)):
        return record
    told = {k: v for k, v in record.texts.items() if k.lower() in CONDITIONS and len({*v}) == 1}
    about = {"format": "cfd_run", "files": (record.provenance["file"],), "averaged": {}, "drift": {}}
    about["conditions"] = {k.lower(): v[0] for k, v in told.items()}
    values = {k: v for k, v in d.values.items() if k in (*LOADS, *_SAME)}
    return by_grid(Dataset("cfd", record.name, values, provenance={**record.provenance, **about}, notes=record.notes),
                   cells)  # fmt: skip
