"""Declarations in the benchmark folders, first the general parts, then the parts of each brake."""

from __future__ import annotations

import pkgutil
from typing import TypeVar

import benchmarks
from bywire.core.brake import modules_below
from bywire.core.registry import Named, instances

_TOOLS = "peers"  # imports libraries that may be missing, and declares nothing

Thing = TypeVar("Thing", bound=Named)


def declared(kind: type[Thing]) -> dict[str, Thing]:
    """Return all declared objects of a type by name."""
    folders = [
        each.name
        for each in pkgutil.iter_modules(benchmarks.__path__)
        if each.ispkg and each.name != _TOOLS
    ]
    modules = [module for name in folders for module in modules_below(f"benchmarks.{name}")]
    return {thing.name: thing for module in modules for thing in instances(kind)(module)}
