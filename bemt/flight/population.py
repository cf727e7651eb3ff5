"""What recorded healthy vehicles show: how their trim differs from flight to flight, and from vehicle to vehicle.

Readings are the roll, pitch and yaw parts of the logs of the motors' drives (:func:`bemt.flight.judge.axes_of`): each
is a quarter of a blade's change of drive on a quadrotor.

Flight to flight: six flights of two Crazyflies 2.1, brushed (4) and brushless (2), IMRCLab/crazyflie-data-collection
@ 4d777a5a: standard deviations of roll, pitch, yaw 0.30, 1.27, 0.63 % and 0.05, 0.57, 0.12 %, pooled 0.75 %. One
vehicle differs from the other by a factor of 2.5, so the pooled value weighs as four degrees of freedom, not twelve.
CrazyPAD E8 (1.89, 0.97, 1.12 %) is left out: it is what the judge is tried on.

Vehicle to vehicle: means of those two, of CrazyPAD E8 (Data 9:79, 2024) and of the quadrotor of Neural-Fly
(aerorobotics/neural-fly @ 0ed50246) in still air: roll 0.8, 0.1, 2.3, 0.7 %, pitch -1.5, -1.0, 0.2, -1.3 %,
yaw 2.9, 0.2, 11.2, 3.5 %.
"""

__all__ = ["SCATTER", "SCATTER_FREE", "TRIM", "TRIM_FREE"]

SCATTER, SCATTER_FREE = 0.0075, 4
"""Standard deviation of a reading between flights of one vehicle [1], and the degrees of freedom it counts as."""
TRIM = (0.012, 0.012, 0.060)
"""Root mean square of roll, pitch and yaw over healthy vehicles [1]."""
TRIM_FREE = 4
"""Vehicles behind it."""
