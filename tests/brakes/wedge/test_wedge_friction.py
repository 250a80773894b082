"""The wedge brake over the friction of its pads: closed loop, and force at rest."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from wedge_runs import TAN_ALPHA

import bywire
from bywire.brakes.wedge.case import tag
from bywire.core.errors import UnknownNameError
from run_once import run_once

NAMES = ("friction-sweep", "static-force")


@pytest.fixture(scope="module")
def results():
    return {name: run_once(bywire.Bench(name, "roberts2003")) for name in NAMES}


def values(result):
    return {kpi.name: kpi.value for kpi in result.kpis}


def sweep(options, **overrides):
    changes = {key.replace("__", "."): value for key, value in overrides.items()}
    bench = bywire.Bench("friction-sweep", "roberts2003", changes, options, step=40e-6)
    return run_once(bench)


def test_every_substep_settles_and_nothing_warns(results):
    for result in results.values():
        assert result.warnings == []
        for recording in result.recordings.values():
            assert recording.attrs["unsettled_substeps"] == 0


def test_loop_is_stable_over_friction(results):
    kpi = values(results["friction-sweep"])
    assert kpi["unstable"] == 0.0
    for mu_B in (0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6):
        assert kpi[f"stable_{tag(mu_B)}"] == 1.0
        assert kpi[f"overshoot_{tag(mu_B)}"] < 0.1
        assert kpi[f"settling_time_{tag(mu_B)}"] < 0.12
        assert 20.0 < kpi[f"hold_power_{tag(mu_B)}"] < 30.0


@pytest.mark.parametrize(("slope", "overshoot"), [("known", 0.1), ("fixed", 6.0)])
def test_loop_is_stable_without_the_help_of_friction(slope, overshoot):
    kpi = values(sweep({"friction": "none", "slope": slope}))
    assert kpi["unstable"] == 0.0
    assert kpi["overshoot_max"] < overshoot


def test_sweep_sees_a_loop_that_is_too_fast():
    """A moment loop faster than the position loop inside it oscillates at every friction."""
    result = sweep({"friction": "none", "mu_B": (0.2, 0.6)}, control__moment__f_c=80.0)
    assert values(result)["unstable"] == 2.0
    assert len(result.warnings) == 2
    assert all("limit" in text and "20 A" in text for text in result.warnings)


def test_key_figures_follow_the_table():
    bench = bywire.Bench(
        "friction-sweep",
        "roberts2003",
        options={"mu_B": (0.355,), "t_hold": 0.3},
        requirements={"overshoot_mu35p5": "<= 5 %"},
    )
    assert run_once(bench).status == "passed"
    with pytest.raises(UnknownNameError, match=r"unknown KPI .*'overshoot_mu35'"):
        replace(bench, requirements={"overshoot_mu35": "<= 5 %"})


# Force at rest


def test_actuation_force_and_brake_factor(results):
    kpi = values(results["static-force"])
    assert kpi["F_M_error"] < 0.1
    assert kpi["C_star_error"] < 0.1
    assert kpi["neutral_mu"] == pytest.approx(TAN_ALPHA, abs=1e-6)
    assert kpi["C_star_mu20"] == pytest.approx(0.4 / (TAN_ALPHA - 0.2), rel=1e-6)
    assert kpi["C_star_mu60"] == pytest.approx(1.2 / (TAN_ALPHA - 0.6), rel=1e-6)
    assert kpi["neutral_mu_falling"] < TAN_ALPHA < kpi["neutral_mu_rising"]


@pytest.mark.parametrize("mu_B", [0.2, 0.3, 0.35, 0.4, 0.5, 0.6])
def test_friction_makes_a_band_of_forces(results, mu_B):
    """Half as wide as the friction on the sliding wedge, by interfaces and rollers."""
    result, at = results["static-force"], tag(mu_B)
    kpi = values(result)
    width = kpi[f"F_M_rising_{at}"] - kpi[f"F_M_falling_{at}"]
    ramps = result.recordings[f"friction-{at}"].sel(time=slice(0.55, 1.45))
    friction = result.bench.par.wedge_friction
    squeeze = float((ramps["f_1"] + ramps["f_2"]).mean())
    F_N = float(ramps["F_N"].mean())
    bound = friction.mu_int * squeeze * TAN_ALPHA + friction.mu_R * F_N
    assert 0.5 * width == pytest.approx(bound, rel=0.1)
    assert kpi[f"F_M_falling_{at}"] < kpi[f"F_M_{at}"] < kpi[f"F_M_rising_{at}"]


# Odd options

ODD = [
    ("friction-sweep", {"M_step": 2.0, "mu_B": (0.3,)}),
    ("friction-sweep", {"t_hold": 0.002, "mu_B": (1.5,)}),
    ("static-force", {"mu_B": (1.2, 0.36397023426620234), "t_hold": 0.001}),
    ("static-force", {"M_hold": 2.0, "mu_B": (0.3,), "t_ramp": 0.001, "t_start": 0.001}),
]


@pytest.mark.parametrize(("name", "options"), ODD)
def test_odd_options_give_figures_or_reasons(name, options):
    bench = bywire.Bench(name, "roberts2003", options=options, step=40e-6)
    for kpi in run_once(bench).kpis:
        assert math.isfinite(kpi.value) or kpi.note, kpi.name
