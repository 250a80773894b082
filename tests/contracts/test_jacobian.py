"""Contract: the derivatives that the solvers take are those of the function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from contracts.elements import all_functions, annotations
from contracts.sampling import Case, combinations, evaluate, flattened, traced

FUNCTIONS = all_functions()
SAMPLES = 30
STEP = 1e-6  # of the nominal value
TOLERANCE = 1e-7


def check_jacobian(function: Callable[..., Any]) -> None:
    """Refuse a function whose symbolic Jacobian is not its slope, away from kinks."""
    arguments, _ = annotations(function)
    for choices in combinations(arguments):
        case = Case(arguments, choices)
        structure, matrix = case.matrix(SAMPLES)
        column, results = traced(function, structure)
        shape = (results.numel(), column.numel(), SAMPLES)
        compiled = ca.Function("J", [column], [ca.vec(ca.densify(ca.jacobian(results, column)))])
        exact = compiled(matrix).full().reshape(shape, order="F")
        assert np.all(np.isfinite(exact)), f"the Jacobian is not finite, {choices}"
        largest = np.abs(evaluate(function, structure, matrix)).max(axis=1)[:, None]
        for j, name in enumerate(flattened(structure)):
            nominal = abs(case.known(name).nominal)
            wide, narrow = (
                _slope(function, structure, matrix, j, h * nominal) for h in (STEP, STEP / 2)
            )
            scale = largest / nominal + np.abs(exact[:, j])
            # Where the two differences disagree there is a kink or a jump between their ends.
            smooth = np.abs(wide - narrow) <= 1e-3 * scale
            assert np.all(smooth.mean(axis=1) > 0.5), f"kinks everywhere along {name}, {choices}"
            off = np.abs(narrow - exact[:, j]) / np.where(scale > 0, scale, 1)
            assert np.all(off[smooth] <= TOLERANCE), f"slope along {name}, {choices}: {off}"


def _slope(
    function: Callable[..., Any], structure: Any, matrix: np.ndarray, j: int, step: float
) -> np.ndarray:
    ahead, behind = matrix.copy(), matrix.copy()
    ahead[j] += step
    behind[j] -= step
    difference = evaluate(function, structure, ahead) - evaluate(function, structure, behind)
    return difference / (2.0 * step)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_jacobian_is_the_slope(name: str) -> None:
    check_jacobian(FUNCTIONS[name])
