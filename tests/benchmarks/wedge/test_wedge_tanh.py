"""Tanh friction with explicit steps: the same brake, and what the regularization costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.wedge import wedge_brake
from benchmarks.wedge.tanh_rk4 import SIGNALS, Solution, solve
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.catalog import parameters
from bywire.simulation.compiler import find_compiler
from bywire.simulation.run import Run, simulate

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

FRICTIONLESS = {
    "bearing.C_0": 0.0,
    "bearing.C_2": 0.0,
    "bearing.T_nu": 0.0,
    "screw.eta_f": 1.0,
    "screw.eta_b": 1.0,
    "wedge_friction.mu_int": 0.0,
    "wedge_friction.mu_R": 0.0,
}


def brake(changes: dict[str, float] | None = None) -> WedgeParameters:
    par = parameters("roberts2003").replace({"encoder.law": "ideal", **(changes or {})})
    assert isinstance(par, WedgeParameters)
    return par


def short(changes: dict[str, float] | None = None) -> Run:
    return replace(wedge_brake.fig7(brake(changes)), duration=0.2)


def errors(run: Run, solution: Solution) -> tuple[float, float]:
    """Return the rms errors of wedge travel [m] and shown moment [N m]."""
    exact = simulate(replace(run, step=wedge_brake.FINE), SIGNALS)
    x, y_M = (
        float(np.sqrt(np.mean((found - exact[name]) ** 2)))
        for found, name in zip(solution, SIGNALS, strict=False)
    )
    return x, y_M


def test_without_friction_it_is_the_same_brake() -> None:
    """The difference is the reference's error. A contact 1 % stiffer would be detected."""
    run = short(FRICTIONLESS)
    x, y_M = errors(run, solve(run, 0.1, 1e-4, 5e-6))
    assert x < 1e-12
    assert y_M < 1e-6
    other = short(FRICTIONLESS | {"heart.K_W": 40.4e6})
    assert errors(run, solve(other, 0.1, 1e-4, 5e-6))[0] > 1e-10


def test_error_falls_with_the_width_and_time_rises() -> None:
    run = short()
    wide, narrow = solve(run, 0.3, 1e-4, 1e-5), solve(run, 0.03, 1e-5, 1e-6)
    for theirs, less in zip(errors(run, wide), errors(run, narrow), strict=True):
        assert less < 0.5 * theirs
    assert narrow.seconds > 4.0 * wide.seconds


def test_results_of_the_benchmark(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wedge_brake, "_ROUNDS", 1)
    found = [*wedge_brake.single(brake()), *wedge_brake.regularized(brake())]
    assert [r.id for r in found] == [
        "wedge.single.hand_c",
        "wedge.single.realtime_factor",
        "wedge.peer.tanh_rk4",
    ]
    assert "tanh of 0.03 rad/s" in found[-1].note
