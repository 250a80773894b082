"""Studies whose bench states a numerical error: the step, its check, and the folder."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bywire
from bywire.api.study_run import StudyRun
from bywire.bench import step_choice
from bywire.core.errors import FileError, StepError
from bywire.studies.stated_error import error_check, probing_cases, with_step
from bywire.studies.store import StudyStore
from bywire.studies.study_file import read_study

STUDY = """
bench = "hard-braking"
[set]
simulation.error = "1 %"
options.duration = "0.4 s"
options.settle = "0.2 s"
[vary]
"motor.R_m" = { kind = "normal", sd = "4 %" }
"seal.T_pr" = "+-20 %"
[design]
cases = 64
[requirements]
overshoot = "<= 15 % with 90 %"
"""


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a study file."""
    path = tmp_path_factory.mktemp("study") / "study.toml"
    path.write_text(STUDY, "utf-8")
    return path


@pytest.fixture(scope="module")
def study(file: Path) -> StudyRun:
    """Return the results of the study."""
    return bywire.run_study(file, file.parent / "out", workers=1)


def test_probing_cases_visit_quantiles_pairs_and_choices(tmp_path: Path) -> None:
    """Both quantities combine in four ways, and each choice occurs."""
    file = tmp_path / "study.toml"
    choice = '"motor_heat.law" = { kind = "discrete", values = ["off", "lumped"] }\n[design]'
    file.write_text(STUDY.replace("[design]", choice), "utf-8")
    plan = read_study(file)
    cases = probing_cases(plan)
    resistances = {case["motor.R_m"] for case in cases}
    assert len(resistances) == 4
    ends = {(c["motor.R_m"], c["seal.T_pr"]) for c in cases}
    extremes = min(resistances), max(resistances)
    assert len([pair for pair in ends if pair[0] in extremes]) == 4
    assert {case["motor_heat.law"] for case in cases} == {"off", "lumped"}
    scores = (np.array(sorted(resistances)) - 0.35) / (0.04 * 0.35)
    assert scores == pytest.approx([-2.326, -0.674, 0.674, 2.326], abs=1e-3)
    assert probing_cases(plan) == cases


def test_the_study_shows_its_step_and_the_check(study: StudyRun) -> None:
    """The check reruns some cases with other steps, and finds no larger error."""
    choice = study.plan.bench.choice
    assert choice is not None
    assert choice.benches > 4
    assert study.nominal.bench.step == choice.step > 20e-6
    assert study.check is not None
    assert study.check.cases == 32
    assert 0.0 < study.check.largest["overshoot"] <= 0.01
    shown = study.as_object()
    assert shown["step"]["stated_error"] == 0.01
    assert shown["error_check"]["kpis"]["overshoot"]["exceeding"] == 0
    assert any("within simulation.error = 1 %" in text for text in study.notes)
    assert "chosen for simulation.error = 1 %" in str(study)


def test_cases_that_exceed_the_error_cause_a_warning(study: StudyRun) -> None:
    """With a smaller stated error, the same cases exceed it."""
    choice = study.plan.bench.choice
    assert choice is not None
    smaller = replace(study.plan.bench, error=1e-6, choice=replace(choice, stated=1e-6))
    findings = replace(study.findings, plan=replace(study.plan, bench=smaller))
    check = error_check(findings, study.nominal)
    assert check is not None
    assert check.exceeding == {"overshoot": 32}
    assert "overshoot in 32 cases" in check.warning
    assert not check.note


def test_a_study_keeps_the_step_in_its_folder(study: StudyRun, file: Path) -> None:
    """Another error, or a stated step, is another study; a damaged choice is chosen anew."""
    again = bywire.study_report(study.folder)
    assert again.plan.bench.choice == study.plan.bench.choice
    assert again.plan.digest == study.plan.digest
    step = {"simulation.step": f"{study.plan.bench.step} s"}
    stated = read_study(file, step)
    assert stated.bench.error is None
    assert stated.digest != study.plan.digest
    with pytest.raises(FileError, match="another study"):
        bywire.run_study(file, study.folder, {"simulation.error": "5 %"}, workers=1)
    record = study.folder / "study.json"
    content = json.loads(record.read_text())
    record.write_text(json.dumps({**content, "choice": {"step": "x"}}))
    kept = with_step(read_study(file), StudyStore(study.folder))
    assert kept.digest == study.plan.digest
    record.write_text(json.dumps(content))


def test_an_error_that_the_study_cannot_reach(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail before the folder is created."""
    monkeypatch.setattr(step_choice, "FINEST", 50e-6)
    with pytest.raises(StepError, match=r"0\.0001 % cannot be reached"):
        bywire.run_study(file, file.parent / "none", {"simulation.error": "0.0001 %"})
    assert not (file.parent / "none").exists()


def test_a_campaign_chooses_its_step_for_fault_free_runs(tmp_path: Path) -> None:
    """And states that it does."""
    campaign = tmp_path / "faults.toml"
    campaign.write_text(
        """
bench = "hard-braking"
[set]
simulation.error = "5 %"
requirements.overshoot = "<= 15 %"
[vary]
"motor.R_m" = "+-5 %"
[campaign]
only = ["pressure.offset"]
onset = "0.1 s"
healthy = 4
[[criteria]]
name = "high"
signal = "p_mc"
above = "60 bar"
lasting = "10 ms"
""",
        "utf-8",
    )
    shown = bywire.run_faults(campaign)
    assert shown.as_object()["step"]["benches"] == 5
    assert any("key figures of fault-free runs" in text for text in shown.notes)
