"""Which propeller, and which motor constant: labels and motors against a target."""

from __future__ import annotations

from bemt.design.search import Target, choose

__all__ = ["Target", "choose"]
