"""A recording warns if a signal exceeds the range of its sensor."""

from __future__ import annotations

from typing import Any

import pytest

import bywire
from run_once import run_once

OPTIONS = {"duration": "0.3 s", "settle": "0.1 s"}


def warnings(overrides: dict[str, Any]) -> list[str]:
    return run_once(bywire.Bench("hard-braking", "dardanelli2010", overrides, OPTIONS)).warnings


@pytest.mark.parametrize("place", ["master-cylinder", "mid-pipeline"])
def test_pressure_beyond_the_sensor(place: str) -> None:
    here = {"pressure_sensor.place": place}
    assert warnings(here) == []
    found = warnings({**here, "pressure_sensor.p_high": 36e5})
    text = "the pressure leaves the sensor's range, 0 to 36 bar absolute, at t = 0."
    assert sum(warning.startswith(text) for warning in found) == 1


def test_current_beyond_the_sensor() -> None:
    found = warnings({"current_sensor.i_low": -3.0, "current_sensor.i_high": 10.0})
    text = "the current leaves the sensor's range, -3 to 10 A, at t = 0"
    assert sum(warning.startswith(text) for warning in found) == 1


def released(law: str) -> list[str]:
    options = {"duration": "1 s"}
    bench = bywire.Bench("pressure-release", "dardanelli2010", {"port.law": law}, options)
    return run_once(bench).warnings


def test_piston_pulled_against_its_retracted_stop() -> None:
    (text,) = released("makeup")
    assert "retracted stop" in text
    assert "port.law = 'dead-stroke'" in text
    (text,) = released("dead-stroke")
    assert "retracted stop" in text
    assert "port.law" not in text


def test_several_warnings_stay_apart() -> None:
    found = warnings({"pressure_sensor.p_high": 30e5})
    assert len(found) >= 2
    assert all("; " not in text for text in found)
