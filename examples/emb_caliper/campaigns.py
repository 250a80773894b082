"""Fault campaign: every fault of the brake while it holds a clamp force."""

from __future__ import annotations

from bywire.authoring import DeclaredCampaign


def _campaign(name: str, parameters: str, summary: str) -> DeclaredCampaign:
    """Return the campaign of a brake that has an estimate to fall back on."""
    return DeclaredCampaign(
        name,
        summary,
        {
            "bench": "clamp-step",
            "set": {
                "parameters": parameters,
                "options.F_to": "20 kN",
                "options.duration": "0.7 s",
            },
            "vary": {
                "friction.C": "+-10 %",
                "friction.G": "+-10 %",
                "caliper.k_1": {
                    "kind": "tolerance",
                    "tolerance": "3 %",
                    "together": ["caliper.k_2", "caliper.k_3"],
                },
            },
            "campaign": {"onset": "0.3 s", "spread": "50 ms", "onsets": 2, "healthy": 64},
            "criteria": [
                {
                    "name": "loss of clamp force",
                    "signal": "F_cl",
                    "below_share": "80 %",
                    "lasting": "50 ms",
                },
                {
                    "name": "too much clamp force",
                    "signal": "F_cl",
                    "above_healthy": "4 kN",
                    "lasting": "20 ms",
                },
            ],
        },
    )


CAMPAIGN = _campaign(
    "emb-caliper",
    "emb42v-fallback",
    "every fault of the caliper with a DC motor while it holds 20 kN",
)
PMSM = _campaign(
    "emb-caliper-pmsm",
    "emb42v-pmsm-fallback",
    "every fault of the caliper with a synchronous motor while it holds 20 kN",
)
