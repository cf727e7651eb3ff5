"""BEMT against folders of measured propellers.

``bemt.validate(folder)`` runs it: ``help(bemt.library.validate)``.
"""

from __future__ import annotations

import sys

from bemt.base.face import CallableRoom

sys.modules[__name__].__class__ = CallableRoom  # bemt.validate(...) is bemt.library.validate(...)
