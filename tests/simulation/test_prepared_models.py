"""Many threads share the objects that are built once per structure, which distinguish models."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bywire.simulation import case_kernels, ensemble, native, sensitivity
from bywire.simulation.compiler import load_library
from bywire.simulation.engine import prepare
from bywire.simulation.run import Run, simulate
from systems.nonlinear_drive import PARAMETERS, Memory, NonlinearDrive, State


class Tabulated(NonlinearDrive):
    """A drive whose drag is an entry of a long table."""

    def __init__(self, table: np.ndarray) -> None:
        self.table = table

    def balance(self, x, xe, m, par, contact):
        plain = super().balance(x, xe, m, par, contact)
        return plain._replace(omega=plain.omega - float(self.table[500]) * x.omega)


def drive(model: NonlinearDrive, R: float = 0.5) -> Run:
    return Run(
        model,
        PARAMETERS.replace({"R": R}),
        State(0.0, 0.0, 0.0),
        Memory(6.0),
        lambda t: np.full((t.size, 1), 6.0),
        0.05,
    )


def test_models_differ_by_what_they_hold() -> None:
    tables = [np.zeros(2000), np.zeros(2000)]
    tables[1][500] = 0.05
    first, second = (simulate(drive(Tabulated(t)))["omega"] for t in tables)
    assert np.abs(first - second).max() > 0.1


def test_equal_models_are_built_once() -> None:
    run = drive(Tabulated(np.zeros(2000)))
    again = drive(Tabulated(np.zeros(2000)))
    assert prepare(run.model, run.par) is prepare(again.model, again.par)


def test_threads_that_ask_at_once_compile_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """For single runs, lanes and derivatives alike."""
    run, compiled = replace(drive(Tabulated(np.full(2000, 0.01))), duration=1e-3), []

    def slow(source: str, *others: Any) -> Any:
        compiled.append(source)
        time.sleep(0.1)
        return load_library(source, *others)

    for module in (native, case_kernels, sensitivity):
        monkeypatch.setattr(module, "load_library", slow)
    for wanted in (
        lambda _: simulate(run, ["omega"]),
        lambda _: ensemble.simulate_ensemble(run, {"R": [0.5, 0.6]}, ["omega"]),
        lambda _: sensitivity.simulate_with_sensitivities(run, ["R"], ["omega"]),
    ):
        compiled.clear()
        with ThreadPoolExecutor(4) as pool:
            list(pool.map(wanted, range(4)))
        assert len(compiled) == 1


def test_threads_do_not_disturb_each_other() -> None:
    runs = [replace(drive(NonlinearDrive(), R), duration=0.02) for R in (0.3, 0.4, 0.5, 0.6)]
    for engine in ("virtual-machine", "auto"):
        alone = [simulate(run, engine=engine).values for run in runs]
        with ThreadPoolExecutor(4) as pool:
            together = list(pool.map(lambda r, e=engine: simulate(r, engine=e).values, runs))
        for a, b in zip(alone, together, strict=True):
            np.testing.assert_array_equal(a, b)
