"""Designs over operating points: gain schedules, and the bench at the corners of ranges."""

from __future__ import annotations

import numpy as np
import pytest

from bywire.analysis.loop import LOOPS
from bywire.analysis.margins import MARGINS, margins
from bywire.bench.bench import Bench
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError
from bywire.synthesis.bench_figures import BenchFigures, bench_figures
from bywire.synthesis.designer import Problem
from bywire.synthesis.linear_case import cases_of, read
from bywire.synthesis.outcome import ScheduleDesign
from bywire.synthesis.schedules import design_schedule, points_by_region, verify_schedule
from bywire.synthesis.verification import MOST, Trial, corners_of, judged, verify
from few_starts import few_starts

ON = {"ecu.schedule.law": "regions"}
LOW_K_P = "ecu.schedule.low.k_p"


def test_operating_points_by_region() -> None:
    loop, par = LOOPS.find("pressure"), parameters("dardanelli2010")
    found = points_by_region(loop, par, (37e5, 10e5, 5e5, 20e5, 7e5))
    assert found == {"low": (5e5, 7e5), "medium": (10e5, 20e5), "high": (37e5,)}
    assert [len(own) for own in points_by_region(loop, par, ()).values()] == [1, 1, 1]
    with pytest.raises(ParameterError, match=r"region 'low'.*10 bar and 35 bar.*with at, or"):
        points_by_region(loop, par, (20e5, 37e5))
    with pytest.raises(ParameterError, match="no gain schedule"):
        points_by_region(LOOPS.find("moment"), parameters("roberts2003"), ())


def test_a_region_is_designed_and_the_whole_schedule_is_looked_at() -> None:
    loop, par = LOOPS.find("pressure"), parameters("dardanelli2010-retuned").replace(ON)
    requirements = read(["bandwidth >= 5 Hz", "phase margin >= 70 deg"])
    tunables = {"low": {LOW_K_P: (5e-6, 4e-5)}, "medium": {}, "high": {}}
    points = points_by_region(loop, par, ())
    with few_starts():
        found = design_schedule(loop, par, requirements, points, tunables)
    assert found.regions.keys() == {"low"}
    assert found.regions["low"].status == "met"
    k_p = found.gains[LOW_K_P]
    assert k_p < par.leaves()[LOW_K_P]  # which gives 60 degree
    # Nobody else's figures: those of the margins, wherever the loop was looked at.
    own = par.replace(found.gains)
    for one in found.across[::6]:
        known = margins(loop, own, one.at)
        assert one.figures["crossover"] == pytest.approx(known.crossover, rel=2e-3)
        assert one.figures["disk_margin"] == pytest.approx(known.disk, rel=2e-3)
    assert {one.region for one in found.across} == {"low", "medium", "high"}
    assert {10e5, 35e5, *(p for own in points.values() for p in own)} <= {
        one.at for one in found.across
    }
    # The gains of medium pressure stayed at 60 degree: the schedule as a whole is not met.
    assert found.status == "infeasible"
    assert found.worst.at > 10e5
    assert found.worst.slack == pytest.approx(60.35 / 70.0 - 1.0, abs=2e-3)
    # On the bench at all three points; the braking from 6 to 37 bar passes through all regions.
    trial = Trial(loop, par, 20e5, (1e5,), Bench("hard-braking", "dardanelli2010-retuned", ON))
    tried = verify_schedule(found, requirements, tunables, trial, generations=0)
    assert tried.linear.corners.keys() == {"pressure = 5 bar", "pressure = 37 bar"}
    own_bench = {LOW_K_P: [k_p]}
    (there,) = bench_figures(loop, par, 5e5, (1e5,), own_bench, None, 5.0)
    assert tried.linear.corners["pressure = 5 bar"] == there
    (off,) = bench_figures(
        loop,
        parameters("dardanelli2010-retuned"),
        5e5,
        (1e5,),
        {"ecu.pressure.b": [1.0]},
        None,
        5.0,
    )
    assert there.small[0].crossover < off.small[0].crossover


def test_a_region_that_falls_short_on_the_bench_is_retuned_alone() -> None:
    loop, par = LOOPS.find("pressure"), parameters("dardanelli2010-retuned").replace(ON)
    requirements = read(["bandwidth >= 8 Hz", "phase margin >= 55 deg"])
    points = {"low": (5e5,), "medium": (20e5,), "high": (37e5,)}
    gains = {LOW_K_P: 7e-6}
    cases = cases_of(loop, par, 20e5, {"pressure": [5e5, 20e5, 37e5]})
    nominal = {"phase_margin": 60.4}
    found = ScheduleDesign({}, points, gains, nominal, cases, ())
    tunables = {"low": {LOW_K_P: (5e-6, 4e-5)}, "medium": {}, "high": {}}
    trial = Trial(loop, par, 20e5, (1e5,), None)
    tried = verify_schedule(found, requirements, tunables, trial, generations=1)
    assert not tried.linear.slack >= 0.0
    assert tried.met
    assert tried.final.gains.keys() == {LOW_K_P}
    assert tried.final.gains[LOW_K_P] > 1e-5
    assert tried.tuning is not None
    assert tried.tuning.count > 0
    assert tried.conflict() is None
    # The other regions were left alone.
    there = "pressure = 37 bar"
    assert tried.final.corners[there] == tried.linear.corners[there]
    assert tried.final.figures == tried.linear.figures


def test_a_step_that_passes_all_points_counts_at_each_of_them() -> None:
    requirements = read(["overshoot <= 15 %"])
    linear = {"overshoot <= 15 %": -0.5}
    small = ()
    found = {
        "nominal": BenchFigures(small, {"overshoot": 6.0}),
        "pressure = 5 bar": BenchFigures(small, {}),
        "motor.R_m = 0.4 ohm": BenchFigures(small, {"overshoot": 12.0}),
    }
    assert judged(requirements, {}, found, linear).slack == pytest.approx(0.2)
    assert judged(requirements, {}, {"nominal": found["pressure = 5 bar"]}, linear).slack == -0.5


def test_friction_that_no_linear_model_knows_is_found_at_a_corner() -> None:
    loop, par = LOOPS.find("pressure"), parameters("dardanelli2010-retuned")
    requirements = read(["bandwidth >= 10 Hz", "phase margin >= 60 deg"])
    cases = cases_of(loop, par, 20e5, {"seal.f_cfr_p": [1.2e-8, 1.6e-8, 2e-8]})
    gains = {"ecu.pressure.b": 1.0}
    trial = Trial(loop, par, 20e5, (1e5,), Bench("hard-braking", "dardanelli2010-retuned"))
    span = {"ecu.pressure.b": (0.0, 1.0)}
    nominal = verify(gains, requirements, span, cases[:1], trial, generations=0)
    assert nominal.met
    assert nominal.linear.corners == {}
    found = verify(gains, requirements, span, cases, trial, generations=0)
    assert found.corners == 2
    (label,) = found.linear.corners
    assert label == "seal.f_cfr_p = 2e-08 N*m/Pa"
    assert not found.met
    assert found.linear.figures == nominal.linear.figures
    own = par.replace({"seal.f_cfr_p": 2e-8})
    bench = Bench("hard-braking", "dardanelli2010-retuned", {"seal.f_cfr_p": 2e-8})
    (there,) = bench_figures(
        loop, own, 20e5, (1e5,), {name: [value] for name, value in gains.items()}, bench, 10.0
    )
    assert found.linear.corners[label] == there


def test_the_scheduled_set_has_more_margin_at_low_pressure_and_meets_the_paper() -> None:
    loop, par = LOOPS.find("pressure"), parameters("dardanelli2010-scheduled")
    retuned = parameters("dardanelli2010-retuned")
    same = {"ecu.pressure.b": [1.0]}
    bench = Bench("hard-braking", "dardanelli2010-scheduled")
    for p in (5e5, 8.5e5, 10e5, 20e5):
        step = bench if p == 20e5 else None
        (found,) = bench_figures(loop, par, p, (1e5, 3e5), same, step, 10.0)
        assert min(one.least for one in found.small) > np.sqrt(0.5)
        assert min(one.phase_margin for one in found.small) > 60.0
        there, other = margins(loop, par, p), margins(loop, retuned, p)
        assert there.phase > 60.0
        if p < 9e5:
            assert there.phase > other.phase + 9.0
            assert there.disk > other.disk + 0.15
        elif p == 20e5:
            for name in MARGINS:
                assert getattr(there, name) == pytest.approx(getattr(other, name), rel=1e-9)
    assert found.step["overshoot"] < 8.0
    (known,) = bench_figures(
        loop, retuned, 20e5, (1e5,), same, Bench("hard-braking", "dardanelli2010-retuned"), 10.0
    )
    assert known.step["overshoot"] > 14.0


def test_corners_are_the_ends_of_the_ranges_and_the_worst_model() -> None:
    loop, par = LOOPS.find("moment"), parameters("roberts2003")
    requirements = read(["crossover >= 5 Hz", "phase margin >= 60 deg"])
    start = {"control.moment.f_c": 8.0}

    def labels(over: dict[str, list[float]]) -> list[str]:
        cases = cases_of(loop, par, 200.0, over)
        problem = Problem(loop.tunables, requirements, cases)
        found = corners_of(problem, start)
        slacks = [min(problem.slacks(problem.point(start), [k])[0]) for k in range(len(cases))]
        assert found[0].label == cases[1 + int(np.argmin(slacks[1:]))].label
        return [one.label for one in found]

    two = labels({"wedge.mu_B": [0.25, 0.35, 0.45], "moment": [100.0, 200.0, 300.0]})
    assert len(two) == 4
    assert set(two) == {
        f"wedge.mu_B = {mu:g}, moment = {moment:g} N*m"
        for mu in (0.25, 0.45)
        for moment in (100.0, 300.0)
    }
    names = ("wedge.mu_B", "motor_1.R_ref", "motor_1.L_M", "motor_1.J_M")
    many = {name: [0.9 * par.leaves()[name], par.leaves()[name]] for name in names}
    assert len(labels(many)) == MOST


def test_a_region_of_its_own_cannot_be_a_range() -> None:
    loop, par = LOOPS.find("pressure"), parameters("dardanelli2010")
    with pytest.raises(ParameterError, match="cannot vary because"):
        cases_of(loop, par, 20e5, {LOW_K_P: [1e-5]})
