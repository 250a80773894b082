"""Derived parameters: computed when parameters change, instead of in every tick.

Such numbers become members of their parameter set, beside its parameters: a law for two wheels has
them for each wheel. ``NAME_ecu_derive`` updates them; `values` are those of the export.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bywire.core import ops
from bywire.export.controller.c_text import c_name, unique
from bywire.export.controller.values import Expr, Use, Uses

STEADY = frozenset({"local", "field", "own", "library", "constant"})
"""kinds of dependencies that derived parameters may have; calls of laws are not among them"""
_EXACT = frozenset({"fabs", "sqrt", "fabsf", "sqrtf"})
_NAME = re.compile(r"(?<![\w.>])[A-Za-z_]\w*(->)?")
_NUMBER = re.compile(r"(?<![\w.])(\d+\.\d*(?:e[-+]?\d+)?|\d+e[-+]?\d+)f?")
_WORDS = {"+": "plus", "-": "minus", "*": "times", "/": "over"}
_NAMED = {"6.283185307179586": "two_pi", "3.141592653589793": "pi"}
_LONG = 40
_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "sine": ops.sin,
    "cosine": ops.cos,
    "exponential": ops.exp,
    "logarithm": ops.log,
    "power_of": ops.power,
    "whole": ops.floor,
    "larger": ops.fmax,
    "smaller": ops.fmin,
    "fabs": ops.fabs,
    "fabsf": ops.fabs,
    "sqrt": ops.sqrt,
    "sqrtf": ops.sqrt,
}
_ARITHMETIC: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


@dataclass(frozen=True)
class Term:
    """A derived number, in the terms of the function that reads it.

    Parameters
    ----------
    holder
        The function's argument with this member.
    struct, member
        Structure and member.
    """

    function: str
    holder: str
    struct: str
    member: str
    expr: Expr


@dataclass(frozen=True)
class Derived:
    """The same for one set, from the root of all parameters: ``par.PLACE = TEXT``."""

    place: str
    text: str
    uses: Uses

    @property
    def statement(self) -> str:
        """Its assignment in C."""
        return f"par->{self.place} = {re.sub(r'(?<![.])par[.]', 'par->', self.text)};"


@dataclass
class Derivations:
    """All derived terms of a translation, and the arguments of its functions.

    Parameters
    ----------
    refused
        Function and text of terms with two values for one member; this translation adds to them.
    """

    refused: set[tuple[str, str]] = field(default_factory=set)
    terms: list[Term] = field(default_factory=list)
    calls: dict[str, list[tuple[str, Mapping[str, Any]]]] = field(default_factory=dict)

    def member(
        self, function: str, holder: str, struct: str, expr: Expr, hint: str, taken: Iterable[str]
    ) -> str:
        """Return the name of the member for a term, a new one if there is none."""
        for each in self.terms:
            if (each.function, each.holder, each.expr.text) == (function, holder, expr.text):
                return each.member
        name = unique(c_name(hint or worded(expr.text)), {c_name(each) for each in taken})
        self.terms.append(Term(function, holder, struct, name, expr))
        return name

    def called(self, function: str, caller: str, arguments: Mapping[str, Any]) -> None:
        """Record a call."""
        self.calls.setdefault(function, []).append((caller, arguments))

    def _roots(self, function: str) -> Iterator[tuple[dict[str, str], Uses]]:
        """Yield the arguments from the root of all parameters, call by call."""
        if function not in self.calls:
            yield {"par": "par"}, frozenset()
            return
        for caller, arguments in self.calls[function]:
            for outer, uses in self._roots(caller):
                inner = {}
                for name, value in arguments.items():
                    if isinstance(value, Expr):
                        inner[name] = rooted(value.text.removeprefix("&"), outer)
                        uses |= value.uses
                yield inner, uses

    def derived(self, uses: frozenset[Use]) -> list[Derived]:
        """Return the terms to compute, in the order of their dependencies."""
        wanted, needs = [], set(uses)
        for term in reversed(self.terms):
            if ("field", term.struct, term.member) in needs:
                wanted.append(term)
                needs |= term.expr.uses
        made: dict[str, Derived] = {}
        for term in reversed(wanted):
            for roots, outer in self._roots(term.function):
                place = f"{roots[term.holder]}.{term.member}".removeprefix("par.")
                kept = frozenset(u for u in term.expr.uses | outer if u[0] in STEADY - {"local"})
                each = Derived(place, rooted(term.expr.text, roots), kept)
                if made.setdefault(place, each).text != each.text:
                    self.refused.add((term.function, term.expr.text))
        return list(made.values())


def is_exact(uses: Iterable[Use]) -> bool:
    """Return whether an expression has the same value wherever it is computed."""
    return all(u[0] in STEADY and (u[0] != "library" or u[1] in _EXACT) for u in uses)


def rooted(text: str, roots: Mapping[str, str]) -> str:
    """Return a text with the arguments of a function replaced by their values."""

    def replaced(found: re.Match[str]) -> str:
        name, arrow = found[0].removesuffix("->"), found[1]
        if name not in roots:
            return found[0]
        root = roots[name]
        is_path = re.fullmatch(r"[\w.]+", root) is not None
        return f"{root}." if arrow else root if is_path else f"({root})"

    return _NAME.sub(replaced, text)


def worded(text: str) -> str:
    """Return a name for an expression without one.

    Examples
    --------
    >>> worded("par->p_high - par->p_low")
    'p_high_minus_p_low'
    """
    words = []
    for part in re.findall(r"[A-Za-z_][\w.]*(?:->[\w.]+)*|[\d.]+(?:e[-+]?\d+)?|[-+*/]", text):
        last = re.split(r"->|[.](?=[A-Za-z_])", part)[-1]
        words.append({**_WORDS, **_NAMED}.get(part, last.removesuffix(".0").replace(".", "_")))
    name = "_".join(words)
    return name if len(name) <= _LONG else "term"


def values(
    derived: Iterable[Derived],
    par: Any,
    constants: Mapping[str, float],
    number: Callable[[float], Any],
) -> dict[str, Any]:
    """Return the numbers of a parameter set by their place, as Python computes them."""
    made: dict[str, Any] = {}
    names: dict[str, Any] = {name: number(value) for name, value in constants.items()}
    names["par"] = _Place(par, "", made, number)

    def computed(node: ast.expr) -> Any:
        match node:
            case ast.BinOp():
                return _ARITHMETIC[type(node.op)](computed(node.left), computed(node.right))
            case ast.UnaryOp():
                return -computed(node.operand)
            case ast.Call(func=ast.Name(id=name)):
                return _FUNCTIONS[name](*map(computed, node.args))
            case ast.Attribute():
                return getattr(computed(node.value), node.attr)
            case ast.Name():
                return names[node.id]
            case ast.Constant(value=float() as value):
                return number(value)
        raise TypeError(f"{ast.unparse(node)} does not follow from parameters")

    with np.errstate(all="ignore"):
        for each in derived:
            text = _NUMBER.sub(r"\1", each.text)
            made[each.place] = computed(ast.parse(text, mode="eval").body)
    return made


@dataclass(frozen=True)
class _Place:
    """A parameter set in C: names in C, and derived numbers."""

    group: Any
    path: str
    made: Mapping[str, Any]
    number: Callable[[float], Any]

    def __getattr__(self, name: str) -> Any:
        place = f"{self.path}{name}"
        if place in self.made:
            return self.made[place]
        known = {c_name(each): each for each in type(self.group).model_fields}
        value = getattr(self.group, known[name])
        if hasattr(type(value), "model_fields"):
            return _Place(value, f"{place}.", self.made, self.number)
        return self.number(value)
