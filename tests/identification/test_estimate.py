"""An estimate by hand: intervals, bounds, what means nothing, what goes together, and its texts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bywire.identification.estimate import Estimate, Kept, Part, as_object
from bywire.identification.unknown import Unknown

# Deviations 0.3, 2 and 0.1; b and c go together by -0.95, a and c by 0.5.
COVARIANCE = np.array([[0.09, 0.0, 0.015], [0.0, 4.0, -0.19], [0.015, -0.19, 0.01]])
ESTIMATE = Estimate(
    unknowns=(
        Unknown("motor.R_m", 1.0, low=0.0, high=50.0, scale=1.0, unit="ohm"),
        Unknown("offset.i", 0.0, scale=3.0, unit="A"),
        Unknown("motor.K_e", 0.5, low=0.1, scale=0.5, unit="N*m/A", trial="slow"),
    ),
    values=np.array([2.5, -3.0, 0.8]),
    covariance=COVARIANCE,
    singular_values=np.array([7.0, 3.0, 0.5]),
    residuals=np.array([1.0, -1.0, 3.0, 0.0]),
    freedom=10.0,
    colored=True,
    kept=(Kept(Unknown("seal.c", 0.2, unit="N*s/m"), "1e9 of its size"),),
    notes=("first",),
)
T = 2.2281388519649385  # Student's t of 97.5 % and 10 degrees of freedom (tables: 2.228)


def near(bound: float, value: float, deviation: float, scale: float = 1.0) -> dict[str, float]:
    """Return where one unknown between some bound and infinity lies at a bound."""
    unknown = Unknown("x", max(bound, 0.0), low=bound, scale=scale)
    return replace(
        ESTIMATE,
        unknowns=(unknown,),
        values=np.array([value]),
        covariance=np.array([[deviation**2]]),
    ).at_bounds()


def test_deviations_and_correlation() -> None:
    assert ESTIMATE.deviations == pytest.approx([0.3, 2.0, 0.1])
    expected = [[1.0, 0.0, 0.5], [0.0, 1.0, -0.95], [0.5, -0.95, 1.0]]
    assert ESTIMATE.correlation == pytest.approx(np.array(expected))
    worst = ("slow:motor.K_e", "offset.i", pytest.approx(-0.95))
    other = ("slow:motor.K_e", "motor.R_m", pytest.approx(0.5))
    assert ESTIMATE.correlated() == [worst]
    assert ESTIMATE.correlated(0.4) == [worst, other]
    assert ESTIMATE.correlated(0.96) == []


def test_intervals_are_student_s() -> None:
    reach = T * np.array([0.3, 2.0, 0.1])
    ends = np.column_stack((ESTIMATE.values - reach, ESTIMATE.values + reach))
    assert ESTIMATE.intervals() == pytest.approx(ends, rel=1e-9)
    narrow = ESTIMATE.intervals(0.5)  # tables: 0.700
    assert narrow[:, 1] - ESTIMATE.values == pytest.approx(0.69981 * ESTIMATE.deviations, rel=1e-4)
    few = replace(ESTIMATE, freedom=0.2).intervals()  # as if there was one: tables: 12.706
    assert few[0, 1] - 2.5 == pytest.approx(12.7062 * 0.3, rel=1e-5)


def test_at_a_bound_is_a_twentieth_of_a_deviation_or_a_millionth_of_the_scale() -> None:
    assert near(0.0, 0.049, 1.0) == {"x": 0.0}
    assert near(0.0, 0.051, 1.0) == {}
    assert near(2.0, 2.049, 1.0) == {"x": 2.0}
    assert near(-2.0, 2.0, 1.0) == {}
    assert near(0.0, 0.9e-6, 1e-9) == {"x": 0.0}
    assert near(0.0, 1.1e-6, 1e-9) == {}
    assert near(0.0, 2.9e-6, 1e-9, scale=3.0) == {"x": 0.0}
    assert near(-math.inf, -1e300, 1.0) == {}


def test_what_means_nothing() -> None:
    """An interval that reaches beyond zero, or a bound; the same with either sign."""
    assert ESTIMATE.vague() == {"offset.i": "is -3 +- 4.5 A, so it may be zero"}
    at_end = replace(ESTIMATE, values=np.array([50.0, -4.5, 0.8]))
    assert at_end.vague() == {"motor.R_m": "is at its bound, 50 ohm"}


def test_values_by_label_and_what_a_bench_takes() -> None:
    assert ESTIMATE["slow:motor.K_e"] == 0.8
    assert ESTIMATE.parameters() == {"motor.R_m": 2.5}
    kinds = ("initial.omega", "stimulus.v", "offset.i")
    others = replace(ESTIMATE, unknowns=tuple(Unknown(kind, 0.0) for kind in kinds))
    assert others.parameters() == {}


def test_rms_and_notes() -> None:
    assert ESTIMATE.rms == pytest.approx(math.sqrt(11.0 / 4.0))
    assert ESTIMATE.noted(("second", "third")).notes == ("first", "second", "third")


def test_table() -> None:
    assert str(ESTIMATE).splitlines() == [
        "motor.R_m                 2.5 +- 0.67       ohm",
        "offset.i                   -3 +- 4.5        A",
        "slow:motor.K_e            0.8 +- 0.22       N*m/A",
        "seal.c           not determined by the data, kept at 0.2 N*s/m: 1e9 of its size",
        "first",
    ]


def test_object() -> None:
    shown = as_object(ESTIMATE)
    assert shown["parameters"]["offset.i"] == {  # type: ignore[index]
        "value": -3.0,
        "unit": "A",
        "standard_deviation": pytest.approx(2.0),
        "interval_95": pytest.approx([-3.0 - 2.0 * T, -3.0 + 2.0 * T]),
    }
    assert shown["not_identifiable"] == {
        "seal.c": {"kept": 0.2, "unit": "N*s/m", "reason": "1e9 of its size"}
    }
    assert shown["correlation"]["names"] == list(ESTIMATE.names)  # type: ignore[index]
    assert shown["singular_values"] == [7.0, 3.0, 0.5]
    assert shown["residual_rms"] == pytest.approx(ESTIMATE.rms)
    assert (shown["degrees_of_freedom"], shown["colored_residuals"]) == (10.0, True)
    assert shown["notes"] == ["first"]


@pytest.mark.parametrize("read", [as_object, str, Estimate.at_bounds, Estimate.parameters])
def test_unknowns_and_values_that_do_not_belong_together_are_not_cut(read: object) -> None:
    fewer = replace(ESTIMATE, unknowns=ESTIMATE.unknowns[:2])
    with pytest.raises(ValueError, match=r"shorter|longer"):
        read(fewer)  # type: ignore[operator]


def test_what_is_left_of_each_part_is_in_its_unit() -> None:
    parts = (Part("p", "", 3, "Pa", noise=2.0), Part("i", "slow", 1, "A"))
    first, second = replace(ESTIMATE, parts=parts).leftovers()
    assert (first.residuals.tolist(), first.unit) == ([2.0, -2.0, 6.0], "Pa")
    assert (second.residuals.tolist(), second.label) == ([0.0], "slow:i")
