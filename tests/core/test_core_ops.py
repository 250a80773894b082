"""Elementary functions give the same number for all kinds of arguments."""

from __future__ import annotations

import math
import subprocess
import sys

import casadi as ca
import numpy as np
import pytest

from bywire.core import ops

ONE = {
    "exp": (ops.exp, math.exp, (-700.0, -1.5, 0.0, 2.5, 700.0)),
    "decay": (ops.decay, lambda x: math.exp(-x) if x < 40 else 0.0, (0.0, 0.5, 39.9, 40.0, 1e6)),
    "log": (ops.log, math.log, (1e-300, 0.5, 1.0, 7.0)),
    "sqrt": (ops.sqrt, math.sqrt, (0.0, 0.25, 2.0, 1e300)),
    "sin": (ops.sin, math.sin, (-7.0, 0.0, 1.0)),
    "cos": (ops.cos, math.cos, (-7.0, 0.0, 1.0)),
    "fabs": (ops.fabs, abs, (-2.5, -0.0, 3.0)),
    "floor": (ops.floor, math.floor, (-2.5, -2.0, 0.0, 2.999)),
    "clip": (lambda x: ops.clip(x, -1.0, 2.0), lambda x: min(max(x, -1), 2), (-9, -1, 0.5, 2, 9)),
    "where": (
        lambda x: ops.where(x >= 1.0, x + 1.0, -x),
        lambda x: x + 1 if x >= 1 else -x,
        (0.0, 0.999, 1.0, 5.0),
    ),
    "interpolate": (
        lambda x: ops.interpolate(x, (0.0, 1.0, 3.0), (1.0, 2.0, -2.0)),
        lambda x: float(np.interp(x, (0.0, 1.0, 3.0), (1.0, 2.0, -2.0))),
        (-5.0, 0.0, 0.25, 1.0, 2.0, 3.0, 9.0),
    ),
}
TWO = {
    "fmax": (ops.fmax, max, ((1.0, 2.0), (2.0, 1.0), (-0.5, -0.5))),
    "fmin": (ops.fmin, min, ((1.0, 2.0), (2.0, 1.0), (-0.5, -0.5))),
    "power": (ops.power, math.pow, ((0.0, 0.5), (2.0, 0.3), (9.0, -0.5), (3.0, 0.0))),
}
CALLS = {
    **{name: (f, exact, [(x,) for x in xs]) for name, (f, exact, xs) in ONE.items()},
    **TWO,
}


def close(found, expected):
    """Compare numbers with the exact values."""
    np.testing.assert_allclose(np.asarray(found, dtype=float), expected, rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize("name", CALLS)
def test_floats(name):
    function, exact, points = CALLS[name]
    for point in points:
        found = function(*map(float, point))
        assert isinstance(found, (float, int))
        close(found, exact(*point))


@pytest.mark.parametrize("kind", [int, np.float64, np.float32, np.int64])
def test_other_plain_numbers(kind):
    assert ops.fmax(kind(1), kind(2)) == 2
    assert ops.clip(kind(5), 0.0, 2.0) == 2.0
    assert float(ops.exp(kind(1))) == pytest.approx(math.e, rel=1e-6)
    assert ops.where(kind(1) > 0, 1.0, 2.0) == 1.0


@pytest.mark.parametrize("name", CALLS)
def test_arrays(name):
    function, exact, points = CALLS[name]
    columns = [np.array(column, dtype=float) for column in zip(*points, strict=True)]
    found = function(*columns)
    assert isinstance(found, np.ndarray)
    assert found.shape == columns[0].shape
    close(found, [exact(*point) for point in points])


@pytest.mark.parametrize("symbol", [ca.SX, ca.MX], ids=["SX", "MX"])
@pytest.mark.parametrize("name", CALLS)
def test_symbols(name, symbol):
    function, exact, points = CALLS[name]
    arguments = [symbol.sym(f"x{k}") for k in range(len(points[0]))]
    graph = ca.Function("graph", arguments, [function(*arguments)])
    for point in points:
        close(float(graph(*point)), exact(*point))


@pytest.mark.parametrize("name", CALLS)
def test_a_symbol_may_stand_anywhere(name):
    function, exact, points = CALLS[name]
    for place in range(len(points[0])):
        x = ca.SX.sym("x")
        mixed = [x if k == place else value for k, value in enumerate(points[0])]
        graph = ca.Function("graph", [x], [function(*mixed)])
        close(float(graph(points[0][place])), exact(*points[0]))


class Traced:
    """A number with its own operations, like numbers with units."""

    def __init__(self, value: float) -> None:
        self.value = value
        self.calls: list[str] = []

    def _bywire_op(self, name, *arguments):
        self.calls.append(name)
        return Traced(getattr(ops, name)(*(getattr(a, "value", a) for a in arguments)))


@pytest.mark.parametrize("name", [*TWO, "exp", "log", "sqrt", "sin", "cos", "fabs", "floor"])
def test_objects_with_operations_of_their_own(name):
    function, exact, points = CALLS[name]
    for point in points:
        number = Traced(float(point[0]))
        found = function(number, *point[1:])
        assert number.calls == [name]
        close(found.value, exact(*point))


def test_interpolation_needs_no_more_than_one_node():
    assert ops.interpolate(3.0, (1.0,), (7.0,)) == 7.0


def test_clip_keeps_the_order_of_its_bounds():
    assert ops.clip(0.0, 1.0, 2.0) == 1.0
    assert ops.clip(3.0, 1.0, 2.0) == 2.0
    assert ops.clip(-0.0, 0.0, 1.0) == 0.0


def test_floats_need_no_casadi():
    code = (
        "import sys; from bywire.core import ops;"
        "ops.interpolate(ops.exp(1.0), (0.0, 1.0), (0.0, 1.0));"
        "sys.exit('casadi' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
