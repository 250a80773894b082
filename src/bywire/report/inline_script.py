"""Scripts within a page: their text, and their entry in the page's policy."""

from __future__ import annotations

import base64
import hashlib
import re


def admitted(text: str) -> str:
    """Return the source expression that allows exactly this text.

    Examples
    --------
    >>> admitted("")
    "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='"
    """
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


# --- Scripts without comments and indentation

_COMMENT = r"/\*.*?\*/\s*|^//[^\n]*\n|[ \t]+//[^\n]*$"
_LEFT_OUT = re.compile(rf"{_COMMENT}|^[ \t]+", re.DOTALL | re.MULTILINE)


def bare(script: str) -> str:
    """Return a script without comments and indentation.

    Its texts must not contain two slashes after a space, or a slash before a star.

    Examples
    --------
    >>> bare("/* A sum. */ let a = 1; // one")
    'let a = 1;'
    """
    return _LEFT_OUT.sub("", script)
