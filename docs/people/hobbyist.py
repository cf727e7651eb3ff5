"""10x4.5, 900 rev/min/V, 3S: static thrust and power over speed, then the whole drive of a 1.4 kg quadrotor."""

import bemt

propeller = bemt.propeller("10x4.5")
bench = propeller.curve(rpm=range(2000, 9001, 500), J=0)
bench.plot("rpm", "thrust_N").figure.savefig("thrust.png")
bench.plot("rpm", "power_W").figure.savefig("power.png")
flight = bemt.drive(propeller, kv=900, cells=3, mass_kg=1.4, rotors=4, capacity_Ah=3)
print(flight.text)
