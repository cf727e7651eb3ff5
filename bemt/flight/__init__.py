"""Flight logs: what a rotor does in the air.

``read`` (one file per format) -> ``log`` (one time base, one column per rotor) -> ``identify``, ``inflow`` (constants
with bands), ``judge`` (a flight beside healthy ones, by the balance of the rigid body), ``change`` (within one flight),
``vibration``, ``motor_speed``, ``wind`` -> ``answer`` (document) -> ``text``, ``picture``.
"""
