"""A new brake's package, written from the template."""

from __future__ import annotations

import keyword
import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from bywire.core.brake import brakes
from bywire.core.errors import FileError, ParameterError, quoted
from bywire.core.scratch import scratch_folder
from bywire.report.answer import Answer
from bywire.report.document import Document, Listing, Paragraph, Section

HERE = Path(__file__).parents[1] / "template"
PACKAGE, TESTS = "bywire.template.starter", "starter_tests.py"
_ALLOWED = re.compile(r"[a-z][a-z0-9]*([_-][a-z0-9]+)*")
_LONGEST = 40


@dataclass(frozen=True)
class NewBrake(Answer):
    """A package that was written.

    Parameters
    ----------
    name
        Of the brake.
    folder
        Its project: ``pyproject.toml``, ``README.md``, ``src`` and ``tests``.
    package
        What ``--system`` takes.
    """

    name: str
    folder: Path
    package: Path

    def document(self) -> Document:
        """Return what was written, and what to do next."""
        files = sorted(str(p.relative_to(self.folder)) for p in self.folder.rglob("*.py"))
        steps = [
            f"bywire check --system {self.package}",
            f"bywire run {self.name}-clamp --system {self.package}",
            f"bywire margins {self.name}-force --system {self.package}",
            f"pip install -e {self.folder}    # then every command finds it without --system",
            f"pytest {self.folder / 'tests'}    # with pytest installed",
        ]
        written = Paragraph(f"{self.name} stands in {self.folder}; its README says what is where")
        following = Listing(steps, "Next:")
        return Document(
            f"The brake {self.name}",
            "A package that passes bywire check, to be changed step by step.",
            sections=[Section("What was written", [written, Listing(files), following])],
            brief=[written, following],
            data=self._data(steps),
        )

    def _data(self, steps: list[str]) -> dict[str, Any]:
        return {
            "name": self.name,
            "folder": str(self.folder),
            "package": str(self.package),
            "next": steps,
        }


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
        raise FileError(
            f"{target} already exists: choose another name, or another folder", name=str(target)
        )
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder} is not a folder: choose another one", name=str(folder))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with scratch_folder(folder) as scratch:
            draft = scratch / name
            for place, text in _files(package):
                (draft / place).parent.mkdir(parents=True, exist_ok=True)
                (draft / place).write_text(text, encoding="utf-8")
            os.rename(draft, target)
    except OSError as error:
        raise FileError(
            f"{target} cannot be written: {error.strerror or error}: make room there, or choose "
            "another folder",
            name=str(target),
        ) from None
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
        reason = "a name has small letters and digits, single dashes between, and a letter first"
    elif len(name) > _LONGEST:
        reason = f"a name has at most {_LONGEST} characters"
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
            f"{quoted(name)} cannot be the name of a new brake: {reason}; choose one such as "
            "front-caliper",
            name="name",
            value=quoted(name),
        )
    return package


def _files(package: str) -> Iterator[tuple[Path, str]]:
    """Yield every file of a new package with its text."""
    for source in sorted((HERE / "starter").rglob("*.py")):
        place = source.relative_to(HERE / "starter")
        yield Path("src") / package / place, _renamed(source, package)
    for source in sorted((HERE / "project").iterdir()):
        yield Path(source.name), _renamed(source, package)
    yield Path("tests") / f"test_{package}.py", _renamed(HERE / TESTS, package)


def _renamed(source: Path, package: str) -> str:
    """Return the text of a file of the template under the new names."""
    text = source.read_text(encoding="utf-8").replace(PACKAGE, package)
    text = text.replace("Starter", "".join(part.capitalize() for part in package.split("_")))
    return text.replace("starter", package.replace("_", "-"))
