"""The public API, `import bemt`: propellers and fans, their curves, recordings, diagnoses, drives.

Functions take a label, a file or numbers in the unit of their name, and return a :class:`bemt.physics.dataset.Dataset`
or a small object. Nothing prints. Bad input raises :class:`bemt.base.errors.InputError` with file, location and remedy.
"""

from __future__ import annotations

from bemt.app.library.actions import calibrate_rotor, cite, estimate, export, plan, report
from bemt.app.library.answers import Answer, compare, diagnose, drive, read, validate
from bemt.app.library.blades import design
from bemt.app.library.rotors import Propeller, load, propeller

__all__ = [
    "Answer", "Propeller", "calibrate_rotor", "cite", "compare", "design", "diagnose", "drive", "estimate", "export",
    "load", "plan", "propeller", "read", "report", "validate",
]  # fmt: skip
