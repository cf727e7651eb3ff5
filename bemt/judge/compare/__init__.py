"""What changed between two recordings, and one run beside the model.

``bemt.compare(a, b)`` says what changed between two recordings: ``help(bemt.library.compare)``.
"""

from __future__ import annotations

import sys

from bemt.base.face import CallableRoom

sys.modules[__name__].__class__ = CallableRoom  # bemt.compare(...) is bemt.library.compare(...)
