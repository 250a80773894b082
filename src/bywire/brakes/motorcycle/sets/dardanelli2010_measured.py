"""The motorcycle brake that explains best what Dardanelli et al. (2010) measured.

All free parameters are estimated at once from Table 4, Figs. 5 to 7 and Table 3's friction, by
``bywire.brakes.motorcycle.paper.measured.estimation.estimated``; ``bywire reproduce
dardanelli2010-measured`` shows what they explain and what they do not. The rest is Table 1.
"""

from __future__ import annotations

from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.sets.dardanelli2010 import ENTRIES as _OTHERS
from bywire.core.catalog import CitedSet
from bywire.core.provenance import Cited, calibrated, chosen, derived

_PRIOR = next(entry for entry in _OTHERS if entry.name == "dardanelli2010-table1")


def _told(value: float, interval: str, by: str) -> Cited:
    return calibrated(value, f"estimated, 95 % interval {interval}; told by {by}")


ESTIMATED = {
    "master_cylinder.A_mc": _told(7.38e-05, "1.77e-06 to 0.000146",
        "fig5.loop_area_ratio, table4.medium.T1, table4.low.K"),
    "gear.eta_g": _told(0.996, "0.366 to 1.63",
        "fig5.loop_area_ratio, table4.medium.T1, table4.low.K"),
    "master_cylinder.k_damp": _told(1075, "-1.01e+04 to 1.22e+04",
        "fig7.peak"),
    "caliper.K_pd": _told(2.261e+06, "-2.7e+05 to 4.79e+06",
        "fig7.peak, fig5.loop_area_ratio, table4.low.K"),
    "fluid.V_air": _told(2.863e-09, "-1.22e-07 to 1.27e-07",
        "table4.medium.T1, table4.high.T1, table4.low.T1"),
    "seal.f_cfr_p": _told(1.601e-08, "1.36e-08 to 1.84e-08",
        "table3.f_cfr_p"),
    "seal.f_cfr_n": _told(5.402e-09, "5.16e-09 to 5.64e-09",
        "table3.f_cfr_n"),
    "seal.k_brk_p": _told(2.616, "2.38 to 2.85",
        "table3.k_brk_p"),
    "seal.k_brk_n": _told(2.299, "2.06 to 2.54",
        "table3.k_brk_n"),
    "seal.c": _told(4.955, "2.54 to 7.37",
        "table3.c"),
    "seal.mu_T": _told(2.016e-07, "-4.01e-08 to 4.43e-07",
        "table3.mu_T"),
    "ecu.filter.zeta": _told(0.7043, "0.361 to 1.05",
        "fig5.loop_area_ratio, table4.low.K, table4.medium.T1"),
}  # fmt: skip
# Moved to the minimum with the others, from which no statement tells it apart.
MOVED_ALONG = {
    "gear.J_mot": calibrated(2.645e-05, "estimated with the others, which it cannot be told from"),
}
NOT_TOLD = ("seal.T_pr", "master_cylinder.s_mc", "pipeline.d_pl")
_UNTOLD = "as in dardanelli2010-table1: estimated with the others, but no statement tells it"
_KNOWN = "the ECU knows the friction, as it was estimated"
_SEAL = {name: ESTIMATED[f"seal.{name}"].value for name in ("f_cfr_p", "k_brk_p")}

ENTRIES = (
    CitedSet(
        name="dardanelli2010-measured",
        assembly=_PRIOR.assembly,
        source=_PRIOR.source,
        summary="motorcycle brake, estimated from what the paper measured: Table 4, Figs. 5 to 7",
        parameter_class=MotorcycleParameters,
        values={
            **_PRIOR.values,
            **ESTIMATED,
            **MOVED_ALONG,
            **{name: chosen(_PRIOR.values[name].value, _UNTOLD) for name in NOT_TOLD},
            "fluid.air": chosen("entrained", "the volume of air is estimated"),
            "master_cylinder.x_rest": derived(0.00585847, "x_mc = 7 mm at 20 bar"),
            **{f"ecu.est_par.{name}": derived(value, _KNOWN) for name, value in _SEAL.items()},
        },
    ),
)
