"""The adjuster in the ECU of the simulated wedge brake, beside that of its life."""

import numpy as np
import pytest

import bywire
from bywire.brakes.wedge import life
from bywire.brakes.wedge.life import WEDGE_PADS
from bywire.core.errors import ParameterError
from bywire.report.answer import AnswerWarning

PERIOD = 0.5  # s from one application to the next


def ran(options=None, changes=None, faults=()):
    bench = bywire.Bench(
        "gap-adjusting", "roberts2003", changes or {}, options=options or {}, faults=faults
    )
    return bywire.run(bench, estimate_error=False)


def figures(result):
    return {kpi.name: kpi.value for kpi in result.kpis}


@pytest.fixture(scope="module")
def sound():
    return ran()


@pytest.fixture(scope="module")
def dragging():
    """With teeth twice as long as the ECU assumes, three of them press the pads on the disc."""
    with pytest.warns(AnswerWarning, match="current limit"):
        return ran(changes={"adjuster.tooth": 0.16e-3})


def test_it_turns_the_teeth_that_the_adjuster_of_a_life_turns(sound):
    run, seen = sound.recording, []
    z = life.begin(bywire.parameters("roberts2003-corner"), WEDGE_PADS.defaults())
    z = {**z, "clearance": 0.45e-3}
    for k in range(5):
        braked = run.sel(time=slice(k * PERIOD, (k + 1) * PERIOD - 1e-3))
        gap = float(braked["theta_c"].where(braked["mode"] == 2.0, drop=True).values[-1])
        gap *= sound.bench.par.control.adjuster.gap_slope_hat
        seen.append((gap - z["clearance"], float(braked["clearance"].values[-1])))
        readings = {"beyond": gap - z["clearance"], "T_disc": 293.15}
        z = life.between(
            z, readings, bywire.parameters("roberts2003-corner"), WEDGE_PADS.defaults()
        )
        assert float(braked["clicks"].values[-1]) == z["clicks"] == (3.0 if k > 1 else 0.0)
        assert seen[-1][1] == pytest.approx(z["clearance"], abs=1e-9)
    # As well as the moment control knows where the pads touch; docs/life.md states 2 and 5 um.
    assert max(abs(beyond) for beyond, _ in seen) < 6e-6


def test_it_brings_the_clearance_back_and_the_gap_is_crossed_sooner(sound):
    made = figures(sound)
    assert (made["clicks"], made["teeth_counted"], made["turned_after"]) == (3.0, 3.0, 3.0)
    assert made["clearance_end"] == pytest.approx(0.45e-3 - 3 * 0.08e-3, abs=1e-9)
    assert 0.2e-3 <= made["clearance_end"] <= 0.3e-3
    # 0.24 mm at 7 ms for each 0.1 mm, since the moment control knows of the teeth.
    assert made["contact_first"] - made["contact_last"] == pytest.approx(16.8e-3, abs=2e-3)
    assert abs(made["adjuster_work"]) < 1e-9


def test_it_turns_between_two_applications_and_records_what_it_is_at(sound):
    run = sound.recording
    turning = run["adjusting"].values == 2.0
    assert set(run["adjusting"].values) == {0.0, 1.0, 2.0}
    assert np.ptp(run["time"].values[turning]) < sound.bench.par.control.adjuster.T_adjust
    moving = np.abs(np.diff(run["clearance"].values)) > 1e-9
    assert not run["F_N"].values[1:][moving].any()
    assert not run["M_set"].values[1:][moving].any()


def test_an_application_before_the_brake_is_parked_is_no_other_one():
    made = ran({"t_pause": 0.02}).recording
    assert made["clicks"].values[-1] == 0.0
    assert not (made["mode"].sel(time=slice(0.1, None)).values == 0.0).any()


def test_what_it_presses_is_its_own_work_in_the_books(dragging):
    made, run = figures(dragging), dragging.recording
    assert made["clearance_end"] == pytest.approx(-0.03e-3, abs=1e-8)
    assert run["F_N"].sel(time=1.45, method="nearest") > 500.0
    stored = 0.5 * dragging.bench.par.caliper.K_cal * 0.03e-3**2
    assert made["adjuster_work"] == pytest.approx(stored, rel=0.2)  # the disc does the rest
    taken = sum(
        run[name]
        for name in (
            "E_copper",
            "E_damping",
            "E_shaft",
            "E_wedge",
            "E_heart",
            "E_caliper",
            "E_stop",
            "E_stored",
        )
    )
    lacking = (run["E_source"] - taken).values
    assert np.abs(lacking - lacking[0]).max() < 0.01 * made["adjuster_work"]


def test_it_gives_back_what_is_too_little():
    made = figures(ran({"more": -0.15e-3}))
    assert made["clicks"] < 0
    assert made["clearance_end"] >= 0.13e-3


def test_a_stuck_adjuster_costs_every_third_application():
    made = ran({"applications": 7, "t_hold": 0.3}, faults=[{"fault": "control.adjuster.stuck"}])
    run, late = made.recording, []
    for k in range(7):
        braked = run.sel(time=slice(k * 0.55, k * 0.55 + 0.3))
        late.append(float(braked["time"].values[np.argmax(braked["F_N"].values > 0)]) - k * 0.55)
    assert figures(made)["clicks"] == 0.0
    assert figures(made)["teeth_counted"] == 6.0
    # It believes in a gap that it did not take away, and creeps from there on.
    assert max(late[k] for k in (0, 1, 2, 4, 5)) < 0.065
    assert min(late[k] for k in (3, 6)) > 0.2


def test_its_faults_want_an_adjuster():
    with pytest.raises(ParameterError, match=r"control\.adjuster\.stuck.*adjuster\.law"):
        bywire.run("moment-ramp", faults=["control.adjuster.stuck"])
