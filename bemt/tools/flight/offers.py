"""What flight logs offer to the house (:mod:`bemt.base.plugins`)."""

ACTIONS = {"fly": "bemt.tools.flight.actions:fly"}
