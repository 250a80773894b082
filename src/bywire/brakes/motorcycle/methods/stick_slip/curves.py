"""Curves that show an identified friction: over the speed with its band, and the ramp once more."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.core import ops
from bywire.core.typing import Array
from bywire.data.labeled import labeled
from bywire.identification.estimate import Estimate
from bywire.identification.output_error import trial
from bywire.plant import seal_friction
from bywire.simulation.run import simulate

_SHARE = 1e-6


def stribeck_band(
    par: seal_friction.Parameters, estimate: Estimate, pressures: Sequence[float], omega: Array
) -> xr.Dataset:
    """Return friction torque over speed at several pressures, with 95 % bands.

    ``par``: the identified friction; ``estimate``: estimate of ``seal.*`` parameters;
    ``pressures``: [Pa]; ``omega``: shaft speeds [rad/s], shape (n,).

    Returns
    -------
    xarray.Dataset
        ``value``, ``low``, ``high`` [N m] over ``pressure`` and ``omega``; at zero speed NaN,
        where the friction takes any value between its breakaway torques.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (16), Fig. 4.
    """
    seal = [k for k, u in enumerate(estimate.unknowns) if u.name.startswith("seal.")]
    unknowns = [estimate.unknowns[k] for k in seal]
    names = [u.name.removeprefix("seal.") for u in unknowns]
    value = np.array([[_torque(par, w, p) for w in omega] for p in pressures])
    slopes = []
    for name, unknown in zip(names, unknowns, strict=True):
        by = _SHARE * unknown.scale
        up = par.replace({name: getattr(par, name) + by})
        moved = np.array([[_torque(up, w, p) for w in omega] for p in pressures])
        slopes.append((moved - value) / by)
    G = np.array(slopes)
    variance = np.einsum("ipw,ij,jpw->pw", G, estimate.covariance[np.ix_(seal, seal)], G)
    half = 0.5 * np.diff(estimate.intervals(), axis=1).ravel() / estimate.deviations
    reach = float(half[0]) * np.sqrt(np.maximum(variance, 0.0))
    axes = {
        "pressure": (np.array(pressures), "Pa", "pressure"),
        "omega": (omega, "rad/s", "motor speed"),
    }
    band = {"value": value, "low": value - reach, "high": value + reach}
    return labeled(axes, {name: (T, "N*m", "friction torque") for name, T in band.items()})


def _torque(par: seal_friction.Parameters, omega: float, p: float) -> float:
    if omega == 0.0:
        return float("nan")
    friction = seal_friction.output(seal_friction.Input(omega, p), par)
    return float(ops.where(omega > 0.0, friction.T_p, -friction.T_n))


def replayed(data: xr.Dataset, par: MotorcycleParameters, step: float) -> xr.Dataset:
    """Return the pressure over the whole ramp, measured and modeled, driven by the current.

    ``data``: ``i`` [A] and ``p_mc`` [Pa] over ``time`` [s]; ``step``: substep [s].
    """
    driven_par = par.replace({"drive.mode": "current-source"})
    start = max(float(data["p_mc"][0]), 0.0)
    whole = trial(
        MotorcycleBrake(),
        driven_par,
        data,
        {"i_set": "i"},
        {"p_mc": 1.0},
        state=state_at(start, driven_par),
        memory=memory_at(start, driven_par),
        step=step,
    )
    modeled = simulate(whole.run, ("p_mc",))["p_mc"]
    attrs = {"units": "Pa", "long_name": "master-cylinder pressure"}
    return xr.Dataset(
        {"measured": ("time", data["p_mc"].values, attrs), "modeled": ("time", modeled, attrs)},
        {"time": data["time"]},
    )
