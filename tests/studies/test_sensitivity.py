"""Indices of sensitivity are those of closed forms, and their intervals cover."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bywire.api.study_run import StudyRun
from bywire.api.study_tables import drivers_data, sensitivity_tables
from bywire.core.errors import FileError, InputError, ParameterError
from bywire.studies.designs import MOST, SENSITIVITY, SensitivityDesign
from bywire.studies.findings import Findings
from bywire.studies.plan import StudyPlan
from bywire.studies.store import CASE, FAILURE, WARNINGS
from bywire.studies.study_file import read_study
from raising import raises

NAMES = ("motor.R_m", "motor.K_e", "motor.L_m")
DESIGN = """
[vary]
"motor.R_m" = "+-5 %"
"motor.K_e" = "+-5 %"
"motor.L_m" = "+-5 %"
[design]
kind = "{kind}"
cases = {cases}
"""
KPI = "peak_current"  # stands for any figure: its column is fed
ISHIGAMI = {  # with a = 7, b = 0.1: first order and total in closed form
    "motor.R_m": (0.3139, 0.5576),
    "motor.K_e": (0.4424, 0.4424),
    "motor.L_m": (0.0, 0.2437),
}
SLOPES = np.array([1.0, -2.0, 3.0])
SEEDS = 50


def ishigami(x):
    """Of three quantities between -1 and 1."""
    a, b, c = np.pi * x
    return np.sin(a) + 7.0 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a)


def linear(x):
    return SLOPES @ x


def found(plan: StudyPlan, function: Callable[..., np.ndarray]) -> Findings:
    """Return the cases of a study as they were computed, of a function of (-1, 1) each."""
    chunks = [pd.DataFrame(plan.values(k)) for k in range(plan.chunks)]
    cases = pd.concat(chunks, ignore_index=True)
    nominal = plan.bench.par.flat()
    x = np.array([(cases[name] / nominal[name] - 1.0) / 0.05 for name in NAMES])
    cases = cases.assign(**{KPI: function(x), CASE: range(len(cases)), FAILURE: "", WARNINGS: ""})
    for name in plan.bench.definition.kpis_with(plan.bench.chosen_options):
        if name != KPI:
            cases[name] = math.nan
    return Findings(plan, cases, ())


@pytest.fixture
def planned(study):
    """Return a function that reads the plan of a design."""

    def plan(kind: str, cases: int, text: str = "") -> StudyPlan:
        return read_study(study(DESIGN.format(kind=kind, cases=cases) + text))

    return plan


def by_name(findings: Findings) -> dict:
    return {each.quantity: each for each in findings.sensitivity(KPI).drivers}


def holds(estimate, true: float) -> bool:
    return estimate.low <= true <= estimate.high


def test_shares_of_variance_are_those_of_ishigamis_function(planned):
    indices = by_name(found(planned("sobol-indices", 20_480), ishigami))
    assert list(indices) == ["motor.R_m", "motor.K_e", "motor.L_m"]  # by their totals
    for name, (first, total) in ISHIGAMI.items():
        each = indices[name]
        assert (each.first.value, each.total.value) == pytest.approx((first, total), abs=0.02)
        assert holds(each.first, first)
        assert holds(each.total, total)
        assert each.first.high - each.first.low < 0.15


def test_groups_out_of_order_would_show(planned):
    """The gate above can fail: columns exchanged, or the cases of groups shifted by one."""
    plan = planned("sobol-indices", 20_480)
    exchanged = by_name(found(plan, lambda x: ishigami(x[[1, 0, 2]])))
    assert not holds(exchanged["motor.R_m"].total, ISHIGAMI["motor.R_m"][1])
    shifted = by_name(found(plan, lambda x: np.roll(ishigami(x), 1)))
    assert not holds(shifted["motor.L_m"].first, 0.0)


def test_a_linear_function_has_its_slopes(planned):
    indices = by_name(found(planned("sobol-indices", 5120), linear))
    shares = SLOPES**2 / np.sum(SLOPES**2)
    for name, share in zip(NAMES, shares, strict=True):
        each = indices[name]
        assert (each.first.value, each.total.value) == pytest.approx((share, share), abs=0.01)
    effects = by_name(found(planned("morris", 100), linear))
    assert list(effects) == ["motor.L_m", "motor.K_e", "motor.R_m"]
    for name, slope in zip(NAMES, SLOPES, strict=True):  # from end to end: twice the slope
        each = effects[name]
        assert each.mu_star.value == pytest.approx(2.0 * abs(slope))
        assert each.sigma == pytest.approx(0.0, abs=1e-9)


def test_a_step_between_single_values_is_all_they_can_do(study):
    """Whatever their weights, a switch that adds 5 A has an effect of 5 A, and no more."""
    plan = read_study(
        study("""
[vary]
"motor.R_m" = "+-5 %"
"supply.V_bat" = { kind = "discrete", values = ["11 V", "13 V"], weights = [1, 3] }
"adc.law" = { kind = "discrete", values = ["ideal", "quantized"] }
[design]
kind = "morris"
cases = 64
""")
    )
    chunks = [pd.DataFrame(plan.values(k)) for k in range(plan.chunks)]
    cases = pd.concat(chunks, ignore_index=True)
    ratio = (cases["motor.R_m"] / plan.bench.par.motor.R_m - 1.0) / 0.05
    figure = ratio + 2.0 * cases["supply.V_bat"] - 5.0 * (cases["adc.law"] == "ideal")
    effects = by_name(Findings(plan, cases.assign(**{KPI: figure}), ()))
    for name, size in (("motor.R_m", 2.0), ("supply.V_bat", 4.0), ("adc.law", 5.0)):
        each = effects[name]
        assert (each.mu_star.value, each.mu_star.low) == pytest.approx((size, size))
        assert each.sigma == pytest.approx(0.0, abs=1e-9)


def mean_effects(function) -> np.ndarray:
    """Return mu* over all trajectories there are: every step of two thirds on four levels."""
    levels = np.linspace(-1.0, 1.0, 4)
    points = np.stack(np.meshgrid(levels, levels, levels)).reshape(3, -1)
    means = []
    for k in range(3):
        low = points[:, points[k] < 0.0]
        high = low.copy()
        high[k] += 4.0 / 3.0
        means.append(np.mean(np.abs(function(high) - function(low))) * 1.5)
    return np.array(means)


def curved(x):
    return (x[0] + 1.0) ** 2 + x[0] * x[1] + np.sin(2.0 * x[2]) * x[1] + 0.3 * x[2]


@pytest.mark.parametrize(("kind", "cases"), [("sobol-indices", 320), ("morris", 64)])
def test_intervals_cover_from_the_least_number_of_cases_on(planned, kind, cases):
    """Of each index over many seeds; intervals of 50 % width would not."""
    plan, held, narrow = planned(kind, cases), [], []
    for seed in range(SEEDS):
        if kind == "morris":
            indices = by_name(found(replace(plan, seed=seed), curved))
            true = dict(zip(NAMES, mean_effects(curved), strict=True))
            pairs = [(each.mu_star, true[name]) for name, each in indices.items()]
        else:
            indices = by_name(found(replace(plan, seed=seed), ishigami))
            pairs = [
                (index, true)
                for name, each in indices.items()
                for index, true in zip((each.first, each.total), ISHIGAMI[name], strict=True)
            ]
        for estimate, true_value in pairs:
            reach = estimate.high - estimate.value
            held.append(abs(estimate.value - true_value) <= reach)
            narrow.append(abs(estimate.value - true_value) <= 0.5 * reach)
    assert np.mean(held) >= 0.92
    assert np.mean(narrow) < 0.85


def test_the_confidence_of_the_study_is_that_of_its_intervals(planned):
    wide, narrow = (
        by_name(found(replace(planned(kind, 640), confidence=c), curved))["motor.R_m"].strength
        for kind in ["morris"]
        for c in (0.99, 0.5)
    )
    ratio = (wide.high - wide.value) / (narrow.high - narrow.value)
    assert ratio == pytest.approx(2.5758 / 0.6745, rel=1e-3)


@pytest.mark.parametrize("kind", SENSITIVITY)
def test_points_and_intervals_depend_on_the_seed_alone(planned, kind):
    for seed in (0, 1, 2**62):  # SALib takes the seed 0 as none
        plan = replace(planned(kind, 320), seed=seed)
        one, two = (by_name(found(each, curved)) for each in (plan, replace(plan)))
        assert one == two
    assert by_name(found(replace(plan, seed=1), curved)) != one
    later = plan.values(3)["motor.R_m"]
    np.testing.assert_array_equal(later, replace(plan).values(3)["motor.R_m"])


def test_a_group_of_saltellis_exchanges_one_quantity_at_a_time():
    groups = SensitivityDesign("sobol-indices", 3, 320, 1).probabilities.reshape(64, 5, 3)
    a, b = groups[:, 0], groups[:, -1]
    assert (a != b).all()
    for k in range(3):
        mixed = np.where(np.arange(3) == k, b, a)
        np.testing.assert_array_equal(groups[:, 1 + k], mixed)


def test_trajectories_go_to_the_ends_and_no_further(study):
    plan = read_study(
        study("""
[vary]
"motor.R_m" = { kind = "normal", sd = "4 %" }
"motor.K_e" = "+-5 %"
"adc.law" = { kind = "discrete", values = ["ideal", "quantized"], weights = [1, 3] }
[design]
kind = "morris"
cases = 127
""")
    )
    assert (plan.total, plan.chunks) == (124, 2)  # 31 trajectories of 4 cases
    last = plan.values(1)
    assert {len(column) for column in last.values()} == {60}  # a shorter chunk
    columns = {name: [*column, *last[name]] for name, column in plan.values(0).items()}
    par = plan.bench.par.motor
    ratios = np.array(columns["motor.R_m"]) / par.R_m
    assert (ratios.min(), ratios.max()) == pytest.approx((0.88, 1.12))  # 3 standard deviations
    ratios = np.array(columns["motor.K_e"]) / par.K_e
    assert sorted({*ratios.round(6)}) == pytest.approx([0.95, 0.983333, 1.016667, 1.05])
    assert {*columns["adc.law"]} == {"ideal", "quantized"}


@pytest.mark.parametrize(
    ("kind", "cases", "base", "least"),
    [("sobol-indices", 2000, 256, 320), ("morris", 2000, 500, 64)],
)
def test_the_budget_is_used_and_its_least_is_said(planned, kind, cases, base, least):
    plan = planned(kind, cases)
    assert plan.sensitivity.base == base
    assert plan.total == base * plan.sensitivity.group <= cases
    assert planned(kind, least).total == least
    with raises(InputError, name="cases", value=f"{least - 1}", valid=f">= {least}"):
        planned(kind, least - 1)
    with raises(ParameterError, name="cases", valid="<= "):
        replace(plan, cases=MOST + 1).points  # noqa: B018


@pytest.mark.parametrize(
    ("text", "texts"),
    [
        ("[requirements]\novershoot = '<= 15 % with 90 %'", ["no probability", "'monte-carlo'"]),
        ("[[correlation]]\nof = ['motor.R_m', 'motor.K_e']\nvalue = 0.5", ["[[correlation]]"]),
        ("levels = 6", ["levels", "no effect"]),
    ],
)
@pytest.mark.parametrize("kind", SENSITIVITY)
def test_what_such_designs_do_not_admit_is_refused(planned, kind, text, texts):
    with pytest.raises(InputError) as refused:
        planned(kind, 640, text)
    for each in (kind, *texts):
        assert each in str(refused.value)


def test_more_single_values_than_levels_are_refused(study):
    """Of five, trajectories on four levels would leave one out."""
    values = [f"{volts} V" for volts in range(10, 15)]
    text = f'[vary]\n"supply.V_bat" = {{ kind = "discrete", values = {values} }}\n'
    with raises(ParameterError, name="[vary] supply.V_bat", value="5", valid="4"):
        read_study(study(f'{text}[design]\nkind = "morris"\n'))
    read_study(study(f'{text}[design]\nkind = "sobol-indices"\ncases = 640\n'))


def test_another_number_of_groups_is_another_study(planned):
    plan = planned("sobol-indices", 320)
    same, more, other = (
        replace(plan, **change).digest for change in ({"cases": 639}, {"cases": 640}, {"seed": 2})
    )
    assert plan.digest == same
    assert len({plan.digest, more, other, planned("morris", 320).digest}) == 4


def undefined(x):
    return np.where(np.arange(x.shape[1]) == 7, np.nan, curved(x))


@pytest.mark.parametrize(
    ("function", "text"),
    [
        (undefined, "not defined in 1 of 320 cases"),
        (lambda x: 5.0 + 0.0 * x[0], "does not vary"),
        (lambda x: 5.0 + 1e-15 * x[0], "does not vary"),  # but for rounding
    ],
)
@pytest.mark.parametrize("kind", SENSITIVITY)
def test_figures_without_indices_say_why(planned, kind, function, text):
    findings = found(planned(kind, 320), function)
    assert (findings.sensitivity(KPI).drivers, findings.sensitivity(KPI).missing) == ((), text)
    assert sensitivity_tables(findings) == []
    assert findings.drivers(KPI) == []
    assert drivers_data(findings, KPI) == {"sensitivity": {}, "sensitivity_missing": text}
    notes = StudyRun(findings.plan, Path("out"), findings, None, "done").notes
    assert notes[1].endswith(f"{KPI}: {text}")


def test_a_figure_that_varies_in_a_few_cases_alone_has_no_variance_to_share(planned):
    plan = planned("sobol-indices", 320)
    for case, text in ((6, "varies in too few cases"), (5, "")):  # exchanged, and a first point
        findings = found(plan, lambda x, at=case: 1.0 * (np.arange(x.shape[1]) == at))
        assert findings.sensitivity(KPI).missing == text


def test_a_study_that_is_not_complete_has_no_indices(planned):
    whole = found(planned("sobol-indices", 320), curved)
    part = Findings(whole.plan, whole.cases[64:], ())
    assert part.sensitivity(KPI).missing == "not all cases are computed"
    assert len(whole.sensitivity(KPI).drivers) == 3


def test_a_missing_library_is_one_error(planned, monkeypatch):
    monkeypatch.setitem(sys.modules, "SALib.sample.sobol", None)
    with pytest.raises(FileError, match=r"need the library SALib.*\.\[studies\]"):
        planned("sobol-indices", 320)


def test_no_interval_of_a_share_ends_beyond_all_of_the_variance(planned):
    """What one quantity makes alone has wide intervals around 1 with few groups."""
    indices = by_name(found(planned("sobol-indices", 320), lambda x: x[0] ** 3))
    for each in indices.values():
        for share in (each.first, each.total):
            assert share.low <= share.value <= share.high <= max(1.0, share.value)
