"""What the folders of the benchmark declare: general parts first, then those of each brake."""

from __future__ import annotations

import pkgutil
from typing import TypeVar

import benchmarks
from bywire.core.brake import modules_below
from bywire.core.registry import Named, instances

_TOOLS = "peers"  # loads libraries that may be missing, and declares nothing

Thing = TypeVar("Thing", bound=Named)


def declared(kind: type[Thing]) -> dict[str, Thing]:
    """Return the objects of a type that the modules in the folders declare, by name."""
    folders = [
        each.name
        for each in pkgutil.iter_modules(benchmarks.__path__)
        if each.ispkg and each.name != _TOOLS
    ]
    modules = [module for name in folders for module in modules_below(f"benchmarks.{name}")]
    return {thing.name: thing for module in modules for thing in instances(kind)(module)}
