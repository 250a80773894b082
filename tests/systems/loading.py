"""Users' brakes in tests: loaded for a while, and forgotten again."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bywire.core import brake as registry
from bywire.core import registry as kinds
from bywire.core.brake import Brake, load_system

SPRING_AXIS = Path(__file__).with_name("spring_axis.py")


@contextmanager
def forgotten() -> Iterator[None]:
    """Forget the brakes that are loaded meanwhile, and their modules."""
    before = dict(registry._loaded)
    try:
        yield
    finally:
        roots = {brake.module for name, brake in registry._loaded.items() if name not in before}
        registry._loaded.clear()
        registry._loaded.update(before)
        for name in list(sys.modules):
            if name.partition(".")[0] in roots:
                del sys.modules[name]
        if roots:  # a brake that is loaded again is equal, but its things are not
            for cached in (kinds._found, kinds._gathered, kinds._declared):
                cached.cache_clear()


@contextmanager
def loaded(path: Path) -> Iterator[Brake]:
    """Have a brake known by its names for a while."""
    with forgotten():
        yield load_system(path)
