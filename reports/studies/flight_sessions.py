"""How often `fly` is right when it names, by healthy flights of other sessions than that of the judged one.

``python reports/studies/flight_sessions.py DATA > reports/flight/sessions.txt`` takes DATA/flight_logs (10 s). The six
normal flights of CrazyPAD E8 are three sessions by their balance: 00 and 01, 02 to 04, 05; those of E9 are one, and
the cuts of its motors 1 and 2 of another day. Every choice of sessions, with two flights or more, judges all other
recordings, and the normal flights left out with a rotor that needs 8 to 40 % more drive, as a rigid body balances it
(their vibration is not counted: nobody knows it).
"""

from __future__ import annotations

import argparse
import re
from collections import Counter
from collections.abc import Iterator
from itertools import combinations, product
from pathlib import Path

import numpy as np
from scipy import stats

from bemt.tools.flight.balance import WEIGHT, blade, directions, features
from bemt.tools.flight.judge import BesideBalance, posterior
from bemt.tools.flight.layout import layout_of
from bemt.tools.flight.read import read_log
from bemt.tools.flight.vibration import vibration

SESSIONS = {"E8": ("0[01]", "0[234]", "05"), "E9": ("0[012]",)}  # numbers of the normal flights
SIZES = (0.08, 0.12, 0.2, 0.3, 0.4)
ENDS = ("named right", "named wrong", "class right", "class wrong", "unknown", "accused", "none", "insufficient")


def faults(name: str) -> set[str]:
    """What a recording's name says is wrong."""
    motors = re.findall(r"M(\d)", name)
    return {f"{WEIGHT}near motor {m}" if "weight" in name else blade(int(m)) for m in motors}


def trials(folder: Path) -> Iterator[tuple[str, str, str]]:
    """Kind of a trial, how it ended, and what it was."""
    layout = layout_of("crazyflie", 4)
    for vehicle, sessions in SESSIONS.items():
        files = sorted(p for p in folder.rglob("*.usdlog") if f"{vehicle}/" in str(p) or f"{vehicle}_normal" in p.name)
        logs = {p.stem: read_log(p) for p in files}
        flown = {k: x for k, log in logs.items() if (x := features(log)) is not None}
        level = {k: vibration(logs[k]).level for k in flown}
        days = [{k for k in flown if re.search(f"normal.*log{n}$", k)} for n in sessions]
        for used in (u for n in range(1, len(days) + 1) for u in combinations(range(len(days)), n)):
            past = [k for d in used for k in sorted(days[d])]
            label = [d for d in used for _ in days[d]]
            made = {
                f"{k}, motor {m + 1}, {100 * size:.0f} %": (
                    f"{100 * size:.0f} % added",
                    {blade(m + 1)},
                    flown[k] + np.log1p(size) * way,
                )
                for k, (m, way), size in product(
                    (k for k in flown if "normal" in k and k not in past),
                    enumerate(list(directions(4, layout).values())[:4]),
                    SIZES,
                )
            }
            told = {k: ("recorded", faults(k), x) for k, x in flown.items() if k not in past}
            levels = tuple(level[k] for k in past)
            for (what, (kind, wrong, x)), day in product((told | made).items(), ("", None)) if len(past) > 1 else ():
                shake = BesideBalance(level=level.get(what, np.nan), levels=levels)
                said = posterior(x, np.array([flown[k] for k in past]), layout, False, shake, label, day).said
                hit = "right" if wrong and wrong <= set(said.effects) else "wrong"
                end = f"{said.verdict} {hit}" if said.effects else said.verdict
                end = "accused" if not wrong and end not in ("none", "insufficient") else end
                yield f"{kind}, {'day open' if day == '' else 'another day'}", end, f"{what} by {', '.join(past)}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    counts: dict[str, Counter[str]] = {}
    for kind, end, what in trials(parser.parse_args().data / "flight_logs"):
        counts.setdefault(kind, Counter())[end] += 1
        if end in ("named wrong", "class wrong", "accused"):
            print(f"{end}: {kind}, {what}")
    print(f"{'':26}" + "".join(f"{end:>14}" for end in ENDS))
    for kind, count in counts.items():
        print(f"{kind:26}" + "".join(f"{count[end]:14}" for end in ENDS))
    right, wrong = (
        sum(c[f"{v} {hit}"] for c in counts.values() for v in ("named", "class")) for hit in ("right", "wrong")
    )
    wrong += sum(c["accused"] for c in counts.values())
    named = sum(c["named right"] for c in counts.values())
    bad = sum(c["named wrong"] + c["accused"] for c in counts.values())
    for words, a, b in (("right when it names", named, bad), ("right when it names or gives a class", right, wrong)):
        low, high = stats.binomtest(a, a + b).proportion_ci(method="exact")
        print(f"{words}: {a} of {a + b}, {100 * a / (a + b):.0f} % (95 %: {100 * low:.0f} to {100 * high:.0f} %)")


if __name__ == "__main__":
    main()
