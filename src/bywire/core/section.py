"""Tables of files: each key is stated once, as a typed field of a section.

A section is read from what a file holds: texts with units become numbers [SI], and what does not
fit is refused in one sentence with key, value, what is valid and the nearest match. No message of
pydantic's own reaches a user.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Self, Union, get_args, get_origin

from annotated_types import Ge, Le
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from bywire.core.errors import InputError, ParameterError, quoted, unknown_name, unknown_of_few
from bywire.core.parameters import leaf_of
from bywire.core.quantities import Unit
from bywire.core.values import written

Name = Annotated[str, Field(pattern=r"\S")]
"""a text that is not blank"""
Names = tuple[str, ...]
"""a list of names"""
Table = Annotated[Mapping[str, Any], Field(default_factory=dict)]
"""a section whose keys name parameters, faults or figures, and are no fields; empty by default"""

_WANTED: Mapping[Any, str] = {str: "a text", bool: "true or false", tuple: "a list of names"}


@dataclass(frozen=True)
class Hint:
    """What to write for a field, where that says more than its type."""

    text: str


class Section(BaseModel):
    """Base of all sections: immutable, no unknown keys; a model is built when it is first used."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, defer_build=True)

    @classmethod
    def read(cls, content: Any, where: str) -> Self:
        """Return the section that a table of a file is.

        Parameters
        ----------
        content
            What the file holds there.
        where
            What errors call it: ``"[design]"``; of a whole file, ``"a study file"``.

        Raises
        ------
        UnknownNameError
            For an unknown key, or a choice that there is not.
        UnitError
            For a number without its unit, or with another one.
        ParameterError
            For what is missing, of another kind, or out of range.
        """
        fields, place = cls.model_fields, f"{where} " if where.startswith("[") else ""
        for key in _table(content, where):
            if key not in fields:
                raise unknown_of_few(f"key of {where}", key, fields)
        values = {key: _value(fields[key], each, place, key) for key, each in content.items()}
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            key = str(error.errors()[0]["loc"][0])
            if key not in content:
                what = _hint(fields[key]) or "give it a value"
                raise ParameterError(f"{place}{key} is missing: {what}") from None
            raise _refused(fields[key], content[key], f"{place}{key}") from None

    @property
    def given(self) -> dict[str, Any]:
        """What the file says, by key."""
        return {
            key: getattr(self, key)
            for key in type(self).model_fields
            if key in self.model_fields_set
        }


def _value(info: FieldInfo, value: Any, place: str, key: str) -> Any:
    """Return what a field is validated with: numbers in SI, sections for tables."""
    kind, unit = _kind(info.annotation), _unit(info)
    if _is_section(kind):
        return kind.read(value, f"[{key}]")
    if kind is Mapping:
        return _table(value, f"[{key}]")
    if kind is tuple and _is_section(get_args(info.annotation)[0]):
        return _sections(get_args(info.annotation)[0], value, f"[[{key}]]")
    if kind is float and unit is not None:
        return float(written(value, unit.symbol, f"{place}{key}", unit.nominal))
    return tuple(value) if kind is tuple and isinstance(value, list) else value


def _table(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ParameterError(f"{where} must be a section with key = value lines")
    return dict(value)


def _sections(kind: type[Section], value: Any, where: str) -> tuple[Section, ...]:
    if not isinstance(value, list) or not all(isinstance(each, Mapping) for each in value):
        raise ParameterError(f"write {where} with two brackets, once for each of them")
    return tuple(kind.read(each, where) for each in value)


def _refused(info: FieldInfo, value: Any, name: str) -> InputError:
    """Return the error of a value that is not what its field is declared as."""
    kind, unit = _kind(info.annotation), _unit(info)
    if kind is Literal:
        return unknown_name(name, str(value), get_args(info.annotation))
    if unit is not None:
        leaf = leaf_of(name, unit, info)
        in_percent = isinstance(value, str) and value.rstrip().endswith("%")
        wanted = leaf.range_in("%") if in_percent else leaf.range_text
        return ParameterError(f"{name} = {quoted(value)} must be {wanted}")
    if kind is int:
        least = next(note.ge for note in info.metadata if isinstance(note, Ge))
        most = next(note.le for note in info.metadata if isinstance(note, Le))
        return ParameterError(
            f"{name} = {quoted(value)}: a whole number from {least} to {most} is wanted"
        )
    wanted = _hint(info) or f"{_WANTED[kind]} is wanted"
    return ParameterError(f"{name} = {quoted(value)}: {wanted}")


def _unit(info: FieldInfo) -> Unit | None:
    return next((note for note in info.metadata if isinstance(note, Unit)), None)


def _hint(info: FieldInfo) -> str:
    return next((note.text for note in info.metadata if isinstance(note, Hint)), "")


def _kind(annotation: Any) -> Any:
    """Return what a value is where it is not None."""
    if get_origin(annotation) in (Union, UnionType):
        (annotation,) = (each for each in get_args(annotation) if each is not NoneType)
    return get_origin(annotation) or annotation


def _is_section(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Section)
