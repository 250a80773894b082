"""Procedures: key figures in closed form, heat from stop to stop, verdicts, and bad input."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import bywire
from bywire.bench import running
from bywire.bench.bench import Bench
from bywire.core.errors import FileError, InputError
from bywire.plant import disc_heat
from bywire.procedures import cooling
from bywire.procedures.motion import Motion
from bywire.procedures.procedure_file import read_procedure
from bywire.procedures.sequence import NOT_SHOWN, run_stops
from bywire.usecases.evidence.readers import READERS

ROOT = Path(__file__).parents[2]
SHIPPED = sorted([*ROOT.glob("procedures/*.toml"), *ROOT.glob("examples/*/procedures/*.toml")])

HEAD = """
procedure = "Trial"
source = "chosen"
experiment = "straight-stop"
v_max = "200 km/h"
demand = ["p_front", "p_rear"]
[numbers.V]
value = "60 km/h"
source = "2.1.1"
[numbers.share]
missing = "S6"
"""
STOP = """
[[stops]]
name = "cold"
speed = "{V}"
limits.stopping_distance = "<= (0.1*V + V^2/115) m, V in km/h"
"""


@pytest.fixture
def plan_of(tmp_path):
    """Return a function that reads a procedure file of some text."""

    def read(text, overrides=()):
        file = tmp_path / "trial.toml"
        file.write_text(text)
        return read_procedure(file, dict(overrides))

    return read


# --- Key figures in closed form


@pytest.mark.parametrize(("v", "a"), [(30.0, 8.0), (50.0 / 3.6, 2.9)])
def test_a_constant_deceleration_gives_itself_and_its_distance(v, a):
    t = np.arange(-0.1, v / a + 0.5, 1e-3)
    after = np.maximum(t, 0.0)
    run = xr.Dataset(
        {
            "v": ("time", v - a * after),
            "x": ("time", v * t - 0.5 * a * after**2),
            "support": ("time", np.where(t < 0.7, 500.0, 0.0)),
        },
        {"time": t},
    )
    figures = {k.name: k for k in Motion("run", "v", "x", "support", {}).kpis({"run": run})}
    assert figures["mfdd"].value == pytest.approx(a, rel=1e-6)
    assert figures["stopping_distance"].value == pytest.approx(v * v / (2.0 * a), rel=1e-6)
    assert figures["stopping_time"].value == pytest.approx(v / a, rel=1e-9)
    assert figures["time_to_lift"].value == pytest.approx(0.7, abs=1.1e-3)


# --- Heat from stop to stop


def test_a_released_brake_cools_by_the_law_of_its_element():
    """Without convection by speed and radiation, the disc alone decays exponentially."""
    par = bywire.parameters("sport600").value("front.heat")
    law = par.replace(
        {"law": "lumped", "h_1": 0.0, "epsilon": 0.0, "G_open": 0.0, "G_pf": 0.0, "G_f": 0.0}
    )
    t = np.array([0.0, 10.0, 300.0])
    T = cooling.cooled(disc_heat.State(500.0, 400.0, 300.0), law, 20.0, t)
    decay = np.exp(-t * law.h_0 * law.A / law.C_d)
    assert T["T_disc"] == pytest.approx(law.T_a + (500.0 - law.T_a) * decay, rel=1e-9)
    assert T["T_pads"] == pytest.approx([400.0] * 3)


def test_a_sequence_equals_the_experiment_with_repeated_stops(plan_of):
    """The experiment repeats the stop with its own loop; its temperatures are the same."""
    changes = {"v_0": 100.0 / 3.6, "stops": 2.0, "pause": 20.0, "parked": 10.0}
    other = running.run(Bench("repeated-stops", options=changes))
    p_front, v_0 = other.kpi("pressure_cold").value, changes["v_0"]
    par = other.bench.par
    rear = 0.2 * par.vehicle.body.m * 8.0 * par.vehicle.rear_wheel.r
    p_rear = rear / (par.rear.disc.faces * par.rear.disc.mu_pad * par.rear.disc.A_cal)
    stop = running.run(
        Bench(
            "straight-stop",
            overrides={"front.heat.law": "lumped", "rear.heat.law": "lumped"},
            options={"v_0": v_0, "p_front": p_front, "p_rear": p_rear / par.rear.disc.r_eff},
        )
    )
    interval = stop.kpi("stopping_time").value + changes["pause"]
    text = (
        HEAD
        + f"""
[set]
options.p_front = "{p_front!r} Pa"
options.p_rear = "{p_rear / par.rear.disc.r_eff!r} Pa"
[[stops]]
name = "again"
speed = "100 km/h"
count = 2
interval = "{interval!r} s"
judged = false
"""
    )
    made = run_stops(plan_of(text)).stops
    assert [each.first for each in made] == [1, 2]
    for k, each in enumerate(made, 1):
        for name in ("disc_before", "disc_after"):
            expected = other.kpi(f"{name}_{k}").value
            assert each.kpi(name).value == pytest.approx(expected, abs=2e-3)
    assert made[1].begin == pytest.approx(interval)


def test_a_temperature_is_set_and_stops_without_an_interval_are_simulated_once(plan_of):
    text = HEAD + STOP.replace("limits", 'T_brake = "400 degC"\ncount = 4\nlimits')
    (stop,) = run_stops(plan_of(text), estimate_error=False).stops
    assert (stop.first, stop.count) == (1, 4)
    assert stop.kpi("disc_before").value == pytest.approx(673.15)
    (cold,) = run_stops(plan_of(HEAD + STOP), estimate_error=False).stops
    assert stop.kpi("stopping_distance").value > cold.kpi("stopping_distance").value  # fades


def test_a_demand_is_adjusted_to_a_deceleration_and_then_stays(plan_of):
    text = (
        HEAD
        + """
[set]
options.duration = "6 s"
[[stops]]
name = "snubs"
speed = "40 km/h"
until = "50 %"
count = 2
interval = "30 s"
deceleration = "3 m/s^2"
judged = false
"""
    )
    first, second = run_stops(plan_of(text)).stops
    assert first.kpi("mfdd").value == pytest.approx(3.0, rel=1e-3)
    assert first.kpi("demand_p_front").value == second.kpi("demand_p_front").value < 10e5
    assert first.course["v"][-1] == pytest.approx(20.0 / 3.6, abs=4e-3)


# --- Verdicts


def test_limits_are_judged_at_the_speed_and_relative_to_an_earlier_stop(plan_of):
    text = (
        HEAD
        + STOP
        + """
[[stops]]
name = "later"
speed = ["90 km/h", "25 % of v_max"]
limits.mfdd = [">= 105 % of cold", ">= {share} of cold"]
limits.stopping_distance = "<= {share}"
"""
    )
    made = run_stops(plan_of(text))
    cold, later = made.stops
    assert cold.plan.v_0 == pytest.approx(60.0 / 3.6)
    assert later.plan.v_0 == pytest.approx(50.0 / 3.6)
    (verdict,) = cold.verdicts
    assert (verdict.limit, verdict.outcome) == ("<= 37.3043 m", "met")
    assert 0.0 < verdict.error < 1e-3
    (relative,) = later.verdicts
    assert relative.required.bound == pytest.approx(1.05 * cold.kpi("mfdd").value)
    assert relative.outcome == "missed"
    assert [each.outcome for each in later.gaps] == [NOT_SHOWN, NOT_SHOWN]
    assert made.status == "failed"


def test_a_limit_within_the_numerical_error_is_undecided(plan_of):
    exact = run_stops(plan_of(HEAD + STOP)).stops[0].kpi("stopping_distance").value
    text = STOP[: STOP.index("limits")] + f'limits.stopping_distance = "<= {exact!r} m"\n'
    result = run_stops(plan_of(HEAD + text))
    assert result.verdicts[0].outcome == "undecided"
    assert result.status == "undecided"


def test_a_missing_number_leaves_its_stops_out_and_never_passes(plan_of):
    text = (
        HEAD
        + """
[[stops]]
name = "heating"
speed = "{share}"
interval = "40 s"
judged = false
[[stops]]
name = "hot"
speed = "{V}"
interval = "60 s"
limits.mfdd = ">= 1 m/s^2"
"""
    )
    made = run_stops(plan_of(text))
    assert not made.verdicts
    assert [gap.figure for gap in made.gaps] == ["mfdd"]
    assert "was not run" in made.gaps[0].reason
    assert made.status == "incomplete"
    changed = plan_of(text, {"numbers.share": "40 km/h", "v_max": "150 km/h"}.items())
    assert changed.v_max == pytest.approx(150.0 / 3.6)
    assert changed.stops[0].v_0 == pytest.approx(40.0 / 3.6)
    assert changed.numbers[1].source == "set by the user"


def test_a_stop_that_does_not_end_misses_its_limit_and_leaves_no_heat(plan_of):
    weak = STOP.replace("limits", 'set."options.p_front" = "0 bar"\nlimits')
    text = (
        HEAD
        + weak
        + f"""
[[stops]]
{HOT.replace("cold", "hot")}interval = "30 s"
"""
    )
    made = run_stops(plan_of(text), estimate_error=False)
    assert [each.outcome for each in made.verdicts] == ["missed"]
    assert "does not stop" in made.verdicts[0].note
    assert [gap.figure for gap in made.gaps] == ["mfdd"]


# --- Bad input

HOT = 'name = "cold"\nspeed = "60 km/h"\nlimits.mfdd = ">= 1 m/s^2"\n'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "procedure is missing"),
        (HEAD, r"at least one \[\[stops\]\]"),
        (HEAD + "[[stops]]\nspeed = '1 m/s'", "name is missing"),
        (HEAD + STOP + "gap = '3 s'", "unknown key of .*'gap'"),
        (HEAD + STOP + STOP, r"'cold' \(line 18\) occurs twice"),
        (HEAD + "[[stops]]\nname = 'a'\nspeed = '{V}'", r"'a' \(line 12\) has no limit"),
        (HEAD + f"[[stops]]\n{HOT}interval = '-3 s'", "interval = '-3 s' .* > 0 s"),
        (HEAD + f"[[stops]]\n{HOT}interval = '3 m'", "cannot be converted to s"),
        (HEAD + f"[[stops]]\n{HOT}interval = '3'", "interval"),
        (HEAD + f"[[stops]]\n{HOT}interval = '25 h'", "interval = '25 h' .* <= 24 h"),
        (HEAD + f"[[stops]]\n{HOT}cooling_speed = '201 km/h'", "cooling_speed .* <= v_max"),
        (HEAD + f"[[stops]]\n{HOT}interval = 3", "interval = 3: write it in quotation marks"),
        (HEAD + f"[[stops]]\n{HOT}until = '50 km/h'", "a percentage"),
        (HEAD + f"[[stops]]\n{HOT}set.'options.v_0' = '3 m/s'", "Change speed instead"),
        (HEAD + f"[[stops]]\n{HOT}count = 0", "whole number from 1"),
        (
            HEAD + f"[[stops]]\n{HOT}set.'options.p_front' = '3 m'",
            "p_front = '3 m' has the wrong unit",
        ),
        (HEAD + f"[[stops]]\n{HOT}set.'options.p_frnt' = '3 bar'", "p_front"),
        (HEAD + STOP.replace("{V}", "230 km/h"), "<= v_max = 200 km/h"),
        (HEAD + STOP.replace("{V}", "{W}"), "unknown number of the procedure 'W'"),
        (HEAD + STOP.replace("stopping_distance", "stoping_distance"), "'stopping_distance'"),
        (HEAD + STOP.replace(") m,", ") s,"), "cannot be converted to m"),
        (HEAD + STOP.replace('"<=', '">= 60 % of hot" #'), "unknown earlier stop"),
        (HEAD + STOP.replace("limits", "limits.mfdd = 4.4\nlimits"), "in quotation marks"),
        (HEAD.replace('source = "2.1.1"', "") + STOP, "a value without a source"),
        (HEAD.replace('missing = "S6"', "") + STOP, "either value and source, or missing"),
        (HEAD.replace("straight-stop", "hard-braking") + STOP, "has no option v_0"),
        (HEAD.replace("straight-stop", "strait-stop") + STOP, "'straight-stop'"),
        (HEAD.replace("straight-stop", "../a.toml") + STOP, "unknown experiment"),
        (HEAD.replace("straight-stop", "bandwidths") + STOP, "makes 7 runs"),
        (HEAD.replace("p_front", "p_middle") + STOP, "p_middle"),
        (HEAD.replace("200 km/h", "0 km/h") + STOP, "v_max = '0 km/h'"),
    ],
)
def test_bad_files_are_rejected_with_file_and_key(plan_of, text, says):
    with pytest.raises(InputError, match=says) as caught:
        plan_of(text)
    assert str(caught.value).startswith(str(caught.value).split("trial.toml")[0] + "trial.toml: ")


def test_an_interval_shorter_than_the_stop_is_rejected_when_it_runs(plan_of):
    text = HEAD + f"[[stops]]\n{HOT}count = 2\ninterval = '1 s'"
    with pytest.raises(InputError, match="interval = 1 s is not valid"):
        run_stops(plan_of(text), estimate_error=False)


def test_other_files_are_rejected_with_their_command(plan_of, tmp_path):
    with pytest.raises(InputError, match="bywire life"):
        plan_of('life = "wedge-pads"')
    with pytest.raises(FileError, match="procedure file"):
        read_procedure(tmp_path / "none.toml")
    file = tmp_path / "p.toml"
    file.write_text(HEAD + STOP)
    with pytest.raises(InputError, match="bywire procedure"):
        bywire.run(file)


# --- Shipped procedures


@pytest.fixture(scope="module")
def one_box():
    """Load the one-box brake."""
    bywire.load_system(ROOT / "examples/one_box")


@pytest.mark.parametrize("key", ['T_brake = "350 K"', 'interval = "60 s"'])
def test_brakes_that_do_not_warm_up_accept_no_temperatures(plan_of, one_box, key):
    text = (ROOT / "examples/one_box/procedures/cold_effectiveness.toml").read_text()
    with pytest.raises(InputError, match="would have no effect because the brakes"):
        plan_of(text.replace("[[stops]]", f"[[stops]]\n{key}", 1))


def test_a_procedure_is_evidence_that_changes_with_its_content(plan_of, tmp_path):
    def task_of(text):
        plan_of(text)
        return READERS["procedure"]("trial.toml", {}, tmp_path)

    task = task_of(HEAD + STOP)
    assert task.limit("mfdd >= 4 m/s^2").unit == "m/s**2"
    with pytest.raises(InputError, match="'mfdd'"):
        task.limit("mfd >= 4 m/s^2")
    assert task_of(f"# remark\n{HEAD}{STOP}").digest == task.digest
    for old, new in (("V^2/115", "V^2/116"), ("60 km/h", "61 km/h")):
        assert task_of((HEAD + STOP).replace(old, new)).digest != task.digest


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_shipped_procedures_cite_every_number(file, one_box):
    plan = read_procedure(file)
    assert plan.source
    assert plan.missing
    assert all(each.source for each in plan.numbers)
    assert all(stop.source for stop in plan.stops if stop.limits)


def test_the_result_has_a_page_json_and_a_verdict(tmp_path, plan_of):
    plan_of(HEAD + STOP)
    result = bywire.run_procedure(tmp_path / "trial.toml", estimate_error=False)
    facts = result.as_object()
    assert (facts["status"], result.holds, result.outcome) == ("passed", True, "met")
    assert result.key_figures[0].at == "cold 1"
    (stop,) = facts["stops"]
    assert stop["requirements"][0]["limit"] == "<= 37.3043 m"
    assert stop["conditions"]["v_0"] == pytest.approx(60.0 / 3.6)
    assert facts["numbers"]["share"] == {"value": None, "source": "S6"}
    assert {"Limits", "Stops", "Numbers"} <= set(result.tables())
    assert result.plot("limits") is not None
