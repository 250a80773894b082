"""Chunks: the figures of cases are those of single runs, and a case that fails fails alone."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bywire.bench import running
from bywire.core.errors import DeviceError, RunError
from bywire.core.parameters import ParameterSet
from bywire.studies import store as chunks
from bywire.studies.executor import InProcess
from bywire.studies.store import case_bench, computed_chunk
from bywire.studies.study_file import read_study
from emulated_driver import EmulatedDriver, Status, emulated

RELEASE = """
experiment = "pressure-release"
parameters = "dardanelli2010"
[options]
duration = "40 ms"
settle = "10 ms"
"""
CORNER = """
experiment = "corner-stop"
parameters = "roberts2003-corner"
[options]
v_0 = "10 km/h"
"""
OPEN_LOOP = """
experiment = "motor-open-loop"
parameters = "dardanelli2010"
[options]
duration = "40 ms"
p_start = "5 bar"
[stimulus]
kind = "step"
start = "0 A"
end = "2 A"
t_step = "0 s"
"""


@pytest.fixture
def plan(study, monkeypatch):
    monkeypatch.setattr("bywire.studies.store.CHUNK", 8)
    monkeypatch.setattr("bywire.studies.plan.CHUNK", 8)
    return read_study(study())


def test_key_figures_are_those_of_single_runs(plan):
    columns = computed_chunk(plan, 2)
    assert columns["case"].tolist() == list(range(16, 24))
    assert not any(columns["failure"])
    for k in (0, 5):
        values = {name: column[k] for name, column in plan.values(2).items()}
        alone = running.run(case_bench(plan, 16 + k, values))
        for kpi in alone.kpis:
            assert columns[kpi.name][k] == pytest.approx(kpi.value, rel=1e-9, nan_ok=True)


def test_cases_of_several_structures_run_in_groups(study, monkeypatch):
    monkeypatch.setattr("bywire.studies.plan.CHUNK", 8)
    plan = read_study(
        study('[vary]\n"adc.law" = { values = ["ideal", "quantized"] }\n"motor.R_m" = "+-5 %"\n')
    )
    columns = computed_chunk(plan, 0)
    assert {*columns["adc.law"]} == {"ideal", "quantized"}
    assert np.isfinite(columns["peak_current"]).all()


@pytest.mark.parametrize(
    ("bench", "name", "values", "other"),
    [
        (RELEASE, "options.how", ["controlled", "current-off"], "motor.R_m"),
        (OPEN_LOOP, "options.add_holding", ["false", "true"], "motor.R_m"),
        (CORNER, "options.surface", ["dry-asphalt", "ice"], "options.v_0"),
    ],
    ids=["pressure-release", "motor-open-loop", "corner"],
)
def test_key_figures_of_choices_among_the_options_are_those_of_single_runs(
    study, monkeypatch, bench, name, values, other
):
    monkeypatch.setattr("bywire.studies.plan.CHUNK", 8)
    text = ", ".join(values if "true" in values else map(repr, values))
    plan = read_study(
        study(f'[vary]\n"{name}" = {{ values = [{text}] }}\n"{other}" = "+-5 %"\n', bench)
    )
    columns = computed_chunk(plan, 0)
    assert sorted({*columns[name]}) == values
    assert not any(columns["failure"])
    for k in range(8):
        case = {each: column[k] for each, column in plan.values(0).items()}
        for kpi in running.run(case_bench(plan, k, case)).kpis:
            assert columns[kpi.name][k] == pytest.approx(kpi.value, rel=1e-9, nan_ok=True)


def test_choices_of_one_name_in_parameters_and_options_tell_cases_apart():
    class Chosen(ParameterSet):
        law: str

    def bench(par, option):
        return SimpleNamespace(par=Chosen(law=par), chosen_options=Chosen(law=option))

    benches = {0: bench("a", "b"), 1: bench("b", "b"), 2: bench("a", "b"), 3: bench("a", "a")}
    assert chunks._alike(benches) == [[0, 2], [1], [3]]


def test_a_case_that_fails_fails_alone(plan, monkeypatch):
    worst = float(np.sort(plan.values(0)["motor.R_m"])[-1])
    key_figures_of = chunks.key_figures_of

    def failing(benches, threads):
        if any(bench.par.motor.R_m == worst for bench in benches):
            raise RunError("it left the numbers")
        return key_figures_of(benches, threads)

    monkeypatch.setattr(chunks, "key_figures_of", failing)
    columns = computed_chunk(plan, 0)
    failed = columns["motor.R_m"] == worst
    assert [text == "it left the numbers" for text in columns["failure"]] == failed.tolist()
    assert (np.isnan(columns["peak_current"]) == failed).all()


def test_values_that_contradict_each_other_are_a_failure(study):
    plan = read_study(
        study(
            '[vary]\n"master_cylinder.s_mc" = { kind = "discrete", '
            'values = ["0.0001 mm", "10 mm"] }\n'
        )
    )
    columns = computed_chunk(plan, 0)
    failed = np.array([bool(text) for text in columns["failure"]])
    assert (failed == (columns["master_cylinder.s_mc"] < 1e-6)).all()
    assert failed.any()
    assert not failed.all()


def test_drawn_cases_have_noise_of_their_own(plan):
    values = {name: column[0] for name, column in plan.values(0).items()}
    assert case_bench(plan, 5, values).seed == plan.bench.seed + 5


def test_chunks_that_a_graphics_processor_computes_together_are_as_they_are_alone(plan):
    there = replace(plan, bench=replace(plan.bench, engine="cuda"))
    with emulated(EmulatedDriver()) as driver:
        with InProcess(together=3).opened(there) as compute:
            computed = list(compute([4, 0, 2, 1]))
        assert len(driver.launches) == 2
        driver.cuCtxSynchronize = lambda: (Status.CUDA_ERROR_ILLEGAL_ADDRESS,)
        with pytest.raises(DeviceError, match="failed"):  # and is no case without a result
            computed_chunk(there, 3)
    assert [number for number, _ in computed] == [4, 0, 2, 1]
    for number, columns in computed:
        alone = computed_chunk(plan, number)
        assert columns.keys() == alone.keys()
        for name, column in alone.items():
            np.testing.assert_array_equal(columns[name], column)
