"""The reservoir port in runs: with a dead stroke, a released brake is vented."""

from __future__ import annotations

from typing import Any

import pytest

import bywire
from bywire.bench.energy_ledger import energy_residual
from bywire.plant import reservoir_port
from run_once import run_once

DEAD = {"port.law": "dead-stroke"}


def released(overrides: dict[str, Any]) -> Any:
    bench = bywire.Bench("pressure-release", "dardanelli2010", overrides, {"duration": "1 s"})
    return run_once(bench).recording


def test_port_is_open_at_the_retracted_end_and_closed_after_its_stroke() -> None:
    par = reservoir_port.Parameters(law="dead-stroke", x_port=1e-3, G_port=1e-11)
    strokes = (-1e-5, 0.0, 0.5e-3, 1e-3, 3e-3)
    G = [reservoir_port.output(reservoir_port.Input(x, 1e5), par).G for x in strokes]
    assert pytest.approx([1e-11, 1e-11, 0.5e-11, 0.0, 0.0]) == G


def test_residual_pressure_vents_through_the_dead_stroke() -> None:
    held, vented = released({}), released(DEAD)
    assert float(held["p_pd"][-1]) > 0.1e5
    assert float(vented["p_pd"][-1]) < 1.0
    assert float(held["E_port"][-1]) < 1e-9
    assert float(vented["E_port"][-1]) > 1e-5
    spent = float(vented["E_source"].max() - vented["E_source"][0])
    assert float(abs(energy_residual(vented)).max()) < 1e-6 * spent


def test_piston_travels_the_dead_stroke_before_it_brakes() -> None:
    options = {"p_from": "0.5 bar", "p_to": "10 bar", "duration": "0.6 s", "settle": "0 s"}

    def travel(overrides: dict[str, Any]) -> float:
        bench = bywire.Bench("hard-braking", "dardanelli2010", overrides, options)
        run = run_once(bench).recording
        return float(run["x_mc"][int((run["p_mc"] > 8e5).argmax("time"))])

    assert travel(DEAD) - travel({}) == pytest.approx(0.8e-3, abs=0.25e-3)
