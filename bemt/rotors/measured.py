"""Measured propellers as reference runs: what the fit of each says, found by maker and label.

`measured.npz` holds numbers of our own fit, no measured ones: each propeller of the population was fitted to its
readings on its stations (`reports/studies/measured_rotors.py`); a dozen smooth readings of that fit then conditioned
the rotor that its label draws, as those of another piece in another campaign (`bemt.rotors.conditioning.apart`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from bemt.base.arrays import Array
from bemt.base.cache import shipped_arrays
from bemt.data.readers.uiuc_names import FAMILIES, class_of, family_of
from bemt.rotors.conditioning import SESSION, ReferenceRun, apart, noise_of_run
from bemt.rotors.latents import NAMES, Prior, Sensed
from bemt.rotors.population import population

if TYPE_CHECKING:
    from geometry.designation import Designation

DATABASE = "UIUC Propeller Database"
_CLOSE_IN = 0.011  # labels state hundredths of an inch


@dataclass(frozen=True, eq=False)
class MeasuredRotor:
    """One measured propeller, as its fit describes it."""

    name: str  # As the database has it, such as ``gwsdd_9x5``
    family: str
    volume: str
    # Label [in], [in], [1]
    diameter_in: float
    pitch_in: float
    blades: int
    # Blade that its label draws, to which `mean` belongs: largest chord over R, camber [1], offset of the angle [deg]
    chord: float
    camber: float
    offset_deg: float
    # (K,), (K, K) Latent numbers of that blade after the readings [units of `NAMES`]
    mean: Array
    cov: Array
    # (K,) and (K,) Latent numbers of its own stations and their standard deviations
    stations: Array
    stations_sd: Array
    rpm: Array  # (P,) of the smooth readings [rev/min]
    y: Array  # (2, P) CT and CP of them [1]
    single: Array  # (2, P) their standard deviations [1]
    at: Sensed  # The solver on the blade of the label at them, its slopes at `mean`
    left: Array  # (2 P,) Readings less the solver at `mean` [1]
    # Factor on the covariance of the noise, and size of the rest, as conditioning found them [1]
    excess: float
    size: float

    @property
    def label(self) -> str:
        """Maker, series and size.

        >>> records()["apce_10x5"].label
        'APC Thin Electric 10x5'
        """
        blades = f"x{self.blades}" if self.blades != 2 else ""
        return f"{FAMILIES.get(self.family, self.family)} {self.diameter_in:.4g}x{self.pitch_in:.4g}{blades}"

    @property
    def source(self) -> str:
        """Where it was measured."""
        return f"{DATABASE}, {self.volume.replace('-', ' ')}: {self.name}"

    @property
    def designation(self) -> Designation:
        """The label, read."""
        from geometry.designation import Designation

        return Designation(
            self.diameter_in, self.pitch_in, self.blades, class_of(self.family), FAMILIES.get(self.family, self.family)
        )

    def has_size(self, told: Designation) -> bool:
        """Whether a label states its diameter, pitch and blades."""
        apart = max(abs(self.diameter_in - told.diameter_in), abs(self.pitch_in - told.pitch_in))
        return apart < _CLOSE_IN and self.blades == (told.blades or 2)

    def as_built(self) -> tuple[Prior, ReferenceRun]:
        """Law of the latent numbers and rows of the run, as `bemt.rotors.as_measured` gives them."""
        p = population()
        noise = noise_of_run(p, self.at, self.y, self.single, (SESSION, SESSION), apart(self.at.diameter_m))
        prior = Prior(self.mean, self.cov, np.ones(1), np.ones(1), "measured")
        return prior, ReferenceRun(self.at, self.left, self.excess * noise, self.size)


SENSED = ("J", "alpha_deg", "Re", "f", "top", "T")


@cache
def records() -> dict[str, MeasuredRotor]:
    """Every shipped propeller by the database's name."""
    raw = shipped_arrays("bemt.rotors", "measured.npz")
    if (names := tuple(raw["latents"])) != NAMES:
        raise ValueError(f"got latent numbers {names}; expected {NAMES}")

    def one(i: int) -> MeasuredRotor:
        v: dict[str, Any] = {
            key: np.asarray(rows[i], dtype=float) for key, rows in raw.items() if rows.dtype.kind == "f"
        }
        at = Sensed(float(v.pop("diameter_m")), *(v.pop(name) for name in SENSED))
        v = {key: float(value) if value.ndim == 0 else value for key, value in v.items()}
        v |= {key: str(raw[key][i]) for key in ("name", "family", "volume")}
        return MeasuredRotor(blades=int(raw["blades"][i]), at=at, **v)

    return {str(name): one(i) for i, name in enumerate(raw["name"])}


def find(told: Designation, family: str | None = None) -> MeasuredRotor | None:
    """Measured propeller of a label, None without one or where the label may mean several series.

    >>> from geometry.designation import parse_designation
    >>> [one and one.name for one in map(find, map(parse_designation, ("GWS HD 9x5", "APC 10x5E", "10x5", "APC 10x5")))]
    ['gwsdd_9x5', 'apce_10x5', None, None]
    """
    family = family or family_of(told.maker, told.blade_class, told.blades)
    for one in records().values():
        if one.has_size(told) and one.family == family and told.width == 0:
            return one
    return None


def measured_rotors(query: str = "") -> list[MeasuredRotor]:
    """List measured propellers whose label or name holds every word of a query.

    Parameters
    ----------
    query : str
        Words such as ``"apc 10x5"``; all propellers by default.

    Returns
    -------
    list of MeasuredRotor
        ``.name``, ``.label``, ``.source``, and the fit's numbers, by name.

    Examples
    --------
    >>> [one.label for one in measured_rotors("gws direct 9x5")]
    ['GWS Direct Drive 9x5']
    """
    words = query.casefold().split()
    return [
        one for _, one in sorted(records().items()) if all(w in f"{one.label} {one.name}".casefold() for w in words)
    ]


def table(rotors: list[MeasuredRotor]) -> str:
    """List for people: label, where it was measured, and how far its blade is from its drawing."""
    from bemt.base.tables import text_table

    if not rotors:
        makers = dict.fromkeys(FAMILIES.get(one.family, one.family) for one in records().values())
        return f"None measured has all of these words. Makers and series: {', '.join(sorted(makers))}\n"
    head = ["label", "measured as", "CT at rest", "CP at rest", "blade angle", "u", "drag", "u"]
    rows = []
    for one in rotors:
        still = np.abs(one.at.J) < 0.01
        loads = one.y[:, still].mean(axis=1) if still.any() else np.full(2, np.nan)
        k, d = NAMES.index("angle_deg"), NAMES.index("drag")
        rows.append([
            one.label, f"{one.name}, {one.volume}", f"{loads[0]:.4f}", f"{loads[1]:.4f}",
            f"{one.stations[k]:+.2f} deg", f"{one.stations_sd[k]:.2f}",
            f"{100 * one.stations[d]:+.0f} %", f"{100 * one.stations_sd[d]:.0f}",
        ])  # fmt: skip
    source = f"{DATABASE} (Brandt, Deters, Ananda, Dantsker, Selig); numbers of bemt's own fit."
    return f"{text_table(head, rows, left=(0, 1))}\n{source}\n"
