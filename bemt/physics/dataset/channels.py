"""Names of channels and what they say: kinds of a dataset, origins of an uncertainty, units."""

from __future__ import annotations

from functools import lru_cache

from bemt.base import units

__all__ = ["DIMENSIONLESS", "KINDS", "ORIGINS", "channel_fault", "unit_in"]

KINDS = ("bemt", "k1k2", "cfd", "bench", "vendor")
"""Kinds that comparisons know; others (``k1k2_printed``, ``flight``) are allowed and kept apart."""

ORIGINS = ("random", "session", "input", "model", "numerics")
"""Where an uncertainty comes from: scatter of points, what a session shares (gain, zero), inputs not known exactly, the
model's own error on real rotors, discretisation."""

DIMENSIONLESS = frozenset(
    {
        "CT", "CP", "CQ", "J", "eta", "FM", "Re", "Re75", "M_tip", "M_tip_helical", "throttle", "duct_share", "run",
        "thrust_ratio", "upper_thrust_ratio", "lower_thrust_ratio",
    }
)  # fmt: skip
"""Channel names without a unit."""


@lru_cache(maxsize=1024)
def channel_fault(name: str) -> tuple[str, str, str] | None:
    """Reason why a channel name is refused: (got, expected, hint)."""
    if name == "rpm" or name in DIMENSIONLESS:
        return None
    base, unit = units.split_suffix(name)
    if unit is None or not base:
        return (f"channel {name!r}", "rpm, a coefficient, or a name that ends in its SI unit", "As in thrust_N")
    if unit.factor != 1.0 or unit.offset != 0.0:
        hint = f"Convert it with units.to_si(..., {unit.suffix!r})"
        return (f"channel {name!r} in {unit.suffix}", "an SI unit", hint)
    return None


def unit_in(name: str) -> str:
    """Unit that the name of a channel says; "-" for none."""
    if name == "rpm" or name in DIMENSIONLESS:
        return "rpm" if name == "rpm" else "-"
    unit = units.split_suffix(name)[1]
    return "" if unit is None else unit.suffix or "-"
