"""Find the identification methods by name."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from bywire.core.discovery import declared, pick
from bywire.identification import methods
from bywire.identification.method import Method


@cache
def all_methods() -> Mapping[str, Method]:
    """Return every method: the ``METHOD`` of each module in ``methods``."""
    return declared(methods, "METHOD", Method)


def find_method(name: str) -> Method:
    """Return one method.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    return pick(all_methods(), name, "method")
