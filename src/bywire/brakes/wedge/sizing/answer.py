"""What is demanded of a drive train of the wedge brake, and how it answers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from bywire.core.typing import Array

PHASES = tuple(0.5 * math.pi * k for k in range(4))
"""angles of the disc [rad] at which a run begins"""


@dataclass(frozen=True)
class Demand:
    """What every design must do.

    Parameters
    ----------
    moment
        Step of the demand [N m].
    t_90
        Time [s] in which the sensor must show 90 % of it, at every friction coefficient.
    t_hold, t_release
        Lengths [s] of the demand and of the release after it.
    mu_B
        Friction coefficients of the pads.
    known
        Whether the moment control knows the coefficient, so that its crossover stays.
    enforced
        Whether the time is enforced by the speed of the reference; else the pads' closing speed
        is that of the given brake.
    whole
        Whether the power of the release counts too, else that of build-up and hold alone.
    phases
        Angles of the disc [rad] at which the runs begin.
    """

    moment: float
    t_90: float
    t_hold: float
    t_release: float
    mu_B: Sequence[float]
    known: bool
    enforced: bool
    whole: bool = False
    phases: Sequence[float] = PHASES


@dataclass(frozen=True)
class Answer:
    """What a design does, per friction coefficient, shape (cases,); the worst of all phases.

    Where on a revolution the disc's run-out meets the stop is chance: several phases are tried.

    Parameters
    ----------
    closing_speed
        Largest speed at which the reference closes the pads [m/s], the same for all cases.
    t_90
        Time to 90 % of the demand [s]; NaN where it is not reached.
    filtered, instantaneous
        Largest power at the drives' input [W], as the rig shows it and as it is, where it counts.
    release
        Largest power during the release [W], as the rig shows it.
    current
        Largest current demand of either motor [A].
    speed
        Largest speed of either motor [rad/s].
    copper, friction
        Energies lost in copper, bearings and screws [J].
    held
        Mean moment in the last fifth of the stop [N m].
    left
        Moment at the end of the release [N m].
    stop
        Largest force on the wedge's end stops [N].
    unsettled
        Substeps of all cases that hit the cap of the contact iteration.
    """

    closing_speed: float
    t_90: Array
    filtered: Array
    instantaneous: Array
    release: Array
    current: Array
    speed: Array
    copper: Array
    friction: Array
    held: Array
    left: Array
    stop: Array
    unsettled: int
