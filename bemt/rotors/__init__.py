"""What is known of a real rotor and how well: the population of measured propellers, predictive uncertainty."""
