"""Mapping files: TOML in, mapping out; nothing in them is executed."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from bywire.core.errors import FileError, InputError
from bywire.data.mapping import MeasurementMapping
from bywire.data.mapping_tables import mapping_from

LARGEST = 1_000_000
"""size of a mapping file in bytes; a larger one is refused before it is parsed"""

# The time to read a dotted key grows with the square of its parts, so long ones are not read.
_KEY_PARTS = 8
_PART = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')"""
_LONG_KEY = re.compile(rf"(?<![\w-]){_PART}(?:[ \t]*\.[ \t]*{_PART}){{{_KEY_PARTS}}}")


def read_mapping(path: str | Path) -> MeasurementMapping:
    """Read a mapping file.

    Parameters
    ----------
    path
        TOML file with ``time`` or ``rate`` and a section ``[signals.NAME]`` for each signal.

    Raises
    ------
    FileError
        When the file cannot be read or is no TOML.
    InputError
        For anything in it that does not fit, with the file's name in front.
    """
    file = Path(path)
    content = _parsed(file)
    try:
        return mapping_from(content)
    except InputError as error:
        raise type(error)(f"{file}: {error}") from None


def _parsed(file: Path) -> dict[str, Any]:
    try:
        with file.open("rb") as stream:
            data = stream.read(LARGEST + 1)
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise FileError(f"cannot read mapping {file}: {reason}: check the path") from None
    if len(data) > LARGEST:
        raise FileError(f"{file} has more than {LARGEST // 1000} kB: that is no mapping file")
    try:
        text = data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError:
        raise FileError(f"cannot read mapping {file}: it is not UTF-8: give a TOML file") from None
    if _LONG_KEY.search(text):
        raise FileError(f"{file} holds a dotted key of more than {_KEY_PARTS} parts: shorten it")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise FileError(f"{file} is no mapping file: it is nested far too deeply") from None
    except ValueError as error:  # TOMLDecodeError, or a number of thousands of digits
        raise FileError(f"{file} is not valid TOML: {error}") from None
