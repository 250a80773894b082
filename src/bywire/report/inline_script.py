"""Scripts within a page: without what is for those who change them."""

from __future__ import annotations

import re

_LEFT_OUT = re.compile(r"/\*.*?\*/\s*|^//[^\n]*\n|[ \t]+//[^\n]*$|^[ \t]+", re.DOTALL | re.MULTILINE)


def bare(script: str) -> str:
    """Return a script without comments and indentation.

    No text in it may hold two slashes after a space.

    Examples
    --------
    >>> bare("/* A sum. */\\nlet a = 1; // one\\n  a += 2;")
    'let a = 1;\\na += 2;'
    """
    return _LEFT_OUT.sub("", script)
