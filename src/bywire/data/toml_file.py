"""TOML files from outside: bounded in size and in the time that reading them takes."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bywire.core.errors import FileError, quoted
from bywire.core.scratch import NULL_CHARACTER

LARGEST = 1_000_000
"""size of a file in bytes; a larger one is refused before it is parsed"""

# The time to read a dotted key grows with the square of its parts, so long ones are not read.
_KEY_PARTS = 16
_PART = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')"""
_LONG_KEY = re.compile(rf"(?<![\w-]){_PART}(?:[ \t]*\.[ \t]*{_PART}){{{_KEY_PARTS}}}")
_ADVICE = "check the path"


def _no_idea(_: Path) -> str:
    return _ADVICE


def read_toml(
    file: Path, kind: str, *, missing: Callable[[Path], str] = _no_idea, too_large: str = ""
) -> dict[str, Any]:
    """Return what a TOML file holds; a mark of the byte order is let pass.

    Parameters
    ----------
    file
        Where it is.
    kind
        What errors call it, for instance ``"bench file"``.
    missing
        Returns what to do about a file that is not there.
    too_large
        What to do about one that is too large, with a semicolon in front.

    Raises
    ------
    FileError
        When the file cannot be read or is no TOML, and for whole numbers beyond all others.
    """
    text = _text(file, kind, missing, too_large)
    if _LONG_KEY.search(text):
        raise FileError(f"{file} holds a dotted key of more than {_KEY_PARTS} parts: shorten it")
    try:
        content = tomllib.loads(text)
        _require_numbers(content, file, "")
    except RecursionError:
        raise FileError(f"{file} is no {kind}: it is nested far too deeply") from None
    except ValueError as error:  # TOMLDecodeError, or a number of thousands of digits
        raise FileError(f"{file} is not valid TOML: {error}") from None
    return content


def _require_numbers(value: Any, file: Path, key: str) -> None:
    """Refuse whole numbers that no floating-point number is as large as, wherever they stand."""
    if isinstance(value, dict):
        for name, each in value.items():
            _require_numbers(each, file, f"{key}.{name}" if key else name)
    elif isinstance(value, list):
        for each in value:
            _require_numbers(each, file, key)
    elif isinstance(value, int) and value.bit_length() >= sys.float_info.max_exp:
        raise FileError(f"{file}: {key} = {quoted(value)}: write any finite number, below 1.8e308")


def _text(file: Path, kind: str, missing: Callable[[Path], str], too_large: str) -> str:
    try:
        with file.open("rb") as stream:
            data = stream.read(LARGEST + 1)
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        reason = error.strerror if isinstance(error, OSError) else NULL_CHARACTER
        hint = missing(file) if isinstance(error, FileNotFoundError) else _ADVICE
        raise FileError(f"cannot read {kind} {file}: {reason}: {hint}") from None
    if len(data) > LARGEST:
        raise FileError(f"{file} has more than {LARGEST // 1000} kB: that is no {kind}{too_large}")
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError:
        raise FileError(
            f"cannot read {kind} {file}: it is not UTF-8 text: give a TOML file"
        ) from None
