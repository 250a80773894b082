"""A user's own brake at a wheel, with public names only."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import bywire
from bywire.plant import drum
from systems.loading import loaded

FILE = Path(__file__).parents[2] / "examples" / "drum_on_a_wheel.py"


@pytest.fixture(scope="module")
def result():
    with loaded(FILE):
        yield bywire.run("drum-stop")


def test_it_imports_public_names_only():
    nodes = ast.walk(ast.parse(FILE.read_text()))
    modules = [node.module for node in nodes if isinstance(node, ast.ImportFrom)]
    own = {"bywire.authoring", "bywire.plant", "bywire.vehicle"}
    assert {m for m in modules if m.startswith("bywire")} == own


def test_the_stopping_distance_follows_from_the_work_of_the_brake(result):
    run = result.recording
    par = result.bench.par
    v_0, r, m = 22.2, par.wheel.r, par.corner.body.m
    kinetic = 0.5 * m * v_0**2 + 0.5 * par.wheel.J * (v_0 / r) ** 2
    out = float(run["E_brake"][-1] + run["E_tyre"][-1])
    assert out == pytest.approx(kinetic, rel=1e-6)
    assert float(run["omega"][-1]) == 0.0


def test_the_torque_is_that_of_the_drum(result):
    par = result.bench.par
    closed = drum.output(drum.Input(par.A_cylinder * 50e5, 1.0), par.drum).T_p
    rolling = par.wheel.C_rr * par.corner.body.m * par.corner.body.g * par.wheel.r
    steady = result.recording["torque"].sel(time=2.0, method="nearest")
    assert float(steady) == pytest.approx(closed + rolling, rel=1e-6)


def test_every_contract_holds(result):
    assert bywire.check("drum-on-a-wheel").holds
