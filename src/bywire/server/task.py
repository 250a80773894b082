"""Tasks that pages offer: all use cases with a form."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from bywire.bench.bench_file import PATHS
from bywire.core.errors import InputError, unknown_name
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.contents import Contents
from bywire.server.exchange import RefusedError
from bywire.server.field import Field, is_file_name
from bywire.server.place import Place, shortened
from bywire.server.study_so_far import StudyProgress
from bywire.usecases import use_cases
from bywire.usecases.declare import Argument, Form, UseCase


@dataclass(frozen=True)
class Task:
    """Use case that pages offer, computed in a separate process.

    Parameters
    ----------
    case, form
        The use case, and its form as declared.
    fields
        Fields of the form, in the order shown.
    """

    case: UseCase
    form: Form
    fields: tuple[Field, ...]

    @property
    def name(self) -> str:
        """Name in forms and results."""
        return self.form.name or self.command

    @property
    def command(self) -> str:
        """Words of the corresponding command, after ``bywire``."""
        return self.case.commands[0].words

    def read(self, form: Mapping[str, Any], place: Place) -> dict[str, Any]:
        """Check and return the values of a form.

        Raises
        ------
        UnknownNameError
            If a field is unknown.
        RefusedError
            Contains the field, with status 404 for a path outside the folder, and 422 for any other
            invalid value.
        """
        known = {field.name: field for field in self.fields}
        for name in form:
            if name not in known:
                raise unknown_name(f"field of {self.name!r}", name, known)
        asked: dict[str, Any] = {}
        for field in self.fields:
            with _beside(field.name, place):
                asked[field.name] = field.read(form.get(field.name), place)
        self._require_fitting(self._from_anywhere(asked, place), place)
        return asked

    def compute(self, asked: Mapping[str, Any], out: Path, progress: Progress) -> Answer:
        """Call the function. ``out`` is the folder, or file, of the result."""
        shown = StudyProgress(out, progress) if self.form.is_kept else progress
        answer: Answer = self.case.call(self._filled_in(asked), out=out, progress=shown)
        return answer

    def begun(self, asked: Mapping[str, Any], place: Place, folders: Sequence[Path]) -> Path | None:
        """Return the folder with earlier results for the same values to continue there, or None."""
        if self.case.holds is None:
            return None
        read = self.case.read(self._from_anywhere(asked, place))
        return next((each for each in folders if self.case.holds(each, read)), None)

    def said_of(self, asked: Mapping[str, Any]) -> str:
        """Return the subject that the list of jobs shows."""
        subject = asked[self.form.subject]
        return ", ".join(subject) if isinstance(subject, list) else str(subject)

    def stem(self, asked: Mapping[str, Any]) -> str:
        """Return the base of the result folder's name."""
        subject = asked[self.form.subject]
        if isinstance(subject, list):
            return shortened("-".join(Path(each).stem for each in subject))
        return shortened(Path(str(subject)).stem)

    def _arguments(self) -> list[Argument]:
        """Return the arguments behind the fields."""
        known = {argument.name: argument for argument in self.case.arguments}
        return [known[field.name] for field in self.fields]

    def _filled_in(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """Return the filled-in values. Empty fields have the default."""
        filled = {name: value for name, value in asked.items() if value not in ("", None, [], {})}
        for each in self._arguments():
            if each.ask.ticked and filled.pop(each.name, False):
                filled[each.name] = each.ask.ticked
        return filled

    def _from_anywhere(self, asked: Mapping[str, Any], place: Place) -> dict[str, Any]:
        """Return the filled-in values, with absolute paths of files."""
        found = self._filled_in(asked)
        for each in self._arguments():
            value = found.get(each.name)
            if value is None:
                continue
            if each.kind == "changes":
                found[each.name] = {
                    key: str(place.root / text) if key.rpartition(".")[2] in PATHS else text
                    for key, text in value.items()
                }
            elif each.kind == "thing":
                found[each.name] = _path_of(value, place)
            elif each.kind == "things":
                found[each.name] = [_run_of(name, place) for name in value]
        return found

    def _require_fitting(self, given: Mapping[str, Any], place: Place) -> None:
        """Raise the use case's error with the field that causes it.

        This is the first field for which the error stays the same if all later fields are removed.
        """
        try:
            self.case.read(given)
        except InputError as error:
            filled = [field.name for field in self.fields if field.name in given]
            required = [field.name for field in self.fields if field.is_required]
            for count, name in enumerate(filled, 1):
                kept = {n: given[n] for n in given if n in required or n in filled[:count]}
                if count == len(filled) or self._error_of(kept) == str(error):
                    with _beside(name, place):
                        raise

    def _error_of(self, given: Mapping[str, Any]) -> str:
        try:
            self.case.read(given)
        except InputError as error:
            return str(error)
        return ""


@cache
def tasks() -> Mapping[str, Task]:
    """Return every task by its name."""
    found = [_task_of(case, case.form) for case in use_cases().values() if case.form is not None]
    return {task.name: task for task in sorted(found, key=lambda task: task.name)}


def _task_of(case: UseCase, form: Form) -> Task:
    labeled = {a.name: a for a in case.arguments if a.ask.label}
    return Task(case, form, tuple(_field(labeled[name]) for name in form.fields or labeled))


def _field(argument: Argument) -> Field:
    ask, default = argument.ask, argument.default
    kind = "flag" if ask.ticked else argument.kind

    def offered(there: Contents) -> Sequence[str]:
        return [name for part in ask.offered for name in getattr(there, part)]

    return Field(
        argument.name,
        ask.label,
        kind,
        "" if ask.ticked else ask.help,
        ask.example,
        _words_of(argument),
        offered if ask.offered else None,
        is_required=argument.is_required or argument.is_many,
        default=int(default) if isinstance(default, int) and (default or kind == "whole") else None,
        least=ask.least or 0,
    )


def _words_of(argument: Argument) -> Callable[[], Sequence[str]] | None:
    """Return a function for all known names, if there are any."""
    words, kinds = argument.ask.words, argument.ask.known
    if kinds:
        return lambda: _names(*kinds)
    if not words:
        return None
    return words if callable(words) else lambda: words


def _names(*kinds: str) -> list[str]:
    from bywire.api.overview import overview

    things = overview().things
    return sorted({name for kind in kinds for name in things[kind]})


def _path_of(name: str, place: Place) -> Path:
    """Return the absolute path of a file in the folder, or the name itself for other names."""
    return place.root / name if is_file_name(name) else Path(name)


def _run_of(name: str, place: Place) -> Path:
    """Return the path of a run. A result takes precedence over an experiment with its name."""
    from bywire.bench.bench_file import names_experiment
    from bywire.bench.result_folder import is_result_folder

    path = place.root / name
    if path.is_dir() and (is_result_folder(path) or not names_experiment(name)):
        return path
    return _path_of(name, place)


@contextmanager
def _beside(field: str, place: Place) -> Iterator[None]:
    """Add the field to an error, and make its paths relative to the folder."""
    try:
        yield
    except RefusedError as refused:
        raise RefusedError(refused.status, refused.text, field) from None
    except InputError as error:
        message = str(error).replace(f"{place.root}{os.sep}", "")
        raise RefusedError(422, message, field) from None
