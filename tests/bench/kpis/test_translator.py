"""Loops in Python and in C give the same bits; unsupported constructs are rejected by line."""

from __future__ import annotations

import importlib
import linecache
import math
import re
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bywire.bench.kpis.kpi import Undefined
from bywire.bench.kpis.loop_family import NO_NUMBER, LoopFamily
from bywire.core.errors import ModelError
from bywire.simulation.compiler import find_compiler
from raising import raises

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="there is no C compiler")

HEAD = '''
"""Figures of a test."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import NamedTuple

from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import Samples, integral, moving_average

LEVEL = 0.5
WORDS = "its words"


@dataclass(frozen=True)
class Setting:
    """The signal."""

    y: str = "y"
    other: str = "other"
    level: float = 0.25
    count: int = 3
    is_odd: bool = True
    least: float | None = None
    window: tuple[float, float] | None = None


class Pair(NamedTuple):
    """Two numbers, one by default."""

    low: float
    high: float = 2.0


'''

Write = Callable[..., LoopFamily]


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Return a function that creates a family from the source of functions."""

    def write(*functions: str) -> LoopFamily:
        file = tmp_path / "written.py"
        file.write_text(HEAD + "\n\n".join(textwrap.dedent(each) for each in functions))
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.delitem(sys.modules, "written", raising=False)
        importlib.invalidate_caches()
        linecache.clearcache()
        module = importlib.import_module("written")
        monkeypatch.delitem(sys.modules, "written")
        monkeypatch.setitem(sys.modules, "written", module)
        return LoopFamily(module)

    return write


def figure(body: str, takes: str = "t: Samples, y: Samples, setting: Setting") -> str:
    """Return a figure with a body."""
    lines = textwrap.indent(textwrap.dedent(body).strip(), "    ")
    return f'@measure("1")\ndef f({takes}) -> float | Undefined:\n    """F."""\n{lines}\n'


COMPUTED = {
    "loops": """
        whole = 0.0
        for k in range(2, len(y), 2):
            if y[k] < 0.0:
                continue
            if whole > 3.0:
                break
            whole += y[k] * (k - 1) / 2
        for k in range(len(y) - 1, 0, -1):
            whole -= y[k]
        for k in range(len(y) - 1, 2, -3):
            whole -= k * y[k]
        for x in y:
            whole += x
        return whole
    """,
    "whole numbers": """
        k = -7
        n = 0
        while k < 8:
            n += (k // 2) * 3 + (k // -3)
            k += 1
        n += y[0] > 0.0
        n -= not y[0] > 0.0
        return n / 4 + float(n) + (3 if n > 2 else 4)
    """,
    "choices": """
        a = y[0] if y[0] > y[1] else y[1]
        b = min(a, y[2], ) if 0.0 < a <= 1.0 or not a != y[0] else max(y[2], LEVEL)
        if a < b and isfinite(a):
            return a
        elif a == b:
            return -b
        else:
            return abs(a - b)
    """,
    "extremes": "return max(y) - min(y) + max(0, len(y) - 50) + sqrt(abs(y[-1]) + 1)",
    "slices": """
        k = bisect_left(t, setting.level)
        n = bisect_right(t[k:], 3.0 * setting.level)
        late = y[k : k + n]
        end = y[-3:][:99]
        whole = integral(t[k:][:n], late) + late[-1] if len(late) > 0 else 0.0
        return whole + max(end) + len(end) + len(y[5:-2]) + len(y[9:4]) + min(y[-99:2])
    """,
    "lists": """
        twice = [2.0 * x for x in y[1:]]
        rise = [y[k + 1] - y[k] for k in range(len(y) - 1)]
        odd = [y[k] for k in range(1, len(y))]
        whole = [0.0] * len(y)
        for k in range(1, len(y)):
            whole[k] = whole[k - 1] + rise[k - 1]
            whole[k] += 0.5
        moved = list(y)
        moved[0] = 7.0
        return integral(t, whole) + max(twice) + moved[0] + moved[-1] + odd[0] + len(odd)
    """,
    "functions that make lists": """
        whole = 0.0
        for x in moving_average(t, y, 0.1)[1:]:
            whole += x
        size = [abs(x) for x in moving_average(t, y, 0.2)]
        return whole + max(size) + moving_average(t, y, 0.3)[-1] + moving_average(t, y, 1.0)[2]
    """,
    "nothing": """
        least = 0.0 if setting.least is None else setting.least
        known: float | None = None
        if setting.window is not None:
            known = setting.window[0] + setting.window[1]
        if known is None:
            return least + setting.count + (1.0 if setting.is_odd else 2.0)
        return known + least
    """,
    "undefined": """
        if y[0] > 0.5:
            return Undefined(f"{y[0]:.3g} of {len(y)} {{level}} {LEVEL:g}", is_open=True)
        return Undefined(WORDS) if y[0] > 0.0 else y[0]
    """,
    "division by zero": "return 1.0 / (y[0] - y[0])",
    "root of less than nothing": "return sqrt(min(y) - 100.0)",
    "no number": "return math.nan",
}


@needs_compiler
@pytest.mark.parametrize("body", COMPUTED.values(), ids=COMPUTED.keys())
@pytest.mark.parametrize(
    "setting", [{}, {"least": -2.5, "window": (0.2, 0.4), "is_odd": False, "count": 5}]
)
def test_c_computes_what_python_does(written, body, setting):
    assert_alike(written(figure(body)), np.random.default_rng(2), setting)


def assert_alike(family, random, setting):
    """Run a family in both languages on coarse samples."""
    assert family.is_compiled
    n = 23
    t = np.cumsum(random.choice([0.01, 0.05], n)) - 0.1
    y = np.round(random.standard_normal((12, n)), 1)
    chosen = family.setting_class(**setting)
    present = {"y": y, "other": y + 1.0}
    made = family.in_c(t, [present.get(name) for name in family.signals], [chosen] * len(y))
    for k, row in enumerate(y):
        lists = {name: present[name][k].tolist() for name in family.signals}
        expected = family.in_python(t.tolist(), lists, chosen)
        for place, value in enumerate(expected.values()):
            reason = int(made.reasons[place, k])
            if isinstance(value, Undefined):
                assert family.undefined(reason, made.numbers[place, k].tolist()) == value
            else:
                assert reason == 0
                assert made.values[place, k] == value, row


@needs_compiler
def test_what_functions_share_is_computed_once_and_may_be_undefined(written):
    family = written(
        """
        def pair(y: Samples, setting: Setting) -> Pair | Undefined:
            if y[0] > 0.0:
                return Undefined(f"above by {y[0]:g}")
            return Pair(y[0]) if y[1] > 0.0 else Pair(high=y[1], low=0.0)


        def double(register: float, default: float) -> float | Undefined:
            if register > 1.0:
                return Undefined("too much")
            return 2.0 * register + default


        def spread(pair: Pair) -> float:
            return pair.high - pair.low


        def why(x: float) -> Undefined | None:
            if x > 1.5:
                return Undefined("why not", is_open=True)
            return None
        """,
        """
        @measure("1")
        def first(spread: float) -> float:
            \"\"\"First.\"\"\"
            return spread


        @measure("1")
        def second(pair: Pair, y: Samples, other: Samples | None) -> float | Undefined:
            \"\"\"Second.\"\"\"
            none = why(y[2])
            if none is not None:
                return none
            twice = double(pair.low + y[2], 1.0)
            if isinstance(twice, Undefined):
                return twice
            return twice + (0.0 if other is None else other[0])
        """,
    )
    assert family.signals == {"y": False, "other": True}
    assert family.measures["second"].needs == ("other",)
    assert_alike(family, np.random.default_rng(3), {})


REFUSED = {
    "power": ("return y[0] ** 2", 0, "arithmetic is + - * /"),
    "sine": ("return math.sin(y[0])", 0, "it can call functions of this kind"),
    "else of a loop": ("for x in y:\n    pass\nelse:\n    return 1.0\nreturn 0.0", 0, "else"),
    "try": ("try:\n    return y[0]\nfinally:\n    pass", 0, "valid statements are"),
    "a number as condition": ("if len(y):\n    return 1.0\nreturn 0.0", 0, "must be a bool"),
    "a narrowing": ("k = 0\nk = y[0]\nreturn 1.0 * k", 1, "it is float, but it must be int"),
    "a counter that moves": ("for k in range(9):\n    k = 3\nreturn 0.0", 1, "a loop counter"),
    "a counter after its loop": (
        "for k in range(9):\n    pass\nreturn 1.0 * k",
        2,
        "it has no value here",
    ),
    "a list in a loop": ("for k in range(9):\n    z = list(y)\nreturn 0.0", 1, "within a loop"),
    "a signal that is changed": ("y[0] = 1.0\nreturn y[0]", 0, "only a list created in this"),
    "a list that is changed late": (
        "z = list(y)\na = z[1:]\nz[2] = 9.0\nreturn a[1]",
        2,
        "sliced, passed on or renamed",
    ),
    "a list that a loop hands on": (
        "z = list(y)\nfor k in range(9):\n    z[k] = 1.0\n    a = integral(t, z)\nreturn 0.0",
        2,
        "or the loop there",
    ),
    "a list of any length": ("z = [0.0] * 999\nreturn z[0]", 0, "one number per sample"),
    "a list of other numbers": ("z = [1.0] * len(y)\nreturn z[0]", 0, "must start as [0.0]"),
    "a text": ("return 1.0 if setting.y == 'y' else 0.0", 0, "'y' is not a field with a C type"),
    "a text of parts": ("return Undefined('a' + WORDS)", 0, "write the text as one"),
    "a number without format": ("return Undefined(f'{y[0]}')", 0, "numbers such as"),
    "too many numbers": (
        "return Undefined(f'{y[0]:g} {y[0]:g} {y[0]:g} {y[0]:g}')",
        0,
        "at most 3 numbers",
    ),
    "a list in a comparison": (
        "return 1.0 if 0.0 < max(moving_average(t, y, 1.0)) < 1.0 else 0.0",
        0,
        "assign the middle number",
    ),
    "infinity": ("return math.inf", 0, "a constant must be a finite number"),
    "a name in several": ("a = b = 1.0\nreturn a", 0, "valid statements are"),
    "a sum": ("return sum(y)", 0, "`sum(y)` in C: it can call functions"),
    "a starred call": ("return integral(*[t, y])", 0, "without * and **"),
    "what is never nothing": ("return 1.0 if y is None else 0.0", 0, "this value is never None"),
    "a lambda": ("f = lambda x: x\nreturn 0.0", 0, "may compute this expression"),
    "an unknown name": ("return unknown", 0, "it has no value here"),
}


@pytest.mark.parametrize(("body", "line", "why"), REFUSED.values(), ids=REFUSED.keys())
def test_what_has_no_translation_is_refused_with_its_line(written, body, line, why):
    family = written(figure(body))
    before = HEAD.count("\n") + 3  # decorator, head and docstring
    with pytest.raises(ModelError, match=re.escape(why)) as caught:
        family.translate()
    assert f"written.py, line {before + line + 1}, in f: " in str(caught.value)


def test_a_function_that_calls_itself_and_an_unknown_type_are_refused(written):
    again = "def g(x: float) -> float:\n    return g(x)\n"
    with pytest.raises(ModelError, match="must not call itself"):
        written(again, figure("return g(y[0])")).translate()
    with pytest.raises(ModelError, match="the type of 'x' is <class 'str'>"):
        written("def g(x: str) -> float:\n    return 1.0\n", figure("return g('a')")).translate()
    with raises(ModelError, name="f", value="z", valid="t, setting, a field of Setting"):
        written(figure("return 1.0", "z: Samples"))


def test_python_alone_leaves_a_figure_undefined_that_divides_by_zero(written):
    family = written(figure("return 1.0 / (y[0] - y[0])"))
    (given,) = family.in_python([0.0, 1.0], {"y": [1.0, 2.0]}, family.setting_class()).values()
    assert given == Undefined(NO_NUMBER)
    (given,) = family.in_python([0.0, 1.0], {"y": [1.0, math.inf]}, None).values()
    assert given == Undefined("not a number at 1 s")
