"""What flight logs offer to the house (:mod:`bemt.base.plugins`)."""

ACTIONS = {"fly": "bemt.tools.flight.actions:fly"}
FILE_KINDS = {"bemt fly": "bemt.tools.flight.read:kind_of"}
