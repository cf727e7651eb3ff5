"""Series: the one currency in which BEMT, K1/K2, CFD, bench and vendor numbers meet.

A series holds N points as named channels. A channel name ends in its SI unit (``thrust_N``, ``airspeed_m_s``), except
for ``rpm`` [rev/min] and dimensionless channels (``CT``, ``CP``, ``CQ``, ``J``, ``eta``, ...). Coefficients are in the
PROPELLER convention: CT = T/(rho n^2 D^4), CQ = Q/(rho n^2 D^5), CP = P/(rho n^3 D^5) = 2 pi CQ, J = V/(n D), n in
rev/s; :meth:`Series.from_rotor_convention` takes the helicopter convention. Torque and power are those of the shaft.

Standard uncertainties (one sigma) go with each channel; NaN means unknown, which is not zero.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt import coefficients as co
from bemt.base import units
from bemt.base.errors import Fault, InputError

__all__ = ["DIMENSIONLESS", "KINDS", "Series", "concat"]

KINDS = ("bemt", "k1k2", "cfd", "bench", "vendor")
"""Kinds that comparisons know; others (``k1k2_printed``, ``flight``) are allowed and kept apart."""

DIMENSIONLESS = frozenset(
    {"CT", "CP", "CQ", "J", "eta", "FM", "Re", "M_tip", "M_tip_helical", "throttle", "duct_share", "run"}
)
"""Channel names without a unit."""

Array = NDArray[np.float64]
_KIND = re.compile(r"[a-z][a-z0-9_]*")


def _channel_fault(name: str) -> tuple[str, str, str] | None:
    """Reason why a channel name is refused: (got, expected, hint)."""
    if name == "rpm" or name in DIMENSIONLESS:
        return None
    base, unit = units.split_suffix(name)
    if unit is None or not base:
        return (f"channel {name!r}", "rpm, a coefficient, or a name that ends in its SI unit", "As in thrust_N")
    if unit.factor != 1.0 or unit.offset != 0.0:
        hint = f"Convert it with units.to_si(..., {unit.suffix!r})"
        return (f"channel {name!r} in {unit.suffix}", "an SI unit", hint)
    return None


def _frozen(array: ArrayLike) -> Array:
    out = np.array(array, dtype=float)
    out.setflags(write=False)
    return out


@dataclass(frozen=True, eq=False)
class Series:
    """N points of one source.

    Parameters
    ----------
    kind : str
        One of :data:`KINDS`, or another lower-case word.
    name : str
        What was measured or computed.
    values : mapping of str to (N,) array
        Channels; at least one. NaN marks a value that does not exist (unconverged, not recorded).
    u : mapping of str to (N,) array or float
        Standard uncertainty by channel, in its unit; absent or NaN: unknown.
    flags : tuple of tuple of str
        Per point; empty: no flags.
    provenance : mapping
        ``source``, ``file``, ``sha256``, ``remark`` and more, as far as known.
    labels : tuple of str
        Per point, where it comes from (``file:row``); empty: none.

    Raises
    ------
    InputError
        With all faults: names, lengths, infinite values, negative uncertainties.

    Examples
    --------
    >>> s = Series("bench", "stand", {"rpm": [6000.0], "thrust_N": [10.0]}, {"thrust_N": 0.1})
    >>> d = s.derive(diameter_m=0.254, density_kg_m3=1.225)
    >>> round(float(d["CT"][0]), 4), round(float(d.u["CT"][0]), 4)
    (0.1961, 0.002)
    """

    kind: str
    name: str
    values: Mapping[str, Any]
    u: Mapping[str, Any] = field(default_factory=dict)
    flags: tuple[tuple[str, ...], ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    labels: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        values = {key: _frozen(v) for key, v in self.values.items()}
        n = next((len(v) for v in values.values() if v.ndim == 1), 0)
        found = [*self._head_faults(values, n)]
        u: dict[str, Array] = {}
        for key, raw in self.u.items():
            array = _frozen(raw)
            if key not in values:
                found.append((f"u.{key}", "uncertainty of an absent channel", "a channel of values", ""))
            elif array.shape not in ((), (n,)):
                found.append((f"u.{key}", f"shape {array.shape}", f"one number or shape ({n},)", ""))
            elif np.any(array < 0) or np.any(np.isinf(array)):
                found.append((f"u.{key}", "a negative or infinite uncertainty", "zero or more; NaN = unknown", ""))
            else:
                u[key] = _frozen(np.broadcast_to(array, (n,)))
        if found:
            file = str(self.provenance.get("file", "")) or self.name
            raise InputError([Fault(file, *fault) for fault in found])
        unknown = _frozen(np.full(n, np.nan))
        object.__setattr__(self, "values", MappingProxyType(values))
        object.__setattr__(self, "u", MappingProxyType({key: u.get(key, unknown) for key in values}))
        object.__setattr__(self, "flags", tuple(tuple(f) for f in self.flags) or ((),) * n)
        object.__setattr__(self, "labels", tuple(self.labels))
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))

    def _head_faults(self, values: Mapping[str, Array], n: int) -> Iterable[tuple[str, str, str, str]]:
        if not _KIND.fullmatch(self.kind):
            yield ("kind", repr(self.kind), f"a lower-case word such as {', '.join(KINDS)}", "")
        if not values:
            yield ("values", "no channels", "one channel or more", "")
        for key, array in values.items():
            if fault := _channel_fault(key):
                yield (f"values.{key}", *fault)
            if array.shape != (n,):
                yield (f"values.{key}", f"shape {array.shape}", f"shape ({n},) like the first channel", "")
            elif np.any(np.isinf(array)):
                yield (f"values.{key}", "an infinite value", "finite numbers, or NaN for none", "")
        for what, items in (("flags", self.flags), ("labels", self.labels)):
            if items and len(items) != n:
                yield (what, f"{len(items)} entries", f"{n}, one per point", "")

    def __len__(self) -> int:
        """Give the number of points."""
        return len(next(iter(self.values.values())))

    def __getitem__(self, channel: str) -> Array:
        """Give one channel, (N,), read-only."""
        channel_values: Array = self.values[channel]
        return channel_values

    def __contains__(self, channel: object) -> bool:
        """Tell whether a channel is there."""
        return channel in self.values

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as plain dictionaries (worker processes send series back)."""
        plain = (dict(self.values), dict(self.u), self.flags, dict(self.provenance), self.labels)
        return (Series, (self.kind, self.name, *plain))

    @classmethod
    def from_rotor_convention(cls, kind: str, name: str, values: Mapping[str, ArrayLike], **kwargs: Any) -> Series:
        """Make a series from helicopter coefficients.

        Parameters
        ----------
        kind, name : str
            As for the class.
        values : mapping of str to (N,) array
            Channels; ``CT_rotor`` = T/(rho A (Omega R)^2), ``CP_rotor`` = ``CQ_rotor`` = P/(rho A (Omega R)^3) and
            ``mu_axial`` = V/(Omega R) are converted, others pass.
        **kwargs
            ``u`` (of the same channels), ``flags``, ``provenance``, ``labels``.

        Returns
        -------
        Series
            With CT = (pi^3/4) CT_rotor, CP = (pi^4/4) CP_rotor, J = pi mu_axial.

        Examples
        --------
        >>> s = Series.from_rotor_convention("bench", "rotor", {"CT_rotor": [0.004]})
        >>> round(float(s["CT"][0]), 5)
        0.03101
        """
        factors = {
            "CT_rotor": ("CT", co.CT_PER_ROTOR), "CP_rotor": ("CP", co.CP_PER_ROTOR),
            "CQ_rotor": ("CQ", co.CQ_PER_ROTOR), "mu_axial": ("J", math.pi),
        }  # fmt: skip

        def convert(channels: Mapping[str, ArrayLike]) -> dict[str, Array]:
            pairs = ((*factors.get(key, (key, 1.0)), array) for key, array in channels.items())
            return {key: np.asarray(array, dtype=float) * factor for key, factor, array in pairs}

        u = convert(kwargs.pop("u", {}))
        return cls(kind, name, convert(values), u, **kwargs)

    def derive(self, diameter_m: float, density_kg_m3: ArrayLike | None = None) -> Series:
        """Add every channel that follows from the ones that are there; none is replaced.

        Parameters
        ----------
        diameter_m : float
            Diameter. [m]
        density_kg_m3 : float or (N,) array or None
            Density [kg/m3], NaN: unknown; None takes the channel ``density_kg_m3`` (without it only J, airspeed, CQ-CP,
            torque-power and eta are derived).

        Returns
        -------
        Series
            With thrust_N-CT, torque_Nm-CQ, power_W-CP, CQ-CP, torque_Nm-power_W, airspeed_m_s-J, eta = J CT/CP.

        Raises
        ------
        InputError
            When the diameter or a density is not positive.

        Notes
        -----
        Uncertainties are propagated to first order from the measured quantity alone: diameter, density, rpm and
        airspeed count as exact, because their uncertainty belongs to u_input of a comparison (ASME V&V 20), not to
        u_D. For eta, those of CT and CP are taken as independent. Unknown stays unknown.
        """
        rho = self.values.get("density_kg_m3") if density_kg_m3 is None else np.asarray(density_kg_m3, dtype=float)
        faults = []
        if not (math.isfinite(diameter_m) and diameter_m > 0):
            faults.append(Fault(self.name, "diameter_m", f"{diameter_m:g}", "a positive number", ""))
        if rho is not None and np.any(rho <= 0):
            faults.append(Fault(self.name, "density_kg_m3", "a density that is not positive", "positive numbers", ""))
        if faults:
            raise InputError(faults)
        values, u = dict(self.values), dict(self.u)
        n = values["rpm"] / 60.0 if "rpm" in values else None

        def add(new: str, old: str, factor: Array) -> None:
            if new not in values and old in values:
                values[new] = values[old] * factor
                u[new] = u[old] * np.abs(factor)

        pairs: list[tuple[str, str, Any]] = [("CQ", "CP", co.CQ_from_CP(1.0))]
        if n is not None:
            with np.errstate(divide="ignore"):
                omega = np.where(n > 0, 2 * math.pi * n, np.nan)
            pairs += [("airspeed_m_s", "J", co.airspeed(1.0, n, diameter_m)), ("power_W", "torque_Nm", omega)]
            if rho is not None:
                pairs += [
                    ("thrust_N", "CT", co.thrust(1.0, rho, n, diameter_m)),
                    ("torque_Nm", "CQ", co.torque(1.0, rho, n, diameter_m)),
                    ("power_W", "CP", co.power(1.0, rho, n, diameter_m)),
                ]
        for _ in range(3):  # the longest chain is thrust stand -> torque -> power -> CP -> CQ
            for one, other, raw in pairs:
                factor = np.asarray(raw, dtype=float)
                add(one, other, factor)
                inverse = np.divide(1.0, factor, out=np.full(factor.shape, np.nan), where=factor > 0)
                add(other, one, inverse)
        if "eta" not in values and {"J", "CT", "CP"} <= values.keys():
            values["eta"] = np.asarray(co.eta(values["J"], values["CT"], values["CP"]), dtype=float)
            with np.errstate(divide="ignore", invalid="ignore"):
                u_eta = np.hypot(values["J"] * u["CT"], values["eta"] * u["CP"]) / np.abs(values["CP"])
            u["eta"] = np.where(np.isfinite(u_eta), u_eta, np.nan)
        return replace(self, values=values, u=u)

    def select(self, where: ArrayLike | slice | Callable[[Series], ArrayLike]) -> Series:
        """Take some points.

        Parameters
        ----------
        where : (N,) bool array, int array, slice, or function of the series that gives one
            Points to keep, in this order.

        Returns
        -------
        Series
            Same channels and provenance.

        Examples
        --------
        >>> s = Series("bench", "s", {"J": [0.0, 0.3, 0.6]}, flags=((), ("odd",), ()))
        >>> s.select(lambda s: s["J"] > 0.1).flags
        (('odd',), ())
        """
        chosen = where(self) if callable(where) else where
        index = np.arange(len(self))[chosen if isinstance(chosen, slice) else np.atleast_1d(np.asarray(chosen))]
        return replace(
            self,
            values={key: v[index] for key, v in self.values.items()},
            u={key: v[index] for key, v in self.u.items()},
            flags=tuple(self.flags[i] for i in index),
            labels=tuple(self.labels[i] for i in index) if self.labels else (),
        )

    def to_rows(self) -> list[dict[str, Any]]:
        """Give one plain dictionary per point, fit for JSON.

        Returns
        -------
        list of dict
            ``source`` (the kind), ``name``, one key per channel, ``u`` (per channel), ``flags``, and ``label`` where
            there are labels. NaN becomes None: no value, or uncertainty unknown.

        Examples
        --------
        >>> Series("vendor", "fan", {"thrust_N": [27.0]}).to_rows()
        [{'source': 'vendor', 'name': 'fan', 'thrust_N': 27.0, 'u': {'thrust_N': None}, 'flags': []}]
        """

        def plain(x: float) -> float | None:
            return None if math.isnan(x) else float(x)

        rows = []
        for i in range(len(self)):
            row: dict[str, Any] = {"source": self.kind, "name": self.name}
            row |= {key: plain(v[i]) for key, v in self.values.items()}
            row |= {"u": {key: plain(v[i]) for key, v in self.u.items()}, "flags": list(self.flags[i])}
            if self.labels:
                row["label"] = self.labels[i]
            rows.append(row)
        return rows


def concat(series: Iterable[Series], name: str | None = None) -> Series:
    """Join series of one kind, point after point.

    Parameters
    ----------
    series : iterable of Series
        At least one; all of the same kind.
    name : str or None
        Name of the result; None takes the first.

    Returns
    -------
    Series
        All channels of all; NaN where a part lacks one. ``provenance["parts"]`` lists (name, points, provenance).

    Raises
    ------
    InputError
        When there is none, or kinds differ.

    Examples
    --------
    >>> a, b = Series("bench", "a", {"J": [0.1]}), Series("bench", "b", {"J": [0.2], "CT": [0.1]})
    >>> concat([a, b])["CT"]
    array([nan, 0.1])
    """
    parts = list(series)
    kinds = sorted({part.kind for part in parts})
    if len(kinds) != 1:
        got = f"kinds {', '.join(kinds)}" if kinds else "no series"
        raise InputError(Fault(name or "concat", "", got, "one or more series of one kind", ""))
    if len(parts) == 1:
        return parts[0] if name is None else replace(parts[0], name=name)
    channels = list(dict.fromkeys(key for part in parts for key in part.values))

    def joined(attribute: str, key: str) -> Array:
        return np.concatenate([getattr(p, attribute).get(key, np.full(len(p), np.nan)) for p in parts])

    return Series(
        kinds[0],
        parts[0].name if name is None else name,
        {key: joined("values", key) for key in channels},
        {key: joined("u", key) for key in channels},
        sum((part.flags for part in parts), ()),
        {"parts": tuple((part.name, len(part), dict(part.provenance)) for part in parts)},
        sum((part.labels or ("",) * len(part) for part in parts), ()) if any(part.labels for part in parts) else (),
    )
