"""The state vector of a run, and what bounds its passes: all that a ready kernel needs to know."""

from __future__ import annotations

from dataclasses import dataclass

COUNTERS = 3  # at the end of the state vector, see `Layout`
CAP = 8  # passes through one substep before it is counted as unsettled
JUMP, FLAG, DOUBT = 4, 5, 6  # places among the results of a pass, behind x, d, r, q
# Where a substep is cut: how often the instant is tried, within which share of the substep's change
# of velocity it counts as met, or as so near that a line leads there, and the least share of a part
# that is cut off or left.
ATTEMPTS, CLOSE, NEAR, EDGE = 12, 1e-12, 1e-9, 1e-9
STILL = 1e-9  # share of its speed below which another velocity counts as zero at the same instant


def most_cuts(velocities: int) -> int:
    """Return into how many parts a substep is cut before it is counted as unsettled.

    Each velocity with dry friction may turn, and turn once more when others have.
    """
    return 2 * velocities + 2


@dataclass(frozen=True)
class Layout:
    """Where the parts of the state vector start.

    The vector holds x, d, r, q, the memory m, and the counters: substeps that did not settle,
    substeps that were repeated, and parts of substeps that were tried for that.
    """

    start: dict[str, int]
    length: dict[str, int]

    @property
    def total(self) -> int:
        """Length of the state vector."""
        return self.start["counters"] + COUNTERS
