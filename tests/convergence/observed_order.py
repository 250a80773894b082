"""The observed order of errors that should be a power of the step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

TOLERANCE = 0.15  # tells second order from first and third


def assert_order(steps: Sequence[float], errors: Sequence[float], order: float, what: str) -> None:
    """Fail unless absolute errors fall with the given power of the step, by a log-log fit."""
    values = np.asarray(errors, dtype=float)
    assert np.all(values > 0.0), f"{what}: an error of exactly zero compares nothing"
    slope, offset = np.polyfit(np.log(steps), np.log(values), 1)
    assert slope == pytest.approx(order, abs=TOLERANCE), f"{what}: observed order {slope:.3f}"
    scatter = np.log(values) - (offset + slope * np.log(steps))
    assert np.abs(scatter).max() < np.log(2.0), f"{what}: errors scatter around the fit: {values}"
