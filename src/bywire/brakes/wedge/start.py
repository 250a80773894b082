"""States at rest of the wedge brake: parked, preloaded, without current."""

from __future__ import annotations

from bywire.brakes.wedge.control import Memory
from bywire.brakes.wedge.elements import wedge, wedge_caliper
from bywire.brakes.wedge.laws import screw_offset
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core import ops
from bywire.core.signals import zeros
from bywire.plant import roller_screw

Par = WedgeParameters


def travel_for(F_N: float, par: Par) -> float:
    """Return the wedge travel [m] at a normal force [N], run-out left out."""
    return (par.caliper.clearance + wedge_caliper.travel(F_N, par.caliper)) / wedge.slope(par.wedge)


def force_for(moment: float, par: Par) -> float:
    """Return the normal force [N] that gives a braking moment [N m]."""
    return moment / wedge_caliper.moment(1.0, par.wedge.mu_B, 1.0, par.caliper)


def contact_angle(par: Par) -> float:
    """Return the motor angle [rad] at which the pads touch."""
    return travel_for(0.0, par) / roller_screw.slope(par.screw)


def memory_at(x: float, par: Par) -> Memory:
    """Return the controllers' memory in which the references stand at that state."""
    k = roller_screw.slope(par.screw)
    delta = par.control.offset.delta_preload
    both = screw_offset.output(x / k, delta, par.control.offset)
    adjusts = par.adjuster.law != "none"
    return zeros(Memory)._replace(
        on=1.0,
        direction=ops.where(par.flywheel.Omega_0 < 0, -1.0, 1.0),
        theta_c=contact_angle(par),
        gap_hat=par.control.adjuster.gap_slope_hat * contact_angle(par) if adjusts else 0.0,
        theta_ref=x / k,
        delta=delta,
        theta_1_ref=both.theta_1,
        theta_2_ref=both.theta_2,
        last_1=x / k - delta / k,
        last_2=x / k + delta / k,
    )
