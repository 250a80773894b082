"""Values of an ``[[evidence]]`` entry: paths, changes, limits, and digests of files and code."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import bywire
from bywire.bench.bench_file import flattened
from bywire.bench.requirements import Limit, parted, read_limit
from bywire.core.brake import loaded_files
from bywire.core.errors import FileError, not_valid, quoted, unknown_name
from bywire.core.pairs import changes, named
from bywire.usecases.declare import Argument

Origin = tuple[Callable[..., Any], Sequence[Any]]
_SUFFIXES = (".py", ".c", ".h", ".toml", ".js")


def title_of(kind: str, subject: str, arguments: Mapping[str, Any]) -> str:
    """Return the kind, subject and arguments of an entry in one line.

    Examples
    --------
    >>> title_of("loop", "pressure", {"at": "20 bar", "set": {"motor.R_m": "0.4 ohm"}})
    'loop pressure, at = 20 bar, set motor.R_m = 0.4 ohm'
    """
    texts = [f"{kind} {subject}"]
    for key, value in arguments.items():
        if isinstance(value, Mapping):
            texts += [f"{key} {name} = {_text(each)}" for name, each in flattened(value).items()]
        else:
            text = _text(value)
            texts.append(f"{key} {text}" if "=" in text else f"{key} = {text}")
    return ", ".join(texts)


def _text(value: Any) -> str:
    return ", ".join(map(_text, value)) if isinstance(value, list) else str(value)


def there(subject: str, argument: Argument | None, folder: Path) -> str:
    """Return the path of a file relative to the sign-off file, or a name unchanged.

    Parameters
    ----------
    subject
        A file or a name.
    argument
        Argument of the use case, which may accept files only or names only; None for a file.
    folder
        Folder of the sign-off file.
    """
    if argument is not None and not (argument.is_path or argument.ask.files):
        return subject
    is_name = argument is not None and bool(argument.ask.known)
    ending = "" if argument is None else argument.ask.files
    try:
        is_file = not is_name or (folder / subject).is_file()
    except (OSError, ValueError):  # too long, or with a null character
        return subject
    is_file = is_file or "/" in subject or bool(ending and subject.endswith(ending))
    return str(folder / subject) if is_file else subject


def value_of(argument: Argument, value: Any, folder: Path) -> Any:
    """Return the value of a use case's argument from the value in the file.

    Raises
    ------
    ParameterError
        If it has the wrong type.
    """
    kind, name = argument.kind, f"[[evidence]] {argument.name}"
    if kind == "flag":
        if not isinstance(value, bool):
            raise not_valid(name, quoted(value), "true or false")
        return value
    if kind == "whole":
        if not isinstance(value, int) or isinstance(value, bool):
            raise not_valid(name, quoted(value), "a whole number")
        return value
    if kind in ("changes", "pairs", "names") and isinstance(value, Mapping):
        flat = flattened(value)
        for key, each in flat.items():
            if not isinstance(each, str):
                valid = "a string in quotation marks, with its unit"
                raise not_valid(f"{name} {key}", quoted(each), valid)
        return flat
    if kind in ("changes", "pairs", "names", "lines", "files", "things"):
        texts = [value] if isinstance(value, str) else value
        if not isinstance(texts, list) or not all(isinstance(each, str) for each in texts):
            raise not_valid(name, quoted(value), "a string or a list of strings")
        if kind in ("files", "things"):
            return [folder / each for each in texts]
        if kind == "names":
            return named(texts, name)
        return texts if kind == "lines" else changes(texts, name)
    if not isinstance(value, str):
        raise not_valid(name, quoted(value), "a string in quotation marks")
    return there(value, argument, folder)


def read_figure_limit(
    text: str, figures: Mapping[str, str], *, has_probability: bool = False
) -> Limit:
    """Return a limit with the name of its figure in front, such as ``"overshoot <= 15 %"``.

    Parameters
    ----------
    text
        The limit.
    figures
        Unit of every figure by name.
    has_probability
        Whether the limit may end with a probability.

    Raises
    ------
    InputError
        If it is not a limit, the figure is unknown, or the unit is wrong.
    """
    figure, compare, _ = parted(text)
    if compare is None or not figure:
        raise not_valid("limit", quoted(text), "a figure with its limit, as in 'overshoot <= 15 %'")
    if figure not in figures:
        raise unknown_name("key figure in limit", figure, figures)
    limit = text[text.index(figure) + len(figure) :].strip()
    return read_limit(figure, limit, figures[figure], "limit", has_probability=has_probability)


def require_file(path: Any) -> None:
    """Reject the path of a file that does not exist.

    Raises
    ------
    FileError
        With its path.
    """
    if not Path(path).is_file():
        raise FileError(f"the file {path} does not exist. Check its path", name=str(path))


# --- Digests


def file_digest(path: Path) -> str:
    """Return the SHA-256 digest of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def digests_of(asked: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the digests of all files among the values of arguments, by the files' names."""
    digests: dict[str, list[str]] = {}
    for value in asked.values():
        for path in _files(value):
            digests.setdefault(path.name, []).append(file_digest(path))
    return digests


def _files(value: Any) -> Iterator[Path]:
    if isinstance(value, list):
        for each in value:
            yield from _files(each)
    elif isinstance(value, (str, Path)):
        try:
            if (path := Path(value)).is_file():
                yield path
        except (OSError, ValueError):  # a string that is not a path
            return


@cache
def source_digest() -> str:
    """Return the digest of bywire's source code and of the brakes loaded from files."""
    loaded = (Path(file) for file in loaded_files())
    places = [
        Path(next(iter(bywire.__path__))),
        *(file.parent if file.name == "__init__.py" else file for file in loaded),
    ]
    digest = hashlib.sha256()
    for place in places:
        files = [place] if place.is_file() else sorted(place.rglob("*"))
        for path in files:
            if path.suffix in _SUFFIXES and path.is_file():
                digest.update(f"{path.name} {file_digest(path)}\n".encode())
    return digest.hexdigest()
