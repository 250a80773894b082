"""Runs side by side, each with its own parameters, start and stimulus, as in a single run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bywire.bench.bench_file import read
from bywire.core.errors import ParameterError, SolverError
from bywire.simulation import case_kernels
from bywire.simulation.ensemble import fit_lanes, simulate_group
from bywire.simulation.run import simulate


def braking(p_to: str, R_m: str = "0.35 ohm", **options: str):
    changes = {"options.p_to": p_to, "motor.R_m": R_m, "options.settle": "10 ms"}
    changes |= {f"options.{name}": value for name, value in options.items()}
    (run,) = read("hard-braking", {"options.duration": "60 ms", **changes}).runs().values()
    return run


@pytest.fixture(scope="module")
def runs():
    """Return five runs, more than a group of lanes holds; starts and set points differ."""
    levels = ("20 bar", "25 bar", "30 bar", "35 bar", "40 bar")
    return [
        braking(level, f"{0.3 + 0.05 * k} ohm", p_from=f"{5 + k} bar")
        for k, level in enumerate(levels)
    ]


def test_every_run_is_as_if_it_ran_alone(runs):
    assert len({tuple(run.state) for run in runs}) == len(runs)
    shares: list[float] = []
    together = simulate_group(runs, progress=shares.append)
    for run, lane in zip(runs, together, strict=True):
        alone = simulate(run)
        assert lane.names == alone.names
        np.testing.assert_array_equal(lane.time, alone.time)
        size = np.abs(alone.values).max(axis=0) + 1e-12
        assert np.max(np.abs(lane.values - alone.values) / size) < 1e-9
        np.testing.assert_allclose(lane.vector, alone.vector, rtol=1e-8, atol=1e-9)
        assert (lane.status, lane.unsettled) == (alone.status, alone.unsettled)
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


def test_some_signals_on_one_thread(runs):
    few = simulate_group(runs[:2], ["p_mc"], threads=1)
    everything = simulate_group(runs[:2])
    assert few[0].names == ("p_mc",)
    # Another kernel: it may round otherwise.
    np.testing.assert_allclose(few[1]["p_mc"], everything[1]["p_mc"], rtol=1e-9)


@pytest.mark.parametrize("is_paired", [False, True])
@pytest.mark.parametrize("record", [1e-3, 3e-3])
def test_signals_of_both_ends_have_the_bits_of_all_rows(runs, monkeypatch, is_paired, record):
    monkeypatch.setattr(case_kernels, "PAIRED", len(runs) if is_paired else 1000)
    each = [replace(run, record=record) for run in runs]  # 3 ms: the run ends after its last row
    names, apart, first = ("p_mc", "E_seal", "i"), ("E_stored", "E_source"), 3
    every = simulate_group(each, (*names, *apart), first=first)
    few = simulate_group(each, names, first=first, ends=apart)
    assert (few.names, few.end_names) == (names, apart)
    np.testing.assert_array_equal(few.values, every.values[:3])
    np.testing.assert_array_equal(few.ends, every.values[3:][:, :, [0, -1]])
    np.testing.assert_array_equal(few.vectors, every.vectors)
    assert np.all(few.ends[:, :, 0] != few.ends[:, :, 1])


def test_vectors_that_take_turns_change_no_bit(runs, monkeypatch):
    stopping = braking("12 bar", p_from="5 bar", duration="0.2 s")
    longer = [replace(run, duration=stopping.duration) for run in runs]
    many = [*longer, *[stopping] * 5]  # both vectors are used, the second not in all lanes
    usual = simulate_group(many, ["p_mc", "i"])
    monkeypatch.setattr(case_kernels, "PAIRED", len(many))
    in_turn = simulate_group(many, ["p_mc", "i"])
    assert in_turn.kernel.lanes == 2 * usual.kernel.lanes
    np.testing.assert_array_equal(in_turn.values, usual.values)
    np.testing.assert_array_equal(in_turn.vectors, usual.vectors)
    assert in_turn.vectors[in_turn.kernel.layout.start["counters"] + 1].max() > 0  # cut substeps


def test_what_does_not_fit_is_refused(runs):
    longer = braking("20 bar", duration="80 ms")
    assert not fit_lanes([runs[0], longer])
    assert not fit_lanes([runs[0], replace(runs[0], step=10e-6)])
    assert not fit_lanes([])
    other_choice = runs[0].par.replace({"gear.law": "directional"})
    assert not fit_lanes([runs[0], replace(runs[0], par=other_choice)])
    other_period = runs[0].par.replace({"ecu.T_s": 2e-3})
    assert not fit_lanes([runs[0], replace(runs[0], par=other_period)])
    with pytest.raises(ParameterError, match="side by side"):
        simulate_group([runs[0], longer])
    with pytest.raises(ParameterError, match="threads = 0"):
        simulate_group(runs, threads=0)


def test_a_run_that_leaves_the_numbers_fails_all(runs):
    broken = replace(runs[1], state=runs[1].state._replace(i=np.inf))
    with pytest.raises(SolverError, match="diverged"):
        simulate_group([runs[0], broken])


def test_an_interrupt_ends_all(runs):
    def stop(share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_group(runs, progress=stop)
