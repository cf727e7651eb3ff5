"""What stands offer to the house (:mod:`bemt.base.plugins`)."""

ACTIONS = {"stand": "bemt.tools.stand.actions:stand"}
HANDS = {"wired": "bemt.tools.stand.hand:wired"}
