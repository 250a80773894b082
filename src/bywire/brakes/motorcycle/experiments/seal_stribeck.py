"""Stribeck curves: seal friction torque versus speed at several pressures (2010, Fig. 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from bywire.bench.experiment import Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Nodes, Unit
from bywire.data.labeled import labeled
from bywire.plant import seal_friction

if TYPE_CHECKING:
    import xarray as xr

FIGURES = Figures(
    breakaway_apply=("N*m", "Maximum friction torque while applying, at the highest pressure."),
    breakaway_release=("N*m", "Maximum friction torque while releasing, at the highest pressure."),
)


class Options(ParameterSet):
    """Range of the curves."""

    pressures: Annotated[Nodes, Unit("Pa", 2e6), Field(min_length=1)]
    """master-cylinder pressures, one curve each"""
    omega_max: Annotated[float, Unit("rad/s", 2.0), Field(gt=0, allow_inf_nan=False)]
    """maximum motor speed, in both directions"""


def static(par: MotorcycleParameters, options: Options) -> dict[str, xr.Dataset]:
    """Return friction torque versus pressure and speed.

    The speeds contain -0 and +0. The torques there are the breakaway torques, which limit the
    torque at rest.
    """
    side = np.linspace(0.0, options.omega_max, 401)
    speeds = np.concatenate((-side[::-1], side))
    forward = np.arange(speeds.size) >= side.size
    torque = np.empty((len(options.pressures), speeds.size))
    for k, p in enumerate(options.pressures):
        for j, omega in enumerate(speeds):
            friction = seal_friction.output(seal_friction.Input(float(omega), p), par.seal)
            torque[k, j] = friction.T_p if forward[j] else -friction.T_n
    axes = {
        "p_mc": (np.array(options.pressures), "Pa", "master-cylinder pressure"),
        "omega": (speeds, "rad/s", "motor speed"),
    }
    return {"curve": labeled(axes, {"T_fr": (torque, "N*m", "friction torque")})}


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the breakaway torques at the highest pressure."""
    curve = recordings["curve"]
    torque = curve["T_fr"].values[int(np.argmax(curve["p_mc"].values))]
    return FIGURES(breakaway_apply=torque.max(), breakaway_release=-torque.min())


EXPERIMENT = Experiment(
    name="seal-stribeck",
    formerly="stribeck",
    assembly="motorcycle-brake",
    summary="friction torque versus speed at {pressures} (Fig. 4 of Dardanelli et al.)",
    options=Options,
    defaults=Options(pressures=(2e5, 20e5, 40e5), omega_max=2.0),
    cases=lambda *_: (),
    judge=judge,
    kpis=FIGURES.units,
    figures=("stribeck-curve",),
    static=static,
)
