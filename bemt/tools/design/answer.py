"""The ranking of `choose` as text, document and picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bemt.base import canvas
from bemt.base.action import Answered
from bemt.base.errors import EXIT_OK, EXIT_UNCONVERGED
from bemt.base.tables import csv_text, json_text, number_of, number_text, text_table, write_atomic
from bemt.base.units import INCH
from bemt.rotors.case.motor import LIST, motors_on_sale
from bemt.rotors.case.tip_speed import fast_words
from bemt.tools.design.search import SOC_END, Target

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = "bemt.choose/1"
RESULTS = ("choose.json", "choose.csv", "choose.png")
SHOWN = 10


@dataclass(frozen=True, eq=False)
class DriveChoice(Answered):
    """Propellers and motors for a target, best first; columns of the table are attributes as well.

    Parameters
    ----------
    table : pandas.DataFrame
        As :func:`bemt.tools.design.search.choose` gives it.
    target : bemt.tools.design.search.Target
        What was asked for.
    on_sale : pandas.DataFrame
        Motors on sale for the first propeller; empty where none is known, or motors were given.
    sure : float
        Probability from which on a pair counts as sure.
    """

    table: pd.DataFrame
    target: Target
    on_sale: pd.DataFrame
    sure: float

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "table":
            raise AttributeError(name)
        return getattr(self.table, name)

    def __len__(self) -> int:
        return len(self.table)

    def __repr__(self) -> str:
        first = self.table.iloc[0]
        return f"<choice of {len(self.table)} pairs: {first.label} with {first.kv:.0f} rev/min/V>"

    @property
    def good(self) -> pd.DataFrame:
        """Pairs that are sure to meet the target."""
        return self.table[self.table.probability >= self.sure]

    @property
    def exit_code(self) -> int:
        """1 if no pair is sure to meet the target."""
        return EXIT_OK if len(self.good) else EXIT_UNCONVERGED

    def to_pandas(self) -> pd.DataFrame:
        """The table, a row per pair."""
        return self.table.copy()

    def _document(self) -> dict[str, Any]:
        """``bemt.choose/1``; all pairs, best first."""
        pairs, on_sale = (table.to_dict("records") for table in (self.table, self.on_sale))
        target = {**vars(self.target), **vars(self.target.use)}
        del target["use"]
        return {"schema": SCHEMA, "target": target, "sure": self.sure, "pairs": pairs, "on_sale": on_sale}

    @property
    def text(self) -> str:
        """One screen: what to take, and the best motor of each label."""
        t, good = self.target, len(self.good)
        at = "this thrust" if t.cruise_N is None else f"hover of {self.table.mass_kg.iloc[0]:.3g} kg"
        size = "" if t.airspeed_m_s == 0.0 else f" at {t.airspeed_m_s:g} m/s"
        fluid = "" if t.use.fluid == "air" else ", in water"
        pair = ", each one of a coaxial pair" if t.use.coaxial else ""
        what = f"{t.thrust_N:.3g} N"
        if t.mass_kg is not None and not t.fixed:
            what = f"{t.mass_kg:.3g} kg on {number_of(t.rotors, 'rotor')}"
        lines = [
            *self._headline(at),
            *self._to_buy(),
            *self._at_an_end(),
            *self._fast(),
            "",
            f"{what}{pair} on {t.cells}S at 50% charge{size}{fluid}, tip Mach up to {t.max_tip_mach:g}: "
            f"{good} of {len(self.table)} pairs meet it with a probability of {self.sure:.0%} or more",
            f"power, current and time at {at.partition(' of ')[0]} of one rotor; ± one standard deviation; best motor "
            "of each label",
            "peak A and full N: at full throttle, what the controller has to stand and what is reached",
        ]
        if t.rest_kg is not None:
            what = "" if t.told_rest else f"the first weighs {self.table.mass_kg.iloc[0]:.3g} kg in all, and "
            lines.append(
                f"{what}every pair lifts the same {t.rest_kg:.3g} kg and its own motors, propellers, controllers and "
                "frame (column g, of one rotor, by laws with a spread of 25 to 50 %): column kg is what hovers"
            )
        if t.max_diameter_in is None:
            lines.append("no limit on the diameter: give --max-diameter-in, or --arm-mm of the frame")
        if t.capacity_Ah is not None:
            lines.append(f"min: {1.0 - SOC_END:.0%} of the battery is flown, {SOC_END:.0%} stays in it")
        timed = "min" if t.capacity_Ah is not None else "min/Ah"
        head = [
            "propeller", "kv", "P(met)", "power W", "A", "peak A", "g/W", timed, "Mach", "full N", "g",
            *([] if t.rest_kg is None else ["kg"]), "why not the first",
        ]  # fmt: skip
        rows = [
            [r.label, f"{r.kv:.0f}", f"{r.probability:.0%}", _banded(r.power_W, r.u_power_W),
             *(number_text(v, 3) for v in (r.current_A, r.peak_A, r.g_per_W, r.minutes)), number_text(r.tip_mach, 2),
             number_text(r.full_thrust_N, 3), f"{r.propulsion_g:.0f}",
             *([] if t.rest_kg is None else [number_text(r.mass_kg, 3)]), r.why or "-"]
            for r in best_of_each(self.table).head(SHOWN).itertuples()
        ]  # fmt: skip
        return "\n".join([*lines, "", text_table(head, rows, range(len(head))), *self._stock()]) + "\n"

    def _at_an_end(self) -> list[str]:
        """Word of a first motor beyond which none was tried."""
        kvs = self.table.kv
        for end, word in ((kvs.max(), "largest"), (kvs.min(), "smallest")):
            if self.target.sized and kvs.nunique() > 1 and kvs.iloc[0] == end:
                if word == "largest" and self._fast():
                    return []  # no faster one is for this propeller
                return [f"{end:.0f} is the {word} K_v that was tried: --kv LOW:HIGH tries others"]
        return []

    def _fast(self) -> list[str]:
        """What `drive` says of the first pair, where it is a fast one."""
        t, first = self.target, self.table.iloc[0]
        if t.fan or t.use.fluid != "air":
            return []
        words = fast_words(first.kv, t.loaded_V, f"{t.cells}S", first.diameter_in * INCH)
        return [f"! {words}"] if words else []

    def _headline(self, at: str) -> list[str]:
        """What to take, and what the least power would be; else the nearest."""
        table, first, t = self.table, self.table.iloc[0], self.target
        same = table[(table.label == first.label) & (table.probability >= 0.5)]
        even = f" (an even chance from {same.kv.min():.0f})" if same.kv.min() < first.kv else ""
        if not len(self.good) and first.probability > 0.0:
            return [f"none meets it with a probability of {self.sure:.0%}; nearest is {first.label} with "
                    f"{first.kv:.0f} rev/min/V{even} at {first.probability:.0%}: {first.why}"]  # fmt: skip
        if not len(self.good):
            reach = table.loc[table.full_thrust_N.idxmax()]
            most = f"{reach.full_thrust_N:.3g} N, with {reach.label} at {reach.kv:.0f} rev/min/V"
            return [f"none meets it; the most is {most if reach.full_thrust_N > 0.0 else 'no thrust at all'}"]
        lines = [
            f"Take {first.label} with {first.kv:.0f} rev/min/V{even}: {_banded(first.power_W, first.u_power_W)} W at "
            f"{at}, {first.g_per_W:.3g} g/W" + (f", but it {first.why}" if first.why else "")
        ]
        least = self.good.mean_W.idxmin()
        if least != 0:
            other = table.loc[least]
            lines.append(
                f"The least power has {other.label} with {other.kv:.0f}: {1.0 - other.mean_W / first.mean_W:.1%} "
                f"less, {other.diameter_in - first.diameter_in:.3g} in larger"
                + ("" if t.rest_kg is None else f", {other.propulsion_g - first.propulsion_g:+.0f} g a rotor")
            )
        return lines

    def _to_buy(self) -> list[str]:
        """Which motor on sale to take: the nearest and most usual. The least power would be that of a wrong sheet."""
        if self.on_sale.empty:
            return []
        one = self.on_sale.iloc[0]
        power, chance = _banded(one.power_W, one.u_power_W), f"{one.probability:.0%}"
        return [
            f"On sale is {one.motor} ({one.kv:.0f} rev/min/V): with {one.label} it meets this at {chance}, {power} W, "
            f"{one.full_thrust_N:.3g} N at full throttle"
        ]

    def _stock(self) -> list[str]:
        """Motors on sale for the first propeller, and where they come from."""
        t, first = self.target, self.table.iloc[0]
        if not t.sized or t.use.fluid != "air" or first.probability < self.sure:
            return []
        if not (known := len(motors_on_sale())):
            return ["", 'Motors on sale by name: pip install "bemt[motors]"']
        source = f"{known:,} of {LIST} (Karakaya, Apache-2.0), makers' numbers; price and stock not known"
        if self.on_sale.empty:
            allowed = "within the amperes and watts of its maker"
            lead = f"No motor on sale near that K_v and mass is sure to turn {first.label} {allowed}"
            return ["", f"{lead}: none of {source}"]
        weighed = t.rest_kg is not None
        head = ["motor on sale", "kv", "g", *(["kg"] if weighed else []), "P(met)", "power W", "peak A", "of A",
                "full N"]  # fmt: skip
        rows = [
            [r.motor, f"{r.kv:.0f}", f"{r.motor_g:.0f}", *([number_text(r.mass_kg, 3)] if weighed else []),
             f"{r.probability:.0%}", _banded(r.power_W, r.u_power_W),
             *(number_text(v, 3) for v in (r.peak_A, r.max_current_A, r.full_thrust_N))]
            for r in self.on_sale.itertuples()
        ]  # fmt: skip
        lead = f"{first.label} on motors that are on sale, one of a maker ({source})"
        return ["", lead, text_table(head, rows, range(len(head)))]

    def write(self, out: str | Path) -> None:
        """Write document, table and picture to a folder."""
        folder = Path(out)
        write_atomic(folder / RESULTS[1], csv_text(list(self.table.columns), self.table.to_dict("records")))
        write_atomic(folder / RESULTS[2], self.picture())
        write_atomic(folder / RESULTS[0], json_text(self.to_dict()))

    def front(self) -> pd.DataFrame:
        """Pairs of the best motors that no smaller propeller beats in power, smallest first (the Pareto front)."""
        sure = best_of_each(self.good).sort_values(["diameter_in", "power_W"])
        return sure[sure.power_W < sure.power_W.cummin().shift(fill_value=math.inf)]

    def picture(self) -> bytes:
        """Power over diameter of the best motor of each label, coloured by probability, with the front. PNG bytes."""
        t = self.target
        best = best_of_each(self.table).dropna(subset=["power_W"])
        figure = canvas.figure(7.5, 4.6)
        ax = figure.add_subplot()
        dots = ax.scatter(
            best.diameter_in, best.power_W, c=best.probability, vmin=0.0, vmax=1.0, cmap="viridis", s=32, zorder=3
        )
        figure.colorbar(dots, ax=ax, label="probability that the target is met")
        edge = self.front()
        if len(edge):
            ax.errorbar(edge.diameter_in, edge.power_W, edge.u_power_W, color="#D55E00", lw=1.2, capsize=2,
                        label="least power for the size, ± one standard deviation")  # fmt: skip
            for row in edge.itertuples():
                ax.annotate(f"{row.label}, {row.kv:.0f}", (row.diameter_in, row.power_W), xytext=(-4, -4),
                            textcoords="offset points", fontsize=7, ha="right", va="top")  # fmt: skip
            ax.legend(frameon=False, fontsize=8)
        ax.set(xlabel="diameter [in]", ylabel=f"power at {t.at_N:.3g} N [W]")
        ax.set_title(f"{t.thrust_N:.3g} N on {t.cells}S: best motor of each propeller (label, rev/min/V)", fontsize=10)
        ax.margins(x=0.12)  # room for the labels to the left
        canvas.frame(ax)
        return canvas.png(figure)


def best_of_each(table: pd.DataFrame) -> pd.DataFrame:
    """The best motor of each label, in the order of the ranking."""
    return table.drop_duplicates("label").reset_index(drop=True)


def _banded(value: float, u: float) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value:.0f} ± {u:.0f}" if math.isfinite(u) and value >= 10.0 else number_text(value, 3)
