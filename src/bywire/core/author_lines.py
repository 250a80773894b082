"""Errors and warnings of a brake's own code, said with the line that its author wrote."""

from __future__ import annotations

import traceback
import warnings
from difflib import get_close_matches

from bywire.core.errors import BywireError


def said_with_line(error: BaseException, *inside: str) -> str:
    """Return an error with the innermost line at which it happened in files of these folders."""
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    text = str(error) if isinstance(error, BywireError) else text
    if isinstance(error, SyntaxError) and error.filename:
        text = f"{type(error).__name__}: {error.msg}"
    if isinstance(error, AttributeError) and error.name and error.obj is not None:
        near = get_close_matches(error.name, dir(error.obj), n=1)
        text += f": did you mean {near[0]!r}?" if near else ""
    if "truth value of a CasADi" in text:
        text = "an if, and, or, min or max on a number of the model: use bywire.core.ops.where"
    line = _innermost(error, *inside)
    return f"{line[0]}, line {line[1]}: {text}" if line else text


def warn_at_line(text: str, kind: type[Warning], error: BaseException, *inside: str) -> None:
    """Warn at the line of an author's file that raised an error, and not at one of ours.

    Parameters
    ----------
    text, kind
        What is said, and its category.
    error
        What went wrong; of an error that was put in other words, what it came from.
    inside
        Folders or files of the author's; the first line of the last one where the error came up
        nowhere in them.
    """
    line = _innermost(error.__cause__ or error, *inside)
    warnings.warn_explicit(text, kind, *(line or (inside[-1], 1)))


def _innermost(error: BaseException, *inside: str) -> tuple[str, int] | None:
    """Return file and line at which an error came up in files of some folders; None for nowhere."""
    if isinstance(error, SyntaxError) and error.filename:
        return error.filename, error.lineno or 1
    lines = [
        (frame.filename, frame.lineno or 1)
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename.startswith(inside) and not frame.filename.startswith("<")
    ]
    return lines[-1] if lines else None
