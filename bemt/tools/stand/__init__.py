"""A stand that answers: three verbs behind a guard, and the loop from a recording to the run that decides."""

ACTIONS = {"stand": "bemt.tools.stand.actions:stand"}
HANDS = {"wired": "bemt.tools.stand.hand:wired"}
