"""The contract for effects, and the records that effects change.

An effect is a frozen dataclass with an ``id`` and hooks that are called in a fixed order. The solver calls, once per
rotor: ``blade`` (adds to beta) -> ``inflow`` (scales and adds to Vx, Vy) -> ``section`` (changes cl, cd tables) ->
``momentum`` (sets numbers of the compiled kernel). The model of a recording (:mod:`bemt.physics.bem.model`) calls, once
per set of points: ``flow`` (conditions at the rotor) before the solver, ``loads`` (thrust and torque) and ``reading``
(instrument readings) after it. Hooks that an effect does not define are not called. Each file in this folder that
defines a subclass of :class:`Effect` is found by :func:`bemt.physics.effects.catalogue`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from geometry.airfoil import Airfoil

Array = NDArray[np.float64]

FORM = {0.15: 0.7, 0.45: 0.3}
"""Standard deviation of the form of an effect, share of its size, with its prior weight: published laws of one effect
differ by that, of some by half [1]."""
# Reynolds number that represents blades where the Mach number matters.
RE_FAST = 5e5
# Points further apart than the second show no transient; nothing changes the speed of a rotor within the first [s].
_SHORTEST_STEP, _LONGEST_STEP = 1e-4, 1.0


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect: name, unit and physical range.

    Parameters
    ----------
    name, unit : str
        Field name in the effect and unit ("1" for a pure number).
    low, high : float
        Physical prior range, in the unit of the parameter.
    source : str
        Source of range and default.
    steps : int
        Number of values at which a diagnosis solves (it interpolates between them); 0: it keeps the default [1].
    off : float, optional
        Value at which the effect vanishes; an effect with several such parameters vanishes if all have this value.
        In the unit of the parameter.
    usual : float, optional
        Typical size, if the range extends far beyond it; None: all values are equally likely (unit of the parameter).
    """

    name: str
    unit: str
    low: float
    high: float
    source: str
    steps: int = 5
    off: float | None = None
    usual: float | None = None

    def density(self, value: float) -> float:
        """Unnormalised prior density of a value: uniform over the range, or heavy-tailed around "off".

        Student's t with three degrees of freedom: most faults have the typical size, some are many times larger.
        """
        if self.usual is None or self.off is None:
            return 1.0
        return float((1.0 + ((value - self.off) / self.usual) ** 2 / 3.0) ** -2)


@dataclass(slots=True)
class KernelNumbers:
    """Numbers that effects may set for the compiled kernel; any other name is an error.

    Attributes
    ----------
    tip, hub : float
        Factors on the exponents of the tip and hub losses; 0: no loss [1].
    far_wake : float
        1: the vortex sheets of the tip loss follow the far-wake helix, 0: the helix at the disk [1].
    swirl : float
        1: swirl is part of the momentum balance, 0: it is neglected [1].
    bridge : float
        1: an empirical curve where momentum theory fails, 0: momentum theory everywhere [1].
    gap_share : float
        Ducted rotor: share of the open tip loss, 0 (sealed) to 1 [1].
    gap_loss : float
        Ducted rotor: share of the blade force lost through the gap [1].
    lip_loss : float
        Ducted rotor: what the lip loses besides what the duct says, over 1/2 rho (w - V)^2 [1].
    cone : float
        Coning angle of blades on flapping hinges, NaN: stiff blades [rad].
    """

    tip: float = 0.0
    hub: float = 0.0
    far_wake: float = 0.0
    swirl: float = 0.0
    bridge: float = 0.0
    gap_share: float = 0.0
    gap_loss: float = 0.0
    lip_loss: float = 0.0
    cone: float = float("nan")


@dataclass(slots=True)
class RotorBuild:
    """Mutable record of one rotor while its effects are applied.

    Attributes
    ----------
    r, dr, chord, beta, sigma : (N,) float
        Stations: radius, width, chord [m], blade angle [rad], local solidity [1].
    R, Rhub : float
        Tip and hub radius [m].
    B : int
        Blade count.
    alpha : (Na,) float
        Angle of attack grid [rad].
    Re : (Nr,) float
        Reynolds grid [1].
    M2 : (Nm,) float
        Grid of the squared Mach number [1].
    cl, cd : (N, Nm or 1, Nr, Na) float
        Section tables; one Mach number unless an effect depends on it (:meth:`scale_lift`, :meth:`add_drag`) [1].
    mach_lift, mach_drag : (N, Nm, 1, Na) float or None
        Factor on cl and addition to cd that are kept separate from the tables; None: they are in the tables [1].
    alpha0, cla : (N, Nr) float
        Zero-lift angle [rad] and lift slope [1/rad] of the incompressible table.
    num : KernelNumbers
        Numbers for the kernel.
    Vx_factor, Vy_factor : (N,) float
        Factors on the axial and tangential onset speed of every point [1].
    Vx_add, Vy_add : (N,) float
        Increments that are then added to them [m/s].
    thickness : (N,) float
        Maximum thickness over chord [1].
    own_mach : (N,) float
        Share of the station's table that already depends on Mach number, 0 to 1 [1].
    gap : float
        Tip gap of a ducted rotor [m], NaN for an open one.
    ducted : bool
        Whether there is a duct.
    level : float
        Strength of an effect that varies from point to point, see :meth:`Effect.share`; the effect that uses it
        resets it to 1 [1].
    sections : tuple of (float, geometry.airfoil.Airfoil)
        Section shapes at r/R, ascending; empty if unknown.
    """

    r: Array
    dr: Array
    chord: Array
    beta: Array
    sigma: Array
    R: float
    Rhub: float
    B: int
    alpha: Array
    Re: Array
    M2: Array
    cl: Array
    cd: Array
    alpha0: Array
    cla: Array
    Vx_factor: Array
    Vy_factor: Array
    Vx_add: Array
    Vy_add: Array
    thickness: Array
    own_mach: Array
    gap: float = float("nan")
    ducted: bool = False
    level: float = 1.0
    sections: tuple[tuple[float, Airfoil], ...] = ()
    num: KernelNumbers = field(default_factory=KernelNumbers)
    mach_lift: Array | None = None
    mach_drag: Array | None = None

    def scale_lift(self, factor: Array) -> None:
        """Multiply cl by a factor that may depend on Mach number, (N or 1, Nm or 1, Nr or 1, Na or 1) [1]."""
        if self._apart(factor):
            self.mach_lift = factor if self.mach_lift is None else self.mach_lift * factor
        else:
            self.cl *= factor

    def add_drag(self, drag: Array) -> None:
        """Add to cd a value that may depend on Mach number, (N or 1, Nm or 1, Nr or 1, Na or 1) [1]."""
        if self._apart(drag):
            self.mach_drag = drag if self.mach_drag is None else self.mach_drag + drag
        else:
            self.cd += drag

    def spread(self) -> None:
        """Expand the tables over all Mach numbers, for effects that change them in another way."""
        shape = (self.cl.shape[0], self.M2.size, *self.cl.shape[2:])
        if self.cl.shape != shape:
            self.cl = np.multiply(self.cl, 1.0 if self.mach_lift is None else self.mach_lift, out=np.empty(shape))
            self.cd = np.add(self.cd, 0.0 if self.mach_drag is None else self.mach_drag, out=np.empty(shape))
        self.mach_lift = self.mach_drag = None

    @property
    def mach_apart(self) -> bool:
        """Whether changes over Mach number are kept separate from the tables."""
        return self.mach_lift is not None or self.mach_drag is not None

    def _apart(self, values: Array) -> bool:
        """Whether the change depends on Mach but not on Reynolds number, and the tables have no Mach axis yet."""
        if self.cl.shape[1] == self.M2.size:
            return False
        if values.shape[2] > 1:
            self.spread()
            return False
        return True

    @property
    def fast(self) -> slice:
        """The Reynolds number nearest to RE_FAST."""
        i = int(np.argmin(np.abs(np.log(self.Re / RE_FAST))))
        return slice(i, i + 1)

    @property
    def alpha_col(self) -> Array:
        """Angle grid shaped to broadcast against the tables, (1, 1, 1, Na) [rad]."""
        return self.alpha[None, None, None, :]


def follows(time_s: Array) -> NDArray[np.bool_]:
    """Whether each point but the first follows the one before closely: by 0.1 ms to 1 s.

    Points that are means of others may share one time but for rounding.

    Parameters
    ----------
    time_s : (P,) float
        Times in order [s].

    Returns
    -------
    (P-1,) bool

    Examples
    --------
    >>> follows(np.array([0.0, 0.1, 0.1, 9.0])).tolist()
    [True, False, False]
    """
    step = np.diff(time_s)
    return np.asarray((step > _SHORTEST_STEP) & (step < _LONGEST_STEP))


@dataclass
class Flow:
    """Conditions at the rotor for P points of a recording; the hook ``flow`` changes them before the solver runs.

    Attributes
    ----------
    rpm, V, rho, mu, a_sound : (P,) float
        Speed of rotation [rev/min], axial onset speed [m/s], density [kg/m3], viscosity [Pa s], speed of sound [m/s].
    R, Rhub, chord : float
        Tip radius, hub radius, chord at 0.75 R [m].
    B : int
        Blade count.
    ducted : bool
        Whether the model has a duct.
    T0, Q0 : (P,) float
        Thrust [N] and torque [N m] of the baseline at the recorded conditions.
    dT_dV, dQ_dV : (P,) float
        Their slopes with the axial onset speed [N s/m], [N s].
    extra : mapping of str to (P,) float
        Other channels of the recording, SI by name: time_s, temperature_K, pressure_Pa, voltage_V, current_A, pwm_s,
        tip_gap_m, wall_distance_m, sideslip_rad, second_rotor_rad_s, run.  Absent: not recorded. usual_voltage_V is
        that of the known speed at each pulse width.
    side : (P,) float or None
        In-plane onset speed [m/s]; None where there is none.
    """

    rpm: Array
    V: Array
    rho: Array
    mu: Array
    a_sound: Array
    R: float
    Rhub: float
    chord: float
    B: int
    ducted: bool
    T0: Array
    Q0: Array
    dT_dV: Array
    dQ_dV: Array
    extra: Mapping[str, Array] = field(default_factory=dict)
    side: Array | None = None

    @property
    def n(self) -> Array:
        """Revolutions per second, (P,) [1/s]."""
        return self.rpm / 60.0

    @property
    def omega(self) -> Array:
        """Angular speed, (P,) [rad/s]."""
        return self.rpm * (math.pi / 30.0)

    @property
    def J(self) -> Array:
        """Advance ratio, (P,) [1]."""
        return self.V / (self.n * 2.0 * self.R)

    @property
    def M_tip(self) -> Array:
        """Rotational tip Mach number, (P,) [1]."""
        return self.omega * self.R / self.a_sound

    @property
    def warming(self) -> Array:
        """Temperature rise since the start of the run, (P,), zero if not recorded [K]."""
        if "temperature_K" not in self.extra:
            return np.zeros_like(self.rpm)
        T = self.extra["temperature_K"]
        start = np.full_like(self.rpm, T[0])
        for run in self.runs:
            start[run] = T[run[0]]
        return np.nan_to_num(T - start)

    @property
    def area(self) -> float:
        """Disk area [m2]."""
        return math.pi * self.R**2

    @property
    def time_s(self) -> Array:
        """Time of each point, (P,), where it is recorded [s]."""
        return self.extra["time_s"]

    @property
    def runs(self) -> list[NDArray[np.intp]]:
        """Points of each run (one run if runs are not recorded) in order of time; [] without time_s."""
        if "time_s" not in self.extra:
            return []
        t = self.time_s
        label = self.extra.get("run", np.zeros_like(t))
        members = (np.flatnonzero((label == name) & np.isfinite(t)) for name in np.unique(label[np.isfinite(label)]))
        return [m[np.argsort(t[m], kind="stable")] for m in members if m.size]

    @property
    def transients(self) -> list[NDArray[np.intp]]:
        """Those of the runs whose points mostly follow each other closely enough to show how loads follow the speed."""
        return [run for run in self.runs if 2 * np.sum(follows(self.time_s[run])) >= run.size]

    @property
    def clock(self) -> Array:
        """Time since the first point of the run, (P,), zero if not recorded [s]."""
        t = np.zeros_like(self.rpm)
        for run in self.runs:
            t[run] = self.time_s[run] - self.time_s[run[0]]
        return t

    @property
    def induced(self) -> Array:
        """Induced speed of the baseline's thrust by momentum theory, (P,) [m/s]."""
        return induced_speed(self.T0, self.V, self.rho * self.area)


def induced_speed(T: Array, V: Array, rho_A: Array) -> Array:
    """Induced speed of a thrust by momentum theory of the open disk.

    Parameters
    ----------
    T, V, rho_A : (P,) float
        Thrust [N], axial onset speed [m/s], density times disk area [kg/m].

    Returns
    -------
    (P,) float
        v = sqrt(V^2/4 + T/(2 rho A)) - V/2 (Glauert 1935, eq. VII 2.3), zero unless the thrust is positive [m/s].
    """
    half = 0.5 * np.abs(V)
    return np.asarray(np.sqrt(half**2 + np.maximum(T, 0.0) / (2.0 * rho_A)) - half)


@dataclass
class Loads:
    """Thrust and torque of the rotor at P points; the hook ``loads`` changes them.

    Attributes
    ----------
    T, Q : (P,) float
        Thrust (total thrust with a duct) [N]; shaft torque [N m].
    T_duct : (P,) float
        Thrust of the duct, zero without one [N].
    """

    T: Array
    Q: Array
    T_duct: Array


@dataclass
class Reading:
    """Instrument readings at P points; the hook ``reading`` changes them.

    Attributes
    ----------
    values : dict of str to (P,) float
        Channels: thrust_N and torque_Nm; also ``rpm`` if the recording has a pulse width.
    full_scale : mapping of str to float
        Largest magnitude of each channel in the baseline, for errors given as a share of full scale.
    """

    values: dict[str, Array]
    full_scale: Mapping[str, float]


class Effect:
    """Base class of all effects; subclasses are frozen dataclasses whose fields are the parameters."""

    id: ClassVar[str] = ""
    title: ClassVar[str] = ""
    # Signature: where it shows and what distinguishes it from other effects.
    sign: ClassVar[str] = ""
    # "air" (the flow), "stand" (instruments and records) or "drive" (motor, battery).
    kind: ClassVar[str] = "air"
    # What is wrong with an instrument ("gain", "zero", "drift", "unit", ...) and the channel that it gives; "" where
    # the setting says which, or where nothing is wrong with one.
    fault: ClassVar[str] = ""
    sensor: ClassVar[str] = ""
    # Covariates along which it shows first, of those that a diagnosis knows (J, rpm, Re, M_tip, time_s, ...).
    along: ClassVar[tuple[str, ...]] = ()
    # Effect whose law it is, at another size than stated.
    law: ClassVar[str] = ""
    # Whether only a change of speed shows it: not steady points.
    transient: ClassVar[bool] = False
    # Law of a flow without friction and compressibility: by similarity (Buckingham 1914) its dimensionless form may
    # depend on the advance ratio and on `along`, not on speed or density.
    inviscid: ClassVar[bool] = False
    # It only changes the shape of the blade or the direction of the flow; the solver itself works out the rest.
    geometric: ClassVar[bool] = False
    # Anyone at the stand would see it.
    evident: ClassVar[bool] = False
    # A wrongly recorded number: its effect follows from the definition, so the law cannot be off.
    exact: ClassVar[bool] = False
    # Its share of torque is not known from that of thrust: codes and ducts differ in it, even in its sign.
    torque_open: ClassVar[bool] = False
    # How to check it without a run, and the time that this takes at a stand, declared [min].
    check: ClassVar[str] = ""
    check_minutes: ClassVar[float] = 10.0
    # Whether that check is one of a room: no tunnel can do it.
    check_in_room: ClassVar[bool] = False
    # Parameters with a few discrete values (such as a ratio of units).
    discrete: ClassVar[tuple[str, ...]] = ()
    # Names in Flow.extra that are required to see it; whether airspeed is, or a duct; why it is not in one.
    needs: ClassVar[tuple[str, ...]] = ()
    flies: ClassVar[bool] = False
    needs_duct: ClassVar[bool] = False
    in_duct: ClassVar[str] = ""
    # Whether a diagnosis may name it.
    diagnosed: ClassVar[bool] = True
    # Words that a parameter of text may have.
    words: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    # Values of each parameter of which a diagnosis tries every combination, instead of the ranges.
    tried: ClassVar[Mapping[str, tuple[Any, ...]]] = {}
    # Position among the section hooks: polars first (10), rotation (20), cascade (30), compressibility (40).
    order: ClassVar[int] = 50
    # Whether its tables need a Mach axis.
    uses_mach: ClassVar[bool] = False
    on_by_default: ClassVar[bool] = True

    def __init_subclass__(cls) -> None:
        """Refuse a parameter that would hide a hook; an effect without notes inherits those of its base class."""
        if "    Notes\n" not in (cls.__doc__ or ""):
            notes = next((n for b in cls.__mro__[1:] if (n := (b.__doc__ or "").partition("    Notes\n")[2])), "")
            cls.__doc__ = (cls.__doc__ or "") + (f"\n\n    Notes\n{notes}" if notes else "")
        hidden = sorted(
            set(cls.__dict__.get("__annotations__", {})) & {n for n, v in vars(Effect).items() if callable(v)}
        )
        if hidden:
            raise TypeError(
                f"{cls.__name__}: parameter {', '.join(hidden)} has the name of a hook; choose another name"
            )

    def __post_init__(self) -> None:
        """Refuse unknown words."""
        for name, lawful in self.words.items():
            if (value := getattr(self, name)) not in lawful:
                raise ValueError(f"{name}={value!r}; expected {', '.join(lawful)}")

    def blade(self, bake: RotorBuild) -> None:
        """Change blade angles; does nothing by default."""

    def inflow(self, bake: RotorBuild) -> None:
        """Change the onset speeds of the stations; does nothing by default."""

    def section(self, bake: RotorBuild) -> None:
        """Change section tables; does nothing by default."""

    def momentum(self, bake: RotorBuild) -> None:
        """Set kernel numbers; does nothing by default."""

    def duct(self, R: float, stated: bool) -> Mapping[str, float] | None:
        """Numbers of :class:`bemt.physics.bem.duct.DuctFlow` that the effect sets, None for no duct.

        Only effects with a duct of their own have this hook; the others leave that of the case.

        Parameters
        ----------
        R : float
            Tip radius [m].
        stated : bool
            Whether the case itself has a duct.

        Returns
        -------
        mapping or None
            Attributes by name, in their units.
        """
        return None

    def flow(self, flow: Flow) -> None:
        """Change the conditions at the rotor; does nothing by default."""

    def loads(self, loads: Loads, flow: Flow) -> None:
        """Change thrust and torque; does nothing by default.

        Parameters
        ----------
        loads : Loads
            Thrust and torque, changed in place.
        flow : Flow
            Conditions at the rotor.
        """

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Change instrument readings; does nothing by default.

        Parameters
        ----------
        reading : Reading
            Instrument readings, changed in place.
        flow : Flow
            Conditions at the rotor.
        """

    def share(self, flow: Flow) -> Array | None:
        """Strength at each point, (P,) from 0 to 1: the ``level`` of the solver hooks; None: 1 everywhere [1]."""
        return None

    def solved(self) -> Effect:
        """Effect whose solver hooks stand for this one's: `share` and `loads` tell the rest; itself by default."""
        return self

    def applies(self, flow: Flow) -> str:
        """Reason why the effect cannot be present in a recording, "" if it can."""
        missing = [name for name in self.needs if name not in flow.extra]
        if missing:
            return f"the recording has no {', '.join(missing)}"
        if flow.ducted and self.in_duct:
            return self.in_duct
        if self.needs_duct and not flow.ducted:
            return "the rotor has no duct"
        return "no point has airspeed" if self.flies and not np.any(flow.V > 0.0) else ""

    def variants(self) -> tuple[dict[str, Any], ...] | None:
        """Settings that a diagnosis tries instead of the ranges of ``parameters``; None: use the ranges."""
        if not self.tried:
            return None
        return tuple(dict(zip(self.tried, values, strict=True)) for values in product(*self.tried.values()))

    def settings(self, flow: Flow) -> tuple[dict[str, Any], ...] | None:
        """Those that it tries at these points: `variants` by default."""
        return self.variants()

    def odds(self) -> float:
        """Prior odds of this setting among those of `variants`, over those of the commonest; 1 by default. [1]"""
        return 1.0

    def plausible(self, flow: Flow) -> bool:
        """Whether such an effect is physically plausible at these points; True by default."""
        return True

    def describe(self) -> dict[str, Any]:
        """Id and every field, for provenance."""
        return {"id": self.id, **{k: v for k, v in vars(self).items() if not k.startswith("_")}}
