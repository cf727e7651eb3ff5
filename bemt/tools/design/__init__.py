"""Which propeller, which motor constant, and a better blade: labels and motors against a target, blades for a thrust."""
