"""Functions in C: arguments, results, calls, and bodies under construction."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from bywire.export.controller.c_text import c_name, unique
from bywire.export.controller.structs import (
    Structs,
    built_shape,
    ctype_of,
    is_exact,
    is_number,
    literal,
)
from bywire.export.controller.values import (
    PRIMARY,
    Array,
    Built,
    BuiltGroup,
    Expr,
    Given,
    Group,
    Items,
    Known,
    Memories,
    Record,
    Shape,
    Table,
    Update,
    Use,
    Uses,
    lifted,
)


@dataclass(frozen=True)
class Statement:
    """``target = value``, or ``target.member = value``, with comments above.

    Parameters
    ----------
    target
        C variable. An empty string means that the function is called only for its side effects.
    changes
        Memory that is changed in place by the function called in ``value``.
    is_pointer
        Whether the target is a pointer to the owner of the member.
    """

    target: str
    ctype: str
    value: Expr
    member: str = ""
    notes: tuple[str, ...] = ()
    changes: tuple[str, ...] = ()
    is_pointer: bool = False


def live(statements: list[Statement], result: Uses) -> list[Statement]:
    """Return the statements that affect the result."""
    needed, kept = _locals(result), []
    for statement in reversed(statements):
        if statement.target not in needed:
            if needed.isdisjoint(statement.changes):
                continue
            statement = replace(statement, target="")
        kept.append(statement)
        if not statement.member:
            needed.discard(statement.target)
        needed |= _locals(statement.value.uses)
    return kept[::-1]


def _locals(uses: Iterable[Any]) -> set[str]:
    return {use[1] for use in uses if use[0] == "local"}


# --- Bodies


@dataclass
class Body:
    """Statements of a function.

    Parameters
    ----------
    stores
        Number of assignments to every Python variable.
    memory
        Versions of the memory, and the variables that contain them.
    fixed
        Arguments that depend only on parameters: shapes of parameter sets, None for numbers.
    """

    structs: Structs
    stores: Counter[str]
    memory: Memories = field(default_factory=Memories)
    statements: list[Statement] = field(default_factory=list)
    names: set[str] = field(default_factory=set)
    types: dict[str, str] = field(default_factory=dict)
    moving: set[str] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)
    fixed: dict[str, Shape | None] = field(default_factory=dict)

    def fresh(self, hint: str) -> str:
        """Return an unused C name."""
        name = unique(c_name(hint), self.names)
        self.names.add(name)
        return name

    def write(
        self,
        target: str,
        ctype: str,
        value: Expr,
        member: str = "",
        changes: Iterable[str] = (),
        is_pointer: bool = False,
    ) -> None:
        """Append a statement."""
        self.memory.read(value.uses)
        made = Statement(
            target, ctype, value, member, tuple(self.notes), tuple(changes), is_pointer
        )
        self.statements.append(made)
        self.notes.clear()
        for place in changes:
            self.moving.add(place)
            self.memory.changed(place)

    def is_stable(self, expr: Expr) -> bool:
        """Return whether an expression keeps its value later: it reads nothing that changes."""
        changing = {use[1] for use in expr.uses if use[0] == "local"} & self.moving
        return expr.is_path and not changing and not self.memory.versions_in(expr.uses)

    def is_steady(self, value: Any) -> bool:
        """Return whether a number is known or depends only on parameters."""
        if isinstance(value, Group):
            return bool(value.origin) and value.origin[0] in self.fixed
        if isinstance(value, Known):
            return is_number(value)
        if not isinstance(value, Expr) or value.truth or "?" in value.text:
            return False
        places = {use[1] for use in value.uses if use[0] == "local"}
        return is_exact(value.uses) and places <= self.fixed.keys()

    def derived(self, value: Expr, hint: str = "") -> Expr:
        """Return a value, as a derived parameter if it depends only on parameters."""
        groups = [
            n for n, shape in self.fixed.items() if shape is not None and ("local", n) in value.uses
        ]
        is_plain = value.is_path or Expr(value.text.removeprefix("-")).is_path
        if self.structs.precision.name == "single" and not hint:
            # In single precision, a sum or a product takes one instruction, like reading it.
            is_plain |= "/" not in value.text and not any(u[0] == "own" for u in value.uses)
        refused = (self.memory.function, value.text) in self.structs.derivations.refused
        if not groups or is_plain or refused or not self.is_steady(value):
            return value
        shape = self.fixed[groups[0]]
        assert shape is not None
        return self.structs.derive(self.memory.function, groups[0], shape, value, hint)

    def operands(self, *values: Expr) -> list[Expr]:
        """Return operands; if some of them change, the constant ones become derived parameters."""
        if all(map(self.is_steady, values)):
            return list(values)
        return [self.derived(each) for each in values]

    def settled(self, value: Any, hint: str) -> Any:
        """Return a value that stays the same in later statements, in a variable if necessary."""
        value = lifted(value)
        if isinstance(value, Expr):
            return value if self.is_stable(value) else self.variable(hint, value)
        if isinstance(value, Record):
            is_kept = self.structs.is_memory(value) or self.is_stable(value.expr)
            return value if is_kept else self.variable(hint, value)
        if isinstance(value, (Update, BuiltGroup)):
            return self.variable(hint, value)
        if isinstance(value, Group) and not self.is_stable(value.expr):
            return self.variable(hint, value)
        if isinstance(value, Built):
            return Built(value.cls, self._all_settled(value.items, hint))
        if isinstance(value, Table):
            return Table(self._all_settled(value.items, hint))
        if isinstance(value, Items):
            each = enumerate(value.values)
            return Items(tuple(self.settled(v, f"{hint}_{k}") for k, v in each))
        return value

    def _all_settled(self, items: Mapping[str, Any], hint: str) -> dict[str, Any]:
        return {name: self.settled(v, f"{hint}_{name}") for name, v in items.items()}

    def variable(self, hint: str, value: Any, name: str = "") -> Any:
        """Return a value in the variable of this name, or in a new variable without a name."""
        if isinstance(value, Update) and self.structs.is_memory(value):
            return self.changed_memory(value)
        target = name or self.fresh(hint)
        ctype = ctype_of(self.structs, value)
        here = Expr(target, uses=frozenset({("local", target)}))
        if isinstance(value, (Record, Built)) and self.structs.is_memory(value):
            self.write(target, ctype, self.rvalue(value))
            return self.memory.at(value.cls, target, pointer=False)
        if isinstance(value, Update):
            self.write(target, ctype, self.rvalue(value.record))
            self.moving.add(target)
            self.update(Record(value.record.cls, here), value.items)
            return Record(value.record.cls, here)
        self.write(target, ctype, self.rvalue(value))
        if isinstance(value, Expr):
            return replace(here, truth=value.truth)
        if isinstance(value, (Record, Built)):
            return Record(value.cls, here)
        if isinstance(value, (Group, BuiltGroup)):
            shape = value.shape if isinstance(value, Group) else built_shape(value)
            return Group(shape, here, pointer=False)
        return here

    def changed_memory(self, value: Update) -> Record:
        """Return the memory with some fields replaced, in place unless old values are needed."""
        place = self.owned(value.record)
        self.update(place, value.items)
        self.memory.changed(place.expr.text)
        return self.memory.at(place.cls, place.expr.text, place.pointer)

    def address(self, record: Record) -> Expr:
        """Return a pointer to memory."""
        return replace(record.expr, text=f"{'' if record.pointer else '&'}{record.expr.text}")

    def owned(self, record: Record) -> Record:
        """Return the memory to change: a copy if the old values are read later."""
        if self.memory.stays(record.expr.text):
            return record
        copied: Record = self.variable(f"{record.expr.text}_new", record)
        return copied

    def update(self, record: Record, items: Mapping[str, Any]) -> None:
        """Assign new values to fields of a variable."""
        struct = self.structs.of_tuple(record.cls)
        kept = {
            name: v
            for name, v in items.items()
            if struct.is_memory or self.structs.keeps(struct, name)
        }
        target = record.expr.text
        # Compute all values before the first assignment.
        values = {name: self.rvalue(lifted(v)) for name, v in kept.items()}
        earlier: set[Any] = set()
        for name, value in values.items():
            reads = ("local", target) in value.uses
            if reads and (earlier & value.uses or any(use[0] == "call" for use in value.uses)):
                values[name] = self.variable(f"{name}_new", value)
            earlier.add(("field", struct.name, name))
        for name, value in values.items():
            uses = value.uses | {("local", target)}
            if struct.is_memory:
                uses |= {("field", struct.name, name)}
            self.write(
                target,
                struct.name,
                replace(value, uses=uses),
                c_name(name),
                is_pointer=record.pointer,
            )
        self.moving.add(target)

    def rvalue(self, value: Any) -> Expr:
        """Return the C expression of a number or a structure."""
        value = lifted(value)
        if isinstance(value, Expr):
            return value
        if isinstance(value, Known):
            return literal(value, self.structs)
        if isinstance(value, Record):
            text = f"*{value.expr.text}" if value.pointer else value.expr.text
            return replace(value.expr, text=text)
        if isinstance(value, Group):
            text = f"*{value.expr.text}" if value.pointer else value.expr.text
            return replace(value.expr, text=text)
        if isinstance(value, Built):
            return self._compound(self.structs.of_tuple(value.cls), value.items)
        if isinstance(value, BuiltGroup):
            numbers = {
                n: v for n, v in value.items.items() if isinstance(v, (Expr, Group)) or is_number(v)
            }
            return self._compound(self.structs.of_group(built_shape(value)), numbers)
        if isinstance(value, Update):
            return self.rvalue(self.variable(f"{c_name(value.record.expr.text)}_new", value))
        raise TypeError(f"a value of type {type(value).__name__} cannot be written in C")

    def _compound(self, struct: Any, items: Mapping[str, Any]) -> Expr:
        uses: set[Any] = set()
        parts = []
        for name, value in items.items():
            if not struct.is_memory and not self.structs.keeps(struct, name):
                continue
            expr = self.as_number(self.rvalue(value))
            uses |= expr.uses
            parts.append(f".{c_name(name)} = {expr.text}")
            if struct.is_memory:
                uses.add(("field", struct.name, name))
        uses.add(("struct", struct.name))
        return Expr(f"({struct.name}){{{', '.join(parts)}}}", uses=frozenset(uses))

    def as_number(self, expr: Expr) -> Expr:
        """Return a truth value as 1 or 0."""
        if not expr.truth:
            return expr
        one, zero = (self.structs.precision.literal(v) for v in (1.0, 0.0))
        return Expr(f"({expr.at(PRIMARY)} ? {one} : {zero})", uses=expr.uses)


# --- Arguments, results and calls


@dataclass(frozen=True)
class Argument:
    """An argument of a C function."""

    name: str
    declaration: str


def kind_of(value: Any, structs: Structs) -> Any:
    """Return the part of an argument that determines which C function is called."""
    value = lifted(value)
    if isinstance(value, Expr):
        return "truth" if value.truth else "number"
    if isinstance(value, Known):
        if isinstance(value.value, float):
            return "number"
        return ("known", type(value.value), _hashable(value.value))
    if structs.is_memory(value):
        return "memory"
    if isinstance(value, Record) and value.pointer:
        return ("pointer", value.cls)
    if isinstance(value, (Record, Built)):
        return ("tuple", value.cls)
    if isinstance(value, Update):
        return ("tuple", value.record.cls)
    if isinstance(value, Items):
        return ("items", *(kind_of(each, structs) for each in value.values))
    if isinstance(value, Table):
        return ("table", *((name, kind_of(each, structs)) for name, each in value.items.items()))
    if isinstance(value, Array):
        return ("array", value.length)
    if isinstance(value, Group):
        return ("group", value.shape)
    if isinstance(value, BuiltGroup):
        return ("group", built_shape(value))
    return ("other", id(value))


def _hashable(value: Any) -> Any:
    try:
        hash(value)
    except TypeError:
        return id(value)
    return value


def received(value: Any, name: str, body: Body) -> Iterator[tuple[Any, Argument | None]]:
    """Yield an argument's form inside the function, with its arguments in C."""
    value, structs = lifted(value), body.structs
    if isinstance(value, Known) and not isinstance(value.value, float):
        yield value, None
        return
    if isinstance(value, (Items, Table)):
        inner: dict[Any, Any] = {}
        arguments: list[Argument] = []
        each = value.items.items() if isinstance(value, Table) else enumerate(value.values)
        for key, entry in each:
            (inner[key], first), *more = received(entry, f"{name}_{key}", body)
            arguments += [a for _, a in [(None, first), *more] if a is not None]
        yield (
            Table(inner) if isinstance(value, Table) else Items(tuple(inner.values())),
            arguments[0] if arguments else None,
        )
        yield from ((None, a) for a in arguments[1:])
        return
    target = body.fresh(name)
    here = Expr(target, uses=frozenset({("local", target)}))
    ctype = ctype_of(structs, value) if not isinstance(value, Array) else structs.precision.real
    body.types[target] = ctype
    if isinstance(value, (Expr, Known)):
        is_truth = isinstance(value, Expr) and value.truth
        yield Expr(target, uses=here.uses, truth=is_truth), Argument(target, f"{ctype} {target}")
    elif stays_there(value, structs):
        there = Record(value.cls, here, pointer=True)
        yield there, Argument(target, f"const {ctype} *{target}")
    elif structs.is_memory(value):
        there = body.memory.at(structs.memory, target, pointer=True)
        yield there, Argument(target, f"{ctype} *{target}")
    elif isinstance(value, (Record, Built, Update)):
        cls = value.record.cls if isinstance(value, Update) else value.cls
        yield Record(cls, here), Argument(target, f"{ctype} {target}")
    elif isinstance(value, Array):
        declared = f"const {ctype} {target}[{value.length}]"
        yield Array(here, value.length), Argument(target, declared)
    else:
        shape = value.shape if isinstance(value, Group) else built_shape(value)
        made = Group(shape, here, pointer=True, origin=(target,))
        yield made, Argument(target, f"const {ctype} *{target}")


def stays_there(value: Any, structs: Structs) -> bool:
    """Return whether a NamedTuple is an input, which is passed as a pointer to constant data."""
    return isinstance(value, Record) and value.pointer and not structs.is_memory(value)


def passed(value: Any, body: Body) -> Iterator[Expr | Record]:
    """Yield the C arguments of a value, in the order of `received`; memory is passed unchanged."""
    value = lifted(value)
    if isinstance(value, Known) and not isinstance(value.value, float):
        return
    if isinstance(value, (Items, Table)):
        each = value.items.values() if isinstance(value, Table) else value.values
        for entry in each:
            yield from passed(entry, body)
    elif body.structs.is_memory(value):
        made = body.settled(value, "memory")
        yield body.variable("memory", made) if isinstance(made, Built) else made
    elif isinstance(value, Array) or stays_there(value, body.structs):
        yield value.expr
    elif isinstance(value, BuiltGroup) or (isinstance(value, Group) and not value.expr.is_path):
        yield from passed(body.variable("values", value), body)
    elif isinstance(value, Group):
        sign = "" if value.pointer else "&"
        yield Expr(f"{sign}{value.expr.text}", uses=value.expr.uses)
    else:
        yield body.rvalue(value)


# --- Functions


@dataclass
class CFunction:
    """A function of C.

    Parameters
    ----------
    result
        C type of the result. It is empty if the result is known at export and nothing is called,
        and ``void`` if the function only changes memory.
    value
        The result, in terms of the function's own variables.
    members
        Fields of the structure for several results, by their place in ``value``.
    arguments
        Arguments that the function reads.
    all_arguments
        Names of all arguments of a call, including unused ones.
    changes
        Memory arguments that are changed in place.
    """

    name: str
    module: str
    description: list[str]
    is_plant: bool = False
    result: str = ""
    value: Any = None
    members: dict[tuple[Any, ...], str] = field(default_factory=dict)
    struct: str = ""
    arguments: list[Argument] = field(default_factory=list)
    all_arguments: list[str] = field(default_factory=list)
    statements: list[Statement] = field(default_factory=list)
    returned: Expr | None = None
    changes: set[str] = field(default_factory=set)
    moving: set[str] = field(default_factory=set)

    @property
    def uses(self) -> frozenset[Use]:
        """All dependencies of the function's statements."""
        every = [each.value.uses for each in self.statements]
        if self.returned is not None:
            every.append(self.returned.uses)
        return frozenset().union(*every)


def finish(made: CFunction, body: Body, value: Any, node: ast.AST) -> None:
    """Let a function return a value directly or in a structure; a known value needs no result."""
    value = lifted(value)
    if isinstance(value, Update):
        value = _changed(value, body)
    value = _left_there(made, body, value)
    is_group = isinstance(value, Group) and value.origin
    if isinstance(value, (Known, Array, Given)) or is_group:
        made.value = value
    elif isinstance(value, (Items, Table)):
        _several(made, body, value, node)
    else:
        made.result, made.value = ctype_of(body.structs, value), value
        made.returned = body.rvalue(value)
    changed: frozenset[Use] = frozenset(("local", place) for place in made.changes)
    if made.returned is not None:
        body.memory.read(made.returned.uses)
        made.statements = live(body.statements, made.returned.uses | changed)
    elif changed:
        made.result = "void"
        made.statements = live(body.statements, changed)
    needed = {use[1] for use in made.uses if use[0] == "local"}
    made.arguments = [each for each in made.arguments if each.name in needed]
    made.moving = body.moving


def _left_there(made: CFunction, body: Body, value: Any) -> Any:
    """Return a function's value, with returned memory replaced by the function's argument."""
    memories = [a.name for a in made.arguments if a.name in body.memory.versions]
    if not memories:
        return value
    kept = set()

    def walked(value: Any) -> Any:
        value = lifted(value)
        if isinstance(value, Items):
            # Compute the expressions that read the memory before the memory changes.
            each = [
                v if body.structs.is_memory(v) else body.settled(v, "kept") for v in value.values
            ]
            return Items(tuple(map(walked, each)))
        if isinstance(value, Table):
            return Table({name: walked(each) for name, each in value.items.items()})
        if body.structs.is_memory(value):
            value = body.settled(value, "changed")
            is_given = isinstance(value, Record) and value.expr.text in memories
            if is_given and body.memory.is_now(value):
                kept.add(value.expr.text)
                return Given(value.expr.text)
        return value

    value = walked(value)
    for place in memories:
        if place not in kept:
            body.memory.keep(place)
        elif body.memory.versions[place]:
            made.changes.add(place)
    return value


def _changed(value: Update, body: Body) -> Any:
    """Return a replaced NamedTuple in its own variable if the function owns this variable."""
    name = value.record.expr.text
    if body.structs.is_memory(value):
        return body.changed_memory(value)
    if name in body.types and not value.record.pointer:
        body.update(value.record, value.items)
        return value.record
    return body.variable("changed", value)


def _several(made: CFunction, body: Body, value: Items | Table, node: ast.AST) -> None:
    """Let a function return several values in a structure."""
    updates = [v for v in getattr(value, "values", ()) if isinstance(v, Update)]
    if isinstance(value, Items) and updates:
        value = Items(tuple(body.settled(v, "changed") for v in value.values))
    leaves = list(_leaves(value, ()))
    names = _member_names(value, node)
    types: dict[str, str] = {}
    parts: list[str] = []
    uses: set[Use] = set()
    for place, leaf in leaves:
        name = unique(
            c_name(names.get(place[0], "item") if len(place) == 1 else "_".join(map(str, place))),
            types,
        )
        types[name] = ctype_of(body.structs, leaf)
        made.members[place] = name
    made.value = value
    if not leaves:
        return
    struct = body.structs.of_result(made.name, types)
    made.result = made.struct = struct.name
    for place, leaf in leaves:
        name = made.members[place]
        if body.structs.keeps(struct, name):
            expr = body.rvalue(leaf)
            uses |= expr.uses
            parts.append(f".{name} = {expr.text}")
    made.returned = Expr(f"({struct.name}){{{', '.join(parts)}}}", uses=frozenset(uses))


def _leaves(value: Any, place: tuple[Any, ...]) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Yield the parts of a result that are unknown at export, with their places."""
    value = lifted(value)
    if isinstance(value, Items):
        for k, each in enumerate(value.values):
            yield from _leaves(each, (*place, k))
    elif isinstance(value, Table):
        for name, each in value.items.items():
            yield from _leaves(each, (*place, name))
    elif not isinstance(value, (Known, Given)) and not (isinstance(value, Group) and value.origin):
        yield place, value


def _member_names(value: Any, node: ast.AST) -> dict[Any, str]:
    """Return names for the values of a result, derived from the return expression."""
    if isinstance(value, Table):
        return {name: str(name) for name in value.items}
    names: dict[Any, str] = {}
    for k, each in enumerate(getattr(node, "elts", ())):
        while isinstance(each, (ast.Call, ast.Subscript)):
            each = each.func if isinstance(each, ast.Call) else each.value
            if isinstance(each, ast.Attribute) and each.attr == "_replace":
                each = each.value
        if isinstance(each, (ast.Name, ast.Attribute)):
            names[k] = (each.id if isinstance(each, ast.Name) else each.attr).lower()
    return names


def given_back(made: CFunction, structs: Structs, result: Expr) -> Any:
    """Return the results of a function as members of its structure, which is in a variable."""

    def rebuilt(value: Any, place: tuple[Any, ...]) -> Any:
        value = lifted(value)
        if isinstance(value, Items):
            each = enumerate(value.values)
            return Items(tuple(rebuilt(v, (*place, k)) for k, v in each))
        if isinstance(value, Table):
            return Table({n: rebuilt(v, (*place, n)) for n, v in value.items.items()})
        if place not in made.members:
            return value
        name = made.members[place]
        uses = result.uses | {("field", made.struct, name)}
        return as_value(value, Expr(f"{result.text}.{name}", uses=uses))

    return rebuilt(made.value, ())


def as_value(value: Any, expr: Expr) -> Any:
    """Return a C expression as the same kind of value."""
    if isinstance(value, (Record, Built)):
        return Record(value.cls, expr)
    if isinstance(value, (Group, BuiltGroup)):
        shape = value.shape if isinstance(value, Group) else built_shape(value)
        return Group(shape, expr, pointer=False)
    truth = isinstance(value, Expr) and value.truth
    return Expr(expr.text, expr.level, expr.uses, truth)
