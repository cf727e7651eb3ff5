"""Dataset: the one currency in which BEMT, K1/K2, CFD, bench and vendor numbers meet.

A dataset holds N points as named channels. A channel name ends in its SI unit (``thrust_N``, ``airspeed_m_s``), except
for ``rpm`` [rev/min] and dimensionless channels (``CT``, ``CP``, ``CQ``, ``J``, ``eta``, ...). Coefficients are in the
PROPELLER convention: CT = T/(rho n^2 D^4), CQ = Q/(rho n^2 D^5), CP = P/(rho n^3 D^5) = 2 pi CQ, J = V/(n D), n in
rev/s; :meth:`Dataset.from_rotor_convention` takes the helicopter convention. Torque and power are those of the shaft.

Standard uncertainties (one sigma) go with each channel; NaN means unknown, which is not zero. Where their origin is
known they are split by :data:`ORIGINS`, and the total is the root of the sum of squares.
"""

from __future__ import annotations

import html
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt import coefficients as co
from bemt.base import units
from bemt.base.errors import Fault, InputError

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["DIMENSIONLESS", "KINDS", "ORIGINS", "Dataset", "concat", "from_pandas"]

KINDS = ("bemt", "k1k2", "cfd", "bench", "vendor")
"""Kinds that comparisons know; others (``k1k2_printed``, ``flight``) are allowed and kept apart."""

ORIGINS = ("random", "session", "input", "model", "numerics")
"""Where an uncertainty comes from: scatter of points, what a session shares (gain, zero), inputs not known exactly, the
model's own error on real rotors, discretisation."""

DIMENSIONLESS = frozenset(
    {"CT", "CP", "CQ", "J", "eta", "FM", "Re", "Re75", "M_tip", "M_tip_helical", "throttle", "duct_share", "run"}
)
"""Channel names without a unit."""

Array = NDArray[np.float64]
_KIND = re.compile(r"[a-z][a-z0-9_]*")


@lru_cache(maxsize=1024)
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
class Dataset:
    """N points of one source: channels, uncertainties by origin, provenance.

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
    u_by : mapping of str to mapping of str to (N,) array or float
        Parts of ``u`` by origin (:data:`ORIGINS`), then channel, in its unit. Channels without an entry in ``u`` get
        the root of the sum of squares of their parts.
    notes : tuple of str
        What was assumed, dropped or averaged.

    Raises
    ------
    InputError
        With all faults: names, lengths, infinite values, negative uncertainties.

    Examples
    --------
    >>> s = Dataset("bench", "stand", {"rpm": [6000.0], "thrust_N": [10.0]}, {"thrust_N": 0.1})
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
    u_by: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        values = {key: _frozen(v) for key, v in self.values.items()}
        n = next((len(v) for v in values.values() if v.ndim == 1), 0)
        found = [*self._head_faults(values, n)]

        def checked(where: str, given: Mapping[str, Any]) -> dict[str, Array]:
            kept: dict[str, Array] = {}
            for key, raw in given.items():
                array = _frozen(raw)
                if key not in values:
                    found.append((f"{where}.{key}", "uncertainty of an absent channel", "a channel of values", ""))
                elif array.shape not in ((), (n,)):
                    found.append((f"{where}.{key}", f"shape {array.shape}", f"one number or shape ({n},)", ""))
                elif np.any(array < 0) or np.any(np.isinf(array)):
                    got = "a negative or infinite uncertainty"
                    found.append((f"{where}.{key}", got, "zero or more; NaN = unknown", ""))
                else:
                    kept[key] = _frozen(np.broadcast_to(array, (n,)))
            return kept

        u = checked("u", self.u)
        u_by = {origin: checked(f"u_by.{origin}", parts) for origin, parts in self.u_by.items()}
        for origin in u_by.keys() - set(ORIGINS):
            found.append((f"u_by.{origin}", "an unknown origin", f"one of {', '.join(ORIGINS)}", ""))
        for key in values.keys() - u.keys():
            parts = [part[key] for part in u_by.values() if key in part]
            if parts:
                u[key] = _frozen(np.sqrt(np.sum(np.square(parts), axis=0)))
        if found:
            file = str(self.provenance.get("file", "")) or self.name
            raise InputError([Fault(file, *fault) for fault in found])
        unknown = _frozen(np.full(n, np.nan))
        object.__setattr__(self, "values", MappingProxyType(values))
        object.__setattr__(self, "u", MappingProxyType({key: u.get(key, unknown) for key in values}))
        object.__setattr__(self, "flags", tuple(tuple(f) for f in self.flags) or ((),) * n)
        object.__setattr__(self, "labels", tuple(self.labels))
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))
        by = {origin: MappingProxyType(u_by[origin]) for origin in ORIGINS if u_by.get(origin)}
        object.__setattr__(self, "u_by", MappingProxyType(by))
        object.__setattr__(self, "notes", tuple(self.notes))

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
        if channel not in self.values:
            raise KeyError(f"no channel {channel!r}; there are {', '.join(self.values)}")
        channel_values: Array = self.values[channel]
        return channel_values

    def __contains__(self, channel: object) -> bool:
        """Tell whether a channel is there."""
        return channel in self.values

    def __repr__(self) -> str:
        """Say what it holds in a line; to_pandas() shows the numbers."""
        return f"Dataset({self.kind!r}, {self.name!r}, {len(self)} points: {', '.join(self.values)})"

    def _repr_html_(self) -> str:
        """Show the points in a notebook: each value with its standard uncertainty, where one is known."""
        columns = [*self.values, *(["flags"] if any(self.flags) else [])]
        shown = list(range(len(self))) if len(self) <= 12 else [*range(8), None, *range(len(self) - 3, len(self))]

        def cell(name: str, i: int) -> str:
            if name == "flags":
                return ", ".join(self.flags[i])
            value, u = self.values[name][i], self.u[name][i]
            if not np.isfinite(value):
                return "-"
            if not u > 0.0:
                return f"{value:.6g}"
            digits = max(0, 1 - math.floor(math.log10(u)))  # two digits of the uncertainty
            return f"{value:.{digits}f} &plusmn; {u:.{digits}f}"

        head = "".join(f"<th>{html.escape(name)}</th>" for name in columns)
        rows = "".join(
            "<tr>" + "".join(f"<td>{'&#8942;' if i is None else cell(name, i)}</td>" for name in columns) + "</tr>"
            for i in shown
        )
        notes = "".join(f"<br><small>{html.escape(note)}</small>" for note in self.notes)
        what = f"<strong>{html.escape(f'{self.kind}: {self.name}, {len(self)} points')}</strong>"
        return f'{what}<div style="overflow-x:auto"><table class="bemt"><tr>{head}</tr>{rows}</table></div>{notes}'

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as plain dictionaries (worker processes send series back)."""
        by = {origin: dict(parts) for origin, parts in self.u_by.items()}
        plain = (dict(self.values), dict(self.u), self.flags, dict(self.provenance), self.labels, by, self.notes)
        return (Dataset, (self.kind, self.name, *plain))

    @property
    def converged(self) -> NDArray[np.bool_]:
        """Points whose channels that were computed are all numbers, (N,).

        Examples
        --------
        >>> Dataset("bemt", "p", {"rpm": [4000.0, 6000.0], "thrust_N": [2.1, math.nan]}).converged
        array([ True, False])
        """
        loads = [v for key, v in self.values.items() if key in ("thrust_N", "torque_Nm", "CT", "CP")]
        return np.asarray(np.all(np.isfinite(loads or list(self.values.values())), axis=0))

    def __getattr__(self, channel: str) -> Array:
        """Give a channel as an attribute, as in ``d.thrust_N``."""
        values = self.__dict__.get("values", {})
        if channel in values:
            return values[channel]  # type: ignore[no-any-return]
        raise AttributeError(f"no channel {channel!r}; there are {', '.join(values)}")

    @classmethod
    def from_rotor_convention(cls, kind: str, name: str, values: Mapping[str, ArrayLike], **kwargs: Any) -> Dataset:
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
        Dataset
            With CT = (pi^3/4) CT_rotor, CP = (pi^4/4) CP_rotor, J = pi mu_axial.

        Examples
        --------
        >>> s = Dataset.from_rotor_convention("bench", "rotor", {"CT_rotor": [0.004]})
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

    def derive(self, diameter_m: float, density_kg_m3: ArrayLike | None = None) -> Dataset:
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
        Dataset
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

    def select(self, where: ArrayLike | slice | Callable[[Dataset], ArrayLike]) -> Dataset:
        """Take some points.

        Parameters
        ----------
        where : (N,) bool array, int array, slice, or function of the series that gives one
            Points to keep, in this order.

        Returns
        -------
        Dataset
            Same channels and provenance.

        Examples
        --------
        >>> s = Dataset("bench", "s", {"J": [0.0, 0.3, 0.6]}, flags=((), ("odd",), ()))
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
            u_by={origin: {key: v[index] for key, v in parts.items()} for origin, parts in self.u_by.items()},
        )

    def to_pandas(self) -> pd.DataFrame:
        """Give the points as a table.

        Returns
        -------
        pandas.DataFrame
            A column per channel, ``u_<channel>`` where its uncertainty is known somewhere, ``u_<origin>_<channel>`` for
            its parts, ``flags`` (joined by "; ") where there are any; ``attrs`` holds kind, name, provenance and notes.

        Examples
        --------
        >>> Dataset("bench", "stand", {"rpm": [6000.0], "thrust_N": [10.0]}, {"thrust_N": 0.1}).to_pandas()
              rpm  thrust_N  u_thrust_N
        0  6000.0      10.0         0.1
        """
        import pandas as pd

        columns: dict[str, Any] = dict(self.values)
        columns |= {f"u_{key}": v for key, v in self.u.items() if not np.all(np.isnan(v))}
        columns |= {f"u_{origin}_{key}": v for origin, parts in self.u_by.items() for key, v in parts.items()}
        if any(self.flags):
            columns["flags"] = ["; ".join(words) for words in self.flags]
        frame = pd.DataFrame(columns, index=pd.Index(self.labels) if self.labels else None)
        about = {"kind": self.kind, "name": self.name, "provenance": dict(self.provenance), "notes": list(self.notes)}
        frame.attrs.update(about)
        return frame

    def to_xarray(self) -> xr.Dataset:
        """Give the points as an xarray dataset over the dimension ``point``.

        Returns
        -------
        xarray.Dataset
            The columns of :meth:`to_pandas` as variables, with ``units`` in their attributes.

        Raises
        ------
        InputError
            When xarray is not installed.

        Examples
        --------
        >>> x = Dataset("bench", "stand", {"rpm": [6000.0], "thrust_N": [10.0]}).to_xarray()
        >>> x["thrust_N"].attrs["units"], x.sizes["point"]
        ('N', 1)
        """
        from bemt.base.errors import needs

        xarray = needs("xarray", "xarray")
        frame = self.to_pandas()
        out = xarray.Dataset({key: ("point", frame[key].to_numpy()) for key in frame.columns}, attrs=dict(frame.attrs))
        for key in out.data_vars:
            _, unit = units.split_suffix(str(key))
            out[key].attrs["units"] = "1" if unit is None else unit.suffix
        return out

    def plot(self, x: str | None = None, y: Sequence[str] = (), ax: Any = None) -> Any:
        """Draw channels over another one, with bands where uncertainties are known.

        Parameters
        ----------
        x : str, optional
            Channel of the abscissa; what varies of J, airspeed and rpm by default.
        y : sequence of str
            Channels to draw; CT and CP, or thrust, by default.
        ax : matplotlib axes, optional
            Where to draw, beside what is there: a channel keeps its colour. A new figure by default.

        Returns
        -------
        matplotlib axes
            With a line for each channel, and for each speed of rotation where J or airspeed is the abscissa.

        Raises
        ------
        InputError
            For a channel that is not there.

        Examples
        --------
        >>> d = Dataset("bench", "stand", {"rpm": [4000.0, 6000.0], "thrust_N": [2.1, 4.7]}, {"thrust_N": 0.1})
        >>> d.plot().get_xlabel()
        'rpm'
        """
        import matplotlib.pyplot as plt

        ways = [k for k in ("J", "airspeed_m_s", "rpm") if k in self and np.unique(self[k].round(9)).size > 1]
        x = x or (ways[0] if ways else "rpm")
        wanted = list(y) or [k for k in ("CT", "CP") if k in self and x == "J"] or ["thrust_N"]
        wanted = [y] if isinstance(y, str) else wanted
        unknown = [key for key in (x, *wanted) if key not in self]
        if unknown:
            known = ", ".join(self.values)
            raise InputError(Fault(self.name, ", ".join(unknown), "no such channel", f"one of {known}"))
        beside, points = ax is not None, self.kind in ("bench", "cfd", "vendor")
        ax = ax if beside else plt.subplots(layout="constrained")[1]
        drawn = [line.get_gid() for line in ax.lines]
        colours = {line.get_gid(): line.get_color() for line in ax.lines if drawn.count(line.get_gid()) == 1}
        speeds = np.unique(self["rpm"]) if "rpm" in self and x != "rpm" else np.array([np.nan])
        for channel in wanted:
            for speed in speeds:
                rows = np.flatnonzero(self["rpm"] == speed) if np.isfinite(speed) else np.arange(len(self))
                rows = rows[np.argsort(self[x][rows], kind="stable")]
                name = f"{channel}, {speed:.0f} rev/min" if len(speeds) > 1 else channel
                name = f"{name}, {self.name}" if beside else name
                style = {"marker": "o", "ls": ""} if points else {}
                style |= {"color": colours[channel]} if channel in colours and len(speeds) == 1 else {}
                at, value, u = self[x][rows], self[channel][rows], self.u[channel][rows]
                (line,) = ax.plot(at, value, label=name, gid=channel, **style)
                if np.any(u > 0.0) and points:
                    ax.errorbar(at, value, np.nan_to_num(u), fmt="none", ecolor=line.get_color(), lw=1)
                elif np.any(u > 0.0):
                    ax.fill_between(at, value - u, value + u, alpha=0.2, color=line.get_color(), lw=0)
        ax.set_xlabel(x)
        ax.set_ylabel(", ".join(wanted))
        if not beside:
            ax.set_title(self.name, fontsize=10)
        ax.legend(fontsize=8, frameon=False)
        return ax

    def to_rows(self) -> list[dict[str, Any]]:
        """Give one plain dictionary per point, fit for JSON.

        Returns
        -------
        list of dict
            ``source`` (the kind), ``name``, one key per channel, ``u`` (per channel), ``flags``, and ``label`` where
            there are labels. NaN becomes None: no value, or uncertainty unknown.

        Examples
        --------
        >>> Dataset("vendor", "fan", {"thrust_N": [27.0]}).to_rows()
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


def concat(series: Iterable[Dataset], name: str | None = None) -> Dataset:
    """Join series of one kind, point after point.

    Parameters
    ----------
    series : iterable of Dataset
        At least one; all of the same kind.
    name : str or None
        Name of the result; None takes the first.

    Returns
    -------
    Dataset
        All channels of all; NaN where a part lacks one. ``provenance["parts"]`` lists (name, points, provenance).

    Raises
    ------
    InputError
        When there is none, or kinds differ.

    Examples
    --------
    >>> a, b = Dataset("bench", "a", {"J": [0.1]}), Dataset("bench", "b", {"J": [0.2], "CT": [0.1]})
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

    return Dataset(
        kinds[0],
        parts[0].name if name is None else name,
        {key: joined("values", key) for key in channels},
        {key: joined("u", key) for key in channels},
        sum((part.flags for part in parts), ()),
        {"parts": tuple((part.name, len(part), dict(part.provenance)) for part in parts)},
        sum((part.labels or ("",) * len(part) for part in parts), ()) if any(part.labels for part in parts) else (),
    )


def from_pandas(frame: pd.DataFrame, kind: str = "bench", name: str = "table", **more: Any) -> Dataset:
    """Make a dataset from a table whose headings carry their units.

    Parameters
    ----------
    frame : pandas.DataFrame
        Columns ``rpm``, coefficients, or names that end in a unit (``thrust_N``, ``thrust_gf``, ``airspeed_km_h``);
        they are converted to SI by it. ``u_<column>`` is a standard uncertainty, ``flags`` words joined by "; ".
    kind, name : str
        As for :class:`Dataset`.
    **more
        ``provenance``, ``notes``.

    Returns
    -------
    Dataset
        With the index as labels, unless it only counts.

    Raises
    ------
    InputError
        With all faults: headings without a known unit, cells that are no numbers.

    Examples
    --------
    >>> import pandas as pd
    >>> d = from_pandas(pd.DataFrame({"rpm": [6000], "thrust_gf": [1000.0]}))
    >>> d["thrust_N"].round(5), d.kind
    (array([9.80665]), 'bench')
    """
    import pandas as pd

    faults: list[Fault] = []
    values: dict[str, Array] = {}
    u: dict[str, Array] = {}
    u_by: dict[str, dict[str, Array]] = {}
    for heading in map(str, frame.columns):
        if heading == "flags":
            continue
        column = heading.removeprefix("u_") if heading.startswith("u_") else heading
        origin = next((o for o in ORIGINS if column.startswith(f"{o}_") and heading.startswith("u_")), "")
        column = column.removeprefix(f"{origin}_") if origin else column
        base, unit = units.split_suffix(column)
        scale, offset, channel = 1.0, 0.0, column
        named = column == "rpm" or column in DIMENSIONLESS
        if not named and unit is not None and (unit.factor, unit.offset) != (1.0, 0.0):
            base_unit = (unit.dimension, 1.0, 0.0)
            si = next(s for s, o in units.UNITS.items() if (o.dimension, o.factor, o.offset) == base_unit)
            scale, offset, channel = unit.factor, unit.offset, f"{base}_{si}"
        elif fault := _channel_fault(column):
            faults.append(Fault(name, heading, *fault))
            continue
        try:
            numbers = pd.to_numeric(frame[heading]).to_numpy(dtype=float)
        except (ValueError, TypeError) as error:
            faults.append(Fault(name, heading, str(error), "a column of numbers"))
            continue
        if heading == column:
            values[channel] = numbers * scale + offset
        elif origin:
            u_by.setdefault(origin, {})[channel] = numbers * scale
        else:
            u[channel] = numbers * scale
    if faults:
        raise InputError(faults)
    flags = tuple(tuple(w for w in str(words).split("; ") if w) for words in frame["flags"]) if "flags" in frame else ()
    counted = isinstance(frame.index, pd.RangeIndex)
    labels = () if counted else tuple(map(str, frame.index))
    return Dataset(kind, name, values, u, flags, more.pop("provenance", {}), labels, u_by, more.pop("notes", ()))
