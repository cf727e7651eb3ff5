"""The population of measured propellers: by how much real rotors differ from the solver.

A reading is f(z) + bias + rest + noise. The latent numbers z of `bemt.rotors.latents` scatter by family and by rotor
with a size that differs from rotor to rotor (a mixture of sizes at quantiles of Student's t: heavy tails). The rest is
a Gaussian process over the angle of attack at 0.75 R and ln Re: errors of the section tables, which enter as a change
of zero-lift angle and of ln(drag) through the solver's own slopes, a remainder of CT and CP, and a part at rest that
flight does not share. All numbers are fitted by maximum likelihood to measured propellers
(`reports/studies/population_fit.py`); the file beside this module holds them and where they come from.

What the label says of the blade angle is weighed against the stations by their variances: stations err by s, the label
lies below the blade angle by the offset usual for its family (known to tau where the family is unknown) and errs by l.
The blade's error has the mean -w (gap - offset) and the variance s^2 (1 - w), with w = s^2 / (s^2 + l^2 + tau^2).
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cache, lru_cache
from importlib import resources
from typing import Any

import numpy as np

from bemt.base.arrays import Array
from bemt.rotors.latents import KNOWN_FROM, NAMES, Prior, Sensed, arrays_of
from bemt.rotors.validity import Validity

SMALL_IN = 7.0
"""Diameter below which the rest, and the chord of a label, scatter more [in]."""
ANGLE_SD = {"cad": 0.1, "scan": 0.5}
"""Standard deviation of the blade angle where the blade was drawn or scanned [deg], declared: CAD as meshed; scans half
as far off as optical stations.  Those of stations and labels are part of the fit."""
CHORD_SD, CHORD_SD_SMALL = 0.15, 0.35
"""Scatter of ln(lift) and ln(drag) for a chord that only the label tells, from 7 in up and below, calibrated: of six
pairs the one that predicts 175 propellers of UIUC from their labels best (mean log score, families by the root of their
size); their chords scatter by 0.17 around the law [1]."""
LIFT_RE, LIFT_SHAPE = (1e4, 3e4, 1e5, 3e5), (0.0, -1.0, 1.0, 0.0)
"""Mean lift that section tables do not know, linear in ln Re: laminar separation reattaches from 30,000 on and closes
to a shorter bubble from 70,000 (Carmichael 1981, NASA CR 165803, not checked), while tables at n_crit 3 have most of
that step below 30,000.  Nothing was measured above 126,000; from 3e5 the tables are those of another n_crit [1]."""
LIFT_ANGLE = 12.0
"""Angle of attack at 0.75 R at which none of it is left, linear: sections stall [deg]."""
HUB = 0.15
"""Hub over the diameter of the rotor that `Population.hub_cd` counts on: CT = pi/8 cd (HUB J)^2 [1]."""
AT_REST_J = 0.05
"""Advance ratio within which the part of the rest that belongs to hover fades, as exp(-(J / 0.05)^2), declared [1]."""
TURNED_DEG = 8.0
"""Length of the rest over a turn of the blade in its hub, calibrated on twelve pairs of 3D-printed blades turned by 5
deg (NR640, DA4052), one measured, the other predicted: mean log scores 1.02 and 0.95 at 10 deg, 1.09 and 0.82 at 6;
with the rest carried over as if nothing had changed, -0.15 and -0.07 [deg]."""
SECTIONS = ("published", "rule", "given")
"""What a section may be: coordinates of the maker, the general rule, or declared."""
SHARED = ("angle_deg", "drag", "camber_deg")
"""Latent numbers that the rotors of a family have in common."""
_QUANTILES = np.array([0.005, 0.03, 0.12, 0.3, 0.5, 0.7, 0.9])
WEIGHTS = np.array([0.01, 0.04, 0.14, 0.21, 0.2, 0.2, 0.2])
_ANGLE, _LIFT, _DRAG, _CAMBER = (NAMES.index(n) for n in ("angle_deg", "lift", "drag", "camber_deg"))
_SHARED = [NAMES.index(n) for n in SHARED]
_REST = ("local_camber_deg", "local_drag", "rest_CT", "rest_CP", "hover_CT", "hover_CP")


def label_angle_deg(pitch_m: float, diameter_m: float) -> float:
    """Blade angle at 0.75 R that a pitch stands for [deg].

    >>> round(label_angle_deg(0.127, 0.254), 2)
    11.98
    """
    return math.degrees(math.atan2(pitch_m, 0.75 * math.pi * diameter_m))


def chord_sd(diameter_m: float) -> float:
    """Scatter of ln(chord) around the chord usual for the diameter [1]."""
    return CHORD_SD if diameter_m >= SMALL_IN * 0.0254 * (1.0 - 1e-9) else CHORD_SD_SMALL


@lru_cache(maxsize=64)
def sizes(nu: float) -> Array:
    """Factors on standard deviations whose mixture by `WEIGHTS` is nearly Student's t with nu degrees of freedom."""
    from scipy.special import gammaincinv

    return np.asarray(np.sqrt(0.5 * nu / gammaincinv(0.5 * nu, _QUANTILES)))


@dataclass(frozen=True, eq=False)
class Family:
    """What measured propellers of one family have in common, from the population's spread between families."""

    # Blade angle over the label's and its standard deviation [deg]
    offset_deg: float
    offset_sd_deg: float
    # (3,), (3, 3) Shift of `SHARED` from what is usual, and its covariance [units of `NAMES`]
    mean: Array
    cov: Array


@dataclass(frozen=True, eq=False)
class Ducted:
    """What ducted rotors whose case is stated say of the rest (`reports/studies/duct_fans.py`)."""

    size: float  # Their rest over that of open rotors: root mean square over families [1]
    families: int  # Families of them; so many degrees of freedom has what is expected of another one
    validity: Validity  # Ranges of them
    provenance: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Population:
    """Fitted numbers of the population."""

    # Error of the stations' angle, of the label's, scatter of the offset between families, and the offset: blade angle
    # at 0.75 R over the label's [deg]
    stations_deg: float
    label_deg: float
    family_deg: float
    offset_deg: float
    # Standard deviations of zero-lift angle [deg], ln(drag) and ln(lift) of a known section [1]
    camber_deg: float
    drag: float
    lift: float
    # The same of a section that nobody published, besides
    unknown_camber_deg: float
    unknown_drag: float
    camber_drag: float  # Correlation of zero-lift angle and ln(drag) [1]
    slow_flyer_deg: float  # Further zero-lift angle of slow flyers [deg]
    rest_small: float  # Exponent of (7 in / D) on the rest of smaller propellers [1]
    # Errors of the section tables that change with the angle of attack: zero-lift angle [deg], ln(drag) [1]
    local_camber_deg: float
    local_drag: float
    local_correlation: float
    # Their lengths in angle of attack [deg] and in ln Re
    local_deg: float
    local_ln_Re: float
    # Remainder over the coefficient at rest, correlation of CT and CP [1], lengths as above
    rest_CT: float
    rest_CP: float
    rest_correlation: float
    rest_deg: float
    rest_ln_Re: float
    rest_share: float  # The remainder is as large as f^share f0^(1 - share), f the coefficient and f0 that at rest [1]
    # Exponent of the rational quadratic covariance, (1 + d^2 / 2 a)^-a (Rasmussen and Williams 2006, eq. 4.19): the
    # smaller, the more lengths it has at once [1]
    reach: float
    # Part of the rest that flight does not share with hover, over the coefficient at rest [1]
    hover_CT: float
    hover_CP: float
    noise: float  # Scatter of single readings, of the coefficient [1]
    hub_cd: float  # Drag coefficient of the hub in flight, on a disk of `HUB` diameters [1]
    # Expectation of ln(lift) at small angles of attack and Re 100,000, with the opposite sign at 30,000 [1]
    lift_Re: float
    # Degrees of freedom of the heavy tails: latent numbers; rest and noise, which also differ in size by rotor [1]
    nu: float
    nu_rest: float
    between: tuple[float, ...] = (0.5, 0.5, 0.5)  # Share of the variances of `SHARED` that is between families [1]
    families: Mapping[str, Family] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)  # Folders, propellers, points, command, version
    validity: Validity | None = None  # Ranges of the propellers it was fitted to
    ducted: Ducted | None = None

    def in_duct(self) -> Population:
        """Population of ducted rotors: the rest of open ones times `Ducted.size`, with the tails of few families.

        What is known of a blade stays: angle, chord and section do not ask what is around them.
        """
        if self.ducted is None:
            return self
        rest = {name: self.ducted.size * getattr(self, name) for name in _REST}
        both = [known for known in (self.validity, self.ducted.validity) if known is not None]
        return replace(
            self, **rest, nu_rest=float(self.ducted.families), validity=Validity.of_rotors(both), ducted=None
        )

    @property
    def rest_sizes(self) -> Array:
        """Factors on the rest of a rotor, to be weighed by `WEIGHTS` [1]."""
        return sizes(self.nu_rest)

    def angle(self, known_from: str, gap_deg: float = math.nan, family: Family | None = None) -> tuple[float, float]:
        """Mean and variance of the error of the stated blade angle [deg], [deg^2]."""
        offset, tau = (self.offset_deg, self.family_deg)
        if family is not None:
            offset, tau = family.offset_deg, family.offset_sd_deg
        second = self.label_deg**2 + tau**2
        if known_from == "label":
            return (-(gap_deg - offset) if math.isfinite(gap_deg) else 0.0), second
        if known_from in ANGLE_SD:
            return 0.0, ANGLE_SD[known_from] ** 2
        mean, own = 0.0, self.stations_deg**2
        if family is not None:
            mean, own = float(family.mean[0]), (1.0 - self.between[0]) * own + float(family.cov[0, 0])
        if not math.isfinite(gap_deg):
            return mean, own
        w = own / (own + second)
        return mean - w * (gap_deg + mean - offset), own * (1.0 - w)

    def section(self, section: str, blade_class: str | None) -> tuple[Array, Array]:
        """Mean and covariance of ln(drag) and zero-lift angle before the family is known, (2,) and (2, 2)."""
        mean, variance = np.zeros(2), np.array([self.drag, self.camber_deg]) ** 2
        if section == "rule":
            variance += np.array([self.unknown_drag, self.unknown_camber_deg]) ** 2
            mean[1] = self.slow_flyer_deg if blade_class == "slow_flyer" else 0.0
        cross = self.camber_drag * math.sqrt(variance[0] * variance[1])
        return mean, np.array([[variance[0], cross], [cross, variance[1]]])

    def prior(
        self, known_from: str, diameter_m: float, gap_deg: float = math.nan, family: str | None = None,
        section: str = "given", declared: Collection[str] = (), sds: Mapping[str, float] | None = None,
        blade_class: str | None = None,
    ) -> Prior:  # fmt: skip
        """What is known of one rotor."""
        if known_from not in KNOWN_FROM[:-2] or section not in SECTIONS:
            raise ValueError(f"got {known_from!r}, {section!r}; expected one of {KNOWN_FROM[:-2]} and of {SECTIONS}")
        kin = self.families.get(family or "")
        mean, cov = np.zeros(len(NAMES)), np.zeros((len(NAMES), len(NAMES)))
        both = np.ix_([_DRAG, _CAMBER], [_DRAG, _CAMBER])
        mean[[_DRAG, _CAMBER]], cov[both] = self.section(section, blade_class)
        cov[_LIFT, _LIFT] = self.lift**2
        if kin is not None:
            own = np.sqrt(1.0 - np.array(self.between[1:]))
            mean[[_DRAG, _CAMBER]] += kin.mean[1:]
            cov[both] = cov[both] * np.outer(own, own) + kin.cov[1:, 1:]
        if "camber" in declared:
            mean[_CAMBER], cov[_CAMBER], cov[:, _CAMBER] = 0.0, 0.0, 0.0
            cov[_CAMBER, _CAMBER] = self.camber_deg**2
        if "angle" not in declared:
            mean[_ANGLE], cov[_ANGLE, _ANGLE] = self.angle(known_from, gap_deg, kin)
        if known_from == "label" and "chord" not in declared:
            # a wider blade is more lift and more drag by the same share
            cov[np.ix_([_LIFT, _DRAG], [_LIFT, _DRAG])] += chord_sd(diameter_m) ** 2
        prior = Prior(mean, cov, sizes(self.nu), WEIGHTS.copy(), known_from)
        return prior.scaled(sds) if sds else prior

    def _amplitudes(self, at: Sensed) -> tuple[Array, Array]:
        """Standard deviations of remainder and of the part at rest, (..., 2, P) each [1]."""
        growth, top = _growth(at.diameter_m, self.rest_small)[..., None, None], np.abs(at.top)
        level, hover = (
            np.array(pair)[:, None] for pair in ((self.rest_CT, self.rest_CP), (self.hover_CT, self.hover_CP))
        )
        share = np.clip(np.abs(at.f) / top, 0.05, 2.0) ** self.rest_share
        return growth * level * top * share, growth * hover * top * np.exp(-((at.J / AT_REST_J) ** 2))[..., None, :]

    def _local(self, at: Sensed) -> tuple[Array, Array]:
        """Slopes with errors of the section tables, (..., 2, 2, P), and the covariance of those, (..., 2, 2)."""
        sd = np.array([self.local_drag, self.local_camber_deg])
        cov = np.outer(sd, sd) * np.where(np.eye(2) == 1.0, 1.0, self.local_correlation)
        return at.T[..., [_DRAG, _CAMBER], :], cov * _growth(at.diameter_m, self.rest_small)[..., None, None] ** 2

    def rest_sd(self, at: Sensed) -> Array:
        """Standard deviation of the rest at points, (..., 2, P) [1]."""
        remainder, hover = self._amplitudes(at)
        T, cov = self._local(at)
        return np.asarray(np.sqrt(remainder**2 + hover**2 + np.einsum("...ckp,...kl,...clp->...cp", T, cov, T)))

    def rest(self, at: Sensed, other: Sensed | None = None) -> Array:
        """Covariance of the rest between points of a rotor, CT rows first, (..., 2 P, 2 Q) [1]."""
        b = at if other is None else other
        angle = at.alpha_deg[..., :, None] - b.alpha_deg[..., None, :]
        Re = np.log(at.Re[..., :, None] / b.Re[..., None, :])
        turned = 0.0 if other is None else (at.beta75_deg[..., :, None] - b.beta75_deg[..., None, :]) / TURNED_DEG

        def near(deg: float, ln_Re: float) -> Array:
            far = (angle / deg) ** 2 + (Re / ln_Re) ** 2 + turned**2
            return np.asarray((1.0 + far / (2.0 * self.reach)) ** -self.reach)[..., None, :, None, :]

        (A, H), (B, G), (T, cov) = self._amplitudes(at), self._amplitudes(b), self._local(at)
        S = self._local(b)[0]
        loads = np.where(np.eye(2) == 1.0, 1.0, self.rest_correlation)[:, None, :, None]
        tables = np.einsum("...ckp,...kl,...dlq->...cpdq", T, cov, S)
        out = tables * near(self.local_deg, self.local_ln_Re)
        out += loads * near(self.rest_deg, self.rest_ln_Re) * A[..., :, :, None, None] * B[..., None, None, :, :]
        out += loads * H[..., :, :, None, None] * G[..., None, None, :, :]
        P, Q = at.J.shape[-1], b.J.shape[-1]
        return np.asarray(out.reshape(*out.shape[:-4], 2 * P, 2 * Q))

    def noise_sd(self, at: Sensed) -> Array:
        """Scatter of single readings, (..., 2, P) [1]."""
        return np.asarray(0.5 * self.noise * (np.abs(at.f) + np.abs(at.top)))

    def bias(self, at: Sensed) -> Array:
        """What the solver lacks in the mean, (..., 2, P): drag of the hub (Hoerner 1965, ch. 3), lift over Re [1]."""
        hub, lift = bias_columns(at)
        return self.hub_cd * hub + self.lift_Re * lift

    def document(self) -> dict[str, Any]:
        """Plain values for the file."""
        plain = asdict(self)
        plain["latents"] = list(NAMES)
        plain["families"] = {
            name: {k: np.asarray(v).tolist() for k, v in vars(one).items()} for name, one in self.families.items()
        }
        return plain

    @staticmethod
    def of(document: Mapping[str, Any]) -> Population:
        """Population of a file."""
        plain = dict(document)
        if (names := tuple(plain.pop("latents"))) != NAMES:
            raise ValueError(f"got latent numbers {names}; expected {NAMES}")
        if (validity := plain.get("validity")) is not None:
            plain["validity"] = Validity.of(validity)
        if (ducted := plain.get("ducted")) is not None:
            plain["ducted"] = Ducted(**{**ducted, "validity": Validity.of(ducted["validity"])})
        plain["between"] = tuple(plain["between"])
        plain["families"] = {name: Family(**arrays_of(one)) for name, one in plain["families"].items()}
        return Population(**plain)


def _growth(diameter_m: float | Array, exponent: float) -> Array:
    """Factor on the standard deviations of small propellers."""
    return np.exp(exponent * np.maximum(0.0, np.log(SMALL_IN * 0.0254 / np.asarray(diameter_m))))


def bias_columns(at: Sensed) -> tuple[Array, Array]:
    """Drag of a hub of drag coefficient 1, and a change of ln(lift) of 1 at Re 100,000, (..., 2, P) each [1]."""
    small_angles = np.clip(1.0 - at.alpha_deg / LIFT_ANGLE, 0.0, 1.0)
    lift = small_angles * np.interp(np.log(at.Re), np.log(LIFT_RE), LIFT_SHAPE)
    drag = -math.pi / 8.0 * (HUB * at.J) ** 2
    return np.stack([drag, np.zeros_like(drag)], axis=-2), at.T[..., _LIFT, :] * lift[..., None, :]


@cache
def population(ducted: bool = False) -> Population:
    """The committed population: of open rotors, or what it says of ducted ones."""
    if ducted:
        return population().in_duct()
    text = resources.files("bemt.rotors").joinpath("population.json").read_text(encoding="utf-8")
    return Population.of(json.loads(text))
