"""Subcommands of ``python -m bemt``, one thin file each: parse, call, print, exit code."""
