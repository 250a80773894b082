"""Key figures and warnings where an emulated graphics processor keeps the rows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from bywire.bench.bench import Bench
from bywire.bench.bench_file import read
from bywire.bench.ensemble import KeyFigures, changed, key_figures_of
from bywire.bench.kpis import families
from bywire.bench.recording import Rows
from bywire.core import watching
from bywire.core.errors import CompilerError
from bywire.simulation import cuda
from emulated_driver import EmulatedDriver, emulated

QUICK = {
    "options.duration": "60 ms",
    "options.settle": "10 ms",
    "adc.noise": "1",
    "current_sensor.i_high": "40 A",
    "current_sensor.i_low": "-40 A",
    "motor_heat.law": "lumped",
}
STOP = {"options.v_0": "3 m/s", "options.surface": "wet-asphalt"}


@pytest.fixture
def driver() -> Iterator[EmulatedDriver]:
    with emulated(EmulatedDriver()) as driver:
        yield driver


@pytest.fixture
def fetched(monkeypatch) -> set[int]:
    """Return the numbers of all signals that are fetched."""
    numbers: set[int] = set()
    plain = cuda.HeldRows.signal
    monkeypatch.setattr(cuda.HeldRows, "signal", lambda r, k: numbers.add(k) or plain(r, k))
    return numbers


def both(benches: list[Bench]) -> tuple[KeyFigures, KeyFigures]:
    """Return key figures in lanes, and on a graphics processor."""
    there = [replace(bench, engine="cuda") for bench in benches]
    return key_figures_of(benches), key_figures_of(there)


def require_equal(ours: KeyFigures, there: KeyFigures) -> None:
    assert there.warnings == ours.warnings
    for each, other in zip(ours.figures, there.figures, strict=True):
        assert (each.name, each.unit) == (other.name, other.unit)
        np.testing.assert_array_equal(other.values, each.values, err_msg=each.name)
    for k in range(len(ours.warnings)):
        assert there.kpis(k) == ours.kpis(k)


def varied(bench: Bench, values: dict[str, list[float]]) -> list[Bench]:
    return [
        changed(bench, dict(zip(values, row, strict=True)))
        for row in zip(*values.values(), strict=True)
    ]


def test_rows_stay_there_unless_a_warning_needs_them(driver, fetched):
    bench = read("hard-braking", QUICK)
    ours, there = both(varied(bench, {"seal.T_pr": [0.0019, 0.002, 0.0021]}))
    require_equal(ours, there)
    assert {"bw_step_response", "bw_effort", "bw_occupation"} < set(driver.entries)
    assert len(fetched) == 2  # pressures, whose difference is the flow in the line
    assert not driver.places
    assert any(kpi.note for kpi in there.kpis(0))  # some are not defined


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [
        ("fluid.nu", [5e-4, 5e-9, 5e-4], "not laminar"),
        ("motor_heat.T_most", [400.0, 290.0, 400.0], "winding exceeds"),
        ("current_sensor.i_high", [40.0, 40.0, 18.0], "current leaves"),
    ],
)
def test_cases_that_warn_are_those_of_lanes(name, values, said, driver):
    ours, there = both(varied(read("hard-braking", QUICK), {name: values}))
    require_equal(ours, there)
    assert [any(said in text for text in texts) for texts in there.warnings].count(True) == 1


def test_levels_from_parameters_need_no_rows(driver, fetched):
    ours, there = both(varied(read("straight-stop", STOP), {"vehicle.body.m": [180.0, 190.0]}))
    require_equal(ours, there)
    assert "bw_vehicle_stop" in driver.entries
    assert not fetched


def test_this_machine_judges_what_the_device_cannot(driver, monkeypatch):
    benches = varied(read("hard-braking", QUICK), {"seal.T_pr": [0.0019, 0.002, 0.0021]})
    driver.capacity = 60_000  # too little for all cases together
    require_equal(*both(benches))
    assert set(driver.entries) == {cuda.ENTRY}
    driver.capacity = 1 << 30

    def rejected(*_: object) -> None:
        raise CompilerError("no such kernel")

    monkeypatch.setattr(families.LoopFamily, "on_device", rejected)
    for each in families.FAMILIES.all().values():
        if each.loops is not None:
            monkeypatch.setattr(each.loops, "is_on_device", True)  # and as before afterwards
    require_equal(*both(benches))
    assert not families.FAMILIES.find("effort").loops.is_on_device
    assert not driver.places


@pytest.mark.parametrize("experiment", ["hard-braking", "straight-stop", "moment-pulses"])
def test_lowest_and_highest_values_tell_whether_an_element_warns(experiment):
    run = next(iter(read(experiment, {}).runs().values()))
    rng, outcomes = np.random.default_rng(3), set()
    for part, inputs in watching._watching_parts(run.model, run.par):
        names = [*watching.names_in(tuple(inputs.values()))]
        signals = [name for name in names if not name.startswith(".")]
        bare = {name: {} for name in signals}
        for _ in range(200):
            scale = 10.0 ** rng.uniform(-2, 8, (len(signals), 1, 1))
            values = scale * rng.uniform(-1.0, 1.0, (len(signals), 2, 6))
            outlined = np.stack((values.min(axis=2), values.max(axis=2)), axis=2)
            every, two = (
                Rows(np.arange(float(v.shape[2])), dict(zip(signals, v, strict=True)), bare)
                for v in (values, outlined)
            )
            each = part, inputs
            if not watching._is_outlined(each, two):
                assert part.name == "line"  # a difference
                break
            pars = [run.par] * 2
            silent = [watching._is_silent(run.model, each, r, run.par, pars) for r in (every, two)]
            assert silent[0] == silent[1]
            outcomes.add(silent[0])
    assert outcomes <= {False, True}
    assert len(outcomes) == 2 or experiment == "moment-pulses"
