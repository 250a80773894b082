"""What Roberts et al. (2003) state of the moments and powers of their Figs. 7 to 9.

Moments that are held, reached or followed have the tolerance by which they are judged, as a band.
"""

from __future__ import annotations

from bywire.bench.stated import StatedFigure, StatedLevel
from bywire.brakes.wedge.paper import facts
from bywire.brakes.wedge.paper.tolerances import ERROR, FOLLOWED
from bywire.reproduction.item import Allowance, Fact


def _judged(fact: Fact, allowance: Allowance) -> str:
    """Return the place of a statement, and why a curve may be so far off."""
    return f"{fact.where}; tolerance ours: {allowance.reason}"


HELD = StatedLevel(
    "wedge.fig7.held",
    "moment-pulses",
    "M_B",
    facts.HELD.value,
    "held, Fig. 7",
    _judged(facts.HELD, FOLLOWED),
    ("M_high",),
    FOLLOWED.around(facts.HELD.value),
)
PULSED = StatedLevel(
    "wedge.fig7.pulsed",
    "moment-pulses",
    "M_B",
    facts.PULSED.value,
    "pulses, Fig. 7",
    _judged(facts.PULSED, FOLLOWED),
    ("M_high", "low"),
    FOLLOWED.around(facts.PULSED.value),
)
LOWERED = StatedLevel(
    "wedge.fig8.lowered",
    "moment-ramp",
    "M_B",
    facts.LOWERED.value,
    "lowered, Fig. 8",
    _judged(facts.LOWERED, FOLLOWED),
    ("M_low",),
    FOLLOWED.around(facts.LOWERED.value),
)
RAMPED = StatedLevel(
    "wedge.fig8.ramped",
    "moment-ramp",
    "M_B",
    facts.RAMPED.value,
    "ramp's end, Fig. 8",
    _judged(facts.RAMPED, FOLLOWED),
    ("M_high",),
    FOLLOWED.around(facts.RAMPED.value),
)
PULSE = StatedLevel(
    "wedge.fig9.pulse",
    "moment-pulse-950",
    "M_B",
    facts.PULSE.value,
    "pulse, Fig. 9",
    _judged(facts.PULSE, FOLLOWED),
    ("M_high",),
    FOLLOWED.around(facts.PULSE.value),
)
POWER = StatedLevel(
    "wedge.fig9.power",
    "moment-pulse-950",
    "P_meas",
    facts.POWER.value,
    "around this, Fig. 9",
    facts.POWER.where,
    ("M_high",),
)
PEAK_MOMENT = StatedFigure(
    "wedge.fig9.peak_moment",
    "moment-pulse-950",
    "peak_moment",
    facts.PULSE.value,
    _judged(facts.PULSE, FOLLOWED),
    ("M_high",),
    tolerance=FOLLOWED.around(facts.PULSE.value),
)
HOLD_MOMENT = StatedFigure(
    "wedge.fig7.hold_moment",
    "moment-pulses",
    "hold_moment",
    facts.HELD.value,
    _judged(facts.HELD, FOLLOWED),
    ("M_high",),
    tolerance=FOLLOWED.around(facts.HELD.value),
)
RAMP_ERROR = StatedFigure(
    "wedge.fig8.ramp_error",
    "moment-ramp",
    "ramp_error_mean",
    facts.FOLLOWED.value,
    _judged(facts.FOLLOWED, ERROR),
    ("M_low", "M_high"),
    tolerance=ERROR.size,
)
