"""Public functions that return an answer, check arguments and issue the answer's warnings."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

Asked = ParamSpec("Asked")
Given = TypeVar("Given")


def answering(function: Callable[Asked, Given]) -> Callable[Asked, Given]:
    """Issue the warnings of a function's answer, so that users cannot miss them.

    The wrapper rejects arguments whose types do not match the signature. Commands read warnings,
    notes and failures from the answer, and print each in its place.
    """

    @wraps(function)
    def warned(*args: Asked.args, **kwargs: Asked.kwargs) -> Given:
        from bywire.core.arguments import require_kinds
        from bywire.report.answer import AnswerWarning

        require_kinds(warned, args, kwargs)
        answer: Any = function(*args, **kwargs)
        for text in (*answer.warnings, *answer.notes, *answer.failures):
            warnings.warn(text, AnswerWarning, stacklevel=2)
        return answer  # type: ignore[no-any-return]

    return warned
