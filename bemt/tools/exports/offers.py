"""What this tool offers to the house (:mod:`bemt.base.plugins`)."""

ACTIONS = {"export": "bemt.tools.exports.actions:export"}
