"""What is said of two studies that differ: each difference once, in the words of the file."""

from __future__ import annotations

import pytest

from bywire.cases.identity import differing

BEFORE = {"varied": {"motor.R_m": ["0.4 ohm +- 5 %", ["ecu.R"], [0.38, 0.42]]}, "seed": 1}


@pytest.mark.parametrize(
    ("now", "said"),
    [
        (
            {"motor.R_m": ["0.4 ohm +- 6 %", ["ecu.R"], [0.37, 0.43]]},
            "varied motor.R_m: 0.4 ohm +- 5 %, now 0.4 ohm +- 6 %",
        ),
        (
            {"motor.R_m": ["0.4 ohm +- 5 %", ["ecu.R"], [0.37, 0.43]]},
            "varied motor.R_m quantiles: 0.38, 0.42, now 0.37, 0.43",
        ),
        (
            {"motor.R_m": ["0.4 ohm +- 6 %", [], [0.37, 0.43]]},
            "varied motor.R_m: 0.4 ohm +- 5 %, now 0.4 ohm +- 6 %; "
            "varied motor.R_m together: ecu.R, now nothing",
        ),
        (
            {"motor.K_e": ["+- 1 %", ["ecu.K_e"], [1.0, 2.0]]},
            "varied motor.K_e: nothing, now +- 1 %; varied motor.R_m: 0.4 ohm +- 5 %, now nothing",
        ),
    ],
)
def test_what_follows_from_another_difference_is_not_said(now, said):
    assert differing(BEFORE, {**BEFORE, "varied": now}) == said
