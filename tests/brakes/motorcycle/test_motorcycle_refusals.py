"""Contradictory parameters of the motorcycle brake are rejected with a remedy."""

from __future__ import annotations

from typing import Any

import pytest

from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import ParameterError

AIR = {"fluid.air": "entrained"}
DEAD = {"port.law": "dead-stroke"}


def changed(changes: dict[str, Any]) -> None:
    PARAMETER_SETS.find("dardanelli2010").parameters().replace(changes)


@pytest.mark.parametrize(
    ("taken", "refused", "text"),
    [
        (
            {"ecu.dither.f_dit": 499.0},
            {"ecu.dither.f_dit": 500.0},
            r"ecu\.dither\.f_dit = 500 Hz must be < half the sample rate, 500 Hz",
        ),
        (
            {"ecu.dither.f_dit": 500.0, "ecu.dither.waveform": "off"},
            {"ecu.dither.f_dit": 500.0, "ecu.dither.waveform": "square"},
            "waveform = 'off'",
        ),
        (
            {"fluid.V_air": 4.3e-7, **AIR},
            {"fluid.V_air": 4.4e-7, **AIR},
            r"fluid\.V_air = 4\.4e-07 m\*\*3 must be < .* 4\.38\d*e-07 m\*\*3",
        ),
        (
            {"fluid.V_air": 3.3e-7, **AIR, **DEAD},
            {"fluid.V_air": 4.3e-7, **AIR, **DEAD},
            r"fluid\.V_air = 4\.3e-07 m\*\*3",
        ),
        ({"fluid.V_air": 1e-5}, {"fluid.V_air": 1e-5, **AIR}, "V_air"),
        (
            {"port.x_port": 4.6e-3, **DEAD},
            {"port.x_port": 4.7e-3, **DEAD},
            r"port\.x_port = 4\.7 mm must be < .* = 4\.601 mm",
        ),
        ({"port.x_port": 4.7e-3}, {"port.x_port": 4.7e-3, **DEAD}, "never closes"),
    ],
)
def test_contradiction_is_refused(
    taken: dict[str, Any], refused: dict[str, Any], text: str
) -> None:
    changed(taken)
    with pytest.raises(ParameterError, match=text):
        changed(refused)
