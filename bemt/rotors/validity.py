"""What the population of measured rotors covers, and how its band grows where a point lies outside.

Outside the data nothing measured says how wrong the solver is. Its variance is then taken to grow with the distance
from the data, each departure adding its own part, with no step at the edge:

* diameter, Reynolds number, blades, pitch: by its own size per e-fold beyond the nearest measured value, the length
  over ln Re of the fitted residual (`rest_ln_Re`, 1.0); of diameter and Reynolds number the larger counts. Rotors at
  15 to 40 times the measured Reynolds numbers lie within -5 to +26 % (X-22A, NACA report 594, Caradonna and Tung:
  reports/README.md), where this rule makes 12 % of the 6 % of a usual blade.
* J over J of zero thrust: by its own size per `LENGTH_X` at the edge, and per e-fold farther out. Descent counts from
  hover.
* tip Mach number: standard deviation linear from `FREE_MACH`, twice as large at the speed of sound. From tip Mach 0.43
  to 0.88 the solver drifts from the CT of Caradonna and Tung (NASA TM 81232) by 3 to 14 %; next to 6 % that is a factor
  of 1.7, and this rule gives 1.76.
* wind from the side: a share of what it changes, by analogy with the one rotor measured in it whose blades are known
  (PCA-2, NACA Report 515, pitch 1.9 deg, advance ratio 0.14 to 0.55): thrust is off by 12 % of that change rms,
  and torque by half of it, as far as friction is not known. Two stiff blades are not four hinged ones: thrust counts
  twice. Not a factor: a part of its own.
* descent: an eighth of the thrust from the induced speed of hover on, less before; Castles and Gray (NACA TN 2474,
  constant chord) are 8 % rms off up to 0.45 of that speed, 13 % from there to 1.6 and 12 % beyond.
* a duct: nothing, as long as the ducted rotors that were compared cover the point; they have a rest of their own
  (`bemt.rotors.population.Ducted`). What a case leaves open of its duct is in the band as inputs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array

if TYPE_CHECKING:
    from geometry.rotor import Blade

Range = tuple[float, float]

FREE_MACH = 0.5
"""Tip Mach number up to which nothing is widened, though the measured ones end below: sections at 0.75 R then see 0.38,
where the Prandtl-Glauert factor is 8 % and in the solver [1]."""
LENGTH_X = 0.34
"""Length over J/J0 on which the residual forgets itself: fitted to 89 propellers with the residual written over it; the
7 deg of today's, over the angle of attack, are the same on a usual blade [1]."""
SIDE = (0.25, 0.5)
"""Error of CT and CP over what wind from the side changes [1]."""
SINK = 0.125
"""Error of CT and CP in descent over their size [1]."""
SAID = 1.01
"""Smallest factor that a single departure is named for [1]."""
DOUBTFUL = 2.5
"""Factor from which a point is called one not to be trusted, declared [1]."""

OUTSIDE, DOUBT = "beyond what was measured", "do not trust it"


def serious(flags: Sequence[str]) -> tuple[str, ...]:
    """Flags that forbid to call a point one that agrees, without their numbers; a band that is a little wider does not.

    >>> serious(["supersonic tip: Mach 1.09", "beyond what was measured: 5 blades (rotors 2 to 4)"])
    ('supersonic tip',)
    """
    return tuple(kind(f) for f in flags if not f.startswith(OUTSIDE) or f.endswith(DOUBT))


def kind(flag: str) -> str:
    """What a flag is about: its words up to the numbers.

    >>> kind("not converged at r/R 0.31: no root"), kind("supersonic tip: Mach 1.09, beyond section theory")
    ('not converged', 'supersonic tip')
    """
    return re.split(r":| on \d| at r/R", flag)[0]


def counted(flags: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Flags of many points, those of one kind together: how many points have it, and the words of the last.

    >>> counted([(), ("supersonic tip: Mach 1.05",), ("supersonic tip: Mach 1.09",)])
    ('2 of 3 points: supersonic tip: Mach 1.09',)
    >>> counted([("a duct",)])
    ('a duct',)
    """
    found: dict[str, list[str]] = {}
    for point in flags:
        for flag in point:
            found.setdefault(kind(flag), []).append(flag)
    if len(flags) == 1:
        return tuple(flags[0])
    return tuple(f"{len(all_)} of {len(flags)} points: {all_[-1]}" for all_ in found.values())


@dataclass(frozen=True)
class Validity:
    """Ranges of the measured rotors. Smallest and largest value each."""

    diameter_m: Range
    x: Range  # J over the solver's J of zero thrust [1]
    Re: Range  # Reynolds number at 0.75 R [1]
    M_tip: float  # Largest rotational tip Mach number [1]
    blades: tuple[int, int]
    pitch_over_D: Range  # Geometric pitch at 0.75 R over the diameter [1]

    @staticmethod
    def of_rotor(
        diameter_m: float, blades: int, pitch_over_D: float, x: ArrayLike, Re: ArrayLike, M_tip: ArrayLike
    ) -> Validity:
        """Ranges of one rotor at its points."""
        x_ends, Re_ends = ((float(np.nanmin(v)), float(np.nanmax(v))) for v in (x, Re))
        D, pitch = float(diameter_m), float(pitch_over_D)
        return Validity((D, D), x_ends, Re_ends, float(np.nanmax(M_tip)), (int(blades), int(blades)), (pitch, pitch))

    @staticmethod
    def of_rotors(rotors: Iterable[Validity]) -> Validity:
        """Ranges of several.

        >>> one = Validity.of_rotor(0.254, 2, 0.5, [0.0, 0.8], [3e4, 9e4], 0.2)
        >>> Validity.of_rotors([one, Validity.of_rotor(0.2, 3, 0.6, [0.0], [2e4], 0.3)]).Re
        (20000.0, 90000.0)
        """
        found = list(rotors)

        def ends(name: str) -> tuple[Any, Any]:
            return min(getattr(one, name)[0] for one in found), max(getattr(one, name)[1] for one in found)

        fastest = max(one.M_tip for one in found)
        return Validity(
            ends("diameter_m"), ends("x"), ends("Re"), fastest, ends("blades"), ends("pitch_over_D")
        )  # fmt: skip

    @staticmethod
    def of(document: Mapping[str, Any]) -> Validity:
        """Ranges of a file."""
        plain: dict[str, Any] = {k: tuple(v) if isinstance(v, (list, tuple)) else v for k, v in document.items()}
        return Validity(**plain)

    def at(
        self, diameter_m: float, blades: int, pitch_over_D: float, x: Array, Re: Array, M_tip: Array
    ) -> tuple[Array, tuple[tuple[str, ...], ...]]:
        """Factor on the model's own error, (P,), and for each point the sentence that says why; none inside."""
        P = np.size(x)
        M_tip = np.asarray(M_tip, dtype=float)
        mach = (1.0 + np.maximum(M_tip - max(self.M_tip, FREE_MACH), 0.0) / (1.0 - FREE_MACH)) ** 2 - 1.0
        ahead, behind = (
            self.x[1] / LENGTH_X * np.log1p(np.maximum(far, 0.0) / self.x[1]) for far in (x - self.x[1], self.x[0] - x)
        )
        size, Reynolds = _folds(diameter_m, self.diameter_m), _folds(Re, self.Re)
        parts: list[tuple[ArrayLike, str, ArrayLike, str]] = [
            (size, "diameter {:.3g} m", diameter_m, _ends(self.diameter_m)),
            (Reynolds, "Re {:,.0f} at 0.75 R", Re, _ends(self.Re)),
            (_folds(blades, self.blades), "{:.0f} blades", blades, _ends(self.blades)),
            (_folds(pitch_over_D, self.pitch_over_D), "pitch/D {:.2f}", pitch_over_D, _ends(self.pitch_over_D)),
            (ahead, "J {:.3g} times that of zero thrust", x, _ends(self.x)),
            (behind, "descent at J {:.3g} times that of zero thrust", x, _ends(self.x)),
            (mach, "tip Mach {:.2f}", M_tip, f"up to {self.M_tip:.2f}"),
        ]  # fmt: skip
        more = [np.broadcast_to(np.nan_to_num(part), P) for part, *_ in parts]
        factor = np.sqrt(1.0 + np.sum(more, axis=0) - np.minimum(more[0], more[1]))
        said: list[tuple[str, ...]] = [()] * P
        for i in np.flatnonzero(np.max(more, axis=0) > SAID**2 - 1.0).tolist():
            why = [
                f"{text.format(_three(float(np.broadcast_to(value, P)[i])))} (rotors {known})"
                for part, (_, text, value, known) in zip(more, parts, strict=True)
                if part[i] > SAID**2 - 1.0
            ]
            doubt = f"; {DOUBT}" if factor[i] >= DOUBTFUL else ""
            said[i] = (f"{OUTSIDE}: {', '.join(why)}, so that {_wider(float(factor[i]))}{doubt}",)
        return np.asarray(factor, dtype=float), tuple(said)


def aside(loads: Array, axial: Array, sink: Array) -> Array:
    """Standard deviation that wind from the side and descent add to the model's own, (2, P) of CT and CP [1].

    ``axial`` (2, P) are the coefficients without the wind from the side, ``sink`` (P,) is the speed of descent over
    the induced speed of hover at this thrust, 0 in climb [1].
    """
    return np.asarray(np.hypot(np.array(SIDE)[:, None] * (loads - axial), SINK * np.clip(sink, 0.0, 1.0) * loads))


def _folds(value: ArrayLike, known: tuple[float, float]) -> Array:
    """E-folds by which a value lies outside its range."""
    v = np.maximum(np.asarray(value, dtype=float), 1e-12)
    return np.asarray(np.log(np.maximum(np.maximum(known[0] / v, v / known[1]), 1.0)))


def _wider(factor: float) -> str:
    """What a factor on the model's own error means.

    >>> _wider(1.04), _wider(2.6)
    ("the model's own uncertainty is 4 % wider", "the model's own uncertainty is 2.6 times as wide")
    """
    size = f"{1e2 * (factor - 1.0):.0f} % wider" if factor < 2.0 else f"{factor:.3g} times as wide"
    return f"the model's own uncertainty is {size}"


def _three(value: float) -> float:
    """To three digits."""
    return float(f"{value:.3g}")


def _ends(known: tuple[float, float]) -> str:
    low, high = (f"{_three(v):,.0f}" if v >= 1e3 or float(v).is_integer() else f"{v:.2g}" for v in known)
    return f"{low} to {high}"


SWEPT_DEG = 15.0
"""Sweep or rake of the outer half of the blade from which its loads are doubted, declared [deg]."""


def swept_words(blade: Blade) -> tuple[str, ...]:
    """What is said of a blade whose sweep or rake is too large to be left out of the loads.

    By simple sweep theory, lift goes with the square of the cosine of the angle of sweep, whatever its direction; the
    solver leaves it out. 15 deg are 7 % of the tip's lift, about what the band of a usual blade holds.
    """
    if blade.sweep is None or blade.rake is None:
        return ()
    out = blade.r > 0.5 * blade.R
    slope = np.hypot(np.gradient(blade.sweep, blade.r), np.gradient(blade.rake, blade.r))
    angle = math.degrees(math.atan(float(np.max(slope[out], initial=0.0))))
    if angle < SWEPT_DEG:
        return ()
    return (f"swept blade: by up to {angle:.0f} deg, loads are those of the straight one",)
