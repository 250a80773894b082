"""Campaigns of faults: effects, times and coverage as single runs show them; kept and resumed."""

from __future__ import annotations

import json
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest

import bywire
from bywire.api.run_faults import FaultCampaign
from bywire.bench.running import run
from bywire.campaigns.campaign_file import read_campaign
from bywire.campaigns.judging import FACTORS, faulty_traces, healthy_traces, judge_healthy
from bywire.campaigns.plan import Criterion
from bywire.campaigns.residual import (
    NEVER,
    detected,
    first_time,
    least_of_the_last,
    mean_of_the_last,
    threshold,
)
from bywire.campaigns.running import CampaignFindings, CampaignStore, FaultFinding, finding
from bywire.core.errors import DeviceError, FileError, InputError
from bywire.simulation.cuda_device import find_device

SMALL = """
bench = "hard-braking"
[set]
"options.p_from" = "36 bar"
"options.p_to" = "37 bar"
"options.settle" = "0.1 s"
"options.duration" = "0.6 s"
[vary]
"motor.R_m" = "+-10 %"
"seal.T_pr" = "+-10 %"
[campaign]
only = ["pressure.stuck", "battery.lost", "motor.hot", "ecu.frozen", "bridge.late", "fluid.cold"]
present = ["fluid.*"]
onset = "0.4 s"
spread = "20 ms"
onsets = 2
healthy = 8
[values]
"pressure.stuck" = ["0 bar", "50 bar"]
[[criteria]]
name = "loss"
signal = "p_pd"
below_share = "80 %"
lasting = "20 ms"
severity = "S2"
[[criteria]]
name = "too much"
signal = "p_pd"
above_healthy = "5 bar"
lasting = "20 ms"
severity = "S3"
[rates]
"pressure.stuck" = 3
battery = 1
[reaction]
fault = "bridge.open-phase"
delay = "5 ms"
"""
LAWS = "{ kind = 'discrete', values = ['ideal', 'quantized'] }"


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """Return a campaign file of seven faults and two onsets."""
    path = tmp_path_factory.mktemp("campaign") / "small.toml"
    path.write_text(SMALL)
    return path


@pytest.fixture(scope="module")
def folder(file):
    """Return the folder that the campaign is run into."""
    return file.parent / "out"


@pytest.fixture(scope="module")
def campaign(file, folder):
    """Return the campaign, run."""
    return bywire.run_faults(file, folder)


def of(campaign, name):
    return [each for each in campaign.findings.faults if each.failing.mode.name == name]


def test_a_fault_does_in_the_campaign_what_it_does_alone(campaign):
    plan = campaign.findings.plan
    for name, sign in (("pressure.stuck", 1), ("battery.lost", -1)):
        each = of(campaign, name)[0]
        number = plan.faults.index(each.failing)
        for k, onset in enumerate(plan.onsets):
            sample = plan.sample_of(number * len(plan.onsets) + k)
            section = {"fault": name, "value": 0.0, "onset": onset}
            section = section if each.failing.mode.unit else {"fault": name, "onset": onset}
            benches = [plan.benches[sample], plan.benches[sample]]
            healthy, alone = (
                run(bench.varied({}, {}) if faults is None else _with(bench, faults)).recording
                for bench, faults in zip(benches, (None, section), strict=True)
            )
            off = (alone["p_pd"] - healthy["p_pd"]).values
            extremes = each.extremes["p_pd"]
            assert extremes[0][k] == pytest.approx(off.min(), rel=1e-6, abs=1.0)
            assert extremes[1][k] == pytest.approx(off.max(), rel=1e-6, abs=1.0)
            time, level = alone["time"].values, alone["p_pd"].values
            beyond = off > 5e5 if sign > 0 else level < 0.8 * healthy["p_pd"].values
            begins = time[np.flatnonzero(beyond & (time >= onset))[0]]
            assert each.violated[k] == pytest.approx(begins + 0.02 - onset, abs=2e-3)


def _with(bench, section):
    """Return a bench with a fault and the same scatter and noise."""
    flat = {name: bench.par.value(name) for name in ("motor.R_m", "seal.T_pr")}
    made = bywire.Bench(
        bench.experiment,
        bench.parameters,
        overrides=flat,
        options=bench.options,
        seed=bench.seed,
        faults=[section],
    )
    assert made.par == bench.par
    return made


def test_classes_coverage_and_reaction_follow_from_the_runs(campaign):
    findings = campaign.findings
    assert len(findings.faults) == 7
    kinds = {
        f"{each.failing.mode.name} {each.failing.value:g}": each.kind for each in findings.faults
    }
    assert kinds["battery.lost 0"] == kinds["pressure.stuck 0"] == "covered"
    assert kinds["fluid.cold 3"] in ("latent", "harmless, seen")
    # Where a residual alarms at the same instant by chance, it may stand first.
    assert np.all(of(campaign, "ecu.frozen")[0].detected["watchdog.ecu"] <= 1.001e-3)
    low, high = of(campaign, "pressure.stuck")
    assert (*low.criteria, *high.criteria) == ("too much", "loss")
    assert (low.severity(findings.plan), high.severity(findings.plan)) == ("S3", "S2")
    assert of(campaign, "motor.hot")[0].severity(findings.plan) == ""
    # Opened in time the bridge leaves a sensor that reads nothing without its overshoot.
    assert low.dangerous == 2
    assert np.isnan(low.reacted["too much"]).all()
    weights = {"pressure.stuck": 3.0, "battery.lost": 1.0, "ecu.frozen": 1.0}
    dangerous = [each for each in findings.faults if each.dangerous]
    total = sum(weights[e.failing.mode.name] * e.dangerous for e in dangerous)
    seen = sum(weights[e.failing.mode.name] * e.in_time for e in dangerous)
    assert findings.coverage == pytest.approx(seen / total)
    assert findings.is_weighted
    object_ = campaign.as_object()
    assert json.loads(json.dumps(object_))["runs"] == 14
    tables = campaign.tables()
    assert {*tables} >= {"Faults", "Residuals", "Criteria"}
    frame = tables["Faults"]
    assert frame.attrs["units"] == {"within": "s", "seen within": "s"}
    tolerances = [e.tolerance for e in findings.faults]  # the table begins with the worst fault
    np.testing.assert_equal(np.sort(frame["within"]), np.sort(tolerances))
    assert tables["Residuals"]["false alarms"].dtype.kind == "i"
    assert len(campaign.write(campaign.folder)) >= 3


def test_healthy_halves_are_apart_and_alarms_fall_with_the_threshold(campaign):
    plan, healthy = campaign.findings.plan, campaign.findings.healthy
    assert {plan.sample_of(k) for k in range(100)} == set(range(4, 8))
    for counts in healthy.alarms.values():
        assert counts == sorted(counts, reverse=True)
        assert counts[-1] == 0
    again = judge_healthy(plan, healthy_traces(plan))
    assert again.thresholds == healthy.thresholds
    assert len(FACTORS) == len(next(iter(healthy.alarms.values())))


def test_what_was_killed_goes_on_with_the_same_bits(campaign, file, folder, monkeypatch):
    threads, keep = set(), CampaignStore.keep
    monkeypatch.setattr(
        CampaignStore,
        "keep",
        lambda *given: (threads.add(threading.current_thread()), keep(*given)),
    )
    kept = sorted((folder / "faults").glob("*.json"))
    texts = [path.read_bytes() for path in kept]
    kept[1].unlink()
    kept[2].write_text('{"reached"')  # a damaged one
    again = bywire.run_faults(file, folder)
    assert [path.read_bytes() for path in kept] == texts
    # Two that write into one folder at a time would take each other's scratch files away.
    assert threads == {threading.main_thread()}
    first = CampaignFindings(
        campaign.findings.plan,
        campaign.findings.healthy,
        tuple(finding(campaign.findings.plan, k, json.loads(text)) for k, text in enumerate(texts)),
    )
    assert again.findings.coverage == first.coverage == campaign.findings.coverage
    with pytest.raises(FileError, match="contains another campaign"):
        bywire.run_faults(file, folder, {"options.p_to": "36.5 bar"})


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("[campaign]", "[campain]", "unknown key of a campaign file 'campain'"),
        ('"motor.hot"', '"motor.hott"', "unknown fault of .campaign. only 'motor.hott'"),
        ('onset = "0.4 s"', 'onset = "0.9 s"', "must be in the range"),
        ("healthy = 8", "healthy = 2", "a whole number from 4"),
        ('"pressure.stuck" = ["0 bar"', '"pressure.stuck" = ["0 A"', "wrong unit"),
        ('signal = "p_pd"\nbelow', 'signal = "p_pads"\nbelow', "unknown signal of criterion"),
        ('below_share = "80 %"', 'beneath = "80 %"', "unknown key of ..criteria.. 'beneath'"),
        ('below_share = "80 %"', 'above = "1 bar"\nbelow = "2 bar"', "needs exactly one of"),
        ('name = "too much"', 'name = "loss"', "occurs twice"),
        ("battery = 1", "batery = 1", "unknown fault in .rates. 'batery'"),
        ('delay = "5 ms"', 'delay = "-5 ms"', "must be >= 0 ms"),
        ('"motor.R_m" = "+-10 %"', f'"adc.law" = {LAWS}', "only numbers can vary"),
        (
            'bench = "hard-braking"',
            'bench = "hard-braking"\nresiduals = ["x"]',
            "unknown residual 'x'",
        ),
        (
            'bench = "hard-braking"',
            'bench = "hard-braking"\nresiduals = [["x"]]',
            "must be a list of names",
        ),
        ("healthy = 8", "healthy = 1000000", "a whole number from 4 to 10000"),
        ('"0 bar", "50 bar"]', "20]", "wrong unit"),
        ('["0 bar", "50 bar"]', "[]", "or use leave_out"),
        ("[values]", '[values]\n"battery.lost" = 3', "battery.lost: this fault has no value"),
        ('above_healthy = "5 bar"', "above_healthy = 5", "wrong unit"),
        ('signal = "p_pd"\nbelow', 'signal = ["p_pd"]\nbelow', "unknown signal of criterion"),
        ("present =", 'leave_out = ["*"]\npresent =', "contains no faults"),
        ('delay = "5 ms"', "value = 3", "bridge.open-phase has no value"),
        ("battery = 1", "battery = 1" + "0" * 400, "battery = a number of 300 digits or more"),
        ("battery = 1", "battery = 1e13", "a number from 0 to 1e12"),
        (SMALL, 'bench = "bandwidths"', "'bandwidths' has 7 runs"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path, right, wrong, message):
    assert SMALL.count(right) >= 1
    (tmp_path / "bad.toml").write_text(SMALL.replace(right, wrong, 1))
    with pytest.raises(InputError, match=message):
        read_campaign(tmp_path / "bad.toml")


def test_a_campaign_is_computed_by_the_engine_of_its_bench(campaign, monkeypatch):
    monkeypatch.setitem(sys.modules, "cuda.bindings.driver", None)
    find_device.cache_clear()
    plan = campaign.findings.plan
    with pytest.raises(DeviceError, match="engine 'cuda' needs"):
        healthy_traces(replace(plan, bench=replace(plan.bench, engine="cuda")))


def test_a_campaign_that_does_not_fit_into_memory_is_refused(tmp_path):
    text = SMALL.replace("healthy = 8", "healthy = 1000").replace('"0.6 s"', '"600 s"')
    text = text.partition("[vary]")[0] + "[campaign]" + text.partition("[campaign]")[2]
    (tmp_path / "large.toml").write_text(text)
    with pytest.raises(InputError, match=r"1000 runs with 6e\+05 rows of"):
        read_campaign(tmp_path / "large.toml")


def test_a_reaction_may_be_a_fault_that_the_campaign_leaves_out(tmp_path):
    text = SMALL.replace('"bridge.open-phase"', '"current.stuck"').replace('"0.6 s"', '"0.5 s"')
    text = text.replace(
        '["pressure.stuck", "battery.lost", "motor.hot", "ecu.frozen", '
        '"bridge.late", "fluid.cold"]',
        '["pressure.*"]',
    )
    (tmp_path / "other.toml").write_text(text)
    plan = read_campaign(tmp_path / "other.toml")
    assert [tap.name for tap in plan.taps[0]] == ["current", "pressure"]
    stuck = next(each for each in plan.faults if each.mode.name == "pressure.stuck")
    traces = faulty_traces(plan, stuck, [0.4], [4], [0.42])
    assert np.isfinite(traces.signals["p_pd"]).all()


def test_a_drift_that_is_there_from_the_start_grows_from_time_zero():
    drift = next(
        each for each in read_campaign("motorcycle").faults if each.mode.name == "pressure.drift"
    )
    (fault,) = replace(drift, is_present=True).at(0.0, 0)
    assert fault.course.onset == 0.0


def test_what_must_not_last_longer_than_the_run_is_not_reached():
    criterion = Criterion("c", "p_pd", "above", 0.0, lasting=1e308)
    time = np.arange(5.0) * 1e-3
    reached = criterion.reached(np.ones((1, 5)), np.zeros((1, 5)), time, np.zeros(1))
    assert np.isnan(reached).all()
    assert least_of_the_last(np.ones((1, 5)), 0).shape == (1, 5)


def test_campaigns_of_brakes_can_be_read_and_others_are_not_known():
    for name in ("motorcycle", "wedge", "two-wheeler"):
        plan = read_campaign(name)
        assert plan.total >= 160
        assert plan.residuals
        assert {each.assembly for each in plan.residuals} <= {plan.case(0).model.name}
    with pytest.raises(InputError, match="did you mean 'motorcycle'"):
        read_campaign("motorcycel")


def test_faults_of_what_a_bench_lacks_are_left_out():
    without, adjusted = (
        {each.mode.name for each in read_campaign("wedge", changes).faults}
        for changes in ({}, {"adjuster.law": "screw"})
    )
    assert not [name for name in without if "adjuster" in name]
    assert "control.adjuster.stuck" in adjusted
    assert {name.partition(".")[0] for name in adjusted - without} == {"control", "adjuster"}


def test_double_faults_stand_beside_the_latent_one(tmp_path):
    text = (
        SMALL.replace("present =", 'latent = ["seal.swollen"]\npresent =')
        .replace("healthy = 8", "healthy = 4")
        .replace(', "ecu.frozen", "bridge.late", "fluid.cold"]', ', "fluid.cold"]')
    )
    text = text.replace('"pressure.stuck" = ["0 bar", "50 bar"]', '"seal.swollen" = 3')
    (tmp_path / "pairs.toml").write_text(text.replace('"pressure.stuck", ', ""))
    campaign = bywire.run_faults(tmp_path / "pairs.toml")
    single, double = of(campaign, "battery.lost")
    assert (single.failing.latent, double.failing.latent.mode.name) == (None, "seal.swollen")
    # Swollen seals hold the brake without power: the loss of the battery does not release it.
    assert single.dangerous == 2
    assert double.dangerous == 0
    assert "battery.lost after seal.swollen 3" in [f.failing.name for f in campaign.findings.faults]


def test_a_residual_that_is_never_looked_at_sees_nothing_by_any_threshold(campaign):
    plan = campaign.findings.plan
    alive = plan.residuals[0]
    dead = replace(
        alive,
        name="dead",
        compute=lambda signals, par, dt: np.where(signals["i_meas"] < 1e3, NEVER, 0.0),
    )
    judged = judge_healthy(replace(plan, residuals=(alive, dead)), healthy_traces(plan))
    assert judged.thresholds["dead"] == NEVER
    assert not any(judged.alarms["dead"])
    assert any(judged.alarms[alive.name])


def test_an_interrupt_says_what_is_kept(campaign, file, folder):
    (folder / "faults" / "0003.json").unlink()

    def interrupt(label, share):
        if share > 0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match=r"7 of 7 faults are saved\. Rerun the command"):
        bywire.run_faults(file, folder, progress=interrupt)


def test_what_lasts_is_counted_over_the_rows_before():
    values = np.array([[0.0, 3.0, 1.0, 2.0, 5.0, 4.0]])
    assert least_of_the_last(values, 2)[0].tolist() == [0, 0, 1, 1, 2, 4]
    assert mean_of_the_last(values, 2)[0, 1:].tolist() == [1.5, 2.0, 1.5, 3.5, 4.5]
    time = np.arange(6.0)
    assert first_time(values > 2, time, np.array([2.0])).tolist() == [4.0]
    assert np.isnan(first_time(values > 9, time, np.array([0.0]))).all()
    assert threshold(np.arange(100.0), 0.02) == 97.0
    assert threshold(np.arange(10.0), 0.01) == 9.0
    shown = np.array([[0.0, 1.0, 2.0]])
    assert detected(shown, 0.5, np.arange(3.0), np.zeros(1)).tolist() == [1.0]
    assert np.isnan(detected(shown, NEVER, np.arange(3.0), np.zeros(1))).all()


def hand_made(plan, loss, reacted, answered, seen=0.01):
    """Return a finding of two runs: when each violates "loss", and with the reaction."""
    never = np.full(2, np.nan)
    return FaultFinding(
        plan.faults[0],
        {"loss": np.array(loss), "too much": never},
        {each.name: np.full((len(FACTORS), 2), seen) for each in plan.watched},
        {},
        {"loss": np.array(reacted), "too much": never[: len(answered)]} if answered else {},
        answered,
    )


def test_harm_done_by_the_reaction_is_counted_run_by_run(campaign):
    plan, nan = campaign.findings.plan, np.nan
    faults = (
        hand_made(plan, [nan, nan], [0.1, 0.1], [0, 1]),  # harmless, seen: the reaction costs it
        hand_made(plan, [nan, nan], [nan, nan], [0, 1]),  # harmless with and without
        hand_made(plan, [nan, nan], [], [], seen=nan),  # latent, never answered
        hand_made(plan, [0.3, nan], [0.2, nan], [0, 1]),  # dangerous, and sooner so
        hand_made(plan, [0.3, nan], [0.2], [1]),  # the other run becomes dangerous
        hand_made(plan, [0.3, nan], [nan, nan], [0, 1]),  # relieved
    )
    found = CampaignFindings(plan, campaign.findings.healthy, faults)
    harmed = {k: each.only_with_reaction for k, each in enumerate(faults)}
    assert {k: counts for k, counts in harmed.items() if counts} == {0: {"loss": 2}, 4: {"loss": 1}}
    assert [each.is_relieved for each in faults] == [False] * 5 + [True]
    assert found.harm_of_reaction() == (
        "the reaction, bridge.open-phase, is harmful: it alone causes loss in 2 of 6 faults "
        "(1 of 2 harmless, seen; 1 of 3 dangerous)",
        "the reaction, bridge.open-phase, hastens loss in 1 of 3 dangerous faults",
    )
    assert found.benefit_of_reaction() == (
        "the reaction prevents loss in 1 of 3 dangerous faults, and makes 1 of 3 dangerous faults "
        "harmless"
    )
    shown = FaultCampaign(found)
    assert str(shown).count(", bridge.open-phase, is harmful: ") == 1
    assert next(iter(shown.as_object())) == "headline"
    banner = shown.document().banner
    assert banner.text.startswith("0 of 3 dangerous faults are undetected or detected too late. ")
    assert " The reaction, bridge.open-phase, is harmful: " in banner.text
    calm = FaultCampaign(CampaignFindings(plan, campaign.findings.healthy, faults[1:3]))
    assert not calm.warnings
    assert "headline" not in calm.as_object()


def test_a_campaign_warns_of_what_its_runs_warn_of(campaign, tmp_path):
    text = SMALL.replace('"motor.R_m" = "+-10 %"\n', "", 1)
    text = text.replace("[vary]", '"pressure_sensor.p_high" = "34 bar"\n[vary]', 1)
    text = text.replace(
        'only = ["pressure.stuck", "battery.lost", "motor.hot",', 'only = ["motor.hot",'
    )
    text = text[: text.index("[values]")] + text[text.index("[[criteria]]") :]
    text = text.replace('["motor.hot", "ecu.frozen", "bridge.late", "fluid.cold"]', '["motor.hot"]')
    (tmp_path / "clipped.toml").write_text(text.replace("healthy = 8", "healthy = 4"))
    found = bywire.run_faults(tmp_path / "clipped.toml")
    assert any(
        "fault-free run: the pressure leaves the sensor's range" in each for each in found.warnings
    )
    assert not campaign.warnings or "fault-free run" not in " ".join(campaign.warnings)
    doubtful = replace(campaign.findings.faults[0], doubts=("3 substeps hit the cap",))
    findings = replace(campaign.findings, faults=(doubtful, *campaign.findings.faults[1:]))
    assert findings.doubts == ("runs with 1 of the faults: 3 substeps hit the cap",)
    assert findings.doubts[0] in FaultCampaign(findings).warnings
