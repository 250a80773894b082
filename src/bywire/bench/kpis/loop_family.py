"""Key figures whose functions loop over samples: run in Python, or translated to C.

The names of a function's parameters determine its arguments:

* ``t``: the times [s];
* a field of the family's ``Setting`` that specifies a signal: its samples, or None if the
  annotation is ``Samples | None`` and the signal is not recorded;
* ``setting``: the ``Setting``, from which the function reads numbers;
* another function of the file: its result, which is computed once for all figures of a case. If it
  is undefined, the figure is undefined, too.

Functions receive only valid samples: at least two finite numbers at increasing times. A result that
is not finite, and a division by zero, leave the figure undefined.
"""

from __future__ import annotations

import ctypes
import inspect
import math
import re
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from functools import cache, cached_property
from pathlib import Path
from types import FunctionType, ModuleType, NoneType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bywire.bench.kpis.kpi import Kpi, Measure, Undefined
from bywire.bench.kpis.samples import Samples, defect_of_signal, defect_of_times, signal
from bywire.bench.kpis.translator import (
    BOOL,
    FIGURE,
    FLOAT,
    INT,
    PAIR,
    Kind,
    Unit,
    c_name,
    fields_of,
)
from bywire.core.errors import CompilerError, ModelError
from bywire.core.typing import Array
from bywire.simulation.compiler import find_compiler, load_library

if TYPE_CHECKING:
    import xarray as xr

    from bywire.bench.recording import Held

NO_NUMBER = "its value is not a finite number"
_NO_FIGURE = Undefined(NO_NUMBER)
_FLAGS = ("-O3", "-march=native")  # vectorizes loops over samples, without reordering sums
_FEW = 100_000  # rows: Python evaluates this many in a third of the compilation time
_NEGATIVE_ZERO = re.compile(r"-0(?![.\d])")
_HEADER = Path(__file__).with_name("loops.h")
_PACKED = (FLOAT, INT, BOOL, PAIR)
_ARGUMENTS = """const double *times, const bw_signal *signals,
    const double *settings, double *work, double *values, int32_t *reasons, double *numbers"""
# C++ has no literals of structures with their type in parentheses.
_LITERAL = re.compile(r"\((bw_\w+)\)(?=\{)")
_INCLUDE = re.compile(r"^#include.*$", re.M)
_SHARE = 4  # part of the device's free memory for the work arrays of its threads


class Reason(NamedTuple):
    """Reason why a figure is undefined: a template whose placeholders are numbers."""

    text: str
    is_open: bool


class FiguresInC(NamedTuple):
    """Figures of many cases: values, NaN where undefined, and the reasons.

    ``values`` and ``reasons``: shape ``(figures, cases)``; ``numbers``: those in the reasons'
    texts, ``(figures, cases, 3)``.
    """

    values: Array
    reasons: NDArray[np.int32]
    numbers: Array


class LoopFamily:
    """Functions of a family, with their arguments.

    Parameters
    ----------
    module
        Declares ``Setting`` and the figures.

    Raises
    ------
    ModelError
        When a function has an unknown argument.
    """

    def __init__(self, module: ModuleType) -> None:
        self.name = module.__name__.rpartition(".")[2]
        self.setting_class: type = module.Setting
        self.measures = {m.name: m for m in vars(module).values() if isinstance(m, Measure)}
        self.shared: dict[str, FunctionType] = {}  # in an order in which each follows its arguments
        self._module = module
        self._looked_at = 0  # rows of single runs
        self.is_on_device = True  # unless the compiler rejects it
        self._optional: dict[str, bool] = {}  # signals, and whether they may be missing
        for each in self.measures.values():
            self._take(each.__wrapped__)
        for each in self.measures.values():
            taken = self._parameters(each.__wrapped__)
            each.needs = tuple(name for name in taken if self._optional.get(name))

    @property
    def entry(self) -> str:
        """Name of the family's function in C."""
        return f"bw_{self.name}"

    @cached_property
    def signals(self) -> dict[str, bool]:
        """Whether the signal of each field of the setting may be missing, in the field's order."""
        names = [each.name for each in fields(self.setting_class)]
        return {name: self._optional[name] for name in names if name in self._optional}

    def signals_of(
        self, recording: xr.Dataset, setting: Any
    ) -> tuple[dict[str, Array | None], str]:
        """Return the signals by the setting's fields, None for a missing one, and the first's unit.

        Raises
        ------
        UnknownNameError
            When the recording does not contain a signal that the family needs.
        """
        signals: dict[str, Array | None] = {}
        level = "1"
        for place, (name, is_optional) in enumerate(self.signals.items()):
            signals[name] = None
            wanted = getattr(setting, name)
            if not is_optional or wanted in recording:
                signals[name], unit = signal(recording, wanted)
                level = level if place else unit
        return signals, level

    def kpi(self, figure: Measure, value: float | Undefined, setting: Any, level: str) -> Kpi:
        """Return a figure with its unit and note; ``level``: the unit of the first signal."""
        further = setting.units(level) if hasattr(setting, "units") else {}
        if isinstance(value, Undefined):
            text = _NEGATIVE_ZERO.sub("0", value.reason.replace("{level}", level))
            value = replace(value, reason=text)
        else:
            value += 0.0  # zeros are positive: C does not preserve their sign
        return figure.kpi(value, {"level": level, **further}, getattr(setting, "note", ""))

    # in Python

    def in_python(
        self, t: Samples, signals: Mapping[str, Samples | None], setting: Any
    ) -> dict[str, float | Undefined]:
        """Return the figures of one run by name; its signals by fields of the setting."""
        defects = (defect_of_signal(t, y) for y in signals.values() if y is not None)
        wrong = defect_of_times(t) or next((each for each in defects if each is not None), None)
        if wrong is not None:
            return dict.fromkeys(self.measures, wrong)
        given: dict[str, Any] = {"t": t, "setting": self._in_floats(setting), **signals}
        for name, function in self.shared.items():
            given[name] = self._given(function, given)
        figures = {n: self._given(each.__wrapped__, given) for n, each in self.measures.items()}
        return {
            name: value if isinstance(value, Undefined) or math.isfinite(value) else _NO_FIGURE
            for name, value in figures.items()
        }

    def _given(self, function: Callable[..., Any], given: Mapping[str, Any]) -> Any:
        """Return the result of a function."""
        args = [given[name] for name in inspect.signature(function).parameters]
        undefined = next((each for each in args if isinstance(each, Undefined)), None)
        if undefined is not None:
            return undefined
        try:
            return function(*args)
        except (ZeroDivisionError, OverflowError, ValueError):  # ValueError: a root
            return _NO_FIGURE

    def _in_floats(self, setting: Any) -> Any:
        """Return a setting with Python's numbers, as NumPy's numbers allow division by zero."""
        plain = {
            name: tuple(map(float, value)) if kind.base is tuple else kind.base(value)
            for name, kind in self._numbers.items()
            if (value := getattr(setting, name)) is not None
        }
        return replace(setting, **plain) if plain else setting

    # in C

    @cached_property
    def _unit(self) -> Unit:
        unit = Unit()
        unit.reason(NO_NUMBER, False)
        unit.function(defect_of_times)
        unit.function(defect_of_signal)
        for each in self._called:
            unit.function(each)
        return unit

    @cached_property
    def c_text(self) -> str:
        """The C of the family in one piece.

        Raises
        ------
        ModelError
            When a function cannot be translated.
        """
        return self._text(f"""void {self.entry}(int64_t cases, int64_t n, {_ARGUMENTS}) {{""")

    @cached_property
    def cuda_text(self) -> str:
        """The family's CUDA C, with a kernel that has one thread for each case."""
        from bywire.simulation.cuda import THREADS  # loads all of the code generation

        head = f"""KERNEL void __launch_bounds__({THREADS}) {self.entry}(const int64_t *sizes,
    {_ARGUMENTS}) {{
  const int64_t cases = sizes[0], n = sizes[1], first = sizes[2];
  const int64_t begin = first + (int64_t)blockIdx.x * blockDim.x + threadIdx.x;
  const int64_t end = begin < sizes[3] ? begin + 1 : begin;"""
        text = self._text(head, "begin", "end", f"work + (k - first) * n * {self.room}")
        return _LITERAL.sub(r"LITERAL(\1)", _INCLUDE.sub("", text))

    def _text(self, head: str, begin: str = "0", end: str = "cases", work: str = "work") -> str:
        """Return all functions, and one with a head that judges the cases from begin to end."""
        unit = self._unit
        lines = "\n".join(f"    {line}" for line in self._lines())
        return f"""{_HEADER.read_text(encoding="utf-8")}
{unit.text}
{head}
  const bw_figures to = {{values, reasons, numbers, cases}};
  const bw_samples t = {{times, n}};
  const bw_undefined of_times = {unit.function(defect_of_times).name}(t);
  for (int64_t k = {begin}; k < {end}; ++k) {{
    double *rest = {work}, **room = &rest;
    bw_undefined wrong = of_times;
{lines}
  }}
}}
"""

    def translate(self) -> None:
        """Translate all functions, so that errors in them appear early.

        Raises
        ------
        ModelError
            When a function cannot be translated.
        """
        assert self.c_text

    @cached_property
    def reasons(self) -> list[Reason]:
        """Reasons for undefined figures, in the order of their numbers in C, from 1 on."""
        self.translate()
        return [Reason(*each) for each in self._unit.reasons]

    @cached_property
    def room(self) -> int:
        """Size of the work array in C for one case, in numbers per sample."""
        return sum(self._unit.function(each).arrays for each in self._called)

    @cached_property
    def _numbers(self) -> dict[str, Kind]:
        """Types of the numbers in a setting, by field."""
        kinds = fields_of(self.setting_class)
        return {name: kind for name, kind in kinds.items() if kind.inner in _PACKED}

    def packed(self, setting: Any) -> list[float]:
        """Return the numbers of a setting in the layout of C."""
        row: list[float] = []
        for name, kind in self._numbers.items():
            value = getattr(setting, name)
            if kind.or_none:
                row.append(float(value is not None))
            if kind.inner == PAIR:
                row.extend(map(float, (0.0, 0.0) if value is None else value))
            else:
                row.append(0.0 if value is None else float(value))
        return row

    def _lines(self) -> Iterator[str]:
        """Yield the C statements for a case."""
        unit, defect = self._unit, self._unit.function(defect_of_signal).name
        yield "(void)settings, (void)signals, (void)room;"
        for place, (name, is_optional) in enumerate(self.signals.items()):
            case = f"bw_case(&signals[{place}], k, n)"
            there = f"signals[{place}].first"
            if is_optional:
                kind = unit.ctype(Kind(list, or_none=True))
                yield f"const {kind} s_{name} = {{{there} ? {case} : t, {there} != 0}};"
            else:
                yield f"const bw_samples s_{name} = {case};"
            value = f"s_{name}.value" if is_optional else f"s_{name}"
            yield f"if (!wrong.reason && {there}) wrong = {defect}(t, {value});"
        yield "if (wrong.reason) {"
        yield f"  for (int64_t j = 0; j < {len(self.measures)}; ++j)"
        yield "    bw_give(&to, j, k, 0.0, wrong, 1);"
        yield "  continue;"
        yield "}"
        if any("setting" in self._parameters(each) for each in self._called):
            yield from self._setting_lines()
        for name, function in self.shared.items():
            made = unit.function(function)
            yield f"{unit.ctype(made.returns)} s_{name} = {{0}};"
            none, call = self._call(function)
            yield f"const bw_undefined n_{name} = {none};"
            yield f"if (!n_{name}.reason) s_{name} = {call};"
        for place, measure in enumerate(self.measures.values()):
            yield from self._give_lines(place, measure)

    def _give_lines(self, place: int, measure: Measure) -> Iterator[str]:
        function = measure.__wrapped__
        none, call = self._call(function)
        returns = self._unit.function(function).returns
        yield "{"
        yield f"  bw_undefined none = {none};"
        if returns == FIGURE:
            yield f"  {self._unit.ctype(returns)} given = {{0}};"
            yield f"  if (!none.reason) given = {call}, none = given.none;"
            yield f"  bw_give(&to, {place}, k, given.value, none, 1);"
        else:
            yield f"  bw_give(&to, {place}, k, none.reason ? 0.0 : (double){call}, none, 1);"
        yield "}"

    def _call(self, function: Callable[..., Any]) -> tuple[str, str]:
        """Return C expressions: why an argument of a function is undefined, and its call."""
        made = self._unit.function(function)
        args, none = ["room"] if made.arrays else [], "(bw_undefined){0}"
        for name in reversed(self._parameters(function)):
            if name in self.shared:
                given = self._unit.function(self.shared[name]).returns
                own = f"s_{name}.none" if given.or_undefined else none
                none = f"n_{name}.reason ? n_{name} : {own}.reason ? {own} : {none}"
        for name, kind in made.parameters.items():
            is_wrapped = name in self.shared and (
                self._unit.function(self.shared[name]).returns.or_undefined
            )
            text = "t" if name == "t" else f"s_{name}"
            if kind.or_none and self.signals.get(name) is False:  # others need it
                text = f"({self._unit.ctype(kind)}){{{text}, 1}}"
            args.append(f"{text}.value" if is_wrapped else text)
        return none, f"{made.name}({', '.join(args)})"

    def _setting_lines(self) -> Iterator[str]:
        """Yield the setting of a case, from its row of numbers."""
        place, made = 0, []
        for name, kind in self._numbers.items():
            there = f"row[{place}]"
            place += kind.or_none
            value = f"row[{place}]"
            place += 1
            if kind.inner == PAIR:
                value = f"{{{{row[{place - 1}], row[{place}]}}}}"
                place += 1
            whole = f"{{{value}, {there} != 0.0}}" if kind.or_none else value
            made.append(f".{c_name(name)} = {whole}")
        yield f"const double *row = settings + {place} * k;"
        setting = self._unit.ctype(Kind(self.setting_class))
        yield f"const {setting} s_setting = {{{', '.join(made)}}};"

    @cached_property
    def _function(self) -> Any:
        """The compiled function; None without a compiler."""
        return _compiled(self.c_text, self.entry)

    @property
    def is_compiled(self) -> bool:
        """Whether the family's C can be compiled here."""
        return self._function is not None

    def is_worth_c(self, rows: int) -> bool:
        """Return whether to compute another run in C: compiling pays off after many rows."""
        self._looked_at += rows
        return self._looked_at > _FEW and self.is_compiled

    def in_c(
        self, t: Array, signals: Sequence[Array | None], settings: Sequence[Any]
    ) -> FiguresInC:
        """Return the figures of many cases.

        Parameters
        ----------
        t
            Times [s], shape ``(n,)``.
        signals
            Signals in the order of ``self.signals``, shape ``(cases, n)``; None for a missing one.
        settings
            Setting of each case.
        """
        kept = [None if each is None else _in_rows(each) for each in signals]
        places = [(0, 0) if y is None else (y.ctypes.data, y.strides[0] // 8) for y in kept]
        given, made = self._arrays(t, places, settings)
        work = np.empty(max(1, self.room * t.size))
        arrays = (*given, work, *made)
        self._function(len(settings), t.size, *(each.ctypes.data for each in arrays))
        made.values[:] += 0.0  # zeros are positive: C does not preserve their sign
        return made

    def on_device(
        self, t: Array, held: Held, signals: Sequence[str | None], settings: Sequence[Any]
    ) -> FiguresInC:
        """Return the figures of many cases whose rows a graphics processor holds; see `in_c`.

        ``signals``: names of the signals in the order of ``self.signals``; None for a missing one.
        """
        from bywire.simulation.cuda import THREADS  # loads all of the code generation

        cases, n, device = len(settings), t.size, held.rows.device
        places = [(0, 0) if each is None else (held.address(each), n) for each in signals]
        given, made = self._arrays(t, places, settings)
        figures: tuple[NDArray[Any], ...] = made
        function = device.load(self.cuda_text, self.entry)
        with device.working() as memory:
            there = [memory.room(each.nbytes) for each in given]
            results = [memory.room(each.nbytes) for each in figures]
            sizes = memory.room(32)
            for place, each in zip(there, given, strict=True):
                memory.put(place, each)
            size = max(8 * self.room * n, 8)
            together = min(cases, max(device.free() // (_SHARE * size), 1))
            work = memory.room(together * size)
            for first in range(0, cases, together):
                end = min(first + together, cases)
                memory.put(sizes, np.array([cases, n, first, end]))
                arguments = (sizes, *there, work, *results)
                memory.run(function, -(-(end - first) // THREADS), THREADS, arguments)
            for place, each in zip(results, figures, strict=True):
                memory.get(place, each)
        made.values[:] += 0.0
        return made

    def _arrays(
        self, t: Array, places: Sequence[tuple[int, int]], settings: Sequence[Any]
    ) -> tuple[tuple[NDArray[Any], ...], FiguresInC]:
        """Return the arguments of the function in C before its work array, and its results.

        ``places``: address and distance of the cases of each signal; zero for a missing one.
        """
        distinct = {id(each): each for each in settings}  # mostly one
        rows = {number: self.packed(each) for number, each in distinct.items()}
        packed = np.array([rows[id(each)] for each in settings], dtype=np.float64).reshape(-1)
        shape = len(self.measures), len(settings)
        given = (
            np.ascontiguousarray(t, dtype=np.float64),
            np.array(places or [(0, 0)], dtype=np.int64),
            packed,
        )
        reasons, numbers = np.empty(shape, dtype=np.int32), np.empty((*shape, 3))
        return given, FiguresInC(np.empty(shape), reasons, numbers)

    def undefined(self, reason: int, numbers: Sequence[float]) -> Undefined:
        """Return an `Undefined` for a number of a reason in C."""
        text, is_open = self.reasons[reason - 1]
        return Undefined(text.format(*numbers), is_open)

    # arguments of functions

    @property
    def _called(self) -> list[Callable[..., Any]]:
        return [*self.shared.values(), *(each.__wrapped__ for each in self.measures.values())]

    def _parameters(self, function: Callable[..., Any]) -> list[str]:
        return list(inspect.signature(function).parameters)

    def _take(self, function: Callable[..., Any], *above: object) -> None:
        """Add the signals and functions that are a function's arguments; ``above``: its callers."""
        hints = typing.get_type_hints(function)
        settings = typing.get_type_hints(self.setting_class)
        for name in self._parameters(function):
            beside = vars(self._module).get(name)
            if name in ("t", "setting") or name in self.shared:
                continue
            if settings.get(name) is str:
                is_optional = NoneType in typing.get_args(hints.get(name))
                self._optional[name] = self._optional.get(name, True) and is_optional
            elif isinstance(beside, FunctionType) and beside not in (function, *above):
                self._take(beside, function, *above)
                self.shared[name] = beside
            else:
                raise ModelError(
                    f"{self._module.__file__}: {name!r} is not a valid parameter of the key "
                    f"figure's function {function.__name__}. Parameters must be t, setting, a "
                    "field of Setting that names a signal, or another function of the file",
                    name=function.__name__,
                    value=name,
                    valid="t, setting, a field of Setting that names a signal, or another "
                    "function of the file",
                )


@cache
def _compiled(text: str, entry: str) -> Any:
    """Return a family's function, compiled; None without a compiler."""
    compiler = find_compiler()
    if compiler is None:
        return None
    try:
        library, _ = load_library(text, _FLAGS, compiler, entry)
    except CompilerError:
        return None
    function = getattr(library, entry)
    function.argtypes = [ctypes.c_int64, ctypes.c_int64, *[ctypes.c_void_p] * 7]
    function.restype = None
    return function


def _in_rows(y: Array) -> Array:
    """Return signals in which the samples of each case are contiguous."""
    is_so = y.dtype == np.float64 and y.strides[1] == 8 and y.strides[0] % 8 == 0
    return y if is_so else np.ascontiguousarray(y, dtype=np.float64)
