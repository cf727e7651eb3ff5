"""Single rows of a recording that all its others contradict: mistyped, exchanged, or read while something happened."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.tables import number_text
from bemt.judge.compare.matched import StandRun, advance

_FAR, _FAR_SHARE = 5.0, 0.05  # robust standard deviations, and share of the largest load, from which a row is far off
# Points that tell a curve, rows beyond which they are no exception, share up to which a weighing leaves them out.
_FEWEST, _MOST, _LEFT_OUT = 6, 3, 0.1


class _Curve(NamedTuple):
    """A load beside what all rows together give, (N,)."""

    n: Array  # Speed [rev/s]
    load: Array  # [N], [N m]
    slope: float  # Of what all rows give together, over 1/n^2 [N], [N m]
    level: float  # There at high speed, over n^2 [N s^2], [N m s^2]

    def at(self, n: Array) -> Array:
        """What all rows give together at speeds [rev/s]."""
        return self.slope + self.level * n**2

    @property
    def expected(self) -> Array:
        """The same for each row."""
        return self.at(self.n)

    @property
    def off(self) -> Array:
        """How far each row is off, as a share of the largest load [1]."""
        return np.asarray((self.load - self.expected) / np.nanmax(np.abs(self.load)))

    def fits(self, i: int, at: int) -> bool:
        """Whether the load of one row is that of another one."""
        return bool(abs(self.load[i] - self.expected[at]) < _FAR_SHARE * np.nanmax(np.abs(self.load)))

    def far(self, other: _Curve) -> NDArray[np.intp]:
        """Rows that are far off, where the other recording is not far off to the same side."""
        from scipy.stats import median_abs_deviation

        off, order = self.off, np.argsort(other.n)
        good = np.isfinite(other.off[order])
        there = np.interp(self.n, other.n[order][good], other.off[order][good])
        least = max(_FAR * float(median_abs_deviation(off, scale="normal", nan_policy="omit")), _FAR_SHARE)
        return np.flatnonzero((np.abs(off) > least) & (np.abs(off - there) > least))


def _curves(run: StandRun) -> dict[str, _Curve]:
    """Thrust and torque at rest over the speed.

    A load over n^2 is nearly constant, and a zero adds a term in 1/n^2: the line through all by repeated medians
    (Siegel 1982, Biometrika 69:242; not checked) is that of most rows, up to half of them being anywhere.
    """
    from scipy.stats import siegelslopes

    points, out = run.points, dict[str, _Curve]()
    if "rpm" not in points or np.unique(advance(run, 1.0)[np.isfinite(points.rpm)]).size > 1:
        return out
    n = points.rpm / 60.0
    for name, channel in {"thrust": "thrust_N", "torque": "torque_Nm"}.items():
        good = np.isfinite(n) & (n > 0.0) & np.isfinite(points.values.get(channel, np.nan))
        if good.sum() >= _FEWEST:
            slope, level = siegelslopes(points[channel][good] / n[good] ** 2, n[good] ** -2.0)
            out[name] = _Curve(n, points[channel], float(slope), float(level))
    return out


def odd_rows(run: StandRun, other: StandRun) -> str:
    """Rows of one recording that its others and another recording contradict, in words; "" where there are none."""
    own, beside = _curves(run), _curves(other)
    found: dict[int, list[str]] = {}
    for name, curve in own.items():
        for i in curve.far(beside[name]).tolist() if name in beside else ():
            found.setdefault(i, []).append(f"{name} x{number_text(curve.load[i] / curve.expected[i], 2)}")
    if not _LEFT_OUT * len(run) < len(found) <= _MOST:
        return ""
    odd, points = sorted(found), run.points
    where = {i: f"line {points.lines[i]}" if points.lines else f"{points.rpm[i]:.0f} rev/min" for i in odd}
    each = " and ".join(f"{where[i]} ({', '.join(found[i])})" for i in odd)
    swapped = len(odd) == 2 and all(c.fits(*odd) and c.fits(*odd[::-1]) for c in own.values())
    rest = {k: np.delete(c.load / beside[k].at(c.n), odd) for k, c in own.items() if k in beside}
    left = " and ".join(f"{k} {100.0 * (np.nanmedian(v) - 1.0):+.1f} %" for k, v in rest.items())
    return f"{each}{', as if these two were exchanged' if swapped else ''}; without them {left}"
