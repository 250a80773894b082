"""Gains over drawn models: who meets what is counted, who does not exist counts as missing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import norm

import bywire
from bywire.analysis.linear.linear_model import LinearModel
from bywire.api.design_probability import (
    BenchProbability,
    DrawnModels,
    Probability,
    _deciding,
    bench_probability,
)
from bywire.api.loop_case import loop_case
from bywire.bench.bench import Bench
from bywire.core.errors import ParameterError
from bywire.core.typing import silent
from bywire.studies.study_file import read_study
from bywire.synthesis.designer import Problem, design
from bywire.synthesis.linear_case import NOMINAL, LinearCase, cases_of, read
from bywire.synthesis.outcome import Judged, judged_over
from bywire.synthesis.verification import corners_of
from few_starts import few_starts
from raising import raises

STUDY = """
bench = "../b.toml"
[vary]
"motor.R_m" = "+-20 %"
"motor.L_m" = { kind = "normal", sd = "10 %", low = "-30 %", high = "+30 %" }
"""
BENCH = 'experiment = "hard-braking"\nparameters = "dardanelli2010"\n'


OFTEN = "overshoot <= 15 % with 95"


@pytest.fixture
def study(tmp_path):
    (tmp_path / "s").mkdir()
    (tmp_path / "b.toml").write_text(BENCH)

    def write(text=STUDY):
        path = tmp_path / "s" / "study.toml"
        path.write_text(text)
        return path

    return write


def test_models_are_counted_by_what_they_meet():
    case = loop_case("current", "", "", {})
    gains = {name: case.par.leaves()[name] for name in case.loop.tunables}
    wide = [0.3, 0.4, 0.5, 0.6]
    models = [*cases_of(case.loop, case.par, case.value, {"motor.R_m": wide})[1:], None]
    bandwidths = [model.figures(gains).bandwidth for model in models[:4]]
    between = 0.5 * sum(sorted(bandwidths)[1:3])
    told = judged_over(models, read([f"bandwidth >= {between} Hz", "overshoot <= 99 %"]), gains)
    assert (told.models, told.unstable, told.met, told.all_met) == (5, 1, (2, 4), 2)
    assert told.worst[0] == pytest.approx(min(bandwidths))


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Design for six models, tested on 48 others."""
    folder = tmp_path_factory.mktemp("study")
    (folder / "study.toml").write_text(STUDY.replace("../b.toml", "b.toml"))
    (folder / "b.toml").write_text(BENCH)
    with few_starts(), pytest.MonkeyPatch.context() as patch:
        patch.setattr("bywire.api.design_probability._JUDGES", 48)
        return bywire.design(
            "current",
            require=["bandwidth >= 90 Hz", "phase_margin >= 60 deg"],
            vary=folder / "study.toml",
            drawn=6,
            probability="90 %",
            linear_only=True,
        )


def test_gains_hold_as_probably_as_is_wanted(found):
    """And a margin that half of the models miss is not."""
    told = found.probability
    assert found.holds
    assert (told.outcome, told.judged.models, len(told.drawn.cases)) == ("met", 48, 6)
    assert told.together.low >= 0.9
    assert "all requirements with 90 %: met" in str(found)
    assert found.as_object()["drawn"]["all"]["met"] == told.judged.all_met
    margins = sorted(each.figures(found.gains).phase_margin for each in told.drawn.judges)
    more = read([f"phase_margin >= {1.002 * margins[24]} deg"])  # what is within 0.1 % is met
    judged = judged_over(told.drawn.judges, more, found.gains, silent)
    beyond = Probability(told.drawn, tuple(more), judged, 0.9)
    assert beyond.judged.met == (sum(each >= 1.001 * margins[24] for each in margins),)
    assert 10 < beyond.judged.all_met < 24
    missed = replace(found, probability=replace(beyond, drawn=replace(told.drawn, lacking=3)))
    assert not missed.holds
    assert missed.document().remarks == ["all requirements with 90 %: missed"]
    assert "for 3 more draws" in str(missed)
    assert beyond.outcome == "missed"


@pytest.mark.parametrize(
    ("text", "given", "message"),
    [
        (STUDY.replace("motor.L_m", "ecu.current.k_p"), {}, "the design chooses"),
        (STUDY + '"options.p_to" = "+-1 %"\n', {}, "option of the experiment"),
        (STUDY, {"drawn": 0}, "1 to 1000"),
        (STUDY, {"vary": "", "probability": "99 %"}, "needs drawn models"),
        (STUDY, {"probability": "120 %"}, "between 0 and 100 %"),
        (STUDY, {"schedule": True}, "schedule and vary"),
        (STUDY, {"vary": "", "require": [f"{OFTEN} %"]}, "Add vary FILE.*remove 'with 95 %'"),
        (STUDY, {"vary": "", "require": [f"{OFTEN} %"], "schedule": True}, "cannot schedule"),
        (STUDY, {"require": [OFTEN]}, "in percent"),
        (STUDY, {"require": [f"{OFTEN}0 %"]}, "between 0 and 100 %"),
        (STUDY, {"require": ["overshoot <= 15 % with 99.999 %"]}, "rare failures"),
    ],
)
def test_what_does_not_fit_is_refused(study, text, given, message):
    with pytest.raises(ParameterError, match=message):
        bywire.design(
            "pressure" if "schedule" in given else "current",
            **{
                "require": ["bandwidth >= 50 Hz"],
                "vary": study(text),
                "linear_only": True,
                **given,
            },
        )


def test_a_study_of_another_brake_is_refused(study):
    with raises(ParameterError, name="study.toml"):
        bywire.design("moment", require=["crossover >= 5 Hz"], vary=study(), linear_only=True)


# --- Requirements with a probability

T = 1e-3
DRAWS = 40


def integrator(k: float, pole: float) -> LinearModel:
    """Return a sampled first-order model x+ = pole x + u, y = k x."""
    A, C = np.array([[pole]]), np.array([[k]])
    one, units = ("1",), (("x",), ("u",), ("y",))
    return LinearModel(
        "loop", A, np.ones((1, 1)), C, np.zeros((1, 1)), *units, one, one, one, np.zeros(1), T
    )


def first_order(label: str, g: float, draws: int = 0) -> LinearCase:
    """Return a loop whose gain is k g T / (z - 1)."""
    return LinearCase(
        label,
        lambda gains: (
            integrator(gains["k"] * g * T, 1.0),
            integrator(gains["k"] * g * T, 1.0 - gains["k"] * g * T),
        ),
        draws=draws,
    )


G = np.exp(0.3 * norm.ppf((np.arange(DRAWS) + 0.5) / DRAWS))
CASES = (first_order(NOMINAL, 1.0), *(first_order(f"drawn {g:.3g}", g, DRAWS) for g in G))


def crossover(x: float) -> float:
    """Return the crossover of x T / (z - 1), from abs(z - 1) = 2 sin(w T / 2)."""
    return math.asin(0.5 * x * T) / (math.pi * T)


@pytest.mark.parametrize(("text", "spared"), [("", 0), (" with 90 %", 4)])
def test_the_gain_is_that_of_the_quantile(text, spared):
    """The lower limit holds at the least g, and the upper limit at the largest g that counts."""

    def excess(k: float) -> float:
        upper = (20.0 - crossover(k * G[-1 - spared])) / 20.0
        return upper - (crossover(k * G[0]) - 2.0) / 2.0

    wanted = read(["crossover >= 2 Hz", f"crossover <= 20 Hz{text}"], has_probabilities=True)
    found = design({"k": (1.0, 500.0)}, wanted, CASES, {"k": 10.0})
    assert found.status == "met"
    assert found.gains["k"] == pytest.approx(brentq(excess, 1.0, 500.0), rel=1e-3)


def test_a_limit_that_some_models_miss_is_met_by_a_larger_gain():
    """From the lower limit at all models on, no gain keeps all of them below the upper limit."""
    largest = brentq(lambda k: crossover(k * G[-5]) - 20.0, 1.0, 500.0)
    least = 0.995 * crossover(largest * G[0])
    texts = [f"crossover >= {least} Hz", "crossover <= 20 Hz"]
    with few_starts(is_coarse=False):
        strict = design({"k": (1.0, 500.0)}, read(texts), CASES, {"k": 10.0})
    assert strict.status == "infeasible"
    often = read([texts[0], f"{texts[1]} with 90 %"], has_probabilities=True)
    found = design({"k": (1.0, 500.0)}, often, CASES, {"k": 10.0})
    assert found.status == "met"
    assert found.gains["k"] == pytest.approx(largest, rel=3e-3)
    assert found.missed == {"crossover <= 20 Hz with 90 %": 4}
    assert found.worst["crossover"][0] == pytest.approx(least, rel=0.01)


def test_models_count_unless_the_probability_permits_to_miss_them():
    (wanted,) = read(["crossover <= 20 Hz with 90 %"], has_probabilities=True)
    drawn = [first_order(f"drawn {k}", 1.0, 30) for k in range(29)]  # a draw lacks its model
    problem = Problem({"k": (1.0, 2.0)}, (wanted,), (CASES[0], *drawn))
    assert problem.spared == {0: 2}  # (1 - 0.9) 30 is 2.9999999999999996
    slacks = np.linspace(-1.0, 1.0, 30)[:, np.newaxis]
    everything = range(30)
    assert problem.counted(slacks, everything).min() == -1.0  # the nominal model always counts
    slacks[0] = 1.0
    assert problem.counted(slacks, everything).min() == slacks[3]
    slacks[1] = -12.0  # an unstable model also
    assert problem.counted(slacks, everything).min() == -12.0
    certain = Problem(problem.tunables, tuple(read(["crossover <= 20 Hz"])), problem.cases)
    assert np.array_equal(certain.counted(slacks, everything), slacks)


@pytest.mark.parametrize(
    ("share", "count", "outcome"),
    [
        (" with 90 %", 24, "missed"),
        (" with 30 %", 24, "met"),
        (" with 50 %", 24, "undecided"),
        ("", 47, "missed"),  # all models must meet it
        ("", 48, "met"),
    ],
)
def test_every_requirement_has_a_verdict(found, share, count, outcome):
    texts = [f"phase_margin >= 60 deg{share}", "overshoot <= 99 % with 90 %"]
    wanted = read(texts, has_probabilities=True)
    judged = Judged(48, 0, (count, 48), count, (59.0, 1.0))
    told = Probability(found.probability.drawn, wanted, judged, None)
    assert told.outcomes == {texts[0]: outcome, texts[1]: "met"}
    design = replace(found, probability=told)
    assert design.holds == (outcome == "met")
    assert len(design._remarks()) == (outcome != "met")
    assert all(outcome in text and f"{count} of 48" in text for text in design._remarks())
    assert ("1 of 2 not met over" in design._verdict()) == (outcome != "met")
    rows = told.data()["requirements"]
    assert [row["outcome"] for row in rows] == [outcome, "met"]


def test_without_probabilities_there_are_no_verdicts(found):
    assert found.outcomes == {}
    assert "outcome" not in found.as_object()["drawn"]["requirements"][0]


def test_enough_models_decide_a_probability():
    """Without a failure, log(0.025) / log(0.99) = 368 models show 99 % with 95 % confidence."""
    assert [_deciding(0.99, missing, 0.95) for missing in (0, 2)] == [368, 720]


def test_the_bench_has_the_last_word_on_figures_of_its_step(study):
    """Its cases are draws that were not used before, and its limits have the units of the bench."""
    case = loop_case("current", "", "", {})
    plan = replace(read_study(study()), design="monte-carlo")
    drawn = DrawnModels(plan, (first_order("drawn", 1.0, 2),), 1, (None,) * 20)
    gains = {"ecu.current.k_p": 0.03, "ecu.current.k_i": 19.0}
    bench = Bench(case.loop.proof, case.name)

    def over(*texts: str) -> BenchProbability | None:
        wanted = read(texts, has_probabilities=True)
        return bench_probability(drawn, wanted, bench, gains, None)

    assert over("overshoot <= 9 %") is None
    assert over("phase_margin >= 60 deg with 90 %") is None
    found = over("phase_margin >= 60 deg", "steady_state_error <= 50 % with 90 %")
    assert found is not None
    (judgment,) = found.findings.judgments
    assert found.outcomes == {"steady_state_error <= 50 % with 90 %": "met"}
    assert (judgment.demand.bound, judgment.demand.unit) == (pytest.approx(0.5 * 0.73), "A")
    assert found.findings.count == 64
    assert found.findings.cases["case"].iloc[0] == 64  # the first chunk has the designed models
    assert found.findings.cases["motor.R_m"].iloc[0] == plan.values(1)["motor.R_m"][0]
    values = np.sort(found.findings.figure("overshoot"))
    middle = 0.5 * (values[31] + values[32])
    assert middle > 0.1
    median = over(f"overshoot <= {middle} % with 90 %", "settling_time <= 1 s")
    assert median is not None
    assert [*median.outcomes.values()] == ["missed", "met"]
    (missed, _) = median.findings.judgments
    assert (missed.share.count, missed.share.cases) == (32, 64)
    assert median.reached(missed.demand) == values[62]  # 62 of 64 cases do not prove 90 %
    text = str(missed.demand)
    linear = Probability(drawn, (missed.demand,), Judged(20, 0, (20,), 20, (0.0,)), None)
    remark = median.remark(text, linear)
    assert "missed on the bench, with a probability of 50" in remark
    assert "On the linear models, it is undecided with 100 %" in remark
    assert f"The gains meet overshoot <= {values[62]:.3g}" in remark
    tables = [part for part in median.parts() if not isinstance(part, str)]
    assert [column.heading for column in tables[0].columns][-1] == "result"
    assert median.data()["requirements"][0]["reached"] == values[62]


@pytest.mark.parametrize(("text", "labels"), [("", {"a", "c", "d"}), (" with 90 %", {"a", "c"})])
def test_a_drawn_model_is_a_corner_of_the_bench_unless_it_may_miss(text, labels):
    ranges = [replace(first_order(n, 1.0), changes={"x": k}) for k, n in enumerate("abc")]
    drawn = replace(first_order("d", 2.0, 1), changes={"y": 1.0})
    wanted = read([f"crossover <= 20 Hz{text}"], has_probabilities=True)
    problem = Problem({"k": (1.0, 500.0)}, wanted, (CASES[0], *ranges, drawn))
    assert {case.label for case in corners_of(problem, {"k": 10.0})} == labels
