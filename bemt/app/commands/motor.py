"""``bemt motor``: the torque constant by three methods, whether they agree, and why not."""

from __future__ import annotations

import argparse

from bemt.app.commands import _options
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED

NAME = "motor"
HELP = "compare the motor constant from data sheet, back-EMF and torque sensor"
GROUP = "Drive"
EXAMPLE = "motor motor.toml"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("file", nargs="?", metavar="FILE", help="motor.toml or its folder")
    made = "write generated trials (labelled as generated) and their motor.toml to DIR"
    parser.add_argument("--generate", metavar="DIR", help=made)
    parser.add_argument("--seed", type=int, metavar="N", help="with --generate: random seed (default 0)")
    plant = "with --generate: add a systematic error, e.g. torque.shunt=1.04; repeatable"
    parser.add_argument("--plant", metavar="NAME=SIZE", help=plant, **_options.REPEATABLE)
    parser.add_argument("--out", metavar="DIR", help="write JSON, trials as CSV and a box plot to this folder")
    _options.add_json(parser, "bemt.motor.result/1; with only --generate bemt.motor.generated/1")


def run(args: argparse.Namespace) -> int:
    """Generate, judge, print; 1 when the methods disagree."""
    from bemt.base.tables import json_text
    from bemt.tools.drive import motor_result

    motor_result.check_options(args.file, args.generate, args.seed, args.plant, args.out)
    if args.generate:
        made = motor_result.generate(args.generate, args.seed, args.plant, args.file, args.out)
        if not args.file:
            print(json_text(made) if args.json else motor_result.generated_text(made), end="")
            return EXIT_OK
    trials, found = motor_result.judge(args.file, args.out)
    print(json_text(found) if args.json else motor_result.text(trials, found), end="")
    return EXIT_OK if found["agree"] else EXIT_UNCONVERGED
