"""Check whether a step resolves the contacts: many runs at once give the same result as each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bywire.simulation.contacts import unresolved
from bywire.simulation.engine import prepare
from bywire.simulation.run import Run
from bywire.simulation.run_table import doubts_of
from systems.two_mass import rig


def jacobians(run: Run) -> list[np.ndarray]:
    """Return the Jacobians of dx/dt, open and closed, by plain calls of the function."""
    computed = prepare(run.model, run.par).contact_jacobians
    leaves = list(run.par.leaves().values())
    return [np.array(J.full()) for J in computed(run.state, run.memory, leaves)]


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    """Return runs with ever harder walls, which hardly damp."""
    base = rig(0.01)
    par = base.par.replace({"tau_wall": 1e-7})
    hard = (5e5, 5e7, 2e10, 5e11)
    return [replace(base, par=par.replace({"k_wall": k}), step=20e-6) for k in hard]


def test_many_runs_are_doubted_as_each_alone(runs: list[Run]) -> None:
    expected = []
    for run in runs:
        opened, *closed = (J[None] for J in jacobians(run))
        expected += unresolved(opened, closed, run.step)
    assert doubts_of(runs) == expected
    assert [doubts_of([run])[0] for run in runs] == expected
    assert expected[0] == ""
    assert "too fast for steps of 20 us" in expected[-1]
    assert len(set(expected[1:])) == len(expected[1:])
