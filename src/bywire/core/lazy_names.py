"""Names that a package loads on first use, declared only in the stub next to the package."""

from __future__ import annotations

from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any


class LazyNames:
    """A package's lazily loaded names.

    Parameters
    ----------
    file
        ``__init__.py`` of the package. The stub next to it, which type checkers also read, contains
        lines ``from HOME import NAME as NAME``. If an object has another name in its home module,
        the line imports it ``as _NAME``, and a line ``NAME = _NAME`` follows for type checkers.
    """

    def __init__(self, file: str) -> None:
        self._stub = Path(file).with_suffix(".pyi")

    @cached_property
    def homes(self) -> dict[str, tuple[str, str]]:
        """Module of each name, and the object's name in this module."""
        lines = self._stub.read_text(encoding="utf-8").splitlines()
        words = [line.split() for line in lines if line.startswith("from ")]
        return {name.removeprefix("_"): (home, there) for _, home, _, there, _, name in words}

    def all(self) -> list[str]:
        """Return the public names."""
        return sorted(name for name in self.homes if not name.startswith("_"))

    def load(self, name: str) -> Any:
        """Return the object with a name, or a list of all names for ``__all__``.

        Raises
        ------
        AttributeError
            For any other name.
        """
        if name == "__all__":
            return self.all()
        if name.startswith("_") or name not in self.homes:
            package = self._stub.parent.relative_to(Path(__file__).parents[2])
            raise AttributeError(f"module {'.'.join(package.parts)!r} has no attribute {name!r}")
        home, there = self.homes[name]
        module = import_module(home)
        return (
            getattr(module, there) if hasattr(module, there) else import_module(f"{home}.{there}")
        )
