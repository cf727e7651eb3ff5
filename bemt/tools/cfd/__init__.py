"""Campaigns of OpenFOAM runs: what to run, running it, recording it, summing it up (`command` joins them)."""
