"""The use cases of bywire, one module per family. `declare` turns them into commands and forms.

These modules load fast, because the command line loads all of them at every start. A use case
imports the modules for its computation only when its function is called.
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
