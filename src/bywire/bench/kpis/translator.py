"""C from typed Python functions that loop over samples, statement by statement.

Key figures for many cases or for a page are such functions. Python runs them unchanged. The
translator supports the following:

* int, float and bool, `Samples`, NamedTuples of these, the numbers of a family's ``Setting``,
  ``| None`` and ``| Undefined``;
* ``for`` over a range or samples, ``while``, ``if``, ``break``, ``continue``, ``return``;
* arithmetic, comparisons, slices, lists with one number per sample;
* other functions of this kind, and some Python functions.

Any other code in a function raises an error with its line.

C and Python return the same bits, except for signs of zero. The translator keeps every operation as
written, and compilers may not regroup operations. The translator therefore also rejects functions
whose digits depend on the machine's library (``sin``, ``**``).
"""

from __future__ import annotations

import ast
import bisect
import builtins
import dataclasses
import inspect
import math
import re
import textwrap
import types
import typing
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import FunctionType, NoneType
from typing import Any, NoReturn

from bywire.bench.kpis.kpi import Undefined
from bywire.core.errors import ModelError

_NUMBERS = {int: "int64_t", float: "double", bool: "int"}
_OPERATORS: dict[type, str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
_MOST_NUMBERS = 3
"""maximum number of numbers in the text of an undefined figure, as in `bw_undefined` of loops.h"""
_C_WORDS = (
    "auto case char const default do double enum extern float goto inline int long register "
    "restrict short signed sizeof static struct switch typedef union unsigned void volatile "
    # also in C++, for graphics processors
    "catch concept delete explicit export friend mutable namespace new operator private protected "
    "public requires template this throw typename using virtual"
)


@dataclass(frozen=True)
class Kind:
    """C type: ``base`` is a class, ``list`` for samples, or ``tuple`` for a pair of numbers."""

    base: type
    or_none: bool = False
    or_undefined: bool = False

    @property
    def is_number(self) -> bool:
        """Whether it is a number and nothing else."""
        return self.base in _NUMBERS and not self.is_wrapped

    @property
    def is_wrapped(self) -> bool:
        """Whether it may be None or undefined, so that its value is a field."""
        return self.base is not Undefined and (self.or_none or self.or_undefined)

    @property
    def inner(self) -> Kind:
        """Type of the value itself."""
        return Kind(self.base) if self.is_wrapped else self


FLOAT, INT, BOOL, SAMPLES = Kind(float), Kind(int), Kind(bool), Kind(list)
_NOTHING = Kind(NoneType)
FIGURE = Kind(float, or_undefined=True)
"""result of the function of a key figure"""
PAIR = Kind(tuple)


@dataclass(frozen=True)
class Value:
    """C expression and its type."""

    text: str
    kind: Kind


@dataclass
class Function:
    """Translated function.

    Parameters
    ----------
    name
        Its name in C.
    parameters, returns
        Types of its parameters, by name, and of its result.
    text
        Its C source.
    arrays
        Number of lists with one number per sample that it and the functions it calls create.
    """

    name: str
    parameters: dict[str, Kind]
    returns: Kind
    text: str = ""
    arrays: int = 0


@dataclass
class Unit:
    """C source of some functions and of all functions that they call.

    ``reasons``: texts of undefined figures as templates for `str.format`, each with whether it
    leaves the figure open. A figure's reason is the number of its text here, from 1 on.
    """

    reasons: dict[tuple[str, bool], int] = field(default_factory=dict)
    _types: dict[Kind, tuple[str, str]] = field(default_factory=dict)
    _functions: dict[FunctionType, Function] = field(default_factory=dict)
    _names: set[str] = field(default_factory=set)
    _begun: set[FunctionType] = field(default_factory=set)

    @property
    def text(self) -> str:
        """Types and functions, each after those that it uses."""
        types = (declared for _, declared in self._types.values() if declared)
        return "\n".join([*types, *(function.text for function in self._functions.values())])

    def function(self, function: Callable[..., Any]) -> Function:
        """Return a function's translation, after those of the functions that it calls.

        Raises
        ------
        ModelError
            When the function cannot be translated. The message contains the line.
        """
        if not isinstance(function, FunctionType):
            raise ModelError(f"{function!r} is not a function in a source file")
        if function not in self._functions:
            self._begun.add(function)
            self._functions[function] = _Writer(self, function).translated()
        return self._functions[function]

    def is_begun(self, function: FunctionType) -> bool:
        """Return whether a function's translation has begun but is not complete."""
        return function in self._begun and function not in self._functions

    def new_name(self, stem: str) -> str:
        """Return a unique name for a function or type."""
        name = stem if stem not in self._names else f"{stem}_{len(self._names)}"
        self._names.add(name)
        return name

    def ctype(self, kind: Kind) -> str:
        """Return the C name of a type, and declare the type if necessary."""
        if kind not in self._types:
            self._types[kind] = self._declared(kind)
        return self._types[kind][0]

    def reason(self, text: str, is_open: bool) -> int:
        """Return the number of a reason's text."""
        return self.reasons.setdefault((text, is_open), len(self.reasons) + 1)

    def _declared(self, kind: Kind) -> tuple[str, str]:
        """Return the C name of a type and its declaration."""
        if kind.is_wrapped:
            value = self.ctype(kind.inner)
            stem = value.removeprefix("bw_")
            rest = ("bw_undefined none", "undefined") if kind.or_undefined else ("int is", "maybe")
            name = f"bw_{rest[1]}_{stem}"
            return name, f"typedef struct {{ {value} value; {rest[0]}; }} {name};"
        named = {list: "bw_samples", tuple: "bw_pair", Undefined: "bw_undefined"}
        if kind.base in _NUMBERS or kind.base in named:
            return (_NUMBERS | named)[kind.base], ""
        fields = "".join(f" {self.ctype(k)} {c_name(n)};" for n, k in fields_of(kind.base).items())
        name = self.new_name(f"bw_{kind.base.__name__}")
        return name, f"typedef struct {{{fields} }} {name};"


def c_name(name: str) -> str:
    """Return a name that is valid in C."""
    return f"{name}_" if name in _C_WORDS.split() or name.startswith("bw_") else name


def kind_of(hint: Any) -> Kind | None:
    """Return the type of an annotation; None if C has no such type."""
    if isinstance(hint, types.UnionType) or typing.get_origin(hint) is typing.Union:
        parts = [part for part in typing.get_args(hint) if part is not NoneType]
        beside = [part for part in parts if part is not Undefined] or parts[:1]
        or_none = NoneType in typing.get_args(hint)
        or_undefined = len(beside) < len(parts)
        inner = kind_of(beside[0]) if len(beside) == 1 else None
        return None if inner is None else replace(inner, or_none=or_none, or_undefined=or_undefined)
    if hint in _NUMBERS or hint is Undefined:
        return Kind(hint)
    if hint == list[float] or hint == tuple[float, float]:
        return Kind(typing.get_origin(hint) or list)
    is_record = isinstance(hint, type) and (
        (issubclass(hint, tuple) and hasattr(hint, "_fields")) or dataclasses.is_dataclass(hint)
    )
    return Kind(hint) if is_record else None


def fields_of(record: type) -> dict[str, Kind]:
    """Return the types of a NamedTuple's fields, or of a setting's numbers."""
    kinds = {name: kind_of(hint) for name, hint in _hints(record).items()}
    return {name: kind for name, kind in kinds.items() if kind is not None}


def _hints(of: Any) -> dict[str, Any]:
    """Return the types of annotations."""
    try:
        return typing.get_type_hints(of)
    except NameError as error:
        raise ModelError(
            f"{of.__module__}: an annotation of {of.__name__} has no value at run time: {error}",
            name=of.__name__,
        ) from None


class _Writer:
    """Translation of one function."""

    def __init__(self, unit: Unit, function: FunctionType) -> None:
        self.unit, self.function = unit, function
        self.place = Path(function.__code__.co_filename).name
        try:
            lines, self.first = inspect.getsourcelines(function)
            (self.node,) = ast.parse(textwrap.dedent("".join(lines))).body
            self.hints = _hints(function)
        except (OSError, SyntaxError) as error:
            raise ModelError(
                f"{self.place}: {function.__name__} cannot be translated to C: {error}",
                name=function.__name__,
            ) from None
        self.kinds: dict[str, Kind] = {}
        self.locals: dict[str, Kind] = {}
        self.arrays: set[str] = set()  # lists that this function creates
        self.counters: list[str] = []  # variables of the enclosing loops
        self.loops = 0
        self.values: dict[ast.expr, Value] = {}  # of translated expressions
        self.made: Function

    def translated(self) -> Function:
        """Return the translated function."""
        node = self.node
        if not isinstance(node, ast.FunctionDef) or node.name != self.function.__name__:
            self.refuse(node, "it is not a function, or its file has changed since it was loaded")
        a = node.args
        for each in (a.vararg, a.kwarg, *a.kwonlyargs, *a.posonlyargs):
            if each is not None:
                self.refuse(each, "its parameters must be plain: name: type, ...")
        self.kinds = {each.arg: self.annotated(each, each.arg) for each in a.args}
        returns = self.annotated(node, "return")
        name = self.unit.new_name(f"k_{self.function.__name__}")
        self.made = Function(name, dict(self.kinds), returns)
        _ArraysFinished(self).check(node)
        body = self.block(node.body)
        head = [f"{self.unit.ctype(k)} {c_name(n)}" for n, k in self.made.parameters.items()]
        room = ["double **room"] if self.made.arrays else []
        local = [f"  {self.unit.ctype(k)} {c_name(n)}{_zero(k)};" for n, k in self.locals.items()]
        doc = (ast.get_docstring(node) or "").partition("\n")[0].replace("*/", "")
        start = f"static inline {self.unit.ctype(returns)} {name}({', '.join(room + head)}) {{"
        end = "" if isinstance(node.body[-1], ast.Return) else self.unreached(returns)
        comment = f"/* {doc} */\n" if doc else ""
        text = "\n".join([start, *local, *(f"  {line}" for line in [*body, *end.splitlines()])])
        self.made.text = f"{comment}{text}\n}}\n"
        return self.made

    def unreached(self, returns: Kind) -> str:
        """Return the last line of a function that ends in a branch; it is never executed."""
        return f"return ({self.unit.ctype(returns)}){'0' if returns.is_number else '{0}'};"

    def annotated(self, node: ast.AST, name: str) -> Kind:
        """Return the declared type of a parameter or of the result."""
        kind = kind_of(self.hints[name]) if name in self.hints else None
        if kind is None or (kind.or_none and kind.or_undefined):
            hint = self.hints.get(name, "missing")
            self.refuse(
                node,
                f"the type of {name!r} is {hint}; C has int, float, bool, Samples, NamedTuples of "
                "them, and each of these with `| None` or `| Undefined`",
            )
        return kind

    def refuse(self, node: ast.AST, why: str) -> NoReturn:
        """Raise the error for code that cannot be translated."""
        line = self.first + getattr(node, "lineno", 1) - 1
        text = "" if isinstance(node, (ast.FunctionDef, ast.arg)) else f" `{_short(node)}`"
        raise ModelError(
            f"{self.place}, line {line}, in {self.function.__name__}: bywire cannot write{text} in "
            f"C: {why}"
        )

    def block(self, body: Sequence[ast.stmt]) -> list[str]:
        return [line for each in body for line in self.statement(each)]

    def statement(self, node: ast.stmt) -> list[str]:
        """Return the lines of a statement."""
        match node:
            case ast.Expr(ast.Constant(str())) | ast.Pass():
                return []
            case ast.Assign([ast.Name(name)], value):
                return self.assigned(node, name, value, self.kinds.get(name))
            case ast.AnnAssign(ast.Name(name), annotation, ast.expr() as value):
                hint = self.evaluated(annotation)
                return self.assigned(node, name, value, kind_of(hint))
            case ast.Assign([ast.Subscript() as target], value):
                return [f"{self.stored(target)} = {self.number(value)};"]
            case ast.AugAssign(ast.Name(name) as target, op, value):
                whole = ast.BinOp(ast.Name(name, ast.Load()), op, value)
                return self.assigned(node, target.id, ast.copy_location(whole, node), None)
            case ast.AugAssign(ast.Subscript() as target, op, value):
                whole = ast.copy_location(ast.BinOp(target, op, value), node)
                return [f"{self.stored(target)} = {self.number(whole)};"]
            case ast.For(ast.Name(name), over, body, []):
                return self.loop(node, name, over, body)
            case ast.While(test, body, []):
                self.loops += 1
                lines = [f"while ({self.condition(test)}) {{", *_in(self.block(body)), "}"]
                self.loops -= 1
                return lines
            case ast.If(test, body, rest):
                lines = [f"if ({self.condition(test)}) {{", *_in(self.block(body)), "}"]
                return lines + (["else {", *_in(self.block(rest)), "}"] if rest else [])
            case ast.Return(ast.expr() as value):
                lines, given = self.list_made(value)
                return [*lines, f"return {self.coerced_value(value, given, self.made.returns)};"]
            case ast.Break():
                return ["break;"]
            case ast.Continue():
                return ["continue;"]
        self.refuse(
            node,
            "valid statements are assignments, for, while, if, break, continue and return of a "
            "value, without else after a loop",
        )

    def assigned(self, node: ast.stmt, name: str, value: ast.expr, kind: Kind | None) -> list[str]:
        """Return the lines of an assignment; the first one determines the variable's type."""
        if name in self.counters:
            self.refuse(node, f"{name!r} is a loop counter, which the loop must not change")
        lines, given = self.list_made(value)
        if name in self.arrays and not lines:
            self.refuse(node, f"{name!r} is already a list of this function. Use another name")
        kind = kind or self.kinds.get(name) or given.kind
        if kind == _NOTHING:
            self.refuse(node, "the variable needs an annotation: `name: float | None = None`")
        if name not in self.kinds:
            self.kinds[name] = self.locals[name] = kind
        if lines:
            self.arrays.add(name)
        return [*lines, f"{c_name(name)} = {self.coerced_value(value, given, kind)};"]

    def list_made(self, node: ast.expr) -> tuple[list[str], Value]:
        """Return the lines that create a list of one number per sample; none for other values."""
        match node:
            case ast.BinOp(ast.List([ast.Constant(float(start))]), ast.Mult(), count):
                if start != 0.0:
                    self.refuse(node, "a list must start as [0.0] * len(...)")
                self.made.arrays += self.array(node)
                return [""], Value(f"bw_zeros(room, {self.length(count)})", SAMPLES)
            case ast.Call(ast.Name("list"), [copied], []):
                self.made.arrays += self.array(node)
                return [""], Value(f"bw_copy(room, {self.samples(copied)})", SAMPLES)
            case ast.ListComp(element, [ast.comprehension(ast.Name(name), over, [], 0)]):
                return self.comprehension(node, element, name, over)
        return [], self.value(node)

    def array(self, node: ast.AST) -> int:
        """Return 1 for a list that is created once; reject a list within a loop."""
        if self.loops:
            self.refuse(node, "a list must not be created within a loop")
        return 1

    def comprehension(
        self, node: ast.ListComp, element: ast.expr, name: str, over: ast.expr
    ) -> tuple[list[str], Value]:
        """Return the lines that create a list from an expression."""
        self.made.arrays += self.array(node)
        array, k = (f"bw_{each}_{self.made.arrays}" for each in ("list", "place"))
        outer = self.kinds.get(name)
        if self.calls(over, range):
            begin, end = self.bounds_of_list(over)
            above = []
            self.kinds[name] = INT
            item = f"const int64_t {c_name(name)} = {k} + {begin};"
        else:
            given = f"{array}_of"
            above = [f"const bw_samples {given} = {self.samples(over)};"]
            begin, end = "0", f"{given}.n"
            self.kinds[name] = FLOAT
            item = f"const double {c_name(name)} = {given}.at[{k}];"
        self.loops += 1
        value = self.number(element)
        self.loops -= 1
        del self.kinds[name]
        if outer is not None:
            self.kinds[name] = outer
        count = f"{array}_n"
        return [
            *above,
            f"const int64_t {count} = {end} > {begin} ? {end} - {begin} : 0;",
            f"double *restrict {array} = bw_take(room, {count});",
            f"for (int64_t {k} = 0; {k} < {count}; ++{k}) {{",
            f"  {item}",
            f"  {array}[{k}] = {value};",
            "}",
        ], Value(f"(bw_samples){{{array}, {count}}}", SAMPLES)

    def bounds_of_list(self, over: ast.expr) -> tuple[str, str]:
        """Return begin and end of a list's range, which is no longer than the recording."""
        match getattr(over, "args", ()):
            case [end]:
                begin = "0"
            case [ast.Constant(int(first)), end]:
                begin = str(first)
            case _:
                self.refuse(
                    over, "the range of a list must be range(len(...)) or range(1, len(...))"
                )
        match end:
            case ast.BinOp(ast.Call() as length, ast.Sub(), ast.Constant(int(less))):
                return begin, f"({self.length(length)} - {less})"
        return begin, self.length(end)

    def length(self, node: ast.expr) -> str:
        """Return the number of samples of a list."""
        if self.calls(node, len):
            return self.value(node).text
        self.refuse(node, "a list must have one number per sample: len(...)")

    def stored(self, target: ast.Subscript) -> str:
        """Return the list element to which a number is assigned."""
        if not isinstance(target.value, ast.Name) or target.value.id not in self.arrays:
            self.refuse(target, "only a list created in this function can be changed")
        return f"((double *){c_name(target.value.id)}.at)[{self.index(target.value, target.slice)}]"

    def loop(self, node: ast.For, name: str, over: ast.expr, body: Sequence[ast.stmt]) -> list[str]:
        """Return the lines of a loop over a range or over samples, whose bounds are fixed first."""
        if name in self.kinds:
            self.refuse(node, f"{name!r} is already in use. Use another name for the loop variable")
        k = c_name(name)
        if self.calls(over, range):
            head, self.kinds[name] = [f"{{ {self.range_head(over, k)}"], INT
        else:
            at, given = f"bw_at_{k}", f"bw_of_{k}"
            head, self.kinds[name] = (
                [
                    f"{{ const bw_samples {given} = {self.samples(over)};",
                    f"for (int64_t {at} = 0; {at} < {given}.n; ++{at}) {{",
                    f"  const double {k} = {given}.at[{at}];",
                ],
                FLOAT,
            )
        self.loops += 1
        self.counters.append(name)
        lines = _in(self.block(body))
        self.counters.pop()
        del self.kinds[name]
        self.loops -= 1
        return [*head, *lines, "}}"]

    def range_head(self, over: ast.expr, k: str) -> str:
        """Return the head of a loop over a range."""
        match getattr(over, "args", ()):
            case [end]:
                begin, step = "0", 1
            case [first, end]:
                begin, step = self.whole(first), 1
            case [first, end, ast.UnaryOp(ast.USub(), ast.Constant(int(size)))]:
                begin, step = self.whole(first), -size
            case [first, end, ast.Constant(int(step))]:
                begin = self.whole(first)
            case _:
                self.refuse(
                    over, "the step of a range must be a literal number: range(begin, end, -1)"
                )
        if step == 0:
            self.refuse(over, "the step of a range must not be zero")
        goes_on = f"{k} {'<' if step > 0 else '>'} bw_end_{k}"
        bounds = f"int64_t {k} = {begin}, bw_end_{k} = {self.whole(end)}"
        return f"for ({bounds}; {goes_on}; {k} += {step}) {{"

    # expressions

    def plain(self, node: ast.expr) -> Value:
        """Return an expression; for one that may be None or undefined, its value."""
        return _plain(self.value(node))

    def number(self, node: ast.expr) -> str:
        """Return a numeric expression."""
        value = self.plain(node)
        if not value.kind.is_number:
            self.refuse(node, "this must be a number")
        return value.text

    def whole(self, node: ast.expr) -> str:
        """Return an integer expression."""
        value = self.plain(node)
        if value.kind not in (INT, BOOL):
            self.refuse(node, "this must be an int")
        return value.text

    def condition(self, node: ast.expr) -> str:
        """Return a Boolean expression."""
        value = self.value(node)
        if value.kind != BOOL:
            self.refuse(
                node, "a condition must be a bool. Add a comparison, such as != 0 or `is None`"
            )
        return value.text

    def samples(self, node: ast.expr) -> str:
        """Return an expression for samples."""
        value = self.plain(node)
        if value.kind != SAMPLES:
            self.refuse(node, "this must be Samples")
        return value.text

    def coerced(self, node: ast.expr, kind: Kind) -> str:
        """Return an expression converted to a type."""
        return self.coerced_value(node, self.value(node), kind)

    def coerced_value(self, node: ast.expr, value: Value, kind: Kind) -> str:
        if value.kind == kind:
            return value.text
        whole = f"({self.unit.ctype(kind)})"
        if kind.base is Undefined and kind.or_none:
            if value.kind == _NOTHING:
                return f"{whole}{{0}}"
            if value.kind.base is Undefined:
                return value.text
        elif kind.or_undefined:
            if value.kind.base is Undefined:
                return f"{whole}{{.none = {value.text}}}"
            if value.kind.or_undefined:
                return f"{whole}{{.none = {value.text}.none}}"
            return f"{whole}{{.value = {self.coerced_value(node, value, kind.inner)}}}"
        elif kind.or_none:
            if value.kind == _NOTHING:
                return f"{whole}{{.is = 0}}"
            return f"{whole}{{.value = {self.coerced_value(node, value, kind.inner)}, .is = 1}}"
        value = _plain(value)
        is_narrower = kind == FLOAT and value.kind.is_number
        if value.kind == kind or is_narrower or (kind, value.kind) == (INT, BOOL):
            return value.text
        self.refuse(node, f"it is {_annotation(value.kind)}, but it must be {_annotation(kind)}")

    def value(self, node: ast.expr) -> Value:
        """Return an expression with its type."""
        if node not in self.values:
            self.values[node] = self.translated_value(node)
        return self.values[node]

    def translated_value(self, node: ast.expr) -> Value:
        match node:
            case ast.Constant(None):
                return Value("", _NOTHING)
            case ast.Constant(bool() | int() | float() as constant):
                return self.constant(node, constant)
            case ast.Name(name):
                if name in self.kinds:
                    return Value(c_name(name), self.kinds[name])
                return self.constant(node, self.evaluated(node))
            case ast.Attribute():
                return self.attribute(node)
            case ast.Subscript(of, ast.Slice(low, high, None)):
                begin = "0" if low is None else self.whole(low)
                end = "INT64_MAX" if high is None else self.whole(high)
                return Value(f"bw_slice({self.samples(of)}, {begin}, {end})", SAMPLES)
            case ast.Subscript(of, ast.UnaryOp(ast.USub(), ast.Constant(int(back)))):
                return Value(f"bw_from_end({self.samples(of)}, {back})", FLOAT)
            case ast.Subscript(of, at) if not isinstance(at, ast.Slice):
                return Value(f"{self.plain(of).text}.at[{self.index(of, at)}]", FLOAT)
            case ast.UnaryOp(ast.Not(), operand):
                return Value(f"(!{self.condition(operand)})", BOOL)
            case ast.UnaryOp(ast.USub(), operand):
                kind = self.plain(operand).kind
                return Value(f"(-{self.number(operand)})", INT if kind == BOOL else kind)
            case ast.BinOp():
                return self.arithmetic(node)
            case ast.Compare():
                return self.comparison(node)
            case ast.BoolOp(op, values):
                joint = " && " if isinstance(op, ast.And) else " || "
                return Value(f"({joint.join(map(self.condition, values))})", BOOL)
            case ast.IfExp(test, body, orelse):
                return self.choice(node, test, body, orelse)
            case ast.Call():
                return self.call(node)
        self.refuse(node, "C and Python may compute this expression differently")

    def constant(self, node: ast.expr, constant: Any) -> Value:
        """Return a literal number or a constant of a module."""
        if isinstance(constant, (bool, int)):
            return Value(str(int(constant)), BOOL if isinstance(constant, bool) else INT)
        if isinstance(constant, float) and math.isnan(constant):
            return Value("bw_no_number()", FLOAT)
        if isinstance(constant, float) and math.isfinite(constant):
            return Value(repr(constant), FLOAT)
        self.refuse(node, "a constant must be a finite number")

    def evaluated(self, node: ast.expr) -> Any:
        """Return the value of a name, an attribute or a type outside the function."""
        names = self.function.__globals__
        match node:
            case ast.Constant(value):
                return value
            case ast.BinOp(left, ast.BitOr(), right):
                return self.evaluated(left) | self.evaluated(right)
            case ast.Subscript(of, ast.Tuple(parts)):
                return self.evaluated(of)[tuple(map(self.evaluated, parts))]
            case ast.Subscript(of, part):
                return self.evaluated(of)[self.evaluated(part)]
            case ast.Name(name) if name in names:
                return names[name]
            case ast.Name(name) if hasattr(builtins, name):
                return getattr(builtins, name)
            case ast.Attribute(of, name) if hasattr(owner := self.evaluated(of), name):
                return getattr(owner, name)
        self.refuse(node, "it has no value here: it is not assigned yet, or only within a loop")

    def attribute(self, node: ast.Attribute) -> Value:
        """Return a field, or a constant of a module."""
        if isinstance(node.value, ast.Name) and node.value.id not in self.kinds:
            return self.constant(node, self.evaluated(node))
        value = self.plain(node.value)
        kind = fields_of(value.kind.base).get(node.attr) if value.kind.base not in _SIMPLE else None
        if kind is None:
            self.refuse(node, f"{node.attr!r} is not a field with a C type")
        return Value(f"{value.text}.{c_name(node.attr)}", kind)

    def index(self, of: ast.expr, at: ast.expr) -> str:
        """Return the index of a sample."""
        value = self.plain(of)
        if value.kind == PAIR and isinstance(at, ast.Constant) and at.value in (0, 1):
            return str(at.value)
        if value.kind != SAMPLES:
            self.refuse(of, "this must be Samples")
        return self.whole(at)

    def arithmetic(self, node: ast.BinOp) -> Value:
        (left, right) = (self.plain(each) for each in (node.left, node.right))
        a, b = self.number(node.left), self.number(node.right)
        is_whole = FLOAT not in (left.kind, right.kind)
        if isinstance(node.op, ast.FloorDiv) and is_whole:
            return Value(f"bw_floor_divide({a}, {b})", INT)
        sign = _OPERATORS.get(type(node.op))
        if sign is None:
            self.refuse(node, "valid arithmetic is + - * /, and // of ints")
        if sign == "/":
            return Value(f"({'(double)' if is_whole else ''}{a} / {b})", FLOAT)
        return Value(f"({a} {sign} {b})", INT if is_whole else FLOAT)

    def comparison(self, node: ast.Compare) -> Value:
        match node:
            case ast.Compare(left, [ast.Is() | ast.IsNot() as op], [ast.Constant(None)]):
                value = self.value(left)
                if not value.kind.or_none:
                    self.refuse(node, "this value is never None")
                there = "reason" if value.kind.base is Undefined else "is"
                sign = "==" if isinstance(op, ast.Is) else "!="
                return Value(f"({value.text}.{there} {sign} 0)", BOOL)
        before = self.made.arrays
        sides = [self.number(each) for each in (node.left, *node.comparators)]
        if len(sides) > 2 and self.made.arrays > before:  # C would compute the middle one twice
            self.refuse(node, "assign the middle number to a variable first")
        signs = [_OPERATORS.get(type(op)) for op in node.ops]
        if None in signs:
            self.refuse(node, "valid comparisons are < <= > >= == != of numbers, and `is None`")
        parts = [f"{a} {s} {b}" for a, s, b in zip(sides, signs, sides[1:], strict=False)]
        return Value(f"({' && '.join(parts)})", BOOL)

    def choice(self, node: ast.IfExp, test: ast.expr, body: ast.expr, orelse: ast.expr) -> Value:
        sides = [self.value(body), self.value(orelse)]
        kind = _joint(sides[0].kind, sides[1].kind)
        if kind is None:
            self.refuse(node, "both values of a conditional expression must have the same type")
        yes, no = (
            self.coerced_value(each, value, kind)
            for each, value in zip((body, orelse), sides, strict=True)
        )
        return Value(f"({self.condition(test)} ? {yes} : {no})", kind)

    # calls

    def calls(self, node: ast.expr, function: Any) -> bool:
        """Return whether an expression calls a given function of Python."""
        is_call = isinstance(node, ast.Call) and self.is_outside(node.func)
        return is_call and self.evaluated(node.func) is function  # type: ignore[attr-defined]

    def is_outside(self, node: ast.expr) -> bool:
        """Return whether a name, or one in a module, is defined outside the function."""
        while isinstance(node, ast.Attribute):
            node = node.value
        return isinstance(node, ast.Name) and node.id not in self.kinds

    def call(self, node: ast.Call) -> Value:
        """Return the result of a function, or a new record."""
        if not self.is_outside(node.func):
            self.refuse(node, "only functions of modules can be called")
        called = self.evaluated(node.func)
        if called is isinstance:
            return self.is_undefined(node)
        if called is Undefined:
            return self.undefined(node)
        if called in _BUILT_IN:
            return self.built_in(node, _BUILT_IN[called])
        if isinstance(called, FunctionType):
            if self.unit.is_begun(called):
                self.refuse(node, "a function must not call itself")
            made = self.unit.function(called)
            if made.arrays:
                self.made.arrays += made.arrays * self.array(node)
            args = self.arguments(node, called, made.parameters)
            rooms = ["room"] if made.arrays else []
            return Value(f"{made.name}({', '.join([*rooms, *args.values()])})", made.returns)
        kind = kind_of(called) if isinstance(called, type) else None
        if kind is None or not hasattr(called, "_fields"):
            names = ", ".join(each.__name__ for each in _BUILT_IN)
            self.refuse(node, f"it can call functions of this kind, NamedTuples, and {names}")
        args = self.arguments(node, called, fields_of(called))
        given = ", ".join(f".{c_name(n)} = {text}" for n, text in args.items())
        return Value(f"({self.unit.ctype(kind)}){{{given}}}", kind)

    def arguments(
        self, node: ast.Call, called: Callable[..., Any], wanted: dict[str, Kind]
    ) -> dict[str, str]:
        """Return the arguments of a call by the names of its parameters."""
        keywords = {each.arg: each.value for each in node.keywords}
        if None in keywords or any(isinstance(each, ast.Starred) for each in node.args):
            self.refuse(node, "pass the arguments one by one, without * and **")
        signature = inspect.signature(called)
        try:
            bound = signature.bind(*node.args, **keywords)  # type: ignore[arg-type]
        except TypeError as error:
            self.refuse(node, str(error))
        for name, parameter in signature.parameters.items():
            if name not in bound.arguments:
                bound.arguments[name] = ast.copy_location(ast.Constant(parameter.default), node)
        missing = [name for name in bound.arguments if name not in wanted]
        if missing:
            self.refuse(node, f"the type of {missing[0]!r} does not exist in C")
        return {name: self.coerced(bound.arguments[name], wanted[name]) for name in wanted}

    def built_in(
        self, node: ast.Call, forms: Sequence[tuple[tuple[Kind, ...], Kind, str]]
    ) -> Value:
        """Return the result of a function of Python."""
        values = [self.plain(each) for each in node.args]
        given = tuple(each.kind for each in values)
        if given in ((INT, FLOAT), (FLOAT, INT)):
            given = (FLOAT, FLOAT)
        for takes, gives, text in forms:
            if takes == given and not node.keywords:
                return Value(f"{text}({', '.join(each.text for each in values)})", gives)
        valid = ", or ".join(" and ".join(map(_annotation, takes)) for takes, *_ in forms)
        alone = "it is valid only in a for, or alone on the right of an assignment"
        self.refuse(node, f"its arguments must be {valid}" if valid else alone)

    def is_undefined(self, node: ast.Call) -> Value:
        match node.args:
            case [ast.expr() as tested, ast.expr() as kind] if self.evaluated(kind) is Undefined:
                value = self.value(tested)
                if value.kind.or_undefined:
                    return Value(f"({value.text}.none.reason != 0)", BOOL)
        self.refuse(node, "use isinstance only to test whether a `... | Undefined` is Undefined")

    def undefined(self, node: ast.Call) -> Value:
        """Return the reason for an undefined figure: number of its text, and the numbers in it."""
        match node:
            case ast.Call(_, [reason], []):
                is_open = False
            case ast.Call(_, [reason], [ast.keyword("is_open", ast.Constant(bool(is_open)))]):
                pass
            case _:
                self.refuse(node, "write Undefined(text) or Undefined(text, is_open=True)")
        if isinstance(reason, ast.Constant) and re.search(r"\{[{:]", str(reason.value)):
            self.refuse(node, "a text with numbers must be an f-string")
        numbers: list[str] = []
        text = "".join(self.pieces(node, reason, numbers))
        if len(numbers) > _MOST_NUMBERS:
            self.refuse(node, f"a text can contain at most {_MOST_NUMBERS} numbers")
        place = self.unit.reason(text, is_open)
        listed = f", {{{', '.join(numbers)}}}" if numbers else ", {0}"
        return Value(f"(bw_undefined){{{place}{listed}}}", Kind(Undefined))

    def pieces(self, node: ast.Call, reason: ast.expr, numbers: list[str]) -> Iterator[str]:
        """Yield the pieces of a template for `str.format`, and add its numbers to a list."""
        for part in reason.values if isinstance(reason, ast.JoinedStr) else [reason]:
            match part:
                case ast.Constant(str(text)):
                    yield text.replace("{", "{{").replace("}", "}}")
                case ast.FormattedValue(value, -1, ast.JoinedStr([ast.Constant(str(shown))])):
                    numbers.append(self.number(value))
                    yield f"{{:{shown}}}"
                case ast.FormattedValue(value, -1, None) if self.plain(value).kind == INT:
                    numbers.append(f"(double){self.number(value)}")
                    yield "{:.0f}"
                case ast.Name() if isinstance(text := self.evaluated(part), str):
                    yield text.replace("{", "{{").replace("}", "}}")
                case _:
                    self.refuse(
                        node, "write the text as one literal with numbers such as {level:.3g}"
                    )


class _ArraysFinished(ast.NodeVisitor):
    """Rule that makes slices equivalent: Python copies a slice, C refers to the same list.

    A function may change its own list only before it slices, passes on or renames that list.
    """

    def __init__(self, writer: _Writer) -> None:
        self.writer = writer
        self.loops: list[int] = []  # first lines of the enclosing loops
        self.read: dict[str, int] = {}  # line from which a list is passed on
        self.changed: list[tuple[str, ast.Subscript]] = []

    def check(self, node: ast.FunctionDef) -> None:
        """Reject a change of a list that was passed on before."""
        self.visit(node)
        for name, change in self.changed:
            line = self.read.get(name, change.lineno)
            if line < change.lineno:
                self.writer.refuse(
                    change,
                    f"{name!r} must not change after it is sliced, passed on or renamed in line "
                    f"{self.writer.first + line - 1} or the loop there",
                )

    def visit_For(self, node: ast.For | ast.While) -> None:
        """Visit a loop, in which each read precedes the changes in the next iteration."""
        self.loops.append(node.lineno)
        self.generic_visit(node)
        self.loops.pop()

    visit_While = visit_For

    def visit_Subscript(self, node: ast.Subscript) -> None:
        """Visit a single sample, which is not another name for the list."""
        if not isinstance(node.value, ast.Name) or isinstance(node.slice, ast.Slice):
            self.generic_visit(node)
            return
        if isinstance(node.ctx, ast.Store):
            self.changed.append((node.value.id, node))
        self.visit(node.slice)

    def visit_Call(self, node: ast.Call) -> None:
        """Visit a call; calls of len, min and max keep no reference to the list."""
        keeps = not (isinstance(node.func, ast.Name) and node.func.id in ("len", "min", "max"))
        for each in (*node.args, *(keyword.value for keyword in node.keywords)):
            if keeps or not isinstance(each, ast.Name):
                self.visit(each)

    def visit_Name(self, node: ast.Name) -> None:
        """Note a list that is passed on."""
        if isinstance(node.ctx, ast.Load):
            first = min([node.lineno, *self.loops[:1]])
            self.read[node.id] = min(first, self.read.get(node.id, first))


def _zero(kind: Kind) -> str:
    return " = 0" if kind.is_number else " = {0}"


def _in(lines: Sequence[str]) -> list[str]:
    return [f"  {line}" for line in lines if line]


def _plain(value: Value) -> Value:
    return Value(f"{value.text}.value", value.kind.inner) if value.kind.is_wrapped else value


def _joint(one: Kind, other: Kind) -> Kind | None:
    """Return the common type of two alternatives; None if C has none."""
    if one == other:
        return one
    or_none = _NOTHING in (one, other) or one.or_none or other.or_none
    or_undefined = Undefined in (one.base, other.base) or one.or_undefined or other.or_undefined
    bases = {each.base for each in (one, other)} - {NoneType, Undefined}
    if len(bases) == 2 and bases <= _NUMBERS.keys():
        bases = {float} if float in bases else {int}
    if len(bases) > 1 or (or_none and or_undefined):
        return None
    base = next(iter(bases), Undefined)
    return Kind(base, or_none, or_undefined and base is not Undefined)


def _annotation(kind: Kind) -> str:
    """Return a type as in an annotation."""
    names: dict[type, str] = {list: "Samples", tuple: "tuple[float, float]", NoneType: "None"}
    beside = " | None" * kind.or_none + " | Undefined" * kind.or_undefined
    return names.get(kind.base, kind.base.__name__) + beside


def _short(node: ast.AST) -> str:
    text = " ".join(ast.unparse(node).split())
    return text if len(text) < 60 else f"{text[:57]}..."


_SIMPLE = {*_NUMBERS, list, tuple, Undefined, NoneType}
_BUILT_IN: dict[Any, list[tuple[tuple[Kind, ...], Kind, str]]] = {
    abs: [((FLOAT,), FLOAT, "__builtin_fabs")],
    bisect.bisect_left: [((SAMPLES, FLOAT), INT, "bw_bisect_left")],
    bisect.bisect_right: [((SAMPLES, FLOAT), INT, "bw_bisect_right")],
    float: [((INT,), FLOAT, "(double)"), ((FLOAT,), FLOAT, "")],
    len: [((SAMPLES,), INT, "bw_length")],
    list: [],
    math.isfinite: [((FLOAT,), BOOL, "bw_is_finite")],
    math.sqrt: [((FLOAT,), FLOAT, "__builtin_sqrt")],
    max: [
        ((SAMPLES,), FLOAT, "bw_largest"),
        ((FLOAT, FLOAT), FLOAT, "bw_larger"),
        ((INT, INT), INT, "bw_larger_int"),
    ],
    min: [
        ((SAMPLES,), FLOAT, "bw_least"),
        ((FLOAT, FLOAT), FLOAT, "bw_smaller"),
        ((INT, INT), INT, "bw_smaller_int"),
    ],
    range: [],
}
"""C forms of functions of Python: types of the arguments, type of the result, and name in C"""
