"""Relay valve of an air brake, whose output pressure follows the control pressure."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Duration, Factor, Pressure, Unit
from bywire.core.signals import Signal

Overlap = Annotated[float, Unit("1", 0.05), Field(ge=0, lt=0.9, allow_inf_nan=False)]
CrackPressure = Annotated[float, Unit("Pa", 1e4), Field(ge=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Spool between two seats, which are air orifices.

    A spool within the overlap closes both seats exactly. The pressure then stays constant.
    ``law``: with ``"lag"``, the spool follows the pressure difference with a first-order lag. With
    ``"mechanical"``, its piston also has an area ratio, dry friction, and a preloaded inlet seat,
    which give the valve hysteresis and a crack pressure.
    """

    law: Literal["lag", "mechanical"]
    """forces on the spool"""
    tau: Duration
    """time constant of the spool"""
    overlap: Overlap
    """travel of the spool on either side that opens no seat, as a fraction of its full travel"""
    p_full: Pressure
    """pressure difference at which the spool is fully open without preload and friction"""
    a: Factor
    """area at the control pressure per area at the output pressure (law "mechanical")"""
    p_crack: CrackPressure
    """preload of the inlet seat, as a pressure at the output area (law "mechanical")"""
    p_fr: CrackPressure
    """dry friction of the piston, as a pressure at the output area (law "mechanical")"""

    @model_validator(mode="after")
    def _preload_has_a_travel(self) -> Parameters:
        if self.law == "mechanical" and self.overlap == 0.0:
            reason = "the preload of the inlet seat builds up over the overlap"
            raise RuleError("overlap", "0", "> 0 (law 'mechanical')", reason)
        return self


FAULTS = (
    ParameterFault("sluggish", "frozen or dirty spool", ("tau",), 5.0),
    ParameterFault(
        "sticking",
        "dry seals (value: friction)",
        replaced="p_fr",
        value=0.3e5,
        with_it={"law": "mechanical"},
    ),
)


class State(NamedTuple):
    """Travel of the spool."""

    s: Annotated[float, Signal("1", "travel of the spool", 0.5)]


class Input(NamedTuple):
    """Control pressure and output pressure."""

    p_control: Annotated[float, Signal("Pa", "control pressure", 4e5)]
    p_out: Annotated[float, Signal("Pa", "output pressure", 4e5)]


class Output(NamedTuple):
    """Openings of the two seats. At most one is positive."""

    feed: Annotated[float, Signal("1", "opening of the feed seat", 1.0)]
    exhaust: Annotated[float, Signal("1", "opening of the exhaust seat", 1.0)]


def mass(par: Parameters) -> Annotated[float, Signal("s", "time constant", 1e-2)]:
    """Return the factor of the spool's derivative, its time constant."""
    return par.tau


def balance(
    x: State, u: Input, par: Parameters
) -> Annotated[float, Signal("1", "distance to the new travel", 0.5)]:
    r"""Return the distance of the spool from its new travel.

    .. math:: \tau \dot s = \mathrm{sat}\left(\frac{p_c - p}{p_{full}}\right) - s

    With law "mechanical", the piston moves with the excess of its force over the friction:

    .. math::
        \tau \dot s = f - \mathrm{sat}_{\varphi}(f), \quad
        f = \mathrm{sat}_{1 + \varphi}\left(\frac{a p_c - p}{p_{full}}
        - \frac{p_{crack}}{p_{full}} \mathrm{sat}_0^1 \frac{s}{s_0}\right) - s, \quad
        \varphi = \frac{p_{fr}}{p_{full}}

    Notes
    -----
    The piston has no mass, so its dry friction needs no state of its own: with damping, the
    set-valued law has this solution. Friction holds the spool exactly. With increasing pressure
    difference, the feed seat opens at :math:`a p_c - p = p_{crack} + s_0 p_{full} + p_{fr}`, and
    with decreasing difference it closes at :math:`p_{crack} + s_0 p_{full} - p_{fr}`. The exhaust
    seat opens at :math:`-(s_0 p_{full} + p_{fr})` and closes at :math:`-(s_0 p_{full} - p_{fr})`.
    The right-hand side has kinks where the spool starts to move, at full travel, and at both ends
    of the overlap.
    """
    if par.law == "lag":
        return ops.clip((u.p_control - u.p_out) / par.p_full, -1.0, 1.0) - x.s
    stick = par.p_fr / par.p_full
    seat = par.p_crack * ops.clip(x.s / par.overlap, 0.0, 1.0)
    drive = (par.a * u.p_control - u.p_out - seat) / par.p_full
    f = ops.clip(drive, -1.0 - stick, 1.0 + stick) - x.s
    return f - ops.clip(f, -stick, stick)


def output(x: State, par: Parameters) -> Output:
    """Return the openings, with kinks where the spool leaves the overlap and at full travel."""
    span = 1.0 - par.overlap
    return Output(
        feed=ops.clip((x.s - par.overlap) / span, 0.0, 1.0),
        exhaust=ops.clip((-x.s - par.overlap) / span, 0.0, 1.0),
    )
