"""Dataset: the common format of BEMT, K1/K2, CFD, bench and vendor numbers.

A dataset holds N points as named channels. A channel name ends in its SI unit (``thrust_N``, ``airspeed_m_s``), except
for ``rpm`` [rev/min] and dimensionless channels (``CT``, ``CP``, ``CQ``, ``J``, ``eta``, ...). Coefficients are in the
PROPELLER convention: CT = T/(rho n^2 D^4), CQ = Q/(rho n^2 D^5), CP = P/(rho n^3 D^5) = 2 pi CQ, J = V/(n D), n in
rev/s; :meth:`Dataset.from_rotor_convention` takes the helicopter convention. Torque and power are those of the shaft.

Each channel can have a standard uncertainty (one sigma); NaN means unknown, which is not zero. If the origin is known,
it is split by :data:`ORIGINS`, and the total is the root sum square.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.action import worded
from bemt.base.arrays import Array
from bemt.base.errors import Fault, refuse
from bemt.base.tables import number_of
from bemt.physics import coefficients as co
from bemt.physics.dataset.channels import KINDS, ORIGINS, channel_fault, unit_in

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["Dataset"]

_KIND = re.compile(r"[a-z][a-z0-9_]*")
_LARGEST_M = 10.0  # diameter of a propeller; a larger number is in millimetres


def _still(array: NDArray[Any]) -> bool:
    """Whether an array and everything it is a view of are read-only."""
    part = array.base
    while part is not None:
        if not isinstance(part, np.ndarray) or part.flags.writeable:
            return False
        part = part.base
    return not array.flags.writeable


def _absent(channel: str, values: Mapping[str, Any]) -> str:
    """Words on a channel that is not there, with the nearest that is."""
    near = difflib.get_close_matches(channel, values, 1)
    return f"no channel {channel!r}{f' (did you mean {near[0]}?)' if near else ''}; there are {', '.join(values)}"


def _frozen(array: ArrayLike) -> Array:
    """Read-only array; an array that is already read-only is shared, because a log may have millions of rows."""
    if isinstance(array, np.ndarray) and array.dtype == np.float64 and _still(array):
        return array
    out = np.array(array, dtype=float)
    out.setflags(write=False)
    return out


_UNKNOWN = _frozen(np.nan)


def _plain(value: Any) -> Any:
    return {key: _plain(item) for key, item in value.items()} if isinstance(value, Mapping) else value


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
        Channels; at least one. NaN marks a missing value (unconverged, not recorded).
    u : mapping of str to (N,) array or float
        Standard uncertainty by channel, in its unit; absent or NaN: unknown.
    flags : tuple of tuple of str
        Flags per point; empty: no flags.
    provenance : mapping
        ``source``, ``file``, ``sha256``, ``remark`` and others, if known.
    labels : tuple of str
        Source of each point (``file:row``); empty: none.
    u_by : mapping of str to mapping of str to (N,) array or float
        Parts of ``u`` by origin (:data:`ORIGINS`), then channel, in its unit. Channels without an entry in ``u`` get
        the root sum square of their parts.
    notes : tuple of str
        What was assumed, dropped or averaged.
    units : mapping of str to str
        Unit of channels whose name does not end in a unit, as in the file; "": unknown. :meth:`unit` knows that of
        every channel.
    lines : range or tuple of int
        Line of each point in its file, from 1; empty: unknown.
    texts : mapping of str to tuple of str
        Text columns by name, one entry per point.

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
    u: Mapping[str, Array] = field(default_factory=dict)
    flags: tuple[tuple[str, ...], ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    labels: tuple[str, ...] = ()
    u_by: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    lines: Sequence[int] = ()
    texts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    if TYPE_CHECKING:  # u is made of arrays or numbers, and has arrays

        def __init__(
            self, kind: str, name: str, values: Mapping[str, Any], u: Mapping[str, Any] = ...,
            flags: Iterable[tuple[str, ...]] = ..., provenance: Mapping[str, Any] = ..., labels: Iterable[str] = ...,
            u_by: Mapping[str, Mapping[str, Any]] = ..., notes: Iterable[str] = ..., units: Mapping[str, str] = ...,
            lines: Sequence[int] = ..., texts: Mapping[str, tuple[str, ...]] = ...,
        ) -> None: ...  # fmt: skip

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
                    kept[key] = array if array.shape else np.broadcast_to(array, (n,))
            return kept

        u = checked("u", self.u)
        u_by = {origin: checked(f"u_by.{origin}", parts) for origin, parts in self.u_by.items()}
        for origin in u_by.keys() - set(ORIGINS):
            found.append((f"u_by.{origin}", "an unknown origin", f"one of {', '.join(ORIGINS)}", ""))
        for key in values.keys() - u.keys():
            if each := [part[key] for part in u_by.values() if key in part]:
                u[key] = _frozen(np.sqrt(np.sum(np.square(each), axis=0)))
        refuse(Fault(self.file or self.name, *fault) for fault in found)
        unknown = np.broadcast_to(_UNKNOWN, (n,))
        object.__setattr__(self, "values", MappingProxyType(values))
        object.__setattr__(self, "u", MappingProxyType({key: u.get(key, unknown) for key in values}))
        object.__setattr__(self, "flags", tuple(map(tuple, self.flags)) or ((),) * n)
        object.__setattr__(self, "labels", tuple(self.labels))
        object.__setattr__(self, "provenance", MappingProxyType(dict(self.provenance)))
        by = {origin: MappingProxyType(u_by[origin]) for origin in ORIGINS if u_by.get(origin)}
        object.__setattr__(self, "u_by", MappingProxyType(by))
        object.__setattr__(self, "notes", tuple(self.notes))
        object.__setattr__(self, "units", MappingProxyType({k: v for k, v in self.units.items() if k in values}))
        object.__setattr__(self, "lines", self.lines if isinstance(self.lines, range) else tuple(self.lines))
        object.__setattr__(self, "texts", MappingProxyType({k: tuple(v) for k, v in self.texts.items()}))

    def _head_faults(self, values: Mapping[str, Array], n: int) -> Iterable[tuple[str, str, str, str]]:
        if not _KIND.fullmatch(self.kind):
            yield ("kind", repr(self.kind), f"a lower-case word such as {', '.join(KINDS)}", "")
        if not values:
            yield ("values", "no channels", "one channel or more", "")
        for key, array in values.items():
            if key not in self.units and (fault := channel_fault(key)):
                yield (f"values.{key}", *fault)
            if array.shape != (n,):
                yield (f"values.{key}", f"shape {array.shape}", f"shape ({n},) like the first channel", "")
            elif np.any(np.isinf(array)):
                yield (f"values.{key}", "an infinite value", "finite numbers, or NaN for none", "")
        texts = ((f"texts.{key}", cells) for key, cells in self.texts.items())
        for what, items in (("flags", self.flags), ("labels", self.labels), ("lines", self.lines), *texts):
            if len(items) not in (0, n):
                yield (what, f"{len(items)} entries", f"{n}, one per point", "")

    def __len__(self) -> int:
        """Number of points."""
        return len(next(iter(self.values.values())))

    def __getitem__(self, channel: str) -> Array:
        """One channel, (N,), read-only."""
        if channel not in self.values:
            raise KeyError(_absent(channel, self.values))
        channel_values: Array = self.values[channel]
        return channel_values

    def __contains__(self, channel: object) -> bool:
        """Whether a channel exists."""
        return channel in self.values

    def __iter__(self) -> Iterator[str]:
        """Names of the channels, as `in` and ``[name]`` take them."""
        return iter(self.values)

    def __repr__(self) -> str:
        """One-line summary; to_pandas() shows the numbers."""
        return f"Dataset({self.kind!r}, {self.name!r}, {number_of(len(self), 'point')}: {', '.join(self.values)})"

    def _repr_html_(self) -> str:
        """Show the points in a notebook, with standard uncertainties if known."""
        from bemt.physics.dataset import tables

        return tables.to_html(self)

    @property
    def file(self) -> str:
        """File that it was read from; empty: none."""
        return str(self.provenance.get("file", ""))

    @property
    def format(self) -> str:
        """Id of the reader that read it; empty: none."""
        return str(self.provenance.get("format", ""))

    @property
    def clock(self) -> str:
        """What its rows are counted by, ``time``, ``iteration`` or ``none``; empty: not stated."""
        return str(self.provenance.get("clock", ""))

    @property
    def sha256(self) -> str:
        """Sum of that file; empty: none."""
        return str(self.provenance.get("sha256", ""))

    @property
    def headings(self) -> Mapping[str, str]:
        """Headings of the file by channel, as far as kept."""
        found: Mapping[str, str] = self.provenance.get("headings", {})
        return found

    @property
    def constants(self) -> Mapping[str, float]:
        """Numbers that hold for all rows, such as ``diameter_m``."""
        found: Mapping[str, float] = self.provenance.get("constants", {})
        return found

    @property
    def means(self) -> Mapping[str, Any]:
        """What stands for a channel of a history, by channel (`bemt.data.readers.samples.Mean`)."""
        found: Mapping[str, Any] = self.provenance.get("means", {})
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as plain dictionaries (worker processes send series back)."""
        return partial(type(self), **{f.name: _plain(getattr(self, f.name)) for f in fields(self)}), ()

    @property
    def converged(self) -> NDArray[np.bool_]:
        """Whether all computed channels of each point are finite, (N,).

        Examples
        --------
        >>> Dataset("bemt", "p", {"rpm": [4000.0, 6000.0], "thrust_N": [2.1, math.nan]}).converged
        array([ True, False])
        """
        loads = [v for key, v in self.values.items() if key in ("thrust_N", "torque_Nm", "CT", "CP")]
        return np.asarray(np.all(np.isfinite(loads or list(self.values.values())), axis=0))

    def __getattr__(self, channel: str) -> Array:
        """Access a channel as an attribute, such as ``d.thrust_N``, and its uncertainty as ``d.u_thrust_N``."""
        values, name = self.__dict__.get("values", {}), channel.removeprefix("u_")
        if channel in values or name in values:
            return values[channel] if channel in values else self.u[name]
        raise AttributeError(_absent(channel, values))

    def unit(self, channel: str) -> str:
        """Unit of a channel.

        Parameters
        ----------
        channel : str
            Name of the channel.

        Returns
        -------
        str
            SI suffix, ``rpm``, "-" for dimensionless, or the unit in the file; "" if unknown.

        Examples
        --------
        >>> d = Dataset("table", "t", {"thrust_N": [1.0], "J": [0.1], "x": [2.0]}, units={"x": ""})
        >>> [d.unit(k) for k in d.values]
        ['N', '-', '']
        """
        if channel in self.units:
            return self.units[channel]
        return unit_in(channel)

    @classmethod
    def from_rotor_convention(cls, kind: str, name: str, values: Mapping[str, ArrayLike], **kwargs: Any) -> Dataset:
        """Create a dataset from helicopter coefficients.

        Parameters
        ----------
        kind, name : str
            As for the class.
        values : mapping of str to (N,) array
            Channels; ``CT_rotor`` = T/(rho A (Omega R)^2), ``CP_rotor`` = ``CQ_rotor`` = P/(rho A (Omega R)^3) and
            ``mu_axial`` = V/(Omega R) are converted; others pass unchanged.
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
        """Add every channel that follows from existing ones; none is replaced.

        Parameters
        ----------
        diameter_m : float
            Diameter. [m]
        density_kg_m3 : float or (N,) array or None
            Density [kg/m3], NaN: unknown; None uses the channel ``density_kg_m3`` (without it only J, airspeed, CQ-CP,
            torque-power and eta are derived).

        Returns
        -------
        Dataset
            With thrust_N-CT, torque_Nm-CQ, power_W-CP, CQ-CP, torque_Nm-power_W, airspeed_m_s-J, eta = J CT/CP.

        Raises
        ------
        InputError
            If the diameter or a density is not positive, or the diameter above 10 m.

        Notes
        -----
        Uncertainties are propagated to first order from the measured quantity alone: diameter, density, rpm and
        airspeed count as exact, because their uncertainty belongs to u_input of a comparison (ASME V&V 20), not to
        u_D. For eta, CT and CP are assumed independent. Unknown stays unknown.
        """
        rho = self.values.get("density_kg_m3") if density_kg_m3 is None else np.asarray(density_kg_m3, dtype=float)
        faults = []
        if not 0.0 < diameter_m <= _LARGEST_M:
            hint = "Is that in mm? Divide by 1000" if diameter_m > _LARGEST_M else ""
            faults.append(Fault(self.name, "diameter_m", f"{diameter_m:g}", f"a length up to {_LARGEST_M:g} m", hint))
        if rho is not None and np.any(rho <= 0):
            faults.append(Fault(self.name, "density_kg_m3", "a density that is not positive", "positive numbers", ""))
        refuse(faults)
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
            J, CT, CP = (values[name] for name in ("J", "CT", "CP"))
            values["eta"] = eta = np.asarray(co.eta(J, CT, CP), dtype=float)
            with np.errstate(divide="ignore", invalid="ignore"):
                u_eta = np.hypot(J * u["CT"], eta * u["CP"]) / np.abs(CP)
            u["eta"] = np.where(np.isfinite(u_eta), u_eta, np.nan)
        return replace(self, values=values, u=u)

    @worded
    def select(self, where: ArrayLike | slice | Callable[[Dataset], ArrayLike]) -> Self:
        """Select points.

        Parameters
        ----------
        where : (N,) bool array, int array, slice, or function of the series that gives one
            Points to keep, in this order: ``d.select(d.rpm == 6000)``.

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
            lines=tuple(self.lines[i] for i in index) if self.lines else (),
            texts={key: tuple(cells[i] for i in index) if cells else () for key, cells in self.texts.items()},
        )

    def to_pandas(self) -> pd.DataFrame:
        """Convert to a table.

        Returns
        -------
        pandas.DataFrame
            A column per channel, ``u_<channel>`` if its uncertainty is known for some points, ``u_<origin>_<channel>``
            for its parts, ``flags`` (joined by "; ") of what is solved, else if any; ``attrs`` has kind, name,
            provenance and notes.

        Examples
        --------
        >>> Dataset("bench", "stand", {"rpm": [6000.0], "thrust_N": [10.0]}, {"thrust_N": 0.1}).to_pandas()
              rpm  thrust_N  u_thrust_N
        0  6000.0      10.0         0.1
        """
        from bemt.physics.dataset import tables

        return tables.to_pandas(self)

    def to_xarray(self) -> xr.Dataset:
        """Convert to an xarray dataset over the dimension ``point``.

        Returns
        -------
        xarray.Dataset
            The columns of :meth:`to_pandas` as variables, with ``units`` in their attributes.

        Raises
        ------
        InputError
            If xarray is not installed.

        Examples
        --------
        >>> x = Dataset("bench", "stand", {"rpm": [6000.0], "thrust_N": [10.0]}).to_xarray()
        >>> x["thrust_N"].attrs["units"], x.sizes["point"]
        ('N', 1)
        """
        from bemt.physics.dataset import tables

        return tables.to_xarray(self)

    def plot(self, x: str | None = None, y: Sequence[str] = (), ax: Any = None) -> Any:
        """Plot channels over another one, with bands if uncertainties are known.

        Parameters
        ----------
        x : str, optional
            Channel of the x axis; by default the one of J, airspeed and rpm that varies.
        y : sequence of str
            Channels to plot; CT and CP, or thrust, by default.
        ax : matplotlib axes, optional
            Existing axes to add to (a channel keeps its colour). A new figure by default.

        Returns
        -------
        matplotlib axes
            One line per channel, and per speed of rotation if J or airspeed is on the x axis.

        Raises
        ------
        InputError
            For a missing channel.

        Examples
        --------
        >>> d = Dataset("bench", "stand", {"rpm": [4000.0, 6000.0], "thrust_N": [2.1, 4.7]}, {"thrust_N": 0.1})
        >>> d.plot().get_xlabel()
        'rpm'
        """
        from bemt.physics.dataset import tables

        return tables.plot(self, x, y, ax)

    def to_rows(self) -> list[dict[str, Any]]:
        """Convert to one plain dictionary per point, for JSON.

        Returns
        -------
        list of dict
            ``source`` (the kind), ``name``, one key per channel, ``u`` (per channel), ``flags``, and ``label`` if
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
