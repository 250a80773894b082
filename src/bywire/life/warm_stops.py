"""Heat of repeated stops: temperature of the friction surface, and wear of the pads.

One body absorbs the friction work of every stop and cools between stops. This is sufficient for a
life, since a disc's temperature depends more on the pauses than on the speeds.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated

import numpy as np
from pydantic import Field

from bywire.core.catalog import Cited, chosen
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.typing import Array
from bywire.plant import pad_wear

ORGANIC_LINING: Mapping[str, Cited] = MappingProxyType(
    {
        "kappa_0": chosen(3.6e-14, "180 cm^3 of pad over about 5 GJ: a car's front axle"),
        "T_hot": chosen(503.0, "230 degC, usual for organic linings"),
        "T_act": chosen(2760.0, "four times the wear at 400 degC"),
        "E_pad": chosen(5e8, "order of magnitude of organic linings under load"),
    }
)
"""properties of a road vehicle's pads of any size"""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_HOTTEST = 1500.0  # K: cast iron melts


class Parameters(ParameterSet):
    """The disc as a body with uniform temperature."""

    C_d: Annotated[float, Unit("J/K", 1e3), Field(gt=0, allow_inf_nan=False)]
    """heat capacity of the body that absorbs the friction work"""
    tau_d: Annotated[float, Unit("s", 300.0), Field(gt=0, allow_inf_nan=False)]
    """time constant of this body's cooling"""


def temperatures(work: Array, pause: Array, T_air: Array, par: Parameters) -> tuple[Array, Array]:
    """Return the temperature of the disc before and after each of periodically repeated stops.

    Parameters
    ----------
    work, pause, T_air
        Friction work [J], time until the next stop [s], and temperature of the air [K], shape
        (stops,) each; the first stop follows after the last one.

    Returns
    -------
    tuple
        Temperatures [K] before and after each stop, shape (stops,) each.

    Raises
    ------
    ParameterError
        If the disc would melt.
    """
    rise, kept = work / par.C_d, np.exp(-pause / par.tau_d)
    factor, offset = 1.0, 0.0  # of the temperature before the first stop, a cycle later
    for dT, share, air in zip(rise, kept, T_air, strict=True):
        factor, offset = share * factor, air + share * (offset + dT - air)
    before = np.empty(work.size)
    T = offset / (1.0 - factor) if factor < 1.0 else np.inf
    for k, (dT, share, air) in enumerate(zip(rise, kept, T_air, strict=True)):
        before[k] = T
        T = air + share * (T + dT - air)
    after = before + rise
    if not (hottest := float(np.max(after))) < _HOTTEST:
        raise ParameterError(
            f"the disc would reach {hottest - 273.15:.0f} degC and melt. Use longer pauses "
            "(stop.pause), a larger disc, or faster cooling",
            name="stop.pause",
            value=f"{hottest - 273.15:.0f} degC",
        )
    return before, after


def thinned(work: Array, before: Array, after: Array, par: pad_wear.Parameters) -> Array:
    """Return the wear of a pad during each stop [m], shape (stops,).

    The surface temperature [K] rises from one value to the other in proportion to the work.

    Notes
    -----
    Below the hot range, wear per work is constant; above, it is integrated by Gauss-Legendre
    quadrature.
    """
    span = np.maximum(after - before, 1e-9)
    cold = np.clip((par.T_hot - before) / span, 0.0, 1.0)
    begin = np.maximum(before, par.T_hot)
    T = begin[:, None] + 0.5 * (1.0 + _NODES) * (np.maximum(after, begin) - begin)[:, None]
    hot = 0.5 * (pad_wear.wear_per_work(T, par) @ _WEIGHTS)
    worn = work * (cold * par.kappa_0 + (1.0 - cold) * hot)
    return np.asarray(worn / (par.n_pads * par.A_pad))
