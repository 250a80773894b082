"""Limits as formulas of the test speed: values, units, and what is not arithmetic."""

import math

import pytest

from bywire.core.errors import InputError, UnitError
from bywire.procedures.formula import compiled, read_speed_limit

FORMULA = "<= (0.1*V + V^2/115) m, V in km/h"


@pytest.mark.parametrize(
    ("v", "text", "bound"),
    [
        (60.0 / 3.6, FORMULA, 6.0 + 3600.0 / 115.0),
        (100.0 / 3.6, FORMULA, 10.0 + 10000.0 / 115.0),
        (20.0, "<= (20 + 3*V) cm, V in m/s", 0.8),
        (20.0, "<= (-(1 - V)*2) m, V in m/s", 38.0),
        (20.0, "<= 41 m", 41.0),
    ],
)
def test_a_limit_has_its_value_at_the_test_speed(v, text, bound):
    limit = read_speed_limit("stopping_distance", text, "m", "limits").at(v)
    assert limit.bound == pytest.approx(bound, rel=1e-14)
    assert limit.is_met(bound - 1e-9)
    assert not limit.is_met(bound + 1e-9)


def test_a_limit_relative_to_an_earlier_stop_is_a_fraction_of_its_value():
    limit = read_speed_limit("mfdd", ">= 60 % of cold stop", "m/s**2", "limits")
    assert (limit.of, limit.share) == ("cold stop", 0.6)
    beside = limit.beside(8.0)
    assert beside.bound == pytest.approx(4.8)
    assert str(beside) == "mfdd >= 4.8 m/s^2 (60 % of cold stop)"


@pytest.mark.parametrize(
    ("text", "kind", "says"),
    [
        ("<= (0.1*V) s, V in km/h", UnitError, "s cannot be converted to m"),
        ("<= (0.1*V) m, V in kg", UnitError, "speed V"),
        ("<= (0.1*V) m", InputError, "V in km/h"),
        ("<= 0.1*V + V^2/115 m", InputError, "in parentheses"),
        ("(0.1*V) m, V in km/h", InputError, "a limit such as"),
        ("<= (0.1 V) m, V in km/h", InputError, "numbers and V"),
        ("<= (V.real) m, V in km/h", InputError, "numbers and V"),
        ("<= (abs(V)) m, V in km/h", InputError, "numbers and V"),
        ("<= (__import__('os')) m, V in km/h", InputError, "numbers and V"),
        ("<= (True*V) m, V in km/h", InputError, "numbers and V"),
        ("<= (V**2) m, V in km/h", InputError, "numbers and V"),
        ("<= (9^9^9) m, V in km/h", InputError, "numbers and V"),
        (f"<= ({'(' * 120}V{')' * 120}) m, V in km/h", InputError, "numbers and V"),
        (41, InputError, "a limit such as"),
    ],
)
def test_other_texts_are_rejected(text, kind, says):
    with pytest.raises(kind, match="limits stopping_distance") as caught:
        read_speed_limit("stopping_distance", text, "m", "limits").at(20.0)
    assert says in str(caught.value)


def test_a_formula_without_a_finite_value_is_rejected_at_the_speed():
    limit = read_speed_limit("stopping_distance", "<= (1/(V - 10)) m, V in m/s", "m", "limits")
    assert limit.at(20.0).bound == pytest.approx(0.1)
    with pytest.raises(InputError, match="no finite value at V = 10 m/s"):
        limit.at(10.0)
    assert math.isnan(compiled("(-V)^0.5", "limit")(2.0))
