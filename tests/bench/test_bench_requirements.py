"""Requirements: read before the run, evaluated with the sign."""

from __future__ import annotations

import math

import pytest

from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import judge, read_limits
from bywire.core.errors import ParameterError, UnitError, UnknownNameError

KPIS = {"overshoot": "%", "rise_time": "s", "steady_state_error": "Pa", "share_stuck": "1"}


def met(name: str, text: str, value: float) -> bool:
    """Return whether one requirement is met by one value."""
    limits = read_limits({name: text}, KPIS)
    (verdict,) = judge(limits.values(), [Kpi(name, value, KPIS[name], "Of this test.")])
    assert (verdict.kpi, verdict.limit, verdict.unit) == (name, text, KPIS[name])
    return verdict.met


@pytest.mark.parametrize(
    ("text", "value", "expected"),
    [
        ("<= 20 ms", 0.02, True),
        ("< 20 ms", 0.02, False),
        (">= 20 ms", 0.02, True),
        ("> 20 ms", 0.02, False),
        ("<=20ms", 0.0201, False),
        ("  >  0.02 s ", 0.0201, True),
        ("<= 1e-2 s", -1.0, True),
        ("<= 20 ms", math.nan, False),
        (">= 20 ms", math.nan, False),
        ("<= 20 ms", math.inf, False),
    ],
)
def test_limit_with_its_unit(text, value, expected):
    assert met("rise_time", text, value) is expected


def test_percent_is_percent():
    assert met("overshoot", "<= 15 %", 14.9)
    assert not met("overshoot", "<= 15 %", 15.1)
    assert met("overshoot", "<=15%", 15.0)


@pytest.mark.parametrize("text", ["<= 0.2", "<= 20 %"])
def test_share_takes_both_spellings(text):
    assert met("share_stuck", text, 0.2)
    assert not met("share_stuck", text, 0.21)


@pytest.mark.parametrize(
    ("name", "text", "error", "message"),
    [
        ("overshot", "<= 1 %", UnknownNameError, "did you mean 'overshoot'"),
        ("overshoot", "<= 15", UnitError, "a limit in percent such as '<= 15 %'"),
        ("overshoot", "<= 15 bar", UnitError, "a limit in percent"),
        ("overshoot", "<= x %", UnitError, "is not a quantity"),
        ("rise_time", "<= 15 %", UnitError, "cannot be converted to s"),
        ("rise_time", "<= 15", UnitError, "a pure number cannot be converted to s"),
        ("rise_time", "<=", UnitError, "is not a quantity"),
        ("rise_time", "= 1 s", ParameterError, "a limit such as '<= 1.5 s'"),
        ("rise_time", "1 s", ParameterError, "a limit such as"),
        ("rise_time", "== 1 s", ParameterError, "a limit such as"),
        ("rise_time", "<= nan s", UnitError, "is not a quantity"),
        ("rise_time", "<= 1e999 s", ParameterError, "any finite number"),
        ("rise_time", "<= 1 s and >= 0 s", UnitError, "is not a quantity"),
        ("rise_time", 1.0, ParameterError, "a limit such as"),
        ("rise_time", ["<= 1 s"], ParameterError, "a limit such as"),
        ("rise_time", True, ParameterError, "a limit such as"),
        ("rise_time", "", ParameterError, "a limit such as"),
        ("steady_state_error", "<= 1 mm", UnitError, "mm cannot be converted to Pa"),
    ],
)
def test_what_cannot_be_judged_is_refused(name, text, error, message):
    with pytest.raises(error, match=message):
        read_limits({name: text}, KPIS)
