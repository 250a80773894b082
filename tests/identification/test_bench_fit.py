"""Output error on a bench: what is put in comes back, exact derivatives, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr

import bywire
from bywire.core.errors import InputError
from bywire.identification.bench_fit import BenchFit, starts_check
from bywire.identification.bench_replay import case_of
from bywire.identification.measured import joined
from bywire.identification.method import Effort, Identified
from bywire.identification.methods.output_error import METHOD
from bywire.identification.output_error import output_error
from bywire.identification.question import Question, starts_of, unknowns_of
from bywire.identification.trust import trust
from raising import raises

SINE = {"kind": "sine", "mean": "0 V", "amplitude": "2 V", "f": "4 Hz", "phase": 0, "t_start": 0}
KNOWN = {"source": "voltage", "add_holding": True, "duration": 0.25}
OPTIONS = METHOD.defaults.replace({"between": "linear"})
TWO = Question(
    outputs={"p_mc": "0.02 bar", "i": "10 mA"}, unknowns={"motor.R_m": "", "motor.K_e": ""}
)


def bench(p_start: float | None = 10e5, f: str = "4 Hz", **overrides: float) -> bywire.Bench:
    options = KNOWN if p_start is None else {**KNOWN, "p_start": p_start}
    changed = {name.replace("__", "."): value for name, value in overrides.items()}
    return bywire.Bench(
        "motor-open-loop",
        "dardanelli2010",
        overrides=changed,
        options=options,
        stimulus={**SINE, "f": f},
    )


def record(made_on: bywire.Bench, seed: int, question: Question = TWO) -> xr.Dataset:
    return METHOD.on(made_on, question).synthetic(made_on.par, OPTIONS, seed)


def identified(
    on: bywire.Bench, data: xr.Dataset, question: Question = TWO, loss: str = "linear"
) -> Identified:
    options = OPTIONS.replace({"loss": loss})
    found: Identified = METHOD.on(on, question).identify(data, on.par, options, Effort(starts=1))
    return found


def inside(found: Identified, truth: dict[str, float]) -> None:
    one = found.estimates["output error"]
    ends = dict(zip(one.names, one.intervals(0.999), strict=True))
    for name, value in truth.items():
        assert ends[name][0] < value < ends[name][1], name
        assert ends[name][1] - ends[name][0] < 0.05 * abs(value), name


def require_derivatives(
    made_on: bywire.Bench,
    on: bywire.Bench,
    question: Question,
    own: tuple[str, ...],
    speed: float | None,
) -> None:
    """Compare the Jacobian at the starts with central differences."""
    data = record(made_on, 1, question)
    fit = BenchFit(on, question)
    one = fit.record(on, data, OPTIONS)
    trial = fit.trial(one, "")
    unknowns = [*unknowns_of(case_of(on, ""), on.par, question), *fit.starts(one, trial)]
    assert tuple(u.name for u in unknowns[len(question.ranges) :]) == own
    problem = output_error([trial], unknowns)
    values = np.array([u.start for u in unknowns])
    if speed is not None:
        values[-1] = speed
    slopes = problem.evaluate(values)[1]
    for k, u in enumerate(unknowns):
        shift = np.eye(values.size)[k] * 1e-6 * u.scale
        change = problem.evaluate(values + shift)[0] - problem.evaluate(values - shift)[0]
        by_difference = change / (2e-6 * u.scale)
        size = np.linalg.norm(by_difference)
        assert np.linalg.norm(by_difference - slopes[:, k]) < 1e-4 * size, u.name
    stiff = on.par.leaves()["caliper.K_pd"]
    assert trial.start({"caliper.K_pd": 0.9 * stiff})[0].theta > 1.01 * trial.run.state.theta


def test_derivatives_are_those_of_the_residuals() -> None:
    """Zeros of inputs and outputs, a start, and an equilibrium that moves with the parameters.

    At rest an initial speed meets dry friction, whose derivative is one-sided: it begins moving.
    """
    names = ("motor.R_m", "motor.K_e", "caliper.K_pd", "stimulus.v_set", "offset.i")
    question = Question(outputs=TWO.outputs, unknowns=dict.fromkeys(names, ""), states=("omega",))
    own = ("start.p_start", "initial.omega")
    require_derivatives(bench(), bench(None), question, own, 0.3)


def test_derivatives_of_a_closed_loop_follow_the_controllers_start() -> None:
    """The integrator begins with the current that holds the pressure, by the motor's constant."""
    still = {"ecu.dither.waveform": "off"}
    stimulus = {**SINE, "mean": "0 bar", "amplitude": "5 bar", "f": "2 Hz"}
    made_on, on = (
        bywire.Bench(
            "motor-open-loop",
            "dardanelli2010",
            overrides=still,
            stimulus=stimulus,
            options={"source": "pressure", "add_holding": True, "duration": 0.12, **start},
        )
        for start in ({"p_start": 10e5}, {})
    )
    question = Question(outputs=TWO.outputs, unknowns={"motor.K_e": "", "caliper.K_pd": ""})
    require_derivatives(made_on, on, question, ("start.p_start",), None)
    fit = BenchFit(on, question)
    begun = fit.trial(fit.record(on, record(made_on, 1, question), OPTIONS), "").start
    weak, strong = (begun({"motor.K_e": k})[1] for k in (0.03, 0.04))
    assert any(a != b for a, b in zip(weak, strong, strict=True))


def test_a_start_that_one_noisy_sample_tells_is_estimated() -> None:
    """Without it a wrong first sample shifts the whole record."""
    data = record(bench(), 2)
    data["p_mc"][0] += 0.1e5  # five standard deviations
    found = identified(bench(None), data)
    inside(found, {"motor.R_m": 0.35, "motor.K_e": 0.0304, "start.p_start": 10e5})
    assert all(check.holds for check in found.checks)
    assert set(found.parameters) == {"motor.R_m", "motor.K_e"}


def test_records_of_different_starts_are_one_fit() -> None:
    truth = {"motor__R_m": 0.42, "motor__K_e": 0.028}
    slow, quick = record(bench(8e5, **truth), 3), record(bench(14e5, "9 Hz", **truth), 4)
    both = identified(bench(None), joined({"slow": slow, "quick": quick}))
    inside(
        both,
        {
            "motor.R_m": 0.42,
            "motor.K_e": 0.028,
            "slow:start.p_start": 8e5,
            "quick:start.p_start": 14e5,
        },
    )
    one = identified(bench(None), slow).estimates["output error"]
    assert both.estimates["output error"].deviations[0] < one.deviations[0]
    assert {c.name for c in both.curves} == {
        "fit-p_mc-slow",
        "fit-i-slow",
        "fit-p_mc-quick",
        "fit-i-quick",
    }


def test_intervals_hold_what_was_put_in() -> None:
    found = trust(METHOD.on(bench(), TWO), bench().par, OPTIONS, range(10))
    assert not found.failed
    for one in found.recovered:
        assert abs(one.bias_in_errors) < 3.5
        assert one.coverage >= 0.8
        assert 0.5 < one.claimed / one.scatter < 2.0


def test_a_record_that_is_held_out_says_whether_the_result_carries_over() -> None:
    data, other = record(bench(), 5), record(bench(10e5, "7 Hz"), 6)
    wrong = other.assign(p_mc=other["p_mc"][::-1].variable)
    for held, holds in ((other, True), (wrong, False)):
        question = Question(outputs=TWO.outputs, unknowns=TWO.unknowns, holdout=held)
        found = {c.name: c for c in identified(bench(), data, question).checks}
        assert found["validation.p_mc.vaf"].holds is holds
        assert found["validation.i.vaf"].value > 0.99


def test_a_held_out_record_begins_where_it_did() -> None:
    """Not at the start of the one record that was fitted."""
    held = record(bench(14e5, "7 Hz"), 6)
    question = Question(outputs=TWO.outputs, unknowns=TWO.unknowns, holdout=held)
    found = {c.name: c for c in identified(bench(None), record(bench(), 5), question).checks}
    assert found["validation.p_mc.vaf"].value > 0.99
    assert found["validation.p_mc.nrmse"].value < 0.05


LOSSES = ("linear", "soft_l1", "huber", "cauchy")


@pytest.mark.parametrize("loss", LOSSES)
def test_a_wrong_model_does_not_hold(loss: str) -> None:
    data = record(bench(), 7)
    found = identified(bench(caliper__K_pd=8e5), data, loss=loss)
    assert not next(c for c in found.checks if c.name == "residual_over_noise").holds


@pytest.mark.parametrize("loss", LOSSES)
def test_a_few_outliers_are_counted_by_a_robust_loss(loss: str) -> None:
    data = record(bench(), 2)
    data["p_mc"][5::25] += 3e5
    spoiled = data["p_mc"][5::25].size
    found = identified(bench(), data, loss=loss)
    checks = {c.name: c for c in found.checks}
    if loss == "linear":
        assert not checks["residual_over_noise"].holds
        assert 'use loss="huber"' in checks["residual_over_noise"].note
        return
    assert all(check.holds for check in found.checks)
    inside(found, {"motor.R_m": 0.35, "motor.K_e": 0.0304})
    assert checks["outliers"].note.startswith(f"{spoiled} of ")
    assert 0.9 < checks["residual_over_noise"].value < 1.1


def test_noise_that_the_record_does_not_tell_is_no_proof_of_a_model() -> None:
    data = record(bench(), 2)
    data["p_mc"] = data["p_mc"] + 0.5e5 * (-1.0) ** np.arange(data.sizes["time"])
    own = Question(outputs={"p_mc": "", "i": ""}, unknowns=TWO.unknowns)
    check = next(c for c in identified(bench(), data, own).checks if c.name == "noise_not_told")
    assert check.value == 1.0
    assert not check.holds
    assert "p_mc changes from sample to sample" in check.note
    assert 'outputs "p_mc=NOISE bar"' in check.note
    assert all(c.holds for c in identified(bench(), record(bench(), 2), own).checks)
    given = identified(bench(), record(bench(), 2)).checks
    assert "noise_not_told" not in {c.name for c in given}


def test_a_minimum_that_one_start_of_several_found_is_not_believed() -> None:
    assert not starts_check(1, 3)
    (alone,), (met,) = starts_check(1, 4), starts_check(2, 4)
    assert not alone.holds
    assert "more starts" in alone.note
    assert met.holds


def test_ranges_priors_and_starts() -> None:
    question = Question(
        outputs=TWO.outputs,
        unknowns={"motor.R_m": "100..1000 mohm", "gear.k_g": "0 .. 2 mm/rad", "offset.i": ""},
        priors={"motor.R_m": "0.4 +- 0.02 ohm"},
    )
    on = bench(motor__R_m=2.0)
    R, k_g, zero = unknowns_of(case_of(on, ""), on.par, question)
    assert (R.low, R.high, R.start, R.prior) == (0.1, 1.0, 0.55, (0.4, 0.02))
    assert 0.0 < k_g.low < 1e-8
    assert k_g.high == 2e-3
    assert (zero.start, zero.unit) == (0.0, "A")
    starts = np.array(starts_of((R, k_g, zero), question.ranges, 200, 0.3, 1))
    assert starts[0, 0] == 0.55
    assert starts[:, 0].min() < 0.12
    assert starts[:, 0].max() > 0.98
    assert abs(starts[:, 2]).max() <= 0.3 * zero.scale


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"outputs": {}}, "there is no output"),
        ({"outputs": {"p_mcc": ""}}, "unknown output 'p_mcc': did you mean 'p_mc'"),
        ({"outputs": {"p_mc": "0.02 A"}}, "noise of p_mc"),
        ({"inputs": {"v_st": "u"}}, "unknown stimulus 'v_st'"),
        ({"states": ("omeg",)}, "omega"),
        ({"unknowns": {}}, "there is no unknown"),
        (
            {"unknowns": {"motor.Rm": ""}},
            "unknown parameter 'motor.Rm': did you mean 'motor.R_m'",
        ),
        ({"unknowns": {"adc.law": ""}}, "it is a choice (here 'quantized'), not a number"),
        ({"unknowns": {"ecu.pedal_map.V_nodes": ""}}, "nodes of a table"),
        ({"unknowns": {"initial.omega": ""}}, "states omega"),
        ({"unknowns": {"stimulus.v": ""}}, "stimulus.v_set"),
        ({"unknowns": {"offset.omega": ""}}, "offset.p_mc"),
        (
            {"unknowns": {"motor.R_m": "0.1..1"}},
            "range of motor.R_m = '0.1' has the wrong unit",
        ),
        ({"unknowns": {"motor.R_m": "0.1 ohm"}}, "use '0.175 ohm..0.7 ohm'"),
        ({"unknowns": {"motor.R_m": "1..0.1 ohm"}}, "is empty"),
        (
            {"unknowns": {"motor.R_m": "-1..1 ohm"}},
            "'-1..1 ohm' is not valid: it must be > 0 ohm",
        ),
        ({"priors": {"motor.R_m": "0.3"}}, "prior of motor.R_m"),
        ({"priors": {"motor.R_m": "0.3 +- 0 ohm"}}, "with a deviation > 0"),
        ({"priors": {"motor.L_m": "1 +- 1 mH"}}, "unknown in priors"),
        ({"case": "runn"}, "'run'"),
    ],
)
def test_what_does_not_fit_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as refused:
        METHOD.on(
            bench(),
            Question(**{"outputs": TWO.outputs, "unknowns": TWO.unknowns} | changes),
        )
    assert said in str(refused.value)


def test_what_the_experiment_sets_itself_is_refused() -> None:
    wedge = bywire.Bench("current-loop", "roberts2003")
    case = wedge.cases()[0]
    own = next(n for n, v in case.par.leaves().items() if v != wedge.par.leaves()[n])
    with pytest.raises(InputError, match="the experiment sets it"):
        METHOD.on(wedge, Question(outputs={"i_1": ""}, unknowns={own: ""}))


def test_records_that_tell_nothing_are_refused() -> None:
    data = record(bench(), 8)
    still = data.assign(p_mc=0.0 * data["p_mc"] + 1e6)
    quiet = Question(outputs={"p_mc": ""}, unknowns=TWO.unknowns)
    with pytest.raises(InputError, match="p_mc does not change"):
        identified(bench(), still, quiet)
    idle = Question(outputs=TWO.outputs, unknowns={"pedal.x_max": ""})
    with raises(InputError, name="pedal.x_max"):
        identified(bench(), data, idle)
    closed = Question(outputs=TWO.outputs, unknowns={"fluid.V_air": ""})
    with pytest.raises(InputError, match=r"fluid\.air = none.*Switch it on"):
        identified(bench(), data, closed)
    with raises(InputError, name="inputs", valid="v_set"):
        identified(bench(), data.drop_vars("v_set"))
