"""What an effect is, and the working record that effects change.

An effect is a frozen dataclass with an ``id`` and hooks that the solver calls in a fixed order:
``blade`` (adds to beta) -> ``inflow`` (adds to the onset speeds) -> ``section`` (changes cl, cd tables) ->
``momentum`` (sets the few numbers of the compiled kernel).  A hook that an effect does not have is not called.
Each file of this folder that defines a subclass of :class:`Effect` is found by :func:`bemt.effects.catalogue`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

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
    """

    name: str
    unit: str
    low: float
    high: float
    source: str


@dataclass
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
    cl, cd : (N, Nm, Nr, Na) float
        Section tables [1].
    alpha0, cla : (N, Nr) float
        Zero-lift angle [rad] and lift slope [1/rad] of the incompressible table.
    num : dict
        Numbers for the kernel (see :mod:`bemt.solver`).
    onset : (N, 2) float
        Added axial and tangential speed [m/s].
    thickness : (N,) float
        Largest thickness over chord [1].
    own_mach : (N,) float
        Share of the station's table that brings its own Mach dependence, 0 to 1 [1].
    gap : float
        Tip gap of a ducted rotor [m], NaN for an open one.
    ducted : bool
        Whether there is a duct.
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
    onset: Array
    thickness: Array
    own_mach: Array
    gap: float = float("nan")
    ducted: bool = False
    num: dict[str, float] = field(default_factory=dict)

    @property
    def fast(self) -> slice:
        """The one Reynolds number, nearest to 5e5, that stands for the blades whose Mach number matters."""
        i = int(np.argmin(np.abs(np.log(self.Re / 5e5))))
        return slice(i, i + 1)

    @property
    def alpha_col(self) -> Array:
        """Angle grid shaped to broadcast against the tables, (1, 1, 1, Na) [rad]."""
        return self.alpha[None, None, None, :]


class Effect:
    """Base of all effects; subclasses are frozen dataclasses whose fields are the parameters."""

    id: ClassVar[str] = ""
    title: ClassVar[str] = ""
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    # Position among the section hooks: polars first (10), rotation (20), cascade (30), compressibility (40).
    order: ClassVar[int] = 50
    # Whether its tables need a Mach axis.
    uses_mach: ClassVar[bool] = False
    on_by_default: ClassVar[bool] = True

    def blade(self, bake: Baking) -> None:
        """Change blade angles; the base does nothing."""

    def inflow(self, bake: Baking) -> None:
        """Add onset speeds; the base does nothing."""

    def section(self, bake: Baking) -> None:
        """Change section tables; the base does nothing."""

    def momentum(self, bake: Baking) -> None:
        """Set kernel numbers; the base does nothing."""

    def describe(self) -> dict[str, Any]:
        """Id and every field, for provenance."""
        return {"id": self.id, **{k: v for k, v in vars(self).items() if not k.startswith("_")}}
