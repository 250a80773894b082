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
    "master_cylinder.A_mc": _told(7.38e-05, "7.75e-06 to 0.00014",
        "table4.low.K, table4.medium.K, fig6.peak"),
    "gear.eta_g": _told(0.996, "0.47 to 1.52",
        "table4.medium.K, table4.low.K, fig6.peak"),
    "gear.J_mot": _told(2.645e-05, "1.1e-05 to 4.19e-05",
        "table4.high.K, fig7.peak, table4.medium.K"),
    "master_cylinder.k_damp": _told(1075, "-1.1e+04 to 1.32e+04",
        "fig7.peak, fig5.loop_area_ratio"),
    "caliper.K_pd": _told(2.261e+06, "-9.81e+05 to 5.5e+06",
        "fig7.peak, table4.low.K, table4.medium.K"),
    "fluid.V_air": _told(2.863e-09, "-1.36e-07 to 1.42e-07",
        "table4.medium.T1, table4.medium.K, table4.low.K"),
    "seal.f_cfr_p": _told(1.601e-08, "1.35e-08 to 1.86e-08",
        "table3.f_cfr_p"),
    "seal.f_cfr_n": _told(5.402e-09, "5.14e-09 to 5.66e-09",
        "table3.f_cfr_n"),
    "seal.k_brk_p": _told(2.616, "2.36 to 2.87",
        "table3.k_brk_p"),
    "seal.k_brk_n": _told(2.299, "2.04 to 2.56",
        "table3.k_brk_n"),
    "seal.c": _told(4.955, "2.36 to 7.55",
        "table3.c"),
    "seal.mu_T": _told(2.016e-07, "-6e-08 to 4.63e-07",
        "table3.mu_T"),
    "ecu.filter.zeta": _told(0.7043, "0.448 to 0.961",
        "table4.low.K, table4.medium.K, fig5.loop_area_ratio"),
}  # fmt: skip
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
            **{name: chosen(_PRIOR.values[name].value, _UNTOLD) for name in NOT_TOLD},
            "fluid.air": chosen("entrained", "the volume of air is estimated"),
            "master_cylinder.x_rest": derived(0.00585847, "x_mc = 7 mm at 20 bar"),
            **{f"ecu.est_par.{name}": derived(value, _KNOWN) for name, value in _SEAL.items()},
        },
    ),
)
