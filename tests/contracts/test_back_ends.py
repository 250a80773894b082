"""Contract: floats, NumPy arrays and CasADi symbols give one result."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from contracts.elements import all_functions, annotations
from contracts.sampling import Case, combinations, evaluate, traced

FUNCTIONS = all_functions()
SAMPLES = 30


def check_back_ends(function: Callable[..., Any]) -> None:
    """Refuse a function that depends on the type of its arguments."""
    arguments, _ = annotations(function)
    for choices in combinations(arguments):
        structure, matrix = Case(arguments, choices).matrix(SAMPLES)
        floats = np.array([evaluate(function, structure, column) for column in matrix.T.tolist()]).T
        arrays = evaluate(function, structure, matrix)
        column, results = traced(function, structure)
        symbols = ca.Function("f", [column], [results])(matrix).full()
        # A difference of large terms is as good as the terms: the row's largest value is scale.
        scale = np.abs(floats).max(axis=1, keepdims=True)
        for name, other in (("arrays", arrays), ("symbols", symbols)):
            off = np.abs(other - floats)
            assert np.all(off <= 1e-12 * scale), f"{name} differ from floats, {choices}: {off}"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_floats_arrays_and_symbols_agree(name: str) -> None:
    check_back_ends(FUNCTIONS[name])
