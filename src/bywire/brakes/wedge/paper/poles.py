"""Introduction: without control the wedge is neutral at tan(alpha), and unstable above it."""

from __future__ import annotations

import numpy as np

from bywire.analysis.linear.linearize import linearize
from bywire.brakes.wedge.model import WedgeBrake, state_at
from bywire.brakes.wedge.paper import facts
from bywire.brakes.wedge.paper.runs import IDEAL, parameters, tan_alpha
from bywire.brakes.wedge.paper.tolerances import NEUTRAL
from bywire.brakes.wedge.start import memory_at, travel_for
from bywire.reproduction.item import Item, compared, found

BELOW, ABOVE = 0.2, 0.5
"""friction coefficients on both sides of the neutral point"""
DEPTH = 5e-5
"""wedge travel [m] beyond contact at which the brake is linearized; the model is linear there"""
MECHANICAL = ("theta_1", "omega_1", "theta_2", "omega_2", "x", "v")


def poles() -> list[Item]:
    """Return the slow open-loop poles at constant currents, without friction and cogging."""
    note = "linear model at constant currents, without friction and cogging, mu_B ="
    below, neutral, above = (slow_pole(mu_B) for mu_B in (BELOW, tan_alpha(), ABOVE))
    return [
        compared("stability.pole.neutral", facts.NEUTRAL_POLE, neutral.real, NEUTRAL.size,
                 f"largest growth rate, {note} tan(alpha)"),
        compared("stability.pole.above", facts.UNSTABLE_POLE, above.real, ">=",
                 f"largest growth rate, {note} {ABOVE:g}"),
        compared("stability.pole.below", facts.STABLE_POLE, below.real, "<=",
                 f"largest growth rate, {note} {BELOW:g}"),
        found("stability.swing.below", "rad/s", below.imag, f"of the slow pair, {note} {BELOW:g}"),
    ]  # fmt: skip


def slow_pole(mu_B: float) -> complex:
    """Return the slow pole that grows fastest [1/s], the one with positive frequency of a pair."""
    par = parameters().replace({**IDEAL, "command.mode": "current", "wedge.mu_B": mu_B})
    state = state_at(travel_for(0.0, par) + DEPTH, par)
    model = linearize(
        WedgeBrake(), par, state, memory_at(state.x, par), inputs=("i_1_ref",), outputs=("x",)
    )
    # Held: the current loops, and the disc with its sensors, which do not feed back.
    every = model.reduced(MECHANICAL, held=True).poles()
    slow = every[np.argsort(np.abs(every))][:2]
    return complex(max(slow, key=lambda s: (round(s.real, 6), s.imag)))
