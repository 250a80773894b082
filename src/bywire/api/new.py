"""Package for a new brake, written from a template."""

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
    """Package of a new brake.

    Parameters
    ----------
    name
        Name of the brake.
    folder
        Project folder with ``pyproject.toml``, ``README.md``, ``src`` and ``tests``.
    package
        Path of the package, for ``--system``.
    """

    name: str
    folder: Path
    package: Path

    def document(self) -> Document:
        """Return the written files, and the next steps."""
        files = sorted(str(p.relative_to(self.folder)) for p in self.folder.rglob("*.py"))
        steps = [
            f"bywire check --system {self.package}",
            f"bywire run {self.name}-clamp --system {self.package}",
            f"bywire margins {self.name}-force --system {self.package}",
            f"pip install -e {self.folder}    # then every command finds it without --system",
            f"pytest {self.folder / 'tests'}    # with pytest installed",
        ]
        written = Paragraph(f"{self.name} is in {self.folder}. Its README describes the files")
        following = Listing(steps, "Next:")
        return Document(
            f"The brake {self.name}",
            "A package that passes 'bywire check'. Change it step by step.",
            sections=[Section("Files", [written, Listing(files), following])],
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
    """Write a package that passes ``bywire check``. Write nothing if a file cannot be written.

    Parameters
    ----------
    name
        Name of the brake, of lowercase letters, digits and single dashes, such as ``my-brake``.
    folder
        Parent folder.

    Returns
    -------
    pathlib.Path
        The new folder.

    Raises
    ------
    ParameterError
        If the name is not valid for Python or bywire.
    FileError
        If the folder already exists, or is not writable.
    """
    package = module_name(name)
    target = folder / name
    if target.exists() or target.is_symlink():
        raise FileError(
            f"{target} already exists. Choose another name or another folder", name=str(target)
        )
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder} is not a folder. Choose another path", name=str(folder))
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
            f"cannot write {target}: {error.strerror or error}. Free some space, or choose another "
            "folder",
            name=str(target),
        ) from None
    return target


def module_name(name: str) -> str:
    """Return the name of a brake's package.

    Raises
    ------
    ParameterError
        If the name is not valid. The message states the reason.

    Examples
    --------
    >>> module_name("my-brake")
    'my_brake'
    """
    package = name.replace("-", "_")
    reason = ""
    if not _ALLOWED.fullmatch(name):
        reason = "it must start with a letter and contain lowercase letters, digits, single dashes"
    elif len(name) > _LONGEST:
        reason = f"it must have at most {_LONGEST} characters"
    elif keyword.iskeyword(package) or keyword.issoftkeyword(package):
        reason = f"{package} is a Python keyword"
    elif package in sys.stdlib_module_names:
        reason = f"Python has a standard module {package}"
    elif package.replace("_", "-") in brakes():
        reason = f"the brake {package.replace('_', '-')} already exists"
    elif (spec := find_spec(package)) is not None and spec.origin is not None:
        reason = f"a module {package} is already installed"
    if reason:
        raise ParameterError(
            f"{quoted(name)} cannot be the name of a new brake: {reason}. Choose a name such as "
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
    """Return the text of a template file with the new names."""
    text = source.read_text(encoding="utf-8").replace(PACKAGE, package)
    text = text.replace("Starter", "".join(part.capitalize() for part in package.split("_")))
    return text.replace("starter", package.replace("_", "-"))
