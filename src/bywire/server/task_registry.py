"""Finds every task: a file in `tasks` is all that a new one takes."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache

from bywire.server import tasks as package
from bywire.server.task import Task


@cache
def tasks() -> Mapping[str, Task]:
    """Return every task by its name."""
    modules = (f"{package.__name__}.{each.name}" for each in pkgutil.iter_modules(package.__path__))
    every: list[Task] = [importlib.import_module(module).TASK for module in modules]
    return {task.name: task for task in every}
