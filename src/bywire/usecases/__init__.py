"""The use cases of bywire, one module per family; `declare` makes commands and forms of them.

These modules load fast, because every start of the command line reads all of them. A use case
imports what it computes with when its function is called.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping
from functools import cache
from importlib import import_module

from bywire.usecases.declare import DECLARED, UseCase


def use_cases() -> Mapping[str, UseCase]:
    """Return every use case by the name of its function."""
    _load_all()
    return DECLARED


@cache
def _load_all() -> None:
    for module in pkgutil.iter_modules(__path__):
        import_module(f"{__name__}.{module.name}")
