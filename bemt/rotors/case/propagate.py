"""A case at operating points, with bands: the one place that propagates declared unknowns and the model's own error.

Three origins, added as squares (ASME V&V 20). *input*: one declared unknown at a time moves through its range, taken
as uniform; with the results at both ends and in the middle on a parabola, the variance is s^2/3 + 4 q^2/45 (half
difference s, sagitta q), which is (high - low)/sqrt(12) times the slope where the response is straight. *model*: how
far measured rotors of such a description are from the solver (`bemt.rotors`), wider where none was measured
(`bemt.rotors.validity`). *numerics*: change of the result when the blade elements are doubled.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.physics import coefficients as co
from bemt.physics.air import air_arrays
from bemt.physics.bem.coaxial import LOADS, RATIOS, PairModel
from bemt.rotors.conditioning import CAMPAIGN, SESSION, STAND, gains_at
from bemt.rotors.model import RealRotor, coefficients
from bemt.rotors.population import population
from bemt.rotors.predict import LEVELS, zero_thrust
from bemt.rotors.validity import Validity, aside, swept_words

if TYPE_CHECKING:
    from bemt.physics.air import Air
    from bemt.physics.bem.duct import DuctFlow
    from bemt.physics.bem.model import Flags, Model
    from bemt.physics.bem.oblique_near import Near
    from bemt.physics.dataset import Dataset
    from bemt.rotors.case.load import Assumption, Case

Answers = Mapping[str, Array]
Solved = tuple[Answers, "Flags"]
Progress = Callable[[int, int, str], None]

BANDED = ("thrust_N", "torque_Nm", "power_W", "CT", "CP", "eta", "exhaust_speed_m_s", "duct_share")
"""Channels that get a band; of a coaxial pair also its `LOADS` and `RATIOS`."""

_THRUSTS = ("thrust_N", "CT", "upper_thrust_N", "lower_thrust_N", *RATIOS)
_TORQUES = ("torque_Nm", "power_W", "CP", "upper_torque_Nm", "lower_torque_Nm", "reaction_torque_Nm")
_CAMPAIGNS = {"measured": 1.0, "reference": 2.0}  # differences between campaigns that a band holds, as variances
_UNMEASURED = "oblique flow: the band adds to that of axial flow a share of what the side wind changes, by analogy"


@dataclass(frozen=True, eq=False)
class Points:
    """Operating points of a case, (P,) each; what they share with it follows when it is changed."""

    case: Case
    rpm: Array  # [rev/min]
    airspeed_m_s: Array  # [m/s]
    density_kg_m3: Array  # [kg/m3]
    angle_deg: Array  # Between wind and shaft [deg]

    @staticmethod
    def of(
        case: Case, rpm: ArrayLike | None = None, airspeed_m_s: ArrayLike | None = None,
        density_kg_m3: ArrayLike | None = None, angle_deg: ArrayLike | None = None,
    ) -> Points:  # fmt: skip
        """Points that broadcast together; what is not given is the case's own."""
        own = (case.rpm, case.airspeed_m_s, case.air().rho, case.angle_deg)
        given = (own[i] if v is None else v for i, v in enumerate((rpm, airspeed_m_s, density_kg_m3, angle_deg)))
        n, V, rho, angle = np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, dtype=float)) for v in given))
        return Points(case, n.ravel(), V.ravel(), rho.ravel(), angle.ravel())

    def solve(self, model: Model | PairModel, changed: Case, threads: int, near: Near | None = None) -> Solved:
        """Channels and flags of a changed case, near the ones solved before unless the wind turns."""
        rpm, V, air = self.conditions(changed)
        turned = changed.angle_deg != self.case.angle_deg
        return channels_at(model, rpm, V, self.angles(changed), air, threads, None if turned else near)

    def angles(self, changed: Case) -> Array:
        """Angle between wind and shaft at the points in a changed case [deg]."""
        return np.where(self.angle_deg == self.case.angle_deg, changed.angle_deg, self.angle_deg)

    def conditions(self, changed: Case) -> tuple[Array, Array, Air]:
        """Speed, airspeed and air at the points in a changed case."""
        own, air = self.case.air().rho, changed.air()
        rpm = np.where(self.rpm == self.case.rpm, changed.rpm, self.rpm)
        V = np.where(self.airspeed_m_s == self.case.airspeed_m_s, changed.airspeed_m_s, self.airspeed_m_s)
        if np.all(self.density_kg_m3 == own):
            return rpm, V, air
        states, which = np.unique(self.density_kg_m3, return_inverse=True)
        airs = [air if rho == own else changed.air({"air.density_kg_m3": float(rho)}) for rho in states]
        return rpm, V, air_arrays(airs, which.reshape(-1))


def channels_at(
    model: Model | PairModel, rpm: Array, airspeed_m_s: Array, angle_deg: Array, air: Air, threads: int = 1,
    near: Near | None = None,
) -> Solved:  # fmt: skip
    """Channels and flags of points (P,) with their angle between wind and shaft [deg]."""
    if not np.any(angle_deg):
        return model.channels(rpm, airspeed_m_s, air, threads)
    from bemt.rotors.case.oblique import turned

    return turned(model, rpm, airspeed_m_s, angle_deg, air, threads, near)


@dataclass(frozen=True, eq=False)
class Moved:
    """Answers at the values of one declared unknown."""

    unknown: Assumption
    runs: tuple[Answers, ...]  # One for each of `unknown.values`
    u: Answers  # Standard uncertainty of each answer from this unknown alone


@dataclass(frozen=True, eq=False)
class Propagated:
    """A case solved at points, with what the bands were made of."""

    points: Dataset  # Values, bands by origin ("input", "model", "numerics"), flags
    nominal: Answers  # The banded channels of the points
    moved: tuple[Moved, ...]
    refined: Answers | None  # With twice the blade elements
    model: Model | PairModel  # The rotor of the case, prepared, or both of a pair
    model95: Answers  # 95 % half widths from the model's own error
    # Variance of a reading on a stand beyond that of the rotor itself; negative where the stand is the one that
    # calibrated it
    stand: Answers = field(default_factory=dict)

    def half_width95(self, channel: str) -> Array:
        """Half width of the 95 % interval, (P,): twice the u of inputs and numerics, the model's with its tail."""
        parts = self.points.u_by
        rest = sum((parts[origin][channel] ** 2 for origin in ("input", "numerics") if origin in parts), 0.0)
        return np.asarray(np.sqrt(4.0 * rest + self.model95[channel] ** 2))

    def u_reading(self, channel: str) -> Array:
        """Standard uncertainty of what a stand shows, (P,); the bands of the points are those of the rotor itself.

        A stand that nobody calibrated has `bemt.rotors.conditioning.STAND` besides, a rotor that others measured their
        campaign; a rotor that its own run calibrated is met again on that stand.
        """
        return self._on_stand(channel, self.points.u[channel], 1.0)

    def reading95(self, channel: str) -> Array:
        """Half width of the 95 % interval of what a stand shows, (P,)."""
        return self._on_stand(channel, self.half_width95(channel), 2.0)

    def _on_stand(self, channel: str, half: Array, times: float) -> Array:
        """A band with what the stand adds or takes; never narrower than a session repeats itself."""
        least = (times * SESSION * self.points[channel]) ** 2
        return np.asarray(np.sqrt(np.maximum(half**2 + times**2 * self.stand.get(channel, 0.0), least)))

    def carry(self, answer: Callable[[Answers], Answers]) -> tuple[dict[str, Array], dict[str, dict[str, Array]]]:
        """Carry the bands through any function of the channels at all points: its values, and their u by origin.

        The model's own error moves thrust at all points together, then torque and power; both count as independent.
        """
        nominal = dict(self.nominal)
        values = {key: np.asarray(v, dtype=float) for key, v in answer(nominal).items()}
        squares = {origin: {key: np.zeros_like(v) for key, v in values.items()} for origin in self.points.u_by}
        for one in self.moved:
            runs = [values if run is self.nominal else answer(run) for run in one.runs]
            for key, v in values.items():
                squares["input"][key] += spread(one.unknown, v, [np.asarray(run[key]) for run in runs]) ** 2
        if "numerics" in squares and self.refined is not None:
            other = answer(self.refined)
            for key, v in values.items():
                squares["numerics"][key] += (np.asarray(other[key]) - v) ** 2
        for together in (_THRUSTS, _TORQUES) if "model" in squares else ():
            u = self.points.u_by["model"]
            ends = [answer(nominal | {k: nominal[k] + sign * u[k] for k in together if k in nominal})
                    for sign in (-1.0, 1.0)]  # fmt: skip
            for key in values:
                squares["model"][key] += (0.5 * (np.asarray(ends[1][key]) - np.asarray(ends[0][key]))) ** 2
        return values, {origin: {k: np.sqrt(v) for k, v in part.items()} for origin, part in squares.items()}


def spread(unknown: Assumption, nominal: Array, at: Sequence[Array]) -> Array:
    """Standard uncertainty from one unknown, (P,), of the results at its values.

    What is taken may be one end of the range: then the whole of the range lies on one side of the result, and the root
    mean square about it counts.

    >>> from bemt.rotors.case.load import Assumption
    >>> ends = [np.array([0.0]), np.array([2.0])]
    >>> [spread(Assumption("x", x, (0.0, 2.0), False, ""), np.array([x]), ends).round(3).item() for x in (1.0, 0.0)]
    [0.577, 1.155]
    """
    if unknown.discrete:
        return np.asarray(np.sqrt(np.mean(np.subtract(at, nominal) ** 2, axis=0)))
    low, high = at
    if unknown.nominal in unknown.values:
        return np.asarray(np.abs(high - low) / np.sqrt(3.0))
    slope, sag = 0.5 * (high - low), 0.5 * (high + low) - nominal
    return np.asarray(np.sqrt(slope**2 / 3.0 + 4.0 * sag**2 / 45.0))


def vary(
    case: Case, nominal: Answers, answer: Callable[[Case, str], Answers], unknowns: Sequence[Assumption] | None = None
) -> tuple[Moved, ...]:
    """Move one declared unknown at a time; the case's own unless others are given."""
    out = []
    for unknown in case.assumptions if unknowns is None else unknowns:
        runs = tuple(
            nominal if v == unknown.nominal else answer(case.replaced({unknown.key: v}), unknown.key)
            for v in unknown.values
        )
        u = {key: spread(unknown, v, [run[key] for run in runs]) for key, v in nominal.items()}
        out.append(Moved(unknown, runs, u))
    return tuple(out)


def prepared(case: Case, stations: int | None = None, second: Case | None = None) -> Model | PairModel:
    """Model of a case: of its rotor, or of both of a coaxial pair; ``second`` replaces the case of the second one."""
    from bemt.rotors.case.prepare import prepare_case, prepare_pair

    return prepare_pair(case, stations, second) if case.paired else prepare_case(case, None, stations, oblique=True)


def _unknowns_of_second(case: Case) -> tuple[Assumption, ...]:
    """What is not known of the blades of a second rotor that has a case of its own."""
    told = case.file.second_rotor
    if told is None or (told.label is None and told.case is None):
        return ()
    shared = ("air.", "operating.", "drive.")
    return tuple(item for item in case.second().assumptions if not item.key.startswith(shared))


def _flagged(flags: Iterable[tuple[str, ...]], where: Iterable[bool], word: str) -> tuple[tuple[str, ...], ...]:
    """Flags of each point, with one more where it holds."""
    return tuple((*f, word) if holds else f for f, holds in zip(flags, where, strict=True))


def _that_move_loads(case: Case) -> tuple[Assumption, ...]:
    """Unknowns of a case and its duct but for the motor's, which move no load at a given speed."""
    from bemt.rotors.case.prepare import duct_unknowns

    return (*(item for item in case.assumptions if not item.key.startswith("drive.")), *duct_unknowns(case))


def propagate(
    case: Case, rpm: ArrayLike | None = None, airspeed_m_s: ArrayLike | None = None,
    density_kg_m3: ArrayLike | None = None, *, angle_deg: ArrayLike | None = None,
    unknowns: Sequence[Assumption] | None = None, bands: bool = True, threads: int = 1,
    progress: Progress | None = None,
) -> Propagated:  # fmt: skip
    """Solve a case at points [rev/min], [m/s], [kg/m3], by default its own, with bands and flags.

    ``angle_deg`` is that between wind and shaft, 0 to 180; ducted rotors know 0 only. In oblique flow the model's own
    error and that of its numerics are those of axial flow at the speed along the shaft, with a share of what the side
    wind changes (:func:`bemt.rotors.validity.aside`); the point is flagged.
    Whatever a point shares with the case - speed, airspeed, angle, air - follows an unknown that is that quantity.
    ``bands`` False leaves the uncertainties unknown; the flags stay.
    """
    points = Points.of(case, rpm, airspeed_m_s, density_kg_m3, angle_deg)
    if case.paired and np.any(points.angle_deg != 0.0):
        got, expected = f"{np.max(points.angle_deg):g} deg on a coaxial pair", "0 deg: it is solved in axial flow only"
        raise InputError(Fault(case.path.as_posix(), "angle_deg", got, expected))
    declared = _that_move_loads(case) if unknowns is None else tuple(unknowns)
    of_second = _unknowns_of_second(case) if unknowns is None else ()
    skewed = (points.angle_deg != 0.0) & (points.airspeed_m_s != 0.0)
    near: Near | None = None
    if bands and np.any(skewed):
        from bemt.physics.bem import oblique_near

        near = oblique_near.Near()
    steps, done = 2 + sum(len(item.values) for item in (*declared, *of_second)), 0

    def solved(changed: Case, what: str, second: Case | None = None) -> tuple[Model | PairModel, Solved]:
        nonlocal done
        model = prepared(changed, None, second).at_speeds(*points.conditions(changed))
        found = points.solve(model, changed, threads, near)
        done += 1
        if progress is not None:
            progress(done, steps, what)
        return model, found

    def channels(found: Answers | Dataset) -> dict[str, Array]:
        keys = (*BANDED, *LOADS, *RATIOS) if case.paired else BANDED
        return {key: np.asarray(found[key], dtype=float) for key in keys}

    def along(model: Model | PairModel) -> Dataset:
        """Axial flow at the speed along the shaft."""
        rpm, V, air = points.conditions(case)
        if np.any(skewed):
            from bemt.rotors.case.oblique import parted

            V = parted(V, points.angle_deg)[0]
        return model.solve(rpm, V, air, threads)

    model, own = solved(case, "nominal")
    found = model.dataset(*own)
    beside = along(model) if np.any(skewed) else found
    if isinstance(model, PairModel):
        from bemt.rotors.case.pair_error import PairError

        error = PairError.of(case, model, found, points.conditions(case)[2])
        words = error.words
    else:
        factor, words = validity_of(case, beside.J, beside.Re75, beside.M_tip)
    flags = _flagged(((*a, *b) for a, b in zip(found.flags, words, strict=True)), skewed, _UNMEASURED)
    nominal = channels(found)
    if not bands:
        nothing = {key: np.full(len(found), np.nan) for key in nominal}
        return Propagated(replace(found, flags=flags), nominal, (), None, model, nothing)
    finer = channels(along(prepared(case, 2 * case.file.model.stations).at_speeds(*points.conditions(case))))
    refined = {key: nominal[key] + (finer[key] - v) for key, v in channels(beside).items()}
    moved = vary(case, nominal, lambda changed, what: channels(solved(changed, what)[1][0]), declared)
    if of_second:
        moved += vary(case.second(), nominal, lambda changed, what: channels(solved(case, what, changed)[1][0]),
                      of_second)  # fmt: skip
    if isinstance(model, PairModel):
        narrow, wide = error.widths()
    else:
        narrow, wide = _widths(case, model, found, beside, points.conditions(case)[2], factor)
    given = {key: np.sqrt(sum((one.u[key] ** 2 for one in moved), np.zeros(len(found)))) for key in nominal}
    parts = {"input": given, "model": narrow, "numerics": {key: np.abs(refined[key] - v) for key, v in nominal.items()}}
    answer = replace(found, u={}, u_by=parts)
    stand = _of_stand(case, found, model.upper.diameter_m if isinstance(model, PairModel) else model.diameter_m)
    lost = found.converged & np.isnan(answer.u["thrust_N"])
    flags = _flagged(flags, lost, "unconverged somewhere in the range of the assumptions: u unknown")
    return Propagated(replace(answer, flags=flags), nominal, moved, refined, model, wide, stand)


def _widths(
    case: Case, model: Model, found: Dataset, beside: Dataset, air: Air, factor: Array
) -> tuple[dict[str, Array], dict[str, Array]]:
    """The model's own error of loads at 68 and 95 %."""
    widths, more = model_error(case, model, beside, air), _aside(case, model, found, beside)
    narrow, wide = (
        loads_of(found, model.diameter_m, np.hypot(factor * u, times * more), beside.J)
        for u, times in zip(widths, (1.0, 2.0), strict=True)
    )
    if model.duct is not None:
        narrow, wide = (
            one | {"duct_share": share_error(model.duct, found, one["thrust_N"], air, k)}
            for k, one in zip(SHARE_TIMES, (narrow, wide), strict=True)
        )
    return narrow, wide


def model_error(case: Case, model: Model, points: Dataset, air: Air) -> tuple[Array, Array]:
    """Half widths of the 68 and 95 % intervals of CT and CP about the nominal result, (2, P) each.

    What the population expects beside the nominal result counts too, as a root sum of squares. The band is that of the
    rotor as another careful campaign finds it: of a rotor that its own run calibrated, both campaigns count; a
    measured one has the first in its law already, others are spread over campaigns.
    """
    known = case.as_built()
    rotor = RealRotor.of(model, air, known.prior, known.drawn, known.reference)
    solved = np.array([points.CT, points.CP])
    at = rotor.at(points.rpm, points.J, points.Re75, solved if model.learned is None else None)
    mean = at.f
    if not np.array_equal(known.prior.mean, known.drawn):
        mean = rotor.solve(known.prior.mean, points.rpm, points.J, np.arange(points.rpm.size))
    found = rotor.predict(at, mean)
    off = found.mean - solved
    elsewhere = _CAMPAIGNS.get(known.prior.known_from, 0.0)
    narrow, wide = (found.half_width(level, campaigns=elsewhere) for level in LEVELS)
    return np.hypot(narrow, off), np.hypot(wide, 2.0 * off)


def _of_stand(case: Case, points: Dataset, D: float) -> dict[str, Array]:
    """Variance of all channels that a reading on a stand has beyond the rotor's own, (P,) each."""
    loads = np.abs(np.array([points.CT, points.CP]))
    if case.as_built().prior.known_from != "reference":
        return {key: v**2 for key, v in loads_of(points, D, loads * STAND[:, None]).items()}
    session = loads_of(points, D, loads * SESSION)  # met again on its own stand
    campaigns = loads_of(points, D, loads * gains_at(math.sqrt(_CAMPAIGNS["reference"]) * CAMPAIGN, points.J))
    return {key: session[key] ** 2 - campaigns[key] ** 2 for key in session}


def _aside(case: Case, model: Model, found: Dataset, axial: Dataset) -> Array:
    """Standard deviation that wind from the side and descent add, (2, P) of CT and CP."""
    loads, along = np.array([found.CT, found.CP]), np.array([axial.CT, axial.CP])
    if case.ducted:
        return np.zeros_like(loads)
    area = np.pi * model.rotor.R**2
    hover = np.sqrt(np.abs(found.thrust_N) / (2.0 * found.density_kg_m3 * area))
    sink = np.divide(-axial.airspeed_m_s, hover, out=np.zeros_like(hover), where=hover > 0.0)
    return aside(loads, along, sink)


def _zero_thrust_J(case: Case) -> float:
    """Advance ratio at which thrust vanishes at the case's own speed and air, found once."""

    def find() -> float:
        from bemt.rotors.case.prepare import prepare_case

        return zero_thrust(
            coefficients(prepare_case(case, oblique=True, alone=True), case.air()), case.as_built().drawn, case.rpm
        )

    return case.kept("J of zero thrust", find)


def validity_of(case: Case, J: Array, Re75: Array, M_tip: Array) -> tuple[Array, tuple[tuple[str, ...], ...]]:
    """Factor on the model's own error at points, (P,), and for each why it is wider or where the method ends."""
    known, factor = population(case.ducted).validity, np.ones(J.size)
    words: tuple[tuple[str, ...], ...] = ((),) * J.size
    if known is not None:
        size = (case.diameter_m, int(case.file.rotor.blades), case.rotor().blade.pitch_m() / case.diameter_m)
        run = case.as_built().reference
        if run is not None:  # a rotor that was measured itself
            own = Validity.of_rotor(*size, run.at.J / _zero_thrust_J(case), run.at.Re, known.M_tip)
            known = Validity.of_rotors((known, own))
        factor, words = known.at(*size, J / _zero_thrust_J(case), Re75, M_tip)
    tip = ((f"supersonic tip: Mach {m:.2f}, beyond section theory",) if m >= 1.0 else () for m in M_tip)
    whole = (*swept_words(case.rotor().blade), *filter(None, [case.as_built().doubt]))
    return factor, tuple((*a, *b, *whole) for a, b in zip(words, tip, strict=True))


SHARE = 0.04
"""Standard deviation of the duct's share at one thrust [1]: root mean square at rest of two ducts that the balance was
not set on, nozzle 19A at five pitches (off by 2.2 points, rms) and the DS-30 without vanes in our own CFD (5.3)."""
SHARE_TIMES = (1.32, 4.3)
"""So many of it are 68 and 95 %: Student's t of two ducts [1]."""


def share_error(duct: DuctFlow, points: Dataset, u_thrust: Array, air: Air, times: float = 1.0) -> Array:
    """Uncertainty of the duct's share, (P,): so many deviations of the balance, and what that of the thrust moves."""
    T, more = points.thrust_N / points.density_kg_m3, np.log1p(u_thrust / np.abs(points.thrust_N))
    V, nu = points.airspeed_m_s, np.asarray(air.mu) / np.asarray(air.rho)
    at = np.array([duct.share_at(T * np.exp(k * more), V, nu) for k in (-1.0, 0.0, 1.0)])
    moved = np.fmax(np.abs(at[0] - at[1]), np.abs(at[2] - at[1]))
    return np.where(np.isnan(moved), np.abs(points.duct_share), np.hypot(times * SHARE, moved))


def loads_of(points: Dataset, D: float, u: Array, J_axial: Array | None = None) -> dict[str, Array]:
    """Standard uncertainties of all channels from those of CT and CP, (2, P).

    Exhaust speed follows thrust by momentum, T = m V_e - m V, so that dV_e/V_e = (V_e - V)/(2 V_e - V) dT/T. The duct's
    share: `share_error`. Efficiency takes CT and CP as independent.
    """
    rho, n, V, exit_speed = points.density_kg_m3, points.rpm / 60.0, points.airspeed_m_s, points.exhaust_speed_m_s
    thrust = np.asarray(co.thrust(u[0], rho, n, D))
    power = np.asarray(co.power(u[1], rho, n, D))
    with np.errstate(divide="ignore", invalid="ignore"):
        torque = power / (2.0 * np.pi * n)
        exhaust = np.abs((exit_speed - V) / (2.0 * exit_speed - V) * exit_speed * thrust / points.thrust_N)
        eta = np.hypot((points.J if J_axial is None else J_axial) * u[0], points.eta * u[1]) / np.abs(points.CP)
    return {
        "thrust_N": thrust, "torque_Nm": torque, "power_W": power, "CT": u[0], "CP": u[1],
        "eta": np.where(np.isfinite(eta), eta, np.nan), "duct_share": np.zeros_like(V),
        "exhaust_speed_m_s": np.where(np.isfinite(exhaust), exhaust, np.nan),
    }  # fmt: skip
