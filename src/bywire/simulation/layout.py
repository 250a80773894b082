"""The state vector of a run, and what bounds its passes: all that a ready kernel needs to know."""

from __future__ import annotations

from dataclasses import dataclass

CAP = 8  # passes through one substep before it is counted as unsettled


@dataclass(frozen=True)
class Layout:
    """Where the parts of the state vector start.

    The vector holds x, d, r, q, the memory m, and two counters: substeps that did not
    settle, substeps that were repeated.
    """

    start: dict[str, int]
    length: dict[str, int]

    @property
    def total(self) -> int:
        """Length of the state vector."""
        return self.start["counters"] + 2
