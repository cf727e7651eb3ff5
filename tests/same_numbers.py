"""Same numbers before and after a change of structure: run every command that prints JSON, then compare two such runs.

``python tests/same_numbers.py save FOLDER [--tree CHECKOUT]`` runs the commands in a checkout and keeps the output;
``python tests/same_numbers.py compare BEFORE AFTER`` lists every number that differs by more than 1e-9 of its size and
every key that came or went, and exits 1 when there is one. Keys that name versions, times or files are left out.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
TOLERANCE = 1e-9
PASSING = {"version", "revision", "seconds", "time", "date", "out", "path", "written", "files", "sha256", "hash"}

D = "{data}"
FLUENT = [f"reports/diagnosis/fluent_{n}.csv" for n in ("8x5", "10x5", "12x6", "14x8")]
CASES = [f"cases/prop_{n}" for n in ("8x5", "10x5", "12x6", "14x8")]
CFD = ["--reference", "reports/diagnosis/cfd_reference.csv", "--case", "cases/prop_8x5"]
COMMANDS: dict[str, list[str]] = {
    "sweep": ["sweep", "cases/", "--json"],
    "validate_1": ["validate", f"{D}/uiuc/volume-1", "--json"],
    "validate_2": ["validate", f"{D}/uiuc/volume-2", "--json"],
    "reproduce": ["reports/studies/reproduce.py", "--json"],
    "diagnose_fluent": ["diagnose", *FLUENT, "--case", *CASES, "--json"],
    "diagnose_k1k2": ["diagnose", *FLUENT, "--case", *CASES, "--baseline", "k1k2", "--json"],
    **{f"diagnose_{n}": ["diagnose", f"reports/diagnosis/cfd_{n}.csv", *CFD, "--json"]
       for n in ("pitch", "plate", "duct", "compressible")},
    "plan": ["plan", "reports/diagnosis/cfd_pitch.csv", "--case", "cases/prop_8x5", "--json"],
    "drive": ["drive", "cases/ds30", "--json"],
    "map": ["map", f"{D}/thrust_map/xNova-SR-steps.csv", "--sign", "-1", "--json"],
    "motor": ["motor", "reports/drive/motor_mn4006", "--json"],
    "cfd": ["reports/studies/own_cfd.py", "reports/cfd", "--json"],
    "calibrate": ["calibrate", f"{D}/uiuc/volume-1", "--test", f"{D}/uiuc/volume-2", "--json"],
    "estimate": ["estimate", "10x5", "--rpm", "6000", "--airspeed-m-s", "5", "10", "--json"],
    "effects": ["effects", "--json"],
    "import_fluent": ["import", f"{D}/cfd_exports/screw/report-def-0-rfile.out", "--json"],
    "import_bench": ["import", f"{D}/jmajew/grp01__f1507_hqprop76x8_4s_table1.csv", "--json"],
    "compare": ["compare", "reports/diagnosis/cfd_reference.csv", "reports/diagnosis/cfd_pitch.csv", "--json"],
    "compare_case": ["compare", "reports/diagnosis/cfd_reference.csv", "reports/diagnosis/cfd_duct.csv", "--case",
                     "cases/prop_8x5", "--json"],
    "fly": ["fly", f"{D}/flight_logs/cf21_brushed_34.7g_jana00.usdlog", "--mass-kg", "0.0347", "--case", "1.8x1.2",
            "--healthy", f"{D}/flight_logs/cf21_brushed_34.7g_jana02.usdlog",
            f"{D}/flight_logs/cf21_brushed_34.7g_jana11.usdlog", "--json"],
    "fly_autopilot": ["fly", f"{D}/flight_logs/air_octoquad_00000012.BIN", "--json"],
    "fly_px4": ["fly", f"{D}/flight_logs/udesa_quad_cut_15mm_one_blade_log13.ulg.gz", "--json"],
    "export": ["export", "cases/prop_8x5", "--out", "{out}", "--json", "--format", "table", "jsbsim", "gazebo",
               "xrotor"],
    "design": ["design", "--thrust-N", "6", "--airspeed-m-s", "15", "--rpm", "7000", "--diameter-in", "10", "--out",
               "{out}", "--json"],
}  # fmt: skip


def save(folder: Path, tree: Path, only: list[str]) -> None:
    """Run the commands in a checkout; keep what they print, and their exit codes."""
    folder.mkdir(parents=True, exist_ok=True)
    data = os.environ.get("BEMT_DATA", str((tree / "../shared/data").resolve()))
    for name, words in COMMANDS.items():
        if only and name not in only:
            continue
        module = [] if words[0].endswith(".py") else ["-m", "bemt"]
        one = {**os.environ, "PYTHONPATH": "", "OPENBLAS_NUM_THREADS": "1"}  # several threads differ in the last digits
        with tempfile.TemporaryDirectory() as made:
            line = [sys.executable, *module, *(w.format(data=data, out=f"{made}/out") for w in words)]
            done = subprocess.run(line, cwd=tree, capture_output=True, text=True, env=one)
            text = (done.stdout or json.dumps({"error": done.stderr[-2000:]})).replace(made, "made")
            if "{out}" in words:
                text = json.dumps({"answer": json.loads(text), "made": in_files(Path(made))})
        (folder / f"{name}.json").write_text(text)
        print(f"{name}: exit {done.returncode}, {len(done.stdout)} characters", flush=True)


def in_files(folder: Path) -> dict[str, list[float]]:
    """Every number in the texts of a folder, by file; those of a manifest are of sizes and dates."""
    numbers = re.compile(r"(?<![\w.])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?(?![\w.])")
    found = (p for p in sorted(folder.rglob("*")) if p.is_file() and p.name != "manifest.json" and p.suffix != ".png")
    return {p.relative_to(folder).as_posix(): [float(x) for x in numbers.findall(p.read_text(errors="replace"))]
            for p in found}  # fmt: skip


def leaves(value: Any, where: str = "") -> Iterator[tuple[str, Any]]:
    """Every leaf of a document with its place."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if key not in PASSING or (isinstance(inner, list) and isinstance([*inner, None][0], dict)):  # no names
                yield from leaves(inner, f"{where}.{key}")
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from leaves(inner, f"{where}[{i}]")
    else:
        yield where, value


def same(a: Any, b: Any) -> bool:
    """Whether two leaves are equal, numbers to the tolerance."""
    if isinstance(a, (int, float)) and isinstance(b, (int, float)) and not isinstance(a, bool):
        if math.isnan(a) or math.isnan(b):
            return math.isnan(a) and math.isnan(b)
        return abs(a - b) <= TOLERANCE * max(1.0, abs(a), abs(b))
    return bool(a == b)


def compare(before: Path, after: Path) -> int:
    """Number of differences between two runs, each printed."""
    count = 0
    for file in sorted(before.glob("*.json")):
        texts = [(folder / file.name).read_text() for folder in (before, after) if (folder / file.name).is_file()]
        if len(texts) < 2:
            continue
        old, new = (dict(leaves(json.loads(text))) for text in texts)
        found = [f"{k}: {old.get(k, 'absent')!r} -> {new.get(k, 'absent')!r}" for k in old | new
                 if k not in old or k not in new or not same(old[k], new[k])]  # fmt: skip
        count += len(found)
        print(f"{file.stem}: {len(found)} of {len(old)} differ")
        for line in found[:8]:
            print("   ", line[:200])
    return count


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("task", choices=("save", "compare"))
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--tree", type=Path, default=ROOT)
    parser.add_argument("--only", nargs="*", default=[])
    args = parser.parse_args()
    if args.task == "save":
        save(args.folders[0].resolve(), args.tree.resolve(), args.only)
        return 0
    return 1 if compare(*args.folders) else 0


if __name__ == "__main__":
    sys.exit(main())
