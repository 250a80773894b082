"""Relay valve of an air brake, whose output pressure follows the control pressure."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Pressure, Unit
from bywire.core.signals import Signal

Overlap = Annotated[float, Unit("1", 0.05), Field(ge=0, lt=0.9, allow_inf_nan=False)]
Opening = Annotated[float, Signal("1", "opened fraction", 1.0)]


class Parameters(ParameterSet):
    """Spool with a first-order lag. Its seats are air orifices.

    A spool within the overlap closes both seats exactly. The pressure then stays constant.
    """

    tau: Duration
    """time constant of the spool"""
    overlap: Overlap
    """travel of the spool on either side that opens no seat, as a fraction of its full travel"""
    p_full: Pressure
    """pressure difference at which the spool is fully open"""


FAULTS = (ParameterFault("sluggish", "frozen or dirty spool", ("tau",), 5.0),)


class State(NamedTuple):
    """Travel of the spool."""

    s: Annotated[float, Signal("1", "travel of the spool", 0.5)]


class Input(NamedTuple):
    """Control pressure and output pressure."""

    p_control: Annotated[float, Signal("Pa", "control pressure", 4e5)]
    p_out: Annotated[float, Signal("Pa", "output pressure", 4e5)]


class Output(NamedTuple):
    """Openings of the two seats. At most one is positive."""

    feed: Opening
    exhaust: Opening


def mass(par: Parameters) -> Annotated[float, Signal("s", "time constant", 1e-2)]:
    """Return the factor of the spool's derivative, its time constant."""
    return par.tau


def balance(
    x: State, u: Input, par: Parameters
) -> Annotated[float, Signal("1", "distance to the new travel", 0.5)]:
    r"""Return the distance of the spool from its new travel.

    .. math:: \tau \dot s = \mathrm{sat}\left(\frac{p_c - p}{p_{full}}\right) - s
    """
    return ops.clip((u.p_control - u.p_out) / par.p_full, -1.0, 1.0) - x.s


def output(x: State, par: Parameters) -> Output:
    """Return the openings, with kinks where the spool leaves the overlap and at full travel."""
    span = 1.0 - par.overlap
    return Output(
        feed=ops.clip((x.s - par.overlap) / span, 0.0, 1.0),
        exhaust=ops.clip((-x.s - par.overlap) / span, 0.0, 1.0),
    )
