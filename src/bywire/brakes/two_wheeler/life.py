"""Pad life of the front brake: pads wear, and fluid from the reservoir replaces their volume.

The seals retract the pistons by the same travel after every stop. The clearance is therefore
constant, and wear draws fluid through the compensating port (see `bywire.life`).
"""

from __future__ import annotations

from collections.abc import Mapping

from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.catalog import chosen, derived
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length, Volume
from bywire.core.typing import Array
from bywire.life import warm_stops
from bywire.life.declaration import Effects, Life, Slow, Values
from bywire.plant import pad_wear


class WearParameters(ParameterSet):
    """Pads and discs of the front axle, and the fluid that follows the pads."""

    pads: pad_wear.Parameters
    disc: warm_stops.Parameters
    h_new: Length
    """lining thickness of a new pad"""
    h_min: Length
    """thickness at which pads are replaced"""
    V_new: Volume
    """fluid in the reservoir with new pads"""
    V_min: Volume
    """fluid volume below which the vehicle warns the rider"""


def begin(par: TwoWheelerParameters, wear: WearParameters) -> Values:
    """Return the slow states with new pads and a full reservoir."""
    return {"h_pad": wear.h_new, "V_reservoir": wear.V_new, "work": 0.0}


def follows(z: Values, par: TwoWheelerParameters, wear: WearParameters) -> Mapping[str, float]:
    """Return no changes, because a controlled pressure does not depend on the pads."""
    return {}


def effects(
    figures: Mapping[str, Array],
    stops: Mapping[str, Array],
    z: Values,
    par: TwoWheelerParameters,
    wear: WearParameters,
) -> Effects:
    """Return the wear of each stop, and the fluid that follows all pistons."""
    work = figures["disc_energy"] * figures["disc_share_front"] / 100.0
    before, after = warm_stops.temperatures(work, stops["pause"], stops["T_air"], wear.disc)
    thinned = warm_stops.thinned(work, before, after, wear.pads)
    drawn = par.front.disc.faces * par.front.disc.A_cal * thinned
    return Effects({"h_pad": -thinned, "V_reservoir": -drawn, "work": work})


def left(z: Values, par: TwoWheelerParameters, wear: WearParameters) -> Values:
    """Return the remaining lining and fluid."""
    return {"lining": z["h_pad"] - wear.h_min, "fluid": z["V_reservoir"] - wear.V_min}


TWO_WHEELER_PADS = Life(
    name="two-wheeler-pads",
    summary="front pads of a motorcycle, and the fluid that replaces their volume",
    experiment="straight-stop",
    wear=WearParameters,
    values={
        **{f"pads.{name}": value for name, value in warm_stops.ORGANIC_LINING.items()},
        "pads.n_pads": chosen(4.0, "two discs"),
        "pads.A_pad": chosen(20e-4, "front pads of a sport motorcycle"),
        "disc.C_d": derived(1.36e3, "60 K per stop from 100 km/h, 80 % of the energy at the front"),
        "disc.tau_d": chosen(60.0, "from 80 to 57 degC in 30 s of driving"),
        "h_new": chosen(4.5e-3, "lining of a sport motorcycle pad"),
        "h_min": chosen(0.5e-3, "4 mm of usable lining"),
        "V_new": chosen(35e-6, "reservoir of a radial master cylinder"),
        "V_min": chosen(10e-6, "mark on the sight glass"),
    },
    states={
        "h_pad": Slow("m", "pad thickness"),
        "V_reservoir": Slow("m**3", "fluid in the reservoir"),
        "work": Slow("J", "friction work at the front", is_drawn=False),
    },
    limits={"lining": Slow("m", "remaining lining"), "fluid": Slow("m**3", "remaining fluid")},
    begin=begin,
    follows=follows,
    effects=effects,
    left=left,
    figures=("disc_energy", "disc_share_front"),
    settings={
        "options.p_front": "15.4 bar",
        "options.p_rear": "37 bar",
        "options.duration": "7 s",
    },
    population={
        "options.v_0": {
            "kind": "discrete",
            "values": ["50 km/h", "100 km/h", "150 km/h"],
            "weights": [70, 25, 5],
        },
    },
)
