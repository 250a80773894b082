"""What can be computed from a page: fields that a form has, and the public function they go to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from bywire.bench.bench_text import PATHS
from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.pairs import changes, named
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.place import Place, require_inside

_LONGEST = 20_000  # characters of a field


Kind = Literal["text", "lines", "pairs", "changes", "names", "flag", "file", "files", "bench"]


@dataclass(frozen=True)
class Field:
    """A field of a form.

    Parameters
    ----------
    name, label
        Of the field, and what stands beside it.
    kind
        A ``text``, ``lines`` of text, ``pairs`` (lines of ``KEY=VALUE``), ``changes`` (such pairs,
        of which some name files), ``names`` (lines of ``NAME`` or ``NAME=TEXT``), a ``flag``, a
        ``file`` or ``files`` of the folder, a ``bench`` (a file of it, or an experiment).
    hint
        An example, or what it is left out for.
    choices
        Returns what can be chosen.
    is_required
        Whether it must be filled in.
    """

    name: str
    label: str
    kind: Kind = "text"
    hint: str = ""
    choices: Callable[[], Sequence[str]] | None = None
    is_required: bool = False

    def read(self, given: Any, place: Place) -> Any:
        """Return what a form gave, checked; paths as they stand in the folder.

        Raises
        ------
        ParameterError
            When it is of another kind, missing, or too long.
        RefusedError
            For a path that is not in the folder.
        """
        if self.kind == "flag":
            if not isinstance(given, (bool, type(None))):
                raise ParameterError(f"{self.name} = {quoted(given)}: true or false is wanted")
            return bool(given)
        text = "" if given is None else given
        if not isinstance(text, str) or len(text) > _LONGEST or "\0" in text:
            raise ParameterError(
                f"{self.name} = {quoted(given)}: a text of at most {_LONGEST:,} characters is "
                "wanted"
            )
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        if self.is_required and not lines:
            raise ParameterError(f"{self.label} is missing: fill it in")
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
        is_path = self.kind == "file" or (self.kind == "bench" and is_file_name(text))
        return place.named(place.file(text)) if is_path and text else text


@dataclass(frozen=True)
class Task:
    """Something that is computed in a process of its own.

    Parameters
    ----------
    name
        As its command.
    title, action
        Heading of its form, and what its button says.
    fields
        Of its form.
    compute
        ``compute(asked, out, progress)``: calls the public function. ``out`` is the folder in
        which the result is written.
    subject
        Field whose value the result's folder is named after.
    is_kept
        Whether the same subject goes on in the same folder.
    is_file
        Whether ``out`` is a file that the task itself writes.
    """

    name: str
    title: str
    action: str
    fields: tuple[Field, ...]
    compute: Callable[[Mapping[str, Any], Path, Progress], Answer]
    subject: str = "bench"
    is_kept: bool = False
    is_file: bool = False

    def read(self, form: Mapping[str, Any], place: Place) -> dict[str, Any]:
        """Return what a form gave, checked.

        Raises
        ------
        InputError
            For fields that there are not, and values that do not fit.
        RefusedError
            For paths that are not in the folder.
        """
        known = {field.name: field for field in self.fields}
        for name in form:
            if name not in known:
                raise unknown_name(f"field of {self.name!r}", name, known)
        return {name: field.read(form.get(name), place) for name, field in known.items()}

    def stem(self, asked: Mapping[str, Any]) -> str:
        """Return what the folder of its result is called by."""
        return Path(str(asked[self.subject])).stem


def is_file_name(bench: str) -> bool:
    """Return whether the name of a bench is that of a file, and not of an experiment."""
    return bench.endswith(".toml")
