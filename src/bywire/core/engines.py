"""Engines from rooms above the simulation, declared where the package is assembled.

A bench selects its engine by name, and the simulation builds it. The simulation must not import an
upper room, so the upper room registers its engine here.
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
    """Register the engine of an upper room under a name; a later engine replaces an earlier one."""
    _DECLARED[name] = make


def declared_engines() -> dict[str, Make]:
    """Return the registered engines by name."""
    return dict(_DECLARED)
