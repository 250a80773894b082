"""The energy balance of whole runs closes with second order, and reveals a wrong sign."""

from __future__ import annotations

from dataclasses import replace
from functools import wraps
from types import ModuleType

import numpy as np
import pytest
import xarray as xr

from bywire.bench.bench import Bench
from bywire.bench.energy_ledger import energy_residual
from bywire.bench.experiment import as_run
from bywire.bench.recording import record
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.plant import battery_supply, caliper, dc_motor, master_cylinder, pipeline
from bywire.simulation.run import simulate

BRAKING = ("hard-braking", {"settle": 0.2, "duration": 0.6})
RELEASE = ("pressure-release", {"settle": 0.1, "duration": 0.8})
"""to the end stop, with makeup flow"""
LOSSES = ("E_supply", "E_copper", "E_gear", "E_seal", "E_damping", "E_pipeline", "E_stop")


def recorded(
    experiment: tuple[str, dict[str, float]],
    step: float,
    brake: type | None = None,
    law: str = "directional",
) -> xr.Dataset:
    """Return the recording of an experiment, with the gear that never gives energy by default."""
    name, options = experiment
    bench = Bench(name, "dardanelli2010", {"gear.law": law}, options, step=step)
    case = bench.cases()[0]
    run = as_run(case if brake is None else replace(case, model=brake()), step)
    return record(run, simulate(run), case.settle, case.keep, {})


def worst(recording: xr.Dataset) -> float:
    """Return the largest residual as a share of the energy put in."""
    put_in = float(recording["E_source"].max() - recording["E_source"][0])
    return float(np.abs(energy_residual(recording)).max()) / put_in


@pytest.mark.parametrize("experiment", [BRAKING, RELEASE], ids=lambda e: e[0])
def test_residual_falls_with_the_square_of_the_step(
    experiment: tuple[str, dict[str, float]],
) -> None:
    steps = np.array([40e-6, 20e-6, 10e-6, 5e-6])
    recordings = [recorded(experiment, h) for h in steps]
    residuals = np.array([worst(r) for r in recordings])
    assert residuals[1] < 2e-11
    assert np.polyfit(np.log(steps), np.log(residuals), 1)[0] == pytest.approx(2.0, abs=0.15)
    if experiment is RELEASE:
        assert recordings[1]["at_stop"].max() == 1.0
        assert recordings[1]["q_makeup"].max() > 1e-7
        assert all(r["p_mc"].min() == 0.0 for r in recordings)


@pytest.mark.parametrize("experiment", [BRAKING, RELEASE], ids=lambda e: e[0])
def test_losses_never_return(experiment: tuple[str, dict[str, float]]) -> None:
    """Where the shaft reverses within a substep, friction takes the direction of its end.

    The substep's midpoint may still move the other way, by half of what the friction changes the
    speed by: the dry losses T_fr omega h can then fall by T_fr (T_fr h / (2 J)) h, and no more.
    """
    step = 20e-6
    recording = recorded(experiment, step)
    inertia = 3e-5
    dip = 2.0 * (float(np.abs(recording["T_fr"]).max()) * step) ** 2 / (2.0 * inertia)
    for name in LOSSES:
        energy = recording[name].values
        rounding = 1e-14 * float(recording["E_source"].max())
        slack = rounding + (dip if name in ("E_gear", "E_seal") else 0.0)
        assert np.diff(energy).min() > -slack, name
    assert dip < 1e-5 * float(recording["E_seal"].max())
    assert all(recording[n].max() > 0.0 for n in LOSSES if n != "E_stop")


def test_the_paper_s_gear_gives_energy() -> None:
    """The check above would reject its constant efficiency."""
    recording = recorded(RELEASE, 20e-6, law="paper")
    assert np.diff(recording["E_gear"].values).min() < -1e-5
    assert worst(recording) < 2e-11


@pytest.mark.parametrize(
    ("element", "name", "factor"),
    [
        (dc_motor, "power_loss", -1.0),
        (battery_supply, "power_loss", -1.0),
        (pipeline, "power_loss", -1.0),
        (master_cylinder, "power_loss", -1.0),
        (caliper, "energy", 1.01),
    ],
)
def test_a_wrong_sign_shows(
    element: ModuleType, name: str, factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each loss with its sign turned, and a stored energy off by one per cent."""
    right = getattr(element, name)
    monkeypatch.setattr(element, name, wraps(right)(lambda *args: factor * right(*args)))
    wrong = type("WronglyBooked", (MotorcycleBrake,), {})  # a type of its own is built anew
    assert worst(recorded(BRAKING, 20e-6, wrong)) > 1e-5
