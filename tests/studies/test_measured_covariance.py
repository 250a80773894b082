"""Parameters vary as an identification left them: means, deviations and correlations come back."""

from __future__ import annotations

import json

import numpy as np
import pytest

from bywire.core.errors import InputError
from bywire.studies.study_file import read_study

NAMES = ["motor.R_m", "motor.K_e", "low:K"]
MATRIX = [[1.0, -0.8, 0.1], [-0.8, 1.0, 0.0], [0.1, 0.0, 1.0]]


def estimate(**changes):
    rows = {
        "motor.R_m": {"value": 0.36, "unit": "ohm", "standard_deviation": 0.01},
        "motor.K_e": {"value": 0.031, "unit": "N*m/A", "standard_deviation": 4e-4},
        "low:K": {"value": 3.0, "unit": "bar/A", "standard_deviation": 0.1},
    }
    for name, value in changes.items():
        rows["motor.R_m"][name] = value
    return {
        "estimates": {
            "braking": {"parameters": rows, "correlation": {"names": NAMES, "matrix": MATRIX}}
        }
    }


@pytest.fixture
def written(tmp_path):
    def write(content):
        (tmp_path / "id").mkdir(exist_ok=True)
        text = content if isinstance(content, str) else json.dumps(content)
        (tmp_path / "id" / "estimate.json").write_text(text)

    return write


def test_estimates_come_back_as_they_were(study, written):
    written(estimate())
    plan = read_study(
        study(
            '[measured]\nfile = "id"\n[vary]\n"motor.L_m" = "+-5 %"\n'
            '[[correlation]]\nof = ["motor.L_m", "motor.R_m"]\nvalue = 0.2\n'
        )
    )
    assert [v.name for v in plan.varied] == ["motor.R_m", "motor.K_e", "motor.L_m"]
    columns = [plan.values(k) for k in range(60)]
    R, K, L = (np.concatenate([c[v.name] for c in columns]) for v in plan.varied)
    assert R.mean() == pytest.approx(0.36, abs=5e-4)
    assert R.std() == pytest.approx(0.01, rel=0.05)
    assert np.corrcoef(R, K)[0, 1] == pytest.approx(-0.8, abs=0.03)
    assert np.corrcoef(R, L)[0, 1] == pytest.approx(0.2, abs=0.05)


def test_pure_numbers_have_no_unit(study, written):
    said = estimate()
    entry = said["estimates"]["braking"]
    entry["parameters"]["seal.k_brk_p"] = {"value": 2.6, "unit": "1", "standard_deviation": 0.1}
    names = [*NAMES, "seal.k_brk_p"]
    entry["correlation"] = {"names": names, "matrix": np.eye(4).tolist()}
    written(said)
    plan = read_study(study('[measured]\nfile = "id"\ntruncate = true\n'))
    law = next(v.distribution for v in plan.varied if v.name == "seal.k_brk_p")
    assert law.quantile(np.array([0.5]))[0] == pytest.approx(2.6)


def test_some_of_them_and_cut_off(study, written):
    written(estimate(value=0.02))
    refused = r"\[measured\] motor.R_m: .* leaves the valid range.*truncate = true"
    with pytest.raises(InputError, match=refused):
        read_study(study('[measured]\nfile = "id"\n'))
    plan = read_study(
        study('[measured]\nfile = "id/estimate.json"\nof = ["motor.R_m"]\ntruncate = true\n')
    )
    assert "truncated from 0 ohm" in plan.varied[0].distribution.text
    assert 0.0 < plan.varied[0].distribution.levels(2)[0] < 0.001
    assert plan.correlations == {}


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("{", "contains no estimates"),
        ({"estimates": {}}, "contains no estimates"),
        (estimate(value="0.3"), "not a number"),
        (estimate(standard_deviation=0.0), "not > 0"),
        ({"estimates": [1, 2]}, "contains no estimates"),
        ("[" * 100_000, "contains no estimates"),
    ],
)
def test_what_is_no_estimate_is_said(study, written, content, text):
    written(content)
    with pytest.raises(InputError, match=text):
        read_study(study('[measured]\nfile = "id"\n'))


@pytest.mark.parametrize(
    ("lines", "text"),
    [
        ('file = "nowhere"', "bywire identify --out"),
        ("file = 3", "specify the folder"),
        ('file = "id"\nof = ["motor.L_m"]', "motor.L_m"),
        ('file = "id"\nof = ["low:K"]', "parameter of .measured."),
        ('file = "id"\nof = []', "Select parameters of the bench"),
        ('file = "id"\ntruncate = "yes"', "true or false"),
        ('file = "id"\nonly = ["motor.R_m"]', "'only'"),
        (
            'file = "id"\n[vary]\n"motor.K_e" = "+-5 %"',
            r"motor.K_e varies twice, in \[measured\] and in \[vary\]",
        ),
        (
            'file = "id"\n[[correlation]]\nof = ["motor.K_e", "motor.R_m"]\nvalue = 0.1',
            "twice. Remove one",
        ),
    ],
)
def test_a_section_that_does_not_fit_is_said(study, written, lines, text):
    written(estimate())
    with pytest.raises(InputError, match=text):
        read_study(study(f"[measured]\n{lines}\n"))
