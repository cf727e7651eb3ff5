"""The rotor in air: air, coefficients, sections, effects, the solver, and the K1/K2 law."""
