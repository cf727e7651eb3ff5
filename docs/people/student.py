"""The 8x5 compared with a recording: CT, CP and efficiency over J, and possible causes of the difference."""

import bemt

rotor = bemt.load("cases/prop_8x5")
recorded = bemt.read("reports/diagnosis/cfd_reference.csv").derive(rotor.diameter_m)
fast = recorded.select(recorded.rpm == 20000)
curve = rotor.curve(rpm=20000, J=[0.05 * k for k in range(15)])
for name, channels in (("coefficients.png", ["CT", "CP"]), ("efficiency.png", ["eta"])):
    axes = curve.plot("J", channels)
    fast.plot("J", channels, axes).figure.savefig(name)
answer = bemt.diagnose(recorded, rotor)
print(answer.text)
