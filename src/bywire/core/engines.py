"""Engines that rooms above the simulation bring: declared where the package is put together.

A bench is told which engine serves by name, and the simulation makes it. What an upper room brings
for that, it can only be handed from above.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bywire.core.model import Model
    from bywire.core.parameters import ParameterSet

Make = Callable[["Model", "ParameterSet", Any], Any]
"""``make(model, par, kernel)``: the engine, which steps the plant by the compiled kernel"""

_DECLARED: dict[str, Make] = {}


def declare_engine(name: str, make: Make) -> None:
    """Let runs be computed by an engine of a room above, by name; again by another one instead."""
    _DECLARED[name] = make


def declared_engines() -> dict[str, Make]:
    """Return what was declared, by name."""
    return dict(_DECLARED)
