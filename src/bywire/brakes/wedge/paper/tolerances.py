"""The tolerances of Roberts et al. (2003), each with its reason."""

from __future__ import annotations

from bywire.reproduction.item import SHARE, Allowance

FOLLOWED = Allowance(
    "moments that are 'held', 'well followed' or reached",
    0.05,
    SHARE,
    "a curve that lies this far from its demand is still seen on it in a figure of this size",
)
ERROR = Allowance(
    "mean error of Fig. 8's ramp", 10.0, "N*m", "5 % of the 200 Nm that the figure shows"
)
ORDER = Allowance(
    "order of the moment's oscillation",
    0.05,
    "1",
    "resolution of a spectrum over 20 revolutions of the disc",
)
LEFT = Allowance(
    "ripple that run-out does not cause",
    5.0,
    "%",
    "of the ripple with run-out: friction and encoder counts may leave as much unseen",
)
FORMULA = Allowance(
    "C* by its formula",
    0.001,
    SHARE,
    "the model without friction obeys the formula; what is left is a run not quite at rest",
)
FORCE = Allowance(
    "forces that vanish by symmetry or at the neutral point",
    0.1,
    "N",
    "1e-4 of the forces that the same test shows otherwise",
)
NEUTRAL = Allowance(
    "growth rate at the neutral point",
    1e-3,
    "s**-1",
    "rounding errors of a double pole; a rate of 1 % in 10 s",
)
KEPT = Allowance(
    "moment kept without power at the neutral point",
    1.0,
    "%",
    "what a line's width hides; run-out is off",
)
GRID = Allowance(
    "lowest mu_B that runs away", 0.01, "1", "distance of the coefficients that are tried"
)
FEW = Allowance(
    "changes of contact with preload",
    5.0,
    "1",
    "a few at the start of the hold, against a change in every swing with free-play",
)
STANDING = Allowance(
    "share of self-reinforcement on a standing disc",
    0.05,
    "1",
    "dry friction on wedge and rollers holds part of the force",
)
RECOVERED = Allowance(
    "stiffnesses, free-play and efficiency recovered by their tests",
    0.03,
    SHARE,
    "the tests read encoders and a force sensor, and take the bearings' friction "
    "as the band between loading and unloading",
)
ALIKE = Allowance(
    "position of the wedge against that of the screws alone",
    5.0,
    "%",
    "of the step: a curve that lies this far from another is still seen on it",
)
AT_LIMIT = Allowance(
    "share of the time at the current limit",
    1.0,
    "%",
    "a fundamental that loses 1 % is 0.1 dB lower, which no figure shows",
)
SAME_GAIN = Allowance(
    "gain of the nonlinear response without friction",
    0.01,
    "dB",
    "the engine's step, 20 us, leaves less than that up to 100 Hz",
)
SAME_PHASE = Allowance(
    "phase of the nonlinear response without friction", 0.1, "degree", "as for the gain"
)

ALLOWANCES = (
    FOLLOWED,
    ERROR,
    ORDER,
    LEFT,
    FORMULA,
    FORCE,
    NEUTRAL,
    KEPT,
    GRID,
    FEW,
    STANDING,
    RECOVERED,
    ALIKE,
    AT_LIMIT,
    SAME_GAIN,
    SAME_PHASE,
)
