"""Blade element momentum: residual and kernel (compiled), packing, duct, and the one way to solve a rotor.

``bem.solve(rotor, rpm=..., V=...)`` gives a :class:`bemt.physics.dataset.Dataset`; ``bem.Model`` keeps what was
prepared.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bemt.physics.bem.model import Model, solve

__all__ = ["Model", "solve"]


def __getattr__(name: str) -> Any:
    """Load the model, and with it the compiled kernel, when it is asked for."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from bemt.physics.bem import model

    return getattr(model, name)
