"""A small case of a propeller with a section table, references and two assumptions of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np

CASE = """
schema = "bemt.case/1"
name = "{name}"
references = "references.csv"
[rotor]
kind = "propeller"
blades = 2
diameter_in = 10
hub_ratio = 0.15
[blade]
pitch_in = 5
chord_law = "apc_like"
max_chord_over_R = 0.2
[blade.section]
naca = "4412"
[[polars]]
file = "polar.csv"
r_over_R = 0.75
[operating]
rpm = 6000
[air]
density_kg_m3 = 1.2
[model]
stations = 20
[[assumptions]]
key = "blade.max_chord_over_R"
low = 0.18
high = 0.22
why = "made for a test of the propagation"
[[assumptions]]
key = "rotor.hub_ratio"
low = 0.1
high = 0.2
why = "made for a test of the propagation"
"""
REFERENCES = """quantity,value,unit,uncertainty,kind,source,remark,rpm,airspeed_m_s,density_kg_m3
thrust,0.5,kgf,0.01,bench,stand,,6000,0,1.2
thrust,0.45,kgf,unknown,cfd,solver,,6000,0,1.2
torque,0.08,N m,0.002,bench,stand,,6000,0,1.2
thrust,0.30,kgf,unknown,vendor,maker,,5000,,
thrust,0.48,kgf,unknown,k1k2_printed,thesis,,6000,0,1.2
"""


def make_case(folder: Path, name: str = "one", extra: str = "", references: str = REFERENCES, title: str = "") -> Path:
    """File of a case with its own section table, so that no network is loaded."""
    here = folder / name
    here.mkdir(parents=True)
    alpha = np.arange(-20.0, 21.0)
    cl = np.clip(0.1 * (alpha + 4.0), -0.9, 1.3)
    rows = [f"{a:g},{c:.5f},{0.012 + 0.008 * c * c:.5f}" for a, c in zip(alpha, cl, strict=True)]
    (here / "polar.csv").write_text("alpha_deg,cl,cd\n" + "\n".join(rows) + "\n")
    (here / "references.csv").write_text(references)
    (here / "case.toml").write_text(CASE.replace("{name}", name + (f'"\ntitle = "{title}' if title else "")) + extra)
    return here / "case.toml"
