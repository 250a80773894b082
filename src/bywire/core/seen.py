"""A recording as an assembly within another one knows it: by its own names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any


class Seen:
    """What an assembly recorded within another one, by its own names.

    Parameters
    ----------
    recording
        The holder's: an xarray.Dataset, or what stands for one.
    names
        Names in there by own names.
    place
        What stands before its parts where those that are silent are named.
    """

    def __init__(self, recording: Any, names: Mapping[str, str], place: str) -> None:
        self._recording = recording
        self._names = {own: there for own, there in names.items() if there in recording}
        every: Iterable[str] = getattr(recording, "silent", ())
        self.silent = frozenset(
            name.removeprefix(place) for name in every if name.startswith(place)
        )

    def __contains__(self, name: str) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __getitem__(self, name: str) -> Any:
        return self._recording[self._names.get(name, name)]

    def __getattr__(self, name: str) -> Any:
        """Return what a Dataset has: it is made when it is asked for."""
        if name.startswith("_"):
            raise AttributeError(name)
        there = self._recording[list(self._names.values())]
        return getattr(there.rename({there: own for own, there in self._names.items()}), name)
