"""The motorcycle brake that explains best what Dardanelli et al. (2010) measured.

All free parameters are estimated at once from Table 4, Figs. 5 to 7 and Table 3's friction, by
``bywire.brakes.motorcycle.paper.measured.estimation`` and, from where its six starts led, by random
steps, after which ``settled`` stays; ``docs/identification.md`` has the way and the misfits.
``bywire reproduce dardanelli2010-measured`` shows what they explain and what they do not. A gear
without losses and a piston without damping lie at their bounds. The rest is Table 1.
"""

from __future__ import annotations

from pathlib import Path

from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.sets.dardanelli2010 import ENTRIES as _OTHERS
from bywire.core.catalog import CitedSet, Formula, calibrated, chosen, derived
from bywire.reproduction.source_file import SourceFile

_PRIOR = next(entry for entry in _OTHERS if entry.name == "dardanelli2010-table1")


ESTIMATED = SourceFile(Path(__file__).with_suffix(".toml")).values()
NOT_TOLD = ("master_cylinder.s_mc", "fluid.V_air", "seal.T_pr", "seal.mu_T", "pipeline.d_pl")
_SEVEN = _PRIOR.values["master_cylinder.x_rest"].where
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
            "master_cylinder.x_rest": calibrated(
                0.00464067, _PRIOR.values["master_cylinder.x_rest"].where
            ),
            **{f"ecu.est_par.{name}": derived(formula, _KNOWN) for name, formula in _SEAL.items()},
        },
    ),
)
