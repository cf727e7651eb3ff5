"""What an effect is, and the working records that effects change.

An effect is a frozen dataclass with an ``id`` and hooks that are called in a fixed order.  The solver calls, once per
rotor: ``blade`` (adds to beta) -> ``inflow`` (scales and adds to Vx, Vy) -> ``section`` (changes cl, cd tables) ->
``momentum`` (sets the few numbers of the compiled kernel).  The model of a recording (:mod:`bemt.bem.model`) calls,
once per set of points: ``flow`` (what the rotor meets) before the solver, ``loads`` (thrust and torque) and ``reading``
(what the instruments show) after it.  A hook that an effect does not have is not called.
Each file of this folder that defines a subclass of :class:`Effect` is found by :func:`bemt.effects.catalogue`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from geometry.airfoil import Airfoil

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """A number of an effect: what it is called, its unit and the physical range it may take.

    Parameters
    ----------
    name, unit : str
        Field name in the effect and unit ("1" for a pure number).
    low, high : float
        Physical prior range, in the unit of the parameter.
    source : str
        Where range and default come from.
    steps : int
        Values of the range at which a diagnosis solves (it interpolates between them); 0: it leaves the default [1].
    off : float, optional
        Value at which nothing is changed; an effect with several such parameters is nothing at all of them together,
        in the unit of the parameter.
    usual : float, optional
        Size that is usual, where the range goes far beyond it; None: all values are alike (unit of the parameter).
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
        """Prior density of a value, of any scale: the same over the range, or heavy-tailed about "off".

        Student's t with three degrees of freedom: most faults are of the usual size, some are many times that.
        """
        if self.usual is None or self.off is None:
            return 1.0
        return float((1.0 + ((value - self.off) / self.usual) ** 2 / 3.0) ** -2)


def choice(name: str, value: str, lawful: tuple[str, ...]) -> None:
    """Refuse a word that a field of an effect does not know.

    Parameters
    ----------
    name, value : str
        Field and what it got.
    lawful : tuple of str
        What it knows.

    Raises
    ------
    ValueError
        If the word is another one.
    """
    if value not in lawful:
        raise ValueError(f"{name}={value!r}; expected {', '.join(lawful)}")


@dataclass(slots=True)
class KernelNumbers:
    """The numbers that effects may set for the compiled kernel; a name that is not here is an error.

    Attributes
    ----------
    tip, hub : float
        Factors on the exponents of the tip and hub losses; 0: no loss [1].
    far_wake : float
        1: the sheets of the tip loss follow the helix of the far wake, 0: that at the disk [1].
    swirl : float
        1: the swirl is taken up by the momentum balance, 0: it is left out [1].
    bridge : float
        1: an empirical curve where momentum theory fails, 0: momentum theory throughout [1].
    gap_share : float
        Ducted rotor: share of the open tip's loss, 0 sealed to 1 [1].
    gap_loss : float
        Ducted rotor: share of the blade force lost through the gap [1].
    """

    tip: float = 0.0
    hub: float = 0.0
    far_wake: float = 0.0
    swirl: float = 0.0
    bridge: float = 0.0
    gap_share: float = 0.0
    gap_loss: float = 0.0


@dataclass(slots=True)
class Baking:
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
        Section tables; one Mach number until an effect tells them apart (:meth:`scale_lift`, :meth:`add_drag`) [1].
    mach_lift, mach_drag : (N, Nm, 1, Na) float or None
        Factor on cl and addition to cd that are kept apart from the tables; None: they are in them [1].
    alpha0, cla : (N, Nr) float
        Zero-lift angle [rad] and lift slope [1/rad] of the incompressible table.
    num : KernelNumbers
        Numbers for the kernel.
    Vx_factor, Vy_factor : (N,) float
        Factors on the axial and tangential onset speed of every point [1].
    Vx_add, Vy_add : (N,) float
        What is added to them then [m/s].
    thickness : (N,) float
        Largest thickness over chord [1].
    own_mach : (N,) float
        Share of the station's table that brings its own Mach dependence, 0 to 1 [1].
    gap : float
        Tip gap of a ducted rotor [m], NaN for an open one.
    ducted : bool
        Whether there is a duct.
    level : float
        Share of an effect whose size differs from point to point, see :meth:`Effect.share`; the effect that uses it
        sets it back to 1 [1].
    sections : tuple of (float, geometry.airfoil.Airfoil)
        Shapes at r/R, ascending; empty where they are not known.
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
        """Add to cd what may depend on Mach number, (N or 1, Nm or 1, Nr or 1, Na or 1) [1]."""
        if self._apart(drag):
            self.mach_drag = drag if self.mach_drag is None else self.mach_drag + drag
        else:
            self.cd += drag

    def spread(self) -> None:
        """Write out the tables over every Mach number, for effects that change them in another way."""
        shape = (self.cl.shape[0], self.M2.size, *self.cl.shape[2:])
        if self.cl.shape != shape:
            self.cl = np.multiply(self.cl, 1.0 if self.mach_lift is None else self.mach_lift, out=np.empty(shape))
            self.cd = np.add(self.cd, 0.0 if self.mach_drag is None else self.mach_drag, out=np.empty(shape))
        self.mach_lift = self.mach_drag = None

    @property
    def mach_apart(self) -> bool:
        """Whether changes of Mach number wait beside the tables."""
        return self.mach_lift is not None or self.mach_drag is not None

    def _apart(self, values: Array) -> bool:
        """Whether the change is of Mach number and not of Reynolds number, and the tables know neither."""
        if self.cl.shape[1] == self.M2.size:
            return False
        if values.shape[2] > 1:
            self.spread()
            return False
        return True

    @property
    def fast(self) -> slice:
        """The one Reynolds number, nearest to 5e5, that stands for the blades whose Mach number matters."""
        i = int(np.argmin(np.abs(np.log(self.Re / 5e5))))
        return slice(i, i + 1)

    @property
    def alpha_col(self) -> Array:
        """Angle grid shaped to broadcast against the tables, (1, 1, 1, Na) [rad]."""
        return self.alpha[None, None, None, :]


@dataclass
class Flow:
    """What the rotor meets at P points of a recording; the hook ``flow`` changes it before the solver runs.

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
        What else the recording carries, SI by name: time_s, temperature_K, pressure_Pa, voltage_V, current_A, pwm_s,
        tip_gap_m, wall_distance_m, sideslip_rad, run.  Absent: not recorded.
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
        """Temperature less that at the start of the run, (P,), zero where it is not recorded [K]."""
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
    def runs(self) -> list[NDArray[np.intp]]:
        """Points of each run (of the only one, if runs are not recorded) in the order of time; [] without time_s."""
        if "time_s" not in self.extra:
            return []
        t = self.extra["time_s"]
        label = self.extra.get("run", np.zeros_like(t))
        members = (np.flatnonzero((label == name) & np.isfinite(t)) for name in np.unique(label[np.isfinite(label)]))
        return [m[np.argsort(t[m], kind="stable")] for m in members if m.size]

    @property
    def clock(self) -> Array:
        """Time since the first point of the run, (P,), zero where it is not recorded [s]."""
        t = np.zeros_like(self.rpm)
        for run in self.runs:
            t[run] = self.extra["time_s"][run] - self.extra["time_s"][run[0]]
        return t

    @property
    def induced(self) -> Array:
        """Induced speed of the baseline's thrust by momentum theory of the open disk, (P,) [m/s].

        v = sqrt(V^2/4 + T/(2 rho A)) - V/2 (Glauert 1935, eq. VII 2.3), zero for a thrust that is not positive.
        """
        load = np.maximum(self.T0, 0.0) / (2.0 * self.rho * self.area)
        half = 0.5 * np.abs(self.V)
        return np.asarray(np.sqrt(half**2 + load) - half)


@dataclass
class Loads:
    """Thrust and torque of the rotor at P points; the hook ``loads`` changes them.

    Attributes
    ----------
    T, Q : (P,) float
        Thrust, with a duct the total [N]; shaft torque [N m].
    T_duct : (P,) float
        Thrust of the duct, zero without one [N].
    """

    T: Array
    Q: Array
    T_duct: Array


@dataclass
class Reading:
    """What the instruments show at P points; the hook ``reading`` changes it.

    Attributes
    ----------
    values : dict of str to (P,) float
        Channels: thrust_N and torque_Nm; also ``rpm`` where the recording has a pulse width to set it by.
    full_scale : mapping of str to float
        Largest magnitude of each channel over the baseline, for errors stated as a share of full scale.
    """

    values: dict[str, Array]
    full_scale: Mapping[str, float]


class Effect:
    """Base of all effects; subclasses are frozen dataclasses whose fields are the parameters."""

    id: ClassVar[str] = ""
    title: ClassVar[str] = ""
    # What an engineer would say of it: where it shows and why it cannot be something else.
    sign: ClassVar[str] = ""
    # "air" (the flow), "stand" (instruments and what was written down) or "drive" (motor, battery).
    kind: ClassVar[str] = "air"
    # What is wrong with an instrument ("gain", "zero", "drift", "unit", ...) and the channel that it gives; "" where
    # the setting says which, or where nothing is wrong with one.
    fault: ClassVar[str] = ""
    sensor: ClassVar[str] = ""
    # Covariates along which it shows first, of those that a diagnosis knows (J, rpm, Re, M_tip, time_s, ...).
    along: ClassVar[tuple[str, ...]] = ()
    # Law of a flow without friction and compressibility: by similarity (Buckingham 1914) its dimensionless form may
    # depend on the advance ratio and on `along`, not on speed or density.
    inviscid: ClassVar[bool] = False
    # Something that anybody at the stand would see.
    evident: ClassVar[bool] = False
    # A number that was written down wrongly: what it changes follows from the definition, and no law can be off.
    exact: ClassVar[bool] = False
    # What one would look at to be sure, without a run.
    check: ClassVar[str] = ""
    # Parameters that take a few values only (a ratio of units), nothing between them.
    discrete: ClassVar[tuple[str, ...]] = ()
    # Names in Flow.extra without which it cannot be seen.
    needs: ClassVar[tuple[str, ...]] = ()
    # Whether a diagnosis may name it.
    diagnosed: ClassVar[bool] = True
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    # Position among the section hooks: polars first (10), rotation (20), cascade (30), compressibility (40).
    order: ClassVar[int] = 50
    # Whether its tables need a Mach axis.
    uses_mach: ClassVar[bool] = False
    on_by_default: ClassVar[bool] = True

    def __init_subclass__(cls) -> None:
        """Refuse a parameter that would hide a hook; an effect without notes has those of the one it comes from."""
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

    def blade(self, bake: Baking) -> None:
        """Change blade angles; the base does nothing."""

    def inflow(self, bake: Baking) -> None:
        """Scale and add to the onset speeds of the stations; the base does nothing."""

    def section(self, bake: Baking) -> None:
        """Change section tables; the base does nothing."""

    def momentum(self, bake: Baking) -> None:
        """Set kernel numbers; the base does nothing."""

    def duct(self, R: float, stated: bool) -> Mapping[str, float] | None:
        """Numbers of :class:`bemt.bem.duct.DuctFlow` that the effect sets, which ducts an open rotor; None: none.

        Parameters
        ----------
        R : float
            Tip radius [m].
        stated : bool
            Whether the case has a duct of its own.

        Returns
        -------
        mapping or None
            Attributes by name, in their units.
        """
        return None

    def flow(self, flow: Flow) -> None:
        """Change what the rotor meets; the base does nothing."""

    def loads(self, loads: Loads, flow: Flow) -> None:
        """Change thrust and torque; the base does nothing.

        Parameters
        ----------
        loads : Loads
            Thrust and torque, changed in place.
        flow : Flow
            What the rotor meets.
        """

    def reading(self, reading: Reading, flow: Flow) -> None:
        """Change what instruments show; the base does nothing.

        Parameters
        ----------
        reading : Reading
            What instruments show, changed in place.
        flow : Flow
            What the rotor meets.
        """

    def share(self, flow: Flow) -> Array | None:
        """Size of the effect at each point of a recording for effects of the solver that differ between points.

        Parameters
        ----------
        flow : Flow
            The points.

        Returns
        -------
        (P,) float or None
            Between 0 and 1, the ``level`` at which the hooks of the solver shall act; None: 1 everywhere [1].
        """
        return None

    def applies(self, flow: Flow) -> str:
        """Reason why the effect cannot be at work in a recording, "" when it can.

        Parameters
        ----------
        flow : Flow
            The points.

        Returns
        -------
        str
            Reason in words.
        """
        missing = [name for name in self.needs if name not in flow.extra]
        return f"the recording has no {', '.join(missing)}" if missing else ""

    def variants(self) -> tuple[dict[str, Any], ...] | None:
        """Discrete settings that a diagnosis tries instead of the ranges of ``parameters``; None: the ranges."""
        return None

    def plausible(self, flow: Flow) -> bool:
        """Whether the world has such a thing at these points, however the effect came about; the base says yes."""
        return True

    def describe(self) -> dict[str, Any]:
        """Id and every field, for provenance."""
        return {"id": self.id, **{k: v for k, v in vars(self).items() if not k.startswith("_")}}
