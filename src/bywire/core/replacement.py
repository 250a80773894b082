"""Values that go into a parameter set in place of others, with nothing validated that stays.

Studies and searches make thousands of sets a second that differ from one in the same few names.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache
from operator import attrgetter
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel

S = TypeVar("S", bound=BaseModel)

KNOWN = "_known"
"""where a set keeps by name what it holds, beside its fields"""


def fields_of(node: BaseModel) -> dict[str, Any]:
    """Return the fields of a set by name, in order, without what it has worked out beside them."""
    kept, names = node.__dict__.copy(), _field_names(type(node))
    kept.pop(KNOWN, None)
    return kept if len(kept) == len(names) else {name: kept[name] for name in names}


@cache
def _field_names(cls: type[BaseModel]) -> tuple[str, ...]:
    return tuple(cls.model_fields)


def read(node: BaseModel, names: tuple[str, ...]) -> dict[str, Any]:
    """Return what stands at dotted names."""
    return dict(zip(names, _reader(names)(node), strict=True))


@lru_cache(maxsize=256)
def _reader(names: tuple[str, ...]) -> Callable[[Any], tuple[Any, ...]]:
    each = attrgetter(*names)
    return each if len(names) > 1 else lambda node: (each(node),)


class Places(NamedTuple):
    """Where values of dotted names go: fields of a set itself, and places in its groups."""

    fields: tuple[tuple[str, str], ...]
    """field and dotted name"""
    groups: tuple[tuple[str, Places], ...]
    """field, and what goes into the group there"""

    @classmethod
    def of(cls, names: Sequence[str], prefix: str = "") -> Places:
        """Return where values of names go that begin with the prefix of a group."""
        own: list[tuple[str, str]] = []
        groups: dict[str, list[str]] = {}
        for name in names:
            field, dot, _ = name.removeprefix(prefix).partition(".")
            if dot:
                groups.setdefault(field, []).append(name)
            else:
                own.append((field, name))
        inner = ((group, cls.of(each, f"{prefix}{group}.")) for group, each in groups.items())
        return cls(tuple(own), tuple(inner))

    def filled(self, node: S, values: Mapping[str, Any]) -> S:
        """Return a set with other values; of a set whose groups alone change, its rules are asked.

        Raises
        ------
        ValueError
            When a value or a rule does not fit; pydantic's `ValidationError` is one.
        AssertionError
            When a rule of an author says so.
        """
        fields = fields_of(node)
        for name, inner in self.groups:
            fields[name] = inner.filled(fields[name], values)
        for name, dotted in self.fields:
            fields[name] = values[dotted]
        rules = None if self.fields else _rules(type(node))
        if rules is None:
            return type(node).model_validate(fields)
        made = type(node).__new__(type(node))
        made.__setstate__({**node.__getstate__(), "__dict__": fields})  # as a copy is made
        for rule in rules:
            made = getattr(made, rule)()
        return made


@cache
def _rules(cls: type[BaseModel]) -> tuple[str, ...] | None:
    """Return the methods by which a class judges a set of valid groups; None where it does more."""
    known, groups = cls.__pydantic_decorators__, cls.model_fields.values()
    judges = known.model_validators
    does_more = (
        known.validators
        or known.field_validators
        or known.root_validators
        or cls.__pydantic_custom_init__
        or cls.__pydantic_post_init__
        or cls.__private_attributes__
        or any(each.info.mode != "after" for each in judges.values())
        or any(len(inspect.signature(getattr(cls, name)).parameters) != 1 for name in judges)
        or any(each.metadata for each in groups if _is_group(each.annotation))
    )
    return None if does_more else tuple(judges)


def _is_group(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)
