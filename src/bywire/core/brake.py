"""Declarations of brakes, and the search for installed and loaded brakes.

A brake is a package or a single file with one declaration::

    BRAKE = Brake("servo-axis", "a motor that turns a lever against a spring", __name__)

bywire finds installed brakes, including its own, by entry points of the group ``bywire.brakes``.
`load_system` loads other brakes from a path. Bench files are untrusted, so they never load a brake.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
import traceback
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from html import escape
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from bywire.core.arguments import checked
from bywire.core.errors import BywireError, FileError, ModelError
from bywire.core.libraries import allow_dask

GROUP = "bywire.brakes"
"""entry points whose values name modules with a ``BRAKE``"""


class BrakeWarning(UserWarning):
    """Warning that bywire skips an installed brake."""


@checked
@dataclass(frozen=True)
class Brake:
    """Declaration of a brake by a package or a file.

    Parameters
    ----------
    name
        Name in listings.
    summary
        One line for listings.
    module
        ``__name__`` of the module where bywire finds the models, parameter sets, experiments and
        loops. In a package, each kind has its own module or folder; see ``bywire.core.registry``.
    """

    name: str
    summary: str
    module: str

    @property
    def file(self) -> str:
        """File that declares the brake."""
        return importlib.import_module(self.module).__file__ or self.module

    def _repr_html_(self) -> str:
        rows = {
            "brake": self.name,
            "summary": self.summary,
            "declared in": self.file,
            "contents": f"bywire.overview(), or bywire.check({self.name!r})",
        }
        cells = "".join(f"<tr><th>{k}</th><td>{escape(v)}</td></tr>" for k, v in rows.items())
        return f"<table>{cells}</table>"


_loaded: dict[str, Brake] = {}


def brakes() -> Mapping[str, Brake]:
    """Return all brakes by name: installed brakes, then brakes that were loaded from files."""
    return {**_installed(), **_loaded}


@cache
def _installed() -> Mapping[str, Brake]:
    brakes: dict[str, Brake] = {}

    def order(point: EntryPoint) -> tuple[bool, str]:
        """Sort bywire's brakes first, so that another brake with the same name is skipped."""
        return not point.module.startswith("bywire."), point.name

    for point in sorted(entry_points(group=GROUP), key=order):
        if not point.module.startswith("bywire."):
            allow_dask()
        try:
            brake = _declared(importlib.import_module(point.module), point.value)
            _require_new(brake, brakes)
        except Exception as error:
            place = _place_of(point.module)
            reason = str(error) if isinstance(error, ModelError) else error_with_line(error, place)
            text = f"bywire skips the installed brake {point.name!r} ({point.value}): {reason}"
            warn_at_line(text, BrakeWarning, error, place)
        else:
            brakes[brake.name] = brake
    return brakes


def _place_of(module: str) -> str:
    """Return the folder of a module's package, or its file, or its name if neither exists."""
    root = module.partition(".")[0]
    try:
        spec = importlib.util.find_spec(root)
    except (ImportError, ValueError):
        spec = None
    folders = list(spec.submodule_search_locations or ()) if spec is not None else []
    return folders[0] if folders else (spec.origin if spec is not None else None) or root


def is_foreign(brake: Brake) -> bool:
    """Return whether another package provides a brake; bywire skips its parts that fail."""
    return brake.name not in _loaded and brake.module.partition(".")[0] != "bywire"


def foreign_line(error: BaseException) -> str:
    """Return an error with file and line if another package's brake raised it, otherwise "".

    The line is the innermost line in the files of that brake.
    """
    folders = [
        str(Path(brake.file).parent if _is_package(brake) else brake.file)
        for brake in brakes().values()
        if brake.module.partition(".")[0] != "bywire"
    ]
    frames = traceback.extract_tb(error.__traceback__)
    if not any(frame.filename.startswith(folder) for folder in folders for frame in frames):
        return ""
    return error_with_line(error, *folders)


def _is_package(brake: Brake) -> bool:
    """Return whether a brake is a package and not a single file."""
    return hasattr(importlib.import_module(brake.module), "__path__")


def loaded_files() -> tuple[str, ...]:
    """Return the files of the brakes that were loaded by path, for another process to load."""
    return tuple(brake.file for brake in _loaded.values())


def load_brakes(files: Iterable[str]) -> None:
    """Load the brakes that another process has loaded by path; see `loaded_files`."""
    for file in files:
        load_system(file)


@checked
def load_system(path: str | Path) -> Brake:
    """Load a brake from a file or a package, so that its names work with every function.

    Loading executes the brake's code. Load only files that you trust.

    Parameters
    ----------
    path
        Python file, or folder with an ``__init__.py`` (or this ``__init__.py``), that declares a
        ``BRAKE``. Or a project folder with a single package of this kind in its ``src``.

    Returns
    -------
    Brake
        The brake, which is loaded only once.

    Raises
    ------
    FileError
        When the file or folder does not exist.
    ModelError
        When the import fails, or the module does not declare a brake with an unused name.
    """
    place = Path(path).expanduser().resolve()
    place = place.parent if place.name == "__init__.py" else _package_of(place)
    source = place / "__init__.py" if place.is_dir() else place
    if not source.is_file() or source.suffix != ".py":
        missing = "" if place.exists() else "does not exist, so it "
        raise FileError(
            f"{path} {missing}does not declare a brake. Use a Python file, a folder with an "
            "__init__.py, or a project with one such folder in src, that contains BRAKE = "
            "bywire.Brake(...)",
            name=str(path),
            valid="BRAKE = bywire.Brake(...)",
        )
    known = next((b for b in _loaded.values() if Path(b.file).resolve() == source), None)
    if known is not None:
        return known
    brake = _declared(_imported(place, source), str(path))
    _require_new(brake, brakes())
    _loaded[brake.name] = brake
    return brake


def _package_of(place: Path) -> Path:
    """Return the single package in a project's folder src, or the path itself without one."""
    packages = [] if (place / "__init__.py").exists() else [*place.glob("src/*/__init__.py")]
    return packages[0].parent if len(packages) == 1 else place


def _imported(place: Path, source: Path) -> ModuleType:
    name = place.name if place.is_dir() else place.stem
    if not name.isidentifier():
        valid = "a name that Python can import, such as servo_axis"
        raise ModelError(
            f"the name of {place} must be {valid}", name=str(place), value=name, valid=valid
        )
    there = sys.modules.get(name)
    elsewhere = importlib.util.find_spec(name) if there is None else None
    origin = (
        elsewhere.origin if elsewhere is not None else None
    )  # None: a folder that is not a package
    if (
        origin is not None and Path(origin).resolve() != source
    ):  # they are equal if the folder is the working folder
        there = ModuleType(name)
        there.__file__ = origin
    if there is not None and Path(getattr(there, "__file__", None) or "").resolve() != source:
        raise ModelError(
            f"{place}: the module name {name!r} is already in use ({_origin(there)}). Rename it",
            name=str(place),
            value=name,
        )
    spec = importlib.util.spec_from_file_location(
        name, source, submodule_search_locations=[str(place)] if place.is_dir() else None
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    allow_dask()
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        for loaded in [each for each in sys.modules if each == name or each.startswith(f"{name}.")]:
            del sys.modules[loaded]
        if not isinstance(error, (Exception, SystemExit)):
            raise
        message = error_with_line(error, str(source.parent) if place.is_dir() else str(source))
        text = f"{message}. Correct this, and load the brake again"
        raise ModelError(text, name=str(place)) from error
    return module


def _declared(module: ModuleType, where: str) -> Brake:
    brake = getattr(module, "BRAKE", None)
    if not isinstance(brake, Brake):
        has = "no BRAKE" if brake is None else f"a BRAKE that is a {type(brake).__name__}"
        raise ModelError(
            f"{where} declares {has}. Write BRAKE = bywire.Brake(name, summary, __name__) in "
            f"{module.__file__}",
            name="BRAKE",
            value=has,
            valid="BRAKE = bywire.Brake(name, summary, __name__)",
        )
    if brake.module != module.__name__:
        raise ModelError(
            f"{module.__file__}: BRAKE is declared for the module {brake.module!r}. Write "
            f"Brake({brake.name!r}, ..., __name__)",
            name="BRAKE",
            value=brake.module,
            valid="__name__",
        )
    return brake


def _require_new(brake: Brake, known: Mapping[str, Brake]) -> None:
    if brake.name in known:
        raise ModelError(
            f"both {brake.file} and {known[brake.name].file} declare a brake {brake.name!r}. "
            "Rename one of them",
            name="BRAKE",
            value=brake.name,
        )


def _origin(module: ModuleType) -> str:
    return getattr(module, "__file__", None) or "of Python itself"


def modules_of(brake: Brake, names: tuple[str, ...]) -> Iterator[ModuleType]:
    """Yield a brake's modules that may declare a kind of thing: the main module and some others.

    Parameters
    ----------
    names
        Modules or folders of the brake's package, for example ``("loops",)``.

    Raises
    ------
    ModelError
        When an import fails.
    """
    package = importlib.import_module(brake.module)
    yield package
    if not hasattr(package, "__path__"):
        return
    for name in names:
        for place in package.__path__:
            if (Path(place) / name).is_dir() or (Path(place) / f"{name}.py").is_file():
                yield from modules_below(f"{brake.module}.{name}")
                break


def modules_below(name: str) -> Iterator[ModuleType]:
    """Yield a module and, if it is a package, the modules in its folder in alphabetical order.

    Raises
    ------
    ModelError
        When an import fails.
    """
    import pkgutil

    module = _attempted(name)
    yield module
    for below in pkgutil.iter_modules(getattr(module, "__path__", ())):
        yield _attempted(f"{name}.{below.name}")


def _attempted(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except Exception as error:
        root = name.partition(".")[0]
        if root == "bywire":
            raise
        folder = Path(getattr(sys.modules.get(root), "__file__", None) or "").parent
        raise ModelError(error_with_line(error, str(folder)), name=name) from error


# --- Errors and warnings from a brake's code, with the author's line


def error_with_line(error: BaseException, *inside: str) -> str:
    """Return an error's text with file and line, which is the innermost line in these folders."""
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    text = str(error) if isinstance(error, BywireError) else text
    if isinstance(error, SyntaxError) and error.filename:
        text = f"{type(error).__name__}: {error.msg}"
    if isinstance(error, AttributeError) and error.name and error.obj is not None:
        near = get_close_matches(error.name, dir(error.obj), n=1)
        text += f": did you mean {near[0]!r}?" if near else ""
    if type(error).__name__ == "ValidationError":
        text = _of_pydantic(error)
    if "truth value of a CasADi" in text:
        text = (
            "if, and, or, min and max do not work with the model's numbers. Use "
            "bywire.core.ops.where"
        )
    line = _innermost(error, *inside)
    return f"{line[0]}, line {line[1]}: {text}" if line else text


def _of_pydantic(error: Any) -> str:
    """Return pydantic's error on one line."""
    lacking = [str(each["loc"][0]) for each in error.errors() if each["type"] == "missing"]
    wrong = [
        f"{'.'.join(map(str, each['loc']))}: {each['msg']}"
        for each in error.errors()
        if each["type"] != "missing"
    ]
    if lacking:
        names = ", ".join(lacking)
        wrong.insert(0, f"{names}. Set a value here, or a default in the class {error.title}")
    return "; ".join(wrong)


def warn_at_line(text: str, kind: type[Warning], error: BaseException, *inside: str) -> None:
    """Warn with the author's line that raised an error, instead of a line of bywire.

    Parameters
    ----------
    text, kind
        The warning's message and category.
    error
        The error. If it has a cause, the line is that of the cause.
    inside
        The author's folders or files. If the error comes from elsewhere, the warning points to
        line 1 of the last file.
    """
    line = _innermost(error.__cause__ or error, *inside)
    warnings.warn_explicit(text, kind, *(line or (inside[-1], 1)))


def _innermost(error: BaseException, *inside: str) -> tuple[str, int] | None:
    """Return file and line of an error within some folders, or None if it comes from elsewhere."""
    if isinstance(error, SyntaxError) and error.filename:
        return error.filename, error.lineno or 1
    lines = [
        (frame.filename, frame.lineno or 1)
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename.startswith(inside) and not frame.filename.startswith("<")
    ]
    return lines[-1] if lines else None
