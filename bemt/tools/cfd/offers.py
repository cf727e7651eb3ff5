"""What campaigns of CFD offer to the house (:mod:`bemt.base.plugins`)."""

ACTIONS = {"cfd": "bemt.tools.cfd.actions:cfd"}
