"""What the panels of stacked time traces show: the motorcycle brake's, and the wedge brake's."""

from __future__ import annotations

from dataclasses import dataclass

from bywire.report.style import Role


@dataclass(frozen=True)
class Trace:
    """A variable and what its line means."""

    variable: str
    role: Role = Role.MAIN


@dataclass(frozen=True)
class Panel:
    """One panel of stacked time traces.

    Parameters
    ----------
    quantity
        What the ordinate says, without its unit; short, for low panels.
    traces
        Lines of one unit, the judged one first; variables a recording lacks are left out.
    saturation
        Variable that is 1 while the quantity is saturated.
    saturated
        What the legend calls that.
    limit
        Parameter of the recording that bounds the first trace on both sides; its lines are drawn
        where the trace comes near.
    levels
        Names of the values 0, 1, 2, ... of a mode, which is then drawn in steps.
    height
        Relative height.
    """

    quantity: str
    traces: tuple[Trace, ...]
    saturation: str | None = None
    saturated: str = "saturated"
    limit: str | None = None
    levels: tuple[str, ...] = ()
    height: float = 1.0


MOTORCYCLE_PANELS = (
    Panel(
        "pressure",
        (Trace("p_mc"), Trace("p_pd", Role.SECOND), Trace("p_ref", Role.SET_POINT)),
        height=1.8,
    ),
    Panel("current", (Trace("i"), Trace("i_ref", Role.SET_POINT)), saturation="sat_current"),
    Panel("speed", (Trace("omega"),)),
    Panel("duty cycle", (Trace("duty"),), saturation="sat_duty"),
    Panel("power", (Trace("P_el"),)),
)

WEDGE_PANELS = (
    Panel(
        "moment",
        (Trace("y_M"), Trace("M_B", Role.SECOND), Trace("M_set", Role.SET_POINT)),
        height=1.8,
    ),
    Panel(
        "motor speed",
        (Trace("omega_1"), Trace("omega_2", Role.SECOND)),
        saturation="sat_rate",
        saturated="on the software rate limit",
    ),
    Panel("current", (Trace("i_1"), Trace("i_2", Role.SECOND)), limit="drive.i_max"),
    # The rig shows the filtered power; the peaks of the raw one would hide it.
    Panel("power", (Trace("P_meas"), Trace("P_in", Role.SECOND))),
    Panel("force", (Trace("F_M"),)),
    Panel("mode", (Trace("mode"),), levels=("parked", "gap", "moment", "retracting")),
)
"""moment, speed, current and power as in Figs. 7 to 9 of Roberts et al. (2003), and more"""

RIG_PANELS = (
    Panel(
        "angle",
        (
            Trace("theta_1"), Trace("theta_2", Role.SECOND), Trace("theta_1_ref", Role.SET_POINT),
        ),
        height=1.8,
    ),
    Panel("motor speed", (Trace("omega_1"), Trace("omega_2", Role.SECOND))),
    Panel(
        "current",
        (Trace("i_1"), Trace("i_2", Role.SECOND), Trace("i_1_ref", Role.SET_POINT)),
        limit="drive.i_max",
    ),
    Panel("force", (Trace("y_F"),)),
    Panel("force", (Trace("F_M"),)),
    Panel("power", (Trace("P_meas"), Trace("P_in", Role.SECOND))),
    Panel("power", (Trace("P_el"),)),
)  # fmt: skip
"""motors and screws alone, or the wedge brake under position or current control"""

KINDS = (MOTORCYCLE_PANELS, WEDGE_PANELS, RIG_PANELS)
"""panels that time traces choose from"""
