"""Experiments of the wedge brake on the command line: one error line, or key figures."""

from __future__ import annotations

import re

import pytest
from command_line import refused


def test_ramp_downward_gets_one_clear_line(bywire):
    outcome = bywire("run", "moment-ramp", "--set", "options.M_low=300 N*m")
    refused(outcome, "M_low = 300 N*m must be <= M_high = 200 N*m")


@pytest.mark.parametrize("change", ["options.t_hold=0.4ms", "simulation.record=0.6s"])
def test_hold_without_rows_is_no_traceback(bywire, change):
    outcome = bywire("run", "moment-pulses", "--set", change)
    assert outcome.status == 0
    assert "Traceback" not in outcome.err
    assert "not defined" in outcome.out
    assert re.search(r"between t = \S+ s and \S+ s", " ".join(outcome.out.split()))


def test_unmet_demand_is_a_warning(bywire):
    outcome = bywire("run", "moment-pulses", "--set", "flywheel.Omega_0=0 rad/s")
    assert re.search(r"bywire: warning: .* 200 N\*m", outcome.err)
