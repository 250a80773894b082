"""What is said of values that a parameter set refuses: one line each, in the user's words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

from bywire.core.errors import quoted
from bywire.core.leaf import Leaf
from bywire.core.units import split

if TYPE_CHECKING:
    from pydantic import ValidationError

_BOOL, _TEXT = "it must be true or false", "it must be a text"
_PLAIN_WORDS = {"bool_parsing": _BOOL, "bool_type": _BOOL, "string_type": _TEXT}


def refusals(
    error: ValidationError, owner: str, leaves: Mapping[str, Leaf], texts: Mapping[str, str]
) -> list[str]:
    """Return a line for every value that was refused.

    Parameters
    ----------
    error
        What pydantic found.
    owner
        Name of the class of the parameter set.
    leaves
        Its numbers by dotted name.
    texts
        How numbers were written, by dotted name, where they came as texts.
    """
    details: list[dict[str, Any]] = [dict(detail) for detail in error.errors()]
    places = {detail["loc"][:-1] for detail in details}
    # A table with a wrong node also counts as too short: the node alone is worth a line.
    details = [d for d in details if not (_is_length(d) and d["loc"] in places)]
    return [_explain(detail, owner, leaves, texts) for detail in details]


def _explain(
    detail: Mapping[str, Any], owner: str, leaves: Mapping[str, Leaf], texts: Mapping[str, str]
) -> str:
    name = ".".join(str(part) for part in detail["loc"])
    value, kind = detail["input"], detail["type"]
    if kind == "missing":
        return f"{owner}: {name} is missing: give it a value"
    if kind == "literal_error":
        return _unknown_choice(name, value, detail["ctx"]["expected"])
    leaf = leaves.get(name) or leaves.get(name.rpartition(".")[0])
    if leaf is not None and kind != "value_error" and not _is_length(detail):
        is_broken = leaf.is_whole and (kind.startswith("int") or kind == "multiple_of")
        wanted = "a whole number, " if is_broken else ""
        return _out_of_range(name, value, leaf, wanted, texts.get(name, ""))
    if _is_length(detail):
        return _wrong_count(name, detail, texts)
    message = _PLAIN_WORDS.get(kind, str(detail["msg"]).removeprefix("Value error, "))
    given = "" if isinstance(value, dict) else f", got {quoted(value)}"
    return f"{name or owner}: {message}{given}"


def _out_of_range(name: str, value: Any, leaf: Leaf, wanted: str, text: str) -> str:
    symbol = leaf.unit.symbol
    number, written = split(text)
    if symbol == "rad" and written not in ("", symbol):  # drawings have angles in degrees
        refused = f"{name} = {number} {written} is not admissible"
        return f"{refused}: it must be {wanted}{leaf.range_in(written)}"
    unit = "" if symbol == "1" else f" {symbol}"
    got = "" if written in ("", symbol) else f", got {quoted(text)}"
    return f"{name} = {value}{unit} is not admissible: it must be {wanted}{leaf.range_text}{got}"


def _wrong_count(name: str, detail: Mapping[str, Any], texts: Mapping[str, str]) -> str:
    """Return what is said of a table with too few or too many nodes."""
    context, value = detail["ctx"], detail["input"]
    short = detail["type"] == "too_short"
    wanted = f"at least {context['min_length']}" if short else f"at most {context['max_length']}"
    written = [texts.get(f"{name}.{k}", "") for k in range(len(value))]
    got = quoted(", ".join(written)) if written and all(written) else quoted(value)
    return f"{name}: {wanted} wanted, got {got}"


def _is_length(detail: Mapping[str, Any]) -> bool:
    return detail["type"] in ("too_short", "too_long")


def _unknown_choice(name: str, value: Any, expected: str) -> str:
    near = get_close_matches(quoted(value), re.findall(r"'[^']*'", expected), n=1, cutoff=0.6)
    hint = f": did you mean {near[0]}?" if near else ""
    return f"{name}: it must be {expected}, got {quoted(value)}{hint}"
