"""What Roberts et al. (2003) state of the moments and powers of their Figs. 7 to 9."""

from __future__ import annotations

from bywire.bench.stated import StatedLevel
from bywire.brakes.wedge.paper import facts

HELD = StatedLevel(
    "wedge.fig7.held", "moment-pulses", "M_B", facts.HELD.value, "held, Fig. 7",
    facts.HELD.where, ("M_high",),
)  # fmt: skip
PULSED = StatedLevel(
    "wedge.fig7.pulsed", "moment-pulses", "M_B", facts.PULSED.value, "pulses, Fig. 7",
    facts.PULSED.where, ("M_high", "low"),
)  # fmt: skip
LOWERED = StatedLevel(
    "wedge.fig8.lowered", "moment-ramp", "M_B", facts.LOWERED.value, "lowered, Fig. 8",
    facts.LOWERED.where, ("M_low",),
)  # fmt: skip
RAMPED = StatedLevel(
    "wedge.fig8.ramped", "moment-ramp", "M_B", facts.RAMPED.value, "ramp's end, Fig. 8",
    facts.RAMPED.where, ("M_high",),
)  # fmt: skip
PULSE = StatedLevel(
    "wedge.fig9.pulse", "moment-pulse-950", "M_B", facts.PULSE.value, "pulse, Fig. 9",
    facts.PULSE.where, ("M_high",),
)  # fmt: skip
POWER = StatedLevel(
    "wedge.fig9.power", "moment-pulse-950", "P_meas", facts.POWER.value, "around this, Fig. 9",
    facts.POWER.where, ("M_high",),
)  # fmt: skip
