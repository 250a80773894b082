"""Scripts within a page: without what is for those who change them."""

from __future__ import annotations

import re

_COMMENT = r"/\*.*?\*/\s*|^//[^\n]*\n|[ \t]+//[^\n]*$"
_LEFT_OUT = re.compile(rf"{_COMMENT}|^[ \t]+", re.DOTALL | re.MULTILINE)


def bare(script: str) -> str:
    """Return a script without comments and indentation.

    No text in it may hold two slashes after a space, nor a slash before a star.

    Examples
    --------
    >>> bare("/* A sum. */ let a = 1; // one")
    'let a = 1;'
    """
    return _LEFT_OUT.sub("", script)
