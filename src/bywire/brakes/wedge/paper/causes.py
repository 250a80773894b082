"""Why some statements of Roberts et al. (2003) do not come out: causes with numbers."""

from __future__ import annotations

from collections.abc import Iterable

from bywire.reproduction.item import Item
from bywire.reproduction.quoted import Quoted
from bywire.reproduction.root_cause import RootCause


def causes(items: Iterable[Item]) -> tuple[RootCause, ...]:
    """Return the root causes, the numbers taken from the items."""
    listed = list(items)
    q = Quoted(listed)
    known = (_neutral_band(q), _pulse_length(q), _bearings(q), _dead_band(q))
    return tuple(cause for cause in known if cause.explained(listed))


def _neutral_band(q: Quoted) -> RootCause:
    return RootCause(
        "The paper's instability above mu_B = tan(alpha) leaves friction out: without it the "
        f"brake runs away from {q('stability.runaway')} on ({q.stated('stability.runaway')} "
        "stated), but dry friction of bearings, screws and wedge holds it without power below "
        f"{q('stability.runaway.friction')} at 500 Nm and {q('stability.runaway.friction.950')} at "
        "950 Nm.",
        ("stability.runaway.friction",),
    )


def _pulse_length(q: Quoted) -> RootCause:
    return RootCause(
        "The length of Fig. 9's pulse is not printed: within our 0.2 s the filtered power above "
        f"standby already falls to {q('fig9.lowest_power')} times that of Fig. 7's hold, which the "
        f"paper does not see; in a pulse that ends as 90 % is reached it is "
        f"{q('fig9.lowest_power.short')} times.",
        ("fig9.lowest_power",),
    )


def _bearings(q: Quoted) -> RootCause:
    return RootCause(
        "Motor torque and force alone do not measure the screw's efficiency: with the bearings' "
        f"friction in it the rig reads {q('efficiency.raw')} of {q.stated('efficiency.raw')} put "
        f"in; with their torque without load taken off, {q('efficiency.recovered')}. What is left "
        "is the bearings' friction under load, which no sensor of the rig tells from the screw's.",
        ("efficiency.*",),
    )


def _dead_band(q: Quoted) -> RootCause:
    return RootCause(
        "Position steps stop where friction holds them: with the soft low-bandwidth controller a "
        f"shaft can rest {q('position.dead_band.low')} from its reference, and what the wedge "
        "leaves of the preload decides where. Its response differs from that of the screws alone "
        f"by {q('position.wedge.low')} of the step, but only by {q('position.wedge.high')} with "
        f"the other controller, of which friction holds {q('position.dead_band.high')}.",
        ("position.wedge.*",),
    )
