"""Writing a new brake's package from the template."""

from __future__ import annotations

import keyword
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from bywire.core.brake import brakes
from bywire.core.errors import FileError, ParameterError, quoted

HERE = Path(__file__).parent
PACKAGE, TESTS = "bywire.template.starter", "starter_tests.py"
_ALLOWED = re.compile(r"[a-z][a-z0-9]*([_-][a-z0-9]+)*")
_LONGEST = 40


def write_package(name: str, folder: Path) -> Path:
    """Write a package that passes ``bywire check``, whole or not at all.

    Parameters
    ----------
    name
        Of the brake, in small letters, digits and single dashes: ``my-brake``.
    folder
        Where its folder is made.

    Returns
    -------
    pathlib.Path
        The new folder.

    Raises
    ------
    ParameterError
        When the name is none that Python and bywire can take.
    FileError
        When there is such a folder already, or it cannot be written.
    """
    package = module_name(name)
    target = folder / name
    if target.exists() or target.is_symlink():
        raise FileError(f"{target} exists already: choose another name, or another folder")
    if not folder.is_dir():
        raise FileError(f"{folder} is no folder: make it first, or choose another one")
    try:
        with tempfile.TemporaryDirectory(dir=folder, prefix=f".{name}-") as scratch:
            draft = Path(scratch) / name
            for place, text in _files(package):
                (draft / place).parent.mkdir(parents=True, exist_ok=True)
                (draft / place).write_text(text, encoding="utf-8")
            os.rename(draft, target)
    except OSError as error:
        raise FileError(f"{target} cannot be written: {error.strerror or error}") from None
    return target


def module_name(name: str) -> str:
    """Return the name of a brake's package.

    Raises
    ------
    ParameterError
        When it cannot be one, with the reason.

    Examples
    --------
    >>> module_name("my-brake")
    'my_brake'
    """
    package = name.replace("-", "_")
    reason = ""
    if not _ALLOWED.fullmatch(name):
        reason = "small letters and digits are wanted, with single dashes between, a letter first"
    elif len(name) > _LONGEST:
        reason = f"at most {_LONGEST} characters are wanted"
    elif keyword.iskeyword(package) or keyword.issoftkeyword(package):
        reason = f"{package} is a word of Python"
    elif package in sys.stdlib_module_names:
        reason = f"Python has a module {package} of its own"
    elif package.replace("_", "-") in brakes():
        reason = f"there is a brake {package.replace('_', '-')} already"
    elif (spec := find_spec(package)) is not None and spec.origin is not None:
        reason = f"a module {package} is installed already"
    if reason:
        raise ParameterError(
            f"{quoted(name)} cannot name a new brake: {reason}; front-caliper, for instance, can"
        )
    return package


def _files(package: str) -> Iterator[tuple[Path, str]]:
    """Yield every file of a new package with its text."""
    for source in sorted((HERE / "starter").rglob("*.py")):
        place = source.relative_to(HERE / "starter")
        yield Path("src") / package / place, _renamed(source, package)
    for source in sorted((HERE / "project").rglob("*")):
        if source.is_file() and source.suffix in (".py", ".toml", ".md"):
            place = source.relative_to(HERE / "project")
            if place.name == TESTS:
                place = place.with_name(f"test_{package}.py")
            yield place, _renamed(source, package)


def _renamed(source: Path, package: str) -> str:
    """Return the text of a file of the template under the new names."""
    text = source.read_text(encoding="utf-8").replace(PACKAGE, package)
    text = text.replace("Starter", "".join(part.capitalize() for part in package.split("_")))
    return text.replace("starter", package.replace("_", "-"))
