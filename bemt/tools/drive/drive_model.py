r"""Battery, ESC, motor and rotor: what a pulse width gives, steady.

The motor is a direct-current machine at the duty d of the ESC, k = 60/(2 pi K_v):

    I = (d V_b - k Omega) / (R + X^2/R),   V_b = V_oc(SoC) - R_b (d I + I_e),   k (I - I_0) = Q(Omega)

R = R_m + R_e, with the ESC's own current I_e and the copper's R_m and the magnets' k at the winding's temperature
(coefficients of `bemt.physics.effects.motor_heating`, so that model and diagnosis agree). X = p L Omega is the
reactance of the winding, which turns the current away from the EMF: at d = 0 this is the brake of a motor with shorted
terminals, strongest at X = R and softer above. Firmware sets for which share of the time it shorts them at no throttle
(`brake_on_stop`); at any throttle above it brakes fully. Above the current limit the ESC lowers d.

An ESC with diodes in place of complementary switching carries no current against the motor. Where the ripple of the
switching, of Z = 2 L f, is larger than the current, the current stops within each period: it flows for the share u of
it, and the motor runs faster than d says,

    k Omega = (d V_b - R I) / u,   u = d + I Z / (d V_b) < 1,   battery current d I / u

until u reaches 1. With V_b from the battery, u is the root of a linear equation.

References
----------
M. Drela, "First-order DC electric motor model", MIT, 2007 (motor equations; not checked). O. Tremblay, L.-A. Dessaint,
"Experimental validation of a battery dynamic model for EV applications", World Electric Vehicle J. 3 (2009) 289-298,
doi:10.3390/wevj3020289 (battery as source and resistance; not checked). R. W. Erickson, D. Maksimovic, "Fundamentals of
Power Electronics", 2001, ch. 5 (buck converter whose current stops, here with the EMF as load and with resistance; not
checked). P. Pillay, R. Krishnan, "Modeling, simulation, and analysis of permanent-magnet motor drives, part I", IEEE
Trans. Ind. Appl. 25 (1989) 265-273, doi:10.1109/28.25541 (dq equations, here steady with v_d = 0; not checked).
Turnigy, "Multistar Race Spec 4-in-1 35A BLHeli-S", user manual, page 4 ("Brake On Stop": 1 to 100 % or disabled,
without effect at non-zero throttle).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bemt.base.arrays import Array
from bemt.base.errors import Fault, InputError
from bemt.physics.effects.motor_heating import COPPER, MAGNET
from bemt.rotors.case import Case
from bemt.rotors.case.drive_schema import LIPO_SOC, LIPO_V, DriveTable
from bemt.rotors.case.lattice import SPEEDS
from bemt.rotors.case.motor import class_resistance, known_mass_g

# Thrust and torque of a rotor over speed, for the drive: from a case by BEMT, or from coefficients.


@dataclass(frozen=True, eq=False)
class RotorMap:
    """Loads of a rotor over speed."""

    omega_max: float  # greatest speed of the table. [rad/s]
    # speed [rad/s] to thrust [N], torque [N m] and thrust per induced speed at fixed rotation [N s/m]
    thrust_law: Callable[[Array], Array]
    torque_law: Callable[[Array], Array]
    slope_law: Callable[[Array], Array] | None
    # of the rotor [m]; swept area that carries the thrust [m2]
    radius_m: float
    area_m2: float
    rho: float  # density of the air. [kg/m3]
    airspeed_m_s: float = 0.0  # of flight. [m/s]
    inertia_kg_m2: float = 0.0  # of the rotor alone. [kg m2]
    notes: tuple[str, ...] = ()  # what was left out

    def thrust(self, omega: ArrayLike) -> Array:
        """Steady thrust, (N,) [N]."""
        return np.asarray(self.thrust_law(np.maximum(np.asarray(omega, dtype=float), 0.0)))

    def torque(self, omega: ArrayLike) -> Array:
        """Steady shaft torque, (N,) [N m]."""
        return np.asarray(self.torque_law(np.maximum(np.asarray(omega, dtype=float), 0.0)))

    def induced(self, thrust_N: ArrayLike) -> Array:
        """Induced speed of momentum theory, 2 rho A v (V + v) = T, (N,) [m/s]."""
        load = np.maximum(np.asarray(thrust_N, dtype=float), 0.0) / (2.0 * self.rho * self.area_m2)
        half = 0.5 * self.airspeed_m_s
        return np.asarray(np.sqrt(half**2 + load) - half)

    @property
    def apparent_mass_kg(self) -> float:
        """Air that follows the rotor, 8/3 rho R^3 (Carpenter and Fridovich, NACA TN 3044, 1953; not checked). [kg]"""
        return 8.0 / 3.0 * self.rho * self.radius_m**3


def quadratic(
    kT: float, kQ: float, diameter_m: float, rho: float = 1.225, inertia_kg_m2: float = 0.0,
    solidity: float | None = None,
) -> RotorMap:  # fmt: skip
    """Rotor whose loads go with the square of the speed.

    With a lift slope a of 5.7 per radian, dT/dw = -rho sigma a A Omega R / 4 (blade element, uniform inflow; J. G.
    Leishman, "Principles of Helicopter Aerodynamics", 2006, ch. 3; not checked).
    """
    R, A = 0.5 * diameter_m, math.pi * diameter_m**2 / 4.0
    slope = None if solidity is None else (lambda w: -0.25 * rho * solidity * 5.7 * A * R * w)
    return RotorMap(math.inf, lambda w: kT * w**2, lambda w: kQ * w**2, slope, R, A, rho, 0.0, inertia_kg_m2)


def points(diameter_m: float, rpm_max: float, airspeed_m_s: float) -> tuple[Array, Array]:
    """Speeds [rev/min] and airspeeds [m/s] of which `from_loads` makes a table: each speed twice, the second faster."""
    rpm = SPEEDS * rpm_max
    step = 0.02 * math.pi * diameter_m * rpm[-1] / 60.0
    return np.tile(rpm, 2), airspeed_m_s + np.repeat([0.0, step], rpm.size)


def from_loads(
    case: Case, rpm: Array, airspeed_m_s: Array, thrust_N: Array, torque_Nm: Array, rho: float,
    inertia_kg_m2: float = 0.0,
) -> RotorMap:  # fmt: skip
    """Rotor of a case from its loads at `points`; loads that are NaN are dropped."""
    from scipy.interpolate import PchipInterpolator

    half = rpm.size // 2
    step = airspeed_m_s[-1] - airspeed_m_s[0]
    known = np.isfinite(thrust_N) & np.isfinite(torque_Nm)
    ok, both = known[:half], known[:half] & known[half:]
    if np.count_nonzero(ok) < max(4, half // 2):
        got_text = f"{np.count_nonzero(ok)} of {half} speeds up to {rpm[-1]:.0f} rev/min converge"
        raise InputError(Fault(case.path.as_posix(), "", got_text, "a rotor that can be solved over its speed range"))
    notes = [] if np.all(ok) else [f"{half - np.count_nonzero(ok)} of {half} speeds do not converge: dropped"]
    omega = rpm[:half][ok] * math.pi / 30.0
    area = math.pi / 4.0 * (case.diameter_m**2 - (case.hub_diameter_m**2 if case.ducted else 0.0))
    T, Q = thrust_N[:half], torque_Nm[:half]
    tT, tQ = PchipInterpolator(omega, T[ok] / omega**2), PchipInterpolator(omega, Q[ok] / omega**2)
    table = RotorMap(
        float(omega[-1]), lambda w: tT(np.clip(w, omega[0], omega[-1])) * w**2,
        lambda w: tQ(np.clip(w, omega[0], omega[-1])) * w**2, None, 0.5 * case.diameter_m, area, rho,
        float(airspeed_m_s[0]), inertia_kg_m2, tuple(notes),
    )  # fmt: skip
    if case.ducted or np.count_nonzero(both) < 4:
        why = "the inflow of a duct follows the fan at once here" if case.ducted else "no slope of thrust over airspeed"
        return _with(table, None, (*notes, f"{why}: no lag of the inflow"))
    # slope at fixed induced speed from the solver's, whose induced speed follows (bemt.physics.effects.inflow_lag)
    w = rpm[:half][both] * math.pi / 30.0
    dT_dV = (thrust_N[half:][both] - T[both]) / step
    v = table.induced(T[both])
    follow = (dT_dV / (2.0 * rho * area) - v) / np.maximum(airspeed_m_s[0] + 2.0 * v, 1e-9)
    law = PchipInterpolator(w, dT_dV / np.maximum(1.0 + follow, 0.1) / w)
    return _with(table, lambda x: law(np.clip(x, w[0], w[-1])) * x, tuple(notes))


def _with(table: RotorMap, slope: Callable[[Array], Array] | None, notes: tuple[str, ...]) -> RotorMap:
    return RotorMap(**{**vars(table), "slope_law": slope, "notes": notes})


EFFECTS = ("battery_sag", "motor_heating", "rotor_inertia", "inflow_lag")
"""Effects of the drive that can be switched off; ids of the diagnosis."""
REFERENCE_C = 25.0


@dataclass(frozen=True)
class Battery:
    """Source with one resistance."""

    cells: int  # in series
    resistance_ohm: float  # of the pack with its leads, as seen by one drive. [ohm]
    capacity_Ah: float = math.nan  # share of one drive. [A h]
    # state of charge, rising [1], and open-circuit voltage of a cell [V]
    soc_table: tuple[float, ...] = LIPO_SOC
    ocv_V: tuple[float, ...] = LIPO_V

    def voc(self, soc: ArrayLike) -> Array:
        """Open-circuit voltage of the pack, (N,) [V]."""
        return np.asarray(self.cells * np.interp(np.asarray(soc, dtype=float), self.soc_table, self.ocv_V))


@dataclass(frozen=True)
class Esc:
    """Speed controller."""

    # Pulse width of no and of full duty [us]
    pulse_min_us: float = 1000.0
    pulse_max_us: float = 2000.0
    exponent: float = 1.0  # duty = share ** exponent; 1 is linear [-]
    resistance_ohm: float = 0.0  # Of bridge and leads [ohm]
    idle_A: float = 0.0  # Own current [A]
    # Battery current above which it lowers the duty, and motor current to which it limits braking [A]
    current_limit_A: float = math.inf
    braking: bool = True  # Whether it can slow the rotor (complementary switching); else the current never goes below 0
    # Share of the time for which it shorts the motor at no duty; 0: the bridge is open there and the rotor coasts.
    # Without `braking` it has no effect [1]
    brake_on_stop: float = 1.0
    # Z = 2 L f: winding between lines, switching frequency; without braking it says when the current stops [ohm]
    ripple_ohm: float = math.inf

    def duty(self, pulse_us: ArrayLike) -> Array:
        """Duty of a pulse width, (N,) [1]."""
        share = (np.asarray(pulse_us, dtype=float) - self.pulse_min_us) / (self.pulse_max_us - self.pulse_min_us)
        return np.clip(share, 0.0, 1.0) ** self.exponent


@dataclass(frozen=True)
class Motor:
    """Brushless motor as a direct-current machine."""

    kv_rpm_V: float  # speed constant. [rev/min/V]
    resistance_ohm: float  # between lines, at 25 C. [ohm]
    no_load_A: float = 0.0  # current that covers friction and iron. [A]
    inertia_kg_m2: float = 0.0  # of the turning part. [kg m2]
    # of the winding [J/K]; to the air [K/W]
    heat_capacity_J_K: float = math.inf
    thermal_K_W: float = 0.0
    ambient_C: float = REFERENCE_C  # temperature of the air. [C]
    reactance_ohm_s: float = 0.0  # p L: pole pairs and inductance between lines; reactance over speed. [ohm s/rad]

    def k(self, temperature_C: ArrayLike = REFERENCE_C) -> Array:
        """EMF per speed and torque per current, (N,) [V s/rad]."""
        warm = np.asarray(temperature_C, dtype=float) - REFERENCE_C
        return 60.0 / (2.0 * math.pi * self.kv_rpm_V) * (1.0 - MAGNET * warm)

    def resistance(self, temperature_C: ArrayLike = REFERENCE_C) -> Array:
        """Resistance of the winding, (N,) [ohm]."""
        warm = np.asarray(temperature_C, dtype=float) - REFERENCE_C
        return self.resistance_ohm * (1.0 + COPPER * warm)


@dataclass(frozen=True)
class Steady:
    """Steady answers at N pulse widths; zero speed where the motor cannot start."""

    # (N,) pulse width [us] and duty in effect [1]
    pulse_us: Array
    duty: Array
    # (N,) speed [rev/min], thrust [N], shaft torque [N m]
    rpm: Array
    thrust_N: Array
    torque_Nm: Array
    # (N,) currents [A] and voltage at the ESC [V]
    motor_A: Array
    battery_A: Array
    voltage_V: Array
    power_W: Array  # (N,) drawn from the battery. [W]
    efficiency: Array  # (N,) shaft power over `power_W`. [1]
    limited: NDArray[np.bool_]  # (N,) whether the current limit acts
    converged: NDArray[np.bool_]  # (N,) false where the rotor table does not reach; values there are NaN


@dataclass(frozen=True)
class Drive:
    """One battery share, ESC, motor and rotor."""

    battery: Battery  # source
    esc: Esc  # controller
    motor: Motor  # machine
    rotor: RotorMap  # load
    off: frozenset[str] = field(default_factory=frozenset)  # effects switched off, see `EFFECTS`

    def without(self, *effects: str) -> Drive:
        """The drive with some effects off."""
        for name in effects:
            if name not in EFFECTS:
                raise ValueError(f"effect {name!r}; expected {', '.join(EFFECTS)}")
        return replace(self, off=self.off | set(effects))

    @property
    def battery_ohm(self) -> float:
        """Resistance of the battery in effect. [ohm]"""
        return 0.0 if "battery_sag" in self.off else self.battery.resistance_ohm

    def currents(self, duty: Array, omega: Array, voc: Array, temperature_C: Array) -> tuple[Array, Array, Array]:
        """Motor current at a speed, with the limits of the ESC."""
        emf, rb = self.motor.k(temperature_C) * omega, self.battery_ohm
        rt = self.motor.resistance(temperature_C) + self.esc.resistance_ohm
        if self.motor.reactance_ohm_s > 0.0:
            rt = rt + (self.motor.reactance_ohm_s * omega) ** 2 / rt
        rest = voc - rb * self.esc.idle_A

        def at(d: Array) -> tuple[Array, Array]:
            amps = (d * rest - emf) / (rt + d * d * rb)
            if self.esc.braking:
                amps = np.maximum(amps, -self.esc.current_limit_A)
                amps = np.where(d > 0.0, amps, self.esc.brake_on_stop * amps)
                return amps, d * amps
            amps = np.maximum(amps, 0.0)
            if math.isinf(self.esc.ripple_ohm):
                return amps, d * amps
            z = self.esc.ripple_ohm
            fall = (emf * rb * d * d + rest * d * rt) / z
            with np.errstate(divide="ignore", invalid="ignore"):
                u = np.where(emf > 0.0, (rest + fall) * d / (emf + fall), 1.0)
                more = np.maximum(u - d, 0.0)  # 0 where the EMF is above the battery
                pulses = d * rest / (1.0 + rb * d * d * more / (z * u)) * more / z
                stops = (u < 1.0) & (d > 0.0)
                return np.where(stops, pulses, amps), np.where(stops, d * pulses / u, d * amps)

        amps, bus = at(duty)
        room = self.esc.current_limit_A - self.esc.idle_A
        over = bus > room
        if np.any(over):
            # the duty at which the battery's current meets the limit: it rises with duty while I > 0
            lo, hi = np.zeros_like(duty), duty.copy()
            for _ in range(50):
                mid = 0.5 * (lo + hi)
                high = at(mid)[1] > room
                lo, hi = np.where(high, lo, mid), np.where(high, mid, hi)
            duty = np.where(over, lo, duty)
            amps, bus = at(duty)
        return amps, bus + self.esc.idle_A, duty

    def steady(self, pulse_us: ArrayLike, soc: ArrayLike = 1.0, temperature_C: ArrayLike | None = None) -> Steady:
        """Solve for the speed at which motor and rotor agree.

        Motor torque falls with speed and rotor torque rises: one root, between rest and twice the speed at no load.
        """
        from scipy.optimize.elementwise import find_root

        pulse, charge, warm = np.broadcast_arrays(
            np.atleast_1d(np.asarray(pulse_us, dtype=float)),
            np.asarray(soc, dtype=float),
            np.asarray(self.motor.ambient_C if temperature_C is None else temperature_C, dtype=float),
        )
        voc, duty = self.battery.voc(charge), self.esc.duty(pulse)

        def surplus(omega: Array, duty: Array, voc: Array, warm: Array) -> Array:
            amps, _, _ = self.currents(duty, omega, voc, warm)
            return np.asarray(self.motor.k(warm) * (amps - self.motor.no_load_A) - self.rotor.torque(omega))

        rest = np.zeros(pulse.shape)
        still = surplus(rest, duty, voc, warm) <= 0.0
        found = find_root(surplus, (rest, 2.0 * voc / self.motor.k(warm)), args=(duty, voc, warm))
        omega = np.where(still, 0.0, np.where(found.success, found.x, np.nan))
        amps, bus, used = self.currents(duty, omega, voc, warm)
        amps, bus = np.where(still, 0.0, amps), np.where(still, self.esc.idle_A, bus)
        inside = omega <= self.rotor.omega_max * (1.0 + 1e-9)
        volts = voc - self.battery_ohm * bus
        torque, thrust = self.rotor.torque(omega), self.rotor.thrust(omega)
        power = volts * bus
        with np.errstate(divide="ignore", invalid="ignore"):
            eta = np.where(power > 0.0, torque * omega / power, 0.0)

        def kept(v: Array) -> Array:
            return np.where(inside, v, np.nan)

        return Steady(pulse, used, kept(omega * 30.0 / math.pi), kept(thrust), kept(torque), kept(amps), kept(bus),
                      kept(volts), kept(power), kept(eta), used < duty, inside)  # fmt: skip

    def pulse_for(self, thrust_N: float, soc: float = 1.0) -> float:
        """Pulse width that gives a thrust. [us]"""
        return float(self.pulses_for(thrust_N, np.array([soc]))[0])

    def pulses_for(self, thrust_N: float, soc: Array, temperature_C: float | None = None) -> Array:
        """Pulse widths that give a thrust at (N,) states of charge, NaN where none does. [us]"""
        full = self.steady(self.esc.pulse_max_us, soc, temperature_C)
        reached = full.thrust_N >= thrust_N
        top = np.where(reached, full.rpm * math.pi / 30.0, 0.0)
        omega = _least(lambda w: np.asarray(self.rotor.thrust(w) >= thrust_N), np.zeros(soc.shape), top)[:, None]
        warm = np.asarray(self.motor.ambient_C if temperature_C is None else temperature_C, dtype=float)
        voc, wanted = self.battery.voc(soc)[:, None], self.rotor.torque(omega)

        def holds(pulse: Array) -> NDArray[np.bool_]:
            amps, _, _ = self.currents(self.esc.duty(pulse), omega, voc, warm)
            return np.asarray((omega == 0.0) | (self.motor.k(warm) * (amps - self.motor.no_load_A) >= wanted))

        ends = (np.full(soc.shape, end) for end in (self.esc.pulse_min_us, self.esc.pulse_max_us))
        return np.where(reached, _least(holds, *ends), np.nan)


def _least(holds: Callable[[Array], NDArray[np.bool_]], lo: Array, hi: Array) -> Array:
    """Least value from (N,) lo to hi at which something holds that goes on holding above and holds at hi."""
    row = np.arange(lo.size)
    for _ in range(6):  # 40 parts at a time
        grid = np.linspace(lo, hi, 41, axis=-1)
        held = holds(grid)
        held[:, -1] = True
        i = np.argmax(held, axis=1)
        lo, hi = grid[row, np.maximum(i - 1, 0)], grid[row, i]
    return hi


# The drive of a case: its battery, ESC and motor around its rotor, with whatever a label leaves open filled in.
#
# A case that states no winding has that of its class (`bemt.rotors.case.motor`); one that states the share of voltage
# or current that is lost at full throttle has the ohms and amperes of a motor that is as large as this rotor needs at
# rest. The motor does not change with an unknown of the rotor or with airspeed: it is the same motor, whatever the
# blade turns out to be.

ROTOR_DENSITY = 0.06
"""Mass of a plastic two-blade propeller over its diameter squared: declared. [kg/m2]"""


def battery_of(table: DriveTable, resistance_ohm: float = 0.0) -> Battery:
    """The share of the battery that one rotor has."""
    b, n = table.battery, table.vehicle.rotors
    capacity = math.nan if b.capacity_Ah is None else b.capacity_Ah / n
    return Battery(table.cells, resistance_ohm, capacity, b.soc_table, b.ocv_cell_V)


def rpm_max(case: Case) -> float:
    """Speed at no load and full battery, at any end of the declared range of K_v: no rotor turns faster. [rev/min]"""
    table = drive_table(case)
    kv = max([table.kv, *(float(v) for item in case.assumptions if item.key == "drive.kv" for v in item.values)])
    return kv * float(battery_of(table).voc(1.0))


def drive_table(case: Case) -> DriveTable:
    """The table [drive] of a case that has one."""
    assert case.file.drive is not None
    return case.file.drive


def inertia_kg_m2(case: Case) -> float:
    """Rotor inertia that the case states, else of slender blades, m R^2/3 with their mass nearer to the hub. [kg m2]"""
    stated = drive_table(case).rotor_inertia_kg_mm2
    if stated is not None:
        return 1e-6 * stated
    return ROTOR_DENSITY * case.diameter_m**2 * (0.5 * case.diameter_m) ** 2 / 9.0 * case.file.rotor.blades


def drive_of(case: Case, rotor: RotorMap, rest: RotorMap | None = None) -> Drive:
    """Drive of a case; shares are taken at full throttle and the stated charge, with the rotor at rest if given."""
    t = drive_table(case)
    m, e = t.motor, t.esc
    henry = None if m.inductance_uH is None else m.inductance_uH * 1e-6
    battery, winding, idle, bridge = _losses(t, rest or rotor)
    esc = Esc(
        e.pulse_min_us, e.pulse_max_us, e.exponent, bridge, e.idle_A,
        math.inf if e.current_limit_A is None else e.current_limit_A, e.braking == "yes", e.brake_on_stop,
        math.inf if henry is None or e.pwm_kHz is None else 2e3 * henry * e.pwm_kHz,
    )  # fmt: skip
    turning = 0.3 * rotor.inertia_kg_m2 if m.inertia_kg_mm2 is None else m.inertia_kg_mm2 * 1e-6
    motor = Motor(
        t.kv, winding, idle, turning, math.inf if m.heat_capacity_J_K is None else m.heat_capacity_J_K,
        m.thermal_K_W or 0.0, m.ambient_C, 0.0 if henry is None or m.pole_pairs is None else m.pole_pairs * henry,
    )  # fmt: skip
    return Drive(battery_of(t, battery), esc, motor, rotor)


def _losses(t: DriveTable, rotor: RotorMap) -> tuple[float, float, float, float]:
    """Resistance of the battery share and of the winding [ohm], no-load current [A], resistance of the ESC [ohm].

    The current at full throttle, on which the shares depend, is the root of a falling function: damped iteration.
    """
    volts, k = float(battery_of(t).voc(t.soc)), 30.0 / (math.pi * t.kv)
    stated = None if t.battery.resistance_mohm is None else t.vehicle.rotors * t.battery.resistance_mohm * 1e-3
    ohm = None if t.motor.resistance_mohm is None else t.motor.resistance_mohm * 1e-3
    mass, of_class = known_mass_g(t.motor), ohm is None and t.motor.winding_drop is None
    sag, drop, share = t.battery.sag or 0.0, t.motor.winding_drop or 0.0, t.motor.idle_share or 0.0
    more, lost = t.esc.resistance_mohm * 1e-3, t.esc.drop or 0.0
    amps = 1e-3
    for _ in range(200):
        if of_class:
            ohm = math.exp(t.motor.size) * float(class_resistance(amps, t.kv, mass))
        loaded = volts * (1.0 - sag) if stated is None else volts - stated * (amps + t.esc.idle_A)
        emf = loaded * (1.0 - lost) - more * amps - (loaded * drop if ohm is None else ohm * amps)
        load = float(rotor.torque(max(emf, 0.0) / k)) / k
        new = load / (1.0 - share) if t.motor.no_load_A is None else load + t.motor.no_load_A
        step = new - amps
        amps = max(amps + 0.3 * step, 1e-3)
        if abs(step) < 1e-9 * amps:
            break
    battery = volts * sag / amps if stated is None else stated
    winding = loaded * drop / amps if ohm is None else ohm
    no_load = share * amps if t.motor.no_load_A is None else t.motor.no_load_A
    return battery, winding, no_load, more + loaded * lost / amps
