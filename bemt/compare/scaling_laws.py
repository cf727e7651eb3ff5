"""How one cause moves thrust, torque and the drive of a rotor, without any blade: a table, its sources in the rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

_SIZES = (0.02, 0.07, 0.25)
# Barometers read 970 to 1040 hPa and rooms 0 to 35 C (5 %); 1,000 m are 10 %.
_AIRS = (0.02, 0.05, 0.1)
# Cells keep their calibration within some per cent; a lever that was measured wrongly is 10 to 16 % off.
_GAINS = (0.01, 0.03, 0.1)
# Cheeseman and Bennett at half a radius from the wall: 1.33, at one radius 1.07.
_WALLS = (0.02, 0.07, 0.15)
_ZEROS = (0.004, 0.015, 0.05)
FAMILY = {
    **dict.fromkeys(("diameter", "pitch_offset", "section", "propeller", "untwist"), "blade"),
    **dict.fromkeys(("duct", "ground_effect", "coaxial_neighbour", "recirculation"), "surroundings"),
    **dict.fromkeys(("airspeed_offset", "airspeed_gain", "nacelle", "oblique_inflow"), "airspeed"),
    **dict.fromkeys(("thrust_gain", "torque_gain", "thrust_zero", "torque_zero", "cross_talk"), "load cell"),
    **dict.fromkeys(("battery_sag", "motor_heating", "motor"), "drive"),
}
"""What an engineer would look at, at once; an effect that is not listed is a family of its own."""

Basis = Mapping[str, float]
Term = tuple[float, Mapping[str, Basis]]


@dataclass(frozen=True)
class ScalingLaw:
    """How one cause moves the channels."""

    id: str  # Of the effect, as in the catalogue of effects where it is there
    title: str  # In words
    # Size relative to the first term, and channel to basis to weight. Bases: ``all`` 1; ``zero`` full scale over
    # reading; ``still`` 1 at rest, fading to 0 at the largest advance; ``slope`` the channel's own derivative with
    # respect to ln J; ``slip`` that over V; ``talk`` the other load over this one;
    # ``drag`` V^2 over thrust; ``n2`` square of the speed; ``volts`` ln of the
    # voltage ratio at equal command, or 1 where it is not recorded.
    terms: tuple[Term, ...]
    says: str  # Why this cause, in a sentence
    settles: str  # Measurement that distinguishes it from others
    source: str  # Of the scaling
    kind: str = "air"  # air, stand or drive
    sizes: tuple[float, ...] = _SIZES  # Standard deviations of the first term, share; they share the prior [1]
    flow: bool = False  # Only with airspeed
    exact: bool = False  # Whether nothing but the law is moved, as by instruments


_T, _Q = "thrust", "torque"
LAWS: tuple[ScalingLaw, ...] = (
    ScalingLaw(
        "air_density",
        "air density",
        ((1.0, {_T: {"all": 1.0}, _Q: {"all": 1.0}}),),
        "thrust and torque change by the same share at every speed",
        "read barometer and thermometer in both runs",
        "T = CT rho n^2 D^4, Q = CQ rho n^2 D^5",
        sizes=_AIRS,
        exact=True,
    ),
    ScalingLaw(
        "rpm_scale",
        "wrong speed of rotation",
        ((1.0, {_T: {"all": 2.0, "slope": -1.0}, _Q: {"all": 2.0, "slope": -1.0}}),),
        "thrust and torque change by the same square at any speed",
        "check the speed with an optical tachometer",
        "T and Q go with n^2 at fixed CT, CQ; J with 1/n",
        "stand",
        (0.01, 0.04),
    ),
    ScalingLaw(
        "diameter",
        "different diameter or cut tip",
        (
            (1.0, {_T: {"all": 4.0, "slope": -1.0}, _Q: {"all": 5.0, "slope": -1.0}}),
            (0.5, {_T: {"all": 1.0}}),
            (0.5, {_Q: {"all": 1.0}}),
        ),
        "torque changes a little more than thrust, both at every speed",
        "measure the diameter",
        "T ~ D^4, Q ~ D^5 at fixed CT, CQ; the shape of another blade adds a few per cent",
        sizes=(0.01, 0.03, 0.1),
    ),
    ScalingLaw(
        "pitch_offset",
        "different pitch or blade angle",
        (
            (1.0, {_T: {"all": 1.0, "slope": -1.0}, _Q: {"all": 1.5, "slope": -1.0}}),
            (0.8, {_Q: {"all": 1.0}}),
            (0.15, {_T: {"slope": 1.0}, _Q: {"slope": 1.0}}),
        ),
        "torque changes more than thrust at every speed, and the advance ratio of zero thrust shifts",
        "measure the blade angle; record a run with airspeed",
        "momentum theory: P ~ T^1.5 at equal figure of merit; blades near stall add torque and no thrust",
        sizes=(*_SIZES, 0.5),
    ),
    ScalingLaw(
        "section",
        "different blade section or surface",
        ((1.0, {_T: {"all": 0.5}}), (1.0, {_Q: {"all": 1.0}})),
        "torque and thrust change by different constant shares",
        "compare the blades by weight and shape",
        "lift and drag of the section move CT and CP apart",
    ),
    ScalingLaw(
        "propeller",
        "another propeller",
        (
            (1.0, {_T: {"all": 1.0}}),
            (1.0, {_Q: {"all": 1.0}}),
            (0.15, {_T: {"n2": 1.0}}),
            (0.15, {_Q: {"n2": 1.0}}),
            (0.5, {_T: {"slope": 1.0}, _Q: {"slope": 1.0}}),
        ),
        "both loads change by large, different shares: pitch, blades, chord and section at once",
        "compare label, blade count and weight",
        "CT and CP of another blade",
        sizes=(0.07, 0.2, 0.6, 1.5),
    ),
    ScalingLaw(
        "untwist",
        "elastic blade twist",
        ((1.0, {_T: {"n2": 1.0}, _Q: {"n2": 1.3}}),),
        "the change grows with the square of the speed",
        "run a stiffer blade of the same shape",
        "twist goes with rho Omega^2; P ~ T^1.5",
        sizes=(0.03, 0.1),
    ),
    ScalingLaw(
        "duct",
        "a duct put on or taken off",
        ((1.0, {_T: {"still": 1.0}, _Q: {"still": -0.7}}), (0.7, {_Q: {"still": 1.0}})),
        "thrust rises at the same speed while torque falls or stays the same; fades with airspeed",
        "weigh rotor and duct separately",
        "momentum theory of the ducted fan: T/T_rotor = 2 sigma in static operation",
    ),
    ScalingLaw(
        "ground_effect",
        "wall behind or in front of the propeller",
        ((1.0, {_T: {"still": 1.0}}), (0.2, {_Q: {"still": 1.0}})),
        "thrust changes at the same speed while torque stays the same; fades with airspeed",
        "measure at twice the distance",
        "Cheeseman and Bennett, ARC R&M 3021, 1955",
        sizes=_WALLS,
    ),
    ScalingLaw(
        "coaxial_neighbour",
        "slipstream of another rotor",
        ((1.0, {_T: {"all": -1.0}, _Q: {"all": -0.3}}), (0.35, {_Q: {"all": 1.0}}), (0.3, {_T: {"n2": 1.0}})),
        "thrust falls at the same speed, torque much less",
        "run the rotor alone",
        "a rotor in a slipstream works as in climb: thrust falls, power hardly",
        sizes=(*_SIZES, 0.5),
    ),
    ScalingLaw(
        "recirculation",
        "recirculation in the room",
        ((1.0, {_T: {"still": -1.0}, _Q: {"still": -0.2}}), (0.3, {_Q: {"still": 1.0}})),
        "thrust falls at low advance ratio, torque less",
        "run in the open, or watch the first seconds of a start",
        "onset flow lowers the angle of attack, as in climb",
        sizes=(0.02, 0.07),
    ),
    ScalingLaw(
        "airspeed_offset",
        "airspeed offset",
        ((1.0, {_T: {"slip": 1.0}, _Q: {"slip": 1.0}}),),
        "both loads move as at another J, most at low speed of rotation",
        "use a second pitot tube",
        "J = V/(n D): an offset of V moves it by dV/(n D)",
        "stand",
        flow=True,
    ),
    ScalingLaw(
        "oblique_inflow",
        "inflow at an angle to the shaft",
        ((1.0, {_T: {"slope": 1.0}, _Q: {"slope": 1.0}}),),
        "both loads move as if J were smaller by one factor",
        "measure the angle between shaft and wind",
        "the rotor sees V cos(alpha) along its axis",
        flow=True,
        exact=True,
    ),
    ScalingLaw(
        "cross_talk",
        "cross-talk between thrust and torque cell",
        ((1.0, {_T: {"talk": 1.0}}), (1.0, {_Q: {"talk": 1.0}})),
        "one cell shows a share of the other load, which shows where their ratio changes with airspeed",
        "hang a dead weight on each cell separately and read both",
        "T' = T + k Q / R, Q' = Q + k T R",
        "stand",
        _GAINS,
        flow=True,
    ),
    ScalingLaw(
        "airspeed_gain",
        "gain error of the airspeed sensor",
        ((1.0, {_T: {"slope": 1.0}, _Q: {"slope": 1.0}}),),
        "both loads move as if J were scaled by one factor",
        "use a second pitot tube",
        "J = V/(n D)",
        "stand",
        flow=True,
    ),
    ScalingLaw(
        "nacelle",
        "drag of parts in the stream",
        ((1.0, {_T: {"drag": 1.0}}),),
        "thrust changes with V^2 at any speed, torque stays the same",
        "run the stand in the stream without propeller",
        "D = q S CD",
        flow=True,
        sizes=_ZEROS,
    ),
    ScalingLaw(
        "thrust_gain",
        "gain of the thrust cell",
        ((1.0, {_T: {"all": 1.0}}),),
        "thrust changes by one factor and torque does not",
        "hang dead weights on the cell",
        "T' = g T",
        "stand",
        _GAINS,
    ),
    ScalingLaw(
        "torque_gain",
        "gain of the torque cell",
        ((1.0, {_Q: {"all": 1.0}}),),
        "torque changes by one factor and thrust does not",
        "hang a known lever and weight",
        "Q' = g Q",
        "stand",
        _GAINS,
    ),
    ScalingLaw(
        "thrust_zero",
        "zero offset of the thrust cell",
        ((1.0, {_T: {"zero": 1.0}}),),
        "thrust is off by a constant, which falls as 1/n^2",
        "note the zero before and after the run",
        "T' = T + z",
        "stand",
        _ZEROS,
    ),
    ScalingLaw(
        "torque_zero",
        "zero offset of the torque cell",
        ((1.0, {_Q: {"zero": 1.0}}),),
        "torque is off by a constant, which falls as 1/n^2",
        "note the zero before and after the run",
        "Q' = Q + z",
        "stand",
        _ZEROS,
    ),
    ScalingLaw(
        "battery_sag",
        "supply or battery voltage",
        ((1.0, {"speed": {"volts": 1.0}}), (0.5, {"electrical": {"volts": 1.0}})),
        "speed at one command follows the voltage; loads at the measured speed are unchanged",
        "log voltage at the controller",
        "n ~ command x V less I R",
        "drive",
        (*_SIZES, 0.8),
    ),
    ScalingLaw(
        "motor_heating",
        "motor heating (winding and magnets)",
        ((1.0, {"speed": {"all": -0.5}, "electrical": {"all": 1.0}}), (0.4, {"electrical": {"all": 1.0}})),
        "more electrical power for the same speed and load, and less speed at one command",
        "repeat after a pause",
        "R = R0 (1 + 0.0039 dT)",
        "drive",
        sizes=(0.03, 0.1),
    ),
    ScalingLaw(
        "motor",
        "different motor, controller or setting",
        (
            (1.0, {"speed": {"all": 1.0}}),
            (1.0, {"electrical": {"all": 1.0}}),
            (0.5, {"speed": {"ramp": 1.0}}),
            (0.5, {"electrical": {"ramp": 1.0}}),
        ),
        "speed at one command and electrical power change, loads at the measured speed are unchanged",
        "compare motor, controller and its settings",
        "shares of their own",
        "drive",
    ),
)
"""Causes that are weighed without a blade."""


def law(name: str) -> ScalingLaw | None:
    """Row of an effect; None for unit slips and rivals."""
    return next((row for row in LAWS if row.id == name), None)
