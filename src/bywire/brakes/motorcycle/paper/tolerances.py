"""The tolerances of Dardanelli et al. (2010), each with its reason."""

from __future__ import annotations

from bywire.reproduction.item import SHARE, Allowance

PRINTED = Allowance(
    "numbers that follow from printed ones by a formula: Tables 1 and 2, eqs. (12) and (19)",
    0.005,
    SHARE,
    "half a unit in the last of three printed digits is at most 0.5 %",
)
ROUND = Allowance(
    "the current loop's 100 Hz and the crossover of 10 Hz",
    0.1,
    SHARE,
    "printed as round numbers, with neither the motor's winding nor the gains",
)
GAIN = Allowance(
    "gains of Table 4",
    0.05,
    SHARE,
    "they differ by 5 % between low and high pressure: less is within the paper's own spread",
)
CORNER = Allowance(
    "corner frequencies of Table 4",
    0.1,
    SHARE,
    "T1 and T2 differ by about 10 % from one pressure region to the next",
)
ABOUT = Allowance(
    "the viscous coefficient of section 3.4",
    0.5,
    SHARE,
    "the text gives it as 'about', to one digit",
)
LOOP = Allowance(
    "hysteresis 'totally removed': area of the loop with dither in % of that without",
    5.0,
    "%",
    "a mean width of about 0.05 A over the whole loop, 1 % of Fig. 5's axis: the width of a line",
)
LEVEL = Allowance(
    "hysteresis 'totally removed': pressure above which the loop is narrow",
    0.5,
    "bar",
    "the lowest level looked at, 1 % of the sensor's range: the loop's ends are always closed",
)
STEADY = Allowance(
    "'zero' steady-state error", 0.05, "bar", "four steps of a 12 bit converter over 50 bar"
)
OVERSHOOT = Allowance(
    "overshoot of Table 4's model", 1.0, "%", "a fifth of what is stated; both steps are exact"
)

ALLOWANCES = (PRINTED, ROUND, GAIN, CORNER, ABOUT, LOOP, LEVEL, STEADY, OVERSHOOT)
