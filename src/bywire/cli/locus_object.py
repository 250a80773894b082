"""A root locus as a JSON object."""

from __future__ import annotations

from typing import Any

from bywire.analysis.locus import Locus


def locus_object(found: Locus) -> dict[str, Any]:
    """Return values, poles by value [real, imaginary], and where stability changes."""
    return {
        "over": found.name,
        "unit": found.unit,
        "values": found.values.tolist(),
        "period": found.period,
        "poles": [[[float(z.real), float(z.imag)] for z in row] for row in found.poles],
        "stable": [bool(one) for one in found.stable],
        "borders": [
            {"value": b.value, "rate": [b.rate.real, b.rate.imag], "stable_above": b.above}
            for b in found.borders
        ],
    }
