"""Memory that is changed in its place, where the laws return it as a new value."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from bywire.export.controller.values import Expr, Record, Use

Site = tuple[str, int]
"""a change of memory: the C function in which it stands, and the how manieth it is there"""


@dataclass
class Memories:
    """Versions of the memory in a C function, by the place in which it stands.

    Python keeps a memory's old values beside the new ones; in C they are gone. What reads a version
    that is gone tells which change came too early: the next translation lets that change begin
    with a copy.

    Parameters
    ----------
    function
        Name of the C function.
    copied
        Changes that begin with a copy; what is found here is added.
    """

    function: str = ""
    copied: set[Site] = field(default_factory=set)
    versions: dict[str, int] = field(default_factory=dict)
    ended: dict[tuple[str, int], Site] = field(default_factory=dict)
    changes: int = 0

    def at(self, cls: type[Any], place: str, pointer: bool) -> Record:
        """Return the memory as it stands in a place now."""
        version = self.versions.setdefault(place, 0)
        uses = frozenset({("local", place), ("version", place, version)})
        return Record(cls, Expr(place, uses=uses), pointer)

    def stays(self, place: str) -> bool:
        """Return whether the next change of a place is made there, without a copy before it."""
        self.changes += 1
        site = (self.function, self.changes)
        if site in self.copied:
            return False
        self.ended[place, self.versions[place]] = site
        return True

    def changed(self, place: str) -> None:
        """Count a change of a place."""
        self.versions[place] += 1

    def versions_in(self, uses: Iterable[Use]) -> list[Use]:
        """Return what of a text's needs are versions of memory."""
        return [use for use in uses if use[0] == "version"]

    def read(self, uses: Iterable[Use]) -> None:
        """Let every version stay that a text reads."""
        for _, place, version in self.versions_in(uses):
            if self.versions[place] != version:
                self.copied.add(self.ended[place, version])

    def is_now(self, record: Record) -> bool:
        """Return whether a memory is what stands in its place now."""
        self.read(record.expr.uses)
        place = record.expr.text
        return ("version", place, self.versions[place]) in record.expr.uses

    def keep(self, place: str) -> None:
        """Let a place stay as it was at first."""
        if self.versions[place]:
            self.copied.add(self.ended[place, 0])
