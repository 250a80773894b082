"""Distributions: closed forms of their moments, and one clear error for each that is wrong."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bywire.core.errors import InputError
from bywire.core.parameters import Leaf
from bywire.core.quantities import Unit
from bywire.studies.distribution import read_choice, read_distribution
from raising import raises

LEAF = Leaf("motor.R_m", Unit("ohm"), 0.0, 10.0, True, False)
MIDDLES = (np.arange(200_000) + 0.5) / 200_000


def read(entry, nominal=0.4, leaf=LEAF):
    return read_distribution("motor.R_m", entry, leaf, nominal)


@pytest.mark.parametrize(
    ("entry", "mean", "sd"),
    [
        ("+-10 %", 0.4, 0.04 / math.sqrt(3)),
        ("± 0.04 ohm", 0.4, 0.04 / math.sqrt(3)),
        ({"kind": "uniform", "low": "0.2 ohm", "high": "+50 %"}, 0.4, 0.4 / math.sqrt(12)),
        ({"kind": "normal", "sd": "5 %"}, 0.4, 0.02),
        ({"kind": "normal", "mean": "500 mohm", "sd": "20 mohm"}, 0.5, 0.02),
        (
            {"kind": "normal", "sd": "0.1 ohm", "low": "0.4 ohm"},
            0.4 + 0.1 * math.sqrt(2 / math.pi),
            0.1 * math.sqrt(1 - 2 / math.pi),
        ),
        ({"kind": "triangular", "low": "0.1 ohm", "high": "0.7 ohm"}, 0.4, 0.3 / math.sqrt(6)),
        (
            {"kind": "discrete", "values": ["0.3 ohm", "0.5 ohm"], "weights": [1, 3]},
            0.45,
            0.2 * math.sqrt(0.25 * 0.75),
        ),
    ],
)
def test_moments_are_those_of_the_closed_form(entry, mean, sd):
    values = read(entry).quantile(MIDDLES)
    assert values.mean() == pytest.approx(mean, rel=1e-4)
    assert values.std() == pytest.approx(sd, rel=1e-3)


def test_log_normal_has_its_median_and_coefficient():
    wide = Leaf("x", Unit("ohm"), 0.0, math.inf, True, False)
    values = read({"kind": "log-normal", "sd": "30 %"}, leaf=wide).quantile(MIDDLES)
    assert np.median(values) == pytest.approx(0.4, rel=1e-4)
    assert np.log(values).std() == pytest.approx(math.sqrt(math.log(1.09)), rel=1e-3)


def test_a_normal_tolerance_ends_where_it_says():
    made = read({"kind": "tolerance", "tolerance": "10 %", "shape": "normal"})
    assert (made.low, made.high) == pytest.approx((0.36, 0.44))
    assert made.quantile(MIDDLES).std() == pytest.approx(0.04 / 3, rel=0.02)


@pytest.mark.parametrize(
    ("entry", "texts"),
    [
        ({"kind": "normal", "sd": "50 %"}, ["> 0 ohm", "probability of 0.023", "'low'"]),
        (
            {"kind": "uniform", "low": "-1 ohm", "high": "1 ohm"},
            ["leaves the valid range", "Choose 'low' and 'high' within"],
        ),
        (
            {"kind": "triangular", "low": "-1 ohm", "high": "1 ohm"},
            ["leaves the valid range", "'low', 'mode' and 'high'"],
        ),
        ({"kind": "log-normal", "sd": "900 %"}, ["leaves the valid range", "smaller 'sd'"]),
        ("+-200 %", ["leaves the valid range", "narrower tolerance"]),
        (
            {"kind": "discrete", "values": ["0 ohm", "1 ohm"]},
            ["leaves the valid range", "Remove 0 ohm"],
        ),
        ("+-100 %", ["Its bound at 0 ohm is not valid", "> 0 ohm and <= 10 ohm"]),
        ({"kind": "tolerance", "tolerance": "100 %", "shape": "normal"}, ["bound at 0 ohm"]),
        ({"kind": "uniform", "low": "0 ohm", "high": "1 ohm"}, ["bound at 0 ohm"]),
        ({"kind": "triangular", "low": "-100 %", "high": "1 ohm"}, ["bound at 0 ohm"]),
        ({"kind": "uniform", "low": "1 ohm", "high": "1 ohm"}, ["must be below"]),
        ({"kind": "discrete", "values": [0.3, 0.4]}, ["motor.R_m.values = 0.3 has"]),
        ("+- 1e-18 %", ["too narrow for floating-point numbers"]),
        ({"kind": "normal", "sd": "1e-18 %"}, ["too narrow for floating-point numbers"]),
        ({"kind": "log-normal", "sd": "1e-18 %"}, ["too narrow for floating-point numbers"]),
        ({"kind": "discrete", "values": ["0.3 ohm"]}, ["only one value, 0.3 ohm"]),
        (
            {"kind": "discrete", "values": ["0.3 ohm", "1 ohm", "300 mohm"]},
            ["lists the value 0.3 ohm twice", "weights"],
        ),
        ({"sd": "5 %"}, ["{ sd = '5 %' } has no kind", "'normal' or 'log-normal'"]),
        ({"kind": ["normal"], "sd": "5 %"}, ["unknown kind", "'normal'"]),
        ({"kind": "normal", "sd": True}, ["sd = true must be one number"]),
        ({"kind": "uniform", "low": "0.5 ohm", "high": "0.4 ohm"}, ["must be below"]),
        ({"kind": "uniform", "low": "0.5 ohm"}, ["needs the key 'high'"]),
        ({"kind": "uniform", "low": 0.3, "high": "0.4 ohm"}, ["low = 0.3 has", "ohm"]),
        ({"kind": "normal", "sd": "5 V"}, ["wrong unit"]),
        ({"kind": "normal", "sd": "0 %"}, ["width > 0"]),
        ({"kind": "normal", "sigma": "5 %"}, ["'sigma'", "sd"]),
        ({"kind": "norml", "sd": "5 %"}, ["'norml'", "'normal'"]),
        ({"kind": "triangular", "low": "0.5 ohm", "high": "0.7 ohm"}, ["increasing order"]),
        ({"kind": "discrete", "values": ["0.3 ohm"], "weights": [1, 2]}, ["1 numbers > 0"]),
        (
            {"kind": "discrete", "values": ["0.3 ohm", "1 ohm"], "weights": [1, "3"]},
            ["weights = [1, '3']", "2 numbers > 0"],
        ),
        ({"kind": "normal", "sd": "1 %", "low": "1.5 ohm"}, ["too little for sampling"]),
        ({"kind": "discrete", "values": []}, ["values = [...]"]),
        ({"kind": "tolerance", "tolerance": "5 %", "shape": "cauchy"}, ["'cauchy'", "normal"]),
        ("5 %", ["Write a tolerance"]),
        (0.4, ["Write a tolerance"]),
    ],
)
def test_what_is_wrong_is_said(entry, texts):
    with pytest.raises(InputError) as refused:
        read(entry)
    for text in ("[vary] motor.R_m", *texts):
        assert text in str(refused.value)


def test_ends_reach_a_limit_that_is_admissible_though_rounding_misses_it():
    made = read("+-0.2 ohm", nominal=0.1, leaf=Leaf("x", Unit("ohm"), -1.0, 0.3, False, False))
    assert 0.1 + 0.2 > 0.3
    assert (made.high, made.levels(2)[-1]) == (0.3, 0.3)


@pytest.mark.parametrize("low", ["0 ohm", "-100 %"])
def test_what_is_truncated_at_a_limit_that_is_not_admissible_has_levels_within(low):
    made = read({"kind": "normal", "sd": "50 %", "low": low, "high": "10 ohm"})
    first, last = made.levels(2)
    assert 0.0 < first < 0.01
    assert (made.low, made.high, last) == (-math.inf, 10.0, 10.0)


def test_a_share_of_zero_needs_an_amount():
    with raises(InputError, name="motor.R_m", valid="a width > 0"):
        read("+-5 %", nominal=0.0)


def test_choices_are_drawn_by_their_weights():
    made = read_choice("law", {"values": ["a", "b"], "weights": [3, 1]}, ("a", "b", "c"))
    values = made.quantile(MIDDLES)
    assert np.mean(values == "a") == pytest.approx(0.75)
    with pytest.raises(InputError, match="'d'"):
        read_choice("law", {"values": ["d"]}, ("a", "b", "c"))


def test_widths_of_a_temperature_are_differences():
    leaf = Leaf("heat.T_1", Unit("K"), 0.0, math.inf, True, True)
    for entry in ("+-10 K", {"kind": "tolerance", "tolerance": "10 K"}):
        made = read(entry, 623.15, leaf)
        assert (made.low, made.high) == pytest.approx((613.15, 633.15))
        assert "350 degC +- 10 K" in made.text
    with pytest.raises(
        InputError, match="degC cannot be converted to a temperature difference in K"
    ):
        read("+-10 degC", 623.15, leaf)


@pytest.mark.parametrize(
    "entry",
    [
        "+-5 %",
        {"kind": "normal", "sd": "5 %"},
        {"kind": "uniform", "low": "-5 %", "high": "60 degC"},
    ],
)
def test_a_temperature_has_no_shares(entry):
    """5 % of 20 degC would be 15 K."""
    leaf = Leaf("motor_heat.T_a", Unit("K"), 200.0, 400.0, False, False)
    with pytest.raises(InputError, match="different zero points"):
        read_distribution("motor_heat.T_a", entry, leaf, 293.15)
    law = read_distribution("motor_heat.T_a", "+-10 K", leaf, 293.15)
    assert (law.low, law.high) == pytest.approx((283.15, 303.15))
