"""Which propeller and motor constant reach a target, and a blade that does it better."""

ACTIONS = {name: f"bemt.tools.design.actions:{name}" for name in ("choose", "design")}
