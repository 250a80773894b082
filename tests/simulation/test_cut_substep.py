"""A substep that is cut at a zero of a velocity has the same total length."""

from __future__ import annotations

import numpy as np
import pytest

from bywire.core.typing import Array
from bywire.simulation import virtual_machine
from bywire.simulation.virtual_machine import CutSubstep

H = 1e-3


def settled(x: Array, d: Array, m: Array, p: Array, h: float) -> tuple[list[Array], bool]:
    """Return a body that friction and drag slow down, next to a clock."""
    v, _ = x
    force = 0.0 if v == 0.0 else -2.0 * np.sign(v) - 40.0 * (v + d[0]) ** 2
    end = np.array([v + h * force, x[1] + h])
    jump = np.array([0.5 * h * 4.0])
    return [end, 0.5 * (end - x), np.zeros(1), np.zeros(0), jump], False


@pytest.mark.parametrize("attempts", [1, 2, 3, 12])
def test_the_clock_goes_on_however_well_the_instant_is_found(
    attempts: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(virtual_machine, "ATTEMPTS", attempts)
    substep = CutSubstep(settled, (0,), np.zeros(0), np.zeros(0), H)
    (x, *_), failed = substep.results(np.array([1.1e-3, 5.0]), np.array([-0.9e-3, 0.5 * H]))
    assert not failed
    assert x[0] == 0.0
    assert x[1] == pytest.approx(5.0 + H, abs=1e-14)
