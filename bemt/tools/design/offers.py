"""What this tool offers to the house (:mod:`bemt.base.plugins`)."""

ACTIONS = {name: f"bemt.tools.design.actions:{name}" for name in ("choose", "design")}
