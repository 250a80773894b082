"""Exponential, logarithm, power, sine and cosine of floats: bit-identical to kernels."""

from __future__ import annotations

import ctypes
import math
from fractions import Fraction

import numpy as np
import pytest

from bywire.core import elementary, ops
from bywire.core.elementary import EXPONENTIAL
from bywire.simulation.c_runtime import SCALAR
from bywire.simulation.compiler import PLAIN, compile_library, find_compiler

RNG = np.random.default_rng(5)
ANGLES = [*RNG.uniform(-9.0, 9.0, 400), *RNG.uniform(-1e5, 1e5, 200), 0.78, -0.0, 1e-300]
POSITIVE = [*10.0 ** RNG.uniform(-290.0, 290.0, 300), *RNG.uniform(0.5, 2.0, 300), 1.0]
POINTS = {
    "exp": [(x,) for x in (*RNG.uniform(-710.0, 710.0, 500), *RNG.uniform(-1.0, 1.0, 200))],
    "log": [(a,) for a in POSITIVE],
    "sin": [(x,) for x in ANGLES],
    "cos": [(x,) for x in ANGLES],
    "pow": list(zip(POSITIVE, RNG.uniform(-1.0, 1.0, len(POSITIVE)), strict=True)),
}
OURS = {"exp": ops.exp, "log": ops.log, "sin": ops.sin, "cos": ops.cos, "pow": ops.power}


@pytest.fixture(scope="module")
def kernel() -> ctypes.CDLL:
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("there is no C compiler")
    calls = "".join(
        f"double call_{name}({', '.join(f'double {v}' for v in 'ab'[: len(rows[0])])})"
        f" {{ return bw_{name}({', '.join('ab'[: len(rows[0])])}); }}\n"
        for name, rows in POINTS.items()
    )
    return ctypes.CDLL(str(compile_library(SCALAR + calls, PLAIN, compiler)))


@pytest.mark.parametrize("name", POINTS)
def test_floats_are_those_of_kernels(name: str, kernel: ctypes.CDLL) -> None:
    function = getattr(kernel, f"call_{name}")
    function.restype = ctypes.c_double
    for point in POINTS[name]:
        assert OURS[name](*map(float, point)) == function(*map(ctypes.c_double, point)), point


@pytest.mark.parametrize("name", POINTS)
def test_floats_are_right(name: str) -> None:
    exact = getattr(math, name)
    for point in POINTS[name]:
        if name == "exp" and not -708.0 <= point[0] <= 709.0:
            continue
        expected = exact(*point)
        assert math.isclose(OURS[name](*point), expected, rel_tol=5e-16, abs_tol=2e-16), point


def test_the_exponentials_series_is_near_the_exponential() -> None:
    """In rational numbers, against Taylor's series to r^20."""
    coefficients = [Fraction(1), Fraction(1), Fraction(1, 2), *map(Fraction, EXPONENTIAL)]
    for n in range(-30, 31):
        r = Fraction(math.log(2.0) / 2.0) * n / 30
        exact = sum(r**k / math.factorial(k) for k in range(21))
        assert abs(sum(c * r**k for k, c in enumerate(coefficients)) / exact - 1) < 6e-18


def test_large_angles_lose_no_more_than_their_last_digit() -> None:
    for x in 10.0 ** RNG.uniform(5.0, 11.0, 300):
        assert abs(elementary.sin(x) - math.sin(x)) <= 0.25 * math.ulp(x)
    assert elementary.cos(1e15) == 1.0


def test_what_is_no_number_stays_so() -> None:
    for function in (ops.exp, ops.log, ops.sin, ops.cos):
        assert math.isnan(function(math.nan))
    assert (ops.exp(1), ops.power(2, 3), ops.power(0, 0.5)) == (math.e, 8.0, 0.0)
    for refused in (lambda: ops.log(0.0), lambda: ops.sin(math.inf), lambda: ops.power(0.0, -1.0)):
        with pytest.raises(ValueError, match=r"math domain error|expected a"):
            refused()


@pytest.mark.parametrize(("name", "most"), [("sin", 9000.0), ("cos", 9000.0), ("exp", 87.0)])
def test_single_precision_is_right_to_its_last_digits(name: str, most: float) -> None:
    eps = float(np.finfo(np.float32).eps)
    for x in map(np.float32, (*RNG.uniform(-most, most, 200), *RNG.uniform(-2.0, 2.0, 200))):
        found, exact = OURS[name](x), getattr(math, name)(float(x))
        assert isinstance(found, np.float32)
        own = 0.25 * float(np.spacing(abs(x))) if abs(x) > 8192.0 else 0.0
        assert abs(float(found) - exact) <= eps * max(abs(exact), 1.0) + own, x
