"""The first picture of a diagnosis: what was recorded, inside the prediction band of its case."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bemt.judge.compare.first_picture import PredictionView, against_band
from bemt.physics.dataset import Dataset

if TYPE_CHECKING:
    from bemt.judge.diagnose.record import Record
    from bemt.rotors.case import Case


def points_of(record: Record) -> Dataset:
    """Give the points of a record, with their loads and what these are uncertain by."""
    loads = [c for c in ("thrust_N", "torque_Nm") if c in record.measured]
    rho = np.broadcast_to(np.asarray(record.air.rho, dtype=float), record.rpm.shape)
    state = {"rpm": record.rpm, "airspeed_m_s": record.V, "density_kg_m3": rho}
    values = state | {c: record.measured[c] for c in loads}
    first, *more = record.name.split(", ")  # a legend has no room for several
    name = f"{first} and {len(more)} more" if more else first
    return Dataset("points", name, values, {c: record.u[c] for c in loads})


def first_picture(records: Sequence[Record], cases: Sequence[Case]) -> list[PredictionView]:
    """Put records beside their cases, one view a case; ``cases`` are one for all records, or one for each."""
    each = list(cases) * len(records) if len(cases) == 1 else list(cases)
    groups: dict[str, tuple[Case, list[Dataset]]] = {}
    for record, case in zip(records, each, strict=True):
        groups.setdefault(str(case.path.resolve()), (case, []))[1].append(points_of(record))
    return [against_band(case, points) for case, points in groups.values()]
