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


def test_a_requirement_that_every_value_meets_is_no_remark(bywire):
    met = bywire(
        "run", "hard-braking", *QUICK, *OVER, "--set", "requirements.peak_current=<= 1000 A"
    )
    assert met.status == 0
    assert "peak_current <= 1000 A: met at all 3 values of motor.R_m" in met.out
    assert "requirement" not in met.err


def test_values_that_miss_a_requirement_and_values_too_close_to_tell_are_apart(bywire):
    found = bywire("run", "hard-braking", *QUICK, *OVER, "--json").object
    peaks = [case["kpis"]["peak_current"] for case in found["cases"]]
    limit = f"requirements.peak_current=<= {peaks[1]['value']:.12g} A"
    judged = bywire("run", "hard-braking", *QUICK, *OVER, "--set", limit)
    assert judged.status == 1
    (remark,) = [line for line in judged.err.splitlines() if "requirement" in line]
    assert "requirement not met: " in remark
    assert ": missed at motor.R_m = 0.3 Ω, worst " in remark
    assert "; undecided at motor.R_m = 0.4 Ω, worst " in remark
    alone = ("--over", "motor.R_m=0.4 ohm, 0.5 ohm")
    undecided = bywire("run", "hard-braking", *QUICK, *alone, "--set", limit)
    assert undecided.status == 1
    assert "requirement undecided: peak_current <= " in undecided.err
    assert "not met" not in undecided.err
