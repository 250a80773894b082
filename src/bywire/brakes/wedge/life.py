"""Pad life of the wedge brake: pads wear, the clearance grows, and the caliper becomes stiffer.

Stops of a quarter car supply the friction work; see `bywire.life`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.rigs.wedge_corner import WedgeCornerParameters
from bywire.brakes.wedge.sets.roberts2003 import ADJUSTER
from bywire.control import wear_adjuster
from bywire.core.catalog import chosen
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length
from bywire.core.typing import Array
from bywire.life import warm_stops
from bywire.life.declaration import Effects, Life, Slow, Values
from bywire.plant import pad_wear, roller_screw


class WearParameters(ParameterSet):
    """Pads, disc heating, adjuster, and wear limits.

    ``mechanism``: with ``"teeth"``, an adjuster works; with ``"none"``, the clearance grows.
    """

    pads: pad_wear.Parameters
    disc: warm_stops.Parameters
    mechanism: Literal["none", "teeth"]
    """mechanism that restores the clearance"""
    adjuster: wear_adjuster.Parameters
    h_new: Length
    """thickness of a new pad; the bench's stiffness applies to new pads"""
    h_min: Length
    """thickness at which pads are replaced"""
    M_full: SomeMoment
    """moment that the brake must reach within the wedge's travel"""


def begin(par: WedgeCornerParameters, wear: WearParameters) -> Values:
    """Return the brake's slow states with new pads."""
    return {
        "h_pad": wear.h_new,
        "clearance": par.caliper.clearance,
        "K_cal": par.caliper.K_cal,
        "clicks": 0.0,
        "counted": 0.0,
        "wide": 0.0,
        "work": 0.0,
    }


def follows(z: Values, par: WedgeCornerParameters, wear: WearParameters) -> Mapping[str, float]:
    """Return clearance and caliper stiffness with worn pads."""
    return {"caliper.clearance": z["clearance"], "caliper.K_cal": z["K_cal"]}


def effects(
    figures: Mapping[str, Array],
    stops: Mapping[str, Array],
    z: Values,
    par: WedgeCornerParameters,
    wear: WearParameters,
) -> Effects:
    """Return the wear of each stop. Both pads wear equally, and both increase the clearance.

    There are two readings between stops: the travel to contact that the moment control estimates,
    minus the clearance, and the disc temperature at the start of a stop.
    """
    work = figures["energy_braked"]
    before, after = warm_stops.temperatures(work, stops["pause"], stops["T_air"], wear.disc)
    thinned = warm_stops.thinned(work, before, after, wear.pads)
    travel = figures["contact_angle"] * roller_screw.slope(par.screw) * wedge.slope(par.wedge)
    return Effects(
        {"h_pad": -thinned, "clearance": 2.0 * thinned, "work": work},
        {"beyond": float(np.mean(travel)) - z["clearance"], "T_disc": float(np.mean(before))},
    )


def between(
    z: Values, readings: Mapping[str, float], par: WedgeCornerParameters, wear: WearParameters
) -> Values:
    """Return the slow states after the adjuster has turned, with the worn pads' stiffness."""
    worn = wear.h_new - z["h_pad"]
    z = {**z, "K_cal": pad_wear.stiffness(par.caliper.K_cal, worn, wear.pads)}
    if wear.mechanism == "none":
        return z
    law, T = wear.adjuster, readings["T_disc"]
    seen = z["clearance"] + readings["beyond"] - law.growth * (T - law.T_cold)
    state, out = wear_adjuster.output(
        wear_adjuster.State(applied=1.0, wide=z["wide"], teeth=z["counted"]),
        wear_adjuster.Input(gap=seen, T=T, touching=0.0, parked=1.0, wanted=0.0),
        law,
    )
    return {
        **z,
        "clearance": z["clearance"] - law.tooth * out.turned,
        "clicks": z["clicks"] + out.turned,
        "counted": state.teeth,
        "wide": state.wide,
    }


def left(z: Values, par: WedgeCornerParameters, wear: WearParameters) -> Values:
    r"""Return the remaining lining, wedge travel, and clearance before a hot disc drags.

    .. math:: x_{stop} \tan\alpha - c - F_N/K_{CAL}

    is the remaining travel, with the normal force at the moment M_full.
    """
    F_N = wear.M_full / (2.0 * par.wedge.mu_B * par.caliper.r_B)
    reach = par.wedge.x_stop * wedge.slope(par.wedge)
    return {
        "lining": z["h_pad"] - wear.h_min,
        "travel": reach - z["clearance"] - F_N / z["K_cal"],
        "free": z["clearance"] - wear.adjuster.gap_min,
    }


WEDGE_PADS = Life(
    name="wedge-pads",
    summary="wedge brake pads on a quarter car, until the lining or the wedge travel is used up",
    experiment="corner-stop",
    wear=WearParameters,
    values={
        **{f"pads.{name}": value for name, value in warm_stops.ORGANIC_LINING.items()},
        "pads.n_pads": chosen(2.0, "a floating caliper"),
        "pads.A_pad": chosen(50e-4, "front pads of a mid-size car"),
        "disc.C_d": chosen(3.4e3, "7 kg of cast iron"),
        "disc.tau_d": chosen(300.0, "a few minutes in the air stream"),
        "mechanism": chosen(
            "teeth", "without an adjuster the travel is used up after about 280 stops"
        ),
        **{f"adjuster.{name}": value for name, value in ADJUSTER.items()},
        "adjuster.ways": chosen("closing", "only wear changes the clearance"),
        "h_new": chosen(10e-3, "front pads of a mid-size car"),
        "h_min": chosen(2e-3, "usual wear limit"),
        "M_full": chosen(950.0, "the highest moment in the paper"),
    },
    states={
        "h_pad": Slow("m", "pad thickness"),
        "clearance": Slow("m", "clearance"),
        "clicks": Slow("1", "teeth turned"),
        "K_cal": Slow("N/m", "stiffness"),
        "counted": Slow("1", "teeth counted by the adjuster", is_drawn=False),
        "wide": Slow("1", "consecutive applications with too much clearance", is_drawn=False),
        "work": Slow("J", "friction work", is_drawn=False),
    },
    limits={
        "lining": Slow("m", "remaining lining"),
        "travel": Slow("m", "remaining travel"),
        "free": Slow("m", "free when hot"),
    },
    begin=begin,
    follows=follows,
    effects=effects,
    left=left,
    figures=("energy_braked", "contact_angle"),
    between=between,
    settings={
        "options.v_0": "100 km/h",
        "options.M_brake": "600 N*m",
        "options.t_hold": "7 s",
        "options.t_end": "100 ms",
        "simulation.step": "50 us",
    },
)
