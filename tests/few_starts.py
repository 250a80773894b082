"""For tests of what a design says, not of how good it is: its search takes most of their time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from bywire.synthesis import designer, optimizer


@contextmanager
def few_starts() -> Iterator[None]:
    """Have gains searched from one start besides the given one, in fewer steps."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(optimizer, "_SAMPLES", 16)
        patch.setattr(optimizer, "_STARTS", 1)
        patch.setattr(optimizer, "_ITERATIONS", 15)
        patch.setattr(optimizer, "_SIMPLEX", 8)
        patch.setattr(designer, "_CONFIRMED", 5)
        patch.setattr(designer, "_CONFIRMED_FIGURES", 20)
        yield
