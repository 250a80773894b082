"""Fields of forms, and checks of their values before a computation."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from bywire.bench.bench_file import PATHS
from bywire.core.errors import ParameterError, not_valid, quoted, unknown_name
from bywire.core.pairs import changes, named, read_count
from bywire.server.contents import Contents
from bywire.server.place import Place, require_inside
from bywire.usecases.declare import Kind

_LONGEST = 20_000  # characters of a field


@dataclass(frozen=True)
class Field:
    """Field of a form.

    Parameters
    ----------
    name, label
        Name of the field, and label on the page.
    kind
        A ``text``, a ``whole`` number, ``lines`` of text, ``pairs`` (lines of ``KEY=VALUE``),
        ``changes`` (such pairs, of which some name files), ``names`` (lines of ``NAME`` or
        ``NAME=TEXT``), a ``flag``, a ``choice``, a measurement ``file`` or ``files`` of the folder,
        or a ``thing`` or ``things``: a known name, or a file of the folder.
    hint
        Help text of the command's option.
    example
        Value that the field shows while it is empty.
    choices
        Function that returns the known names.
    offered
        Function that returns the things in the folder.
    is_required
        Whether the user must fill in the field.
    default
        Default of a whole number or a flag.
    least
        Least valid value of a whole number.
    """

    name: str
    label: str
    kind: Kind = "text"
    hint: str = ""
    example: str = ""
    choices: Callable[[], Sequence[str]] | None = None
    offered: Callable[[Contents], Sequence[str]] | None = None
    is_required: bool = False
    default: int | None = None
    least: int = 0

    def read(self, given: Any, place: Place) -> Any:
        """Check and return a form's value, with paths relative to the folder.

        Raises
        ------
        InputError
            If the value is of the wrong kind, unknown, missing, or too long.
        RefusedError
            If a path is outside the folder.
        """
        if self.kind == "flag":
            if not isinstance(given, (bool, type(None))):
                raise not_valid(self.name, quoted(given), "true or false")
            return bool(self.default) if given is None else given
        text = "" if given is None else given
        if not isinstance(text, str) or len(text) > _LONGEST or "\0" in text:
            raise not_valid(self.name, quoted(given), f"text of at most {_LONGEST:,} characters")
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        if self.is_required and not lines:
            raise ParameterError(f"{self.label} is required. Fill it in", name=self.label)
        return self._checked(lines, text.strip(), place)

    def _checked(self, lines: list[str], text: str, place: Place) -> Any:
        if self.kind == "lines":
            return lines
        if self.kind == "names":
            return named(lines, self.label)
        if self.kind in ("pairs", "changes"):
            values = changes(lines, self.label)
            require_inside(place, values if self.kind == "changes" else {}, PATHS)
            return values
        if self.kind == "files":
            return [place.named(place.file(line)) for line in lines]
        if self.kind == "things":
            return [self._thing(line, place) for line in lines]
        if self.kind == "whole":
            return self._whole(text)
        if self.kind == "file" and text:
            return place.named(place.file(text))
        if self.kind == "thing" and text:
            return self._thing(text, place)
        if self.kind == "choice" and text and text not in self._known():
            raise unknown_name(self.label, text, self._known())
        return text

    def _known(self) -> Sequence[str]:
        return () if self.choices is None else self.choices()

    def _whole(self, text: str) -> int | None:
        if not text:
            return self.default
        number = read_count(text)
        if number is None or number < self.least:
            raise not_valid(self.label, quoted(text), f"a whole number >= {self.least}")
        return number

    def _thing(self, text: str, place: Place) -> str:
        """Return a thing by its known name, or by its path in the folder."""
        if text in self._known():
            if os.path.lexists(place.root / text):  # the use case may read this path first
                place.inside(text)
            return text
        path = place.inside(text)
        if path.is_file() or (path.is_dir() and self.kind == "things"):
            return place.named(path)
        if self.choices is not None and not is_file_name(text):
            raise unknown_name(self.label, text, self._known())
        raise place.unknown(text)


def is_file_name(bench: str) -> bool:
    """Return whether a bench's name is a file name, not an experiment's name."""
    return bench.endswith(".toml")
