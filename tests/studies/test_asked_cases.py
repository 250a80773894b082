"""How many cases a study is asked for: checked before anything is written, and taken back."""

from __future__ import annotations

import pytest

import bywire
from bywire.core.errors import ParameterError
from raising import raises

FEW = """
[vary]
"motor.R_m" = "+-5 %"
[design]
cases = 64
"""


@pytest.mark.parametrize(
    "asked",
    [
        {"cases": 99_999_999_999},
        {"cases": 0},
        {"cases": 1.5},
        {"workers": 0},
        {"workers": 2000},
        {"workers": 2, "cluster": "tcp://host:8786"},
    ],
)
def test_what_cannot_be_leaves_no_folder_and_no_trace_in_one(study, tmp_path, asked):
    path, out = study(FEW), tmp_path / "out"
    with pytest.raises(ParameterError):
        bywire.run_study(path, out, **asked)
    assert not out.exists()
    bywire.run_study(path, out)
    before = (out / "study.json").read_bytes()
    with pytest.raises(ParameterError):
        bywire.resume_study(out, **asked)
    assert (out / "study.json").read_bytes() == before


def test_cases_that_are_not_computed_are_taken_back(study, tmp_path, monkeypatch):
    path, out = study(FEW), tmp_path / "out"
    bywire.run_study(path, out, cases=128)

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bywire.resume_study(out, cases=1_000_000, progress=interrupted)
    with pytest.warns(match="of 1000000 cases are not computed"):
        assert bywire.study_report(out).status == "unfinished"
    with raises(ParameterError, name="cases", value="127", valid=">= 128"):
        bywire.resume_study(out, cases=127)
    assert len(bywire.resume_study(out, cases=128).cases) == 128
    assert len(bywire.study_report(out).cases) == 128
