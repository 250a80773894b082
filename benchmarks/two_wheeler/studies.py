"""Studies of vehicle stops: the fraction of time that is simulation."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.judging import simulated_and_judged
from benchmarks.result import Result, at_most
from benchmarks.stated_error import of_stated_error
from benchmarks.suite import Part
from bywire.studies.store import computed_chunk
from bywire.studies.study_file import read_study

_STUDY = """
bench = "straight-stop"
[vary]
"vehicle.body.m" = "+-5 %"
"vehicle.body.h" = "+-5 %"
"front.disc.mu_pad" = "+-10 %"
"""
_ROUNDS = 3


def studies() -> Iterator[Result]:
    """Measure the time of key figures of stops, relative to their simulation, and a longer step."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_text(_STUDY, encoding="utf-8")
        plan = read_study(path)
        computed_chunk(plan, 0, threads=1)  # the kernel is built
        simulated, judged = simulated_and_judged(plan, _ROUNDS)
        yield at_most(
            "study.vehicle_kpi_share",
            judged / simulated,
            0.05,
            "1",
            f"key figures of a vehicle stop, {1e6 * judged:.3g} us per case, relative to its "
            f"simulation, {1e3 * simulated:.3g} ms",
        )
        yield from of_stated_error(path, "0.1 %", "study.vehicle_error_0.1")


PART = Part("vehicle studies", studies)
