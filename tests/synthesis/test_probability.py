"""Gains over drawn models: who meets what is counted, who does not exist counts as missing."""

from __future__ import annotations

from dataclasses import replace

import pytest

import bywire
from bywire.api.design_probability import Probability
from bywire.api.loop_case import loop_case
from bywire.core.errors import ParameterError
from bywire.core.typing import silent
from bywire.synthesis.linear_case import cases_of, read
from bywire.synthesis.outcome import judged_over
from few_starts import few_starts
from raising import raises

STUDY = """
bench = "../b.toml"
[vary]
"motor.R_m" = "+-20 %"
"motor.L_m" = { kind = "normal", sd = "10 %", low = "-30 %", high = "+30 %" }
"""
BENCH = 'experiment = "hard-braking"\nparameters = "dardanelli2010"\n'


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


def test_gains_hold_as_probably_as_is_wanted(study, monkeypatch):
    """And a margin that half of the models miss is not."""
    monkeypatch.setattr("bywire.api.design_probability._JUDGES", 48)
    with few_starts():
        found = bywire.design(
            "current",
            require=["bandwidth >= 90 Hz", "phase_margin >= 60 deg"],
            vary=study(),
            drawn=6,
            probability="90 %",
            linear_only=True,
        )
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
    ],
)
def test_what_does_not_fit_is_refused(study, text, given, message):
    with pytest.raises(ParameterError, match=message):
        bywire.design(
            "current",
            require=["bandwidth >= 50 Hz"],
            **{"vary": study(text), "linear_only": True, **given},
        )


def test_a_study_of_another_brake_is_refused(study):
    with raises(ParameterError, name="study.toml"):
        bywire.design("moment", require=["crossover >= 5 Hz"], vary=study(), linear_only=True)
