"""Check whether a step resolves the contacts: many runs at once give the same result as each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bywire.simulation import contacts
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


def test_disks_rule_out_only_steps_that_no_mode_makes_too_long():
    random, count = np.random.default_rng(5), 200
    like = random.normal(size=(6, 6)) * 1e4
    closed = (
        like + random.normal(size=(count, 6, 6)) * np.geomspace(1e-3, 3e3, count)[:, None, None]
    )
    opened = np.zeros_like(closed)
    excluded = 0
    for step in np.geomspace(1e-6, 1e-3, 30):
        ruled_out = contacts._are_surely_resolved(closed, step)
        texts = contacts._too_fast(opened, closed, step)
        assert not any(text for text, is_out in zip(texts, ruled_out, strict=True) if is_out)
        excluded += np.count_nonzero(ruled_out)
    assert 0 < excluded < 30 * count
