"""Cases are judged: what is too close to its limit decides nothing, what has no result misses."""

from __future__ import annotations

import json
import math

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from bywire.api.study_tables import drivers_data, influence_tables
from bywire.bench.kpis.kpi import Kpi
from bywire.core.errors import ParameterError, UnknownNameError
from bywire.studies.findings import Findings, choice_influence
from bywire.studies.store import CASE, FAILURE, WARNINGS
from bywire.studies.study_file import read_study
from bywire.studies.survey import Reason
from raising import raises


@pytest.fixture
def found(study):
    def make(peaks, error=math.nan, limit="<= 20 A with 90 %"):
        lines = '[vary]\n"motor.R_m" = "+-5 %"\n[requirements]\n'
        plan = read_study(study(f'{lines}peak_current = "{limit}"\n'))
        peaks = np.array(peaks, dtype=float)
        names = plan.bench.definition.kpis_with(plan.bench.chosen_options)
        columns = {name: np.full(peaks.size, math.nan) for name in names}
        columns |= {
            CASE: np.arange(peaks.size),
            "motor.R_m": np.linspace(0.3, 0.4, peaks.size),
            "peak_current": peaks,
        }
        columns[FAILURE] = np.where(np.isnan(peaks), "it left the numbers", "")
        said = [json.dumps(["far out; cold", f"hot: {20 + k} degC"]) for k in range(peaks.size)]
        columns[WARNINGS] = np.array(said, dtype=object)
        kpi = Kpi("peak_current", float(peaks[0]), "A", "Maximum current.", error=error)
        return Findings(plan, pd.DataFrame(columns), (kpi,))

    return make


@pytest.mark.parametrize(
    ("error", "outcome", "undecided"),
    [(math.nan, "met", 0), (0.5, "met", 0), (2.0, "undecided", 200), (math.inf, "undecided", 200)],
)
def test_cases_closer_to_the_limit_than_their_error_decide_nothing(
    found, error, outcome, undecided
):
    (judgment,) = found([19.0] * 200, error).judgments
    assert (judgment.outcome, judgment.undecided) == (outcome, undecided)


def test_a_case_without_a_result_misses_and_the_worst_is_named(found):
    findings = found([19.0, math.nan, 21.0, 19.5])
    (judgment,) = findings.judgments
    assert (judgment.share.count, judgment.worst) == (2, 2)
    assert (judgment.known, judgment.known_met, judgment.lacking) == (3, 2, 0)
    assert findings.reasons == (Reason("it left the numbers", 1, 1),)
    assert [findings.has_result(row) for row in range(4)] == [True, False, True, True]
    assert findings.warnings == {"far out; cold": 4, "hot: 20 degC, and so on": 4}
    assert [s.undefined for s in findings.spreads] == [1]
    assert findings.values(2) == {"motor.R_m": pytest.approx(0.3 + 0.2 / 3)}


@pytest.mark.parametrize(
    ("peaks", "error", "outcome"),
    [
        ([19.0] * 5, 0.1, "met"),
        ([19.0, 21.0], 0.1, "missed"),
        ([19.0, 19.95], 0.1, "undecided"),
        ([19.0, math.nan], 0.1, "missed"),
    ],
)
def test_without_a_probability_every_case_has_to_meet_it(found, peaks, error, outcome):
    (judgment,) = found(peaks, error, "<= 20 A").judgments
    assert judgment.outcome == outcome


def test_the_worst_of_a_lower_limit_is_the_smallest(found):
    assert found([19.0, 25.0, 18.0], limit=">= 20 A").judgments[0].worst == 2


def test_a_case_that_ran_without_the_figure_is_the_worst(found):
    """It misses, and a reader who runs it sees why; one without a result cannot be run."""
    findings = found([19.0, math.nan, math.nan, 25.0])
    cases = findings.cases.assign(**{FAILURE: ["", "it left the numbers", "", ""]})
    (judgment,) = Findings(findings.plan, cases, findings.nominal).judgments
    assert (judgment.worst, judgment.outcome) == (2, "missed")


def test_no_case_is_the_worst_where_all_are_equal(found):
    assert found([0.0] * 200).judgments[0].worst is None
    assert found([0.0, math.nan, 0.0]).judgments[0].worst is None
    assert found([0.0]).judgments[0].worst == 0


CHOICE = """
[vary]
"motor.R_m" = "+-5 %"
"adc.law" = { kind = "discrete", values = ["ideal", "quantized"] }
[requirements]
peak_current = "<= 20 A with 90 %"
"""


@pytest.mark.parametrize("share", [0.0, 0.3, 3.0])
def test_choices_are_ranked_among_what_drives_a_figure(found, study, share):
    """By ranks: two choices have the size of their rank correlation, but for what chance makes."""
    rng = np.random.default_rng(3)
    law = rng.integers(0, 2, 400)
    slope, noise = np.linspace(0.0, 1.0, 400), 0.1 * rng.normal(size=400)
    findings = found(slope + noise + share * law)
    plan = read_study(study(CHOICE))
    cases = findings.cases.assign(**{"adc.law": np.array(["ideal", "quantized"])[law]})
    mixed = Findings(plan, cases, findings.nominal)
    (choice,) = (i for i in mixed.influences("peak_current") if i.quantity == "adc.law")
    ratio = choice.correlation_ratio
    told = abs(stats.spearmanr(law, mixed.figure("peak_current")).statistic)
    assert ratio == pytest.approx(told, abs=0.05 if share == 0.0 else 0.01)
    wanted = ["adc.law", "motor.R_m"] if share > 1.0 else ["motor.R_m", "adc.law"]
    assert mixed.drivers("peak_current") == wanted[: 2 - (ratio == 0.0)]
    assert choice.is_distinct == (share > 0.0)
    (block,) = influence_tables(mixed)
    assert [each.heading for each in block.table.columns][3] == "correlation ratio"
    rows = [[cell.text for cell in row] for row in block.table.rows]
    assert [row[0] for row in rows] == [f"{w} (choice)" if w == "adc.law" else w for w in wanted]
    (row,) = (each for each in rows if each[0] == "adc.law (choice)")
    assert row[1:4] == ["-", "-", f"{ratio:.2f}"]
    said = drivers_data(mixed, "peak_current")["influences"]
    assert list(said) == wanted
    assert said["adc.law"] == {"correlation_ratio": ratio, "distinct": choice.is_distinct}


def test_a_choice_without_influence_seldom_differs_from_none():
    rng = np.random.default_rng(5)
    laws = rng.integers(0, 3, (1000, 40))
    figures = rng.lognormal(size=laws.shape)
    found = [
        choice_influence("law", law, y, 0.9)
        for law, y in zip(laws.astype(str), figures, strict=True)
    ]
    false = sum(each.is_distinct for each in found)
    assert 70 < false < 130  # of 1000 a tenth, within three standard deviations
    same = stats.kruskal(*(figures[0][laws[0] == k] for k in range(3))).pvalue
    assert found[0].is_distinct == (same < 0.1)


def test_what_a_study_does_not_have_is_named(found):
    findings = found([19.0, 20.0, 21.0])
    asked = (
        findings.figure,
        findings.influences,
        findings.effects,
        findings.drivers,
        findings.sensitivity,
    )
    for ask in asked:
        with pytest.raises(UnknownNameError, match="did you mean 'peak_current'"):
            ask("peak_curent")
    with raises(ParameterError, name="[design] kind", value="monte-carlo", valid="'morris'"):
        findings.sensitivity("peak_current")
