"""Bus that transmits a torque signal with a delay of several sample times."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import TimeConstant
from bywire.core.signals import Signal

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
Torque = Annotated[float, Signal("N*m", "torque on the bus", 300.0)]
SLOTS = 10
"""maximum delay in sample times"""


class Parameters(ParameterSet):
    """Transmission without loss or jitter, by at most 10 sample times."""

    T_d: TimeConstant
    """delay of the bus"""


class State(NamedTuple):
    """Values on the way; the first one is the newest."""

    s1: Torque
    s2: Torque
    s3: Torque
    s4: Torque
    s5: Torque
    s6: Torque
    s7: Torque
    s8: Torque
    s9: Torque
    s10: Torque


class Input(NamedTuple):
    """Sent value."""

    T_sent: Torque


class Output(NamedTuple):
    """Received value."""

    T_received: Torque


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the bus by one sample.

    The received value is :math:`T_d` old. Between whole sample times, it is interpolated; beyond
    10 sample times, the bus transmits nothing, so the set's owner must refuse such a delay.
    """
    sent = (u.T_sent, *x)
    age = par.T_d / T
    shares = (ops.fmax(1.0 - ops.fabs(age - k), 0.0) for k in range(SLOTS + 1))
    received = sum((share * value for share, value in zip(shares, sent, strict=True)), start=0.0)
    return State(*sent[:SLOTS]), Output(T_received=received)
