"""Does `choose` put the propeller first that measured best: benches with several propellers on one motor or drive.

    python docs/choose_benches.py DATA

DATA holds the recorded benches (docs/choose.md names them). At a thrust that every propeller of a bench reached, the
measured g/W are ranked against those of `choose` for the same labels on one motor of the same K_v, which knows no blade
and no loss of the bench. Where no motor was on the stand (shaft power), the motor of `choose` has no losses either.
Below the table: how far power lies from the stated one, and where a battery was on the stand its current (the voltage
there differs by a few per cent only). Current is compared at a thrust, not at full throttle, which two stands never
reached: the supply of the RS2205S gives 11 A and drops from 11 to 8 V, WVU's ramps end at a pulse of 1,544 us.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bemt import choose
from bemt.base.units import G0, INCH
from bemt.data.readers.uiuc_names import UiucName, class_of, parse_file_name
from bemt.tools.design.motors_file import KnownMotor
from bemt.tools.design.rotor_loads import rotor_loads, scatter, size_in
from bemt.tools.design.search import POWER_BAND

Array = NDArray[np.float64]
LBF = 4.4482216
KT = 0.514444
SHARES = (0.3, 0.6, 0.9)
"""Thrusts that are compared, over the most that every propeller reached [1]."""
IDEAL = KnownMotor("no losses", 1000.0, 1e-4, 0.0)
SUFFIX = {"electric": "E", "slow_flyer": "SF"}
UIUC = {"8 in": 8.0, "9 in": 9.0, "10 in": 10.0, "11 in": 11.0}


@dataclass(frozen=True, eq=False)
class Bench:
    """Labels with their measured thrusts [N] and powers [W], and what turned them."""

    name: str
    rows: dict[str, tuple[Array, Array]]
    motor: KnownMotor
    cells: int
    airspeed_m_s: float = 0.0


def power_at(thrust_N: float, thrusts: Array, powers: Array) -> float:
    """Power at a thrust: a line through the nearest points, of the logarithms. [W]"""
    x, y = np.log(thrusts / thrust_N), np.log(powers)
    near = np.argsort(np.abs(x))[: max(4, x.size // 6)]
    slope, at = np.polyfit(x[near], y[near], 1)
    return float(np.exp(at))


def _clean(T: Array, P: Array, least: float = 0.1) -> tuple[Array, Array]:
    good = np.isfinite(T) & np.isfinite(P) & (P > 0.0)
    T, P = T[good], P[good]
    keep = least * T.max() < T
    return T[keep], P[keep]


def tunnel(folder: Path) -> Iterator[Bench]:
    """West Virginia University: throttle ramps of some 20 s, so only up to the greatest thrust.

    Behind it the rotor gives back what it has stored: at 10 N the power is a quarter to a half of that on the way up.
    """
    runs: dict[int, dict[str, tuple[Array, Array]]] = {0: {}, 35: {}, 45: {}}
    for file in sorted((folder / "contrasts/pitch_diameter_wvu_tunnel").glob("run??_*kt.csv")):
        run, label, wind = file.stem.split("_")
        table = pd.read_csv(file)
        T, volt, amp = (table[c].to_numpy(float) for c in ("Thrust (lbf)", "Voltage (V)", "Current (A)"))
        top = int(np.argmax(pd.Series(T).rolling(5, center=True, min_periods=1).median()))
        if run != "run15":  # the same as run 2
            runs[int(wind[:-2])][label] = _clean(LBF * T[: top + 1], volt[: top + 1] * amp[: top + 1])
    for wind_kt, rows in runs.items():
        yield Bench(f"WVU, {wind_kt} kt", rows, KnownMotor("M", 420.0), 6, wind_kt * KT)


def racing(folder: Path) -> Iterator[Bench]:
    """RCbenchmark: an EMAX RS2205S 2600 with four propellers, at the voltages of two and three cells."""
    labels = {"a1": "5x4x3", "a2": "5x4.5x3", "a4": "5x4"}  # a3 has the label of a2
    for volts, cells in ((7, 2), (11, 3)):
        rows = {}
        for key, label in labels.items():
            tables = [pd.read_csv(folder / f"rcbenchmark/{key}_{volts}.csv", encoding="utf-8-sig")]
            if key == "a2":
                tables.append(pd.read_csv(folder / f"rcbenchmark/a3_{volts}.csv", encoding="utf-8-sig"))
            T, P = (
                np.concatenate([t[c].to_numpy(float)[: int(t["Thrust (gf)"].argmax()) + 1] for t in tables])
                for c in ("Thrust (gf)", "Electrical Power (W)")
            )
            rows[label] = _clean(1e-3 * G0 * T, P)
        yield Bench(f"RS2205S 2600, {cells}S", rows, KnownMotor("RS2205S", 2600.0), cells)


def thrust_tool(folder: Path) -> Iterator[Bench]:
    """Author's stand of thrust_tool: an ECO 2814C with three labels on 3S and 4S, an MN2206 with three.

    The current of the MN2206's runs is wrong between 2 and 9 A (the shaft would give up to 1.5 times what the battery
    does), so that its propellers are compared by shaft power.
    """
    eco = {"aeronaut-12x6_3s": "12x6", "graupner-12x6_3s": "12x6", "graupner-10x6_4s": "10x6", "aeronaut-9x7_4s": "9x7"}
    small = {"gemfanbull6045_3s": "6x4.5", "hqprop6x3-5_3s": "6x3.5", "hqprop6x4x3_3s": "6x4x3"}
    for labels, shaft in ((eco, False), (small, True)):
        rows: dict[str, tuple[Array, Array]] = {}
        for part, label in labels.items():
            table = pd.concat([pd.read_csv(f) for f in (folder / "jmajew").glob(f"*_{part}_table*.csv")])
            omega = table.rpm.to_numpy(float) * math.pi / 30.0
            P = 1e-5 * G0 * table.tq.to_numpy(float) * omega if shaft else table.pin.to_numpy(float)
            old = rows.get(label, (np.empty(0), np.empty(0)))
            T, P = _clean(1e-3 * G0 * table.th.to_numpy(float), P)
            rows[label] = np.r_[old[0], T], np.r_[old[1], P]
        yield (Bench("MN2206, shaft", rows, IDEAL, 12) if shaft
               else Bench("ECO 2814C, 3S and 4S", rows, KnownMotor("ECO 2814C", 850.0), 4))  # fmt: skip


def aerocats(folder: Path) -> Bench:
    """University of Cincinnati: APC E propellers; thrust and torque in separate runs, so power by CP at the speed."""
    table = pd.read_csv(folder / "contrasts/density_aerocats/aerocats_static.csv")
    rows = {}
    for _, one in table.groupby("propeller"):
        D, P = float(one.D_in.iloc[0]), float(one.pitch_in.iloc[0])
        thrust, torque = (one[one.quantity == q].sort_values("rpm") for q in ("thrust", "torque"))
        if len(thrust) < 4 or len(torque) < 4:
            continue
        n = thrust.rpm.to_numpy(float)
        CP = np.interp(n, torque.rpm, torque.CT_or_CP)
        d5 = (D * INCH) ** 5
        power = CP * thrust.rho_kg_m3_dry.to_numpy(float) * (n / 60.0) ** 3 * d5
        rows[f"{D:g}x{P:g}E"] = _clean(thrust["value_N_or_Nm"].to_numpy(float), power)
    return Bench("Aerocats, shaft", rows, IDEAL, 12)


def _static(folder: Path) -> Iterator[tuple[UiucName, Array, Array, Array]]:
    """UIUC's propellers of two blades on sale, with speed [rev/min], CT and CP at rest."""
    for file in sorted(folder.glob("uiuc*/volume-*/*_static_*.txt")):
        parsed = parse_file_name(file.stem)
        one = None if parsed is None else parsed.propeller
        if one is not None and one.pitch_in and not one.family.startswith(("da4", "nr")) and (one.blades or 2) == 2:
            yield one, *np.loadtxt(file, skiprows=1, ndmin=2).T[:3]


def _label(one: UiucName) -> str:
    return f"{one.diameter_in:g}x{one.pitch_in:g}{SUFFIX.get(class_of(one.family) or '', '')}"


def uiuc(folder: Path) -> Iterator[Bench]:
    """UIUC static runs by diameter, two blades, printed families left out; equal labels of several makers together."""
    found: dict[str, dict[str, tuple[Array, Array]]] = {name: {} for name in UIUC}
    for one, rpm, CT, CP in _static(folder):
        for name, D in UIUC.items():
            if one.diameter_in == D:
                n, label = rpm / 60.0, _label(one)
                T, P = 1.225 * CT * n**2 * (D * INCH) ** 4, 1.225 * CP * n**3 * (D * INCH) ** 5
                old = found[name].get(label, (np.empty(0), np.empty(0)))
                found[name][label] = np.r_[old[0], T], np.r_[old[1], P]
    for name, rows in found.items():
        yield Bench(f"UIUC {name}, shaft", rows, IDEAL, 12)


def labels(folder: Path) -> Iterator[tuple[str, float, float]]:
    """Family of each of UIUC's propellers, how far shaft power at its middle thrust is from the label's, and its u."""
    for one, rpm, CT, CP in _static(folder):
        i, label = rpm.size // 2, _label(one)
        D = size_in(label) * INCH
        found = rotor_loads(label, 1.3 * rpm[i], 0.0)
        if found is None:
            continue
        n, band = rpm[i] / 60.0, scatter(label, rpm[i], 0.0)
        T = np.interp(rpm[i], found.rpm, found.thrust_N) / (1.225 * n**2 * D**4)
        P = 2.0 * math.pi * found.torque_at(rpm[i : i + 1])[0] / (1.225 * n**2 * D**5)
        u2 = band.u_torque**2 + (1.5 * band.u_thrust) ** 2 - 3.0 * band.correlation * band.u_thrust * band.u_torque
        yield one.family, math.log(P / CP[i]) - 1.5 * math.log(T / CT[i]), POWER_BAND * math.sqrt(u2)


def benches(folder: Path) -> Iterator[Bench]:
    """Every bench with three propellers or more on one motor, then those on a dynamometer."""
    yield from tunnel(folder)
    yield from racing(folder)
    yield from thrust_tool(folder)
    yield aerocats(folder)
    yield from uiuc(folder)


def compared(bench: Bench) -> Iterator[tuple[float, dict[str, tuple[float, float, float, float]]]]:
    """Thrusts [N], and g/W of each label there: measured, predicted, its relative u, and by the mean power."""
    most = min(T.max() for T, _ in bench.rows.values())
    for share in SHARES:
        thrust = float(f"{share * most:.2g}")
        inside = {label: row for label, row in bench.rows.items() if row[0].min() <= 1.05 * thrust}
        if len(inside) < 3:
            continue
        table = choose(
            thrust, bench.cells, labels=list(inside), motors=[bench.motor], airspeed_m_s=bench.airspeed_m_s,
            max_tip_mach=0.95,
        ).set_index("label")  # fmt: skip
        out = {
            label: (1e3 * thrust / G0 / power_at(thrust, *row), float(table.g_per_W[label]),
                    float(table.u_power_W[label] / table.power_W[label]),
                    1e3 * thrust / G0 / float(table.mean_W[label]))
            for label, row in inside.items()
            if math.isfinite(table.g_per_W[label])
        }  # fmt: skip
        if len(out) >= 3:
            yield thrust, out


def main() -> None:
    """Print the table."""
    folder = Path(sys.argv[1])
    right = total = 0
    losses, errors = [], []
    print("| bench | propellers | thrust N | measured best | first of `choose` | loses |\n|---|---|---|---|---|---|")
    for bench in benches(folder):
        for thrust, found in compared(bench):
            best, first = (max(found, key=lambda label: found[label][i]) for i in (0, 3))
            lost = 1.0 - found[first][0] / found[best][0]
            total, right = total + 1, right + (first == best)
            losses.append(lost)
            errors += [(bench.name, a / b - 1.0, u) for a, b, u, _ in found.values()]
            shown = [f"{label}, {found[label][0]:.3g} ({found[label][1]:.3g})" for label in (best, first)]
            row = (bench.name, f"{len(found)}", f"{thrust:g}", *shown, "-" if first == best else f"{lost:.1%}")
            print(f"| {' | '.join(row)} |", flush=True)
            if "-v" in sys.argv:
                print("   ", {k: (round(a, 2), round(b, 2)) for k, (a, b, *_) in found.items()})
    table = pd.DataFrame(errors, columns=["bench", "error", "u"])
    battery, rest = ~table.bench.str.contains("shaft"), ~table.bench.str.contains("[1-9] kt")
    groups = {"power": table, "current": table[battery], "current at rest": table[battery & rest]}
    groups |= dict(iter(table.groupby("bench"))) if "-v" in sys.argv else {}
    for what, some in groups.items():
        z = (some.error / some.u).abs()
        print(f"{what}: {len(some)} readings, off by {some.error.abs().median():.1%} in the median; "
              f"{(z < 1.0).mean():.0%} within one u, {(z < 2.0).mean():.0%} within two")  # fmt: skip
    stand = table.bench.str.partition(",")[0].str.replace(r"UIUC.*", "UIUC", regex=True)
    known = pd.DataFrame(labels(folder), columns=["bench", "error", "u"])
    table, known = (t.assign(z=(t.error / t.u).abs()) for t in (table.assign(bench=stand), known))
    both = pd.concat([table, known])
    for what, some in {"benches": table, "labels of UIUC": known, "both": both}.items():
        rms = {one: math.sqrt((both.z[both.bench != one] ** 2).mean()) for one in some.bench.unique()}
        held = some.z / some.bench.map(rms)
        print(f"{what}: {len(some)}, rms {math.sqrt((some.z**2).mean()):.2f} of u; by all but the same stand or "
              f"family {(held < 1.0).mean():.0%} within one, {(held < 2.0).mean():.0%} within two")  # fmt: skip
    print(f"{right} of {total} right; g/W lost: mean {np.mean(losses):.1%}, most {np.max(losses):.1%}")


if __name__ == "__main__":
    main()
