"""Body of a C function under construction: variables, statements, liveness."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from bywire.export.controller.c_text import c_name, unique
from bywire.export.controller.derived import is_exact
from bywire.export.controller.structs import Structs, built_shape, ctype_of, is_number, literal
from bywire.export.controller.values import (
    PRIMARY,
    Built,
    BuiltGroup,
    Expr,
    Group,
    Items,
    Known,
    Memories,
    Record,
    Shape,
    Table,
    Update,
    Uses,
    lifted,
)


@dataclass(frozen=True)
class Statement:
    """``target = value``, or ``target.member = value``, with comments above.

    Parameters
    ----------
    target
        None (an empty text) for a function that is called only for its side effects.
    changes
        Memory that the function called in ``value`` changes in place.
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
        Versions of the memory, and the variables that keep them.
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
        """Return whether a text has the same value further down: it reads nothing that changes."""
        changing = {use[1] for use in expr.uses if use[0] == "local"} & self.moving
        return expr.is_path and not changing and not self.memory.versions_in(expr.uses)

    def is_steady(self, value: Any) -> bool:
        """Return whether a number depends only on parameters, or is known."""
        if isinstance(value, Group):
            return bool(value.origin) and value.origin[0] in self.fixed
        if isinstance(value, Known):
            return is_number(value)
        if not isinstance(value, Expr) or value.truth or "?" in value.text:
            return False
        places = {use[1] for use in value.uses if use[0] == "local"}
        return is_exact(value.uses) and places <= self.fixed.keys()

    def derived(self, value: Expr, hint: str = "") -> Expr:
        """Return a number that depends only on parameters as a derived parameter."""
        groups = [
            n for n, shape in self.fixed.items() if shape is not None and ("local", n) in value.uses
        ]
        is_plain = value.is_path or Expr(value.text.removeprefix("-")).is_path
        if self.structs.precision.name == "single" and not hint:
            # Then a sum or a product takes one instruction, like reading it.
            is_plain |= "/" not in value.text and not any(u[0] == "own" for u in value.uses)
        refused = (self.memory.function, value.text) in self.structs.derivations.refused
        if not groups or is_plain or refused or not self.is_steady(value):
            return value
        shape = self.fixed[groups[0]]
        assert shape is not None
        return self.structs.derive(self.memory.function, groups[0], shape, value, hint)

    def operands(self, *values: Expr) -> list[Expr]:
        """Return operands of which some change; derive those that depend only on parameters."""
        if all(map(self.is_steady, values)):
            return list(values)
        return [self.derived(each) for each in values]

    def settled(self, value: Any, hint: str) -> Any:
        """Return a value that stays the same further down, in a variable if necessary."""
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
        """Return a value in a variable, a new one unless a name is given."""
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
        """Return the memory with some fields replaced: in place, unless they are read later."""
        place = self.owned(value.record)
        self.update(place, value.items)
        self.memory.changed(place.expr.text)
        return self.memory.at(place.cls, place.expr.text, place.pointer)

    def address(self, record: Record) -> Expr:
        """Return a pointer to memory."""
        return replace(record.expr, text=f"{'' if record.pointer else '&'}{record.expr.text}")

    def owned(self, record: Record) -> Record:
        """Return where to change the memory: in a copy if its values are read later."""
        if self.memory.stays(record.expr.text):
            return record
        copied: Record = self.variable(f"{record.expr.text}_new", record)
        return copied

    def update(self, record: Record, items: Mapping[str, Any]) -> None:
        """Write new values of fields of a variable."""
        struct = self.structs.of_tuple(record.cls)
        kept = {
            name: v
            for name, v in items.items()
            if struct.is_memory or self.structs.keeps(struct, name)
        }
        target = record.expr.text
        # All are computed before the first assignment.
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
        raise TypeError(f"{type(value).__name__} has no value in C")

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
