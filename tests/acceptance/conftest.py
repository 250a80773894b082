"""The papers as they are reproduced: once for all tests that read them."""

from __future__ import annotations

import time
from typing import NamedTuple

import pytest

from bywire.brakes.wedge.paper import roberts2003
from bywire.reproduction.reproduction import Reproduction


class Timed(NamedTuple):
    """A reproduction, the processor time that it took [s], and the stages that it told."""

    reproduction: Reproduction
    seconds: float
    stages: list[tuple[str, float]]


@pytest.fixture(scope="session")
def wedge_paper() -> Timed:
    """Return the reproduction of Roberts et al. (2003)."""
    stages: list[tuple[str, float]] = []
    begin = time.process_time()
    found = roberts2003.reproduce(lambda label, share: stages.append((label, share)))
    return Timed(found, time.process_time() - begin, stages)
