"""Life of a caliper without an adjuster, whose clearance and clamp time increase with wear."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from bywire.authoring import (
    Array,
    Duration,
    Effects,
    Length,
    Life,
    ParameterSet,
    Slow,
    Unit,
    chosen,
)
from bywire.life import warm_stops
from bywire.plant import pad_wear
from emb_caliper.parameters import CaliperBrakeParameters


class WearParameters(ParameterSet):
    """Pads, their load in a stop, and the limit of the dead time."""

    pads: pad_wear.Parameters
    disc: warm_stops.Parameters
    W_stop: Annotated[float, Unit("J", 1e5), Field(gt=0, allow_inf_nan=False)]
    """friction work per stop"""
    h_new: Length
    """thickness of a new pad"""
    h_min: Length
    """thickness at which pads are replaced"""
    t_most: Duration
    """maximum time until the force rises"""


def begin(par: CaliperBrakeParameters, wear: WearParameters) -> dict[str, float]:
    """Return the slow states with new pads."""
    return {"h_pad": wear.h_new, "clearance": par.caliper.clearance, "dead_time": 0.0}


def follows(
    z: Mapping[str, float], par: CaliperBrakeParameters, wear: WearParameters
) -> dict[str, float]:
    """Return the clearance. The measured curve of the caliper does not change."""
    return {"caliper.clearance": z["clearance"]}


def effects(
    figures: Mapping[str, Array],
    stops: Mapping[str, Array],
    z: Any,
    par: Any,
    wear: WearParameters,
) -> Effects:
    """Return the wear of each stop, and the simulated dead time."""
    work = np.full(figures["dead_time"].shape, wear.W_stop)
    before, after = warm_stops.temperatures(work, stops["pause"], stops["T_air"], wear.disc)
    thinned = warm_stops.thinned(work, before, after, wear.pads)
    return Effects(
        {"h_pad": -thinned, "clearance": 2.0 * thinned},
        {"dead_time": float(np.mean(figures["dead_time"]))},
    )


def between(
    z: Mapping[str, float], readings: Mapping[str, float], par: Any, wear: Any
) -> dict[str, float]:
    """Return the slow states with the simulated dead time."""
    return {**z, **readings}


def left(z: Mapping[str, float], par: Any, wear: WearParameters) -> dict[str, float]:
    """Return the remaining lining, and the dead time's margin to its limit."""
    return {"lining": z["h_pad"] - wear.h_min, "time": wear.t_most - z["dead_time"]}


CALIPER_PADS = Life(
    name="caliper-pads",
    summary="pads of a caliper without an adjuster, until they are worn or the brake is too slow",
    experiment="clamp-step",
    wear=WearParameters,
    values={
        "pads.kappa_0": chosen(3.6e-14, "180 cm^3 of lining per 5 GJ, front axle of a car"),
        "pads.T_hot": chosen(503.0, "230 degC, typical of organic linings"),
        "pads.T_act": chosen(2760.0, "four times the wear at 400 degC"),
        "pads.n_pads": chosen(2.0, "a floating caliper"),
        "pads.A_pad": chosen(50e-4, "front pads of a mid-size car"),
        "pads.E_pad": chosen(5e8, "unused, because the caliper has a measured curve"),
        "disc.C_d": chosen(3.4e3, "7 kg of cast iron"),
        "disc.tau_d": chosen(300.0, "a few minutes in the air stream"),
        "W_stop": chosen(174e3, "450 kg from 100 km/h"),
        "h_new": chosen(10e-3, "front pads of a mid-size car"),
        "h_min": chosen(2e-3, "usual wear limit"),
        "t_most": chosen(0.15, "3 m of additional stopping distance at 130 km/h"),
    },
    states={
        "h_pad": Slow("m", "pad thickness"),
        "clearance": Slow("m", "clearance"),
        "dead_time": Slow("s", "dead time"),
    },
    limits={"lining": Slow("m", "remaining lining"), "time": Slow("s", "remaining time")},
    begin=begin,
    follows=follows,
    effects=effects,
    left=left,
    figures=("dead_time",),
    between=between,
)
