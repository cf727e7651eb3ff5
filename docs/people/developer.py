"""CT, CP and efficiency over J of a blade from stations; then the best pitch of a 10 in propeller at 8 m/s, 2 N."""

from pathlib import Path

from scipy.optimize import brentq, minimize_scalar

import bemt

STATIONS = """r_over_R,chord_over_R,beta_deg
0.2,0.160,36.0
0.3,0.205,30.0
0.5,0.200,20.5
0.7,0.165,15.0
0.9,0.110,12.0
1.0,0.060,11.0
"""
Path("blade.csv").write_text(STATIONS)
curve = bemt.propeller(stations="blade.csv", diameter_m=0.254).curve(rpm=8000, J=[0.05 * k for k in range(1, 17)])
curve.plot("J", ["CT", "CP"]).figure.savefig("coefficients.png")
curve.plot("J", "eta").figure.savefig("efficiency.png")


def power(pitch_in: float) -> float:
    """Shaft power at 8 m/s and 2 N. [W]"""
    rotor = bemt.propeller("10x5").replaced({"blade.pitch_in": pitch_in})
    rpm = brentq(lambda n: rotor.solve(n, 8.0, bands=False).thrust_N[0] - 2.0, 3000, 12000, xtol=1.0)
    return float(rotor.solve(rpm, 8.0, bands=False).power_W[0])


best = minimize_scalar(power, bounds=(4.0, 9.0), method="bounded", options={"xatol": 0.05})
print(f"minimum power {best.fun:.1f} W at a pitch of {best.x:.1f} in")
