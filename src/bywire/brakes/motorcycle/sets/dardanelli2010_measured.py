"""The motorcycle brake that explains best what Dardanelli et al. (2010) measured.

All free parameters are estimated at once from Table 4, Figs. 5 to 7 and Table 3's friction, by
``bywire.brakes.motorcycle.paper.measured.estimation`` and, from where its six starts led, by random
steps, after which ``settled`` stays; ``docs/identification.md`` has the way and the misfits.
``bywire reproduce dardanelli2010-measured`` shows what they explain and what they do not. A gear
without losses and a piston without damping lie at their bounds. The rest is Table 1.
"""

from __future__ import annotations

from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.sets.dardanelli2010 import ENTRIES as _OTHERS
from bywire.brakes.motorcycle.sets.dardanelli2010 import SEVEN
from bywire.core.catalog import CitedSet
from bywire.core.provenance import Cited, Formula, calibrated, chosen, derived

_PRIOR = next(entry for entry in _OTHERS if entry.name == "dardanelli2010-table1")


def _told(value: float, interval: str, by: str) -> Cited:
    return calibrated(value, f"estimated, 95 % interval {interval}; told by {by}")


ESTIMATED = {
    "master_cylinder.A_mc": _told(
        6.982e-05, "-0.00011 to 0.00025", "table4.medium.K, fig6.peak, table3.f_cfr_p"
    ),
    "gear.eta_g": _told(
        1, "0.589 to 1.41", "table4.high.overshoot, fig5.loop_area_ratio, table4.high.T1"
    ),
    "gear.J_mot": _told(
        1.363e-05, "-3.32e-05 to 6.05e-05", "table4.medium.K, table4.high.K, fig6.peak"
    ),
    "master_cylinder.k_damp": _told(0, "-3.7e+04 to 3.7e+04", "fig7.peak, table4.high.K"),
    "caliper.K_pd": _told(
        1.106e06, "-4.81e+06 to 7.03e+06", "table4.medium.K, table4.low.T1, fig6.peak"
    ),
    "seal.f_cfr_p": _told(1.628e-08, "-1.39e-08 to 4.64e-08", "table3.f_cfr_p"),
    "seal.f_cfr_n": _told(5.405e-09, "2.23e-09 to 8.58e-09", "table3.f_cfr_n"),
    "seal.k_brk_p": _told(2.886, "-0.147 to 5.92", "fig7.peak, table4.high.K, table4.medium.K"),
    "seal.k_brk_n": _told(2.291, "-0.88 to 5.46", "table3.k_brk_n"),
    "seal.c": _told(5.06, "-26.6 to 36.7", "table3.c"),
    "ecu.filter.zeta": _told(
        0.7095, "-0.0965 to 1.52", "table4.medium.K, table4.high.T1, fig5.loop_area_ratio"
    ),
}
NOT_TOLD = ("master_cylinder.s_mc", "fluid.V_air", "seal.T_pr", "seal.mu_T", "pipeline.d_pl")
_UNTOLD = "as in dardanelli2010-table1: estimated with the others, but no statement tells it"
_KNOWN = "the ECU knows the friction, as it was estimated"
_SEAL: dict[str, Formula] = {
    "f_cfr_p": lambda par: par.seal.f_cfr_p,
    "k_brk_p": lambda par: par.seal.k_brk_p,
}

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
            "fluid.air": chosen("entrained", "its volume was searched for, and may be nothing"),
            "master_cylinder.x_rest": calibrated(0.00464067, SEVEN),
            **{f"ecu.est_par.{name}": derived(formula, _KNOWN) for name, formula in _SEAL.items()},
        },
    ),
)
