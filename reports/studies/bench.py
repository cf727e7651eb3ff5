"""Time per operating point: ``python reports/studies/bench.py [--json] [--quick] [--work DIR]``.

``--log N`` times `import` and `diagnose` on a generated log of N rows instead, ``--waiting [--tree CHECKOUT]`` what a
user waits for.

The work: one two-bladed 10x5 in 30 elements with one NACA 4412 table of one Reynolds number, at 3000, 5000 and 6700
rev/min and 20 advance ratios from 0 to 0.8.  See `bench_work.py`; ``--work DIR`` times the same on other
files of its layout (``<name>_edges31.csv``, ``<name>_mid30.csv``, ``polar_*.csv``).

All times are CPU time of one thread, best of several repeats, after compilation.  Physics as in the peers: tip and hub
loss, swirl; ``standard`` repeats the batch with every standard effect on.  JSON: schema ``bemt.bench/1``.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bench_log
import bench_waiting
import bench_work
import numpy as np
from bench_work import BLADES, DIAMETER, RE, RPM, Work, prepare
from numpy.typing import ArrayLike

from bemt import __version__
from bemt.physics import coefficients as co
from bemt.physics.air import Air

SCHEMA = "bemt.bench/1"


def cpu_us(call: Callable[[], Any], points: int, repeats: int, seconds: float = 0.05) -> float:
    """CPU time per point of a call, best of several repeats. [us]"""
    start = time.process_time()
    call()
    number = max(1, math.ceil(seconds / max(time.process_time() - start, 1e-6)))
    best = math.inf
    for _ in range(repeats):
        start = time.process_time()
        for _ in range(number):
            call()
        best = min(best, time.process_time() - start)
    return best / number / points * 1e6


def measure(work: Work, quick: bool = False) -> dict[str, Any]:
    """Time our solver on the work. [us]"""
    from bemt.physics.bem import solver

    air = Air.from_density()
    rpm, V = work.rpm, work.V
    n = rpm.size
    start = time.perf_counter()
    prep = prepare(work)
    solver.solve(prep, rpm, V, air)
    solver.solve_point(prep, float(rpm[0]), float(V[0]), air)
    compile_s = time.perf_counter() - start
    pairs = [(float(w), float(v)) for w, v in zip(rpm, V, strict=True)]

    def singles() -> None:
        for w, v in pairs:
            solver.solve_point(prep, w, v, air)

    repeats = 3 if quick else 15
    many = 100 if quick else 1000
    large = (np.tile(rpm, many), np.tile(V, many))
    full = prepare(work, None)
    sweep = np.ones(4_000_000)
    cold, made = [], []
    for i in range(20 if quick else 120):
        start = time.process_time()
        fresh = prepare(work)
        made.append(time.process_time() - start)
        sweep += 1.0  # 32 MB: the tables of the fresh rotor leave the caches
        w, v = pairs[(7 * i) % n]
        start = time.process_time()
        solver.solve_point(fresh, w, v, air)
        cold.append(time.process_time() - start)
    sol = solver.solve(prep, rpm, V, air)
    return {
        "us_per_point": {
            "batch": cpu_us(lambda: solver.solve(prep, rpm, V, air), n, repeats),
            "single_warm": cpu_us(singles, n, repeats),
            "single_cold": float(np.median(cold)) * 1e6,
            "single_solve": cpu_us(lambda: solver.solve(prep, rpm[7], V[7], air), 1, repeats),
            "batch_large": cpu_us(lambda: solver.solve(prep, *large, air), n * many, 1 if quick else 3),
            "standard": cpu_us(lambda: solver.solve(full, rpm, V, air), n, repeats),
        },
        "prepare_ms": float(np.median(made)) * 1e3,
        "compile_s": compile_s,
        "rpm": rpm.tolist(),
        "J": sol.J.tolist(),
        "CT": _numbers(sol.CT),
        "CP": _numbers(sol.CP),
        "converged": int(np.sum(sol.converged)),
    }


def _numbers(values: ArrayLike) -> list[float | None]:
    return [float(v) + 0.0 if math.isfinite(v) else None for v in np.asarray(values, dtype=float)]


def ccblade(work: Work, quick: bool = False) -> dict[str, Any]:
    """Time CCBlade of WISDEM on the work, if it is installed. [us]

    CCBlade is a turbine code: the propeller is given to it with its sections turned over, cl'(alpha) = -cl(-alpha), and
    thrust and torque change sign.  Its splines smooth the table.  At J = 0 it returns zero loads without a warning.
    """
    try:
        from wisdem.ccblade.ccblade import CCAirfoil, CCBlade
    except Exception as error:
        missing = isinstance(error, ImportError) and "wisdem" in str(error)
        reason = "not installed (pip install wisdem)" if missing else f"import failed: {type(error).__name__}: {error}"
        return {"us_per_point": None, "note": reason}
    try:
        air, R = Air.from_density(), 0.5 * DIAMETER
        alpha = -work.alpha_deg[::-1]
        foil = CCAirfoil(alpha, [RE], -work.cl[::-1, None], work.cd[::-1, None])
        rotor = CCBlade(
            work.r_R * R, work.c_R * R, work.beta_deg, [foil] * work.r_R.size, float(work.edges[0]) * R, R, BLADES,
            air.rho, air.mu, shearExp=0.0,
        )  # fmt: skip
        zero = np.zeros(work.rpm.size)
        loads = rotor.evaluate(work.V, work.rpm, zero)
        loads = loads[0] if isinstance(loads, tuple) else loads
        T, Q = -np.asarray(loads["T"]), -np.asarray(loads["Q"])
        us = cpu_us(lambda: rotor.evaluate(work.V, work.rpm, zero), work.rpm.size, 1 if quick else 3)
    except Exception as error:  # a peer that fails is a result, not a fault of ours
        return {"us_per_point": None, "note": f"failed: {type(error).__name__}: {error}"}
    n = work.rpm / 60
    CT, CP = co.CT(T, air.rho, n, DIAMETER), co.CP_from_CQ(co.CQ(Q, air.rho, n, DIAMETER))
    still = np.asarray(work.V) == 0
    note = "returns zero thrust and torque at J = 0" if np.all(T[still] == 0) else ""
    return {"us_per_point": us, "note": note, "CT": _numbers(CT), "CP": _numbers(CP)}


PEERS: dict[str, Callable[[Work, bool], dict[str, Any]]] = {"wisdem CCBlade": ccblade}


def machine() -> dict[str, Any]:
    """Describe the machine and the libraries that decide the times."""
    from importlib.metadata import PackageNotFoundError, version

    cpu = platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        cpu = next((x.partition(":")[2].strip() for x in lines if x.startswith("model name")), cpu)
    except OSError:
        pass
    versions = {}
    for name in ("numpy", "numba"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "absent"
    return {"processor": cpu or platform.machine(), "cores": os.cpu_count(), "system": platform.platform(),
            "python": platform.python_version(), **versions}  # fmt: skip


def document(work: Work, quick: bool = False) -> dict[str, Any]:
    """Measure everything."""
    ours = measure(work, quick)
    peers = {name: run_peer(work, quick) for name, run_peer in PEERS.items()}
    return {
        "schema": SCHEMA, "version": __version__, "work": work.name, "points": int(work.rpm.size),
        "elements": int(work.r_R.size), "threads": 1, "quick": quick, **ours,
        "peers": {name: p["us_per_point"] for name, p in peers.items()},
        "peer_notes": {name: p["note"] for name, p in peers.items()},
        "peer_results": {name: {k: p[k] for k in ("CT", "CP")} for name, p in peers.items() if "CT" in p},
        "machine": machine(),
    }  # fmt: skip


_LABELS = {
    "batch": "batch, one call for all points", "single_warm": "single points, one after another",
    "single_cold": "first point of a fresh rotor", "single_solve": "single point through solve()",
    "batch_large": "batch, many points in one call", "standard": "batch, all standard effects on",
}  # fmt: skip


def table(doc: dict[str, Any]) -> str:
    """Lay the document out for a terminal."""
    m = doc["machine"]
    out = [
        f"work {doc['work']}: {doc['points']} points, {doc['elements']} elements, 1 thread, CPU time, best of repeats",
        f"{m['processor']}, {m['cores']} cores, Python {m['python']}, numpy {m['numpy']}, numba {m['numba']}",
        "",
        f"{'':<36}{'us per operating point':>24}",
    ]
    out += [f"{_LABELS[key]:<36}{us:>24.2f}" for key, us in doc["us_per_point"].items()]
    for name, us in doc["peers"].items():
        note = doc["peer_notes"][name]
        out.append(f"{'peer: ' + name:<36}{'-' if us is None else format(us, '.1f'):>24}{'  ' + note if note else ''}")
    out += [
        "",
        f"prepare {doc['prepare_ms']:.1f} ms; compile or load from cache, once: {doc['compile_s']:.1f} s; "
        f"{doc['converged']} of {doc['points']} converged",
        "",
        f"{'J':>6} {'CT':>8} {'CP':>8}   at {RPM[1]:.0f} rev/min",
    ]
    rows = [r for r in zip(doc["rpm"], doc["J"], doc["CT"], doc["CP"], strict=True) if r[0] == RPM[1]]
    for _, J, CT, CP in rows[::3]:
        out.append(f"{J:>6.3f} " + " ".join(f"{'-':>8}" if c is None else f"{c:>8.4f}" for c in (CT, CP)))
    return "\n".join(out)


def main(words: list[str] | None = None) -> int:
    """Print the times; 1 when a point of the work did not converge."""
    parser = argparse.ArgumentParser(description="Time per operating point, ours and the peers'.")
    parser.add_argument("--json", action="store_true", help="print the document")
    parser.add_argument("--quick", action="store_true", help="fewer repetitions")
    parser.add_argument("--work", metavar="DIR", help="the benchmark in this folder")
    parser.add_argument("--log", type=int, metavar="N", help="time and memory for a generated log of N rows instead")
    parser.add_argument("--waiting", action="store_true", help="time what users wait for instead")
    parser.add_argument("--tree", type=Path, metavar="DIR", help="with --waiting: another checkout, in the same run")
    args = parser.parse_args(words)
    if args.waiting:
        found, shown = bench_waiting.document(args.tree, args.quick), bench_waiting.table
    elif args.log is not None:
        found, shown = bench_log.document(args.log), bench_log.table
    else:
        found, shown = document(bench_work.load(args.work), args.quick), table
    print(json.dumps(found, indent=1, allow_nan=False) if args.json else shown(found))
    lost = found.get("points", 0) - found.get("converged", 0)
    if lost:
        print(f"{lost} points did not converge", file=sys.stderr)
    return int(lost > 0)


if __name__ == "__main__":
    raise SystemExit(main())
