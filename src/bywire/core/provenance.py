"""Where a value comes from, kept beside every value of the catalog."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from bywire.core.arguments import checked

Kind = Literal["paper", "derived", "chosen", "calibrated"]


@dataclass(frozen=True)
class Cited:
    """A value of a parameter set with its provenance.

    Parameters
    ----------
    value
        Number, table or choice, in SI.
    kind
        ``paper``: printed in the source. ``derived``: follows from printed values.
        ``chosen``: ours, where the source is silent. ``calibrated``: tuned until a statement of
        the source comes out; that statement is then no evidence.
    where
        Place in the source, or the reason.
    """

    value: Any
    kind: Kind
    where: str


@checked
def paper(value: Any, where: str) -> Cited:
    """Mark a value printed in the source."""
    return Cited(value, "paper", where)


@checked
def derived(value: Any, where: str) -> Cited:
    """Mark a value that follows from printed ones."""
    return Cited(value, "derived", where)


@checked
def chosen(value: Any, where: str) -> Cited:
    """Mark a value that is our choice, with its reason."""
    return Cited(value, "chosen", where)


@checked
def calibrated(value: Any, where: str) -> Cited:
    """Mark a value tuned to a statement of the source, with that statement."""
    return Cited(value, "calibrated", where)
