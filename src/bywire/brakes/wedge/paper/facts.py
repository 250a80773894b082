"""What Roberts et al. (2003) state, and where: numbers, and sentences read as bounds.

The paper prints few numbers. A sentence becomes a statement here where physics lets it be put as
a number that can turn out wrong; how it was read then stands in its place. Nothing is read off
curves.
"""

from __future__ import annotations

from bywire.brakes.wedge.sets.roberts2003 import SOURCE
from bywire.reproduction.item import Fact, reading

CITATION = SOURCE

_MOMENT = "section 'Moment control of brake'"

# Fig. 7
HELD = Fact(200.0, "N*m", f"{_MOMENT}, Fig. 7: 200 Nm step, held at the desired value")
PULSED = Fact(160.0, "N*m", f"{_MOMENT}, Fig. 7: pulsed to reduce it to 80 % of this value")
ONCE = Fact(1.0, "1", f"{_MOMENT}, Fig. 7: oscillations occur once per revolution")
RUNOUT = reading(
    0.0, "%", f"{_MOMENT}, Fig. 7: oscillations are the result of run-out; read as: none without"
)
PEAK_FIRST = reading(
    1.0,
    "1",
    f"{_MOMENT}, Fig. 7: the motor's acceleration toward the disc "
    "causes the initial peak in the power; read as: the largest power comes "
    "before the contact",
)
SMALL_POWER = reading(
    10.0,
    "%",
    f"{_MOMENT}, Fig. 7: the power is very small once the pads are in "
    "contact; read as: at most a tenth of the initial peak, both above standby, "
    "as the rig measures",
)
STANDBY = reading(
    50.0,
    "%",
    f"{_MOMENT}, Fig. 7: the steady power drain on the drive is clearly "
    "visible; read as: most of the power while holding",
)

# Fig. 8
LOWERED = Fact(160.0, "N*m", f"{_MOMENT}, Fig. 8: reduction to 160 Nm")
RAMPED = Fact(200.0, "N*m", f"{_MOMENT}, Fig. 8: a slow ramp up to the original value")
FOLLOWED = reading(
    0.0,
    "N*m",
    f"{_MOMENT}, Fig. 8: the desired response is well followed; read as: without mean error",
)

# Fig. 9
PULSE = Fact(950.0, "N*m", f"{_MOMENT}, Fig. 9: pulse of amplitude 950 Nm")
POWER = Fact(60.0, "W", f"{_MOMENT}, Fig. 9: achieved with around 60 W input power")
LONG = reading(
    50.0,
    "%",
    f"{_MOMENT}, Fig. 9: a long time on the software rate limit; read as: "
    "most of the time from contact to 90 % of the demand",
)
LARGE_LIMITED = reading(
    0.0,
    "%",
    f"{_MOMENT}: rate and torque limits dominate for larger "
    "amplitudes; read as: longer on the rate limit at 950 than at 200 Nm, "
    "shares of the time to 90 %",
)
SMALL_FRICTION = reading(
    1.0,
    "1",
    f"{_MOMENT}: friction is more important for smaller amplitudes; "
    "read as: friction changes the moment by a larger share of the demand at "
    "200 than at 950 Nm",
)
NO_PEAK = reading(
    1.0,
    "1",
    f"{_MOMENT}, Fig. 9: no initial peak due to acceleration; read as: "
    "filtered power above standby before contact at most that after it",
)
NOT_LOW = reading(
    2.0,
    "1",
    f"{_MOMENT}, Fig. 9: not the very low levels during the actual "
    "braking; read as: filtered power above standby always at least twice that of "
    "Fig. 7's hold",
)
REDUCES = reading(
    1.0,
    "1",
    f"{_MOMENT}, Fig. 9: for a longer braking the power would reduce with "
    "time to the steady state; read as: power above standby at the end of 1 s at "
    "most that of the short pulse",
)

# Neutral point and stability
NEUTRAL_FORCE = Fact(0.0, "N", "section 'Introduction': no steady force at mu_B = tan(alpha)")
REMAINS = Fact(
    100.0,
    "%",
    "section 'Introduction': at the neutral point a wedge position remains, and its moment",
)
NEUTRAL_POLE = Fact(
    0.0, "s**-1", "section 'Introduction': a point of neutral stability at mu_B = tan(alpha)"
)
UNSTABLE_POLE = reading(
    0.0,
    "s**-1",
    "section 'Introduction': the wedge becomes unstable as mu_B "
    "increases; read as: a perturbation grows",
)
STABLE_POLE = reading(
    0.0,
    "s**-1",
    "section 'Introduction': a steady pushing force at low mu_B; read as: a perturbation decays",
)
STABLE = Fact(
    0.0,
    "1",
    "section 'Introduction': a controller must be robust to mu_B, else "
    "instability; read as: no coefficient from 0.2 to 0.6 at which the loop is unstable",
    "requirement",
)
NO_PLAY = reading(
    0.0,
    "1",
    "section 'System description': preload removes free-play near the "
    "ideal value; read as: the heart's contacts do not change during a hold",
)
TOGETHER = reading(
    1.0,
    "1",
    "section 'System description': motors that work together have smaller "
    "loads away from the optimum; read as: less hold power above standby than with "
    "preload",
)
ONLY_TURNING = Fact(
    0.0, "1", "section 'Wedge and brake calliper': no self-reinforcement once the wheel has stopped"
)

# Rigs
_PUT_IN = "read as: what was put into the model comes out"
ETA = Fact(65.0, "%", "section 'Roller-screw efficiency': of the order of 65 %")
MEASURABLE = f"section 'Roller-screw efficiency': comparing torques and forces shows it; {_PUT_IN}"
SETS_STIFFNESS = f"section 'Drive train stiffnesses': the test sets K_S and K_W; {_PUT_IN}"
MEASURES_PLAY = f"section 'Drive train stiffnesses': the test measures the free-play; {_PUT_IN}"
SAME_COMPRESSION = (
    "section 'Drive train stiffnesses': essentially the same in compression as before, the force "
    "sensor allowed for; read as: our first stage's"
)
SOFTER_TENSION = reading(
    0.9,
    "1",
    "section 'Drive train stiffnesses': noticeably lower in "
    "tension; read as: at least a tenth below compression",
)
DIFFERENCES_FIGHT = reading(
    0.0,
    "N",
    "section 'Force fight tests': small differences of the "
    "motors cause the fight; read as: none between equal motors",
)
FASTER_FIGHTS = reading(
    1.0,
    "1",
    f"{_MOMENT}, Fig. 9: higher speeds increase the potential for "
    "force fight; read as: a doubled rate limit widens the swing of the angle "
    "between the motors",
)
FAST_CURRENT = reading(
    10.0,
    "1",
    "section 'Motor current loop': its bandwidth is very high; read "
    "as: at least ten times that of the position control",
)
LITTLE = reading(
    0.0,
    "%",
    "section 'Position control of wedge': very little difference to the "
    "screws alone; read as: none that shows",
)

# Position frequency responses: no number of Figs. 5 and 6 is printed, not even amplitudes and
# bandwidths, which are ours.
_ALONE = "section 'Motor & rollerscrew alone'"

NO_LIMIT = reading(
    0.0,
    "%",
    f"{_ALONE}, Fig. 5: the impact of the current limit is minimal; read "
    "as: none of the time at the limit, at any frequency and amplitude",
)
FRICTION_SEEN = reading(
    5.0,
    "%",
    f"{_ALONE}: the effects of friction on both responses are "
    "clearly seen, particularly at low frequency; read as: at 1 Hz and the "
    "smallest amplitude that moves, the response is at least this share of the "
    "amplitude away from the one without friction",
)
FRICTION_LOW = reading(
    1.0,
    "1",
    f"{_ALONE}, Fig. 5: particularly at low frequency; read as: at "
    "every amplitude the gain loses at least as many decibels at 1 Hz as at 100 "
    "Hz",
)
LIMITED = reading(
    1.0,
    "1",
    f"{_ALONE}, Fig. 6: the bandwidth depends on the current limit for all "
    "the amplitudes; read as: the limit sets in below the bandwidth of the linear "
    "loop",
)
KINK = reading(
    2.0,
    "1",
    f"{_ALONE}, Fig. 6: the kink in the phase is clearly visible; read as: "
    "between two of 40 frequencies the phase falls at least twice as far as that of the "
    "linear loop",
)
_SAME = (
    "section 'Comparison with test results': a linear model should give the same frequency "
    "response as the nonlinear one without friction"
)
SAME_GAIN = reading(0.0, "dB", f"{_SAME}; read as: no difference in gain")
SAME_PHASE = reading(0.0, "degree", f"{_SAME}; read as: no difference in phase")
EFFICIENCY_HIGH = reading(
    1.0,
    "1",
    "section 'Roller-screw efficiency': the impact of this "
    "parameter on the response of the motor that drives the wedge could be "
    "seen at higher frequencies; read as: it takes at least as many decibels "
    "off the gain at 100 Hz as at 10 Hz",
)
