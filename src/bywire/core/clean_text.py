"""Cleaning of untrusted text for pages, figures and terminals."""

from __future__ import annotations

import unicodedata

_WORD, _PATH, _MESSAGE = 120, 600, 3000  # maximum lengths of displayed texts, in characters


def clean(text: object) -> str:
    """Return text without characters that could disturb a page, a figure or a terminal.

    White space becomes a plain space, except line breaks. Control characters, marks that reverse
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
    """Shorten a message to a readable length, but keep its beginning and its end.

    Examples
    --------
    >>> len(shortened("unknown parameter '" + 400 * "x" + "': valid names are a, b"))
    162
    """
    words = [_cut(word, _WORD if "/" not in word else _PATH) for word in text.split(" ")]
    return _cut(" ".join(words), _MESSAGE)


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: 2 * most // 3]}...{text[-most // 3 :]}"
