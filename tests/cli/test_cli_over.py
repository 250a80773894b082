"""``bywire run --over``: a table by value, one object, a status for what is required."""

from __future__ import annotations

from command_line import refused

QUICK = ("--set", "options.duration=40ms", "--set", "options.settle=10ms")
OVER = ("--over", "motor.R_m=0.3ohm:0.5ohm:3")


def test_table_object_and_status(bywire):
    outcome = bywire("run", "hard-braking", *QUICK, *OVER)
    assert outcome.status == 0
    assert outcome.out.count("0.4 Ω") >= 1
    found = bywire("run", "hard-braking", *QUICK, *OVER, "--json").object
    assert [case["value"] for case in found["cases"]] == [0.3, 0.4, 0.5]
    limited = ("--set", "requirements.peak_current=<= 1 A")
    failed = bywire("run", "hard-braking", *QUICK, *OVER, *limited)
    assert failed.status == 1
    assert "requirement not met: peak_current <= 1 A: missed at all 3 values" in failed.err


def test_what_is_no_range(bywire):
    refused(bywire("run", "hard-braking", "--over", "motor.R_m"), "NAME=LOW:HIGH:COUNT")
