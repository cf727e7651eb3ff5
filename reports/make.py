"""Rewrite this folder: ``.venv/bin/python reports/make.py``; ``--data DIR`` adds what needs DIR/uiuc/volume-1 and 2.

Campaigns of CFD, the proof (its page alone is written again) and the drive's validation take hours, or data of other
people; their READMEs say how.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

from bemt.proof import proof_text

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
    for name, words in DIAGNOSES.items():
        bemt("diagnose", *words, "--out", f"reports/diagnosis/{name}")
    bemt("motor", "reports/drive/motor_mn4006", "--out", "reports/drive/motor_mn4006/result")
    if data is not None:
        uiuc = data.resolve() / "uiuc"
        bemt("calibrate", f"{uiuc}/volume-1", "--test", f"{uiuc}/volume-2", "--out", "reports/calibration")
        for k in (1, 2):
            bemt("validate", f"{uiuc}/volume-{k}", "--match-J0", "--out", f"reports/validation/uiuc_volume_{k}")
    proof = json.loads((ROOT / "reports" / "proof" / "proof.json").read_text(encoding="utf-8"))
    (ROOT / "reports" / "proof" / "proof.html").write_text(proof_text.html(proof), encoding="utf-8")
    bemt("report", "cases/", "--out", "reports")


if __name__ == "__main__":
    main()
