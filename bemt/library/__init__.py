"""What `import bemt` offers: propellers and fans, their curves, recordings, diagnoses, drives.

Every function here takes and gives plain things: a label or a file, numbers in the unit of their name, a
:class:`bemt.dataset.Dataset` out. Nothing prints; bad input raises :class:`bemt.base.errors.InputError`, which says
file, place and remedy.
"""

from __future__ import annotations

from bemt.library.answers import Answer, compare, diagnose, drive, read, validate
from bemt.library.rotors import Propeller, load, propeller

__all__ = ["Answer", "Propeller", "compare", "diagnose", "drive", "load", "propeller", "read", "validate"]
