"""A search from several starts: the lowest minimum, trials that fail, and going on after Ctrl-C."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bywire.core.errors import ParameterError, SolverError
from bywire.identification.least_squares import Problem, solve
from bywire.identification.multistart import search
from bywire.identification.unknown import Unknown, scattered

Array = NDArray[np.float64]


@pytest.mark.parametrize("undefined", ["residual", "slope"])
def test_trials_where_something_is_not_defined_do_not_end_a_search(undefined: str) -> None:
    """As a key figure that a trial's run does not have, or one of the runs beside it."""
    refused = []

    def evaluate(x: Array) -> tuple[Array, Array]:
        r = np.arctan(3.0 * (x - 1.4))
        J = np.array([3.0 / (1.0 + 9.0 * (x - 1.4) ** 2)])
        if x[0] > 1.5:
            refused.append(x[0])
            (r if undefined == "residual" else J)[...] = np.nan
        return r, J

    problem = Problem((Unknown("x", 1.0),), evaluate)
    found = search(problem, [np.array([1.0]), np.array([2.0])])
    assert found.failed == 1
    assert len(refused) > 1
    assert found.best.values[0] == pytest.approx(1.4, abs=1e-3)


def two_minima(values: Array) -> tuple[Array, Array]:
    """Return residuals whose sum of squares is least at 1, and has another minimum near -1."""
    x = values[0]
    return np.array([(x * x - 1.0) * 3.0, x - 1.0, 0.0]), np.array([[6.0 * x], [1.0], [0.0]])


def test_several_starts_find_the_lower_of_two_minima() -> None:
    problem = Problem((Unknown("x", -1.2),), two_minima)
    starts = scattered(problem.unknowns, 16, 2.0, seed=1)
    found = search(problem, starts)
    assert solve(problem, starts[0]).values[0] < 0.0
    assert found.best.values[0] == pytest.approx(1.0, abs=1e-6)
    assert 2 <= found.reached < 16


def test_an_interrupted_search_goes_on_where_it_was(tmp_path: Path) -> None:
    store, calls = tmp_path / "starts.jsonl", [0]

    def counted(values: Array) -> tuple[Array, Array]:
        calls[0] += 1
        return two_minima(values)

    problem = Problem((Unknown("x", -1.2),), counted)
    starts = scattered(problem.unknowns, 4, 0.3, seed=1)

    def stop(label: str, share: float) -> None:
        if share >= 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(problem, starts, progress=stop, store=store, threads=1)
    lines = store.read_text().splitlines()
    assert 2 <= len(lines) <= 4
    store.write_text("\n".join(lines[:2]) + '\n{"key": "cut')  # as a killed run leaves it
    calls[0] = 0
    again = search(problem, starts, store=store, threads=1)
    whole = search(problem, starts, threads=1)
    np.testing.assert_array_equal(
        [s.values for s in again.solutions], [s.values for s in whole.solutions]
    )
    store.write_text("nothing that is understood\n")
    assert len(search(problem, starts, store=store).solutions) == 4


@pytest.mark.parametrize("error", [SolverError, ParameterError])
def test_trials_that_are_refused_do_not_end_a_search(error: type[Exception]) -> None:
    """By the model, or by its parameters' own rules; starts that are refused are counted."""
    refused = []

    def evaluate(x: Array) -> tuple[Array, Array]:
        if x[0] > 1.5:
            refused.append(x[0])
            raise error("refused")
        return np.arctan(3.0 * (x - 1.4)), np.array([3.0 / (1.0 + 9.0 * (x - 1.4) ** 2)])

    problem = Problem((Unknown("x", 1.0),), evaluate)
    found = search(problem, [np.array([1.0]), np.array([2.0])])
    assert found.failed == 1
    assert len(refused) > 1  # of the way from the other start, too
    assert found.best.values[0] == pytest.approx(1.4, abs=1e-3)
    with pytest.raises(
        error, match="failed from every start" if error is SolverError else "refused"
    ):
        search(problem, [np.array([2.0])])
