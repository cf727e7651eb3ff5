"""Flight logs: what a rotor does in the air.

``read`` (one file per format) -> ``log`` (one time base, one column per rotor) -> ``identify`` (constants with bands)
and ``judge`` (a flight beside healthy ones, by the balance of the rigid body) -> ``answer`` (text, document),
``picture``.
"""
