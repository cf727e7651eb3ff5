"""What users wait for: answers with bands in a warm process, a folder of cases, and the first answer of a machine.

Only names that every version has are called, so that ``--tree CHECKOUT`` can time another checkout in the same run.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

LINES = {
    "one_point_ms": ("one point with bands, warm process", "ms"),
    "new_speed_ms": ("another speed with bands, warm process", "ms"),
    "many_points_s": ("10,000 points with bands, warm process", "s"),
    "sweep_first_s": ("sweep cases/ in process, first time", "s"),
    "sweep_s": ("sweep cases/ in process, again", "s"),
    "first_answer_s": ("first answer from nothing, whole process", "s"),
    "labels_MB": ("most memory of a process that asks for 21 labels", "MB"),
}
"""Keys of the document: words and unit. Times are CPU time, user and system."""

_WARM = """
import json, sys, time
import numpy as np
import bemt

def best(call, repeats):
    call()
    times = []
    for _ in range(repeats):
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    return min(times)

repeats, cases = int(sys.argv[1]), sys.argv[2]
rotor = bemt.propeller("10x5")
rpm, V = np.linspace(2000.0, 9000.0, 10000), np.linspace(0.0, 20.0, 10000)
out = {"one_point_ms": 1e3 * best(lambda: rotor.solve(6000), 5 * repeats)}
speeds = iter(np.linspace(3100.0, 8900.0, 5 * repeats + 1))
out["new_speed_ms"] = 1e3 * best(lambda: rotor.solve(next(speeds)), 5 * repeats)
out["many_points_s"] = best(lambda: rotor.solve(rpm, V), repeats)
if cases:
    from bemt.rotors.case import find_cases, load_case
    try:
        from bemt.judge.compare.sweep.case import solve_case  # until 0.2
    except ImportError:
        from bemt.results.sweep.case import solve_case
    loaded = [load_case(file) for file in find_cases([cases])]
    solve_case(loaded[0])  # compiled
    def sweep():
        for case in loaded:
            solve_case(case)
    began = time.process_time()
    sweep()
    out["sweep_first_s"] = time.process_time() - began
    out["sweep_s"] = best(sweep, repeats)
print(json.dumps(out))
"""
_FIRST = 'import bemt; print(bemt.propeller("10x5").solve(6000).thrust_N)'
_LABELS = 'import bemt; [bemt.propeller(f"{D}x{D / 2:g}").solve(6000) for D in range(5, 26)]'


def _run(words: list[str], tree: Path, **more: str) -> tuple[str, resource.struct_rusage]:
    """Output and use of the machine of a Python process that imports from a checkout."""
    env = os.environ | {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"} | more
    with tempfile.TemporaryFile() as out:
        process = subprocess.Popen([sys.executable, *words], cwd=tree, env=env, stdout=out)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        text = out.read().decode()
    if process.returncode:
        raise RuntimeError(f"python {words[0]} in {tree} ended with {process.returncode}")
    return text, used


def measure(tree: Path, quick: bool = False) -> dict[str, float]:
    """Times of one checkout, by the keys of `LINES`."""
    cases = tree / "cases"
    text, _ = _run(["-c", _WARM, "1" if quick else "3", str(cases) if cases.is_dir() else ""], tree)
    found: dict[str, float] = json.loads(text.splitlines()[-1])
    with tempfile.TemporaryDirectory() as empty:
        caches = {"BEMT_CACHE": f"{empty}/bemt", "NUMBA_CACHE_DIR": f"{empty}/numba", "BEMT_COMPILE": ""}
        used = _run(["-c", _FIRST], tree, **caches)[1]
    found["first_answer_s"] = used.ru_utime + used.ru_stime
    found["labels_MB"] = 1.024e-3 * _run(["-c", _LABELS], tree)[1].ru_maxrss
    return found


def here() -> Path:
    """This checkout."""
    return Path(__file__).resolve().parents[2]


def document(other: Path | None = None, quick: bool = False) -> dict[str, Any]:
    """Times of this checkout, and of another one in the same run."""
    found: dict[str, Any] = {"schema": "bemt.bench-waiting/1", "this": measure(here(), quick)}
    if other is not None:
        found["other"] = {"tree": str(other), **measure(other.resolve(), quick)}
    return found


def table(found: dict[str, Any]) -> str:
    """A line for each time."""
    other = found.get("other")
    lines = ["CPU time, user and system" + (f"; {'this':>18}{'other':>10}{'ratio':>8}" if other else "")]
    for key, (words, unit) in LINES.items():
        if key not in found["this"]:
            continue
        mine = found["this"][key]
        more = f"{other[key]:>10.3g}{mine / other[key]:>8.2f}" if other and key in other else ""
        lines.append(f"{words:<42}{mine:>7.3g} {unit:<2}{more}")
    return "\n".join(lines)
