"""What Dardanelli et al. (2010) state of pressures and currents: Figs. 3 and 6, and section 6."""

from __future__ import annotations

from bywire.bench.stated import StatedFigure, StatedLevel, StatedRange
from bywire.brakes.motorcycle.paper import facts
from bywire.brakes.motorcycle.paper.tolerances import STEADY

_BAR = 1e5
_AXIS = "the curve stays within the axis"

CURRENT_STEP = StatedLevel(
    "motorcycle.fig3.step",
    "current-step",
    "i",
    facts.FIG3_STEP.value,
    "step, Fig. 3",
    facts.FIG3_STEP.where,
    ("i_step",),
)
CURRENT_TOP = StatedLevel(
    "motorcycle.fig3.top",
    "current-step",
    "i",
    facts.FIG3_TOP.value,
    "top of Fig. 3's axis",
    f"{facts.FIG3_TOP.where}: {_AXIS}",
    ("i_step",),
)
PRESSURES = StatedRange(
    "motorcycle.fig6.axis",
    "pressure-step",
    "p_mc",
    facts.FIG6_START.value * _BAR,
    facts.FIG6_TOP.value * _BAR,
    "within Fig. 6's axis",
    f"Fig. 6, ends of its axis: {_AXIS}",
    ("p_start", "i_step"),
)
OVERSHOOT = StatedFigure(
    "motorcycle.fig7.overshoot",
    "hard-braking",
    "overshoot",
    facts.OVERSHOOT.value,
    facts.OVERSHOOT.where,
    ("p_from", "p_to"),
    "<=",
)
STEADY_STATE = StatedFigure(
    "motorcycle.fig7.steady_state_error",
    "hard-braking",
    "steady_state_error",
    facts.STEADY_STATE.value * _BAR,
    f"{facts.STEADY_STATE.where}; tolerance ours: {STEADY.reason}",
    ("p_from", "p_to"),
    tolerance=STEADY.size * _BAR,
)
