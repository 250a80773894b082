"""Outcomes of a run: complete, in chunks, interrupted, diverged."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bywire.bench.bench import Bench
from bywire.bench.experiment import as_run
from bywire.core import ops
from bywire.core.errors import ParameterError, SolverError, UnknownNameError
from bywire.core.model import Task
from bywire.simulation import advance
from bywire.simulation.engine import prepare
from bywire.simulation.ensemble import simulate_ensemble
from bywire.simulation.native import SingleKernel
from bywire.simulation.run import Run, simulate
from bywire.simulation.sensitivity import simulate_with_sensitivities
from systems.three_contacts import heart
from systems.two_mass import Memory, TwoMass, rig

ENGINES = pytest.mark.parametrize("engine", ["compiled", "virtual-machine"])


def braking(duration: float) -> Run:
    bench = Bench("hard-braking", "dardanelli2010", options={"settle": 0.01})
    return replace(as_run(bench.cases()[0], bench.step), duration=duration)


@ENGINES
@pytest.mark.parametrize("system", ["rig", "heart", "braking"])
def test_chunks_do_not_show(system: str, engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One chunk, many chunks and chunks of one row: bit-identical values and the same end."""
    run = {"rig": rig(0.05), "heart": heart(0.05), "braking": braking(0.05)}[system]
    reached: list[list[float]] = []
    results = []
    for seconds in (1e9, 1e-9):
        monkeypatch.setattr(advance, "_CHUNK_SECONDS", seconds)
        shares: list[float] = []
        results.append(simulate(run, engine=engine, progress=shares.append))
        reached.append(shares)
    assert len(reached[0]) < len(reached[1])
    assert all(shares == sorted(shares) and shares[-1] == 1.0 for shares in reached)
    np.testing.assert_array_equal(results[0].values, results[1].values)
    np.testing.assert_array_equal(results[0].vector, results[1].vector)


@pytest.mark.parametrize("stop_at", [1, 3])
def test_interrupt_keeps_the_finished_rows(stop_at: int, monkeypatch: pytest.MonkeyPatch) -> None:
    run = rig(0.2, record=1e-3)
    whole = simulate(run)
    advance, calls = SingleKernel.advance, 0

    def interrupted(self: SingleKernel, *args: Any) -> None:
        nonlocal calls
        calls += 1
        if calls == stop_at:
            raise KeyboardInterrupt
        advance(self, *args)

    monkeypatch.setattr(SingleKernel, "advance", interrupted)
    result = simulate(run)
    assert result.status == "interrupted"
    assert result.time.size == result.values.shape[0] < whole.time.size
    assert (result.time.size == 0) == (stop_at == 1)
    np.testing.assert_array_equal(result.time, whole.time[: result.time.size])
    np.testing.assert_array_equal(result.values, whole.values[: result.time.size])


@ENGINES
def test_interrupt_between_chunks(engine: str) -> None:
    """An interrupt that arrives while progress is shown is no different."""
    run = rig(0.2, record=1e-3)

    def impatient(share: float) -> None:
        if share > 0.05:
            raise KeyboardInterrupt

    result = simulate(run, engine=engine, progress=impatient)
    assert result.status == "interrupted"
    assert 0 < result.time.size < 201


def overwhelmed(run: Run) -> Run:
    """Return the run with a force that is finite but makes the run diverge."""
    return replace(run, stimulus=lambda t: np.where(t > 0.01, 1e308, 1.0)[:, None])


@ENGINES
def test_leaving_the_numbers_is_an_error(engine: str) -> None:
    """The error contains the time; there is never a recording with gaps."""
    with pytest.raises(SolverError, match=r"diverged before t = 0\.\d+ s"):
        simulate(overwhelmed(rig(0.05)), engine=engine)


def test_leaving_the_numbers_in_lanes_and_tangents() -> None:
    run = overwhelmed(rig(0.05))
    with pytest.raises(SolverError, match="one of cases 0 to 1 diverged"):
        simulate_ensemble(run, {"F_c1": [20.0, 30.0]}, ["x_1"])
    with pytest.raises(SolverError, match="diverged"):
        simulate_with_sensitivities(run, ["F_c1"], ["x_1"])


@ENGINES
def test_a_controller_that_computes_no_number(engine: str) -> None:
    """A NaN force must not count as a force that friction holds."""
    tick = TwoMass.tasks

    class Undefined(TwoMass):
        def tasks(self, par: Any) -> tuple[Task, ...]:
            return (replace(tick(self, par)[0], tick=lambda x, m, u, p: Memory(ops.sqrt(u.force))),)

    run = replace(rig(0.05), model=Undefined())
    with pytest.raises(SolverError, match="diverged"):
        simulate(replace(run, stimulus=lambda t: np.full((t.size, 1), -1.0)), engine=engine)
    assert simulate(replace(run, stimulus=lambda t: np.ones((t.size, 1))), engine=engine).time.size


def test_a_stimulus_with_a_hole() -> None:
    """Refused before the run starts, naming the signal and the time."""
    run = replace(rig(0.05), stimulus=lambda t: np.where(t > 0.0105, np.nan, 1.0)[:, None])
    for attempt in (
        lambda: simulate(run),
        lambda: simulate_ensemble(run, {"F_c1": [20.0]}, ["x_1"]),
        lambda: simulate_with_sensitivities(run, ["F_c1"], ["x_1"]),
    ):
        with pytest.raises(ParameterError, match=r"stimulus force is nan at t = 0\.011 s"):
            attempt()


def test_unknown_signal() -> None:
    with pytest.raises(UnknownNameError, match="F_wall"):
        simulate(rig(0.001), ["F_wal"])


def test_programs_are_shared_by_equal_models() -> None:
    """Two benches of one kind use one program: building it takes longer than a short run."""
    first, second = braking(0.01), braking(0.01)
    assert first.model is not second.model
    assert prepare(first.model, first.par) is prepare(second.model, second.par)
    other = second.par.replace({"gear.law": "directional"})
    assert prepare(first.model, first.par) is not prepare(second.model, other)
    changed = first.par.replace({"motor.R_m": 1.0})
    assert prepare(first.model, first.par) is prepare(second.model, changed)
