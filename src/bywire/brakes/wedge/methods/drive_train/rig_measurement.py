"""Measurements of two screw drives with a force between them: signals, reading, noise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, Unit
from bywire.identification.trust import Sensor
from bywire.plant.axial_bearing import AngularSpeed

SIGNALS: Mapping[str, str] = {"i_1": "A", "i_2": "A", "q_1": "rad", "q_2": "rad", "y_F": "N"}
"""currents, angles, compressive force: name -> SI unit"""

SIMULATED = ("sigma_i", "sigma_F")
"""options that synthetic measurements alone use"""


class RigOptions(ParameterSet):
    """Which part of the motion counts, and the synthetic noise."""

    cutoff: Frequency
    """low-pass of the speed"""
    slowest: AngularSpeed
    """speed of one motor toward the other that counts as motion"""
    margin: Duration
    """time left out at either end of a motion"""
    window: Duration
    """time over which signals are averaged"""
    sigma_i: Annotated[float, Unit("A", 0.02), Field(ge=0)]
    """noise of the measured currents in synthetic measurements"""
    sigma_F: Annotated[float, Unit("N", 5.0), Field(ge=0)]
    """noise of the force sensor in synthetic measurements"""


def drive_sensors(options: RigOptions) -> dict[str, Sensor]:
    """Return the sensors of a synthetic measurement: currents, angles of the shafts, force."""
    sensors = {name: Sensor(name, options.sigma_i) for name in ("i_1", "i_2")}
    sensors |= {name: Sensor(name) for name in ("q_1", "q_2")}
    return sensors | {"y_F": Sensor("y_F", options.sigma_F)}
