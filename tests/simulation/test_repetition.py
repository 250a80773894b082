"""Windows that run in parts: bit-identical to a single part, and quickly ended by Ctrl-C."""

from __future__ import annotations

import signal
import sys
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

from bywire.analysis.loop import LOOPS
from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.sweep import Sweep
from bywire.core.catalog import parameters
from bywire.core.errors import SolverError
from bywire.core.interrupts import thread_pool
from bywire.simulation import repetition as part
from bywire.simulation.repetition import Repeated, repeat
from bywire.simulation.run import Run


def position(*frequencies: float) -> tuple[Run, Sweep]:
    """Return the position loop of a single screw, and what to measure in it."""
    loop = LOOPS.find("screw-position")
    point = loop.point(parameters("roberts2003"), loop.at.default)
    whole = loop.whole(point.par)
    return point.run(), Sweep(loop.inputs, loop.output, frequencies, [0.25], whole=whole)


def window(*, lanes: bool = True) -> Repeated:
    """Return some windows of 48 ms at rest in one place."""
    run, _ = position()
    run = replace(run, duration=0.048, record=1e-3)
    rows = run.schedule().stimulus_times.size - 1
    stimuli = np.repeat(run.stimulus(np.zeros(1)), rows, axis=0)[None]
    stimuli += 0.5 * np.sin(2.0 * np.pi * np.arange(rows) / rows)[None, :, None]
    matrix = np.array(list(run.par.leaves().values()))[:, None]

    def figures(found: NDArray[np.float64]) -> NDArray[np.complex128]:
        return found[:, :, 0].astype(complex)

    return repeat(run, matrix, stimuli, ("theta_1", "omega_1"), figures, 1e-9, 3, lanes=lanes)


@pytest.mark.parametrize("lanes", [True, False])
def test_parts_of_a_window_change_no_bit(monkeypatch, lanes):
    monkeypatch.setattr(part, "CHUNK", 10**9)
    whole = window(lanes=lanes)
    monkeypatch.setattr(part, "CHUNK", 350)  # 7 rows of 50 substeps, which leave 6 of 48
    parts = window(lanes=lanes)
    assert np.ptp(whole.values[0, :, 0]) > 0.01
    np.testing.assert_array_equal(parts.values, whole.values)
    np.testing.assert_array_equal(parts.figures, whole.figures)


def test_what_a_stopped_thread_repeats_ends():
    begun, ended = threading.Event(), list[BaseException]()

    def repeated() -> None:
        begun.wait()
        time.sleep(0.05)  # until the pool is left
        try:
            window()
        except BaseException as error:
            ended.append(error)

    def fails() -> None:
        with thread_pool(1) as pool:
            pool.submit(repeated)
            begun.set()
            raise SolverError("another thread failed")

    with pytest.raises(SolverError):
        fails()
    assert [type(error) for error in ended] == [KeyboardInterrupt]


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_interrupt_ends_a_long_sweep_within_a_moment():
    """All of these windows take a minute, each of them some seconds."""
    frequency_response(*position(50.0))  # the kernel is built
    run, sweep = position(*np.geomspace(0.1, 0.2, 12))
    sent: list[float] = []

    def interrupt() -> None:
        sent.append(time.monotonic())
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    timer = threading.Timer(1.0, interrupt)
    timer.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            frequency_response(run, sweep)
    finally:
        timer.cancel()
    assert time.monotonic() - sent[0] < 2.0


def test_a_case_ends_by_itself_and_gives_its_lane_to_the_next():
    """More cases than lanes with different numbers of windows: bit-identical to single cases."""
    run, sweep = position(50.0)
    sweep = replace(sweep, amplitudes=[0.02 * 1.4**k for k in range(19)], tolerance=3e-3)
    together = frequency_response(run, sweep)
    assert len(set(together["windows"].values.ravel())) > 1
    xr.testing.assert_identical(together, frequency_response(run, sweep, lanes=False))
