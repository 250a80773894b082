"""The error from the step that a run states: the true one, against a fine step, lies within it."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.stats import binomtest

from bywire.bench.bench import Bench
from bywire.bench.bench_file import read
from bywire.bench.ensemble import run_benches
from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import judge
from bywire.bench.running import run
from bywire.bench.step_error import OTHER_STEPS, with_step_errors
from bywire.core.errors import BywireError, RunError
from bywire.simulation.run import simulate

STATIC = ("seal-stribeck", "motor-open-loop")
"""one is computed without a run, the other needs a stimulus"""
SERIES = ("repeated-stops",)
"""twenty stops, each time"""


def kpi(value: float, error: float = math.nan) -> Kpi:
    return Kpi("energy", value, "J", "Of this test.", error=error)


def test_errors_of_second_and_of_first_order_are_exact():
    """Of q + c h^2 the error is c h^2, from either other step; of q + c h it takes both."""
    h, c = 20e-6, 3e7
    for factor in OTHER_STEPS:
        other = {factor: [kpi(2.0 + c * (factor * h) ** 2)]}
        (second,) = with_step_errors([kpi(2.0 + c * h**2)], other, {})
        assert second.error == pytest.approx(c * h**2, rel=1e-6)
    others = {factor: [kpi(2.0 + c * factor * h)] for factor in OTHER_STEPS}
    (first,) = with_step_errors([kpi(2.0 + c * h)], others, {})
    assert first.error == pytest.approx(c * h)


def test_small_difference_by_chance_is_seen_by_the_other_step():
    (figure,) = with_step_errors([kpi(1.0)], {0.5: [kpi(1.0)], 2.0: [kpi(1.3)]}, {})
    assert figure.error == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("value", "error", "expected"),
    [
        (1.0, 0.05, "met"), (1.2, 0.05, "missed"), (1.08, 0.05, "undecided"),
        (1.12, 0.05, "undecided"), (1.0, math.nan, "met"), (1.0, math.inf, "undecided"),
        (math.nan, math.nan, "missed"), (math.nan, math.inf, "undecided"),
    ],
)  # fmt: skip
def test_what_is_closer_to_its_limit_than_its_error_is_undecided(value, error, expected):
    (verdict,) = judge({"energy": "<= 1.1 J"}, [kpi(value, error)])
    assert verdict.outcome == expected
    assert verdict.met == (expected == "met")


def test_figure_that_one_step_alone_defines_has_no_known_error():
    errors = [
        with_step_errors([kpi(coarse)], {0.5: [kpi(fine)]}, {})[0].error
        for coarse, fine in [(1.0, math.nan), (math.nan, 1.0), (math.nan, math.nan)]
    ]
    assert errors[:2] == [math.inf, math.inf]
    assert math.isnan(errors[2])


def test_coarser_steps_that_fail_cost_no_result(monkeypatch):
    """The estimate is then that of half the step."""

    def fragile(each, **options):
        if each.step > 30e-6:
            raise RunError("left the numbers")
        return simulate(each, **options)

    bench = read("hard-braking", {})
    monkeypatch.setattr("bywire.bench.running.simulate", fragile)
    kpis = run(bench, estimate_error=True).kpis
    fine = {each.name: each.value for each in run(replace(bench, step=0.5 * bench.step)).kpis}
    (energy,) = (each for each in kpis if each.name == "energy")
    assert energy.error == pytest.approx(abs(energy.value - fine["energy"]) / 0.75, rel=1e-3)


@pytest.mark.parametrize("is_range", [False, True])
def test_that_no_other_step_runs_is_said(monkeypatch, is_range):
    """Neither half nor double: the figures stand, without an error, and the reason is a warning."""
    bench = read("hard-braking", {"options.duration": "40 ms", "options.settle": "10 ms"})

    def stubborn(each, **options):
        if each.step != bench.step:
            raise RunError("left the numbers")
        return simulate(each, **options)

    monkeypatch.setattr("bywire.bench.running.simulate", stubborn)
    monkeypatch.setattr("bywire.bench.side_by_side.simulate", stubborn)
    monkeypatch.setattr("bywire.bench.side_by_side.fit_lanes", lambda *_: False)
    results = run_benches([bench, bench], estimate_error=True) if is_range else (
        run(bench, estimate_error=True),
    )  # fmt: skip
    for result in results:
        (said,) = (text for text in result.warnings if "not known" in text)
        assert "neither half nor double steps (0.5 of the step: left the numbers; 2 " in said
        assert all(math.isnan(kpi.error) for kpi in result.kpis)
        assert not math.isnan(result.kpi("energy").value)


def test_that_a_case_of_a_range_has_no_other_step_costs_the_others_nothing(monkeypatch):
    benches = [
        read("hard-braking", {"options.duration": "40 ms", "options.settle": "10 ms",
                              "motor.R_m": f"{R_m} ohm"}) for R_m in (0.3, 0.4)
    ]  # fmt: skip

    def fragile(each, **options):
        if each.step != benches[0].step and each.par.motor.R_m == 0.3:
            raise RunError("left the numbers")
        return simulate(each, **options)

    monkeypatch.setattr("bywire.bench.side_by_side.simulate", fragile)
    monkeypatch.setattr("bywire.bench.side_by_side.fit_lanes", lambda *_: False)
    first, second = run_benches(benches, estimate_error=True)
    assert first.unestimated
    assert not second.unestimated
    assert second.kpi("energy").error > 0.0


def test_a_time_read_at_a_row_is_no_sharper_than_the_rows():
    t = 1e-3 * np.arange(200)
    rows = {"run": xr.Dataset(coords={"time": ("time", t)})}

    def error(value: float) -> float:
        figure = Kpi("stop", value, "s", "Of this test.")
        return with_step_errors([figure], {0.5: [figure]}, rows)[0].error

    assert error(0.057) == pytest.approx(1e-3)
    assert error(float(t[150] - t[31])) == pytest.approx(1e-3)
    assert error(0.0573) == 0.0  # interpolated
    assert error(0.0) == 0.0
    power = Kpi("power", 0.057, "W", "Of this test.")
    assert with_step_errors([power], {0.5: [power]}, rows)[0].error == 0.0


@pytest.mark.parametrize(
    ("half", "double", "error"),
    [(0.75, 3.0, 1.0), (0.5, 1.0, 1.0), (0.5, 0.1, 1.0), (0.0, 0.6, 0.2)],
    ids=["second order", "first order", "no order", "nothing in half steps"],
)
def test_differences_that_do_not_grow_as_squares_count_as_of_first_order(half, double, error):
    def figure(value: float) -> Kpi:
        return Kpi("force", value, "N", "Of this test.")

    others = {0.5: [figure(7.0 - half)], 2.0: [figure(7.0 + double)]}
    assert with_step_errors([figure(7.0)], others, {})[0].error == pytest.approx(error)


def test_standing_wedge_brake_says_how_far_rows_leave_its_times_open():
    result = run(read("power-off-hold", {}), estimate_error=True)
    rest = result.kpi("time_to_rest")
    t = result.recording["time"].values
    assert rest.value > 0.0
    assert rest.error >= t[-1] - t[-2]
    fine = run(read("power-off-hold", {"simulation.record": "100 us"})).kpi("time_to_rest")
    assert abs(fine.value - rest.value) <= rest.error


def random_bench(rng: np.random.Generator, left_out: Collection[str]) -> Bench:
    """Return an experiment of one of our brakes with three parameters changed and some step."""
    names = [name for name in EXPERIMENTS.all() if name not in (*STATIC, *left_out)]
    while True:
        bench = read(str(rng.choice(names)), {})
        values = {
            name: value for name, value in bench.par.flat().items()
            if isinstance(value, float) and value and not name.rpartition(".")[2].startswith("T_")
        }  # fmt: skip
        changed = rng.choice(sorted(values), 3, replace=False)
        overrides = {str(name): values[name] * rng.uniform(0.8, 1.25) for name in changed}
        try:
            step = float(rng.choice([10e-6, 20e-6, 50e-6]))
            return replace(bench, overrides=overrides, step=step)
        except BywireError:  # out of range, without effect here, or a step that does not divide
            continue


@pytest.mark.parametrize(
    ("count", "fine", "left_out"),
    [(4, 2.5e-6, SERIES), pytest.param(200, 1e-6, (), marks=pytest.mark.trust)],
)
def test_true_error_lies_within_three_times_the_estimate(count, fine, left_out):
    """Of all figures of random benches, not significantly less than 95 %.

    A fine step of a quarter of the smallest leaves a sixteenth of an error of second order.
    """
    rng = np.random.default_rng(20)
    within = total = 0
    for _ in range(count):
        bench = random_bench(rng, left_out)
        estimated = run(bench, estimate_error=True)
        true = {each.name: each.value for each in run(replace(bench, step=fine)).kpis}
        for each in estimated.kpis:
            if math.isnan(each.error) and math.isnan(true[each.name]):
                continue
            total += 1
            off = abs(each.value - true[each.name])
            within += off <= 3.0 * each.error + 1e-9 * abs(each.value)
    assert total > 5 * count
    assert binomtest(within, total, 0.95, alternative="less").pvalue > 0.05
