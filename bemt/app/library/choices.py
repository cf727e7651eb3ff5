"""`bemt.choose`: :func:`bemt.design.search.choose`, whose faults name arguments instead of options."""

from __future__ import annotations

from bemt.design import search
from bemt.library.given import in_words_of_the_library

__all__ = ["choose"]

choose = in_words_of_the_library()(search.choose)
