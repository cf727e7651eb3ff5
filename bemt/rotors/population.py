"""The population of measured propellers: what their latent numbers and the solver's rest scatter by.

A rotor's readings are f(z) + rest + noise.  The latent numbers z of `bemt.rotors.latents` scatter around a common mean
with a covariance whose size differs from rotor to rotor (a mixture of sizes at quantiles of Student's t: heavy tails);
the rest is a smooth Gaussian process over (J/J0, ln Re), shared by static points and flight and correlated between CT
and CP.  All of it is fitted by maximum likelihood to measured propellers (`bemt.rotors.fit`); the file beside this
module holds the numbers and where they come from.

What the label says of the blade angle is weighed against the stations by their variances: stations err by s, the label
lies below the blade angle by the offset usual for its family (known to tau where the family is unknown) and errs by l.
The blade's error has the mean -w (gap - offset) and the variance s^2 (1 - w), with w = s^2 / (s^2 + l^2 + tau^2).
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bemt.rotors.latents import KNOWN_FROM, NAMES, Prior, Sensed
from bemt.rotors.validity import Validity

Array = NDArray[np.float64]

SMALL_IN = 7.0
"""Diameter below which everything scatters more [in]."""
ANGLE_SD = {"cad": 0.1, "scan": 0.5}
"""Standard deviation of the blade angle where the blade was drawn or scanned [deg], declared: CAD as meshed; scans half
as far off as optical stations.  Those of stations and labels are part of the fit."""
CHORD_SD, CHORD_SD_SMALL = 0.21, 0.45
"""Scatter of ln(lift) and ln(drag) for a chord that only the label tells, from 7 in up and below, calibrated: of 87
propellers of UIUC the chord itself scatters by 0.17 and 0.25 around a power of the diameter (each family left out
of it), but from the label alone these widths predict them better (log score -0.09 a point for -0.12), as the blade's
law is unknown too [1]."""
LABEL_NU = 2.9
"""Degrees of freedom of Student's t fitted to the differences of stations and labels of 87 propellers of UIUC (scale
1.02 deg, centre 0.68): a label is now and then wrong by six degrees [1]."""
CAMBER_SD = 1.2
"""Zero-lift angle of a section that nobody published, around the rule's [deg]: the ten families whose camber was
calibrated lie at 3.5 to 6.5 % of the chord (rms 1.5 % from the rule's 3.5, less without slow flyers), 1.04 deg per
percent in thin-airfoil theory (NACA four-digit mean line, largest camber at 40 % chord)."""
SECTION_DRAG_SD = 0.2
"""Scatter of ln(drag) of a section that nobody published, declared: its thickness may be 6 to 12 % and its surface is
unknown."""
LIFT_RE, LIFT_SHAPE = (1e4, 3e4, 1e5, 3e5), (0.0, -1.0, 1.0, 0.0)
"""Mean lift that section tables do not know, linear in ln Re: laminar separation reattaches from 30,000 on and closes
to a shorter bubble from 70,000 (Carmichael 1981, NASA CR 165803, not checked), while tables at n_crit 3 have most of
that step below 30,000.  Nothing was measured above 126,000; from 3e5 the tables are those of another n_crit [1]."""
LIFT_ANGLE = 24.0
"""Angle of attack at 0.75 R, induction left out, at which none of it is left, linear: about 12 deg with induction,
where sections stall.  Chosen: of 15 to 30, those from 23 to 26 predict families left out best [deg]."""
HUB = 0.15
"""Hub over the diameter of the rotor that `Population.hub_cd` counts on: CT = pi/8 cd (HUB J)^2 [1]."""
CHORD_RANGE = (0.10, 0.28)
"""Chords at 0.75 R over the radius at which t/c = 0.101 (chord / 0.144)^-1.2, fitted to 17 blades of APC (PE0 files),
stays inside their 4 to 15 %; farther out the thickness, and its drag, is taken as at the ends [1]."""
RULE_CHORD = 0.15
"""Chord over the radius at which the rule's thickness of 9 % is taken as right [1]."""
SECTIONS = ("published", "calibrated", "rule", "given")
"""What a section may be: coordinates of the maker, camber calibrated on its family, the general rule, or declared."""
_QUANTILES = np.array([0.02, 0.1, 0.3, 0.5, 0.7, 0.9])
WEIGHTS = np.array([0.04, 0.12, 0.24, 0.2, 0.2, 0.2])


def label_angle_deg(pitch_m: float, diameter_m: float) -> float:
    """Blade angle at 0.75 R that a pitch stands for [deg].

    >>> round(label_angle_deg(0.127, 0.254), 2)
    11.98
    """
    return math.degrees(math.atan2(pitch_m, 0.75 * math.pi * diameter_m))


def chord_sd(diameter_m: float) -> float:
    """Scatter of ln(chord) around the chord usual for the diameter [1]."""
    return CHORD_SD if diameter_m >= SMALL_IN * 0.0254 * (1.0 - 1e-9) else CHORD_SD_SMALL


def sizes(nu: float) -> Array:
    """Factors on standard deviations whose mixture by `WEIGHTS` is nearly Student's t with nu degrees of freedom."""
    from scipy.special import gammaincinv

    return np.asarray(np.sqrt(0.5 * nu / gammaincinv(0.5 * nu, _QUANTILES)))


@dataclass(frozen=True, eq=False)
class Population:
    """Fitted numbers of the population.

    Attributes
    ----------
    mean : (K,) float
        Expectation of the latent numbers for a blade whose stations are right, in the order and units of `NAMES`.
    cov : (K, K) float
        Their covariance at size 1 with the angle as stated: the solver's own errors [their units, squared].
    stations_deg, label_deg, family_deg, offset_deg : float
        Error of the stations' angle, of the label's, scatter of the offset between families, and the offset: blade
        angle at 0.75 R over the label's [deg].
    small : float
        Exponent of (7 in / D) on all standard deviations of smaller propellers [1].
    rest_CT, rest_CP : float
        Standard deviation of the rest over the coefficient at rest [1].
    rest_small : float
        Exponent of (7 in / D) on it [1].
    rest_share : float
        The rest is as large as f^share f0^(1 - share), f the coefficient and f0 that at rest: 0 is constant over J, 1 a
        share of the coefficient itself [1].
    length_J, length_ln_Re, reach : float
        Lengths of the rest in J/J0 and in ln Re and exponent of its rational quadratic covariance, (1 + d^2 / 2 a)^-a
        (Rasmussen and Williams 2006, eq. 4.19): the smaller, the more lengths it has at once [1].
    hub_cd : float
        Drag coefficient of the hub in flight, on a disk of `HUB` diameters [1].
    lift_Re : float
        Expectation of ln(lift) at small angles of attack and Re 100,000, with the opposite sign at 30,000 [1].
    drag_chord : float
        Exponent of the chord in the expectation of the drag of sections whose thickness nobody published: narrow
        blades are thicker (`CHORD_RANGE`) [1].
    rest_correlation : float
        Of the rest between CT and CP [1].
    noise : float
        Scatter of single readings, of the coefficient [1].
    nu, nu_rest : float
        Degrees of freedom of the heavy tails: latent numbers; rest and noise, which also differ in size by rotor [1].
    offsets : mapping of str to (float, float)
        Offset of each family at hand and its standard deviation [deg].
    provenance : mapping
        Folders, propellers, points, command, version.
    validity : Validity
        Ranges of the propellers it was fitted to.
    """

    mean: Array
    cov: Array
    stations_deg: float
    label_deg: float
    family_deg: float
    offset_deg: float
    small: float
    rest_CT: float
    rest_CP: float
    rest_small: float
    rest_share: float
    length_J: float
    length_ln_Re: float
    reach: float
    hub_cd: float
    lift_Re: float
    drag_chord: float
    rest_correlation: float
    noise: float
    nu: float
    nu_rest: float
    offsets: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    validity: Validity | None = None

    @property
    def rest_sizes(self) -> Array:
        """Factors on the rest of a rotor, to be weighed by `WEIGHTS` [1]."""
        return sizes(self.nu_rest)

    def growth(self, diameter_m: float) -> float:
        """Factor on the standard deviations of the latent numbers of small propellers."""
        return math.exp(self.small * max(0.0, math.log(SMALL_IN * 0.0254 / diameter_m)))

    def angle(
        self, known_from: str, growth: float, gap_deg: float = math.nan, family: str | None = None
    ) -> tuple[float, float]:
        """Mean and variance of the error of the stated blade angle [deg], [deg^2]."""
        label = math.isfinite(gap_deg)
        offset, tau = self.offsets.get(family or "", (self.offset_deg, self.family_deg))
        second = self.label_deg**2 + tau**2
        if known_from == "label":
            return (-(gap_deg - offset) if label else 0.0), second
        own = (ANGLE_SD.get(known_from) or self.stations_deg * growth) ** 2
        if not label or known_from != "stations":
            return 0.0, own
        w = own / (own + second)
        return -w * (gap_deg - offset), own * (1.0 - w)

    def prior(
        self, known_from: str, diameter_m: float, gap_deg: float = math.nan, family: str | None = None,
        section: str = "given", declared: Collection[str] = (), sds: Mapping[str, float] | None = None,
        chord: float = math.nan,
    ) -> Prior:  # fmt: skip
        """What is known of one rotor; ``chord`` at 0.75 R over the radius where the thickness is not known [1]."""
        if known_from not in KNOWN_FROM or known_from == "reference" or section not in SECTIONS:
            raise ValueError(f"got {known_from!r}, {section!r}; expected one of {KNOWN_FROM[:-1]} and of {SECTIONS}")
        growth = self.growth(diameter_m)
        mean, cov = self.mean.copy(), self.cov * growth**2
        i, drag, camber = (NAMES.index(name) for name in ("angle_deg", "drag", "camber_deg"))
        if "angle" not in declared:
            shift, variance = self.angle(known_from, growth, gap_deg, family)
            mean[i] += shift
            cov[i, i] += variance
        if known_from == "stations" and section in ("calibrated", "rule") and math.isfinite(chord):
            mean[drag] += self.drag_chord * math.log(float(np.clip(chord, *CHORD_RANGE)) / RULE_CHORD)
        if section == "rule" and "camber" not in declared:
            cov[camber, camber] += CAMBER_SD**2
            cov[drag, drag] += SECTION_DRAG_SD**2
        if known_from == "label" and "chord" not in declared:
            # a wider blade is more lift and more drag by the same share
            both = [NAMES.index("lift"), NAMES.index("drag")]
            cov[np.ix_(both, both)] += chord_sd(diameter_m) ** 2
        prior = Prior(mean, cov, sizes(self.nu), WEIGHTS.copy(), known_from)
        return prior.scaled(sds) if sds else prior

    def widths(self, known_from: str, diameter_m: float, section: str = "rule") -> tuple[Array, Array]:
        """Standard deviations at size 1, (K,), and degrees of freedom, (K,), of what is known of each latent number.

        One answer for all that need widths of a blade; a mixture of `sizes` of those degrees by `WEIGHTS` is the law.
        """
        nu = np.full(len(NAMES), self.nu)
        if known_from == "label":
            nu[NAMES.index("angle_deg")] = LABEL_NU
        return self.prior(known_from, diameter_m, section=section).sd, nu

    def rest_sd(self, diameter_m: float, f: Array, top: Array) -> Array:
        """Standard deviation of the rest at points, (2, P): f and top as in `rest` [1]."""
        growth = math.exp(self.rest_small * max(0.0, math.log(SMALL_IN * 0.0254 / diameter_m)))
        level = growth * np.array([[self.rest_CT], [self.rest_CP]])
        top = np.abs(top)
        return np.asarray(level * top * np.clip(np.abs(f) / top, 0.05, 2.0) ** self.rest_share)

    def noise_sd(self, f: Array, top: Array) -> Array:
        """Scatter of single readings, (2, P) [1]."""
        return np.asarray(0.5 * self.noise * (np.abs(f) + np.abs(top)))

    def nearness(self, x: Array, Re: Array, x_other: Array, Re_other: Array) -> Array:
        """Correlation of the rest between points, CT rows first, (2 P, 2 Q)."""
        far = ((x[:, None] - x_other) / self.length_J) ** 2 + (np.log(Re[:, None] / Re_other) / self.length_ln_Re) ** 2
        both = np.array([[1.0, self.rest_correlation], [self.rest_correlation, 1.0]])
        return np.asarray(np.kron(both, (1.0 + far / (2.0 * self.reach)) ** -self.reach))

    def bias(self, at: Sensed) -> Array:
        """What the solver lacks in the mean, (2, P): drag of the hub (Hoerner 1965, ch. 3), lift over Re [1]."""
        alpha = np.degrees(np.arctan(at.J0 / (0.75 * np.pi)) - np.arctan(at.J0 * at.x / (0.75 * np.pi)))
        small_angles = np.clip(1.0 - alpha / LIFT_ANGLE, 0.0, 1.0)
        lift = self.lift_Re * small_angles * np.interp(np.log(at.Re), np.log(LIFT_RE), LIFT_SHAPE)
        bias = at.T[:, NAMES.index("lift")] * lift
        bias[0] -= math.pi / 8.0 * self.hub_cd * (HUB * at.J0 * at.x) ** 2
        return np.asarray(bias)

    def rest(self, diameter_m: float, x: Array, Re: Array, f: Array, top: Array) -> Array:
        """Covariance of the smooth rest. [1]"""
        amplitude = self.rest_sd(diameter_m, f, top).reshape(-1)
        return np.asarray(self.nearness(x, Re, x, Re) * np.outer(amplitude, amplitude))

    def document(self) -> dict[str, Any]:
        """Plain values for the file."""
        plain = asdict(self)
        plain["latents"] = list(NAMES)
        plain |= {name: getattr(self, name).tolist() for name in ("mean", "cov")}
        return plain

    @staticmethod
    def of(document: Mapping[str, Any]) -> Population:
        """Population of a file."""
        plain = dict(document)
        if tuple(plain.pop("latents")) != NAMES:
            raise ValueError(f"got latent numbers {document['latents']}; expected {NAMES}")
        plain |= {name: np.array(plain[name], float) for name in ("mean", "cov")}
        if plain.get("validity") is not None:
            plain["validity"] = Validity.of(plain["validity"])
        plain["offsets"] = {k: (float(a), float(b)) for k, (a, b) in plain["offsets"].items()}
        return Population(**plain)


@cache
def population() -> Population:
    """The committed population."""
    text = resources.files("bemt.rotors").joinpath("population.json").read_text(encoding="utf-8")
    return Population.of(json.loads(text))
