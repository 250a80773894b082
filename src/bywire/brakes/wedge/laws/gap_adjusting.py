"""Law of the wedge brake's adjuster, which corrects the moment control's estimate of the gap.

The moment control estimates the travel from the parking position to contact. The adjuster subtracts
its commanded teeth from this travel, so the next application does not creep through a gap that no
longer exists.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.brakes.wedge.laws import moment_control
from bywire.control import wear_adjuster
from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.quantities import Duration, Temperature, Unit
from bywire.core.signals import Signal

Slope = Annotated[float, Unit("m/rad", 1e-4), Field(gt=0, allow_inf_nan=False)]

NEEDS = {"adjuster.law": "screw"}
FAULTS = tuple(
    ParameterFault(name, f"adjuster {what}", with_it={"fault": name}, needs=NEEDS)
    for name, what in (
        ("stuck", "does not turn, but keeps counting"),
        ("one-way", "does not return clearance, but keeps counting"),
        ("slips", "slips on every second tooth, but keeps counting"),
        ("over-adjusts", "turns one tooth too many"),
        ("blind-to-heat", "mistakes a hot disc for a cold one"),
    )
)


class Parameters(wear_adjuster.Parameters):
    """Law, sample time and assumptions of the adjuster."""

    T_adjust: Duration
    """sample time, long enough to turn all due teeth"""
    gap_slope_hat: Slope
    """assumed clearance per motor angle"""
    T_disc_hat: Temperature
    """assumed disc temperature"""


class State(NamedTuple):
    """Memory of the adjuster."""

    applied: Annotated[float, Signal("1", "brake has been applied since it was last parked")]
    wide: Annotated[
        float, Signal("1", "consecutive applications with too large a gap; < 0: too small")
    ]
    teeth: Annotated[float, Signal("1", "teeth turned, as counted by the adjuster", 3.0)]


class Input(NamedTuple):
    """Contact position, mode and demand of the moment control."""

    theta_c: Annotated[float, Signal("rad", "contact position, estimated", 1.7)]
    mode: Annotated[float, Signal("1", "mode of the moment control", 3.0)]
    braking: Annotated[float, Signal("1", "braking is demanded")]


class Output(NamedTuple):
    """Commanded and turned teeth, mode, and resulting clearance of the cold brake."""

    teeth: wear_adjuster.Teeth
    turned: wear_adjuster.Teeth
    mode: Annotated[float, Signal("1", "adjuster: 0 waits, 1 brake applied, 2 turns", 2.0)]
    gap: Annotated[float, Signal("m", "clearance estimated by the adjuster", 2e-4)]


def output(x: State, u: Input, par: Parameters) -> tuple[State, Output]:
    """Advance the adjuster by one sample."""
    seen = wear_adjuster.Input(
        gap=par.gap_slope_hat * u.theta_c,
        T=par.T_disc_hat,
        touching=ops.where((u.mode - moment_control.MOMENT) ** 2 < 0.25, 1.0, 0.0),
        parked=ops.where(u.mode < 0.5, 1.0, 0.0),
        wanted=u.braking,
    )
    state, out = wear_adjuster.output(wear_adjuster.State(*x), seen, par)
    gap = wear_adjuster.cold_gap(seen, par) - par.tooth * out.teeth
    return State(*state), Output(out.teeth, out.turned, out.mode, gap)


def contact(
    theta_c: Annotated[float, Signal("rad", "contact position, estimated", 1.7)],
    rate: Annotated[float, Signal("1/s", "intended teeth per second", 50.0)],
    T: Annotated[float, Signal("s", "sample time of the moment control", 1e-3)],
    par: Parameters,
) -> Annotated[float, Signal("rad", "contact position, estimated", 1.7)]:
    """Return the estimated contact position after one sample of turning."""
    return theta_c - par.tooth / par.gap_slope_hat * rate * T
