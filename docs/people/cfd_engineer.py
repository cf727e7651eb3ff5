"""Blade loads of the 8x5 compared with a CFD run, and the difference between two CFD campaigns."""

import pandas as pd

import bemt

rotor = bemt.load("cases/prop_8x5")
blade = rotor.along_blade(rpm=20000)
cfd = pd.read_csv("reports/cfd/prop_8x5_incompressible/radial.csv").query("run == '67eb0571ef99'")
for load in ("thrust_per_radius_N_m", "torque_per_radius_Nm_m"):
    axes = blade.plot(x="r_m", y=load, label="BEMT")
    cfd.plot(x="r_m", y=load, style="o", ax=axes, label="CFD", ylabel=load).figure.savefig(f"{load}.png")
campaigns = [f"reports/diagnosis/cfd_{name}.csv" for name in ("reference", "pitch")]
print(bemt.compare(*campaigns, case="cases/prop_8x5").text)
