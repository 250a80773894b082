"""Searches for the worst case come to known ones, at ends and between them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import bywire
from bywire.core.errors import InputError
from bywire.studies.limit_state import BudgetSpentError
from bywire.studies.sought_cases import worst_case
from bywire.studies.study_file import read_study

CURRENT = """
[vary]
"motor.R_m" = { kind = "normal", sd = "4 %" }
"motor.K_e" = "+-5 %"
"adc.law" = { values = ["ideal", "quantized"] }
[design]
kind = "worst-case"
cases = 320
[requirements]
peak_current = "<= 18.9 A"
"""


def test_it_is_found_at_ends_and_between_them():
    points = []

    def margins(x):
        points.append(x)
        return 1.0 - x[:, 0] + (x[:, 1] - 0.3) ** 2 + x[:, 2]

    found = worst_case(margins, 3, 1)
    assert (found.state, found.runs) == ("done", sum(map(len, points)))
    every = np.vstack(points)
    assert every.min() == 0.0
    assert every.max() == 1.0
    worst = every[np.argmin(margins(every))]
    np.testing.assert_allclose(worst, [1.0, 0.3, 0.0], atol=0.02)
    assert 0.0 <= found.margin < 1e-3
    assert worst_case(margins, 3, 1) == found
    assert worst_case(lambda x: np.full(len(x), -1e300), 3, 1).margin == -1e12


def test_it_is_not_the_first_end_that_is_bad():
    def margins(x):  # two bad ends, one of them worse
        return 8.0 - np.maximum(x @ [1.0, 1.0, 1.0, -1.0], 1.1 * (1.0 - x) @ [1.0, 1.0, 1.0, -1.0])

    for seed in range(5):
        assert worst_case(margins, 4, seed).margin == pytest.approx(8.0 - 3.3, abs=1e-2)


def test_a_spent_budget_is_told():
    def margins(x):
        if len(calls) == 3:
            raise BudgetSpentError
        calls.append(len(x))
        return x.sum(axis=1)

    calls: list[int] = []
    assert worst_case(margins, 2, 1).state == "budget spent"
    assert sum(calls) == 192


def test_a_study_finds_the_worst_bench(study, tmp_path):
    path, out = study(CURRENT), tmp_path / "out"
    spent = bywire.run_study(path, out, cases=128, workers=1)
    assert any("budget of 128 cases was spent" in note for note in spent.notes)
    found = bywire.resume_study(out, cases=320, workers=1)
    pd.testing.assert_frame_equal(found.cases[:128], spent.cases, check_exact=True)
    corners = CURRENT.replace("worst-case", "corners").replace("cases = 320", "")
    ends = bywire.run_study(study(corners), tmp_path / "corners", workers=1)
    assert found.cases["peak_current"].max() >= ends.cases["peak_current"].max() - 1e-3
    assert found.status == ends.status
    assert found.worst("peak_current").seed == found.plan.bench.seed
    assert any("does not prove" in note for note in found.notes)
    (shown,) = found.tables()["Requirements"]["worst found"]
    assert shown == found.cases["peak_current"].max()  # and no share of what it went through


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("18.9 A", "18.9 A with 99 %", "no probability"),
        ("cases = 320", "cases = 60", ">= 64"),
    ],
)
def test_what_does_not_fit_is_refused(study, old, new, why):
    with pytest.raises(InputError, match=why):
        read_study(study(CURRENT.replace(old, new)))


def test_something_has_to_be_required(study):
    text = CURRENT[: CURRENT.index("[requirements]")]
    bench = 'experiment = "hard-braking"\nparameters = "dardanelli2010"\n'
    with pytest.raises(InputError, match="searches for the worst case of each"):
        read_study(study(text, bench=bench))
