"""Every effect solved over its physical ranges: what each would change in these readings.

Parameters are solved at a few values and interpolated between them, so that evidence becomes linear algebra over a
fixed set of vectors, for the recording and for hundreds of bootstrapped nulls alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bemt.base.arrays import Array
from bemt.base.units import RPM, UNITS
from bemt.physics import effects
from bemt.physics.effects.unit_slip import UnitSlip

if TYPE_CHECKING:
    from bemt.judge.diagnose.problem import Problem
    from bemt.physics.effects import Effect, Parameter

# Setting, its signature, whether it was solved, its prior weight.
Setting = Mapping[str, Any]
"""Parameters of an effect by name: numbers, or the words that some choose from."""
_Column = tuple[Setting, Array, bool, float]

_FINE = {1: 41, 2: 15, 3: 7}
_ROUNDING = 1e-9  # Over the noise of a reading. [1]


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect over its ranges."""

    id: str  # Effect
    settings: tuple[Setting, ...]  # G settings of its parameters
    signatures: Array  # (M, G) Change of the readings for each [units of the readings]
    weight: Array  # (G,) Prior probability of each setting, times the odds that files tell besides the readings [1]
    solved: NDArray[np.bool_]  # (G,) Whether the setting was solved rather than interpolated
    # Gives what the signature of an effect may be off by because of its law, (M, D) [units of the readings]
    directions: Callable[[Effect], Array] | None = None
    _other: dict[int, Array] = field(default_factory=dict, repr=False)
    _cells: dict[int, Array] = field(default_factory=dict, repr=False)

    def seen_as(self, signatures: Array) -> Candidate:
        """The same settings, of which other signatures (M, G) are known [units of the readings]."""
        return replace(self, signatures=signatures, _other={}, _cells={})

    def only(self, keep: NDArray[np.bool_]) -> Candidate | None:
        """Candidate with some of its settings; None without any."""
        if keep.all():
            return self
        if not keep.any():
            return None
        settings = tuple(s for s, k in zip(self.settings, keep, strict=True) if k)
        weight = self.weight[keep] * (self.weight.sum() / self.weight[keep].sum())
        return Candidate(
            self.id, settings, self.signatures[:, keep], weight, self.solved[keep], self.directions
        )  # fmt: skip

    def other_laws(self, g: int) -> Array:
        """What the signature of a setting is off by in each of the other laws, (M, D) [units of the readings]."""
        if self.directions is None:
            return np.zeros((self.signatures.shape[0], 0))
        if g not in self._other:
            columns = self.directions(effect_of(self.id, self.settings[g]))
            self._other[g] = columns[:, np.any(columns != 0.0, axis=0)]
        return self._other[g]

    def within(self, g: int) -> Array:
        """What readings differ by within the cell of a setting, one column a parameter, (M, D) [units of the readings].

        A setting stands for all values nearer to it than to its neighbours: alike beforehand, their standard deviation
        is the width of the cell over the root of 12.
        """
        if g not in self._cells:
            cls, here, columns = effects.catalogue()[self.id], self.settings[g], []
            for name in (n for n, v in here.items() if isinstance(v, float) and n not in cls.discrete):
                line = [k for k, s in enumerate(self.settings) if name in s and {**s, name: here[name]} == here]
                line.sort(key=lambda k: self.settings[k][name])
                at = line.index(g)
                low, high = line[max(at - 1, 0)], line[min(at + 1, len(line) - 1)]
                cells = (low != g) + (high != g)  # an end has one neighbour
                if cells:
                    columns.append((self.signatures[:, high] - self.signatures[:, low]) / (cells * math.sqrt(12.0)))
            self._cells[g] = np.stack(columns, axis=1) if columns else np.zeros((self.signatures.shape[0], 0))
        return self._cells[g]

    @property
    def middle(self) -> int:
        """Setting that stands for the effect at ordinary strength: the one of median size in the prior."""
        size = np.sqrt(np.sum(self.signatures**2, axis=0))
        order = np.argsort(size, kind="stable")
        order = order[(size[order] > 0) & np.isfinite(size[order])]
        if not order.size:
            return 0
        w = self.weight[order]
        median = float(np.interp(0.5, (np.cumsum(w) - 0.5 * w) / w.sum(), size[order]))
        return int(np.nanargmin(np.where(size > 0, np.abs(size - median), np.nan)))


_CONVERTED = float(np.exp(-2.0))  # Share of numbers that were converted wrongly before they were headed: declared [1]
_DIMENSIONS = {"thrust_N": "force", "torque_Nm": "torque", "rpm": "angular_speed", "airspeed_m_s": "speed",
               "density_kg_m3": "density"}  # fmt: skip


def actual_unit(channel: str, factor: float, declared: Mapping[str, float]) -> str:
    """Unit of the numbers of a channel whose heading has the unit `declared`, in that of the channel; "" for none.

    >>> [actual_unit("airspeed_m_s", factor, {"airspeed_m_s": 1.0 / 3.6}) for factor in (1.0 / 3.6, 0.3048)]
    ['m_s', '']
    """
    size = declared.get(channel, 1.0) / factor * (RPM if channel == "rpm" else 1.0)
    alike = (u for u in UNITS.values() if u.dimension == _DIMENSIONS[channel])
    return next((u.suffix for u in alike if np.isclose(size, u.factor, rtol=1e-6)), "")


def _heading_odds(slip: UnitSlip, declared: Mapping[str, float]) -> float:
    """Share that is left of the odds of a slip beside the units of headings; all of it where they are SI. [1]"""
    si = declared.get(slip.channel, 1.0) == 1.0
    return 1.0 if si or slip.factor < 0.0 or actual_unit(slip.channel, slip.factor, declared) else _CONVERTED


def effect_of(id: str, setting: Setting) -> Effect:  # noqa: A002
    """Effect with a setting of its parameters."""
    return effects.catalogue()[id](**setting)


def candidates(
    problem: Problem, only: Sequence[str] | None = None, progress: Callable[[str], None] | None = None
) -> tuple[tuple[Candidate, ...], dict[str, str]]:
    """Signatures of all effects that can be at work."""
    found: list[Candidate] = []
    absent: dict[str, str] = {}
    for name, cls in effects.catalogue().items():
        if not cls.diagnosed if only is None else name not in only:
            continue
        if progress:
            progress(name)
        reasons = [cls().applies(p.flow) for p in problem.parts]
        if all(reasons):
            absent[name] = reasons[0]
            continue
        candidate = _candidate(problem, name, cls)
        if candidate is None:
            absent[name] = "no change in these readings"
        else:
            found.append(candidate)
    return tuple(found), absent


def _candidate(problem: Problem, name: str, cls: type[Effect]) -> Candidate | None:
    present = next((e for e in problem.baseline if e.id == name), None)
    given = cls().settings(problem.parts[0].flow)
    columns: list[_Column] = []
    floor = 1e-3 * problem.u
    if given is not None:
        sizes = {p.name: p for p in cls.parameters if p.usual is not None}
        for setting in given:
            effect = cls(**setting)
            share = (
                effect.odds() * float(np.prod([p.density(float(setting[k])) for k, p in sizes.items()])) / len(given)
            )
            if isinstance(effect, UnitSlip):
                share *= min(_heading_odds(effect, p.record.declared) for p in problem.parts)
            columns.append((dict(setting), problem.signature((effect,)), True, share))
    else:
        axes = [p for p in cls.parameters if p.steps > 0]
        if not axes:
            if present is None:
                columns.append(({}, problem.signature((cls(),)), True, 1.0))
        else:
            for form in [{"form": f} for f in cls.words.get("form", ())] or [{}]:
                columns.extend(_grid(problem, cls, form, axes, floor))
    lawful = [c for c in columns if all(cls(**c[0]).plausible(p.flow) for p in problem.parts if not p.record.reference)]
    kept = _merged([c for c in lawful if np.isfinite(c[1]).all()])
    if not any(np.any(np.abs(c[1]) > floor) for c in kept):
        return None
    weight = np.array([c[3] for c in kept])
    return Candidate(
        name, tuple(c[0] for c in kept), np.stack([c[1] for c in kept], axis=1), weight / weight.sum(),
        np.array([c[2] for c in kept]), problem.directions if problem.variants else None,
    )  # fmt: skip


def _merged(columns: Sequence[_Column]) -> list[_Column]:
    """Join settings that change the readings alike; a parameter that nowhere matters is not at work and is dropped."""
    groups: dict[bytes, list[int]] = {}
    for k, column in enumerate(columns):
        groups.setdefault(column[1].tobytes(), []).append(k)
    shared = [(columns[group[0]][0], [columns[k][0] for k in group]) for group in groups.values()]
    differing = {n for first, some in shared for n, v in first.items() if any(q.get(n) != v for q in some)}
    idle = {n for n in differing if _idle(n, columns)}
    out: list[_Column] = []
    for group in groups.values():
        setting, signature, solved, _ = columns[group[0]]
        told = {n: v for n, v in setting.items() if n not in idle}
        out.append((told, signature, solved, sum(columns[k][3] for k in group)))
    return out


def _idle(name: str, columns: Sequence[_Column]) -> bool:
    """Whether settings that differ in one parameter only change the readings alike, all of them.

    Of a parameter that never differs alone, as a factor from the name of its unit, that is not known.
    """
    seen: dict[tuple[Any, ...], set[bytes]] = {}
    for setting, signature, *_ in columns:
        others = tuple(sorted((n, v) for n, v in setting.items() if n != name))
        seen.setdefault(others, set()).add(signature.tobytes())
    return len(seen) < len(columns) and all(len(some) == 1 for some in seen.values())


def _grid(
    problem: Problem, cls: type[Effect], form: Setting, axes: Sequence[Any], floor: Array
) -> Iterator[_Column]:  # fmt: skip
    """Solve one form of an effect at the nodes of all parameters and interpolate between them by cubic splines.

    Nothing is solved between corners that all change the readings by less than the floor (M,). Where a parameter has a
    usual size, settings are denser about "off": equal steps of the inverse hyperbolic sine.
    """
    from scipy.interpolate import CubicSpline

    nodes = [np.linspace(p.low, p.high, p.steps) for p in axes]
    names = [p.name for p in axes]

    def solved_at(values: Sequence[float]) -> Array:
        return problem.signature((cls(**form, **dict(zip(names, map(float, values), strict=True))),))

    if all(np.all(np.abs(solved_at(v)) <= floor) for v in product(*(n[[0, -1]] for n in nodes))):
        return
    table = np.stack([solved_at(v) for v in product(*nodes)], axis=-1).reshape(-1, *(n.size for n in nodes))
    if not np.isfinite(table).all():
        # where a corner does not converge, the nodes stand for themselves
        flat = table.reshape(table.shape[0], -1)
        for k, v in enumerate(product(*nodes)):
            share = float(np.prod([p.density(x) for p, x in zip(axes, v, strict=True)]))
            yield {**form, **dict(zip(names, map(float, v), strict=True))}, flat[:, k], True, share
        return
    count = _FINE.get(len(axes), 5)
    # a parameter that moves no reading is not at work: a spline would make differences of its rounding
    still = [k for k in range(len(axes)) if np.all(np.ptp(table, axis=k + 1).T <= _ROUNDING * problem.u)]
    table = table[tuple([slice(None), *(0 if k in still else slice(None) for k in range(len(axes)))])]
    axes, nodes = ([v for k, v in enumerate(some) if k not in still] for some in (axes, nodes))
    names = [p.name for p in axes]
    fine = [_spread(p, n, count) if n.size > 2 else n for p, n in zip(axes, nodes, strict=True)]
    shares = [np.array([p.density(x) for x in f]) * (1.0 if p.usual is None else np.gradient(f))
              for p, f in zip(axes, fine, strict=True)]  # fmt: skip
    for k, (n, f) in enumerate(zip(nodes, fine, strict=True)):
        if n.size > 2:
            matrix = CubicSpline(n, np.eye(n.size), bc_type="natural" if n.size < 4 else "not-a-knot")(f)
            table = np.moveaxis(np.tensordot(matrix, table, axes=(1, k + 1)), 0, k + 1)
    flat = table.reshape(table.shape[0], -1)
    on_node: list[Any] = [np.isclose(f[:, None], n[None, :], rtol=0, atol=1e-9 * max(1.0, abs(n[-1]))).any(axis=1)
               for n, f in zip(nodes, fine, strict=True)]  # fmt: skip
    solved = np.array([all(s) for s in product(*on_node)])
    for k, (v, w) in enumerate(zip(product(*fine), product(*shares), strict=True)):
        yield {**form, **dict(zip(names, map(float, v), strict=True))}, flat[:, k], bool(solved[k]), float(np.prod(w))


def _spread(p: Parameter, nodes: Array, count: int) -> Array:
    """Values of a parameter between the nodes, these among them where it has a usual size."""
    if p.usual is None or p.off is None:
        return np.asarray(np.linspace(float(nodes[0]), float(nodes[-1]), count))
    ends = np.arcsinh((nodes[[0, -1]] - p.off) / p.usual)
    inner = p.off + p.usual * np.sinh(np.linspace(float(ends[0]), float(ends[1]), count))
    return np.asarray(np.union1d(np.round(inner, 12), nodes))
