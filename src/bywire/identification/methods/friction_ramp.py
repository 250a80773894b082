"""Friction from a slow current ramp up and down (2010, eqs. 16 and 17, Fig. 4)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Annotated

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from pydantic import Field

from bywire.assemblies.motorcycle_parameters import MotorcycleParameters
from bywire.bench.experiments import friction_ramp
from bywire.bench.running import as_run
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration, Pressure, Unit
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.method import Check, Curve, Effort, Identified, Method
from bywire.identification.multistart import search
from bywire.identification.output_error import even_interval
from bywire.identification.replay import replayed
from bywire.identification.slip_shooting import Shooting, Shot, cut_out
from bywire.identification.slips import Slip, find_slips, noise_of
from bywire.identification.stribeck_band import stribeck_band
from bywire.identification.unknown import parameters_of, scattered
from bywire.simulation.run import simulate

Array = NDArray[np.float64]

_NAMES = ("T_pr", "f_cfr_p", "f_cfr_n", "k_brk_p", "k_brk_n", "c", "mu_T")
_LIMIT_REPLAY, _LIMIT_RESIDUAL = 0.1, 5.0


class Options(ParameterSet):
    """What counts as a slip, and how sure measurements are."""

    least: Pressure
    """changes of pressure smaller than this are no slips"""
    longest: Duration
    """how much of a slip is compared"""
    scatter: Current
    """standard deviation of the current at which the piston breaks away"""
    sigma_p: Annotated[float, Unit("Pa", 2e3), Field(ge=0)]
    """noise of the pressure in synthetic measurements"""
    step: Duration
    """substep of the slips' runs"""


def identify(
    data: xr.Dataset, par: MotorcycleParameters, options: Options, effort: Effort
) -> Identified:
    """Return the friction's parameters, T_pr among them.

    Parameters
    ----------
    data
        ``i``: measured motor current [A]; ``p_mc``: pressure [Pa]. The demand in place of the
        current biases the estimates: while the shaft turns quickly the current lags behind it.

    Raises
    ------
    ParameterError
        When the record has no slip to learn from.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), section 4.1; the loss is ours, see ``slip_shooting``.
    """
    t, p = data["time"].values, data["p_mc"].values
    i = data["i"].values
    slips = find_slips(p, even_interval(t), options.least)
    if not slips:
        raise ParameterError(
            f"the pressure shows no slip of more than {options.least / 1e5:g} bar: friction cannot "
            "be learned from it; ramp the current slowly, up and down, without dither"
        )
    shots = cut_out(t, p, i, slips, options.longest)
    unknowns = parameters_of(par, [f"seal.{name}" for name in _NAMES])
    sigma = max(noise_of(p), 1.0)
    shooting = Shooting(par, unknowns, options.step)
    problem = Problem(unknowns, partial(_residuals, shooting, shots, sigma, options.scatter))
    starts = scattered(unknowns, effort.starts, effort.spread, effort.seed)
    found = search(problem, starts, "linear", effort.progress, effort.store, effort.threads)
    best = estimate(problem, start=found.best.values)
    values = best.parameters()
    own = par.replace(values)
    whole = _replay(data, own, options.step)
    error = whole["modeled"] - whole["measured"]
    nrmse = float(np.sqrt((error**2).mean()) / (p.max() - p.min()))
    notes = [_counted(slips), f"{found.reached} of {effort.starts} starts reached the minimum"]
    return Identified(
        estimates={"seal friction": best},
        parameters=values,
        checks=(
            Check("residual_over_noise", best.rms, limit=_LIMIT_RESIDUAL,
                  note="aligned slips: residual over the sensor's noise"),
            Check("replay_nrmse", nrmse, limit=_LIMIT_REPLAY,
                  note="whole ramp, computed less measured, over the range"),
            Check("starts_at_minimum", found.reached / effort.starts),
        ),
        curves=(
            Curve("ramp", "Pressure on the ramp: measured, and modeled with the estimates.",
                  whole, "time"),
            _stribeck(own, best),
        ),
        notes=tuple(notes),
    )  # fmt: skip


def _residuals(
    shooting: Shooting, shots: list[Shot], sigma: float, scatter: float, values: Array
) -> tuple[Array, Array]:
    """Return what the slips' shapes and their breakaway currents say, weighted."""
    residuals, slopes, breakaway, breakaway_slopes = [], [], [], []
    for shot in shots:
        one = shooting.fit(shot, values)
        residuals.append(one.residuals / sigma)
        slopes.append(one.slopes / sigma)
        breakaway.append(one.breakaway / scatter)
        breakaway_slopes.append(one.breakaway_slopes / scatter)
    return np.concatenate((*residuals, breakaway)), np.vstack((*slopes, *breakaway_slopes))


def _counted(slips: Sequence[Slip]) -> str:
    up = sum(s.direction > 0 for s in slips)
    return f"{up} slips up, {len(slips) - up} down"


def _replay(data: xr.Dataset, par: MotorcycleParameters, step: float) -> xr.Dataset:
    own = par.replace({"drive.mode": "current-source"})
    return replayed(own, data, {"i_set": "i"}, "p_mc", step)


def _stribeck(par: MotorcycleParameters, found: Estimate) -> Curve:
    return Curve(
        "stribeck",
        "Identified Stribeck curves with 95 % bands (Fig. 4).",
        stribeck_band(par.seal, found, (2e5, 20e5, 40e5), np.linspace(-2.0, 2.0, 201)),
        "omega",
    )


def synthetic(par: MotorcycleParameters, options: Options, seed: int) -> xr.Dataset:
    """Return the ramp of eq. (17) without dither, simulated, with the sensor's noise."""
    case = friction_ramp.EXPERIMENT.cases(par, friction_ramp.EXPERIMENT.defaults, None)[0]
    made = simulate(as_run(case, 20e-6), ("i_meas", "p_mc"))
    noise = np.random.default_rng(seed).normal(0.0, options.sigma_p, made.time.size)
    return xr.Dataset(
        {"i": ("time", made["i_meas"], {"units": "A"}),
         "p_mc": ("time", made["p_mc"] + noise, {"units": "Pa"})},
        {"time": ("time", made.time, {"units": "s"})},
    )  # fmt: skip


METHOD = Method(
    name="friction-ramp",
    assembly="motorcycle-brake",
    summary="seal friction from the slow ramp: breakaway and slips (2010, eqs. 16, 17, Fig. 4)",
    experiment="friction-ramp",
    signals={"i": "A", "p_mc": "Pa"},
    options=Options,
    defaults=Options(least=0.2e5, longest=6.0, scatter=5e-3, sigma_p=2e3, step=20e-6),
    identify=identify,
    synthetic=synthetic,
    unknowns=tuple(f"seal.{name}" for name in _NAMES),
)
