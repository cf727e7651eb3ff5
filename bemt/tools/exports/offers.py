"""What exports offer to the house (:mod:`bemt.base.plugins`)."""

ACTIONS = {"export": "bemt.tools.exports.actions:export"}
