"""Dry losses of gear and seals are separated, also if both are zero."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bywire.bench.energy_ledger import energy_residual
from bywire.bench.experiment import as_run
from bywire.bench.recording import record
from bywire.brakes.motorcycle.case import Signals, case_from_rest
from bywire.core.catalog import PARAMETER_SETS
from bywire.simulation.run import simulate


def pulse(t: np.ndarray) -> Signals:
    """Return a current that applies the brake for 0.2 s."""
    return {"i_set": np.where((t >= 0.1) & (t < 0.3), 4.0, 0.0)}


def recorded(**changes: float) -> xr.Dataset:
    par = PARAMETER_SETS.find("dardanelli2010").parameters()
    own = {"gear.law": "directional", **{k.replace("__", "."): v for k, v in changes.items()}}
    case = case_from_rest("run", par, "current-source", 0.0, pulse, 0.5, own)  # type: ignore[arg-type]
    run = as_run(case, 20e-6)
    return record(run, simulate(run), 0.0, 0.0, {})


@pytest.mark.parametrize("mu_T", [2e-7, 0.0])
def test_run_from_zero_pressure_without_preload_closes(mu_T: float) -> None:
    run = recorded(seal__T_pr=0.0, seal__mu_T=mu_T)
    assert run.attrs["status"] == "done"
    assert float(run["p_mc"].max()) > 10e5
    spent = float(run["E_source"].max())
    assert float(abs(energy_residual(run)).max()) < 1e-10 * spent
    for name in ("E_gear", "E_seal"):
        assert float(run[name][-1]) > 0.01
        assert np.diff(run[name].values).min() >= 0.0


def test_without_any_dry_friction_nothing_is_lost_in_it() -> None:
    run = recorded(
        seal__T_pr=0.0, seal__mu_T=0.0, seal__f_cfr_p=0.0, seal__f_cfr_n=0.0, gear__eta_g=1.0
    )
    assert float(abs(run["E_gear"]).max()) == 0.0
    assert float(abs(run["E_seal"]).max()) == 0.0
    assert float(abs(energy_residual(run)).max()) < 1e-10 * float(run["E_source"].max())
