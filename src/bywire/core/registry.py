"""Registry of all named things by kind, with their places.

A package declares each `Kind`, and a file declares each thing. General things are in the kind's
package. The things of a brake are in the module or folder of its package that the kind specifies
(``experiments``, ``loops``, ...), or in the brake's single file. So a new thing needs only a new
file.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.machinery import ModuleSpec
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import Any, Generic, Protocol, TypeVar

from bywire.core.brake import (
    Brake,
    BrakeWarning,
    brakes,
    is_foreign,
    loaded_files,
    modules_below,
    modules_of,
    warn_at_line,
)
from bywire.core.callers import is_command_line
from bywire.core.errors import ModelError, UnknownNameError, unknown_name


def _declared_at(module: ModuleType, thing: object) -> str:
    """Return file and line of a declaration in a module, or only the file if the line is unknown.

    Parameters
    ----------
    module
        Module that declares the thing as a variable or in a tuple. Imported things have no line.
    thing
        Object or class.
    """
    line = _declared_line(module, thing)
    file = module.__file__ or module.__name__
    return f"{file}, line {line}" if line else file


def _declared_line(module: ModuleType, thing: object) -> int:
    """Return the line on which a module declares a thing; 0 if unknown."""
    try:
        tree = ast.parse(inspect.getsource(module))
    except (OSError, TypeError, SyntaxError):  # typed into a console, or the file has changed
        return 0
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and vars(module).get(node.name) is thing:
            return node.lineno
        if isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            held = [vars(module).get(each.id) for each in targets if isinstance(each, ast.Name)]
            line = next((_line(node, value, thing) for value in held if value is not None), 0)
            if line:
                return line
    return 0


def _line(node: ast.Assign | ast.AnnAssign, held: object, thing: object) -> int:
    """Return the line of the assignment that contains a thing; 0 if there is none."""
    if held is thing:
        return node.lineno
    if type(held) is not tuple or not any(each is thing for each in held):
        return 0
    written = node.value
    if isinstance(written, ast.Tuple) and len(written.elts) == len(held):
        return written.elts[[each is thing for each in held].index(True)].lineno
    return node.lineno


# --- The registry


class Named(Protocol):
    """Anything with a name."""

    @property
    def name(self) -> str:
        """Name in commands and files."""
        ...


T = TypeVar("T", bound=Named)
Thing = TypeVar("Thing")
_KINDS: list[Kind[Any]] = []


@dataclass(frozen=True)
class Kind(Generic[T]):
    """A kind of thing.

    Parameters
    ----------
    name
        Name of the kind in messages, for example ``"experiment"``.
    folders
        Modules or folders of a brake's package that declare things of this kind.
    read
        ``read(module)``: the things that a module declares.
    home
        Dotted name of the package of general things; empty if all belong to brakes.
    declared
        Object that declares a thing of this kind, for example ``"a Loop"``. The error for an
        unknown name contains it if a brake has no such thing.

    Notes
    -----
    Kinds with the same name share one namespace: each thing's name is unique among them.
    """

    name: str
    folders: tuple[str, ...]
    read: Callable[[ModuleType], Iterable[T]]
    home: str = ""
    declared: str = ""

    def __post_init__(self) -> None:
        _KINDS.append(self)

    def all(self) -> Mapping[str, T]:
        """Return all things of this kind by name, starting with general things."""
        return {thing.name: thing for thing, _ in _all(self)}

    def find(self, name: str) -> T:
        """Return the thing with a name.

        Raises
        ------
        UnknownNameError
            When the name is unknown; the message contains the nearest valid names.
        """
        thing: T = _found(self, name, tuple(brakes().values()))
        return thing

    def get(self, name: str) -> T | None:
        """Return the thing with a name, or None. See `guess`."""
        return self.guess(name) or self.all().get(name)

    def unknown(self, name: str, *others: Kind[Any]) -> UnknownNameError:
        """Return the error for an unknown name.

        The error lists the nearest valid names, starting with those of brakes loaded from files. It
        also lists the loaded brakes without a thing of this kind, with instructions.
        """
        kinds = (self, *others)
        title = " or ".join(dict.fromkeys(kind.name for kind in kinds))
        files = loaded_files()
        loaded = [brake.module for brake in brakes().values() if brake.file in files]
        error = unknown_name(
            title,
            name,
            [n for kind in kinds for n in kind.all()],
            first=[n for kind in kinds for module in loaded for n in kind.of(module)],
        )
        hints = [
            f"the brake {brake.name!r} declares no {title}. Declare {self.declared} in a module or "
            f"folder {' or '.join(self.folders)} of its package, or in its file (see "
            "docs/modeling.md)"
            for brake in brakes().values()
            if self.declared and not any(kind.of(brake.module) for kind in kinds)
        ]
        if self.declared and not files and "did you mean" not in str(error):
            loading = "--system PATH, or " * is_command_line() + "bywire.load_system"
            hints.append(f"load your own brake with {loading}")
        return error.reworded("; ".join([str(error), *hints]).replace("?; ", "? "))

    def guess(self, name: str) -> T | None:
        """Return the thing with a name if a file that is named after it or quotes it declares it.

        This avoids loading whole folders, which takes a second if there are many things.
        """
        stem = name.replace("-", "_")
        if not stem.isidentifier():
            return None
        owned = (f"{b.module}.{folder}" for b in brakes().values() for folder in self.folders)
        homes = [home for home in (self.home, *owned) if home and _is_folder(home) is not None]
        called = (f"{home}.{stem}" for home in homes if _is_folder(home))
        quoting = (file for home in homes for file in _quoting(name, home))
        for file in chain(called, quoting):
            for module in modules_below(file) if _is_folder(file) is not None else ():
                for thing in self.read(module):
                    if thing.name == name:
                        _require_new(self, ((thing, module),), _of_others(self))
                        return thing
        return None

    def of(self, module: str) -> Mapping[str, T]:
        """Return the things that a module's brake declares."""
        owner = next((brake for brake in brakes().values() if brake.module == module), None)
        return {thing.name: thing for thing, _ in _declared(self, owner)} if owner else {}

    def own(self, module: str, name: str) -> T | None:
        """Return the thing with a name from a module's brake, or None.

        Raises
        ------
        ModelError
            When a general thing has this name.
        """
        owner = next((brake for brake in brakes().values() if brake.module == module), None)
        for thing, where in _declared(self, owner) if owner else ():
            if thing.name == name:
                _require_new(self, ((thing, where),), _of_others(self))
                found: T = thing
                return found
        return None

    def beside(self, cls: type) -> Mapping[str, T]:
        """Return the things of a class's brake, or all things if the class belongs to no brake.

        The method does not load other brakes.
        """
        where = cls.__module__ + "."
        homes = [b.module for b in brakes().values() if where.startswith(f"{b.module}.")]
        return self.of(max(homes, key=len)) if homes else self.all()

    def owner(self, name: str) -> str:
        """Return the module of the brake that declares a thing; empty for a general thing.

        The search stops at the first match, which avoids loading other brakes.
        """
        for brake in brakes().values():
            try:
                if any(thing.name == name for thing, _ in _declared(self, brake)):
                    return brake.module
            except ModelError:
                if not is_foreign(brake):
                    raise
        return ""

    def place(self, name: str) -> tuple[str, int]:
        """Return file and line of the declaration of a name; line 0 if unknown."""
        module = self.owner(name)
        brake = next((each for each in brakes().values() if each.module == module), None)
        things = [(t, where) for t, where in _declared(self, brake) if t.name == name]
        lines = ((where.__file__ or "", _declared_line(where, thing)) for thing, where in things)
        return max(lines, key=lambda place: place[1], default=("", 0))


def _is_folder(module: str) -> bool | None:
    """Return whether a module is a package; None if the module does not exist."""
    spec = _spec(module)
    return None if spec is None else spec.submodule_search_locations is not None


def _spec(module: str) -> ModuleSpec | None:
    try:
        return importlib.util.find_spec(module)
    except (ImportError, ValueError, AttributeError):
        return None


def _quoting(name: str, home: str) -> Iterator[str]:
    """Yield the modules of a file or folder whose source code quotes a name; load no others."""
    spec = _spec(home)
    folders = spec.submodule_search_locations if spec is not None else None
    if folders is None:
        files = {home: spec.origin} if spec is not None and spec.has_location else {}
    else:
        below = (file for folder in folders for file in sorted(Path(folder).glob("*.py")))
        files = {f"{home}.{file.stem}": str(file) for file in below if file.stem != "__init__"}
    for module, file in files.items():
        text = Path(file or "").read_bytes()
        if any(f"{quote}{name}{quote}".encode() in text for quote in "\"'"):
            yield module


def instances(kind: type[Thing]) -> Callable[[ModuleType], Iterable[Thing]]:
    """Return a function that lists the objects of a type in a module, single or in tuples."""

    def read(module: ModuleType) -> Iterator[Thing]:
        for name, value in vars(module).items():
            if not name.startswith("_"):
                for each in value if type(value) is tuple else (value,):
                    if isinstance(each, kind):
                        yield each

    return read


def _all(kind: Kind[Any]) -> tuple[tuple[Any, str], ...]:
    """Return all things of a kind with their brake's module.

    Raises
    ------
    ModelError
        When two things from different places have the same name.
    """
    return _gathered(kind, tuple(brakes().values()))


@cache
def _found(kind: Kind[Any], name: str, known: tuple[Brake, ...]) -> Any:
    """Return the thing with a name from some brakes; cached, as studies call it for each case.

    Raises
    ------
    UnknownNameError
        When the name is unknown; the message contains the nearest known names.
    """
    guess = kind.guess(name)
    if guess is not None:
        return guess
    every = kind.all()
    if name not in every:
        raise kind.unknown(name)
    return every[name]


@cache
def _gathered(kind: Kind[Any], known: tuple[Brake, ...]) -> tuple[tuple[Any, str], ...]:
    places: dict[str, tuple[Any, str, ModuleType]] = {}
    for owner in (None, *known):
        try:
            new = _declared(kind, owner)
            _require_new(kind, new, places)
            _require_new(kind, new, _of_others(kind, *known))
        except ModelError as error:
            if owner is None or not is_foreign(owner):
                raise
            text = f"bywire skips the {kind.name} of the installed brake {owner.name!r}: {error}"
            warn_at_line(text, BrakeWarning, error, str(Path(owner.file).parent), owner.file)
            continue
        brake = owner.module if owner is not None else ""
        for thing, module in new:
            places.setdefault(thing.name, (thing, brake, module))
    return tuple((thing, brake) for thing, brake, _ in places.values())


def _of_others(kind: Kind[Any], *owners: Brake) -> dict[str, tuple[Any, str, ModuleType]]:
    """Return the things of all kinds with the same name: general things and some brakes' things."""
    return {
        thing.name: (thing, "", module)
        for other in _KINDS
        if other is not kind and other.name == kind.name
        for owner in (None, *owners)
        for thing, module in _declared(other, owner)
    }


def _require_new(
    kind: Kind[Any],
    new: tuple[tuple[Any, ModuleType], ...],
    known: Mapping[str, tuple[Any, str, ModuleType]],
) -> None:
    """Reject things whose name is already in use, in the same brake or in an earlier one."""
    seen = {name: (thing, module) for name, (thing, _, module) in known.items()}
    for thing, module in new:
        first, place = seen.setdefault(thing.name, (thing, module))
        if first is not thing:
            raise ModelError(
                f"{_declared_at(module, thing)}: the {kind.name} {thing.name!r} is already "
                f"declared in {_declared_at(place, first)}. Rename it",
                name=kind.name,
                value=thing.name,
            )


@cache
def _declared(kind: Kind[Any], owner: Brake | None) -> tuple[tuple[Any, ModuleType], ...]:
    """Return the general things of a kind, or those of a brake, with their modules."""
    if owner is not None:
        modules = modules_of(owner, kind.folders)
    else:
        modules = modules_below(kind.home) if kind.home else iter(())
    return tuple((thing, module) for module in modules for thing in kind.read(module))


def pick(known: Mapping[str, Thing], name: str, kind: str) -> Thing:
    """Return the thing with a name.

    Raises
    ------
    UnknownNameError
        When the name is unknown; the message contains the kind and the nearest valid names.
    """
    if name not in known:
        raise unknown_name(kind, name, known)
    return known[name]
