"""Faults of a recording found before physics is: one function per check, one file per kind (`check` joins them)."""
