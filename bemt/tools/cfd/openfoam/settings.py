"""What decides an OpenFOAM case of a rotor: extents, operating point, domain, grid, models, length of the run."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from bemt.base.errors import Fault, refuse

DOMAINS = ("free", "pipe")
SECTORS = ("half", "blade", "full")
TURBULENCE = ("kOmegaSST", "realizableKE")
GASES = ("isentropic", "perfect")
ZONES = ("grid", "margin")
MACH_COMPRESSIBLE = 0.5
"""Helical tip Mach number above which the compressible solver is taken when nothing is said."""
PIPE_RADIUS = 0.998
"""Radius of the pipe over R: the tip just reaches into the wall, so that there is neither a gap nor a sliver."""


@dataclass(frozen=True)
class Body:
    """Extents of one exported part."""

    # Least and greatest z [m]
    low: float
    high: float
    radius: float  # Greatest radius [m]


@dataclass(frozen=True)
class RunSweep:
    """Where the blades are, for the grid."""

    # z of the blades' lowest and highest point [m]
    low: float
    high: float
    # z of the tip section [m]
    tip_low: float
    tip_high: float
    tip_half_angle: float  # Half of the angle that the tip section takes about the shaft [rad]


def sector_choice(blades: int, sideslip: float = 0.0) -> str:
    """Choose the smallest periodic part: one blade from three up, else half, all of it in oblique flow.

    >>> sector_choice(2), sector_choice(3), sector_choice(2, 0.3), sector_choice(1)
    ('half', 'blade', 'full', 'full')
    """
    if sideslip or blades == 1:
        return "full"
    return "half" if blades == 2 else "blade"


@dataclass(frozen=True)
class Settings:
    """One case."""

    # Tip and hub radius [m]
    R: float
    Rhub: float
    B: int  # Number of blades
    rotation: int  # Sense of rotation about z
    rotor: Body  # Extents of blades and hub
    blades: RunSweep  # Extents of the blades
    rpm: float  # Speed [rev/min]
    # Density [kg/m3], viscosity [Pa s], speed of sound [m/s] and temperature [K] far away
    rho: float
    mu: float
    a_sound: float
    temperature: float
    V: float = 0.0  # Speed of the wind; positive is flight forwards [m/s]
    sideslip: float = 0.0  # Angle between the shaft and the wind, 0 to 90 deg; needs the whole rotor [rad]
    sector: str = "half"  # ``half`` (even blade counts), ``blade`` (three blades or more) or ``full``
    domain: str = "free"  # ``free`` or ``pipe`` (cylinder of the propeller's diameter, frictionless, open at both ends)
    level: float = 6.0  # The cells on the blade are R / 2^(level + 2) wide and all others scale with them [1]
    turbulence: str = "kOmegaSST"  # ``kOmegaSST`` or ``realizableKE``, with wall functions
    compressible: bool = False  # Whether rhoSimpleFoam runs instead of simpleFoam
    gas: str = "isentropic"  # ``isentropic`` (density follows pressure) or ``perfect`` (energy equation; see `flow`)
    # Extents of the duct and of the centre body or stator, when exported
    duct: Body | None = None
    body: Body | None = None
    gap: float = 0.0  # Radial tip clearance in the duct [m]
    plate_z: float | None = None  # Where the face of a round plate behind the rotor lies, negative [m]
    plate_radius: float = 0.0  # Its radius [m]
    pitch: float = 0.0  # Geometric pitch at 0.75 R; 0 when unknown [m]
    # Iterations, and how many of the last are averaged
    iterations: int = 400
    average: int = 100
    ranks: int = 2  # Processes when nothing else is said at run time
    # ``grid``: the rotating zone ends on planes of the base grid, so that both periodic sides are cut alike;
    # ``margin``: wherever a margin of 0.15 R ends, as runs before that rule have it (their grids can be made again)
    zone: str = "grid"
    # Surfaces in ``constant/triSurface``; blade and hub among them
    surfaces: tuple[str, ...] = field(default=("blade", "hub"))

    def __post_init__(self) -> None:
        faults = []

        def check(ok: bool, where: str, got: str, expected: str, hint: str = "") -> None:
            if not ok:
                faults.append(Fault("", where, got, expected, hint))

        check(self.sector in SECTORS, "sector", repr(self.sector), f"one of {', '.join(SECTORS)}")
        check(self.domain in DOMAINS, "domain", repr(self.domain), f"one of {', '.join(DOMAINS)}")
        check(self.turbulence in TURBULENCE, "turbulence", repr(self.turbulence), f"one of {', '.join(TURBULENCE)}")
        check(self.gas in GASES, "gas", repr(self.gas), f"one of {', '.join(GASES)}")
        check(self.zone in ZONES, "zone", repr(self.zone), f"one of {', '.join(ZONES)}")
        check(self.sector != "half" or self.B % 2 == 0, "sector", f"half of {self.B} blades", "an even number",
              "Take blade or full")  # fmt: skip
        check(self.sector != "blade" or self.B >= 3, "sector", f"one of {self.B} blades", "three blades or more",
              "Take half or full")  # fmt: skip
        check(0.0 <= self.sideslip <= math.pi / 2, "sideslip", f"{math.degrees(self.sideslip):g} deg", "0 to 90 deg")
        oblique = self.sideslip > 0
        check(not oblique or self.sector == "full", "sector", f"{self.sector} in oblique flow", "full")
        check(not oblique or self.V > 0, "airspeed", f"{self.V:g} m/s in oblique flow", "a positive speed")
        check(self.V >= 0, "airspeed", f"{self.V:g} m/s", "0 or more", "Backward flight has no inlet here")
        check(4.0 <= self.level <= 9.0, "level", f"{self.level:g}", "4 to 9")
        check(self.iterations >= 20, "iterations", f"{self.iterations}", "20 or more")
        check(1 <= self.average <= self.iterations, "average", f"{self.average}", f"1 to {self.iterations}")
        if self.domain == "pipe":
            odd = [w for w, there in (("duct", self.duct), ("plate", self.plate_z), ("sideslip", oblique)) if there]
            check(not odd, "domain", f"pipe with {', '.join(odd)}", "a rotor alone in axial flow")
        if self.plate_z is not None:
            lowest = min([self.rotor.low, *(b.low for b in (self.duct, self.body) if b is not None)])
            check(self.plate_z < lowest, "plate", f"z = {self.plate_z:g} m", f"behind all else, below {lowest:g} m")
        refuse(faults)

    @property
    def sectors(self) -> int:
        """Equal parts of the whole of which the grid is one."""
        return {"half": 2, "blade": self.B, "full": 1}[self.sector]

    @property
    def omega(self) -> float:
        """Speed about z, signed [rad/s]."""
        return self.rotation * self.rpm * math.pi / 30

    @property
    def tip_mach(self) -> float:
        """Helical tip Mach number [1]."""
        return math.hypot(self.omega * self.R, self.V) / self.a_sound

    @property
    def wind(self) -> tuple[float, float, float]:
        """Velocity far away [m/s]."""
        return (self.V * math.sin(self.sideslip), 0.0, -self.V * math.cos(self.sideslip))

    @property
    def base_cell(self) -> float:
        """Size of the cells that snappyHexMesh halves up to six times [m]."""
        return float(self.R / 4 * 2.0 ** (6.0 - self.level))

    @property
    def pressure(self) -> float:
        """Static pressure far away, of a gas with this density and temperature [Pa]."""
        return self.rho * 287.05 * self.temperature

    @property
    def slipstream(self) -> float:
        """Speed that the start assumes behind the disk [m/s].

        Momentum theory with CT = 0.1; in a duct three quarters of the pitch speed: from a slower start the blades of a
        fan stall and stay so.
        """
        n, D = self.rpm / 60, 2 * self.R
        axial = self.V * math.cos(self.sideslip)
        v = -0.5 * axial + math.sqrt(0.25 * axial**2 + 0.1 * n**2 * D**4 / (2 * math.pi * self.R**2))
        return max(axial + 1.5 * v, 0.75 * n * self.pitch if self.duct is not None else 0.0)

    @property
    def walls(self) -> tuple[str, ...]:
        """Walls that stand still."""
        standing = tuple(name for name in self.surfaces if name not in ("blade", "hub"))
        return (*standing, "plate") if self.plate_z is not None else standing
