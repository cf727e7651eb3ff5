"""Flight logs: what a rotor does in the air.

``read`` (one file per format) -> ``log`` (one time base, one column per rotor) -> ``identify``, ``inflow`` (constants
with bands, from pieces of the flight: ``batches``), ``change`` (within one flight), ``vibration``, ``motor_speed``,
``wind`` -> ``judge`` (a flight beside healthy ones: the judge of the diagnosis on the ``balance`` of the body) with
``next_flight`` -> ``answer`` (document) -> ``text``, ``picture``.
"""
