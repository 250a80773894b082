"""Units on the command line and in bench files: rejected units and their messages."""

from __future__ import annotations

import pytest
from command_line import refused

RESPONSE = ("frequency-response", "position")


def test_plain_number_is_no_angle_in_a_file_either(bywire, bench):
    text = 'experiment = "moment-pulses"\nparameters = "roberts2003"\n[set]\nwedge.alpha = 0.4\n'
    outcome = bywire("run", bench(text))
    refused(
        outcome, "wedge.alpha = 0.4 has", "a pure number cannot be converted to rad", "'0.35 rad'"
    )


@pytest.mark.parametrize(
    ("frequencies", "amplitudes", "texts"),
    [
        ("0 Hz:100 Hz:10", "0.25 rad", ["'0 Hz:100 Hz:10'", "logarithmic", "above 0 Hz"]),
        ("9 Hz:1 Hz:10", "0.25 rad", ["the first value must be below the second"]),
        ("10 Hz", "0.25 rad, 1", ["amplitudes = '1'", "a pure number cannot be converted to rad"]),
        ("10 Hz", "1 rad, -0.25 rad", ["amplitudes = 1 rad, -0.25 rad is not valid"]),
        ("0 Hz", "1 rad", ["frequencies = 0 Hz is not valid"]),
    ],
)
def test_range_that_cannot_be_measured(bywire, frequencies, amplitudes, texts):
    arguments = ("--frequencies", frequencies, "--amplitudes", amplitudes)
    refused(bywire(*RESPONSE, *arguments), *texts)
