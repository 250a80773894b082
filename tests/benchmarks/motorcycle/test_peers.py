"""The peers solve the problem that bywire solves."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from importlib.util import find_spec
from multiprocessing import get_context
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from benchmarks.motorcycle import cvodes, diffrax, lsoda, pathsim
from benchmarks.motorcycle.problem import (
    SCALE,
    Solution,
    braking_run,
    error,
    hard_braking,
    rates,
    reference,
    rest,
)
from benchmarks.motorcycle.symbolic import slope_and_jacobian
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.catalog import PARAMETER_SETS
from bywire.simulation.run import simulate

SHORT = 0.03
WIDTH = 3e-4


@pytest.fixture(scope="module")
def par() -> MotorcycleParameters:
    found = PARAMETER_SETS.find("dardanelli2010").parameters()
    assert isinstance(found, MotorcycleParameters)
    return found


def state(**changes: float) -> Any:
    x = MotorcycleBrake.State(
        i=3.0,
        theta=25.0,
        omega=4.0,
        p_mc=2e6,
        p_pd=1.9e6,
        y_p=0.4,
        y_i=0.6,
        T_winding=293.15,
        T_housing=293.15,
    )
    return np.array(x._replace(**changes)) / SCALE


def apart(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a function computes in a process of its own.

    JAX starts threads, and warns whenever a process with them is copied, as other tests do.
    """
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


def solved(peer: str) -> Solution:
    """Return the braking as a peer solves it."""
    par = PARAMETER_SETS.find("dardanelli2010").parameters()
    return import_module(peer).solve(par, hard_braking, SHORT)


@pytest.mark.parametrize("peer", [cvodes, lsoda, diffrax, pathsim])
def test_peer_follows_bywire(peer: ModuleType, par: MotorcycleParameters) -> None:
    if not peer.available():
        pytest.skip("not installed")
    exact = reference(par, hard_braking, SHORT)
    solution = apart(solved, peer.__name__) if peer is diffrax else solved(peer.__name__)
    assert solution.time.size == round(SHORT / par.ecu.T_s) + 1
    assert solution.seconds > 0.0
    assert exact.p_mc[-1] > 2e4
    assert error(solution, exact) < 1e-3


def test_a_wide_friction_is_seen_as_an_error(par: MotorcycleParameters) -> None:
    exact = reference(par, hard_braking, SHORT)
    assert error(cvodes.solve(par, hard_braking, SHORT, width=1.0), exact) > 3e-3


def test_bywire_at_20_us_is_near_its_own_reference(par: MotorcycleParameters) -> None:
    done = simulate(braking_run(par, hard_braking, SHORT), ("p_mc",))
    assert error(Solution(done.time, done["p_mc"], 0.0), reference(par, hard_braking, SHORT)) < 1e-3


@pytest.mark.parametrize("omega", [4.0, 1e-4, 0.0, -1e-4, -4.0])
def test_rates_agree_between_floats_and_symbols(omega: float, par: MotorcycleParameters) -> None:
    slope, jacobian = slope_and_jacobian(par, WIDTH)
    z = state(omega=omega)
    np.testing.assert_allclose(slope(z, 0.3), rates(z.tolist(), 0.3, par, WIDTH), rtol=1e-9)
    step = 1e-7 * np.eye(z.size)
    columns = [(slope(z + s, 0.3) - slope(z - s, 0.3)) / 2e-7 for s in step]
    if omega != 0.0:
        scale = np.abs(jacobian(z, 0.3)).max()
        np.testing.assert_allclose(jacobian(z, 0.3), np.array(columns).T, atol=1e-3 * scale)


def traced_rates(par: MotorcycleParameters) -> Any:
    """Return the rates as JAX compiles them."""
    import jax

    from benchmarks.peers.traced import Traced, stacked

    def traced(z: Any) -> Any:
        return stacked(rates([Traced(entry) for entry in z], 0.3, par, WIDTH))

    with jax.enable_x64(True):
        return np.asarray(jax.jit(traced)(jax.numpy.asarray(state())))


@pytest.mark.skipif(find_spec("jax") is None, reason="not installed")
def test_traced_rates_agree_with_floats(par: MotorcycleParameters) -> None:
    found = apart(traced_rates, par)
    np.testing.assert_allclose(found, rates(state().tolist(), 0.3, par, WIDTH), rtol=1e-9)


def test_rest_has_no_pressure_and_reads_ambient(par: MotorcycleParameters) -> None:
    x = rest(par)
    assert (x.p_mc, x.omega, x.y_i) == (0.0, 0.0, 0.5)
    assert x.y_p == pytest.approx(par.fluid.p_atm / 50e5)
