"""Ten requests and what `choose` answers: ``python docs/choose_requests.py`` fills the table of choose.md."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from bemt import choose
from bemt.tools.design.answer import DriveChoice, best_of_each

PAGE = Path(__file__).resolve().parent / "choose.md"
REQUESTS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("quadrotor of 2 kg, 4S, shafts 330 mm from the middle",
     {"cells": 4, "mass_kg": 2.0, "rotors": 4, "arm_mm": 330.0}),
    ("quadrotor of 250 g, 3S, shafts 90 mm from the middle",
     {"cells": 3, "mass_kg": 0.25, "rotors": 4, "arm_mm": 90.0}),
    ("5 in racer of 650 g, 4S, 12 N a rotor, two or three blades",
     {"cells": 4, "mass_kg": 0.65, "rotors": 4, "thrust_N": 12.0, "arm_mm": 110.0, "blades": (2, 3)}),
    ("wing, 6 N at 15 m/s, 3S, 11 in at most",
     {"thrust_N": 6.0, "cells": 3, "airspeed_m_s": 15.0, "max_diameter_in": 11.0}),
    ("lifter, 100 N a rotor, 12S, 28 in at most", {"thrust_N": 100.0, "cells": 12, "max_diameter_in": 28.0}),
    ("ducted fan of 70 mm, 18 N, 6S", {"thrust_N": 18.0, "cells": 6, "fan": True, "max_diameter_in": 2.76}),
    ("thruster in water, 40 N, 4S, 3 in at most, three blades",
     {"thrust_N": 40.0, "cells": 4, "fluid": "water", "max_diameter_in": 3.0, "blades": 3}),
    ("four coaxial pairs, 4 kg, 6S, 15 in at most",
     {"cells": 6, "mass_kg": 4.0, "rotors": 8, "coaxial": True, "max_diameter_in": 15.0}),
    ("quadrotor of 1.4 kg, 4S, no limit on the diameter", {"cells": 4, "mass_kg": 1.4, "rotors": 4}),
    ("glider's climb, 8 N at 10 m/s, 3S, 14 in at most",
     {"thrust_N": 8.0, "cells": 3, "airspeed_m_s": 10.0, "max_diameter_in": 14.0}),
)  # fmt: skip
HEAD = (
    "| request | first: smallest within 5 % | K_v (even chance) | power W | g/W | full throttle N | motor, propeller, "
    "controller, arm g | least power | a motor on sale |\n|---|---|---|---|---|---|---|---|---|\n"
)


def row(words: str, found: DriveChoice) -> str:
    """Line of the table."""
    table = found.table
    first = table.iloc[0]
    if first.probability < found.sure:
        nearest = f"none is sure; nearest {first.label}, at {first.probability:.0%}"
        return f"| {words} | {nearest} | {first.kv:.0f} | | | {first.full_thrust_N:.3g} |" + " |" * 3
    even = table[(table.label == first.label) & (table.probability >= 0.5)].kv.min()
    least = best_of_each(found.good).sort_values("mean_W").iloc[0]
    gain = 1.0 - least.mean_W / first.mean_W
    other = "the same" if least.label == first.label else f"{least.label}, {gain:.1%} less"
    stock = next((f"{m.motor}, {m.motor_g:.0f} g, {m.power_W:.3g} W" for m in found.on_sale.itertuples()), "-")
    cells = (words, first.label, f"{first.kv:.0f} ({even:.0f})", f"{first.power_W:.3g} ± {first.u_power_W:.2g}",
             f"{first.g_per_W:.3g}", f"{first.full_thrust_N:.3g}", f"{first.propulsion_g:.0f}", other,
             stock)  # fmt: skip
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Rewrite the table."""
    rows = []
    for words, asked in REQUESTS:
        rest = {"rest_kg": 0.6 * asked["mass_kg"]} if "mass_kg" in asked else {}
        rows.append(row(words, choose(**asked, **rest)))
        print(rows[-1], flush=True)
    text = PAGE.read_text(encoding="utf-8")
    found = re.sub(re.escape(HEAD) + r"(\|.*\n)*", lambda _: HEAD + "\n".join(rows) + "\n", text)
    PAGE.write_text(found, encoding="utf-8")


if __name__ == "__main__":
    main()
