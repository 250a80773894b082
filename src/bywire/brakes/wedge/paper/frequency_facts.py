"""What Roberts et al. (2003) state about position frequency responses, and where.

No number of Figs. 5 and 6 is printed, not even the amplitudes and the bandwidths: those are ours.
"""

from __future__ import annotations

from bywire.reproduction.item import Fact

_ALONE = "section 'Motor & rollerscrew alone'"

NO_LIMIT = Fact(
    0.0, "%",
    f"{_ALONE}, Fig. 5: the impact of the current limit is minimal; read as: none of the time at "
    "the limit, at any frequency and amplitude",
    "reading",
)  # fmt: skip
FRICTION_SEEN = Fact(
    5.0, "%",
    f"{_ALONE}: the effects of friction on both responses are clearly seen, particularly at low "
    "frequency; read as: at 1 Hz and the smallest amplitude that moves, the response is at least "
    "this share of the amplitude away from the one without friction",
    "reading",
)  # fmt: skip
FRICTION_LOW = Fact(
    1.0, "1",
    f"{_ALONE}, Fig. 5: particularly at low frequency; read as: at every amplitude the gain loses "
    "at least as many decibels at 1 Hz as at 100 Hz",
    "reading",
)  # fmt: skip
LIMITED = Fact(
    1.0, "1",
    f"{_ALONE}, Fig. 6: the bandwidth depends on the current limit for all the amplitudes; read "
    "as: the limit sets in below the bandwidth of the linear loop",
    "reading",
)  # fmt: skip
KINK = Fact(
    2.0, "1",
    f"{_ALONE}, Fig. 6: the kink in the phase is clearly visible; read as: between two of 40 "
    "frequencies the phase falls at least twice as far as that of the linear loop",
    "reading",
)  # fmt: skip
_SAME = (
    "section 'Comparison with test results': a linear model should give the same frequency "
    "response as the nonlinear one without friction"
)
SAME_GAIN = Fact(0.0, "dB", f"{_SAME}; read as: no difference in gain", "reading")
SAME_PHASE = Fact(0.0, "degree", f"{_SAME}; read as: no difference in phase", "reading")
EFFICIENCY_HIGH = Fact(
    1.0, "1",
    "section 'Roller-screw efficiency': the impact of this parameter on the response of the motor "
    "that drives the wedge could be seen at higher frequencies; read as: it takes at least as many "
    "decibels off the gain at 100 Hz as at 10 Hz",
    "reading",
)  # fmt: skip
