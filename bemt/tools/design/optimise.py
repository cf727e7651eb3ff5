"""From a requirement to a blade: a start of minimum induced loss, then the real solver with its gradient (SLSQP)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.base.units import INCH
from bemt.physics.effects import Effect
from bemt.rotors.case import Case
from bemt.rotors.case.load import with_changes
from bemt.rotors.latents import NAMES, Prior, as_built
from bemt.tools.design import rotor_loads
from bemt.tools.design.minimum_loss import CONTROLS, BladeShape, MinimumLoss, minimum_loss
from bemt.tools.design.problem import BladeProblem, Values, top_lift
from bemt.tools.design.requirement import Requirement
from bemt.tools.design.rotor_loads import RotorLoads
from bemt.tools.design.search import DIAMETERS, pitches_in
from geometry.rotor import Blade, from_stations

if TYPE_CHECKING:
    from bemt.physics.bem.model import Model


Progress = Callable[[int, str], None]

ENOUGH = 1e-3
"""Share of a thrust, or of another limit, that may be missing [1]."""
_TOLERANCE = 1e-6
_STEPS = 60
_ROOM = 1.1  # Thrust over the required one at which the search for more of it ends
_BOX, _SMALLEST_BOX, _CORNERS, _PENALTY, _NEARLY = 0.4, 1e-3, 40, 10.0, 1e-4  # Of the search for the most thrust
_USUAL_TIP = 0.35  # Mach number of a first guess where the speed is free


@dataclass(frozen=True, eq=False)
class Optimum:
    """A blade found."""

    problem: BladeProblem  # What was solved
    # (V,) Variables of start and result
    start: Array
    best: Array
    # What they give
    before: Values
    after: Values
    steps: int  # Iterations
    converged: bool  # Whether the optimum was reached within the tolerance


def section_at_best(model: Model, need: Requirement) -> Callable[[Array], tuple[Array, Array, Array]]:
    """Lift coefficient, angle and drag over lift of the best lift-to-drag ratio within the stall margin, over Re."""
    polar = min(model.polars, key=lambda p: abs(p[0] - 0.7))[1]
    some = np.flatnonzero((polar.alpha >= math.radians(-4.0)) & (polar.alpha <= math.radians(16.0)))
    cl, cd = polar.cl[some, :, 0], polar.cd[some, :, 0]
    top = (1.0 - need.limits.stall_margin) * top_lift(polar)[1]
    best = np.argmax(np.where((cl > 0.1) & (cl <= top[None, :]), cl / cd, -1.0), axis=0)
    n = np.arange(cl.shape[1])
    table = cl[best, n], polar.alpha[some][best], cd[best, n] / cl[best, n]

    def at(Re: Array) -> tuple[Array, Array, Array]:
        ln = np.log(Re)
        one, two, three = (np.interp(ln, np.log(polar.Re), v) if n.size > 1 else np.full_like(ln, v[0]) for v in table)
        return one, two, three

    return at


def start_blade(model: Model, need: Requirement) -> tuple[Blade, MinimumLoss]:
    """Blade of minimum induced loss for the heaviest point; for less thrust where that cannot be reached."""
    point = max(need.points, key=lambda p: (p.weight > 0.0, p.thrust_N))
    rpm = point.rpm or first_speed(need)
    section, target = section_at_best(model, need), point.thrust_N
    air = need.air
    found = None
    while found is None:
        found = minimum_loss(target, point.airspeed_m_s, rpm, need.blades, need.R, need.Rhub, section, float(air.rho),
                             float(air.mu))  # fmt: skip
        target *= 0.7
    keep = np.r_[0, 1:199:6, 199]
    # one angle of attack for the whole blade: that of the best lift-to-drag ratio jumps where the tip's Re falls
    alpha = float(np.interp(0.7 * need.R, found.r, found.beta - found.phi))
    r, chord, beta = found.r[keep], found.chord[keep], found.phi[keep] + alpha
    chord = np.clip(chord, 0.01 * need.R, 0.4 * need.R)
    return from_stations(r, chord, np.minimum(beta, 1.4), need.R, need.Rhub, list(model.rotor.blade.anchors)), found


def first_speed(need: Requirement) -> float:
    """First guess of a free speed [rev/min]."""
    tip = min(_USUAL_TIP, 0.9 * need.limits.max_tip_mach) * float(need.air.a_sound)
    return min(60.0 * tip / (2.0 * math.pi * need.R), 0.95 * need.slow)


def problem_of(model: Model, need: Requirement, blade: Blade, rpm0: float | None = None) -> tuple[BladeProblem, Array]:
    """Problem around a blade, and the variables of that blade."""
    shape, x = BladeShape.around(blade, model.n_stations)
    guess = rpm0 or first_speed(need)
    rpm = np.array([float(p.rpm or guess) for p in need.points])
    fast = np.hypot(rpm.max() * math.pi / 30.0 * need.R, max(p.airspeed_m_s for p in need.points))
    free = any(p.rpm is None for p in need.points)
    mach = need.limits.max_tip_mach if free else float(fast / need.air.a_sound)
    limited = replace(model, mach_max=min(1.2 * mach, model.mach_max))
    problem = BladeProblem(need, limited, shape, rpm, (model.effects,), 1.0)
    low, high = problem.chord_range
    nodes = [int(np.argmin(np.abs(np.r_[shape.Rhub, shape.r, shape.R] / shape.R - n))) for n in shape.nodes]
    x[:CONTROLS] = np.clip(x[:CONTROLS], low[nodes] + 1e-3, high[nodes])
    scale = sum(
        w * p.thrust_N * (p.airspeed_m_s + math.sqrt(p.thrust_N / (2.0 * float(need.air.rho) * math.pi * need.R**2)))
        for w, p in zip(problem.weights, need.points, strict=True)
    )
    return replace(problem, scale_W=scale), np.r_[x, np.zeros(problem.size - 2 * CONTROLS)]


def turned(problem: BladeProblem, x: Array) -> Array:
    """Turn the whole blade until the hardest point has its thrust, as far as that helps."""

    def lacking(angle: float) -> float:
        moved = x.copy()
        moved[CONTROLS : 2 * CONTROLS] += angle
        v = problem.values(moved)
        return -math.inf if v is None else float((v.thrust_N / problem.asked).min()) - 1.0

    angles = np.linspace(-0.8, 0.8, 17)
    gains = np.array([lacking(a) for a in angles])
    if not np.isfinite(gains).any():
        return x
    enough = np.flatnonzero(gains >= 0.0)
    out = x.copy()
    angle = float(angles[int(np.nanargmax(gains))])
    if enough.size and enough[0] > 0:
        low, high = angles[enough[0] - 1], angles[enough[0]]
        for _ in range(12):
            mid = 0.5 * (low + high)
            low, high = (low, mid) if lacking(mid) >= 0.0 else (mid, high)
        angle = high
    out[CONTROLS : 2 * CONTROLS] += angle
    return out


def optimise(problem: BladeProblem, x0: Array, progress: Progress | None = None, steps: int = _STEPS) -> Optimum:
    """Least mean power within the limits; InputError with the nearest thrust that can be reached, if it cannot."""
    start = turned(problem, x0)
    before = problem.values(start)
    if before is None:
        fault = Fault("", "--thrust-N", "no blade to start from converges", "a point that the solver converges at")
        raise InputError(fault)
    inside, n = start, 0
    if before.margins.min() < 0.0:
        reached, inside, n = most_thrust(problem, x0, progress)
        if reached < 1.0 - ENOUGH:
            raise InputError(_unreachable(problem, inside, reached))
    best, more, done = _least_power(problem, inside, progress, steps)
    after = problem.values(best)
    if after is None or after.margins.min() < -ENOUGH:  # what was found before is within the limits
        best, after, done = inside, problem.values(inside), False
    assert after is not None
    return Optimum(problem, start, best, before, after, n + more, done)


def most_thrust(problem: BladeProblem, x0: Array, progress: Progress | None = None) -> tuple[float, Array, int]:
    """Largest share of all thrusts that can be had at once within the limits (up to `_ROOM`), its variables, and steps.

    Linear programs in a box around the last blade, with one slack for all limits (Fletcher and Sainz de la Maza 1989,
    Mathematical Programming 43): the most thrust stands in a corner of the limits.
    """
    from scipy.optimize import linprog

    P = len(problem.need.points)
    low, high = np.array(problem.bounds()).T
    x, box, n = np.clip(x0, low, high), _BOX, 0
    v = problem.values(x, derivatives=True)
    if v is None:
        return 0.0, x0, 0
    c = np.r_[np.zeros(x.size), -1.0, _PENALTY]
    while n < _CORNERS and box > _SMALLEST_BOX:
        if _share(v) >= 1.0 and v.margins[P:].min() >= -_NEARLY:
            break
        # ratio + d(ratio) dx >= t;  margin + d(margin) dx >= -slack
        ratio = v.thrust_N / problem.asked
        A = np.block(
            [
                [-v.jacobian[:P], np.ones((P, 1)), np.zeros((P, 1))],
                [-v.jacobian[P:], np.zeros((v.margins.size - P, 1)), -np.ones((v.margins.size - P, 1))],
            ]
        )
        sides = np.c_[np.maximum(low - x, -box), np.minimum(high - x, box)]
        got = linprog(c, A, np.r_[ratio, v.margins[P:]], bounds=[*sides, (-9.0, _ROOM), (0.0, None)], method="highs")
        n += 1
        if progress is not None:
            progress(n, "limits")
        new = None if got.status != 0 else problem.values(x + got.x[: x.size], derivatives=True)
        if new is not None and _merit(new, P) < _merit(v, P) - 1e-6:
            x, v, box = x + got.x[: x.size], new, min(1.5 * box, _BOX)
        else:
            box *= 0.35
    within = float(np.maximum(-v.margins[P:], 0.0).max(initial=0.0))
    return (_share(v) if within <= ENOUGH else min(_share(v), 0.0)), x, n


def _share(v: Values) -> float:
    """Least thrust over the required one."""
    return float(v.margins[: v.thrust_N.size].min()) + 1.0


def _merit(v: Values, P: int) -> float:
    """What the linear programs lessen: thrust that is missing, and the worst limit."""
    return -min(_share(v), _ROOM) + _PENALTY * max(0.0, -float(v.margins[P:].min()))


def _least_power(problem: BladeProblem, x0: Array, progress: Progress | None, steps: int) -> tuple[Array, int, bool]:
    """Run SLSQP (Kraft 1988, DFVLR-FB 88-28): variables at the end, steps, and whether it converged."""
    from scipy.optimize import minimize

    last, n = [problem.values(x0, derivatives=True)], 0

    def values(x: Array) -> Values:
        found = problem.values(x, derivatives=True)
        last[0] = found or last[0]
        assert last[0] is not None
        return last[0]

    def power(x: Array) -> tuple[float, Array]:
        v = values(x)
        lost = problem.values(x, derivatives=True) is None
        return (1e3, np.zeros(x.size)) if lost else (v.objective, v.gradient)

    def count(x: Array) -> None:
        nonlocal n
        n += 1
        if progress is not None:
            progress(n, "least power")

    found = minimize(
        power, x0, jac=True, method="SLSQP", bounds=problem.bounds(), callback=count,
        constraints=[{"type": "ineq", "fun": lambda x: values(x).margins, "jac": lambda x: values(x).jacobian}],
        options={"maxiter": steps, "ftol": _TOLERANCE},
    )  # fmt: skip
    return np.asarray(found.x), n, bool(found.success)


def _unreachable(problem: BladeProblem, x: Array, share: float) -> list[Fault]:
    """The thrust nearest to the one asked for, and what stands in the way."""
    v = problem.values(x)
    words = [] if v is None else problem.active(v)
    hint = f"Reached then: {'; '.join(words)}" if words else "A larger disk or more speed reaches more"
    faults = []
    for k, p in enumerate(problem.need.points):
        speed = "any speed" if p.rpm is None else f"{p.rpm:g} rev/min"
        nearest = max(share, 0.0) * p.thrust_N
        name = "--static-thrust-N" if p.weight == 0.0 else "--thrust-N"
        faults.append(Fault(name, "", f"{p.thrust_N:g} N {p.at}, {speed}", f"up to {nearest:.3g} N within the limits",
                            hint if k == 0 else ""))  # fmt: skip
    return faults


def as_built_variants(model: Model, prior: Prior) -> list[tuple[Effect, ...]]:
    """Effects of rotors as built that count alike: their mean and covariance are those of the population.

    Cubature points of degree three (Arasaratnam and Haykin 2009, IEEE Trans. Automatic Control 54, eq. 16-18), with the
    variance of the heavy tail.
    """
    K = len(NAMES)
    variance = float(prior.weights @ prior.sizes**2)
    root = np.linalg.cholesky(prior.cov * variance * K + 1e-12 * np.eye(K))
    return [(*model.effects, as_built(prior.mean + sign * root[:, k])) for k in range(K) for sign in (1.0, -1.0)]


def improve(found: Optimum, variants: Sequence[Sequence[Effect]], progress: Progress | None = None) -> Optimum:
    """The same for the mean of several rotors, from the blade that was found."""
    problem = replace(found.problem, variants=tuple(tuple(v) for v in variants))
    return optimise(problem, found.best, progress)


# The best propeller on sale for the same points: standard labels, each at whatever speed gives the thrust.

SMALLEST = 0.6
"""Diameters tried, over that of the design, from here to 1 [1]."""
FAN_RATIOS = (0.6, 0.8, 1.0, 1.2, 1.45, 1.7, 2.0)
FAN_CHORDS = (0.3, 0.45)


@dataclass(frozen=True, eq=False)
class Label:
    """A propeller at points: speeds [rev/min], thrusts [N] and powers [W], (P,) each, and mean power [W]."""

    name: str
    case: Case
    rpm: Array
    thrust_N: Array
    power_W: Array
    mean_W: float


def standard(need: Requirement) -> list[str]:
    """Labels on sale up to the diameter, and of the diameter itself; two blades, and as many as asked for."""
    D = 2.0 * need.R / INCH
    sizes = [float(d) for d in DIAMETERS if SMALLEST * D <= d < D * (1.0 - 1e-6)] + [round(D, 2)]
    flying = any(p.airspeed_m_s for p in need.points)
    blades = dict.fromkeys((2, min(max(need.blades, 2), 8)))
    return [f"{d:g}x{P:g}" + (f"x{B}" if B != 2 else "") for d in sizes for P in pitches_in(d, flying) for B in blades]


def rivals(need: Requirement, ducted: Case | None) -> Iterator[tuple[str, Case]]:
    """Names and cases of what is on sale; in a duct, blades of constant pitch and the chord of fans."""
    if ducted is None:
        yield from ((label, rotor_loads.case_of_label(label)) for label in standard(need))
        return
    section = ducted.written["blade"].get("section")
    for chord in FAN_CHORDS:
        for ratio in FAN_RATIOS:
            blade = {"chord_law": "fan", "max_chord_over_R": chord, "pitch_ratio": ratio, "section": section}
            name = f"fan blade, pitch {ratio:g} D, chord {chord:g} R"
            yield name, with_changes(ducted, {"blade": blade, "assumptions": [], "polars": []})


def best_labels(need: Requirement, ducted: Case | None = None) -> tuple[Label | None, Label | None]:
    """Those with the least mean power that meet every point: at the speed that suits each, and at the speeds asked for.

    The second has at least the thrust at those speeds; None if no speed is asked for, or none has the thrust.
    """
    own, same = [], []
    for name, case in rivals(need, ducted):
        loads = _loads(name, case, need)
        own += [one for one in (_at_points(name, case, need, loads, fixed=False),) if one is not None]
        if all(p.rpm is not None for p in need.points if p.weight > 0.0):
            same += [one for one in (_at_points(name, case, need, loads, fixed=True),) if one is not None]
    return min(own, key=lambda one: one.mean_W, default=None), min(same, key=lambda one: one.mean_W, default=None)


def _loads(name: str, case: Case, need: Requirement) -> dict[float, RotorLoads | None]:
    """Thrust and torque over speed, up to the tip Mach number, by airspeed."""
    fast = {p.airspeed_m_s: 60.0 * tip / (math.pi * case.diameter_m) for p in need.points
            if (tip := _tip_speed(need, p.airspeed_m_s)) > 0.0}  # fmt: skip
    return {V: rotor_loads.loads_of_case(name, case, rpm, V, need.air) for V, rpm in fast.items()}


def _at_points(
    name: str, case: Case, need: Requirement, loads: dict[float, RotorLoads | None], fixed: bool
) -> Label | None:
    rows = []
    for p in need.points:
        one = loads.get(p.airspeed_m_s)
        if one is None:
            return None
        n = p.rpm if fixed and p.rpm is not None else float(one.speed_for(np.array([p.thrust_N]))[0])
        T = float(np.interp(n, one.rpm, one.thrust_N, right=math.nan))
        P = float(one.torque_at(np.array([n]))[0]) * n * math.pi / 30.0
        if not (math.isfinite(n + P) and T >= (1.0 - 1e-3) * p.thrust_N and P > 0.0):
            return None
        rows.append((n, T, P))
    rpm, thrust, power = np.array(rows).T
    weight = np.array([p.weight for p in need.points])
    return Label(name, case, rpm, thrust, power, float(weight @ power / weight.sum()))


def _tip_speed(need: Requirement, airspeed_m_s: float) -> float:
    """Speed of the tip in the disk at the limit of the tip Mach number [m/s]."""
    return math.sqrt(max((need.limits.max_tip_mach * float(need.air.a_sound)) ** 2 - airspeed_m_s**2, 0.0))
