"""`bemt.choose`: :func:`bemt.tools.design.search.choose`, whose faults name arguments instead of options."""

from __future__ import annotations

from bemt.app.library.given import in_words_of_the_library
from bemt.tools.design import search

__all__ = ["choose"]

choose = in_words_of_the_library()(search.choose)
