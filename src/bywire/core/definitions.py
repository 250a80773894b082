"""Layout-independent digest of the source code of functions.

The digest covers functions and everything that they refer to by name: other functions, classes and
constants. It ignores comments, docstrings, annotations, imports, the order of definitions and the
names of their files. It is the same in every version of Python. Only definitions in certain
packages ("rooms") count by their source code. All other definitions count by their name.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import linecache
import sys
from collections import ChainMap
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from enum import Enum
from importlib import import_module
from importlib.util import resolve_name
from types import CodeType, FunctionType, MappingProxyType, MethodType, ModuleType
from typing import Any

import numpy as np

_FORMLESS = {"ctx", "type_comment", "annotation", "returns", "type_params", "kind"}
"""fields of a syntax tree that do not affect results"""
_NOTHING: Mapping[str, Any] = MappingProxyType({})
_MUTABLE = (dict, list, set)
_SCALARS = (str, int, float, complex, bool, bytes, type(None), Enum)


def definitions_digest(
    roots: Iterable[Any],
    rooms: Collection[str],
    named: Callable[[str], Iterable[Any]] = lambda _: (),
    with_equations: bool = False,
) -> str:
    """Return a digest of all definitions that some objects use.

    Parameters
    ----------
    roots
        Functions, classes, and objects or collections that contain functions or classes.
    rooms
        Packages and modules whose definitions count by their source code.
    named
        ``named(text)``: the objects that a string in these definitions refers to, such as a
        registry's entry. Most strings refer to no object.
    with_equations
        Whether models and their elements also count by their source code. Otherwise, only a model's
        ``rest`` counts, because the kernel already identifies the equations.
    """
    reached = _Reached(tuple(rooms), named, with_equations)
    for root in roots:
        _run(reached.visit(root))
    return hashlib.sha256("\n".join(sorted(reached.pieces)).encode()).hexdigest()


_Steps = Iterator["_Steps"]
"""visits of the objects that a definition reaches, one after the other"""


def _run(steps: _Steps) -> None:
    """Run visits and nested visits without recursion, which could exceed Python's stack."""
    stack = [steps]
    while stack:
        nested = next(stack[-1], None)
        if nested is None:
            stack.pop()
        else:
            stack.append(nested)


class _Reached:
    """Definitions that objects reach."""

    def __init__(
        self, rooms: tuple[str, ...], named: Callable[[str], Iterable[Any]], with_equations: bool
    ) -> None:
        self.pieces: set[str] = set()
        self._rooms, self._named, self._with_equations = rooms, named, with_equations
        self._seen: dict[int, Any] = {}  # keeps the objects alive, so that addresses stay unique
        self._seen_collections: set[tuple[str, str]] = set()
        self._seen_texts: set[str] = set()
        self._sources: dict[str, _Source] = {}

    def visit(self, value: Any, name: str = "") -> _Steps:
        """Add an object; ``name``: its name in a definition."""
        if isinstance(value, _SCALARS):
            self.pieces.add(f"{name} = {value!r}")
            if isinstance(value, str):
                yield self._visit_named(value)
            return
        if id(value) in self._seen:
            return
        self._seen[id(value)] = value
        if isinstance(value, FunctionType):
            yield self._visit_function(value)
        elif isinstance(value, type):
            yield self._visit_class(value)
        elif isinstance(value, MethodType):
            yield self.visit(value.__func__)
            yield self.visit(value.__self__)
        elif isinstance(value, functools.partial):
            yield self.visit((value.func, value.args, value.keywords))
        elif isinstance(value, Mapping):
            for key, each in value.items():
                yield self.visit(key)
                yield self.visit(each, str(key))
        elif isinstance(value, (tuple, list, set, frozenset)):
            for each in value:
                yield self.visit(each, name)
        elif isinstance(value, np.ndarray):
            self.pieces.add(f"{name} = {hashlib.sha256(value.tobytes()).hexdigest()}")
        elif hasattr(value, "__wrapped__"):
            yield self.visit(value.__wrapped__)
        elif self._is_reached(type(value).__module__):
            yield self.visit(type(value))
            yield self.visit({k: v for k, v in _fields(value) if not k.startswith("__")})
        else:
            self.pieces.add(f"{name}: {type(value).__name__}")

    def _visit_named(self, text: str) -> _Steps:
        if text in self._seen_texts:
            return
        self._seen_texts.add(text)
        for each in self._named(text):
            yield self.visit(each)

    def _is_reached(self, module: str | None) -> bool:
        return any(f"{module}.".startswith(f"{room}.") for room in self._rooms)

    def _visit_function(self, function: FunctionType) -> _Steps:
        if not self._is_reached(function.__module__):
            self.pieces.add(function.__qualname__)
            return
        code = function.__code__
        nodes = self._source(code.co_filename, function.__globals__).nodes_of(code)
        if not nodes:  # a library made the function, or its source code no longer exists
            if not code.co_filename.startswith("<"):
                self.pieces.add(f"{code.co_code.hex()} {code.co_names}")
            return
        for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
            content = _content(cell)
            if name != "__class__" and not isinstance(
                content, _MUTABLE
            ):  # runs change mutable ones
                yield self.visit(content, name)
        for node in nodes:
            yield self._visit_node(node, function.__globals__)

    def _visit_class(self, kind: type) -> _Steps:
        if not self._is_reached(kind.__module__):
            self.pieces.add(kind.__qualname__)
            return
        if _is_model(kind) and not self._with_equations:
            self.pieces.add(kind.__name__)
            yield self.visit(getattr(kind, "rest", None))
            return
        module = sys.modules.get(kind.__module__)
        names = {} if module is None else vars(module)
        node = self._source(names.get("__file__") or "", names).class_of(kind.__qualname__)
        if node is not None:
            yield self._visit_node(node, names)

    def _source(self, file: str, names: Mapping[str, Any]) -> _Source:
        if file not in self._sources:
            self._sources[file] = _source_of(_text_of(file, names))
        return self._sources[file]

    def _visit_node(self, node: ast.AST, names: Mapping[str, Any]) -> _Steps:
        """Add a definition's source code and the objects that it refers to."""
        self.pieces.add(_form(node))
        imported = dict(self._imported(node, names))
        known = ChainMap(imported, names)  # type: ignore[arg-type]
        for each in _computing(node):
            if isinstance(each, ast.Constant) and isinstance(each.value, str):
                yield self._visit_named(each.value)
            if isinstance(each, ast.Attribute):
                holder = _module_named(each.value, known)
                if holder is not None and self._is_reached(holder.__name__):
                    yield self._visit_global(each.attr, vars(holder))
            if isinstance(each, ast.Name):
                yield self._visit_global(each.id, names, imported)

    def _visit_global(
        self, name: str, names: Mapping[str, Any], imported: Mapping[str, Any] = _NOTHING
    ) -> _Steps:
        known = imported if name in imported else names
        value = known.get(name)
        if name not in known or name.startswith("__"):
            return
        if isinstance(value, _MUTABLE):
            yield self._visit_assigned(name, names)
        elif not isinstance(value, ModuleType):
            yield self.visit(value, name)
        elif self._with_equations and self._is_reached(value.__name__):  # an element of a model
            functions = [each for each in vars(value).values() if isinstance(each, FunctionType)]
            yield self.visit(functions)

    def _visit_assigned(self, name: str, names: Mapping[str, Any]) -> _Steps:
        """Add the source code of a collection, because runs may have changed its content."""
        file = names.get("__file__") or ""
        if (file, name) in self._seen_collections:  # its source code may refer to itself
            return
        self._seen_collections.add((file, name))
        source = self._source(file, names)
        for node in source.assignments_of(name):
            yield self._visit_node(node, names)
        for holder, known_as, original in self._imports(source.tree, names):
            if known_as == name:
                yield self._visit_global(original, vars(holder))

    def _imported(self, node: ast.AST, names: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
        """Yield the names and objects that a definition itself imports from the rooms."""
        for holder, known_as, name in self._imports(node, names):
            module = sys.modules.get(f"{holder.__name__}.{name}")
            yield known_as, getattr(holder, name, module)

    def _imports(
        self, node: ast.AST, names: Mapping[str, Any]
    ) -> Iterator[tuple[ModuleType, str, str]]:
        """Yield imports from the rooms: module, name in this file, and name in that module."""
        for each in ast.walk(node):
            if isinstance(each, ast.ImportFrom):
                package = str(names.get("__package__") or "")
                place = "." * each.level + (each.module or "")
                module = resolve_name(place, package) if each.level else place
                if self._is_reached(module):
                    for alias in each.names:
                        yield import_module(module), alias.asname or alias.name, alias.name


def _is_model(kind: type) -> bool:
    return hasattr(kind, "balance") and hasattr(kind, "Memory")


def _fields(value: Any) -> Iterator[tuple[str, Any]]:
    names = [*getattr(value, "__dict__", {}), *getattr(type(value), "__slots__", ())]
    for name in names:
        if not isinstance(getattr(type(value), name, None), functools.cached_property):
            yield name, getattr(value, name, None)


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # for a function that is not defined yet
        return None


def _module_named(node: ast.AST, names: Mapping[str, Any]) -> ModuleType | None:
    """Return the module that an expression such as ``package.module`` refers to."""
    below: list[str] = []
    while isinstance(node, ast.Attribute):
        below.append(node.attr)
        node = node.value
    value = names.get(node.id) if isinstance(node, ast.Name) else None
    while below and isinstance(value, ModuleType):
        value = getattr(value, below.pop(), None)
    return value if isinstance(value, ModuleType) else None


def _computing(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a tree's nodes that affect results, without annotations and docstrings."""
    waiting = [node]
    while waiting:
        node = waiting.pop()
        yield node
        below = [
            each
            for name, value in ast.iter_fields(node)
            for each in (value if isinstance(value, list) else [value])
            if isinstance(each, ast.AST) and name not in _FORMLESS and not _is_silent(each)
        ]
        waiting.extend(reversed(below))


def _is_silent(node: ast.AST) -> bool:
    """Return whether a statement cannot affect results: a docstring, an import, a pass."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return isinstance(node.value.value, str)
    return isinstance(node, (ast.Import, ast.ImportFrom, ast.Pass))


@functools.lru_cache(maxsize=8192)
def _form(tree: ast.AST) -> str:
    """Return a syntax tree as text that is the same in every version of Python."""
    text: list[str] = []
    waiting: list[Any] = [tree]
    while waiting:
        value = waiting.pop()
        if isinstance(value, _Sign):
            text.append(value)
        elif isinstance(value, list):
            waiting.extend(reversed(_row("[", [[v] for v in value if not _is_silent(v)], "]")))
        elif isinstance(value, ast.JoinedStr):  # versions of Python split its constants differently
            waiting.extend(reversed([_Sign("f("), *value.values, _Sign(")")]))
        elif isinstance(value, ast.Constant):
            text.append(repr(value.value))
        elif isinstance(value, ast.AST):
            fields = [
                [_Sign(f"{name}="), each]
                for name, each in ast.iter_fields(value)
                if name not in _FORMLESS and each is not None and each != []
            ]
            waiting.extend(reversed(_row(f"{type(value).__name__}(", fields, ")")))
        else:
            text.append(repr(value))
    return "".join(text)


class _Sign(str):
    """Text that `_form` outputs unchanged."""

    __slots__ = ()


def _row(opened: str, parts: list[list[Any]], closed: str) -> list[Any]:
    """Return parts between brackets, separated by commas."""
    row: list[Any] = [_Sign(opened)]
    for number, part in enumerate(parts):
        row += [_Sign(","), *part] if number else part
    return [*row, _Sign(closed)]


def _text_of(file: str, names: Mapping[str, Any]) -> str:
    """Return a file's current content."""
    if file.startswith("<"):  # typed into a notebook, for example
        linecache.lazycache(file, dict(names))
    else:
        linecache.checkcache(file)
    return "".join(linecache.getlines(file))


@functools.lru_cache(maxsize=512)
def _source_of(text: str) -> _Source:
    """Return the syntax tree of a file's content, since many digests use the same files."""
    return _Source(text)


class _Source:
    """Syntax tree of a file's content, with its functions and classes."""

    def __init__(self, text: str) -> None:
        try:
            self.tree = ast.parse(text)
        except SyntaxError:  # the file has changed since it was loaded
            self.tree = ast.Module([], [])

    @functools.cached_property
    def _functions(self) -> Mapping[tuple[str, int], tuple[ast.AST, ...]]:
        """Functions by name and first line, decorators included."""
        functions: dict[tuple[str, int], tuple[ast.AST, ...]] = {}
        for node in ast.walk(self.tree):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                line = min([node.lineno, *(each.lineno for each in node.decorator_list)])
                key = (node.name, line)
            elif isinstance(node, ast.Lambda):
                key = ("<lambda>", node.lineno)
            else:
                continue
            functions[key] = (*functions.get(key, ()), node)
        return functions

    def nodes_of(self, code: CodeType) -> tuple[ast.AST, ...]:
        """Return a function's nodes; lambdas on the same line are indistinguishable."""
        return self._functions.get((code.co_name, code.co_firstlineno), ())

    def assignments_of(self, name: str) -> Iterator[ast.stmt]:
        """Yield the file's statements that assign a name."""
        for node in self.tree.body:
            targets = (
                node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            )
            if any(isinstance(each, ast.Name) and each.id == name for each in targets):
                yield node

    def class_of(self, name: str) -> ast.ClassDef | None:
        """Return a class by its qualified name, or None if a function defines it."""
        body: list[ast.stmt] = self.tree.body
        node = None
        for part in name.split("."):
            node = next((n for n in body if isinstance(n, ast.ClassDef) and n.name == part), None)
            if node is None:
                return None
            body = node.body
        return node
