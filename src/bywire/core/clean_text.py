"""Text from anywhere, without what could disturb a page, a figure or a terminal."""

from __future__ import annotations

import unicodedata


def clean(text: object) -> str:
    """Return text without what could disturb a page, a figure or a terminal.

    White space becomes a plain space (line breaks stay); control characters, marks that reverse
    the reading direction and broken code points become the replacement character.

    Examples
    --------
    >>> clean("brake" + chr(27) + "[31m test")
    'brake�[31m test'
    """
    return "".join(map(_clean_character, str(text)))


def _clean_character(character: str) -> str:
    if character == "\n" or character.isprintable():
        return character
    if character in "\t\r" or unicodedata.category(character) == "Zs":
        return " "
    return "\N{REPLACEMENT CHARACTER}"
