"""The linear benchmark of Strathmann and Oehlerking (2015).

The values come from the models of the competitions that use it (ARCH-COMP; CORA, JuliaReach) and
from the problem statement in the archive (cps-vo.org, node 67351). The paper itself was not
available. We interpret lengths as decimeters, so x0 = 0.05 is a clearance of 5 mm.
"""

from __future__ import annotations

from bywire.authoring import CitedSet, paper
from emb_caliper.rigs.approach import ApproachParameters

SOURCE = (
    "T. Strathmann, J. Oehlerking, Verifying properties of an electro-mechanical braking system, "
    "Workshop on Applied Verification for Continuous and Hybrid Systems (ARCH), 2015"
)
_HERE = "benchmark model in ARCH-COMP"
_DM = f"{_HERE}, per dm"

BENCHMARK = CitedSet(
    name="strathmann2015",
    assembly="emb-approach",
    source=SOURCE,
    summary="linear benchmark of an EMB that closes its clearance under sampled PI control",
    parameter_class=ApproachParameters,
    values={
        "motor.R_m": paper(0.5, _HERE),
        "motor.L_m": paper(1e-3, _HERE),
        "motor.K_e": paper(0.02, _HERE),
        "d_rot": paper(0.1, _HERE),
        "i_gear": paper(1131.167, _DM),
        "k_p": paper(1e5, _DM),
        "k_i": paper(1e4, _DM),
        "T_sample": paper(1e-4, _HERE),
        "x_0": paper(5e-3, _DM),
    },
)
