"""Users' brakes in tests: loaded for a while, and forgotten again."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bywire.core import brake as registry
from bywire.core.brake import Brake, load_system

SPRING_AXIS = Path(__file__).with_name("spring_axis.py")


@contextmanager
def loaded(path: Path) -> Iterator[Brake]:
    """Have a brake known by its names, and forget it and its modules afterward."""
    brakes, modules = dict(registry._loaded), set(sys.modules)
    try:
        yield load_system(path)
    finally:
        registry._loaded.clear()
        registry._loaded.update(brakes)
        stem = path.stem
        for name in set(sys.modules) - modules:
            if name == stem or name.startswith(f"{stem}."):
                del sys.modules[name]
