"""Parameters that change during a run: the same as two consecutive runs, with energy balance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bywire.bench.bench import Bench
from bywire.bench.energy_ledger import actuator_ledger
from bywire.bench.running import run as run_bench
from bywire.core.errors import ParameterError
from bywire.simulation.advance import Change
from bywire.simulation.ensemble import fit_lanes, simulate_group
from bywire.simulation.run import Run, simulate
from bywire.simulation.sensitivity import simulate_with_sensitivities
from raising import raises
from systems.sampled_lag import LAG, Memory, SampledLag, State

SLOW = LAG.replace({"tau": 0.2, "c": 5.0})


def wished(begin=0.0):
    return lambda t: 1.0 + 0.5 * np.sin(20.0 * (begin + t[:, None]))


RUN = Run(SampledLag(), LAG, State(0.0), Memory(0.0, 0.0), wished(), 0.6, 1e-4, 5e-3)
CHANGED = replace(RUN, changes=(Change(0.2, SLOW), Change(0.4, LAG)))


def test_a_changed_run_is_two_runs_in_a_row():
    whole = simulate(replace(RUN, changes=(Change(0.2, SLOW),)))
    first = simulate(replace(RUN, duration=0.2))
    memory = Memory(first["seen"][-1], first["drive"][-1])
    rest = simulate(
        Run(SampledLag(), SLOW, State(first["y"][-1]), memory, wished(0.2), 0.4, 1e-4, 5e-3)
    )
    np.testing.assert_allclose(whole["y"][:41], first["y"], rtol=0, atol=1e-15)
    np.testing.assert_allclose(whole["y"][40:], rest["y"], rtol=0, atol=1e-14)
    assert np.max(np.abs(whole["y"] - simulate(RUN)["y"])) > 0.1


@pytest.mark.parametrize("engine", ["compiled", "virtual-machine"])
def test_what_a_change_puts_into_a_store_is_recorded(engine):
    run = simulate(CHANGED, engine=engine)
    at = [round(t / RUN.record) for t in (0.2, 0.4)]
    jumps = [0.5 * d * run["y"][k] ** 2 for k, d in zip(at, (2.0, -2.0), strict=True)]
    wanted = np.zeros(run.time.size)
    wanted[at[0] :] += jumps[0]
    wanted[at[1] :] += jumps[1]
    np.testing.assert_allclose(run["E_change"], wanted, rtol=1e-12, atol=1e-15)


def test_a_change_between_two_frames_waits_for_the_next():
    late = simulate(replace(RUN, changes=(Change(0.1951, SLOW),)))
    on_time = simulate(replace(RUN, changes=(Change(0.2, SLOW),)))
    np.testing.assert_array_equal(late.values, on_time.values)


def test_lanes_with_changes_have_no_signals_of_both_ends_alone():
    with raises(ParameterError, name="ends"):
        simulate_group([CHANGED], ["y"], ends=["seen"])


def test_lanes_change_each_at_its_time():
    runs = [RUN, CHANGED, replace(RUN, changes=(Change(0.35, SLOW),))]
    for run, lane in zip(runs, simulate_group(runs), strict=True):
        alone = simulate(run)
        for name in alone.names:
            np.testing.assert_allclose(lane[name], alone[name], rtol=1e-12, atol=1e-13)
    (skipped,) = simulate_group([CHANGED], first=21)
    np.testing.assert_allclose(skipped["y"], simulate(CHANGED)["y"][21:], rtol=1e-12)


def test_the_books_of_a_brake_close_over_a_change_of_its_stores():
    def books(**fault):
        bench = Bench(
            "hard-braking",
            "dardanelli2010",
            options={"settle": 0.1, "duration": 0.6},
            faults=[{"fault": "caliper.soft", "onset": 0.3, **fault}],
        )
        recording = run_bench(bench).recording
        return recording, actuator_ledger(recording)

    recording, ledger = books(value=0.5)
    assert float(recording["E_change"][-1]) > 0.3
    assert abs(ledger.closing_error) < 1e-9 * ledger.turnover
    without = actuator_ledger(recording.drop_vars("E_change"))
    assert abs(without.closing_error) > 1e-3 * ledger.turnover
    assert recording.attrs["warnings"] == []
    grown, ledger = books(value=0.5, ramp=0.1)
    assert abs(ledger.closing_error) < 1e-9 * ledger.turnover
    assert float(grown["E_change"][-1]) == pytest.approx(float(recording["E_change"][-1]), rel=0.2)


def test_what_cannot_change_is_refused():
    with pytest.raises(ParameterError, match="alters a sample time"):
        simulate(replace(RUN, changes=(Change(0.2, LAG.replace({"T_s": 0.02})),)))
    assert not fit_lanes([replace(RUN, changes=(Change(0.2, LAG.replace({"T_s": 0.02})),))])
    with pytest.raises(
        ParameterError, match="sensitivities are not available for a run whose parameters change"
    ):
        simulate_with_sensitivities(CHANGED, ["tau"], ["y"])
