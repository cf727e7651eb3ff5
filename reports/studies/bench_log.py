"""A long log of a stand through ``import`` and ``diagnose``: wall and CPU time and peak memory of each."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

STEP_S, RATE_HZ, LAG_S = 10.0, 1000.0, 0.15
"""Duration of a step of the speed, samples per second, lag of the rotor."""
BLOCK = 50_000
"""Rows made at once: the peak memory of a process counts that of the one which started it."""


def write_log(path: Path, rows: int, seed: int = 1) -> None:
    """Write a log in blocks: steps of a 10x5 on a stand with noise and offsets, at rest at both ends."""
    import pandas as pd

    rng = np.random.default_rng(seed)
    levels = rng.uniform(3000.0, 8000.0, int((rows - 1) / RATE_HZ // STEP_S) + 1)
    levels[[0, -1]] = 0.0
    for first in range(0, rows, BLOCK):
        t = np.arange(first, min(first + BLOCK, rows)) / RATE_HZ
        step = (t // STEP_S).astype(int)
        before = np.concatenate([[0.0], levels[:-1]])[step]
        rpm = levels[step] + (before - levels[step]) * np.exp(-(t - step * STEP_S) / LAG_S)
        rpm[rpm < 1.0] = 0.0
        torque, volt, noise = 2e-9 * rpm**2, 16.0 - 1e-8 * rpm**2, rng.normal(size=(4, t.size))
        columns = {
            "time_s": t.round(4),
            "rpm": np.where(rpm > 0.0, rpm + 5.0 * noise[0], 0.0).round(1),
            "thrust_N": (1.2e-7 * rpm**2 + 0.02 + 0.02 * noise[1]).round(4),
            "torque_Nm": (torque + 0.001 + 0.001 * noise[2]).round(5),
            "voltage_V": (volt + 0.01 * noise[3]).round(3),
            "current_A": np.where(rpm > 0.0, torque * rpm * 0.131 / volt + 0.1, 0.0).round(3),
        }
        pd.DataFrame(columns).to_csv(path, mode="a", header=first == 0, index=False)


def _run(words: list[str]) -> dict[str, Any]:
    """One command in a process of its own."""
    began = time.perf_counter()
    process = subprocess.Popen([sys.executable, "-m", "bemt", *words], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return {
        "command": words[0],
        "exit": process.returncode,
        "wall_s": time.perf_counter() - began,
        "cpu_s": used.ru_utime + used.ru_stime,
        "peak_MB": used.ru_maxrss / 1024.0,
    }


def document(rows: int) -> dict[str, Any]:
    """Write the log, run both commands, measure them."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "log.csv")
        write_log(log, rows)
        case = str(Path(folder, "case"))
        _run(["new", "10x5", "--out", case])
        runs = [_run(["import", str(log)]), _run(["diagnose", str(log), "--case", case])]
        return {"schema": "bemt.bench-log/1", "rows": rows, "MB": log.stat().st_size / 1e6, "runs": runs}


def table(found: dict[str, Any]) -> str:
    """A line for each command."""
    lines = [f"{found['rows']} rows, {found['MB']:.0f} MB"]
    lines += [
        f"{r['command']:>9}: {r['wall_s']:6.1f} s wall, {r['cpu_s']:6.1f} s CPU, {r['peak_MB']:5.0f} MB"
        f"{'' if r['exit'] in (0, 1) else ', exit ' + str(r['exit'])}"
        for r in found["runs"]
    ]
    return "\n".join(lines)
