"""True errors with the steps that bywire chooses for stated errors, in all shipped benches."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from bywire.bench.bench_file import read
from bywire.bench.running import run
from bywire.bench.step_choice import scales_of, with_chosen_step
from bywire.core.errors import StepError

BENCHES = sorted((Path(__file__).parents[2] / "benches").glob("*.toml"))
REFERENCE = 0.4e-6
ERRORS = ("5 %", "1 %", "0.1 %", "0.01 %")


@pytest.mark.trust
def test_true_errors_are_within_the_stated_errors() -> None:
    """At least 95 % are, as for the bounds of key figures that do not converge."""
    held = []
    for path in BENCHES:
        exact = run(replace(read(path, {}), step=REFERENCE))
        scales = scales_of(exact.bench, exact.recordings).full
        for error in ERRORS:
            try:
                chosen = with_chosen_step(read(path, {"simulation.error": error}))
            except StepError:  # scatter
                continue
            found = run(chosen)
            for name in chosen.limits:
                value, other = found.kpi(name).value, exact.kpi(name).value
                scale = max(abs(value), abs(other), scales.get(name, 0.0))
                is_alike = value == other or (math.isnan(value) and math.isnan(other))
                held.append(is_alike or abs(value - other) <= float(chosen.error or 0.0) * scale)
    assert len(held) > 100
    assert sum(held) / len(held) >= 0.95
