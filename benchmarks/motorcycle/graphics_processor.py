"""Ensembles and studies on a graphics processor, compared with all cores of the same machine."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast
from unittest.mock import patch

import numpy as np
import pandas as pd

from benchmarks.commands import seconds_of
from benchmarks.motorcycle.engine import VARIED
from benchmarks.motorcycle.problem import braking_run, hard_braking
from benchmarks.result import Result, at_least, at_most, failed
from benchmarks.suite import Part
from benchmarks.timing import interleaved, processor_timed, timed
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.catalog import parameters
from bywire.core.child_process import python_command
from bywire.core.errors import DeviceError, ParameterError
from bywire.core.machine import worker_count
from bywire.core.typing import Array
from bywire.simulation.cuda_device import OTHERWISE, Memory, find_device
from bywire.simulation.ensemble import Ensemble, simulate_ensemble
from bywire.simulation.run import Run
from bywire.studies.store import CASE, StudyStore

LANES, THREADS = 1024, 32_768
"""cases of the ratio: half a second of work for a core, and one batch for a large processor"""
ENSEMBLES, BESIDE = (1024, 8192, 32_768, 131_072), 8192
"""cases of the ensembles, and the maximum number of cases in lanes for comparison"""
CASES, STUDIES = 1024, (10_000, 200_000)
"""cases of the studies of longer experiments, and of hard braking"""
CORES, RATIO, DIFFERENCE = 2, 50.0, 0.0
ENSEMBLE_RATE, STUDY_RATE, STUDY_RATIO = 350_000.0, 40_000.0, 4.0
"""goals: cases per second of the largest ensemble and study, and ratio of the longer studies"""
SECONDS = 240.0
"""time limit of this part, after which it skips the remaining rows"""
_ROUNDS = 3
_SIGNALS = ("p_mc", "i", "stuck")
_ONE = _SIGNALS[:1]
_FOLDER = Path(__file__).parents[2]
_TOLERANCES = _FOLDER / "studies" / "tolerances.toml"
_LONGER = {
    "gpu.moment_pulses": ("moment-pulses", {"heart.K_S": "+-5 %", "wedge.mu_B": "+-5 %"}),
    "gpu.wet_stop": (
        str(_FOLDER / "benches" / "wet_stop.toml"),
        {"vehicle.body.m": "+-5 %", "front.disc.mu_pad": "+-10 %"},
    ),
}
"""rows of studies of longer experiments: the bench, and what varies"""


# --- Rows, and the time that is left for them


class _Clock:
    """Time limit of this part."""

    def __init__(self) -> None:
        self._end = time.monotonic() + SECONDS

    def left(self) -> float:
        """Return the remaining time [s]."""
        return max(self._end - time.monotonic(), 0.0)

    def require(self, seconds: float = 0.0) -> None:
        """Skip a row that needs more time than is left, in addition to some time of overhead."""
        if self.left() <= seconds:
            raise _SkippedRowError(
                f"skipped, because {seconds:.3g} s of work do not fit into the remaining "
                f"{self.left():.3g} s of the {SECONDS:g} s for this part"
            )


class _SkippedRowError(Exception):
    """A row is not measured, for the reason in the text."""


@dataclass(frozen=True)
class _Row:
    """Rows of the table that are measured together, or skipped together.

    Parameters
    ----------
    name, unit, goal
        Identifier, unit and goal of a row that could not be measured.
    measure
        Measures the rows.
    """

    name: str
    unit: str
    goal: str
    measure: Callable[[], list[Result]]

    def results(self) -> list[Result]:
        """Return the measured rows, or a row with the reason."""
        try:
            return self.measure()
        except (_SkippedRowError, DeviceError) as reason:
            return [Result(self.name, None, self.unit, self.goal, None, str(reason))]
        except subprocess.TimeoutExpired:
            note = f"skipped, because the time limit of {SECONDS:g} s for this part was reached"
            return [Result(self.name, None, self.unit, self.goal, None, note)]
        except Exception as error:  # of any type, because other rows do not depend on it
            return [failed(self.name, error, self.unit, self.goal)]


def measured() -> Iterator[Result]:
    """Measure cases per second of a graphics processor, and check its results."""
    begin = time.perf_counter()
    try:
        device = find_device()
    except (DeviceError, ParameterError) as error:
        reason = str(error).replace(f", {OTHERWISE}", "")
        yield Result("gpu", None, "1", note=f"no row of this part was measured: {reason}")
        return
    yield Result(
        "gpu.start",
        time.perf_counter() - begin,
        "s",
        note=f"start of the driver and its context in one process on {device.label}",
    )
    clock = _Clock()
    run = braking_run(cast(MotorcycleParameters, parameters("dardanelli2010")), hard_braking)
    at_cores: dict[int, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        studies = _Studies(Path(folder), clock)
        rows = [
            _Row(
                "study.gpu_ratio",
                "times faster",
                f">= {RATIO:g}",
                partial(_relative_to_lanes, run, device.label),
            ),
            *(_ensemble_row(run, cases, at_cores, clock) for cases in ENSEMBLES),
            _study_row(STUDIES[0], studies),
            *(_longer_row(name, studies) for name in _LONGER),
            *(_study_row(cases, studies) for cases in STUDIES[1:]),
            _Row("gpu.study_service", "1/s", "", studies.with_service),
            _Row(
                "gpu.study_difference",
                "1",
                f"<= {DIFFERENCE:g}",
                studies.difference,
            ),
        ]
        for row in rows:
            yield from row.results()


# --- Ensembles


def _varied(run: Run, cases: int) -> dict[str, Array]:
    draw, leaves = np.random.default_rng(0), run.par.leaves()
    return {name: leaves[name] * draw.uniform(0.9, 1.1, cases) for name in VARIED}


def _relative_to_lanes(run: Run, label: str) -> list[Result]:
    many = _varied(run, THREADS)
    few = {name: values[:LANES] for name, values in many.items()}
    in_lanes = partial(simulate_ensemble, run, few, _SIGNALS, threads=1)
    there = partial(simulate_ensemble, run, many, _SIGNALS, engine="cuda")
    seconds = interleaved({"lanes": processor_timed(in_lanes), "gpu": timed(there)}, _ROUNDS)
    lanes, gpu = min(seconds["lanes"]) / LANES, min(seconds["gpu"]) / THREADS
    every = tuple(run.model.Output._fields)
    both = [simulate_ensemble(run, few, every, engine=each) for each in ("auto", "cuda")]
    return [
        at_least(
            "study.gpu_ratio",
            lanes / CORES / gpu,
            RATIO,
            "times faster",
            f"hard-braking runs per second on {label} ({THREADS} variations of {len(VARIED)} "
            "parameters, wall time, including transfer of the rows), relative to lanes on "
            f"{CORES} cores (from the processor time of {LANES} runs); {1e6 * gpu:.3g} us per "
            f"case, and {1e6 * lanes:.3g} us on one core",
        ),
        at_most(
            "study.gpu_difference",
            _largest_difference(*both),
            DIFFERENCE,
            "1",
            f"maximum difference of all {len(every)} signals of {LANES} runs between the two, "
            "relative to a signal's maximum",
        ),
    ]


def _largest_difference(ours: Ensemble, there: Ensemble) -> float:
    difference = np.abs(there.values - ours.values).max(axis=(0, 1))
    largest = np.abs(ours.values).max(axis=(0, 1))
    return float((difference / np.where(largest > 0.0, largest, 1.0)).max())


def _ensemble_row(run: Run, cases: int, at_cores: dict[int, float], clock: _Clock) -> _Row:
    goal = f">= {ENSEMBLE_RATE:g}" if cases == ENSEMBLES[-1] else ""
    measure = partial(_ensemble, run, cases, at_cores, clock)
    return _Row(f"gpu.ensemble_{cases}", "1/s", goal, measure)


def _ensemble(run: Run, cases: int, at_cores: dict[int, float], clock: _Clock) -> list[Result]:
    """Measure an ensemble with one fetched signal, its kernel alone, and lanes on all cores.

    ``at_cores``: cases per second of lanes by number of cases, which larger ensembles share.
    """
    clock.require()
    varied, beside = _varied(run, cases), min(cases, BESIDE)
    there = partial(simulate_ensemble, run, varied, _ONE, engine="cuda")
    with _timed_kernels() as kernels:
        both = []
        for _ in range(_ROUNDS + 1):  # the first one is a warm-up
            kernels.clear()
            both.append((timed(there)(), sum(kernels)))
    seconds, alone = map(min, zip(*both[1:], strict=True))
    if beside not in at_cores:
        few = {name: values[:beside] for name, values in varied.items()}
        lanes = timed(partial(simulate_ensemble, run, few, _ONE))
        at_cores[beside] = beside / min(interleaved({"lanes": lanes}, _ROUNDS)["lanes"])
    name, rate = f"gpu.ensemble_{cases}", cases / seconds
    note = (
        "hard-braking runs per second, wall time, with one fetched signal; "
        f"{at_cores[beside]:.3g} 1/s "
        f"in lanes on {worker_count()} cores ({beside} runs)"
    )
    result = (
        at_least(name, rate, ENSEMBLE_RATE, "1/s", note)
        if cases == ENSEMBLES[-1]
        else Result(name, rate, "1/s", note=note)
    )
    kernel = Result(
        f"gpu.kernel_{cases}", cases / alone, "1/s", note="same quantity, for the kernel alone"
    )
    return [result, kernel]


@contextmanager
def _timed_kernels() -> Iterator[list[float]]:
    """Yield the run times of all kernels in the block [s], each with the wait for its end."""
    seconds: list[float] = []
    plain = Memory.run

    def run(memory: Memory, *given: Any) -> None:
        begin = time.perf_counter()
        plain(memory, *given)
        seconds.append(time.perf_counter() - begin)

    with patch.object(Memory, "run", run):
        yield seconds


# --- Studies, as users start them


@dataclass
class _Compared:
    """Run times of a study [s], and its folders on the graphics processor and on all cores."""

    gpu: float
    cores: float
    folders: tuple[Path, Path] | None


class _Studies:
    """Studies on the graphics processor and on all cores, each in its own folder.

    Parameters
    ----------
    folder
        Folder of their files and results.
    clock
        Time limit.
    """

    def __init__(self, folder: Path, clock: _Clock) -> None:
        self._folder, self._clock = folder, clock
        self._rates: dict[str, float] = {}  # cases per second of all cores, by study
        self._compared: list[tuple[Path, Path]] = []

    def compared(self, study: Path, cases: int) -> _Compared:
        """Run a study on the graphics processor, and on all cores if there is enough time.

        Otherwise the time of all cores follows from the rate of a smaller study.
        """
        rate = self._rates.get(study.stem)
        if rate is None:  # kernels are built and kept
            for engine in ("cuda", "auto"):
                self._seconds(study, 1, engine, "--workers", "1")
        gpu, there = self._seconds(study, cases, "cuda")
        if rate is not None and cases / rate > self._clock.left():
            return _Compared(gpu, cases / rate, None)
        cores, here = self._seconds(study, cases, "auto")
        self._rates[study.stem] = cases / cores
        self._compared.append((there, here))
        return _Compared(gpu, cores, (there, here))

    def difference(self) -> list[Result]:
        """Return the maximum difference of all key figures of the compared studies."""
        if not self._compared:
            raise _SkippedRowError("skipped, because no study ran on both sides")
        largest = max(_difference(*map(_cases_in, both)) for both in self._compared)
        note = (
            f"maximum difference of a key figure between the two in {len(self._compared)} studies, "
            "relative to its maximum; infinite if a text differs"
        )
        return [at_most("gpu.study_difference", largest, DIFFERENCE, "1", note)]

    def file(self, name: str, text: str) -> Path:
        """Return a study file with a text."""
        path = self._folder / f"{name}.toml"
        path.write_text(text, encoding="utf-8")
        return path

    def with_service(self) -> list[Result]:
        """Measure the largest study with NVIDIA's multi-process service."""
        self._clock.require()
        with _service(self._folder) as changes:
            taken, _ = self._seconds(
                _TOLERANCES, STUDIES[-1], "cuda", name="service", changes=changes
            )
        note = (
            f"study of {STUDIES[-1]} cases as above, while NVIDIA's multi-process service lets the "
            f"kernels of several processes run at the same time: {taken:.3g} s"
        )
        return [Result("gpu.study_service", STUDIES[-1] / taken, "1/s", note=note)]

    def _seconds(
        self,
        study: Path,
        cases: int,
        engine: str,
        *more: str,
        name: str = "",
        changes: Mapping[str, str] = MappingProxyType({}),
    ) -> tuple[float, Path]:
        """Return the run time of a command [s], and its folder.

        ``name``: suffix of the folder; ``changes``: additional environment variables.
        """
        self._clock.require()
        out = self._folder / f"{study.stem}-{engine}-{cases}{name}"
        arguments = ("study", "run", str(study), "--out", str(out), "--cases", str(cases))
        line = python_command("-m", "bywire.cli", *arguments, "--engine", engine, *more)
        return seconds_of(line, self._clock.left(), changes), out


_CONTROL, _CONTROL_SECONDS = "nvidia-cuda-mps-control", 20.0


@contextmanager
def _service(folder: Path) -> Iterator[Mapping[str, str]]:
    """Run NVIDIA's multi-process service in a folder; yield the variables that select it."""
    program = shutil.which(_CONTROL)
    if program is None:
        raise _SkippedRowError(f"skipped, because {_CONTROL} is not installed")
    changes = {f"CUDA_MPS_{kind}_DIRECTORY": str(folder) for kind in ("PIPE", "LOG")}
    control = partial(
        subprocess.run,
        env={**os.environ, **changes},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        timeout=_CONTROL_SECONDS,
        check=True,
    )
    control([program, "-d"], stdin=subprocess.DEVNULL)
    try:
        yield changes
    finally:
        control([program], input="quit\n")


def _study_row(cases: int, studies: _Studies) -> _Row:
    goal = f">= {STUDY_RATE:g}" if cases == STUDIES[-1] else ""

    def measure() -> list[Result]:
        name = f"gpu.study_{cases}"
        made = studies.compared(_TOLERANCES, cases)
        rate, note = cases / made.gpu, _note(made, _TOLERANCES.name, cases)
        if goal:
            return [at_least(name, rate, STUDY_RATE, "1/s", note)]
        return [Result(name, rate, "1/s", note=note)]

    return _Row(f"gpu.study_{cases}", "1/s", goal, measure)


def _longer_row(name: str, studies: _Studies) -> _Row:
    def measure() -> list[Result]:
        bench, varied = _LONGER[name]
        lines = [f'bench = "{bench}"', "[vary]", *(f'"{n}" = "{v}"' for n, v in varied.items())]
        study = studies.file(name.partition(".")[2], "\n".join(lines) + "\n")
        made = studies.compared(study, CASES)
        note = _note(made, Path(bench).stem, CASES)
        return [at_least(name, made.cores / made.gpu, STUDY_RATIO, "times faster", note)]

    return _Row(name, "times faster", f">= {STUDY_RATIO:g}", measure)


def _note(made: _Compared, what: str, cases: int) -> str:
    how = "" if made.folders else ", from the rate of the smaller study"
    return (
        f"study of {cases} cases of {what} with all key figures, from command line to report: "
        f"{made.gpu:.3g} s, and {made.cores:.3g} s on {worker_count()} cores{how}"
    )


def _cases_in(folder: Path) -> pd.DataFrame:
    return StudyStore(folder).read(1 << 62)


def _difference(there: pd.DataFrame, here: pd.DataFrame) -> float:
    """Return the maximum difference of a column relative to its maximum; infinite for texts."""
    if list(there) != list(here) or len(there) != len(here):
        return float("inf")
    largest = 0.0
    for name in here:
        ours, given = here[name], there[name]
        if ours.dtype.kind == "O" or name == CASE:
            largest = max(largest, 0.0 if ours.equals(given) else float("inf"))
        elif not ours.isna().equals(given.isna()):
            return float("inf")
        elif ours.notna().any():
            scale = float(ours.abs().max()) or 1.0
            largest = max(largest, float((given - ours).abs().max()) / scale)
    return largest


PART = Part("graphics processor", measured)
