"""Parser of options such as ``motor.R_m=0.4 ohm`` in commands and forms."""

from __future__ import annotations

from collections.abc import Iterable

from bywire.core.errors import ParameterError

DIGITS = 9
"""maximum number of digits of a count"""
_INPUT = ("--input", "Inputs")  # in commands and in forms
_CHANGE = "KEY=VALUE, for example motor.R_m=0.4ohm"
_FORMS = {
    **dict.fromkeys(
        _INPUT,
        "STIMULUS=SIGNAL, a stimulus of the model and the measured signal, such as p_set=p_ref",
    ),
    "--option": "NAME=VALUE, an option of the method ('bywire list METHOD')",
    "--prior": "NAME=VALUE +- DEVIATION, for example 'motor.R_m=0.35 +- 0.02 ohm'",
}


def named(texts: Iterable[str] | None, flag: str) -> dict[str, str]:
    """Return names and texts of an option ``NAME`` or ``NAME=TEXT``; the default text is empty.

    Raises
    ------
    ParameterError
        For an empty name, and for repeated names.
    """
    values: dict[str, str] = {}
    for text in texts or ():
        name, equals, value = (part.strip() for part in text.partition("="))
        if not name or (equals and not value):
            raise ParameterError(
                f"{flag} {text} is not valid. Write NAME, or NAME=TEXT",
                name=flag,
                value=text,
                valid="NAME, or NAME=TEXT",
            )
        if name in values:
            raise ParameterError(
                f"{flag} {text}: {name} appears twice. Remove one of them",
                name=flag,
                value=text,
            )
        values[name] = value
    return values


def changes(texts: Iterable[str] | None, flag: str = "--set") -> dict[str, str]:
    """Return keys and values of ``--set KEY=VALUE`` or a similar option.

    With ``--input STIMULUS``, the measured signal with the same name drives the stimulus.

    Raises
    ------
    ParameterError
        For a text that does not have the form KEY=VALUE, and for repeated keys.
    """
    values: dict[str, str] = {}
    for text in texts or ():
        key, equals, value = (part.strip() for part in text.partition("="))
        if flag in _INPUT and not equals:
            value = equals = key
        if not equals or not key or not value:
            raise ParameterError(
                f"{flag} {text} is not valid. Write {_FORMS.get(flag, _CHANGE)}",
                name=flag,
                value=text,
                valid=_FORMS.get(flag, _CHANGE),
            )
        if key in values:
            raise ParameterError(
                f"{flag} {text}: {key} is set twice. Remove one of them", name=flag, value=text
            )
        values[key] = value
    return values


def read_count(text: str) -> int | None:
    """Return a string of at most `DIGITS` digits as a whole number >= 0; None for other strings.

    Examples
    --------
    >>> read_count(" 12 "), read_count("1.5"), read_count("9" * 400)
    (12, None, None)
    """
    digits = text.strip()
    is_whole = digits.isascii() and digits.isdecimal() and len(digits) <= DIGITS
    return int(digits) if is_whole else None
