"""The caliper of examples/, loaded as its user would, for the tests of this folder."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import xarray as xr

import bywire as toolkit
from bywire.bench.experiment import as_run
from bywire.cli.main import main
from systems.loading import loaded

CALIPER = Path(__file__).parents[3] / "examples" / "emb_caliper"
SET = "emb42v"


@pytest.fixture(scope="module", autouse=True)
def caliper() -> Iterator[Path]:
    with loaded(CALIPER):
        yield CALIPER


@pytest.fixture
def emb(caliper: Path) -> Callable[[str], ModuleType]:
    """Return a function that gives a module of the caliper's package."""
    return lambda name: importlib.import_module(f"emb_caliper.{name}")


@pytest.fixture
def par(caliper: Path) -> Any:
    return toolkit.parameters(SET)


@pytest.fixture
def run(caliper: Path) -> Callable[..., xr.Dataset]:
    """Return a function that runs an experiment, and gives its recording."""

    def call(experiment: str, overrides: Any = None, **options: Any) -> xr.Dataset:
        bench = toolkit.Bench(experiment, SET, overrides or {}, options)
        return toolkit.run(bench).recordings["run"]

    return call


@pytest.fixture
def hold(emb: Callable[[str], ModuleType], par: Any) -> Callable[..., xr.Dataset]:
    """Return a function that drives the motor with a constant current from a clamp force."""

    def call(F: float, i: float, duration: float = 0.5, step: float = 20e-6) -> Any:
        case = emb("case").case_from_rest(
            par, "current", F, lambda t: {"i_set": np.full(t.shape, i)}, duration
        )
        return toolkit.simulate(as_run(case, step))

    return call


@pytest.fixture
def command(
    caliper: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., tuple[int, str, str]]:
    """Return a function that calls ``bywire`` with the caliper loaded."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["bywire", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        code = ended.value.code
        said = capsys.readouterr()
        return (code if isinstance(code, int) else 0), said.out, said.err

    return call
