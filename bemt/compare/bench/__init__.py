"""Time per operating point, beside any peer that is installed."""
