"""The free parameters of the brake: bounds, starts, and what moves with them or is held."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bywire.brakes.motorcycle.paper.runs import PRINTED, parameters
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import travel_at
from bywire.core.errors import ParameterError
from bywire.core.parameters import leaf_fields
from bywire.identification.unknown import Unknown

Par = MotorcycleParameters

PRIOR = PRINTED
"""set that gives starts, and what no statement tells: Table 1 as printed"""
P_NOMINAL = 20e5
"""pressure [Pa] at which the piston stands at its nominal position, as in the other sets"""

_TENFOLD = "a tenth to ten times Table 1: beyond it is another brake"
_TABLE3 = "a fifth to five times Table 3"


@dataclass(frozen=True)
class Free:
    """A free parameter: bounds [SI], their reason, and the magnitude where it may be zero."""

    low: float
    high: float
    reason: str
    scale: float = 0.0


FREE: Mapping[str, Free] = {
    "master_cylinder.A_mc": Free(0.4e-4, 3e-4, "bores of 7 to 20 mm"),
    "gear.eta_g": Free(0.5, 1.0, "ball screw and gear; no machine gives more than it takes"),
    "gear.J_mot": Free(2e-6, 2e-4, "a motor of 20 to 80 mm"),
    "master_cylinder.k_damp": Free(0.0, 2e5, "none to ten times Table 1"),
    "caliper.K_pd": Free(1e5, 1e7, _TENFOLD),
    "fluid.V_air": Free(0.0, 6e-7, "none to what the nominal position leaves room for", 1e-7),
    "pipeline.d_pl": Free(4e-3, 16e-3, "half to twice Table 1"),
    "master_cylinder.s_mc": Free(15.5e-3, 60e-3, "beyond the end stop; three times our choice"),
    "seal.T_pr": Free(0.0, 3e-2, "none to Fig. 4's torque at low pressure"),
    "seal.f_cfr_p": Free(3.2e-9, 8e-8, _TABLE3),
    "seal.f_cfr_n": Free(1.08e-9, 2.7e-8, _TABLE3),
    "seal.k_brk_p": Free(1.0, 13.0, "no less than Coulomb friction; five times Table 3"),
    "seal.k_brk_n": Free(1.0, 11.5, "no less than Coulomb friction; five times Table 3"),
    "seal.c": Free(1.0, 25.0, _TABLE3),
    "seal.mu_T": Free(0.0, 2e-3, "none to the text's 1e-2 N m s/rad in place of Table 3's", 2e-7),
    "ecu.filter.zeta": Free(0.3, 1.5, "second-order low-passes in use"),
}
"""what is estimated at once"""

TIED: Mapping[str, str] = {
    "ecu.est_par.T_pr": "seal.T_pr",
    "ecu.est_par.f_cfr_p": "seal.f_cfr_p",
    "ecu.est_par.k_brk_p": "seal.k_brk_p",
}
"""what the ECU believes of the friction, by which it sets the dither: it is what was identified"""

HELD: Mapping[str, str] = {
    "gear.k_g": "shows in A_mc k_g, k_damp k_g^2 and the chamber's volume only, which A_mc, k_damp "
    "and s_mc take",
    "gear.M_mc": "adds to the inertia, which J_mot takes",
    "motor.K_e": "shows in eta_g K_e, which eta_g takes, and hardly in the back-EMF",
    "caliper.A_pd": "shows in A_pd^2/K_pd only, which K_pd takes",
    "fluid.beta": "shows in the chamber's volume over it, which s_mc takes",
    "fluid.nu": "shows in the pipeline's resistance only, which d_pl takes",
    "fluid.rho": "shows in the pipeline's resistance only, which d_pl takes",
    "pipeline.L_pl": "shows in the pipeline's resistance only, which d_pl takes",
    "pipeline.k_lf": "shows in the pipeline's resistance only, which d_pl takes",
}
"""physical parameters that show in a product with a free one, and stay where Table 1 has them"""


def prior() -> Par:
    """Return where the search begins: Table 1 as printed, with the law of entrained air on."""
    return parameters(PRIOR).replace({"fluid.air": "entrained", "fluid.V_air": 0.0})


def unknowns() -> tuple[Unknown, ...]:
    """Return the free parameters as unknowns, within their bounds, from Table 1."""
    known, fields = prior().leaves(), leaf_fields(Par)
    return tuple(
        Unknown(
            name,
            known[name],
            free.low,
            free.high,
            free.scale or known[name],
            fields[name].unit.symbol,
        )
        for name, free in FREE.items()
    )


def brake(values: Mapping[str, float], base: Par | None = None) -> Par:
    """Return the brake with some of the free parameters at values of their own.

    The retracted end follows, so that the piston stands at its nominal position at 20 bar, and
    what the ECU believes of the friction.

    Parameters
    ----------
    values
        By name, SI.
    base
        Everything else; Table 1 as printed by default.

    Raises
    ------
    ParameterError
        When a value is out of range, or the stroke to 20 bar is longer than the nominal travel.
    """
    tied = {name: values[source] for name, source in TIED.items() if source in values}
    near = (prior() if base is None else base).replace({**values, **tied})
    wanted = near.master_cylinder.x_nominal
    x_rest = near.master_cylinder.x_rest
    for _ in range(20):  # the travel hardly changes with the volume behind it: a few rounds do
        missing = wanted - travel_at(P_NOMINAL, near)
        x_rest += missing
        if not x_rest > 0.0:
            raise ParameterError(
                f"the stroke to {P_NOMINAL / 1e5:g} bar is longer than the nominal travel of "
                f"{wanted * 1e3:g} mm: less air, stiffer pads or a larger piston"
            )
        near = near.replace({"master_cylinder.x_rest": x_rest})
        if abs(missing) < 1e-12:
            break
    return near
