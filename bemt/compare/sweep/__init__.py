"""Cases side by side with what was recorded: one case (`case`), its tables (`text`), all of them (`command`)."""

from __future__ import annotations

from bemt.compare.sweep.command import SCHEMA, fingerprint, run, sweep

__all__ = ["SCHEMA", "fingerprint", "run", "sweep"]
