"""Studies run: closed forms come back, what is kept is told from what is not."""

from __future__ import annotations

import json
import math

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import bywire
from bywire.core.errors import FileError, InputError, ParameterError, UnknownNameError
from bywire.studies.store import Origin, StudyStore
from bywire.studies.study_file import read_study
from raising import raises
from systems.loading import SPRING_AXIS
from undrawn import undrawn

DAMPED = """
bench = "bench.toml"
[vary]
d = { kind = "normal", sd = "15 %" }
[design]
kind = "KIND"
cases = 256
[requirements]
overshoot = "<= 60 % with 98 %"
"""
VARY = '[vary]\n"motor.R_m" = "+-5 %"\n'
AXIS = """
experiment = "step"
parameters = "spring-axis-one"
[options]
input = "F_set"
output = "x"
end = "100 N"
duration = "1.2 s"
record = "0.4 ms"
[simulation]
step = "0.1 ms"
[set]
F_c = "0 N"
k_c = "1 nN/m"
T_s = "0.1 ms"
"""


def overshoot(d):
    """Of a mass on a spring without dry friction [%]; it falls with the damping."""
    zeta = d / (2.0 * math.sqrt(1e4 * 2.0))
    return 100.0 * np.exp(-np.pi * zeta / np.sqrt(1.0 - zeta**2))


@pytest.mark.parametrize("kind", ["monte-carlo", "latin-hypercube", "sobol"])
def test_a_linear_axis_has_the_quantiles_of_its_closed_form(tmp_path, spring_axis, kind):
    (tmp_path / "bench.toml").write_text(AXIS)
    (tmp_path / "study.toml").write_text(DAMPED.replace("KIND", kind))
    study = bywire.run_study(tmp_path / "study.toml", tmp_path / "out", workers=1)
    law = stats.norm(60.0, 9.0)
    np.testing.assert_allclose(study.cases["overshoot"], overshoot(study.cases["d"]), rtol=2e-3)
    (spread,) = (s for s in study.findings.spreads if s.name == "overshoot")
    for each in spread.quantiles:
        true = overshoot(law.ppf(1.0 - each.probability))
        assert each.low - 0.05 <= true <= each.high + 0.05
        if kind != "monte-carlo":  # even points: far closer than the interval says
            assert abs(each.value - true) < 0.2 * (each.high - each.low)
    (judgment,) = study.findings.judgments
    edge = 2.0 * math.sqrt(2e4) * abs(math.log(0.6)) / math.hypot(math.pi, math.log(0.6))
    assert judgment.share.low <= law.sf(edge) <= judgment.share.high
    assert (judgment.outcome, study.status) == ("missed", "failed")
    (influence,) = study.findings.influences("overshoot")
    assert influence.correlation == pytest.approx(-1.0)
    assert study.worst("overshoot").par.d == study.cases["d"].min()


def test_a_choice_among_the_options_varies_from_the_file_to_the_worst_bench(study, tmp_path):
    bench = (
        'experiment = "pressure-release"\nparameters = "dardanelli2010"\n[options]\n'
        'duration = "40 ms"\nsettle = "10 ms"\n'
    )
    found = bywire.run_study(
        study(
            '[vary]\n"options.how" = { values = ["controlled", "current-off"] }\n'
            '"motor.R_m" = "+-5 %"\n[design]\nkind = "corners"\n[requirements]\n'
            'peak_current = "<= 1 A"\n',
            bench,
        ),
        tmp_path / "out",
        workers=1,
    )
    assert found.cases["options.how"].tolist() == ["controlled"] * 3 + ["current-off"] * 2
    with undrawn():
        found.write(tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "one of controlled, current-off" in page
    written = bywire.load(tmp_path / "out" / "worst-peak_current.toml")
    assert written.options["how"] == "controlled"
    (kpi,) = (k for k in bywire.run(written).kpis if k.name == "peak_current")
    assert kpi.value == pytest.approx(found.cases["peak_current"].max(), rel=1e-9)
    assert found.cases["peak_current"].max() > 2.0 * found.cases["peak_current"].min()


def test_more_cases_extend_a_study_and_requirements_may_change(study, tmp_path):
    path, out = study(), tmp_path / "out"
    first = bywire.run_study(path, out, cases=64)
    written = StudyStore(out).path(0).stat().st_mtime_ns
    more = bywire.resume_study(out, cases=128)
    assert StudyStore(out).path(0).stat().st_mtime_ns == written  # nothing is computed twice
    pd.testing.assert_frame_equal(more.cases[:64], first.cases, check_exact=True)
    assert len(bywire.study_report(out).cases) == 128
    assert len(bywire.run_study(path, out, cases=128).cases) == 128
    with raises(ParameterError, name="cases", value="64", valid=">= 128"):
        bywire.resume_study(out, cases=64)
    path.write_text(path.read_text() + '[requirements]\npeak_current = "<= 1 A"\n')
    assert bywire.study_report(out).status == "failed"


@pytest.mark.parametrize(
    ("design", "why"),
    [
        ('kind = "corners"', "determine its cases"),
        ('kind = "morris"\ncases = 64', "groups together"),
    ],
)
def test_a_design_that_has_its_own_cases_takes_no_more(study, tmp_path, design, why):
    path, out = study(f'[vary]\n"motor.R_m" = "+-5 %"\n[design]\n{design}\n'), tmp_path / "out"
    result = bywire.run_study(path, out)
    with pytest.raises(ParameterError, match=why):
        bywire.resume_study(out, cases=256)
    again = bywire.study_report(out)
    assert len(again.cases) == len(result.cases) == result.plan.total
    figures = again.as_object()["kpis"]["peak_current"]
    assert not {"mean", "quantiles", "influences"} & set(figures)


def test_a_folder_of_another_study_is_refused(study, tmp_path):
    path, out = study(), tmp_path / "out"
    bywire.run_study(path, out, cases=64)
    path.write_text(path.read_text().replace("4 %", "5 %"))
    for call in (
        lambda: bywire.run_study(path, out),
        lambda: bywire.resume_study(out),
        lambda: bywire.study_report(out),
    ):
        with pytest.raises(FileError, match="contains another study") as refused:
            call()
        assert "varied motor.R_m: normal, mean" in str(refused.value)
        assert "quantiles" not in str(refused.value)
    path.unlink()
    with pytest.raises(FileError, match="no longer exists"):
        bywire.resume_study(out)
    with pytest.raises(FileError, match="does not contain a study"):
        bywire.study_report(tmp_path)


@pytest.mark.parametrize("design", ["monte-carlo", "subset-simulation"])
def test_a_study_without_a_case_says_so(study, tmp_path, design):
    if design != "monte-carlo":
        pytest.importorskip("openturns")
    text = f'[vary]\n"motor.R_m" = "+-5 %"\n[design]\nkind = "{design}"\ncases = 2560\n'
    path = study(text + '[requirements]\npeak_current = "<= 19 A with 99 %"\n')
    out = tmp_path / "out"
    StudyStore(out).open(read_study(path), Origin(path))
    nothing = bywire.study_report(out)
    assert nothing.status == "unfinished"
    assert "no case is computed yet" in str(nothing)
    assert any("not computed yet" in t or "not all cases" in t for t in nothing.warnings)


def test_a_damaged_chunk_is_named(study, tmp_path):
    path, out = study(), tmp_path / "out"
    bywire.run_study(path, out, cases=64)
    file = StudyStore(out).path(0)
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 0xFF
    file.write_bytes(bytes(data))
    with pytest.raises(FileError, match=r"000000\.parquet is damaged"):
        bywire.study_report(out)
    file.unlink()
    assert len(bywire.resume_study(out).cases) == 64


def test_results_in_python(study, tmp_path):
    text = (
        '[vary]\n"motor.R_m" = "+-4 %"\n"adc.law" = { values = ["ideal", "quantized"] }\n'
        '"motor.K_e" = { kind = "normal", sd = "2 %", together = ["ecu.est_par.K_e"] }\n'
    )
    result = bywire.run_study(study(text), tmp_path / "out", cases=50)
    assert result.status == "passed"
    assert result.data["ecu.est_par.K_e"].attrs["units"] == "N*m/A"
    assert any("64 cases instead of 50" in note for note in result.notes)
    assert any("adc.law: a choice" in note for note in result.notes)
    assert result.data["motor.R_m"].attrs["units"] == "ohm"
    assert result.data["peak_current"].dims == ("case",)
    assert "peak_current" in str(result)
    with undrawn():
        assert "probability" in result._repr_html_()
    with pytest.raises(UnknownNameError, match="valid names are peak_current"):
        result.worst("overshoot")


def test_the_file_of_the_worst_case_runs_it_to_the_last_digit(study, tmp_path):
    result = bywire.run_study(study(), tmp_path / "out", cases=64)
    result.write(tmp_path / "out")
    again = bywire.run(bywire.load(tmp_path / "out" / "worst-peak_current.toml"))
    row = result.findings.judgments[0].worst
    assert again.kpi("peak_current").value == result.cases["peak_current"][row]


def test_a_damaged_chunk_is_computed_again_and_that_is_said(study, tmp_path):
    path = study(VARY)
    before = bywire.run_study(path, tmp_path / "out", cases=128, workers=1)
    store = StudyStore(tmp_path / "out")
    store.path(1).write_bytes(store.path(1).read_bytes()[:200])
    with pytest.raises(FileError, match=r"000001\.parquet is damaged.*study resume"):
        bywire.study_report(tmp_path / "out")
    after = bywire.resume_study(tmp_path / "out", workers=1)
    pd.testing.assert_frame_equal(before.cases, after.cases, check_exact=True)
    assert "1 damaged chunk is recomputed" in after.notes
    store.path(1).write_bytes(store.path(0).read_bytes())  # sound, and in the wrong place
    with pytest.raises(FileError, match=r"000001\.parquet belongs to another study"):
        bywire.study_report(tmp_path / "out")


def test_a_study_is_kept_with_its_changes_and_another_says_how_it_differs(study, tmp_path):
    path, out = study(VARY), tmp_path / "out"
    run = bywire.run_study(path, out, {"seal.T_pr": "+10 %"}, cases=64, workers=1)
    assert bywire.study_report(out).plan.bench.par == run.plan.bench.par
    with pytest.raises(FileError, match=r"parameters seal\.T_pr: 0\.0022\d*, now 0\.002\)"):
        bywire.run_study(path, out, workers=1)
    with pytest.raises(ParameterError, match=r"study = .* must be a string or a path"):
        bywire.run_study({"bench": "hard-braking"})
    study(
        VARY.replace(
            '"+-5 %"', '{ kind = "tolerance", tolerance = "5 %", together = [BOTH] }'
        ).replace("BOTH", '"motor.L_m"')
    )
    both = r"\(varied motor\.R_m together: nothing, now motor\.L_m\)"
    with pytest.raises(FileError, match=both):
        bywire.run_study(path, out, {"seal.T_pr": "+10 %"})


def test_time_is_a_budget(study, tmp_path):
    path = study(VARY + '[design]\ntime = "1 us"\n')
    first = bywire.run_study(path, tmp_path / "out", cases=128, workers=1)
    assert (len(first.cases), first.status) == (64, "unfinished")
    assert "the study file limits each call to 0.001 ms" in first.warnings[-1]
    assert bywire.resume_study(tmp_path / "out", workers=1).status == "passed"
    with raises(ParameterError, name="[design] time", value="worst-case"):
        read_study(study(VARY + "[design]\nkind = 'worst-case'\ntime = '1 s'\n"))


def test_a_study_of_a_loaded_brake_says_which_it_was(tmp_path, spring_axis):
    (tmp_path / "bench.toml").write_text(AXIS)
    (tmp_path / "study.toml").write_text(DAMPED.replace("KIND", "monte-carlo"))
    bywire.run_study(tmp_path / "study.toml", tmp_path / "out", cases=64, workers=1)
    assert f" --system {SPRING_AXIS}" in StudyStore(tmp_path / "out").resume_command
    record = json.loads((tmp_path / "out" / "study.json").read_text())
    record["systems"] = ["elsewhere/axis.py"]  # not loaded by now
    (tmp_path / "out" / "study.json").write_text(json.dumps(record))
    (tmp_path / "study.toml").write_text(DAMPED.replace("bench.toml", "unknown-step"))
    with pytest.raises(InputError, match=r"study needs bywire.load_system\(.elsewhere/axis\.py"):
        bywire.study_report(tmp_path / "out")
