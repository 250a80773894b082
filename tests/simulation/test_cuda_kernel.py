"""Many cases on an emulated graphics processor, bit-identical to kernels on the processor."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bywire.bench.bench import Bench
from bywire.bench.bench_file import read
from bywire.bench.ensemble import simulate_ensemble as simulate_ensemble_of_bench
from bywire.core.brake import load_system
from bywire.core.errors import DeviceError, UnknownNameError
from bywire.simulation import cuda
from bywire.simulation.cuda_device import find_device
from bywire.simulation.ensemble import Ensemble, simulate_ensemble, simulate_group
from bywire.simulation.run import Run, simulate
from emulated_driver import OK, EmulatedDriver, Status, emulated
from raising import raises

EXAMPLES = Path(__file__).parents[2] / "examples"
CASES = 70  # two blocks of threads, the second not full
# What each is varied in, a tenth either way, and what is recorded: velocities turn, so that
# substeps are cut.
BRAKES = {
    "hard-braking": (
        {"options.settle": "20 ms", "options.duration": "0.5 s"},
        "seal.T_pr",
        ("p_mc", "i", "E_seal", "t_stuck"),
    ),
    "moment-pulses": (
        {
            "options.pulses": "1",
            "options.t_hold": "50 ms",
            "options.settle": "10 ms",
            "options.t_low": "50 ms",
            "options.t_high": "50 ms",
        },
        "heart.K_S",
        ("y_M", "F_N", "E_wedge", "t_stuck"),
    ),
    "power-off": (
        {"options.duration": "0.75 s"},
        "friction.C",
        ("F_cl", "i", "E_friction", "t_stuck"),
    ),
}


@pytest.fixture
def driver() -> Iterator[EmulatedDriver]:
    with emulated(EmulatedDriver()) as driver:
        yield driver


def run_of(experiment: str, changes: dict[str, str]) -> Run:
    return next(iter(read(experiment, changes).runs().values()))


def computed(experiment: str) -> tuple[Ensemble, Ensemble]:
    """Return an ensemble in lanes, and on a graphics processor."""
    load_system(EXAMPLES / "emb_caliper")
    changes, varied, signals = BRAKES[experiment]
    run = run_of(experiment, changes)
    cases = {varied: run.par.leaves()[varied] * np.linspace(0.9, 1.1, CASES)}
    lanes, there = (simulate_ensemble(run, cases, signals, engine=e) for e in ("auto", "cuda"))
    return lanes, there


@pytest.mark.parametrize("experiment", BRAKES)
def test_every_case_has_the_digits_that_it_has_in_lanes(experiment, driver, monkeypatch):
    monkeypatch.setattr(cuda, "_SUBSTEPS", 1_500)
    lanes, there = computed(experiment)
    assert there.engine == "CUDA C, emulated 0"
    assert set(driver.launches) == {128}
    assert len(driver.launches) > 2
    np.testing.assert_array_equal(there.values, lanes.values)
    np.testing.assert_array_equal(there.repeated, lanes.repeated)
    assert lanes.repeated.max() > 0
    assert not driver.places  # all memory was given back


@pytest.mark.parametrize("experiment", BRAKES)
def test_a_processor_that_is_there_agrees_with_this_machines(experiment):
    try:
        device = find_device()
    except DeviceError as error:
        pytest.skip(str(error))
    lanes, there = computed(experiment)
    assert there.engine == f"CUDA C, {device.label}"
    largest = np.abs(lanes.values).max(axis=(0, 1))
    assert np.all(np.abs(there.values - lanes.values).max(axis=(0, 1)) <= 1e-9 * largest)


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    """Return five runs whose starts, set points and noise differ."""
    changes = {"options.settle": "10 ms", "options.duration": "40 ms", "adc.noise": "1"}
    return [
        run_of("hard-braking", changes | {"options.p_to": f"{20 + 5 * k} bar"}) for k in range(5)
    ]


def test_runs_go_there_in_batches_that_its_memory_holds(runs, driver, monkeypatch):
    monkeypatch.setattr(cuda, "_SUBSTEPS", 600)
    lanes = simulate_group(runs, first=7)
    driver.capacity = 40_000
    there = simulate_group(runs, first=7, engine="cuda")
    assert there.kernel.lanes == 2  # in three batches, the last of which is not full
    assert driver.most <= driver.capacity / 2
    np.testing.assert_array_equal(there.values, lanes.values)
    alone = [simulate(run, engine="compiled").vector for run in runs]
    np.testing.assert_array_equal(there.vectors.T, alone)


def test_an_ensemble_goes_there_in_batches(runs, driver, monkeypatch):
    signals, cases = BRAKES["hard-braking"][2], {"motor.R_m": np.linspace(0.3, 0.4, 5)}
    lanes = simulate_ensemble(runs[0], cases, signals)
    monkeypatch.setattr(cuda, "MOST", 2)
    there = simulate_ensemble(runs[0], cases, signals, engine="cuda")
    assert len(driver.launches) == 3
    assert driver.copies == 6  # of each batch's rows and states, into one array for all
    np.testing.assert_array_equal(there.values, lanes.values)


def test_a_single_run_is_a_batch_of_one(runs, driver):
    there, here = (simulate(runs[0], ["i", "p_mc"], engine) for engine in ("cuda", "compiled"))
    assert there.engine == "CUDA C, emulated 0"
    np.testing.assert_array_equal(there.values, here.values)
    np.testing.assert_array_equal(there.vector, here.vector)


def test_a_bench_says_that_its_cases_go_there(driver):
    bench = Bench(
        "hard-braking",
        "dardanelli2010",
        engine="cuda",
        options={"duration": "40 ms", "settle": "10 ms"},
    )
    varied = {"motor.R_m": [0.3, 0.4]}
    there = simulate_ensemble_of_bench(bench, varied)
    here = simulate_ensemble_of_bench(replace(bench, engine="auto"), varied)
    assert there.results[1].recording.attrs["engine"] == "CUDA C, emulated 0"
    np.testing.assert_array_equal(there["p_mc"], here["p_mc"])
    assert there.results[1].kpis == here.results[1].kpis


def test_memory_that_is_too_small_is_said(runs, driver):
    driver.capacity = 10_000
    with pytest.raises(DeviceError, match=r"emulated 0 has 0\.01 MB free.*needs .* MB\. Record"):
        simulate_group(runs, engine="cuda")


def test_memory_that_others_took_meanwhile_is_said(runs, driver, monkeypatch):
    monkeypatch.setattr(driver, "cuMemGetInfo", lambda: (OK, 10**9, 10**9))
    driver.capacity = 50_000
    with raises(DeviceError, name="emulated 0", value=" MB"):
        simulate_group(runs, engine="cuda")
    assert not driver.places


@pytest.mark.parametrize(
    ("function", "status", "said"),
    [
        ("cuCtxSynchronize", Status.CUDA_ERROR_ILLEGAL_ADDRESS, "failed: .* why .*_ILLEGAL_ADDR"),
        ("cuCtxSynchronize", Status.CUDA_ERROR_LAUNCH_TIMEOUT, "too long .* drives a display"),
        ("cuLaunchKernel", Status.CUDA_ERROR_LAUNCH_FAILED, "failed: .* why .*_LAUNCH_FAILED"),
        ("cuMemcpyHtoD", Status.CUDA_ERROR_UNKNOWN, r"failed: .* why \(CUDA_ERROR_UNKNOWN\)"),
        ("cuMemcpyDtoH", Status.CUDA_ERROR_ECC_UNCORRECTABLE, "uncorrectable memory error"),
        ("cuMemFree", Status.CUDA_ERROR_UNKNOWN, "failed: .* why"),
        ("cuCtxSetCurrent", Status.CUDA_ERROR_INVALID_CONTEXT, "failed: .* why"),
    ],
)
def test_a_processor_that_fails_is_said(function, status, said, runs, driver, monkeypatch):
    monkeypatch.setattr(driver, function, lambda *_: (status,))
    with raises(DeviceError, name="emulated 0", value=status.name) as caught:
        simulate_group(runs, engine="cuda")
    assert re.search(said, str(caught.value))


def test_an_engine_that_is_none_is_refused(runs):
    with pytest.raises(UnknownNameError, match="unknown engine 'cudo': did you mean 'cuda'"):
        simulate_ensemble(runs[0], {"motor.R_m": [0.3]}, ["i"], engine="cudo")
