"""The drive behind the rotor: bench map, motor constant, battery-ESC-motor-rotor model, thrusters on a body."""

from __future__ import annotations

import sys

from bemt.base.face import CallableRoom

sys.modules[__name__].__class__ = CallableRoom  # bemt.drive(...) is bemt.library.drive(...)
