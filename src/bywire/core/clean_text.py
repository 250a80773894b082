"""Text from anywhere, without what could disturb a page, a figure or a terminal."""

from __future__ import annotations

import unicodedata

_WORD, _PATH, _MESSAGE = 120, 600, 3000  # characters that are shown of each


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


def shortened(text: str) -> str:
    """Return a message of a length that can be read, with its beginning and its end.

    Examples
    --------
    >>> len(shortened("unknown parameter '" + 400 * "x" + "': known are a, b"))
    156
    """
    words = [_cut(word, _WORD if "/" not in word else _PATH) for word in text.split(" ")]
    return _cut(" ".join(words), _MESSAGE)


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: 2 * most // 3]}...{text[-most // 3 :]}"
