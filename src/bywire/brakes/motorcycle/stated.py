"""What Dardanelli et al. (2010) state of the pressures and currents of their Figs. 3 and 6."""

from __future__ import annotations

from bywire.bench.stated import StatedLevel
from bywire.brakes.motorcycle.paper import facts

_BAR = 1e5
_AXIS = "the curve stays within the axis"

CURRENT_STEP = StatedLevel(
    "motorcycle.fig3.step", "current-step", "i", facts.FIG3_STEP.value, "step, Fig. 3",
    facts.FIG3_STEP.where, ("i_step",),
)  # fmt: skip
CURRENT_TOP = StatedLevel(
    "motorcycle.fig3.top", "current-step", "i", facts.FIG3_TOP.value, "top of Fig. 3's axis",
    f"{facts.FIG3_TOP.where}: {_AXIS}", ("i_step",),
)  # fmt: skip
PRESSURE_START = StatedLevel(
    "motorcycle.fig6.start", "pressure-step", "p_mc", facts.FIG6_START.value * _BAR,
    "bottom of Fig. 6's axis", f"{facts.FIG6_START.where}: {_AXIS}", ("p_start", "i_step"),
)  # fmt: skip
PRESSURE_TOP = StatedLevel(
    "motorcycle.fig6.top", "pressure-step", "p_mc", facts.FIG6_TOP.value * _BAR,
    "top of Fig. 6's axis", f"{facts.FIG6_TOP.where}: {_AXIS}", ("p_start", "i_step"),
)  # fmt: skip
