"""Why some statements on Figs. 5 and 6 of Roberts et al. (2003) do not come out."""

from __future__ import annotations

from collections.abc import Iterable

from bywire.reproduction.item import Item
from bywire.reproduction.quoted import Quoted
from bywire.reproduction.root_cause import RootCause


def causes(items: Iterable[Item]) -> tuple[RootCause, ...]:
    """Return the root causes, the numbers taken from the items."""
    listed = list(items)
    q = Quoted(listed)
    known = (
        RootCause(
            "The low-bandwidth controller is too soft to keep the wedge's preload: its response "
            f"is that of a screw preloaded by {q('fig5.wedge.preload')} (to "
            f"{q('fig5.wedge.nearest')}), and {q('fig5.wedge')} away from that with our preload "
            "of the single screw, which the paper does not print. The gear ratio hides the wedge's "
            "mass, not its friction.",
            ("fig5.wedge",),
        ),
        RootCause(
            f"Wedge and screw differ by {q('fig6.wedge.below_limit')} as long as the current "
            f"limit is not reached, and by {q('fig6.wedge')} where it sets in: there the response "
            "jumps, and a little more or less friction moves the jump.",
            ("fig6.wedge",),
        ),
        RootCause(
            "Friction shows in the response of a stiff loop only where the amplitude is small: "
            f"with 60 Hz it moves the response at 1 Hz by {q('fig6.friction')} of 0.25 rad, our "
            "choice, and by more of a smaller amplitude.",
            ("fig6.friction",),
        ),
    )
    return tuple(cause for cause in known if cause.explained(listed))
