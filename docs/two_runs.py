"""Make the two recordings of the quick start, before.csv and after.csv: ``python docs/two_runs.py``.

A 10x5 as it is, then with its blades turned by 1.5 degrees, each with 1 % of noise. So the truth is known.
"""

import numpy as np
import pandas as pd

import bemt

propeller = bemt.propeller("10x5")
rpm, J = np.repeat([5000.0, 10000.0, 15000.0, 20000.0], 6), np.tile(np.linspace(0.0, 0.5, 6), 4)
random = np.random.default_rng(1)
for name, turned_deg in (("before.csv", 0.7), ("after.csv", 2.2)):
    truth = propeller.replaced({"blade.beta_offset_deg": turned_deg}).solve(rpm, J=J, bands=False)
    loads = np.transpose([truth.thrust_N, truth.torque_Nm]) * random.normal(1.0, 0.01, (rpm.size, 2))
    columns = {"rpm": rpm, "airspeed_m_s": truth.airspeed_m_s, "thrust_N": loads[:, 0], "torque_Nm": loads[:, 1]}
    pd.DataFrame(columns).to_csv(name, index=False)
