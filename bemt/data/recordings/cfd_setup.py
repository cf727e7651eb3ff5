"""How a CFD run was computed: its conditions, what a grid is worth at least, and the audit of any CFD recording."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bemt.base.tables import few, number_text
from bemt.data.readers import number
from bemt.data.readers.references import Reference
from bemt.data.recordings.audit import AuditLine, audit, facts_of, number_or
from bemt.physics.dataset import Dataset

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from bemt.data.recordings.grids import LoadStudy

CONDITIONS = (
    "grid_level", "cells", "program", "solver", "gas", "turbulence", "domain", "domain_over_D", "sector", "steady",
    "compressible", "wall", "y_plus",
)  # fmt: skip
"""What a CFD number depends on besides the physics; the grid first."""
_GRID = ("grid_level", "cells")
_ALIAS = {"level": "grid_level", "grid": "grid_level", "mesh": "grid_level", "grid level": "grid_level"}
_LIKE_CELLS = 0.02
_BATTERY = 100.0
Conditions = dict[str, tuple[str, ...]]
"""Conditions of a computed run by name, as texts, each with all values that its rows have."""
FLIES = 0.5
"""Airspeed above which a rotor is not at rest [m/s]."""
SETTLED = 0.01
"""Standard uncertainty of a settled load from point to point on one grid, share of it [1]."""
GRID_FLOOR: Mapping[str, Mapping[str, float]] = {
    "rest": {"thrust_N": 0.057, "torque_Nm": 0.080},
    "flight": {"thrust_N": 0.100, "torque_Nm": 0.082},
}
"""Least standard uncertainty of a load on a grid without a grid study, share of it [1].

Root mean square of the change from one grid to the next in our own runs (``reports/cfd``: no observed order,
so nothing smaller can be claimed): at rest ten pairs of neighbouring grids, 35,000 to 494,000 cells (``prop_8x5_grid``,
``prop_8x5_rest``, ``prop_8x5_zone``, ``ds30_spinner``, ``ds30_vanes``); in flight the one pair there is
(``prop_8x5_zone``, J 0.4: 16.64 and 14.97 N, 0.342 and 0.314 N m). ``tests/test_cfd_runs.py`` recomputes them."""
THRUSTS, TORQUES = ("thrust_N", "duct_thrust_N", "CT"), ("torque_Nm", "power_W", "CQ", "CP")
"""Channels that one grid makes wrong alike."""
GRID_FLOOR_SOURCE = "own runs, reports/cfd: rms change from one grid to the next"


def grid_floor(channel: str, in_flight: bool) -> float:
    """Least standard uncertainty of a load by its grid, without a grid study. [1]

    >>> grid_floor("thrust_N", False), grid_floor("CQ", True)
    (0.057, 0.082)
    """
    return GRID_FLOOR["flight" if in_flight else "rest"]["thrust_N" if channel in THRUSTS else "torque_Nm"]


def _flies(d: Dataset) -> NDArray[np.bool_]:
    """Rows with an airspeed."""
    V, J = d.values.get("airspeed_m_s"), d.values.get("J")
    out = np.zeros(len(d), dtype=bool)
    if V is not None:
        out |= np.nan_to_num(V) > FLIES
    if J is not None:
        out |= np.nan_to_num(J) > 0.02
    return out


def with_grid_floor(
    d: CfdRun, u_grid: Mapping[str, NDArray[np.float64] | float], notes: tuple[str, ...] = ()
) -> CfdRun:
    """Loads of CFD with what their grid is worth [1]: as stated or studied, (N,) a load, else the floor; notes say."""
    random = {k: v.copy() for k, v in d.u.items() if np.isfinite(v).any()}
    numerics: dict[str, NDArray[np.float64]] = {}
    flies = _flies(d)
    bare: set[str] = set()
    for name in (*THRUSTS, *TORQUES):
        if name in d:
            least = np.array([grid_floor(name, bool(f)) for f in flies])
            own = np.asarray(u_grid.get(name, math.nan), dtype=float)
            open_ = np.broadcast_to(np.isnan(own), least.shape)
            bare |= {"thrust" if name in THRUSTS else "torque"} if open_.any() else set()
            numerics[name] = np.abs(d[name]) * np.where(open_, least, own)
    parts = {"random": {k: np.nan_to_num(v) for k, v in random.items() if k in numerics}, "numerics": numerics}
    if bare or not numerics:
        open_loads = sorted(bare) if notes and bare else ("thrust", "torque")
        notes = (floor_note(bool(flies.any()), bool(flies.all()), open_loads), *notes)
    kept = {k: v for k, v in random.items() if k not in numerics}
    return replace(d, u=kept, u_by=parts, notes=(*notes, *d.notes))


def one_grid(run: Dataset) -> tuple[Dataset, dict[str, dict[str, float]]]:
    """Points of a run with what each has of its own, and what one grid makes wrong at all of them alike: a gain [1]."""
    shared = {k: {"gain": float(np.nanmax(v / np.abs(run[k])))} for k, v in run.u_by.get("numerics", {}).items()}
    none = np.zeros(len(run))
    u = {k: np.hypot(run.u_by.get("random", {}).get(k, none), SETTLED * np.abs(run[k])) for k in shared}
    return replace(run, u=u, u_by={}), shared


def floor_note(some_fly: bool, all_fly: bool, loads: Sequence[str] = ("thrust", "torque")) -> str:
    """What a run without a grid study of some loads is told."""
    states = [s for s, wanted in (("rest", not all_fly), ("flight", some_fly)) if wanted]
    words = {"rest": "at rest", "flight": "in flight"}
    channel = {"thrust": "thrust_N", "torque": "torque_Nm"}
    sizes = "; ".join(f"{', '.join(f'{k} {GRID_FLOOR[s][channel[k]]:.1%}' for k in loads)} {words[s]}" for s in states)
    return f"no grid study: at least {sizes} ({GRID_FLOOR_SOURCE})"


class Elsewhere(NamedTuple):
    """A load that the files hold and that does not count, as the user states zones and axis."""

    channel: str
    words: str  # Such as "with thrust-duct"
    factor: float  # Load with it, or there, over what counts [1]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class CfdRun(Dataset):
    """Points of one CFD run, or of one condition on several grids: its files, how it was made, averaged and studied.

    ``zones`` are those whose forces are the thrust, without a sum that the file has of them.
    """

    files: tuple[str, ...] = ()
    conditions: Mapping[str, Any] = field(default_factory=dict)  # As stated or read: cells, turbulence, domain, ...
    averaged: Mapping[str, str] = field(default_factory=dict)  # What each channel is the mean of
    drift: Mapping[str, float] = field(default_factory=dict)  # Over the averaged part, share of the mean [1]
    units_given: tuple[str, ...] = ()  # Loads whose unit the user stated
    studies: tuple[LoadStudy, ...] = ()
    zones: frozenset[str] = frozenset()
    elsewhere: tuple[Elsewhere, ...] = ()
    unread: str = ""  # Columns that nothing read, and in which alone some of its rows differ

    def document(self) -> dict[str, Any]:
        """Plain values."""
        points = [
            {k: float(self[k][i]) for k in self.values}
            | {f"u_{k}": float(self.u[k][i]) for k in self.values if np.isfinite(self.u[k][i])}
            for i in range(len(self))
        ]
        return {"name": self.file, "files": list(self.files), "points": points, "averaged": self.averaged,
                "drift": self.drift, "conditions": self.conditions, "studies": [s.document() for s in self.studies],
                "zones": sorted(filter(None, self.zones)), "notes": list(self.notes)}  # fmt: skip


def stated_of(d: Dataset) -> Mapping[str, Any]:
    """Conditions of a run as stated; {} for any other recording."""
    return d.conditions if isinstance(d, CfdRun) else {}


def conditions_of(d: Dataset) -> Conditions:
    """Conditions of a CFD recording as texts, each with all values that its rows have; {} where none is stated."""
    out: Conditions = {}
    for name, value in stated_of(d).items():
        if name in CONDITIONS and value not in (None, "") and value == value:
            out[name] = (_text(value),)
    for name, cells in d.texts.items():
        key = _ALIAS.get(name.lower(), name.lower())
        if key in CONDITIONS and (found := sorted({c.strip() for c in cells if c.strip()})):
            out.setdefault(key, tuple(found))
    for name, values in d.values.items():
        key = _ALIAS.get(name.lower(), name.lower())
        # a battery has cells, too
        if key in CONDITIONS and np.nanmax(values, initial=-np.inf) > (_BATTERY if key == "cells" else -np.inf):
            out.setdefault(key, tuple(_text(v) for v in np.unique(values[np.isfinite(values)])))
    return out


def stated_setup(d: Dataset) -> Conditions:
    """Conditions of what was computed: a run of CFD, or a table that states solver, turbulence or cells; else {}."""
    found = conditions_of(d)
    return found if d.kind == "cfd" or {"turbulence", "cells", "solver"} & found.keys() else {}


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float, np.floating)):
        number = float(value)
        return f"{number:,.0f}" if abs(number) >= 1e4 else f"{number:g}"
    return str(value)


def conditions_that_differ(a: Dataset | Conditions, b: Dataset | Conditions) -> dict[str, tuple[str, str]]:
    """Conditions that both recordings state and that are not the same: name to the two, in the order of importance.

    >>> one = CfdRun("cfd", "a", {"thrust_N": [1.0]}, conditions={"cells": 1e6, "solver": "SST"})
    >>> two = CfdRun("cfd", "b", {"thrust_N": [1.1]}, conditions={"cells": 2e6, "solver": "SST"})
    >>> conditions_that_differ(one, two)
    {'cells': ('1,000,000', '2,000,000')}
    """
    first, second = (conditions_of(d) if isinstance(d, Dataset) else d for d in (a, b))
    out = {}
    for name in CONDITIONS:
        if name in first and name in second and not _alike(name, first[name], second[name]):
            out[name] = (few(first[name]), few(second[name]))
    return out


def other_setup(a: Conditions, b: Conditions) -> str:
    """What of two set-ups that are stated is not the same, in words; "" where nothing is."""
    return "; ".join(f"{k.replace('_', ' ')} {x} and {y}" for k, (x, y) in conditions_that_differ(a, b).items())


def _alike(name: str, a: tuple[str, ...], b: tuple[str, ...]) -> bool:
    if set(a) == set(b):
        return True
    if name in ("cells", "y_plus", "domain_over_D"):
        sizes = ([number(v.replace(",", "")) or math.nan for v in one] for one in (a, b))  # words are not alike
        ends = zip(*((min(one), max(one)) for one in sizes), strict=True)
        return all(abs(x - y) <= _LIKE_CELLS * max(abs(x), abs(y)) for x, y in ends)
    return False


def grid_that_differs(a: Dataset, b: Dataset) -> str:
    """What of the grid is not the same in two recordings, as a sentence; empty where nothing is.

    Before any physics: on another grid the same flow gives other loads.
    """
    differ = {k: v for k, v in conditions_that_differ(a, b).items() if k in _GRID}
    levels = [conditions_of(d).get("grid_level") for d in (a, b)]
    if not differ or (all(levels) and "grid_level" not in differ):  # on one level another geometry has other cells
        return ""
    words = {"grid_level": "level", "cells": "cells"}
    return "the grid differs: " + "; ".join(f"{words[k]} {one} and {two}" for k, (one, two) in differ.items())


def _one(d: Dataset, name: str, row: int) -> Any:
    """A condition of one row, by any of its names; None where it is not stated."""
    for key in (name, *(k for k, v in _ALIAS.items() if v == name)):
        if key in d.texts and d.texts[key][row].strip():
            return d.texts[key][row].strip()
        if key in d and math.isfinite(d[key][row]):
            return float(d[key][row])
    return stated_of(d).get(name)


def audit_of(
    d: Dataset, diameter_m: float, pitch_m: float, ducted: bool, a_sound: float, row: int = 0
) -> tuple[AuditLine, ...]:
    """Audit of one row of a CFD recording."""

    def get(name: str) -> Any:
        return _one(d, name, row)

    n, V = (float(d.rpm[row]) if "rpm" in d else math.nan) / 60.0, number_or(get("airspeed_m_s"), 0.0)
    thrust, rho = number_or(get("thrust_N")), number_or(get("density_kg_m3"), 1.225)
    return audit(facts_of(
        get, "balance_mass" in d, M_tip=math.pi * n * diameter_m / a_sound, J=V / (n * diameter_m) if n > 0 else 0.0,
        CT=thrust / (rho * n**2 * diameter_m**4) if n > 0 else math.nan, pitch_over_D=pitch_m / diameter_m,
        ducted=ducted,
    ))  # fmt: skip


def conditions_text(conditions: Mapping[str, Any]) -> str:
    """Conditions of a run in words.

    >>> conditions_text({"steady": True, "turbulence": "k-omega SST", "cells": 2e6})
    'steady yes, turbulence k-omega SST, cells 2,000,000'
    """
    shown = {k: v for k, v in conditions.items() if k not in ("thrust_from", "drift_thrust", "u_grid")}
    return ", ".join(f"{k.replace('_', ' ')} {_text(v)}" for k, v in shown.items())


def references_of(run: Dataset, where: str) -> list[Reference]:
    """Points of a run as recorded values of a case: thrust, torque, the duct's part."""
    out = []
    setup = {"thrust_from": "forces", **stated_of(run)}
    loads = (("thrust", "thrust_N", "N"), ("torque", "torque_Nm", "N m"), ("duct_thrust", "duct_thrust_N", "N"))
    sha256 = run.sha256
    for quantity, channel, unit in (*loads, ("CT", "CT", "-"), ("CQ", "CQ", "-")):
        for i in range(len(run) if channel in run else 0):
            value = float(run[channel][i])
            if not math.isfinite(value):
                continue
            state = {k: float(run[k][i]) for k in ("rpm", "airspeed_m_s", "density_kg_m3") if k in run}
            out.append(Reference(
                quantity, value, float(run.u[channel][i]), channel, "cfd", Path(run.name).name, conditions_text(setup),
                f"{number_text(value, 4)} {unit}", where=f"{where}:{i + 1}", sha256=sha256, setup=setup, **state,
            ))  # fmt: skip
    return out


def faults_first(lines: Iterable[AuditLine]) -> list[AuditLine]:
    """What an audit finds, the worst first; settings that are fine are left out."""
    order = ("fault", "doubtful", "not stated")
    return sorted((x for x in lines if x.status in order), key=lambda x: order.index(x.status))
