"""Many gear ratios of the motorcycle actuator beside each other, as a dataset."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr

from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.sizing.demand import Course, Motion, breakaway_current, geared, motion
from bywire.core.typing import Array
from bywire.data.labeled import labeled

Par = MotorcycleParameters

SIZES = {
    "electrical": ("W", "largest electrical power"),
    "mechanical": ("W", "largest mechanical power"),
    "torque": ("N*m", "largest torque"),
    "speed": ("rad/s", "largest speed"),
    "current": ("A", "largest current"),
    "inertia_share": ("1", "inertia's torque over the whole"),
    "current_share": ("1", "current over its limit"),
    "voltage_share": ("1", "voltage over what there is"),
}
"""unit and label of what a motion takes"""


def sizes_of(par: Par, done: Motion, static: float) -> dict[str, float]:
    """Return the largest values of a motion, SI.

    Parameters
    ----------
    static
        Current [A] that breaks the piston away at the peak pressure: torque, current and power
        are at least what it takes.
    """
    torque = float(np.abs(done.torque).max())
    current = max(torque / par.motor.K_e, static)
    voltage = float(np.max(np.abs(done.voltage) / done.available))
    return {
        "electrical": max(float(done.electrical.max()), par.motor.R_m * static**2),
        "mechanical": float(done.mechanical.max()),
        "torque": max(torque, static * par.motor.K_e),
        "speed": float(np.abs(done.omega).max()),
        "current": current,
        "inertia_share": float(np.abs(done.inertia).max()) / torque,
        "current_share": current / par.ecu.pressure.i_max,
        # Where no voltage is left at this current, the share would change its sign.
        "voltage_share": voltage if bool((done.available > 0).all()) else np.inf,
    }


def mapped(
    par: Par,
    p_peak: float,
    ratios: Array,
    frequencies: Array,
    course: Callable[[Par, float], Course],
) -> xr.Dataset:
    """Return what all designs take at all bandwidths.

    Parameters
    ----------
    p_peak
        Largest pressure [Pa], at which the seals must break away.
    ratios, frequencies
        Gear ratios [m/rad], shape (n,), and bandwidths [Hz], shape (m,).
    course
        ``course(par, f)``: the wanted pressure at a bandwidth.

    Returns
    -------
    xarray.Dataset
        Dimensions ``k_g`` and ``frequency``, the variables of `SIZES`.
    """
    rows: list[list[dict[str, float]]] = []
    for k_g in ratios:
        brake = geared(par, float(k_g))
        static = breakaway_current(brake, p_peak)
        rows.append(
            [sizes_of(brake, motion(brake, course(brake, float(f))), static) for f in frequencies]
        )
    values = {name: [[sizes[name] for sizes in row] for row in rows] for name in SIZES}
    axes = {"k_g": (ratios, "m/rad", "gear ratio"), "frequency": (frequencies, "Hz", "bandwidth")}
    return labeled(axes, {name: (values[name], *SIZES[name]) for name in SIZES})
