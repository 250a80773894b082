"""Every structural choice of the motorcycle brake runs, has an effect and conserves energy."""

from __future__ import annotations

import typing
from functools import cache
from typing import Any

import numpy as np
import pytest
import xarray as xr

from bywire.bench.energy_ledger import energy_residual
from bywire.bench.experiment import as_run
from bywire.bench.recording import record
from bywire.brakes.motorcycle.case import Signals, case_from_rest
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import DriveMode, MotorcycleParameters
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.parameters import choice_fields
from bywire.core.signals import signals_of
from bywire.simulation.compiler import find_compiler
from bywire.simulation.run import simulate

DURATION, STEP, COARSE = 0.4, 20e-6, 50e-6
# A measured curve bends little from node to node. A node is crossed within a substep, not at its
# end: that costs the energy balance the jump of the slope times p times the substep's change of p.
PRESSURES = (0.0, 1e5, 2e5, 4e5, 6e5, 9e5, 12e5, 16e5, 20e5, 30e5, 60e5)
VOLUMES = tuple(1.1e-13 * p * (1.0 - 0.4 * p / (p + 20e5)) for p in PRESSURES)
CHOICES: dict[str, dict[str, Any]] = {
    "gear.law": {"directional": {}},
    "caliper.law": {
        "compressible": {},
        "table": {"caliper.p_table": PRESSURES, "caliper.V_table": VOLUMES},
    },
    "caliper.leak": {"leaking": {"caliper.G_leak": 1e-13}},
    "piston.law": {"sticking": {"piston.F_fr": 60.0, "piston.rollback": 0.5}},
    "fluid.air": {"entrained": {"fluid.V_air": 2e-8}, "caliper": {"fluid.V_air": 2e-8}},
    "port.law": {"dead-stroke": {}, "leaking": {"port.G_port": 1e-13}},
    "pressure_sensor.place": {"mid-pipeline": {}},
    "adc.law": {"ideal": {}},
    "ecu.schedule.law": {"regions": {"ecu.schedule.low.k_p": 2e-5, "ecu.schedule.low.k_i": 2e-4}},
    "caliper.fluid_heat": {"warming": {"caliper.T_rate": 2.0}},
    "ecu.derating.law": {"current": {"ecu.derating.T_a_hat": 417.0}},
    "motor_heat.law": {"lumped": {"motor_heat.C_w": 0.02}},
    "ecu.filter.place": {"before-dither": {}},
    "ecu.dither.waveform": {"off": {}, "square": {}, "triangle": {}},
    "drive.mode": {
        "pedal": {},
        "current": {},
        "current-direct": {},
        "voltage-source": {},
        "current-source": {},
    },
}
CASES = [("", "")] + [(name, value) for name, values in CHOICES.items() for value in values]


def stimulus(t: np.ndarray) -> Signals:
    """Return a brake application and its release for any mode."""
    on = np.where((t >= 0.05) & (t < 0.25), 1.0, 0.0)
    return {"p_set": 20e5 * on, "pedal_force": 150.0 * on, "i_set": 4.0 * on, "v_set": 2.5 * on}


@cache
def recorded(name: str, value: str, engine: str = "auto", step: float = STEP) -> xr.Dataset:
    base = PARAMETER_SETS.find("dardanelli2010").parameters()
    assert isinstance(base, MotorcycleParameters)
    changes = {name: value, **CHOICES[name][value]} if name else {}
    mode: DriveMode = changes.pop("drive.mode", "pressure")
    case = case_from_rest("run", base, mode, 0.0, stimulus, DURATION, changes)
    run = as_run(case, step)
    return record(run, simulate(run, engine=engine), 0.0, 0.0, {})


def test_no_choice_is_forgotten() -> None:
    base = PARAMETER_SETS.find("dardanelli2010").parameters()
    for name in choice_fields(MotorcycleParameters):
        options: Any = MotorcycleParameters
        for part in name.split("."):
            options = options.model_fields[part].annotation
        assert {*CHOICES[name], base.flat()[name]} == set(typing.get_args(options)), name


@pytest.mark.parametrize(("name", "value"), CASES[1:])
def test_choice_matters(name: str, value: str) -> None:
    default, other = recorded("", ""), recorded(name, value)
    assert float(abs(default["p_mc"]).max()) > 5e5
    assert float(abs(other["p_mc"]).max()) > 5e5
    assert float(abs(other["p_mc"] - default["p_mc"]).max()) > 10.0


@pytest.mark.parametrize(("name", "value"), CASES)
def test_run_settles_and_its_energy_balance_closes(name: str, value: str) -> None:
    run = recorded(name, value)
    assert (run.attrs["status"], run.attrs["unsettled_substeps"]) == ("done", 0)
    spent = float(run["E_source"].max() - run["E_source"][0])
    assert float(abs(energy_residual(run)).max()) < 1e-6 * spent


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
@pytest.mark.parametrize(("name", "value"), CASES)
def test_engines_agree(name: str, value: str) -> None:
    compiled, slow = (
        recorded(name, value, engine, COARSE) for engine in ("compiled", "virtual-machine")
    )
    assert compiled.attrs["engine"] != slow.attrs["engine"]
    known = signals_of(MotorcycleBrake.Output)
    for signal in map(str, compiled.data_vars):
        size = float(abs(compiled[signal]).max())
        # The force of a stop is its stiffness times an overlap with an error of 1e-18 m: 2e-11 N.
        rounding = 1e-12 * max(known[signal].nominal, 1.0)
        difference = float(abs(slow[signal] - compiled[signal]).max())
        assert difference <= 1e-9 * size + rounding, signal
