"""Limits of key figures that depend on the test speed, or on an earlier stop.

A limit is a constant, ``"<= 41 m"``, a formula, ``"<= (0.1*V + V^2/115) m, V in km/h"``, or a
fraction, ``">= 60 % of cold stop"``. The formula is arithmetic on numbers and V. Python parses the
formula to a syntax tree, of which bywire evaluates only arithmetic nodes.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from bywire.bench.requirements import Comparison, Limit, parted, read_limit
from bywire.core import units
from bywire.core.errors import ParameterError, not_valid, quoted

_LONGEST = 200  # characters of a formula
_STEEPEST = 9.0  # exponent
_FORMULA = re.compile(r"\((.*)\)\s*([^(),]*?)\s*,\s*V\s+in\s+(\S(?:.*\S)?)\s*", re.DOTALL)
_SHARE = re.compile(r"([^%]*%)\s*of\s+(\S(?:.*\S)?)\s*", re.DOTALL)
EXAMPLE = "<= (0.1*V + V^2/115) m, V in km/h"
"""notation of a formula, for messages"""

_BINARY: Mapping[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_UNARY: Mapping[type[ast.unaryop], Callable[[float], float]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}


@dataclass(frozen=True)
class SpeedLimit:
    """Limit of a figure that may depend on the test speed or on an earlier stop.

    Parameters
    ----------
    figure, unit
        Name and unit of the limited key figure.
    text
        The user's text.
    at
        ``at(v)``: the limit at a test speed [m/s]. None if the limit refers to an earlier stop.
    compare, share, of
        Comparison, fraction and name of the earlier stop to which the limit refers.
    """

    figure: str
    unit: str
    text: str
    at: Callable[[float], Limit] | None = None
    compare: Comparison = "<="
    share: float = math.nan
    of: str = ""

    def beside(self, value: float) -> Limit:
        """Return the limit relative to the value of an earlier stop, in the figure's unit."""
        bound = self.share * value
        shown = f"{bound:.4g} %" if self.unit == "%" else units.shown(bound, self.unit, digits=4)
        of = f"{100.0 * self.share:g} % of {self.of}"
        text = f"{self.compare} {shown.replace('**', '^')} ({of})"
        return Limit(self.figure, self.compare, bound, self.unit, text)


def read_speed_limit(figure: str, text: Any, unit: str, what: str) -> SpeedLimit:
    """Return the limit of a figure in a unit.

    ``what``: place of the limit, for errors.

    Raises
    ------
    ParameterError
        When the text is not a limit, or its formula is not arithmetic.
    UnitError
        When a unit does not have the dimension of the figure, or of a speed.
    """
    before, compare, bound = parted(text) if isinstance(text, str) else ("", None, "")
    if compare is None or before:
        raise not_valid(f"{what} {figure}", quoted(text), f"a limit such as {quoted(EXAMPLE)}")
    if match := _SHARE.fullmatch(bound):
        share = units.parse(match[1], "1", f"{what} {figure}")
        return SpeedLimit(figure, unit, text, None, compare, share, match[2])
    if match := _FORMULA.fullmatch(bound):
        return _of_speed(figure, text, unit, what, compare, match)
    if "V" in bound and ("*" in bound or "^" in bound):
        valid = f"a formula in parentheses with units, such as {quoted(EXAMPLE)}"
        raise not_valid(f"{what} {figure}", quoted(text), valid)
    limit = read_limit(figure, text, unit, what)
    return SpeedLimit(figure, unit, text, lambda _: limit)


def _of_speed(
    figure: str, text: str, unit: str, what: str, compare: Comparison, match: re.Match[str]
) -> SpeedLimit:
    name = f"{what} {figure}"
    formula, of_bound, of_speed = match.groups()
    scale = units.parse(f"1 {of_speed}", "m/s", f"{name}: speed V", 20.0)
    value = compiled(formula, name)
    read_limit(figure, f"{compare} 1 {of_bound}", unit, what)  # rejects a wrong unit

    def at(v: float) -> Limit:
        V = v / scale
        bound = value(V)
        if not math.isfinite(bound):
            raise ParameterError(
                f"{name} = {quoted(text)} has no finite value at V = {V:g} {of_speed}",
                name=name,
                value=quoted(text),
                valid="a finite value",
            )
        exact = read_limit(figure, f"{compare} {bound!r} {of_bound}", unit, what)
        return replace(exact, text=f"{compare} {bound:.6g} {of_bound}")

    return SpeedLimit(figure, unit, text, at)


def compiled(formula: str, name: str) -> Callable[[float], float]:
    """Return a formula of V as a function; the value is NaN or infinite where it is undefined.

    Raises
    ------
    ParameterError
        When the formula contains anything other than numbers, ``V``, ``+ - * / ^`` and parentheses.

    Examples
    --------
    >>> compiled("0.1*V + V^2/150", "limit")(30.0)
    9.0
    """
    valid = "a formula of numbers and V with + - * / ^ and parentheses"
    wrong = not_valid(name, quoted(formula), valid)
    if len(formula) > _LONGEST or "**" in formula:
        raise wrong
    try:
        tree = ast.parse(formula.strip().replace("^", "**"), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise wrong from None

    def value(V: float) -> float:
        try:
            return _value(tree, V)
        except (ArithmeticError, ValueError):  # 1/0, or the root of a negative number
            return math.nan

    try:
        value(1.0)
    except (TypeError, RecursionError):
        raise wrong from None
    return value


def _value(node: ast.expr, V: float) -> float:
    """Return the value of a syntax tree; TypeError for anything but arithmetic."""
    if isinstance(node, ast.Constant) and not isinstance(node.value, bool):
        if isinstance(node.value, (int, float)):
            return float(node.value)
        raise TypeError
    if isinstance(node, ast.Name) and node.id == "V":
        return V
    if isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
        return _UNARY[type(node.op)](_value(node.operand, V))
    if isinstance(node, ast.BinOp):
        left, right = _value(node.left, V), _value(node.right, V)
        if isinstance(node.op, ast.Pow):
            if abs(right) > _STEEPEST:
                raise TypeError
            return math.pow(left, right)
        if type(node.op) in _BINARY:
            return _BINARY[type(node.op)](left, right)
    raise TypeError
