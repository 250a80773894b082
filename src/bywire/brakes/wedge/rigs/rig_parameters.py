"""What the test rigs add to the brake's own parts: dummy shaft, preload, clamp, force sensor."""

from __future__ import annotations

from typing import Literal

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Force, Inertia, Torque
from bywire.plant import force_sensor


class Parameters(ParameterSet):
    """Fixtures and operating modes of the rigs; the assembled brake does not have them."""

    mode_1: Literal["position", "current"]
    """what the operator commands of motor 1"""
    mode_2: Literal["position", "current"]
    """what the operator commands of motor 2"""
    load: Literal["dummy", "screw"]
    """what hangs on a single motor: a solid dummy shaft, or a preloaded screw"""
    clamp: Literal["open", "closed"]
    """whether a single motor's shaft is clamped"""
    J_dummy: Inertia
    """inertia that the dummy shaft adds"""
    F_0: Force
    """preload between the two halves of a single screw's nut"""
    T_clamp: Torque
    """torque at which the clamp slips"""
    sensor: force_sensor.Parameters


def dummy_inertia(par: Parameters) -> float:
    """Return the inertia [kg m^2] that the rig adds; the screw's own is in the motor's."""
    return par.J_dummy if par.load == "dummy" else 0.0 * par.J_dummy
