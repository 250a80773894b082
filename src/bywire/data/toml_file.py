"""Users' TOML files: limits of size and time, kinds, and suggestions for missing files."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

from bywire.core.errors import FileError, ParameterError, quoted
from bywire.core.scratch import NULL_CHARACTER

LARGEST = 1_000_000
"""maximum file size in bytes, checked before parsing"""

# The time to read a dotted key grows with the square of its parts, so bywire rejects long keys.
_KEY_PARTS = 16
_PART = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')"""
_LONG_KEY = re.compile(rf"(?<![\w-]){_PART}(?:[ \t]*\.[ \t]*{_PART}){{{_KEY_PARTS}}}")
_ENTRY = re.compile(r"[ \t]*\[\[[ \t]*([\w-]+)[ \t]*\]\]")
_TRIPLE = re.compile(r'"""|\'\'\'')
_ADVICE = "check the path"


def _no_idea(_: Path) -> str:
    return _ADVICE


def read_toml(
    file: Path, kind: str, *, missing: Callable[[Path], str] = _no_idea, too_large: str = ""
) -> dict[str, Any]:
    """Return the content of a TOML file, with or without a byte-order mark.

    Parameters
    ----------
    file
        Path of the file.
    kind
        Its name in errors, for example ``"bench file"``.
    missing
        Returns the next step for a missing file.
    too_large
        Next step for a file that is too large, after a period.

    Raises
    ------
    FileError
        When the file cannot be read, is not valid TOML, or contains an integer beyond the range of
        floating point.
    """
    text = _text(file, kind, missing, too_large)
    if _LONG_KEY.search(text):
        raise FileError(
            f"{file} contains a dotted key of more than {_KEY_PARTS} parts. Shorten it",
            name=str(file),
        )
    try:
        content = tomllib.loads(text)
        _require_numbers(content, file, "")
    except RecursionError:
        raise FileError(
            f"{file} is not a valid {kind}: it is nested too deeply", name=str(file)
        ) from None
    except ValueError as error:  # TOMLDecodeError, or a number of thousands of digits
        raise FileError(f"{file} is not valid TOML: {error}", name=str(file)) from None
    return content


def entry_lines(file: Path) -> dict[str, list[int]]:
    """Return the lines at which the entries of arrays of tables start, by the array's name.

    Only for errors: the lines are those of ``[[NAME]]`` outside multi-line strings.
    """
    lines: dict[str, list[int]] = {}
    closing = ""
    for number, line in enumerate(_text(file, "file", _no_idea, "").splitlines(), start=1):
        if not closing and (match := _ENTRY.match(line)):
            lines.setdefault(match[1], []).append(number)
        closing = _closing_after(line, closing)
    return lines


def _closing_after(line: str, closing: str) -> str:
    """Return the quotation marks that end the multi-line string at the end of a line; or empty."""
    rest = line
    while True:
        if closing:
            _, found, rest = rest.partition(closing)
            if not found:
                return closing
            closing = ""
        match = _TRIPLE.search(rest)
        if match is None or "#" in rest[: match.start()]:
            return ""
        closing, rest = match[0], rest[match.end() :]


def _require_numbers(value: Any, file: Path, key: str) -> None:
    """Reject integers beyond the range of floating point, at any depth."""
    if isinstance(value, dict):
        for name, each in value.items():
            _require_numbers(each, file, f"{key}.{name}" if key else name)
    elif isinstance(value, list):
        for each in value:
            _require_numbers(each, file, key)
    elif isinstance(value, int) and value.bit_length() >= sys.float_info.max_exp:
        raise FileError(
            f"{file}: {key} = {quoted(value)} is not valid: it must be a finite number, below "
            "1.8e308",
            name=key,
            value=quoted(value),
            valid="a finite number",
        )


def _text(file: Path, kind: str, missing: Callable[[Path], str], too_large: str) -> str:
    data = limited_bytes(file, kind, missing=missing, too_large=too_large)
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError:
        raise FileError(
            f"cannot read {kind} {file}: it is not UTF-8 text. Save it as UTF-8, or specify a TOML "
            "file",
            name=str(file),
        ) from None


def limited_bytes(
    file: Path,
    kind: str,
    most: int = LARGEST,
    *,
    missing: Callable[[Path], str] = _no_idea,
    too_large: str = "",
) -> bytes:
    """Return the content of a file of limited size.

    Parameters
    ----------
    file
        Path of the file.
    kind
        Its name in errors.
    most
        Maximum size in bytes.
    missing, too_large
        Next steps, see `read_toml`.

    Raises
    ------
    FileError
        When the file cannot be read or is too large.
    """
    try:
        with file.open("rb") as stream:
            data = stream.read(most + 1)
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        reason = error.strerror if isinstance(error, OSError) else NULL_CHARACTER
        hint = missing(file) if isinstance(error, FileNotFoundError) else _ADVICE
        raise FileError(f"cannot read {kind} {file}: {reason}: {hint}", name=str(file)) from None
    if len(data) > most:
        raise FileError(
            f"{file} is larger than {most // 1000} kB, which is too large for a {kind}{too_large}",
            name=str(file),
        )
    return data


# --- Kinds of files

BENCH, STUDY, LIFE, CAMPAIGN = "bench", "study", "life", "campaign"
PROCEDURE, SIGNOFF = "procedure", "sign-off"
_COMMANDS = {
    BENCH: "bywire run",
    STUDY: "bywire study run",
    LIFE: "bywire life",
    CAMPAIGN: "bywire faults",
    PROCEDURE: "bywire procedure",
    SIGNOFF: "bywire signoff",
}
_WORDS = {
    BENCH: "a bench",
    STUDY: "a study",
    LIFE: "a life",
    CAMPAIGN: "a fault campaign",
    PROCEDURE: "a procedure",
    SIGNOFF: "a sign-off",
}
HEADS = {
    BENCH: "experiment",
    STUDY: "bench",
    LIFE: "life",
    CAMPAIGN: "bench",
    PROCEDURE: "procedure",
    SIGNOFF: "requirement",
}
"""required key of each kind"""
_OF_CAMPAIGNS = ("campaign", "criteria")
_NEVER_IN_STUDIES = {*_OF_CAMPAIGNS, "values", "residuals", "rates", "reaction"}
_NEVER_IN_CAMPAIGNS = {"design", "correlation", "requirements"}


def kind_of(content: Mapping[str, Any]) -> str:
    """Return the kind of a file's content by its keys; empty if undecided.

    Examples
    --------
    >>> kind_of({"experiment": "hard-braking"}), kind_of({"bench": "b.toml", "vary": {}})
    ('bench', 'study')
    """
    keys = content.keys()
    if keys & {"requirement", "evidence"}:
        return SIGNOFF
    if "life" in keys:
        return LIFE
    if "procedure" in keys:
        return PROCEDURE
    if "bench" not in keys:
        return BENCH if "experiment" in keys else ""
    if not keys & _NEVER_IN_STUDIES:
        return STUDY if keys & {"vary", "measured", *_NEVER_IN_CAMPAIGNS} else ""
    is_campaign = any(key in keys for key in _OF_CAMPAIGNS) and not keys & _NEVER_IN_CAMPAIGNS
    return CAMPAIGN if is_campaign else ""


def kind_of_file(file: Path) -> str:
    """Return the kind of a file (see `kind_of`); empty if it cannot be read."""
    try:
        return kind_of(read_toml(file, "file"))
    except FileError:
        return ""


def require_kind(content: Mapping[str, Any], wanted: str, file: Path) -> None:
    """Reject the content of another kind of file, and mention the command that accepts it.

    Parameters
    ----------
    content
        Content of the file.
    wanted
        `BENCH`, `STUDY`, `LIFE`, `CAMPAIGN`, `PROCEDURE` or `SIGNOFF`.
    file
        Path of the file.

    Raises
    ------
    ParameterError
        Without the file's name in front.
    """
    kind = kind_of(content)
    head = HEADS[wanted]
    has_head = head in content and head != HEADS[kind] if kind else False
    if not kind or kind == wanted or (has_head and kind != PROCEDURE):
        return  # a procedure also names an experiment, like a bench
    raise ParameterError(
        f"this is {_WORDS[kind]}, not {_WORDS[wanted]}. Use '{_COMMANDS[kind]} {file}'",
        name=str(file),
        value=kind,
        valid=wanted,
    )


# --- Suggestions for a missing file: in a usual folder, or the most similar name of its kind

_ENDING = ".toml"


def first_there(places: Iterable[Path]) -> Path | None:
    """Return the first path at which there is a file, or None."""
    try:
        return next((place for place in places if place.is_file()), None)
    except (OSError, ValueError):  # ValueError: a null character in the path
        return None


def near_files(
    file: Path,
    kinds: Collection[str],
    folders: Iterable[Path],
    least: float,
    *,
    with_ending: bool = False,
) -> Iterator[tuple[float, Path]]:
    """Yield files with similar names and their similarity, the most similar first.

    Parameters
    ----------
    file
        The path that the user specified; its folder does not count.
    kinds
        Requested kinds of files (see `bywire.data.toml_file.kind_of`).
    folders
        Folders to search; of two files with the same name, the one in the later folder comes first.
    least
        Minimum similarity, up to 1.
    with_ending
        Whether names are compared with their extensions.
    """
    word = file.name if with_ending else file.name.removesuffix(_ENDING)
    near = []
    try:
        for order, folder in enumerate(folders):
            for path in folder.glob(f"*{_ENDING}"):
                name = path.name if with_ending else path.stem
                likeness = SequenceMatcher(None, name, word).ratio()
                if likeness >= least:
                    near.append((likeness, name, order, path))
    except (OSError, ValueError):  # ValueError: a null character in the path
        return
    for likeness, _, _, path in sorted(near, reverse=True):
        if kind_of_file(path) in kinds:
            yield likeness, path
