"""Fault campaign: every fault of the brake during a stop from 80 km/h."""

from __future__ import annotations

from bywire.authoring import DeclaredCampaign

CAMPAIGN = DeclaredCampaign(
    "truck-ebs",
    "every fault of the truck's brake during a stop from 80 km/h",
    {
        "bench": "ebs-stop",
        "vary": {"disc.mu": "+-10 %", "corner.body.m": "+-10 %"},
        "campaign": {"onset": "1 s", "spread": "0.5 s", "onsets": 2, "healthy": 64},
        "criteria": [
            {"name": "longer stop", "signal": "v_x", "above_healthy": "2 m/s", "lasting": "0.3 s"}
        ],
    },
)
PARKING = DeclaredCampaign(
    "truck-park",
    "every fault of the truck's brake while all air is lost on a slope",
    {
        "bench": "park",
        "vary": {"disc.mu": "+-10 %", "corner.body.m": "+-10 %"},
        "campaign": {"onset": "1 s", "spread": "0.1 s", "onsets": 1, "healthy": 16},
        "criteria": [
            {"name": "rolls away", "signal": "s", "below_healthy": "0.1 m", "lasting": "0.1 s"}
        ],
    },
)
