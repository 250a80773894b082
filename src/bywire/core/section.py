"""Sections of files, in which a typed field declares each key.

The reader of a section converts strings with units to numbers in SI units. An error contains the
key, its value, the valid values and the nearest match. Users never see pydantic's own messages.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
"""a string that is not blank"""
Names = tuple[str, ...]
"""a list of names"""
Table = Annotated[Mapping[str, Any], Field(default_factory=dict)]
"""a section whose keys are names of parameters, faults or figures instead of fields; empty by
default"""

_VALID: Mapping[Any, str] = {str: "a string", bool: "true or false", tuple: "a list of names"}


@dataclass(frozen=True)
class Hint:
    """Hint on the notation of a field's value, if the type does not explain it."""

    text: str


class Section(BaseModel):
    """Base of all sections, which are immutable. Pydantic builds its model on first use."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, defer_build=True)

    @classmethod
    def read(cls, content: Any, where: str) -> Self:
        """Read a section from a table in a file.

        Parameters
        ----------
        content
            Content of the table.
        where
            Name in errors, such as ``"[design]"``, or ``"a study file"`` for a whole file.

        Raises
        ------
        UnknownNameError
            For unknown keys and choices.
        UnitError
            When a number has no unit or the wrong unit.
        ParameterError
            When a value is missing, has the wrong type, or is out of range.
        """
        fields = cls.model_fields
        place, within = (f"{where} ", f"{where[1:-1]}.") if where.startswith("[") else ("", "")
        content = table_of(cls.written_out(content), where)
        for key in content:
            if key not in fields:
                raise unknown_of_few(f"key of {where}", key, fields)
        values = {
            key: _value(fields[key], each, f"{place}{key}", within + key)
            for key, each in content.items()
        }
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            key, *inner = error.errors()[0]["loc"]
            raise _rejection(fields[str(key)], content, place, str(key), inner) from None

    @classmethod
    def written_out(cls, content: Any) -> Any:
        """Expand a short form to its table; a plain section has no short form."""
        return content

    @property
    def given(self) -> dict[str, Any]:
        """Values of those keys that the file contains."""
        return {
            key: getattr(self, key)
            for key in type(self).model_fields
            if key in self.model_fields_set
        }


def _value(info: FieldInfo, value: Any, name: str, key: str) -> Any:
    """Convert a field's value for validation: numbers to SI, tables to sections."""
    kind, unit = _kind(info.annotation), _unit(info)
    if _is_section(kind):
        return kind.read(value, f"[{key}]")
    if kind is Mapping:
        each = get_args(info.annotation)[-1]
        table = table_of(value, f"[{key}]")
        if _is_section(each):
            return {name: each.read(entry, f"[{key}.{name}]") for name, entry in table.items()}
        return table
    if kind is tuple and _is_section(get_args(info.annotation)[0]):
        return _sections(get_args(info.annotation)[0], value, f"[[{key}]]")
    if kind is float and unit is not None:
        return float(written(value, unit.symbol, name, unit.nominal))
    return tuple(value) if kind is tuple and isinstance(value, list) else value


def table_of(value: Any, where: str) -> dict[str, Any]:
    """Return a section's keys and values; reject anything else."""
    if not isinstance(value, Mapping):
        valid = "a section with key = value lines"
        raise ParameterError(
            f"{where} must be {valid}", name=where, value=quoted(value), valid=valid
        )
    return dict(value)


def _sections(kind: type[Section], value: Any, where: str) -> tuple[Section, ...]:
    if not isinstance(value, list) or not all(isinstance(each, Mapping) for each in value):
        raise ParameterError(
            f"{where} must be a list. Write it in double brackets, once per entry", name=where
        )
    return tuple(kind.read(each, where) for each in value)


def _rejection(
    info: FieldInfo, content: Mapping[str, Any], place: str, key: str, inner: Sequence[Any]
) -> InputError:
    """Return the error for a field whose value is missing or invalid.

    ``inner``: the value's place within the field.
    """
    hint = _hint(info)
    if key not in content:
        advice = f": {hint}" if hint else ". Add a value"
        return ParameterError(f"{place}{key} is missing{advice}", name=key)
    name, value, kind, unit = f"{place}{key}", content[key], _kind(info.annotation), _unit(info)
    if kind is Mapping:
        name, value, kind = f"[{key}] {inner[0]}", value[inner[0]], get_args(info.annotation)[-1]
    if unit is not None:
        leaf = leaf_of(name, unit, info)
        valid = leaf.range_beside(value) if isinstance(value, str) else leaf.range_text
        return ParameterError(
            f"{name} = {quoted(value)} must be {valid}",
            name=name,
            value=quoted(value),
            valid=valid,
        )
    if kind is int and not hint:
        least = next(note.ge for note in info.metadata if isinstance(note, Ge))
        most = next(note.le for note in info.metadata if isinstance(note, Le))
        return ParameterError(
            f"{name} = {quoted(value)} must be a whole number from {least} to {most}",
            name=name,
            value=quoted(value),
            valid=f"from {least} to {most}",
        )
    if kind is Literal and not hint:
        return unknown_name(name, str(value), get_args(info.annotation))
    valid = "" if hint else _VALID[kind]
    if kind is str and isinstance(value, str):  # only a blank string is not valid
        valid = "a string that is not blank"
    text = f"{name} = {quoted(value)}" + (f": {hint}" if hint else f" must be {valid}")
    return ParameterError(text, name=name, value=quoted(value), valid=valid)


def _unit(info: FieldInfo) -> Unit | None:
    return next((note for note in info.metadata if isinstance(note, Unit)), None)


def _hint(info: FieldInfo) -> str:
    return next((note.text for note in info.metadata if isinstance(note, Hint)), "")


def _kind(annotation: Any) -> Any:
    """Return the type of a value that is not None."""
    if get_origin(annotation) in (Union, UnionType):
        kinds = [each for each in get_args(annotation) if each is not NoneType]
        annotation = kinds[0] if len(kinds) == 1 else Union
    return get_origin(annotation) or annotation


def _is_section(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Section)
