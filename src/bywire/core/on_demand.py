"""Mapping whose values are computed on their first use."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import TypeVar

T = TypeVar("T")


class OnDemand(Mapping[str, T]):
    """Values by name, each computed once, on its first use.

    Parameters
    ----------
    names
        All names, in order.
    compute
        ``compute(name)`` returns a value.

    Examples
    --------
    >>> lengths = OnDemand(["one", "two", ""], lambda name: 1.0 / len(name))
    >>> list(lengths), lengths["two"], "" in lengths
    (['one', 'two', ''], 0.3333333333333333, True)
    """

    def __init__(self, names: Collection[str], compute: Callable[[str], T]) -> None:
        self._names, self._compute = names, compute
        self._known: dict[str, T] = {}

    def __getitem__(self, name: str) -> T:
        if name not in self._known:
            if name not in self._names:
                raise KeyError(name)
            self._known[name] = self._compute(name)
        return self._known[name]

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)
