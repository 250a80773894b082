"""Where rare failures lie: single values have shares, and importance whatever their order."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from bywire.studies.sought_cases import importance_of
from bywire.studies.statistics import UNKNOWN, FailureProbability, counted
from bywire.studies.study_file import read_study

STUDY = """
[vary]
"motor.R_m" = "+-5 %"
"supply.V_bat" = {{ kind = "discrete", values = {values}, weights = {weights} }}
[design]
kind = "subset-simulation"
[requirements]
peak_current = "<= 25 A with 99 %"
"""


def failing(scores) -> FailureProbability:
    estimate = counted(10, 1000, 0.95)
    return FailureProbability(
        "done",
        estimate,
        lambda _: UNKNOWN,
        (),
        1000,
        center=np.asarray(scores).mean(axis=0),
        failing=np.asarray(scores),
    )


def test_single_values_have_shares_in_whatever_order_they_are_listed(study):
    """Three quarters fail at 11 V, which one case in ten has; none at 13 V."""
    values, weights = ["11 V", "12 V", "13 V"], [1, 5, 4]
    score = {"11 V": 0.05, "12 V": 0.3, "13 V": 0.8}  # places within each, in the first order
    told = []
    for order in ([0, 1, 2], [1, 2, 0], [2, 1, 0]):
        listed, shares = [values[k] for k in order], [weights[k] for k in order]
        plan = read_study(study(STUDY.format(values=listed, weights=shares)))
        ends = dict(zip(listed, np.cumsum(shares) / 10.0, strict=True))
        place = {v: ends[v] - 0.05 for v in score}
        u = [place["11 V"]] * 6 + [place["12 V"]] * 2
        scores = np.column_stack([np.linspace(-0.5, 0.7, 8), stats.norm.ppf(u)])
        found = {i.quantity: i for i in importance_of(plan, failing(scores))}
        assert found["supply.V_bat"].shares == {11.0: 0.75, 12.0: 0.25, 13.0: 0.0}
        assert math.isnan(found["supply.V_bat"].score)
        told.append(found["supply.V_bat"].factor)
    entropy = 0.75 * math.log(0.75 / 0.1) + 0.25 * math.log(0.25 / 0.5)
    assert told == pytest.approx([2.0 * entropy / (2.0 * entropy + 0.01)] * 3)


def test_many_single_values_count_as_the_normal_score_they_stand_for(study):
    """Both quantities are moved by 1.5 standard deviations: each makes half of the distance."""
    values = [f"{11.0 + 0.01 * k:.2f} V" for k in range(400)]
    plan = read_study(study(STUDY.format(values=values, weights=[1] * 400)))
    u = (np.arange(200_000) + 0.5) / 200_000
    moved = stats.norm.ppf(u) + 1.5
    rest = np.random.default_rng(1).permutation(moved)
    first, second = importance_of(plan, failing(np.column_stack([rest, moved])))
    assert (first.factor, second.factor) == pytest.approx((0.5, 0.5), abs=0.02)
