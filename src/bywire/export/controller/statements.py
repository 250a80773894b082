"""Statements of C, and which of them a result needs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from bywire.export.controller.values import Expr, Uses


@dataclass(frozen=True)
class Statement:
    """``target = value``, or ``target.member = value``, with comments above.

    Parameters
    ----------
    target
        None (an empty text) where a function is called for what it changes alone.
    changes
        Memory that the function called in ``value`` changes in its place.
    is_pointer
        Whether the target is a pointer to what has the member.
    """

    target: str
    ctype: str
    value: Expr
    member: str = ""
    notes: tuple[str, ...] = ()
    changes: tuple[str, ...] = ()
    is_pointer: bool = False


def live(statements: list[Statement], result: Uses) -> list[Statement]:
    """Return the statements that the result needs."""
    needed, kept = _locals(result), []
    for statement in reversed(statements):
        if statement.target not in needed:
            if needed.isdisjoint(statement.changes):
                continue
            statement = replace(statement, target="")
        kept.append(statement)
        if not statement.member:
            needed.discard(statement.target)
        needed |= _locals(statement.value.uses)
    return kept[::-1]


def _locals(uses: Iterable[Any]) -> set[str]:
    return {use[1] for use in uses if use[0] == "local"}
