"""Find what the modules of a package offer, so that a new file is all that a new thing takes."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator, Mapping
from types import ModuleType
from typing import Protocol, TypeVar

from bywire.core.errors import unknown_name

Thing = TypeVar("Thing")


class Named(Protocol):
    """Anything with a name."""

    @property
    def name(self) -> str:
        """What users call it."""
        ...


NamedThing = TypeVar("NamedThing", bound=Named)


def modules_of(package: ModuleType) -> Iterator[ModuleType]:
    """Yield the modules of a package, loaded, in alphabetical order."""
    for found in pkgutil.iter_modules(package.__path__):
        yield importlib.import_module(f"{package.__name__}.{found.name}")


def declared(package: ModuleType, name: str, kind: type[NamedThing]) -> dict[str, NamedThing]:
    """Return the objects that the modules of a package declare under a name, by their own names.

    Parameters
    ----------
    package
        Where to look; modules without the object are left out.
    name
        For instance ``"EXPERIMENT"``.
    kind
        Type of the objects; what is something else is left out.
    """
    found = (getattr(module, name, None) for module in modules_of(package))
    return {one.name: one for one in found if isinstance(one, kind)}


def pick(known: Mapping[str, Thing], name: str, kind: str) -> Thing:
    """Return the thing of a name.

    Raises
    ------
    UnknownNameError
        With the nearest known names; ``kind`` says what they are names of.
    """
    if name not in known:
        raise unknown_name(kind, name, known)
    return known[name]
