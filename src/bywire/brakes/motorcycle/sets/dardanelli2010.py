"""Parameter sets of Dardanelli et al. (2010), whose values are in TOML files.

``dardanelli2010-measured`` is the brake that best explains the paper's measurements.
``paper.measured`` estimates its free parameters together from Table 4, Figs. 5 to 7 and the
friction of Table 3: six starts, then random steps from the best one, then ``settled``.
``docs/identification.md`` describes the procedure and the misfits, and ``bywire reproduce
dardanelli2010-measured`` lists which statements the set explains. The gear's loss and the piston's
damping are at their lower bound, zero. The other parameters come from Table 1.
"""

from __future__ import annotations

from pathlib import Path

from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.catalog import CitedSet, Formula, calibrated, chosen, derived
from bywire.reproduction.source_file import SourceFile

FILE = SourceFile(Path(__file__).with_suffix(".toml"))
_PUBLISHED = FILE.sets(MotorcycleParameters, FILE.values())
_TABLE1 = next(entry for entry in _PUBLISHED if entry.name == "dardanelli2010-table1")

# --- The set estimated from the paper's measurements

ESTIMATED = SourceFile(Path(__file__).with_name("dardanelli2010_measured.toml")).values()
UNDETERMINED = ("master_cylinder.s_mc", "fluid.V_air", "seal.T_pr")
_AS_TABLE1 = (
    "as in dardanelli2010-table1: free in the estimation, but no published value determines it"
)
_ASSUMED = "the ECU assumes the estimated friction"
_SEAL: dict[str, Formula] = {
    "f_cfr_p": lambda par: par.seal.f_cfr_p,
    "k_brk_p": lambda par: par.seal.k_brk_p,
}
_MEASURED = CitedSet(
    name="dardanelli2010-measured",
    assembly=_TABLE1.assembly,
    source=_TABLE1.source,
    summary="motorcycle brake, estimated from the measurements in Table 4 and Figs. 5 to 7",
    parameter_class=MotorcycleParameters,
    values={
        **_TABLE1.values,
        **ESTIMATED,
        **{name: chosen(_TABLE1.values[name].value, _AS_TABLE1) for name in UNDETERMINED},
        "fluid.air": chosen("entrained", "the air volume is a free parameter, which may be zero"),
        "master_cylinder.x_rest": calibrated(
            0.00464067, _TABLE1.values["master_cylinder.x_rest"].where
        ),
        **{f"ecu.est_par.{name}": derived(formula, _ASSUMED) for name, formula in _SEAL.items()},
    },
)

ENTRIES = (*_PUBLISHED, _MEASURED)
