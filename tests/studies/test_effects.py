"""What each quantity alone does: swings of a closed form, the largest first; choices too."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from bywire.api.study_figures import study_figures
from bywire.api.study_run import findings_data
from bywire.api.study_tables import effect_tables, unmoved
from bywire.studies.findings import Findings
from bywire.studies.store import CASE, FAILURE, WARNINGS
from bywire.studies.study_file import read_study

TEXT = """
[vary]
"motor.R_m" = "+-5 %"
"motor.K_e" = { kind = "log-normal", sd = "4 %" }
"adc.law" = { kind = "discrete", values = ["ideal", "quantized"] }
[design]
kind = "one-at-a-time"
levels = 3
"""


@pytest.fixture
def findings(study):
    plan = read_study(study(TEXT))
    cases = pd.DataFrame(plan.values(0))
    flat = plan.bench.par.flat()
    bent = (cases["motor.K_e"] / flat["motor.K_e"] - 1.0) ** 2  # least in the middle
    figure = 20.0 + 40.0 * (cases["motor.R_m"] / flat["motor.R_m"] - 1.0) + 50.0 * bent
    names = plan.bench.definition.kpis_with(plan.bench.chosen_options)
    texts = {CASE: range(len(cases)), FAILURE: "", WARNINGS: ""}
    cases = cases.assign(**dict.fromkeys(names, math.nan), **texts)
    return Findings(plan, cases.assign(peak_current=figure + (cases["adc.law"] == "ideal")), ())


def test_swings_are_those_of_the_figure(findings):
    resistance, law, constant = findings.effects("peak_current")
    ranked = [e.quantity for e in (resistance, law, constant)]
    assert ranked == ["motor.R_m", "adc.law", "motor.K_e"]
    assert resistance.swing == pytest.approx(4.0)
    assert (resistance.figures[0], resistance.figures[-1]) == pytest.approx((18.0, 22.0))
    assert law.values == ["ideal", "quantized"]
    assert law.figures.tolist() == [21.0, 20.0]
    assert constant.least == pytest.approx(20.0)  # where both ends are above
    ends = np.exp(np.array([-3.0, 3.0]) * np.sqrt(np.log1p(0.04**2)))  # not zero, where it ends
    assert constant.figures[[0, -1]] == pytest.approx(20.0 + 50.0 * (ends - 1.0) ** 2, rel=1e-6)


def test_what_is_not_computed_yet_has_none(findings):
    some = Findings(findings.plan, findings.cases[:5], ())
    assert [e.quantity for e in some.effects("peak_current")] == ["motor.R_m"]


def test_what_takes_the_figure_away_comes_first(findings):
    """A level without it misses what is required, however little the others move it."""
    figure = findings.figure("peak_current").copy()
    figure[-1] = math.nan  # of the choice, at its second value
    lost = Findings(findings.plan, findings.cases.assign(peak_current=figure), ())
    assert lost.drivers("peak_current") == ["adc.law", "motor.R_m", "motor.K_e"]
    assert [e.lacking for e in lost.effects("peak_current")] == [1, 0, 0]
    (tornado,) = (b for b in study_figures(lost, dict) if getattr(b, "name", "") == "tornado")
    assert "A triangle means" in tornado.caption
    assert any(
        text.get_text() == "not defined at a level"
        for text in tornado.figure.legends[0].get_texts()
    )


def test_effects_are_in_the_json(findings):
    said = findings_data(findings)["kpis"]["peak_current"]["effects"]
    assert list(said) == ["motor.R_m", "adc.law", "motor.K_e"]
    assert said["adc.law"] == {
        "unit": None,
        "values": ["ideal", "quantized"],
        "figures": [21.0, 20.0],
        "swing": pytest.approx(1.0),
        "undefined": 0,
    }
    assert said["motor.R_m"]["swing"] == pytest.approx(4.0)
    assert len(said["motor.R_m"]["values"]) == len(said["motor.R_m"]["figures"]) == 3


def test_a_figure_that_nothing_moves_has_a_sentence_in_place_of_a_table(findings):
    assert unmoved(findings) == []
    assert len(effect_tables(findings)) == 1
    still = Findings(findings.plan, findings.cases.assign(peak_current=20.0), ())
    assert unmoved(still) == ["the same in every case: peak_current"]
    assert effect_tables(still) == []
    assert "tornado" not in [getattr(each, "name", "") for each in study_figures(still, dict)]
