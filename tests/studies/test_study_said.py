"""What reports of studies say is true: units, what is left out, who misses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from bywire.api.study_figures import study_figures
from bywire.api.study_run import StudyRun
from bywire.api.study_surrogate import StudySurrogates
from bywire.api.study_tables import influence_tables, spread_table
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.running import Result
from bywire.report.document import FigureBlock, TableBlock
from bywire.report.readable_axis import scale_of
from bywire.studies.findings import Findings
from bywire.studies.store import CASE, FAILURE, WARNINGS
from bywire.studies.study_file import read_study
from bywire.studies.surrogate import surrogate_of

QUANTITIES = (
    "motor.R_m",
    "motor.K_e",
    "motor.L_m",
    "gear.J_mot",
    "seal.T_pr",
    "caliper.K_pd",
    "supply.V_bat",
)
CASES = 1000
BENCH = 'experiment = "hard-braking"\nparameters = "dardanelli2010"\n'


@pytest.fixture
def found(study):
    """Return a function that makes findings of one key figure, which rises with all that varies."""

    def make(name: str, values: np.ndarray, limit: str) -> Findings:
        varied = "".join(f'"{each}" = "+-5 %"\n' for each in QUANTITIES)
        text = f'[vary]\n{varied}[requirements]\n{name} = "{limit}"\n'
        plan = read_study(study(text, bench=BENCH))
        rng = np.random.default_rng(1)
        columns = {
            each: np.full(values.size, math.nan)
            for each in plan.bench.definition.kpis_with(plan.bench.chosen_options)
        }
        columns |= {each: values + rng.normal(size=values.size) for each in QUANTITIES}
        columns |= {CASE: np.arange(values.size), name: values}
        columns |= {FAILURE: np.full(values.size, ""), WARNINGS: np.full(values.size, "")}
        return Findings(plan, pd.DataFrame(columns), (Kpi(name, float(values[0]), "s", "A time."),))

    return make


def captions(findings: Findings) -> Mapping[str, str]:
    blocks = study_figures(findings, dict)
    return {each.name: each.caption for each in blocks if isinstance(each, FigureBlock)}


@pytest.mark.parametrize(
    ("low", "high", "unit"), [(0.05, 0.07, "ms"), (0.9, 1.1, "s"), (2.0, 3.0, "s")]
)
def test_a_figure_has_one_unit_in_its_row_and_on_its_axis(found, low, high, unit):
    values = np.linspace(low, high, CASES)
    findings = found("rise_time", values, "<= 5 s with 90 %")
    (row,) = spread_table(findings).rows
    assert {cell.text.split()[-1] for cell in row[1:]} == {unit}
    assert scale_of(values, "s").unit == unit


def test_what_drives_missed_requirements_comes_first(study):
    varied = "".join(f'"{each}" = "+-5 %"\n' for each in QUANTITIES)
    limits = 'dead_time = "<= 1 s"\nrise_time = "<= 1 s with 99.9 %"\novershoot = "<= 1 %"\n'
    plan = read_study(study(f"[vary]\n{varied}[requirements]\n{limits}", bench=BENCH))
    rng = np.random.default_rng(1)
    names = plan.bench.definition.kpis_with(plan.bench.chosen_options)
    columns = {each: rng.uniform(0.5, 0.9, 128) for each in (*names, *QUANTITIES)}
    columns |= {CASE: np.arange(128), "overshoot": rng.uniform(0.5, 1.5, 128)}
    columns |= {FAILURE: "", WARNINGS: ""}
    findings = Findings(plan, pd.DataFrame(columns), ())
    outcomes = {each.demand.figure: each.outcome for each in findings.judgments}
    assert outcomes == {"dead_time": "met", "rise_time": "undecided", "overshoot": "missed"}
    titles = [each.title.split(" (")[0] for each in influence_tables(findings)]
    assert titles == [
        f"main influences on {name}" for name in ("overshoot", "rise_time", "dead_time")
    ]


def test_a_table_of_drivers_says_how_many_it_leaves_out(found):
    findings = found("rise_time", np.linspace(0.05, 0.07, CASES), "<= 60 ms with 90 %")
    (table,) = influence_tables(findings)
    assert len(table.table.rows) == 5
    assert table.caption.startswith("Main influences on rise_time (the 5 strongest")
    assert " 2 " in table.caption


def test_captions_say_who_is_drawn_and_who_misses(found):
    values = np.linspace(0.05, 0.07, CASES)
    every = captions(found("rise_time", values, "<= 60 ms with 90 %"))
    assert "Crosses" in every["scatter-rise_time"]
    assert every["parallel"].endswith(
        "The figure shows 300 of 500 cases that meet all requirements "
        "and 300 of 500 cases that miss one."
    )
    none = captions(found("rise_time", values, "<= 80 ms with 90 %"))
    assert "Crosses" not in none["scatter-rise_time"]
    assert "miss" not in none["parallel"]
    lacking = captions(found("rise_time", np.where(values < 0.06, values, np.nan), "<= 60 ms"))
    assert "Crosses" not in lacking["scatter-rise_time"]
    assert "(500)" in lacking["scatter-rise_time"]
    assert lacking["parallel"].endswith("goes to 'none'.")


def test_no_more_points_are_left_out_than_are_said(found):
    values = np.linspace(0.05, 0.07, 9000)
    said = captions(found("rise_time", values, "<= 69.5 ms with 90 %"))["scatter-rise_time"]
    assert "shows 4000 of 8775 cases that meet the limit and all 225 cases that miss it." in said


def test_a_surrogate_has_the_unit_of_its_figure(found):
    pytest.importorskip("openturns")
    findings = found("rise_time", np.linspace(0.05, 0.07, 200), "<= 60 ms with 90 %")
    nominal = Result(findings.plan.bench, {}, findings.nominal, (), "done")
    study = StudyRun(findings.plan, Path("out"), findings, nominal, "done")
    made = surrogate_of(findings, "rise_time")
    document = StudySurrogates(study, {"rise_time": made}, dict(made.nominal), {}).document()
    block = document.page[0].blocks[0]
    assert isinstance(block, TableBlock)
    _, told, _, rms, largest, *_ = (cell.text for cell in block.table.rows[0])
    assert {text.split()[-1] for text in (told, rms, largest)} == {"ms"}


def test_histograms_of_designs_that_go_to_the_ends_count_no_frequencies(found):
    findings = found("rise_time", np.linspace(0.05, 0.07, CASES), "<= 60 ms")
    assert "90 % of the cases" in captions(findings)["histograms"]
    ends = replace(findings, plan=replace(findings.plan, design="corners"))
    said = "Heights are numbers of cases of corners, not probabilities"
    assert said in captions(ends)["histograms"]


def test_a_case_that_is_worst_twice_is_drawn_once(found):
    findings = found("rise_time", np.linspace(0.05, 0.07, CASES), "<= 60 ms")
    time = ("time", np.linspace(0.0, 1.0, 11))
    one, other = (
        xr.Dataset({"p": ("time", k * time[1], {"units": "Pa"})}, coords={"time": time})
        for k in (1.0, 2.0)
    )
    runs = {"the bench itself": one, "worst a": other, "worst b": other.copy()}
    blocks = study_figures(findings, lambda: {"run": runs})
    (block,) = (each for each in blocks if getattr(each, "name", "") == "worst-run")
    axes = block.figure.axes[0]
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert texts[:2] == ["the bench itself", "worst a, worst b"]
    assert len(axes.lines) == 2
