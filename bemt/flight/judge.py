"""What is wrong with a flight, beside healthy ones: a rigid body that flies steadily balances its loads.

A rotor that lost thrust at equal drive is driven harder until the loads balance again; of all commands that the mixer
can give these are P e_k, P = A+ A, A the matrix of the layout (for a quadrotor e_k itself: one rotor, and so roll,
pitch, yaw and total at once). A weight under an arm needs roll, pitch and total but no yaw:
A+ diag(1, 1, 0, 1) A e_k. The readings are logs of each rotor's share of the drive; the scatter is that between healthy
flights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bemt.flight.layout import effect_matrix
from bemt.flight.log import FlightLog

__all__ = ["FlightEvidence", "FlightVerdict", "features", "judge"]

Array = NDArray[np.float64]

FALSE_ALARM = 0.01
"""Usual probability that a healthy flight is accused, over all hypotheses together (Bonferroni)."""
ALIKE = 2.0 * np.log(20.0)
"""Explanations whose chi squares differ by less cannot be told apart: odds of 20 to 1."""
_LEAST = 3  # healthy flights from which the scatter is estimated


@dataclass(frozen=True, eq=False)
class FlightEvidence:
    """One explanation: its direction in the shares, its size and misfit."""

    cause: str
    size: float  # change of that rotor's drive [1]
    half: float  # half width of its 95 % interval [1]
    t: float  # size over its standard deviation [1]
    chi2: float  # misfit that remains [1]


@dataclass(frozen=True, eq=False)
class FlightVerdict:
    """Verdict in the words of the diagnosis: none, named, class, unknown or insufficient.

    Attributes
    ----------
    verdict : str
        As above.
    effects : tuple of str
        Causes; of a class all members.
    why : str
        The rule that answered.
    explanations : tuple of FlightEvidence
        All, best first.
    readings : (B,) float
        Change of the log of each rotor's share of the drive [1].
    scatter : float
        Standard deviation of a share between healthy flights [1].
    visible : float
        Smallest change of one rotor's drive that would be named here [1].
    accused, healthy : int
        Healthy flights accused when each is judged by the others, of how many.
    rate95 : (float, float)
        95 % interval of that rate (Clopper and Pearson) [1].
    total : float
        Change of the total drive against the healthy mean [1].
    total_half : float
        Its 95 % half width from the healthy scatter [1].
    """

    verdict: str
    effects: tuple[str, ...]
    why: str
    explanations: tuple[FlightEvidence, ...]
    readings: Array
    scatter: float = float("nan")
    visible: float = float("nan")
    accused: int = 0
    healthy: int = 0
    rate95: tuple[float, float] = (0.0, 1.0)
    total: float = float("nan")
    total_half: float = float("nan")


def features(log: FlightLog) -> Array | None:
    """Log of the mean drive of each rotor in flight.

    Parameters
    ----------
    log : FlightLog
        The flight.

    Returns
    -------
    (B,) float or None
        Of commands (the same in every log), or of squared speeds where there is no command; None without a flight [1].
    """
    on = log.flying
    if on.sum() < 50:
        return None
    drive = log.command if log.command is not None else None if log.rpm is None else log.rpm**2
    if drive is None:
        return None
    mean = drive[on].mean(axis=0)
    return np.log(mean) if np.all(mean > 0.0) else None


def judge(
    flight: Array, healthy: Sequence[Array], layout: Array | None, false_alarm: float = FALSE_ALARM
) -> FlightVerdict:
    """Judge a flight by healthy ones.

    Parameters
    ----------
    flight : (B,) float
        Features of the flight [1].
    healthy : sequence of (B,) float
        Features of healthy flights of the same vehicle [1].
    layout : (B, 2) float or None
        Angles [rad] and turning [1]; None: no weights are tried, and every rotor stands for itself.
    false_alarm : float
        Accepted probability that a healthy flight is accused [1].

    Returns
    -------
    FlightVerdict
        With the error rate of the same rule on the healthy flights.
    """
    from scipy import stats

    said = _decide(flight, np.array(healthy), layout, false_alarm)
    if len(healthy) < _LEAST:
        return said
    rest = [_decide(h, np.delete(np.array(healthy), k, axis=0), layout, false_alarm) for k, h in enumerate(healthy)]
    tried = [r for r in rest if r.verdict != "insufficient"]
    if not tried:
        return said
    accused = sum(r.verdict != "none" for r in tried)
    interval = stats.binomtest(accused, len(tried)).proportion_ci(method="exact")
    return replace(said, accused=accused, healthy=len(tried), rate95=(float(interval.low), float(interval.high)))


def _decide(flight: Array, healthy: Array, layout: Array | None, alarm: float) -> FlightVerdict:
    from scipy import stats

    B, n = flight.size, len(healthy)
    if n == 0:
        share = flight - flight.mean()
        return FlightVerdict("insufficient", (), "no healthy flight to compare with: give --healthy", (), share)
    middle = healthy.mean(axis=0)
    change = flight - middle
    total = float(change.mean())
    change = change - total
    if n < _LEAST:
        why = f"{n} healthy flights do not show how much flights differ: give {_LEAST} or more"
        return FlightVerdict("insufficient", (), why, (), change, total=total)
    shares = healthy - healthy.mean(axis=1, keepdims=True)
    free = (n - 1) * (B - 1)
    spread = shares - shares.mean(axis=0)
    scatter = float(np.sqrt(np.sum(spread**2) / free))
    W, free = _whitening(spread, layout)
    W /= np.sqrt(1.0 + 1.0 / n)
    ways = _directions(B, layout)
    z, found = W @ change, []
    for cause, way in ways.items():
        d = W @ way
        size = float(d @ z / (d @ d))
        width = 1.0 / float(np.linalg.norm(d))
        chi2 = float(np.sum((z - size * d) ** 2))
        found.append(FlightEvidence(cause, size, float(stats.t.ppf(0.975, free)) * width, size / width, chi2))
    found.sort(key=lambda e: (e.t <= 0.0, e.chi2))
    bar = float(stats.t.ppf(1.0 - alarm / len(ways), free))
    totals = healthy.mean(axis=1)
    total_half = float(stats.t.ppf(0.975, n - 1) * totals.std(ddof=1) * np.sqrt(1.0 + 1.0 / n))
    visible = bar * max(1.0 / float(np.linalg.norm(W @ d)) for cause, d in ways.items() if "blade" in cause)
    said = FlightVerdict("none", (), "", tuple(found), change, scatter, visible, total=total, total_half=total_half)
    gate = float(stats.f.ppf(1.0 - alarm, z.size, free))
    off = float(z @ z) / z.size
    rest = z.size - 1
    most = rest * float(stats.f.ppf(1.0 - alarm, max(rest, 1), free))
    best = found[0]
    if best.t < bar:
        if off > gate and best.chi2 > most:
            return replace(
                said, verdict="unknown", why="the balance moved, but not as one rotor or one weight moves it"
            )
        return replace(said, why="no more than healthy flights differ")
    if rest > 0 and best.chi2 > most and best.chi2 > 0.25 * best.t**2:
        return replace(said, verdict="unknown", why="no listed cause leaves a rest as small as healthy flights have")
    alike = tuple(e.cause for e in found if e.t > 0.0 and e.chi2 - best.chi2 < ALIKE)
    if len(alike) == 1:
        return replace(said, verdict="named", effects=alike, why="one cause explains the balance, the others do not")
    return replace(said, verdict="class", effects=alike, why="these explain the balance equally well")


def _whitening(spread: Array, layout: Array | None) -> tuple[Array, int]:
    """Whitening of the shares, (k, B), and its degrees of freedom.

    Where the layout is known the axes are those of the body: a battery put in elsewhere moves roll and pitch, not yaw.
    The variance of each axis is shrunk to the common one with the weight of as many flights as there are axes.
    """
    n, B = spread.shape
    inner = np.eye(B) - 1.0 / B
    if layout is None:
        axes = np.linalg.svd(inner)[2][: B - 1]
    else:
        q, r = np.linalg.qr((effect_matrix(layout)[:3] @ inner).T)
        axes = q[:, np.abs(np.diag(r)) > 1e-9].T
    k = len(axes)
    own = np.sum((spread @ axes.T) ** 2, axis=0)
    common = max(float(own.sum()) / ((n - 1) * k), 1e-12)
    if layout is None:
        return axes / np.sqrt(common), (n - 1) * k
    variance = (own + k * common) / (n - 1 + k)
    return axes / np.sqrt(variance)[:, None], n - 1 + k


def _directions(B: int, layout: Array | None) -> dict[str, Array]:
    """Change of the log shares of each cause, for unit change of that rotor's drive."""
    eye = np.eye(B)
    P, Q = eye, None
    if layout is not None:
        A = effect_matrix(layout)
        back = np.linalg.pinv(A)
        P, Q = back @ A, back @ np.diag([1.0, 1.0, 0.0, 1.0]) @ A
    out = {f"damaged blade, motor {k + 1}": P[:, k] for k in range(B)}
    if Q is not None:
        out |= {f"weight near motor {k + 1}": Q[:, k] for k in range(B)}
    return {cause: d - d.mean() for cause, d in out.items()}
