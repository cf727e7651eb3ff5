"""Rewrite this folder: ``.venv/bin/python reports/make.py``; ``--data DIR`` adds what needs DIR/uiuc/volume-1 and 2.

Campaigns of CFD, the proof (its page alone is written again) and the drive's validation take hours, or data of other
people; their READMEs say how.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
from pathlib import Path

from bemt.judge.proof import score
from bemt.judge.proof.rows import Proof

ROOT = Path(__file__).resolve().parents[1]
SIZES = ("8x5", "10x5", "12x6", "14x8")
FLUENT = [*(f"reports/diagnosis/fluent_{s}.csv" for s in SIZES), "--case", *(f"cases/prop_{s}" for s in SIZES)]
REFERENCE = (
    "--reference reports/diagnosis/cfd_reference.csv --case cases/prop_8x5 --off compressibility --off drag_divergence"  # noqa: E501
)
DIAGNOSES = {
    "bemt_fluent": FLUENT,
    "k1k2_fluent": [*FLUENT, "--baseline", "k1k2"],
    **{f"cfd_{what}": [f"reports/diagnosis/cfd_{what}.csv", *REFERENCE.split()]
       for what in ("compressible", "pitch", "duct", "plate")},
}  # fmt: skip

RECORDINGS = {"reference": "incompressible", **{w: w for w in ("compressible", "pitch", "duct", "plate")}}
GIVEN = ("rpm", "airspeed_m_s", "thrust_N", "torque_Nm", "density_kg_m3", "temperature_C", "wall_distance_m")


def recording(what: str, campaign: str) -> None:
    """Write the converged runs of a campaign as a recording; u is scatter and drift of their iterations."""
    folder = ROOT / "reports" / "cfd" / f"prop_8x5_{campaign}"
    with (folder / "recording.csv").open(encoding="utf-8", newline="") as file:
        rows = [r for r in csv.DictReader(file) if r["converged"] == "1"]
    names = [n for n in GIVEN if n != "wall_distance_m" or rows[0][n]]
    units = {"thrust": "N", "torque": "Nm"}
    with (ROOT / "reports" / "diagnosis" / f"cfd_{what}.csv").open("w", encoding="utf-8", newline="") as file:
        said = "converged runs; u: scatter and drift of the iterations only, the grid's error is common to all"
        print(f"# {folder.name}: {said}", file=file)
        out = csv.writer(file, lineterminator="\n")
        out.writerow([*names[:4], *(f"u_{load}_{unit}" for load, unit in units.items()), *names[4:]])
        for row in rows:
            shares = (max(abs(float(row[f"{k}_{load}"])) for k in ("drift", "scatter")) for load in units)
            u = [f"{max(share, 1e-3) * float(row[f'{load}_{units[load]}']):.6g}"
                 for load, share in zip(units, shares, strict=True)]  # fmt: skip
            out.writerow([*(row[n] for n in names[:4]), *u, *(row[n] for n in names[4:])])


def bemt(*words: str) -> None:
    """Run one command; what it says of the physics (exit code 1) is no failure."""
    print("bemt", *words, flush=True)
    if (code := subprocess.run([sys.executable, "-m", "bemt", *words], cwd=ROOT).returncode) > 1:
        raise SystemExit(code)


def main() -> None:
    """Rewrite everything; the report last, since it shows the diagnoses."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, help="folder with uiuc/volume-1 and uiuc/volume-2")
    data = parser.parse_args().data
    for what, campaign in RECORDINGS.items():
        recording(what, campaign)
    for name, words in DIAGNOSES.items():
        bemt("diagnose", *words, "--out", f"reports/diagnosis/{name}")
    bemt("motor", "reports/drive/motor_mn4006", "--out", "reports/drive/motor_mn4006/result")
    if data is not None:
        uiuc = data.resolve() / "uiuc"
        for k in (1, 2):
            bemt("validate", f"{uiuc}/volume-{k}", "--match-J0", "--out", f"reports/validation/uiuc_volume_{k}")
    proof = Proof.from_document(json.loads((ROOT / "reports" / "proof" / "proof.json").read_text(encoding="utf-8")))
    (ROOT / "reports" / "proof" / "proof.html").write_text(score.html(proof), encoding="utf-8")
    with (ROOT / "reports" / "reproduction.json").open("w", encoding="utf-8") as file:
        subprocess.run([sys.executable, "reports/studies/reproduce.py", "--json"], cwd=ROOT, stdout=file, check=True)
    bemt("report", "cases/", "--out", "reports")


if __name__ == "__main__":
    main()
