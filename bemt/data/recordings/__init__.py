"""Recordings to steady points: plateaus, tare, air, scatter, coefficients (`reduce` joins them)."""
