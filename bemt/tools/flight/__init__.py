"""Flight logs: what a rotor does in the air.

``read`` (one file per format) -> ``log`` (one time base, one column per rotor) -> ``identify``, ``thrust_curve``
(constants with bands, from pieces of the flight: ``repeat``), ``change`` (within one flight), ``vibration``,
``speed_sensor``, ``wind`` -> ``judge`` (a flight beside healthy ones: the judge of the diagnosis on the ``balance`` of
the body, and the next flight) -> ``answer`` (document) -> ``text``, ``picture``.
"""

ACTIONS = {"fly": "bemt.tools.flight.actions:fly"}
FILE_KINDS = {"bemt fly": "bemt.tools.flight.read:kind_of"}
