"""Numbers of the wedge brake's adjuster: of its law, in a life as in the ECU, and of its screw."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from bywire.core.provenance import Cited, chosen, derived

LAW: Mapping[str, Cited] = MappingProxyType(
    {
        "gap_nominal": chosen(0.2e-3, "the clearance of the new brake"),
        "band": chosen(0.1e-3, "7 ms more until the pads touch"),
        "gap_min": chosen(0.13e-3, "what a disc 400 K hotter takes away"),
        "tooth": chosen(0.08e-3, "below the band: it never turns too far"),
        "applications": chosen(3.0, "a single odd application does not turn it"),
        "growth": derived(12e-6 * 28e-3, "12e-6 1/K of cast iron, a disc of 28 mm"),
        "T_cold": chosen(293.15, "20 degC"),
        "fault": chosen("none", "sound"),
    }
)
"""what a life and the ECU have in common"""

IN_ECU: Mapping[str, Cited] = MappingProxyType(
    {
        "adjuster.law": chosen("none", "the paper wants one for its next prototype"),
        "adjuster.tooth": LAW["tooth"],
        "adjuster.tau_turn": chosen(
            3e-3, "a small geared motor's, short beside a sample of its law"
        ),
        **{f"control.adjuster.{name}": value for name, value in LAW.items()},
        "control.adjuster.T_adjust": chosen(
            0.02, "short beside an application, and time for a tooth"
        ),
        "control.adjuster.ways": chosen("both", "clearance taken in error is given back"),
        "control.adjuster.T_disc_hat": chosen(293.15, "20 degC: on the stand no disc warms"),
    }
)
"""parameters of the brake; but for what depends on the wedge's slope"""
