"""Cases side by side with what was recorded: one case (`case`), its tables (`text`), all of them (`batch`)."""

from __future__ import annotations

from bemt.results.sweep.batch import SCHEMA, fingerprint, sweep

__all__ = ["SCHEMA", "fingerprint", "sweep"]
