"""What the tests of studies share: a quick study, and files of others."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from systems.loading import SPRING_AXIS, loaded

BENCH = """
experiment = "hard-braking"
parameters = "dardanelli2010"
[options]
duration = "40 ms"
settle = "10 ms"
[requirements]
peak_current = "<= 25 A"
"""
VARY = """
[vary]
"motor.R_m" = { kind = "normal", sd = "4 %" }
"motor.K_e" = "+-5 %"
"""


@pytest.fixture
def study(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes a study file beside its bench."""

    def write(text: str = VARY, bench: str = BENCH, name: str = "study.toml") -> Path:
        (tmp_path / "bench.toml").write_text(bench)
        path = tmp_path / name
        path.write_text('bench = "bench.toml"\n' + text)
        return path

    return write


@pytest.fixture
def spring_axis() -> Iterator[None]:
    """Have the mass on a spring known, whose step response has a closed form."""
    with loaded(SPRING_AXIS):
        yield
