"""For tests of what a design says, not of how good it is: its search takes most of their time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.loop_figures import LoopFigures
from bywire.synthesis import designer, linear_case


def coarse(gain: LinearModel, closed: LinearModel, points: int) -> LoopFigures:
    """Return figures on a grid of fewer points, 0.3 % apart where they are reported."""
    return LoopFigures(gain, closed, points // 2)


@contextmanager
def few_starts(*, is_coarse: bool = True) -> Iterator[None]:
    """Have gains searched from one start besides the given one, in fewer steps, by fewer points."""
    with pytest.MonkeyPatch.context() as patch:
        if is_coarse:
            patch.setattr(linear_case, "LoopFigures", coarse)
        patch.setattr(designer, "_SAMPLES", 16)
        patch.setattr(designer, "_STARTS", 1)
        patch.setattr(designer, "_ITERATIONS", 15)
        patch.setattr(designer, "_SIMPLEX", 8)
        patch.setattr(designer, "_CONFIRMED", 5)
        patch.setattr(designer, "_CONFIRMED_FIGURES", 20)
        yield
