"""How far a computed number may lie from a stated one, and why."""

from __future__ import annotations

from dataclasses import dataclass

SHARE = "share"
"""unit of an allowance that is a share of the stated number"""


@dataclass(frozen=True)
class Allowance:
    """A tolerance with its reason.

    Parameters
    ----------
    what
        What it is used for.
    size
        Largest difference that counts as agreement.
    unit
        Unit of ``size`` in pint's syntax, or `SHARE`.
    reason
        Why so much and not more.
    """

    what: str
    size: float
    unit: str
    reason: str

    def around(self, stated: float) -> float:
        """Return the tolerance around a stated number, in that number's unit."""
        return self.size * abs(stated) if self.unit == SHARE else self.size
