"""Engines from packages above the simulation, which register here.

A bench selects its engine by name, and the simulation builds it. The simulation must not import a
package above it, so such a package registers its engine here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bywire.core.model import Model
    from bywire.core.parameters import ParameterSet

Make = Callable[["Model", "ParameterSet", Any], Any]
"""``make(model, par, kernel)``: the engine, which steps the plant with the compiled kernel"""

_DECLARED: dict[str, Make] = {}


def declare_engine(name: str, make: Make) -> None:
    """Register an engine under a name; a later engine replaces an earlier engine."""
    _DECLARED[name] = make


def declared_engines() -> dict[str, Make]:
    """Return the registered engines by name."""
    return dict(_DECLARED)
