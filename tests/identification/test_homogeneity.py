"""Records that do not agree are named, with the parameter that does not fit."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from bywire.core.errors import ParameterError
from bywire.identification import (
    Estimate,
    MisfitWarning,
    Problem,
    Unknown,
    disagreements,
    estimate,
)
from bywire.identification.estimate import Part

N = 300


def joint(masses: dict[str, float], seed: int = 1) -> Estimate:
    """Return mass and friction of records, force over acceleration and speed, in one fit."""
    random = np.random.default_rng(seed)
    a, v = random.normal(size=(2, len(masses), N))
    F = np.array(list(masses.values()))[:, None] * a + 3.0 * v + random.normal(0.0, 0.5, a.shape)
    W = np.column_stack((a.ravel(), v.ravel()))
    unknowns = (Unknown("m", 1.0, scale=2.0, unit="kg"), Unknown("d", 1.0, scale=3.0))
    parts = tuple(Part("F", label, N, "N", 0.5) for label in masses)
    return estimate(Problem(unknowns, lambda x: ((W @ x - F.ravel()) / 0.5, W / 0.5), parts=parts))


def test_the_record_and_the_parameter_that_do_not_fit_are_named() -> None:
    masses = {"run_1": 2.0, "run_2": 2.0, "run_3": 2.4}
    with pytest.warns(MisfitWarning, match=r"records disagree: m is 2\.[34]\d* kg .* in run_3"):
        fit = joint(masses)
    (note,) = (note for note in fit.notes if "records disagree" in note)
    assert "no joint interval" in note


def test_records_that_agree_are_not_warned_of() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", MisfitWarning)
        for seed in range(60):  # false alarms are one in a thousand
            joint({"run_1": 2.0, "run_2": 2.0, "run_3": 2.0}, seed)


def test_estimates_made_one_by_one_are_compared() -> None:
    """Two records of one axis, each fitted alone: their masses lie 6 deviations apart."""
    fits = {
        label: joint({label: mass}, seed)
        for seed, (label, mass) in enumerate({"monday": 2.0, "tuesday": 2.4}.items())
    }
    worst, *_ = disagreements(fits)
    assert worst.name == "m"
    assert {worst.value > worst.others, worst.record == "tuesday"} in ({True}, {False})
    assert worst.apart > 5.0
    assert disagreements({"monday": fits["monday"], "again": joint({"again": 2.0}, 7)}) == ()
    with pytest.raises(ParameterError, match="each record"):
        disagreements({"monday": fits["monday"]})
