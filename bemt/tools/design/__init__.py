"""Which propeller and motor constant reach a target, and a blade that does it better."""
