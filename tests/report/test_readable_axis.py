"""Readable axes: units in which values have few digits."""

from __future__ import annotations

import numpy as np
import pytest

from bywire.report.readable_axis import scale_of


@pytest.mark.parametrize(
    ("largest", "symbol", "unit", "shown"),
    [
        (0.0686, "s", "ms", 68.6),
        (1.2, "s", "s", 1.2),
        (25e5, "Pa", "bar", 25.0),
        (773.0, "Pa", "10⁻³ bar", 7.73),
        (3e-5, "kg*m**2", "10⁻⁶ kg·m²", 30.0),
        (2e6, "1", "10⁶", 2.0),
        (0.0, "1", "", 0.0),
        (6.2, "%", "%", 6.2),
        (41.2, "m", "m", 41.2),
        (4e-3, "m", "mm", 4.0),
        (373.15, "K", "°C", 100.0),
    ],
)
def test_scales_spare_the_reader_powers_of_ten(
    largest: float, symbol: str, unit: str, shown: float
) -> None:
    scale = scale_of(np.array([-0.1 * largest, np.nan, largest]), symbol)
    assert scale.unit == unit
    assert scale(largest) == pytest.approx(shown, rel=1e-12)
