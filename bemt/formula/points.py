"""Measured points for a calibration: propellers, and their coefficients over speed and advance ratio."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bemt import coefficients as co
from bemt.air import Air
from bemt.base.errors import Fault, InputError
from bemt.formula import compact

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MeasuredPropeller:
    """One propeller of the data."""

    # As the data name it; the family that is left out together; where it comes from
    name: str
    maker: str
    source: str
    # Nominal [m]
    diameter_m: float
    pitch_m: float
    blades: int = 2  # Number of blades
    chord_m: float = float("nan")  # Chord at 0.75 R; NaN when unknown [m]
    ducted: bool = False  # In a duct: scored, never fitted
    measured_pitch_m: float = float("nan")  # 2 pi 0.75 R tan(blade angle there); NaN when unknown [m]


@dataclass(frozen=True, eq=False)
class FitPoints:
    """N measured points of K propellers."""

    propellers: tuple[MeasuredPropeller, ...]  # K propellers
    index: NDArray[np.intp]  # (N,) propeller of each point
    rpm: Array  # (N,) rotational speed [rev/min]
    # (N,) propeller convention; CP is NaN where no power was measured [-]
    J: Array
    CT: Array
    CP: Array
    refused: tuple[str, ...] = ()  # Files or propellers left out, with the reason
    notes: tuple[str, ...] = ()  # What a user has to know of the sources

    def of(self, name: str) -> Array:
        """Number of the propeller at each point, by field name, (N,)."""
        return np.array([float(getattr(p, name)) for p in self.propellers])[self.index]

    @property
    def P_D(self) -> Array:
        """Pitch over diameter. [-]"""
        return self.of("pitch_m") / self.of("diameter_m")

    @property
    def x(self) -> Array:
        """J/(P/D). [-]"""
        return self.J / self.P_D

    @property
    def ducted(self) -> NDArray[np.bool_]:
        """Whether the rotor runs in a duct."""
        return np.array([p.ducted for p in self.propellers])[self.index]

    def chord(
        self,
        constants: compact.Constants = compact.CONSTANTS,
        known: bool = True,
        series: Mapping[str, compact.MakerSeries] = compact.SERIES,
    ) -> Array:
        """Chord at 0.75 R, (N,) [m]."""
        c = self.of("chord_m")
        own = np.array([series.get(p.maker, compact.MakerSeries()).chord for p in self.propellers])[self.index]
        typical = own * np.asarray(compact.default_chord(self.of("diameter_m"), constants))
        return np.where(np.isfinite(c) & known, c, typical)

    def Re(self, chord_m: Array) -> Array:
        """Reynolds number at 0.75 R in standard air, (N,) [-]."""
        air, n, D = Air.from_density(), self.rpm / 60.0, self.of("diameter_m")
        return np.asarray(co.Re75(chord_m, n, D, self.J * n * D, air.rho, air.mu))

    @property
    def M_tip(self) -> Array:
        """Rotational tip Mach number in standard air. [-]"""
        return np.asarray(co.M_tip(self.rpm / 60.0, self.of("diameter_m"), Air.from_density().a_sound))

    def select(self, where: NDArray[np.bool_]) -> FitPoints:
        """Part of the points, propellers kept."""
        arrays = {name: getattr(self, name)[where] for name in ("index", "rpm", "J", "CT", "CP")}
        return replace(self, **arrays)


Rows = tuple[MeasuredPropeller, Array, Array, Array, Array]


def join(rows: Sequence[Rows], refused: Sequence[str] = (), notes: Sequence[str] = ()) -> FitPoints:
    """Make points of rows per propeller and run; rows of equal propellers are joined."""
    numbers: dict[str, int] = {}
    unique: list[MeasuredPropeller] = []
    parts: list[tuple[Array, ...]] = []
    for made, *arrays in rows:
        k = numbers.setdefault(repr(made), len(unique))
        if k == len(unique):
            unique.append(made)
        rpm, J, CT, CP = (np.asarray(a, dtype=float) for a in arrays)
        ok = np.isfinite(rpm) & (rpm > 0) & np.isfinite(J) & np.isfinite(CT)
        parts.append((np.full(int(ok.sum()), k), rpm[ok], J[ok], CT[ok], CP[ok]))
    joined = [np.concatenate(column) for column in zip(*parts, strict=True)] if parts else [np.empty(0)] * 5
    if joined[0].size == 0:
        raise InputError(Fault("", "", "no finite point", "rows with rpm, J and CT"))
    rpm, J, CT, CP = joined[1:]
    return FitPoints(tuple(unique), joined[0].astype(np.intp), rpm, J, CT, CP, tuple(refused), tuple(notes))
