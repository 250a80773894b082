"""Stribeck curves of an identified seal friction, with the band that its uncertainty leaves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from bywire.core import ops
from bywire.core.typing import Array
from bywire.identification.estimate import Estimate
from bywire.plant import seal_friction

_SHARE = 1e-6


def stribeck_band(
    par: seal_friction.Parameters, found: Estimate, pressures: Sequence[float], omega: Array
) -> xr.Dataset:
    """Return friction torque over speed at several pressures, with 95 % bands.

    Parameters
    ----------
    par
        The identified friction.
    found
        Estimate of ``seal.*`` parameters.
    pressures
        [Pa].
    omega
        Shaft speeds [rad/s], shape (n,).

    Returns
    -------
    xarray.Dataset
        ``value``, ``low``, ``high`` [N m] over ``pressure`` and ``omega``; at zero speed NaN,
        where the friction takes any value between its breakaway torques.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (16), Fig. 4.
    """
    seal = [k for k, u in enumerate(found.unknowns) if u.name.startswith("seal.")]
    unknowns = [found.unknowns[k] for k in seal]
    names = [u.name.removeprefix("seal.") for u in unknowns]
    value = np.array([[_torque(par, w, p) for w in omega] for p in pressures])
    slopes = []
    for name, unknown in zip(names, unknowns, strict=True):
        by = _SHARE * unknown.scale
        up = par.replace({name: getattr(par, name) + by})
        moved = np.array([[_torque(up, w, p) for w in omega] for p in pressures])
        slopes.append((moved - value) / by)
    G = np.array(slopes)
    variance = np.einsum("ipw,ij,jpw->pw", G, found.covariance[np.ix_(seal, seal)], G)
    half = 0.5 * np.diff(found.intervals(), axis=1).ravel() / found.deviations
    reach = float(half[0]) * np.sqrt(np.maximum(variance, 0.0))
    axes = ("pressure", "omega")
    attrs = {"units": "N*m", "long_name": "friction torque"}
    return xr.Dataset(
        {"value": (axes, value, attrs), "low": (axes, value - reach, attrs),
         "high": (axes, value + reach, attrs)},
        {"pressure": ("pressure", np.array(pressures), {"units": "Pa", "long_name": "pressure"}),
         "omega": ("omega", omega, {"units": "rad/s", "long_name": "motor speed"})},
    )  # fmt: skip


def _torque(par: seal_friction.Parameters, omega: float, p: float) -> float:
    if omega == 0.0:
        return float("nan")
    friction = seal_friction.output(seal_friction.Input(omega, p), par)
    return float(ops.where(omega > 0.0, friction.T_p, -friction.T_n))
