"""``python -m bemt choose``: which propeller and which motor constant for a thrust or a mass."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED

NAME = "choose"
HELP = "which propeller and which motor constant reach a thrust, with the probability that they do"
GROUP = "Drive"
EXAMPLE = "choose --thrust 27 --cells 6 --max-diameter-in 18"


def _range(text: str) -> tuple[float, float]:
    """``LOW:HIGH``, or one number."""
    low, _, high = text.partition(":")
    try:
        return float(low), float(high or low)
    except ValueError:
        raise argparse.ArgumentTypeError(f"got {text}; expected LOW:HIGH or a number, as 400:900") from None


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    thrust = "thrust of one rotor at full throttle [N] (default: twice hover, with --mass)"
    parser.add_argument("--thrust", type=float, metavar="N", help=thrust)
    parser.add_argument("--cells", type=_options.positive, metavar="S", help="LiPo cells in series")
    parser.add_argument(
        "--mass", type=float, metavar="KG", help="mass of the vehicle: power and time are of hover [kg]"
    )
    parser.add_argument("--rotors", type=_options.positive, default=1, metavar="N", help="rotors (default 1)")
    parser.add_argument("--capacity", type=float, metavar="AH", help="battery capacity, for the time [A h]")
    parser.add_argument("--hover-time", type=float, metavar="MIN", help="time that is wanted, with --capacity [min]")
    parser.add_argument("--airspeed", type=float, default=0.0, metavar="V", help="flight speed [m/s] (default 0)")
    parser.add_argument("--max-diameter-in", type=float, metavar="IN", help="largest diameter [in]")
    parser.add_argument("--max-tip-mach", type=float, default=0.8, metavar="M", help="tip Mach limit (default 0.8)")
    motor = parser.add_mutually_exclusive_group()
    kv = "range of the motor's speed constant, as 400:900 [rev/min/V] (default 100:3000)"
    motor.add_argument("--kv", type=_range, default=(100.0, 3000.0), metavar="LOW:HIGH", help=kv)
    real = "real motors instead: a CSV with name,kv,resistance_mohm,no_load_A"
    motor.add_argument("--motors", metavar="CSV", help=real)
    parser.add_argument(
        "--labels", metavar="LABEL", help="propellers to try (default: standard sizes)", **_options.MANY
    )
    blades = "blades of the standard sizes (default 2)"
    parser.add_argument("--blades", type=_options.positive, metavar="B", help=blades, **_options.MANY)
    sure = "probability from which on the least power wins (default 0.9)"
    parser.add_argument("--sure", type=float, default=0.9, metavar="P", help=sure)
    parser.add_argument("--out", metavar="DIR", help="write JSON, CSV and a picture to this folder")
    _options.add_json(parser, "bemt.choose/1")


def run(args: argparse.Namespace) -> int:
    """Rank; 1 if nothing meets the target with the probability asked for."""
    from bemt.base.tables import json_text
    from bemt.tools.design import answer
    from bemt.tools.design.search import choose

    table = choose(
        args.thrust, args.cells, kv=args.kv, motors=args.motors or (),
        labels=args.labels or (), blades=args.blades or (2,), mass_kg=args.mass, rotors=args.rotors,
        airspeed_m_s=args.airspeed, max_diameter_in=args.max_diameter_in, max_tip_mach=args.max_tip_mach,
        capacity_Ah=args.capacity, minutes=args.hover_time, sure=args.sure,
    )  # fmt: skip
    if args.out:
        answer.write(table, args.out)
    print(json_text(answer.document(table)) if args.json else answer.text(table), end="")
    return EXIT_OK if (table.probability >= args.sure).any() else EXIT_UNCONVERGED
