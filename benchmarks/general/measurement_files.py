"""Reading time of measurement files, compared with the library that bywire uses."""

from __future__ import annotations

import importlib
import tempfile
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from benchmarks.result import Result, at_most
from benchmarks.suite import Part
from benchmarks.timing import interleaved, ratio, timed
from bywire.core.libraries import how_to_install
from bywire.data.measurement import read_measurement

RATE, CHANNELS = 10_000, 20
SECONDS = 120
"""an hour would need 3 GB of disk space; the time is proportional to the length"""

READ = ("c3", "c7", "c11", "c19")
_ROUNDS = 7
_GOAL = 1.5


def measured() -> list[Result]:
    """Measure the reading time of a few channels of an MDF 4 file."""
    try:
        asammdf = importlib.import_module("asammdf")
    except ImportError:
        note = f"not installed: {how_to_install('measurements')}"
        return [Result("read.mdf4", None, "times as long", f"<= {_GOAL:g}", None, note)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mf4"
        _write(asammdf, path)
        seconds = interleaved(
            {
                "bywire": timed(partial(read_measurement, path, signals=READ)),
                "alone": timed(partial(_alone, asammdf, path)),
            },
            _ROUNDS,
        )
    return [
        at_most(
            "read.mdf4",
            ratio(seconds, "bywire", "alone"),
            _GOAL,
            "times as long",
            f"{len(READ)} of {CHANNELS} channels of {SECONDS} s at {RATE} Hz, a thirtieth of an "
            "hour. bywire reads them in a child process, in SI units, with increasing times, in "
            f"{median(seconds['bywire']):.2g} s. asammdf's select takes "
            f"{median(seconds['alone']):.2g} s. bywire reads files above 0.5 GB in pieces "
            "within bounded memory, which takes several times as long",
        )
    ]


def _write(asammdf: Any, path: Path) -> None:
    """Write a measurement with single-precision channels, as recorders do."""
    time = np.arange(SECONDS * RATE) / RATE
    noise = np.random.default_rng(0).standard_normal(time.size).astype(np.float32)
    channels = [
        asammdf.Signal(np.roll(noise, k), time, name=f"c{k}", unit="bar") for k in range(CHANNELS)
    ]
    with asammdf.MDF(version="4.10") as file:
        file.append(channels)
        file.save(path)


def _alone(asammdf: Any, path: Path) -> Any:
    with asammdf.MDF(path) as file:
        return file.select(list(READ))


PART = Part("measurement files", measured)
