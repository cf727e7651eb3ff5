"""What readers of other rooms return, as the record that ``import`` shows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import singledispatch
from typing import Any

import numpy as np

from bemt.base.averaging import Mean, keep_last, revolution_average
from bemt.base.errors import Fault, InputError, refuse
from bemt.data.readers.apc import ApcPerformance
from bemt.data.readers.references import Reference
from bemt.data.readers.samples import Channel, dataset
from bemt.data.readers.slices import Slices
from bemt.data.recordings.channels import clocks_of, named
from bemt.data.recordings.check import Finding, check
from bemt.data.recordings.reduce import reduce
from bemt.physics.dataset import Dataset
from bemt.physics.dataset.channels import unit_in
from bemt.physics.sections.polars import Polar


def is_recording(record: Dataset, adapted: bool) -> bool:
    """Whether a record is a table of measurements as a stand wrote it: to be checked and reduced."""
    if adapted:
        return False
    if record.kind != "table":
        return record.kind == "bench"
    known = named(record).values.keys()
    return "rpm" in known and bool({"thrust_N", "torque_Nm", "power_W"} & known)


def findings(
    record: Dataset, diameter_m: float | None = None, density_kg_m3: float | None = None, ducted: bool = False
) -> tuple[Finding, ...]:
    """Faults of a recording, of a rotor as far as it is known."""
    measured = record.kind in ("bench", "table")
    return check(record, diameter_m=diameter_m, ducted=ducted, density_kg_m3=density_kg_m3) if measured else ()


def reduction_of(record: Dataset) -> Dataset | str:
    """Reduce, or say why not."""
    try:
        return reduce(record)
    except InputError as error:
        return "; ".join(f"got {f.got}; expected {f.expected}{f'. {f.hint}' if f.hint else ''}" for f in error.faults)


_KIND = {"apc": "vendor", "uiuc": "bench", "references": "table"}
_GEOMETRY = ("ApcBlade", "BladeFile", "UiucGeometry", "UiucThickness")


def _columns(found: Any) -> Iterator[tuple[str, Any]]:
    """Name and values of the one-dimensional numbers of a record."""
    for item in fields(found):
        value = getattr(found, item.name)
        if isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind == "f":
            yield item.name, value
        elif isinstance(value, float):
            yield item.name, np.array([value])


def _channels(columns: Mapping[str, Any]) -> dict[str, Channel]:
    """Columns with the unit that their name says; one value stands for all rows."""
    rows = max((np.size(v) for v in columns.values()), default=0)
    out = {}
    for name, values in columns.items():
        array = np.asarray(values, dtype=float)
        one = array.size == 1 and bool(np.isfinite(array[0]))
        mean = Mean(float(array[0]), "one value") if one else None
        out[name] = Channel(np.full(rows, array[0]) if one else array, unit_in(name), mean)
    return out


def adapt(found: Any, form: str, name: str) -> Dataset:
    """Make the dataset of whatever a reader returned.

    >>> adapt(Dataset("bench", "stand", {"rpm": [6000.0, 7000.0], "thrust_N": [10.0, 13.5]}), "csv", "a.csv")
    Dataset('bench', 'stand', 2 points: rpm, thrust_N)
    """
    if isinstance(found, Mapping):
        return _along(found, form, name)
    made = _dataclass(found, form, name) if is_dataclass(found) and not isinstance(found, type) else None
    if isinstance(found, list) and found and all(isinstance(item, Reference) for item in found):
        made = _references(found, form, name)
    if made is None:
        raise InputError(Fault(name, "", f"a {type(found).__name__} without numbers", "something that can be shown"))
    return made


@singledispatch
def _dataclass(found: Any, form: str, name: str) -> Dataset | None:
    columns = dict(_columns(found))
    if not any(len(values) for values in columns.values()):
        return None
    kind = "geometry" if type(found).__name__ in _GEOMETRY else _KIND.get(form, "table")
    notes = tuple(str(note) for note in getattr(found, "notes", ()) or ())
    return dataset(form, kind, _channels(columns), notes, _texts(getattr(found, "provenance", {}), name))


@_dataclass.register
def _series(found: Dataset, form: str, name: str) -> Dataset:
    if "format" in found.provenance:
        return found
    flags = sorted({flag for row in found.flags for flag in row})
    about = {**_texts(found.provenance, name), "format": form}
    return replace(found, provenance=about, notes=(*found.notes, *flags))


@_dataclass.register
def _polar(found: Polar, form: str, name: str) -> Dataset:
    axes = {"alpha_rad": found.alpha, "Re": found.Re, "M": found.M}
    at = dict(zip(axes, np.meshgrid(*axes.values(), indexing="ij"), strict=True))
    channels = _channels({k: at[k].ravel() if axis.size > 1 else axis for k, axis in axes.items()})
    channels |= {key: Channel(getattr(found, key).ravel()) for key in ("cl", "cd")}
    return dataset(form, "polar", channels, found.notes, {"file": name, "source": found.source})


@_dataclass.register
def _performance(found: ApcPerformance, form: str, name: str) -> Dataset:
    told = f"{found.name}: {found.blades} blades, D {found.diameter_m:.4g} m, pitch {found.pitch_m:.4g} m"
    table, remark = _series(found.series, form, name), str(found.series.provenance.get("remark", ""))
    return replace(table, notes=(told, *filter(None, [remark]), *table.notes))


def _texts(provenance: Mapping[str, Any], name: str) -> dict[str, str]:
    return {"file": name, **{str(k): str(v) for k, v in provenance.items() if isinstance(v, (str, int, float))}}


def _references(found: list[Reference], form: str, name: str) -> Dataset:
    columns: dict[str, list[float]] = {}
    for item in found:
        columns.setdefault(item.channel, []).append(item.value)
    kinds = {item.kind for item in found}
    kind = kinds.pop() if len(kinds) == 1 else "table"
    return dataset(form, kind, _channels(columns), (), {"file": name, "sha256": found[0].sha256})


def _along(found: Mapping[str, Slices], form: str, name: str) -> Dataset:
    """Loads along the blade, a run after the other, with their sums."""
    notes = [f"{run}: {np.trapezoid(s.thrust, s.r):.4g} N and {np.trapezoid(s.torque, s.r):.4g} N m between the radii "
             f"{s.r[0]:.4g} and {s.r[-1]:.4g} m" for run, s in found.items() if not s.over_R]  # fmt: skip
    command = f"`bemt diagnose RECORDING --case CASE --along {name}`"
    notes.append(f"taken for loads of all blades; {command} sets them beside BEMT")
    over = any(s.over_R for s in found.values())
    columns = {"r_over_R" if over else "r_m": "r", "thrust_per_radius_N_m": "thrust",
               "torque_per_radius_Nm_m": "torque"}  # fmt: skip
    channels = {k: Channel(np.concatenate([getattr(s, a) for s in found.values()]), k.split("_", 3)[-1] if a != "r"
                           else "-" if over else "m") for k, a in columns.items()}  # fmt: skip
    return dataset(form, "table", channels, notes, {"file": name})


# Averages of one history over whole revolutions, whose duration only the user knows.
@dataclass(frozen=True)
class Choice:
    """What only the user knows."""

    period: float | None = None  # Duration of a revolution [s]; None: no average over revolutions
    revolutions: int | None = None  # How many; None takes 4, or half of the run


def averaged(record: Dataset, period: float, revolutions: int | None = None) -> Dataset:
    """Replace the means of a history by those over its last whole revolutions.

    >>> import numpy as np
    >>> t = np.arange(1, 401) * 0.01
    >>> r = Dataset("cfd", "x", {"time_s": t, "q": 2 + np.sin(2 * np.pi * t)}, units={"q": ""},
    ...             provenance={"clock": "time", "time_channel": "time_s", "clock_channels": "time_s"})
    >>> mean = averaged(r, 1.0).provenance["means"]["q"]
    >>> round(mean.value, 9), mean.over
    (2.0, 'last 2 revolutions (2 to 4 s, 200 rows)')
    """
    clock, every = clocks_of(record)
    name = clock or "time_s"
    own = {name, *every}
    if name not in record:
        note = "no column of time: the speed of rotation is not used"
        return replace(record, notes=(*record.notes, note))
    time = record[name]
    told = record.means
    index, notes = keep_last(time, name)
    problems: dict[str, list[str]] = {}
    scatter: dict[str, float] = {}
    means: dict[str, Mean] = {}
    for key, values in record.values.items():
        if key in own or (key not in told and record.unit(key) == "s"):
            continue
        average = revolution_average(time[index], values[index], period, revolutions)
        if average.unlike:
            scatter[key] = average.unlike
        if average.problem:
            problems.setdefault(average.problem, []).append(key)
        if average.mean is not None:
            means[key] = Mean(average.mean, average.span, average.drift)
    more = [
        f"{'no mean' if 'only' not in text else 'doubtful mean'} of {', '.join(keys)}: {text}"
        for text, keys in problems.items()
    ]
    if scatter:
        worst = ", ".join(f"{key} {value:.2%}" for key, value in list(scatter.items())[:6])
        more.append(f"means of single revolutions differ: {worst}")
    return replace(record, provenance={**record.provenance, "means": means}, notes=(*record.notes, *notes, *more))


def asked(rpm: float | None = None, period: float | None = None, revolutions: int | None = None) -> Choice:
    """Make a choice of options, or refuse them, all faults at once."""
    faults = []
    if rpm is not None and not (math.isfinite(rpm) and 0.01 <= rpm <= 1e6):
        faults.append(Fault("", "--rpm", f"{rpm:g}", "a number from 0.01 to 1e6 rev/min"))
    if period is not None and not (math.isfinite(period) and 6e-5 <= period <= 6e3):
        faults.append(Fault("", "--period-s", f"{period:g}", "a time from 6e-5 to 6000 s"))
    if rpm is not None and period is not None:
        faults.append(Fault("", "--rpm, --period-s", "both", "one of them"))
    if revolutions is not None and not 1 <= revolutions <= 10**6:
        faults.append(Fault("", "--revolutions", str(revolutions), "a whole number of 1 or more"))
    if revolutions is not None and rpm is None and period is None:
        faults.append(Fault("", "--revolutions", "no speed", "--rpm or --period-s as well"))
    refuse(faults)
    return Choice(60.0 / rpm if rpm is not None else period, revolutions)
