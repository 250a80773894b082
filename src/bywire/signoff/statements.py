"""Requirements and assumptions, and their places in files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bywire.core.errors import InputError, ParameterError, not_valid, quoted

_LONGEST = 200  # characters of an id


@dataclass(frozen=True)
class Place:
    """Line of a file, for errors.

    Parameters
    ----------
    file
        The file.
    line
        Number of the line; 0 if the file has no lines.
    """

    file: Path
    line: int = 0

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}" if self.line else str(self.file)


NOWHERE = Place(Path())
"""place of a statement that does not come from a file"""


@contextmanager
def placed(place: Place) -> Iterator[None]:
    """Add the place in a file to errors in the user's input."""
    try:
        yield
    except InputError as error:
        raise error.reworded(f"{place}: {error}") from None


@dataclass(frozen=True)
class Statement:
    """Requirement, or an assumption on which requirements rely.

    Parameters
    ----------
    id
        Unique name, as in the system that manages the requirements.
    text
        The statement itself.
    source
        Document and section from which it comes; may be empty.
    group
        Heading under which the document lists it; may be empty.
    assumes
        Names of the assumptions on which it relies.
    is_assumption
        Whether it is an assumption.
    place
        Its place in a file.
    """

    id: str
    text: str
    source: str = ""
    group: str = ""
    assumes: tuple[str, ...] = ()
    is_assumption: bool = False
    place: Place = NOWHERE


def require_id(id: str) -> None:
    """Reject an id that is too long or not in one line.

    Raises
    ------
    ParameterError
        With the id.
    """
    if len(id) > _LONGEST or not id.isprintable() or id != id.strip():
        raise not_valid("id", quoted(id), f"one line of at most {_LONGEST} printable characters")


def require_sound(statements: Sequence[Statement]) -> None:
    """Reject statements with the same id, unknown assumptions, and circular assumptions.

    Raises
    ------
    ParameterError
        With the place in the file.
    """
    known: dict[str, Statement] = {}
    for each in statements:
        if each.id in known:
            raise ParameterError(
                f"{each.place}: id {each.id!r} appears twice (first in {known[each.id].place}). "
                "Each requirement and assumption needs its own id",
                name="id",
                value=each.id,
            )
        known[each.id] = each
    for each in statements:
        for name in each.assumes:
            if name not in known or not known[name].is_assumption:
                raise ParameterError(
                    f"{each.place}: assumes contains {name!r}, which is not an assumption. Add an "
                    f"[[assumption]] with this id, or remove {name!r}",
                    name="assumes",
                    value=name,
                )
    settled: set[str] = set()
    for each in statements:
        _require_no_circle(each, known, (), settled)


def _require_no_circle(
    each: Statement, known: Mapping[str, Statement], above: tuple[str, ...], settled: set[str]
) -> None:
    if each.id in above:
        circle = " -> ".join((*above[above.index(each.id) :], each.id))
        raise ParameterError(
            f"{each.place}: assumptions rely on each other circularly ({circle}). Remove one of "
            "these ids from assumes",
            name="assumes",
            value=circle,
        )
    if each.id in settled:
        return
    for name in each.assumes:
        _require_no_circle(known[name], known, (*above, each.id), settled)
    settled.add(each.id)
