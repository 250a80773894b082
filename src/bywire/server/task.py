"""What can be computed from a page: fields that a form has, and the public function they go to."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bywire.core.errors import InputError, unknown_name
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.server.field import Field
from bywire.server.place import Place, shortened
from bywire.server.refusal import RefusedError


@dataclass(frozen=True)
class Task:
    """Something that is computed in a process of its own.

    Parameters
    ----------
    name
        By which forms and results call it.
    title, action
        Heading of its form, and what its button says.
    fields
        Of its form.
    compute
        ``compute(asked, out, progress)``: calls the public function. ``out`` is the folder in
        which the result is written.
    subject
        Field whose value the result's folder is named after.
    summary
        What it does, in a line: with one, it has a page of its own that the start page leads to.
    command
        What the same is called in a terminal, behind ``bywire``; its name by default.
    is_kept
        Whether the same subject goes on in the same folder.
    begun
        ``begun(asked, place, folders)``: returns which of the folders of its subject holds what is
        asked, unfinished perhaps: then it is gone on with; None for none.
    is_file
        Whether ``out`` is a file that the task itself writes.
    """

    name: str
    title: str
    action: str
    fields: tuple[Field, ...]
    compute: Callable[[Mapping[str, Any], Path, Progress], Answer]
    subject: str = "bench"
    summary: str = ""
    command: str = ""
    is_kept: bool = False
    begun: Callable[[Mapping[str, Any], Place, Sequence[Path]], Path | None] | None = None
    is_file: bool = False

    def read(self, form: Mapping[str, Any], place: Place) -> dict[str, Any]:
        """Return what a form gave, checked.

        Raises
        ------
        UnknownNameError
            For fields that there are not.
        RefusedError
            With the field: status 404 for a path that is not in the folder, 422 for any other
            value that does not fit.
        """
        known = {field.name: field for field in self.fields}
        for name in form:
            if name not in known:
                raise unknown_name(f"field of {self.name!r}", name, known)
        asked: dict[str, Any] = {}
        for field in self.fields:
            with _beside(field, place):
                asked[field.name] = field.read(form.get(field.name), place)
        for field in self.fields:
            if field.fits is not None and asked[field.name]:
                with _beside(field, place):
                    field.fits(asked, place)
        return asked

    def said_of(self, asked: Mapping[str, Any]) -> str:
        """Return what lists of jobs call it by."""
        subject = asked[self.subject]
        return ", ".join(subject) if isinstance(subject, list) else str(subject)

    def stem(self, asked: Mapping[str, Any]) -> str:
        """Return what the folder of its result is called by."""
        subject = asked[self.subject]
        if isinstance(subject, list):
            return shortened("-".join(Path(each).stem for each in subject))
        return shortened(Path(str(subject)).stem)


@contextmanager
def _beside(field: Field, place: Place) -> Iterator[None]:
    """Have what is refused say which field it stands beside, with paths as the folder has them."""
    try:
        yield
    except RefusedError as refused:
        raise RefusedError(refused.status, refused.text, field.name) from None
    except InputError as error:
        said = str(error).replace(f"{place.root}{os.sep}", "")
        raise RefusedError(422, said, field.name) from None
