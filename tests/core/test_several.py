"""Numbers of several cases: the results of floats, and errors wherever cases would be mixed up."""

import math
from itertools import pairwise

import numpy as np
import pytest

from bywire.core import ops
from bywire.core.several import DifferError, Several

X = [0.3, 1.0, 1.7, 250.0]
Y = [2.0, 0.3, 1.7, 1e-3]


def computed(x, y):
    """Return results of all operations, in any kind of number."""
    yield from (x + y, 2 - x, x * y, 3 / x, x / y, x**2, 2.0**x, -x, abs(y - x), +x)
    yield from (ops.exp(x - y), ops.log(x), ops.sqrt(x), ops.sin(x), ops.cos(y), ops.arctan(y))
    yield from (ops.fmax(x, y), ops.fmin(x, 1.0), ops.fabs(x - y), ops.floor(x), ops.power(x, y))
    yield from (ops.clip(x, 0.5, y), ops.where(x < y, x, 1.0), ops.where(x != y, y, x))
    yield ops.interpolate(x, (0.0, 1.0, 3.0), (y, 2.0, 5.0))


def test_each_case_has_the_result_of_its_float():
    together = [each.values for each in computed(Several(np.array(X)), Several(np.array(Y)))]
    alone = np.array([list(computed(x, y)) for x, y in zip(X, Y, strict=True)], dtype=float).T
    assert [each.tobytes() for each in together] == [each.tobytes() for each in alone]


def test_a_branch_that_all_cases_take_is_taken():
    x = Several(np.array(X))
    assert x > 0.2
    assert x != 0.5
    assert max(x, 0.1) is x
    assert all(a < b for a, b in pairwise((0.0, x, 1e3)))


def test_cases_that_branch_differently_are_told():
    with pytest.raises(DifferError) as error:
        min(Several(np.array(X)), 1.2)
    assert error.value.where.tolist() == [False, False, True, True]


@pytest.mark.parametrize(
    "single",
    [
        float,
        math.sqrt,
        str,
        hash,
        round,
        list,
        np.asarray,
        lambda x: f"{x:g}",
        lambda x: x / 0.0,
        lambda x: x % 2,
        lambda x: x + np.ones(4),
        lambda x: np.ones(4) * x,
        lambda x: np.where(np.ones(4) > 0, x, 0.0),
        lambda x: np.full(4, x),
        lambda x: ops.sqrt(-x),
        lambda x: (0.0 * x) ** -1.0,
    ],
)
def test_what_needs_a_single_number_is_refused(single):
    with pytest.raises(TypeError):
        single(Several(np.array(X)))
