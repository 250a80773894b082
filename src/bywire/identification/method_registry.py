"""Find the identification methods by name."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from bywire.core.discovery import declared
from bywire.core.errors import unknown_name
from bywire.identification import methods
from bywire.identification.fitting.asked import BenchMethod
from bywire.identification.method import Method


@cache
def all_methods() -> Mapping[str, Method]:
    """Return every method: the ``METHOD`` of each module in ``methods``."""
    return declared(methods, "METHOD", Method)


def find_method(name: str) -> Method:
    """Return one method that needs no bench.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    if name not in all_methods():
        raise unknown_name("method", name, (*all_methods(), *bench_methods()))
    return all_methods()[name]


@cache
def bench_methods() -> Mapping[str, BenchMethod]:
    """Return the methods that are made for a bench: also a ``METHOD`` of ``methods`` each."""
    return declared(methods, "METHOD", BenchMethod)
